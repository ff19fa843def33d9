// What all pages do: switch light and dark, and show everything when printed.
const root = document.documentElement;
const dark = matchMedia("(prefers-color-scheme: dark)");

export const isDark = () =>
  root.dataset.theme ? root.dataset.theme === "dark" : dark.matches;

// Parts that draw on canvases listen to this event of the document and draw again.
const announce = () => document.dispatchEvent(new CustomEvent("msahl-theme"));

for (const button of document.querySelectorAll("button.theme")) {
  button.addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    announce();
  });
}
dark.addEventListener("change", announce);

let folded = [];
addEventListener("beforeprint", () => {
  folded = [...document.querySelectorAll("details:not([open])")];
  for (const part of folded) part.open = true;
});
addEventListener("afterprint", () => {
  for (const part of folded) part.open = false;
});
