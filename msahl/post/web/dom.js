// Elements of the page, built without markup: a text can never become an element.

// Returns an element; `settings` are attributes, listeners (onclick: f) and `text`.
export function make(tag, settings = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(settings)) {
    if (name === "text") element.textContent = value;
    else if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== undefined && value !== null) element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

// Paths of icons, in a square of 24.
const ICONS = {
  play: "M8 5.5v13l10.5-6.5z",
  pause: "M7 5h3.5v14H7zM13.5 5H17v14h-3.5z",
  back: "M7 5h2.2v14H7zM18.5 5.5v13L9.5 12z",
  next: "M14.8 5H17v14h-2.2zM5.5 5.5v13l9-6.5z",
  loop: "M17 4l3.5 3L17 10V8H8a3.5 3.5 0 0 0-3.5 3.5V13h-2v-1.500A5.5 5.5 0 0 1 8 6h9zM7 20l-3.5-3L7 14v2h9a3.5 3.5 0 0 0 3.5-3.500V11h2v1.500A5.5 5.5 0 0 1 16 18H7z",
  fit: "M4 4h6v2H6v4H4zM14 4h6v6h-2V6h-4zM4 14h2v4h4v2H4zM18 14h2v6h-6v-2h4z",
  tree: "M4 5h4v4H4zM11 6h9v2h-9zM7 10h2v3h3v-1h4v4h-4v-1H9v3h3v-1h4v4h-4v-1H7z",
  graph: "M4 4h2v14h14v2H4zM8.3 15.7 7 14.300l4-5 4 3 4-6 1.6 1.2-5 7.3-4-3z",
  camera: "M9 5h6l1.5 2H20v12H4V7h3.500zM12 9a4 4 0 1 0 0 8 4 4 0 0 0 0-8zm0 2a2 2 0 1 1 0 4 2 2 0 0 1 0-4z",
  film: "M4 6h11v12H4zM17 10l4-3v10l-4-3z",
  sun: "M12 7.500a4.5 4.5 0 1 0 0 9 4.5 4.5 0 0 0 0-9zM11 2h2v3h-2zM11 19h2v3h-2zM2 11h3v2H2zM19 11h3v2h-3zM4.2 5.600l1.4-1.4 2.1 2.1-1.4 1.400zM16.3 17.700l1.4-1.4 2.1 2.1-1.4 1.400zM4.2 18.400l2.1-2.1 1.4 1.4-2.1 2.100zM16.3 6.300l2.1-2.1 1.4 1.4-2.1 2.100z",
  help: "M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18zm-1 13h2v2h-2zm1-10a3.8 3.8 0 0 1 3.8 3.800c0 2.4-2.8 2.7-2.8 5h-2c0-3.3 2.8-3.2 2.8-5a1.8 1.8 0 0 0-3.6 0h-2A3.8 3.8 0 0 1 12 6z",
  eye: "M12 5C7 5 3.3 8.6 1.5 12 3.3 15.4 7 19 12 19s8.7-3.6 10.5-7C20.7 8.6 17 5 12 5zm0 2c3.6 0 6.5 2.4 8.2 5-1.7 2.6-4.6 5-8.2 5s-6.5-2.4-8.2-5C5.5 9.4 8.4 7 12 7zm0 2a3 3 0 1 0 0 6 3 3 0 0 0 0-6z",
  path: "M4 18c3 0 3-12 8-12s5 9 8 9v2c-5 0-5-9-8-9s-3 12-8 12zM3 17h3v3H3z",
  target: "M11 2h2v3.100A7 7 0 0 1 18.9 11H22v2h-3.100A7 7 0 0 1 13 18.900V22h-2v-3.100A7 7 0 0 1 5.1 13H2v-2h3.100A7 7 0 0 1 11 5.100zM12 7a5 5 0 1 0 0 10 5 5 0 0 0 0-10zm0 3a2 2 0 1 1 0 4 2 2 0 0 1 0-4z",
  close: "M6.4 5 12 10.6 17.6 5 19 6.4 13.4 12l5.6 5.6-1.4 1.400L12 13.4 6.4 19 5 17.6 10.6 12 5 6.400z",
};

export function icon(name) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 24 24");
  svg.setAttribute("aria-hidden", "true");
  const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  path.setAttribute("d", ICONS[name]);
  path.setAttribute("fill-rule", "evenodd");
  svg.append(path);
  return svg;
}

// Returns a button with an icon; its title says what it does, and by which key.
export function iconButton(name, title, action, settings = {}) {
  return make("button", { type: "button", title, "aria-label": title, onclick: action, ...settings }, icon(name));
}

export function setIcon(button, name) {
  button.replaceChildren(icon(name));
}

// Offers a file for download.
export function download(blob, name) {
  const link = make("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
