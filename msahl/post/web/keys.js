// Keys of the viewer; bars.js lists them for the user.
import { setSpeedBy } from "./bars.js";

export const VIEWS = ["home", "front", "back", "left", "right", "top", "bottom", "corner"];
const SWITCHES = { n: "names", a: "axes", t: "traces", r: "arrows", c: "contacts", j: "joints", s: "springs", x: "through", d: "floor" };

export function listenToKeys(viewer) {
  // A page that is nothing but a viewer listens everywhere, one in a report where it has the focus.
  const listener = viewer.data.isPage ? document : viewer.element;
  listener.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
    if (act(viewer, event)) event.preventDefault();
  });
}

function isTyping(target) {
  return target instanceof HTMLInputElement && target.type !== "range";
}

// Does what a key means; returns whether it means anything.
function act(viewer, { key: pressed, shiftKey, target }) {
  // Letters mean the same with Shift and Caps Lock.
  const key = pressed.length === 1 ? pressed.toLowerCase() : pressed;
  const { player } = viewer;
  const moves = player.end > 0;
  const on = SWITCHES[key];
  if (on) viewer.toggle(on);
  else if (key >= "0" && key <= "7") viewer.setView(VIEWS[Number(key)]);
  else if (key === " " && moves) {
    if (target instanceof HTMLButtonElement || target instanceof HTMLSelectElement) return false;
    player.play();
  } else if (key === "ArrowRight" && moves) player.step(shiftKey ? 10 : 1);
  else if (key === "ArrowLeft" && moves) player.step(shiftKey ? -10 : -1);
  else if (key === "Home" && moves) player.seek(0);
  else if (key === "End" && moves) player.seek(player.end);
  else if (key === "PageUp" && viewer.hasModes) viewer.stepMode(-1);
  else if (key === "PageDown" && viewer.hasModes) viewer.stepMode(1);
  else if (key === "+" || key === "=") setSpeedBy(player, 1);
  else if (key === "-") setSpeedBy(player, -1);
  else if (key === "l") player.isLoop = !player.isLoop;
  else if (key === "g") viewer.setPanel("graph");
  else if (key === "m") viewer.setPanel("tree");
  else if (key === "p") viewer.savePicture();
  else if (key === "?" || key === "h") viewer.help.hidden = !viewer.help.hidden;
  else if (key === "Escape") {
    viewer.help.hidden = true;
    viewer.follow(null);
    viewer.select(null);
  } else return false;
  viewer.invalidate();
  return true;
}
