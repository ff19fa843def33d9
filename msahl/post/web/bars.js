// The bars above and below the view, and the list of keys.
import { iconButton, make, setIcon } from "./dom.js";
import { phaseText } from "./modes.js";
import { FASTEST, SLOWEST } from "./player.js";

const SPEEDS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100];
const PARTIAL = "The run stopped early and is shown up to its last row.";
const VIEW_NAMES = [
  ["home", "Whole motion (0)"], ["front", "Front (1)"], ["back", "Back (2)"], ["left", "Left (3)"],
  ["right", "Right (4)"], ["top", "Top (5)"], ["bottom", "Bottom (6)"], ["corner", "Corner (7)"],
];
const KEYS = [
  ["Space", "play, pause"], ["← →", "one output time back, forward"], ["Shift ← →", "ten output times"],
  ["Home, End", "begin, end"], ["+ −", "faster, slower"], ["L", "loop"], ["0 – 7", "standard views"],
  ["N A T", "names, axes, paths"], ["R J S", "forces, joints, springs"], ["C", "contacts and impulses"], ["X D", "see through bodies, grid"],
  ["G M", "graph, model"], ["P", "picture of this frame"], ["Esc", "select and follow nothing"],
];

// Changes the speed to the next of the list.
export function setSpeedBy(player, steps) {
  let place = SPEEDS.findIndex((speed) => speed >= 0.999 * player.speed);
  if (place < 0) place = SPEEDS.length - 1;
  player.setSpeed(SPEEDS[Math.min(Math.max(place + steps, 0), SPEEDS.length - 1)]);
}

export function buildTop(viewer) {
  const { runs, data } = viewer;
  // In a report the title of the page says what is shown.
  const heading = data.isPage ? make("h1", { text: runs[0].scene.title || runs[0].name || "Model" }) : null;
  const title = make("div", { class: "titles" }, heading);
  const names = runs.map((run, index) => make("span", { class: `run-name run-${index + 1}`, text: run.name ?? "", title: run.note ?? "" }));
  if (runs.length > 1 || (data.isPage && runs[0].name)) title.append(make("p", {}, ...names));
  for (const run of runs) {
    if (data.isPage && run.isPartial) title.append(make("p", { class: "warning", text: PARTIAL }));
    for (const note of run.scene.notes ?? []) title.append(make("p", { class: "warning", text: note }));
  }
  const views = make("select", { "aria-label": "Standard view", title: "Standard view" });
  views.append(make("option", { value: "", text: "View" }));
  for (const [value, text] of VIEW_NAMES) views.append(make("option", { value, text }));
  views.addEventListener("change", () => {
    if (views.value) viewer.setView(views.value);
    views.value = "";
  });
  const buttons = make("div", { class: "buttons" });
  const pressing = (button, isOn) => {
    viewer.onUpdate(() => button.setAttribute("aria-pressed", String(isOn())));
    return button;
  };
  buttons.append(pressing(iconButton("tree", "Model (M)", () => viewer.setPanel("tree")), () => viewer.hasPanel("tree")));
  if (viewer.hasGraph) {
    buttons.append(pressing(iconButton("graph", "Graph (G)", () => viewer.setPanel("graph")), () => viewer.hasPanel("graph")));
  }
  buttons.append(views, iconButton("fit", "Show the whole motion (0)", () => viewer.setView("home")));
  buttons.append(iconButton("camera", "Save a picture (P)", () => viewer.savePicture()));
  if (viewer.canFilm) {
    const film = iconButton("film", "Save a film from this time to the end, at this speed (WebM)", () => viewer.saveFilm());
    buttons.append(pressing(film, () => Boolean(viewer.isFilming)));
  }
  if (data.isPage) buttons.append(iconButton("sun", "Light or dark", () => {}, { class: "theme" }));
  buttons.append(iconButton("help", "Keys and accuracy (?)", () => (viewer.help.hidden = !viewer.help.hidden)));
  return make("div", { class: "top" }, title, buttons);
}

export function buildBar(viewer) {
  const { player } = viewer;
  const play = iconButton("play", "Play or pause (Space)", () => player.play(), { class: "play" });
  const loop = iconButton("loop", "Loop (L)", () => {
    player.isLoop = !player.isLoop;
    viewer.invalidate();
  });
  const scrub = make("input", { type: "range", class: "scrub", min: 0, max: player.end, step: "any", value: 0, "aria-label": "Time" });
  scrub.addEventListener("input", () => {
    player.isPlaying = false;
    player.scrub(Number(scrub.value));
  });
  const clock = make("output", { class: "clock" });
  const speed = speedMenu(player);
  const digits = Math.max(0, Math.min(6, 3 - Math.floor(Math.log10(player.end))));
  viewer.onUpdate(() => {
    if (play.dataset.state !== String(player.isPlaying)) {
      play.dataset.state = String(player.isPlaying);
      setIcon(play, player.isPlaying ? "pause" : "play");
    }
    loop.setAttribute("aria-pressed", String(player.isLoop));
    scrub.value = player.time;
    scrub.style.setProperty("--part", `${(100 * player.time) / player.end}%`);
    const total = `${Number(player.end.toPrecision(6))} s`;
    clock.textContent = viewer.hasModes ? phaseText(player.time) : `${player.time.toFixed(digits)} / ${total}`;
    if (document.activeElement !== speed) speed.value = String(player.speed);
  });
  return make("div", { class: "bar" },
    iconButton("back", "One output time back (←)", () => player.step(-1)), play,
    iconButton("next", "One output time forward (→)", () => player.step(1)), scrub, clock, speed, loop);
}

function speedMenu(player) {
  const made = make("select", { class: "speed", "aria-label": "Speed", title: `Speed, ${SLOWEST} to ${FASTEST} (+ and −)` });
  for (const speed of SPEEDS) made.append(make("option", { value: String(speed), text: `${speed}×` }));
  made.addEventListener("change", () => {
    player.setSpeed(Number(made.value));
    made.blur();
  });
  return made;
}

export function buildHelp(viewer) {
  const list = make("dl");
  const keys = viewer.hasModes ? [...KEYS, ["Page Up, Down", "mode before, after"]] : KEYS;
  for (const [key, text] of keys) list.append(make("dt", { text: key }), make("dd", { text }));
  const close = iconButton("close", "Close", () => (viewer.help.hidden = true), { class: "plain" });
  const notes = viewer.runs.map((run) => (run.note ? make("p", { class: "note", text: run.note }) : null));
  return make("div", { class: "help", role: "dialog", "aria-label": "Keys and accuracy" },
    make("div", { class: "panel-head" }, make("h2", { text: "Keys" }), close), list,
    make("p", { class: "note", text: "Drag to orbit, drag with the right button (or two fingers) to pan, wheel or pinch to zoom." }),
    notes.some(Boolean) ? make("h2", { text: "Accuracy of what is shown" }) : null, ...notes.filter(Boolean));
}
