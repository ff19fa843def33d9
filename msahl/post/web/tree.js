// The panel of what the model consists of, and of what is shown.
import { RESULTANTS } from "./beams.js";
import { iconButton, make } from "./dom.js";
import { SCALES } from "./elastic.js";

// `viewer` is the Viewer whose parts are shown and hidden.
export function buildTree(viewer) {
  const scene = viewer.models[0].scene;
  const panel = make("div", { class: "tree" });
  const parts = [
    make("div", { class: "panel-head" }, make("h2", { text: "Model" }),
      iconButton("close", "Close", () => viewer.setPanel("tree", false), { class: "plain" })),
    switches(viewer),
    section("Bodies", scene.bodies.map((body, index) => body.beam === null && !body.hidden && bodyRow(viewer, body, index)).filter(Boolean)),
    section("Beams", scene.beams.map((beam) => row(viewer, "body", beam.name, `${beam.nodes.length} nodes`))),
    colouring(viewer),
    deforming(viewer),
    section("Joints", scene.joints.map((joint) => row(viewer, "joint", joint.name, joint.kind))),
    section("Motions", scene.motions.map((motion) => row(viewer, "motion", motion.name, motion.coordinate ?? "point"))),
    section("Springs", scene.springs.map((spring) => row(viewer, "spring", spring.name, spring.glyph === "drum" ? "damper" : spring.glyph))),
    section("Loads", scene.loads.map((load) => row(viewer, "load", load.name, load.kind))),
    section("Markers", scene.markers.map((marker) => row(viewer, "marker", marker.name, ""))),
  ];
  panel.append(...parts.filter(Boolean));
  return panel;
}

// The choice of what beams are coloured by, with its range.
function colouring(viewer) {
  if (!viewer.models[0].beams.length) return null;
  const range = make("small", { class: "range" });
  const select = make("select", { title: "Colour beams by a stress resultant" },
    make("option", { value: "", text: "Beams in their own colours" }),
    ...Object.entries(RESULTANTS).map(([key, [name]]) => make("option", { value: key, text: `Colour: ${name}` })));
  select.onchange = () => {
    const [low, high] = viewer.colourBeams(select.value || null);
    const shown = (value) => Number(value.toPrecision(3)).toLocaleString("en", { maximumSignificantDigits: 3 });
    range.textContent = select.value ? `${shown(low)} to ${shown(high)} ${RESULTANTS[select.value][1]}` : "";
    range.classList.toggle("scale", Boolean(select.value));
  };
  return make("div", { class: "colouring" }, select, range);
}

// The choice of how much larger the deformation of elastic bodies is drawn than it is.
function deforming(viewer) {
  if (!viewer.models[0].elastic.length) return null;
  const options = SCALES.map((scale) => make("option", { value: String(scale), text: `Deformation × ${scale}` }));
  const select = make("select", { title: "Draw the deformation larger than it is" }, ...options);
  select.onchange = () => viewer.deform(Number(select.value));
  return make("div", { class: "colouring" }, select);
}

function section(title, rows) {
  if (!rows.length) return null;
  const head = make("summary", {}, make("span", { text: title }), make("small", { text: String(rows.length) }));
  const made = make("details", {}, head, make("ul", {}, ...rows));
  made.open = rows.length <= 14;
  return made;
}

function row(viewer, kind, name, what) {
  return selectable(viewer, kind, name, make("small", { text: what }));
}

// A row whose name selects the element.
function selectable(viewer, kind, name, ...rest) {
  const select = () => viewer.select(viewer.isSelected(kind, name) ? null : { kind, name });
  const text = make("button", { type: "button", class: "what", text: name, title: name, onclick: select });
  const made = make("li", {}, text, ...rest);
  viewer.onUpdate(() => {
    const isSelected = viewer.isSelected(kind, name);
    if (isSelected && !made.classList.contains("selected")) made.scrollIntoView({ block: "nearest" });
    made.classList.toggle("selected", isSelected);
  });
  return made;
}

function bodyRow(viewer, body, index) {
  const dot = make("i", { class: "dot", title: `${body.mass.toPrecision(4)} kg` });
  dot.style.background = body.colour;
  const pressed = (button, isOn) => button.setAttribute("aria-pressed", String(isOn));
  const path = iconButton("path", "Show or hide the path of the mass centre", () => {
    viewer.setTrace(index, !viewer.hasTrace(index));
  });
  const follow = iconButton("target", "Follow this body with the camera", () => {
    viewer.follow(viewer.followed === index ? null : index);
  });
  const eye = iconButton("eye", "Show or hide this body", () => {
    viewer.setBody(index, !viewer.models[0].bodies[index].visible);
  });
  const made = selectable(viewer, "body", body.name, path, follow, eye);
  made.prepend(dot);
  viewer.onUpdate(() => {
    pressed(path, viewer.hasTrace(index));
    pressed(follow, viewer.followed === index);
    pressed(eye, viewer.models[0].bodies[index].visible);
    made.classList.toggle("hidden-body", !viewer.models[0].bodies[index].visible);
  });
  return made;
}

function switches(viewer) {
  const made = make("div", { class: "switches" });
  for (const [key, text, letter] of viewer.switches()) {
    const button = make("button", { type: "button", text, title: letter ? `Key ${letter}` : text, onclick: () => viewer.toggle(key) });
    viewer.onUpdate(() => button.setAttribute("aria-pressed", String(viewer.isOn(key))));
    made.append(button);
  }
  if (viewer.hasArrows) {
    const scale = make("input", { type: "range", min: "-1", max: "1", step: "0.05", value: "0", "aria-label": "Length of the arrows" });
    scale.addEventListener("input", () => viewer.setArrowScale(10 ** Number(scale.value)));
    const label = make("label", { class: "scale" }, make("span", { text: "Arrows" }), scale);
    viewer.onUpdate(() => (label.hidden = !viewer.isOn("arrows")));
    made.append(label);
  }
  return made;
}
