// What all pages do: switch light and dark, and show everything when printed.
const darkSystem = matchMedia("(prefers-color-scheme: dark)");

// Returns whether the page is shown in dark colours.
export function isDark() {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === "dark" : darkSystem.matches;
}

// Returns the value of a colour of page.css, such as colourOf("ink").
export function colourOf(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

// Parts that draw on canvases listen to this event of the document and draw again.
function announceTheme() {
  document.dispatchEvent(new CustomEvent("msahl-theme"));
}

// Buttons that are made later switch as well.
document.addEventListener("click", (event) => {
  if (!event.target.closest("button.theme")) return;
  document.documentElement.dataset.theme = isDark() ? "light" : "dark";
  announceTheme();
});
darkSystem.addEventListener("change", announceTheme);

// A page is printed in light colours with its folds open.
const beforePrinting = { folds: [], theme: undefined };
addEventListener("beforeprint", () => {
  const { dataset } = document.documentElement;
  beforePrinting.theme = dataset.theme;
  dataset.theme = "light";
  beforePrinting.folds = [...document.querySelectorAll("details:not([open])")];
  for (const part of beforePrinting.folds) part.open = true;
});
addEventListener("afterprint", () => {
  if (beforePrinting.theme) document.documentElement.dataset.theme = beforePrinting.theme;
  else delete document.documentElement.dataset.theme;
  for (const part of beforePrinting.folds) part.open = false;
});
