// The panel of what the model consists of, and of what is shown.
import { iconButton, make } from "./dom.js";

// `viewer` is the Viewer whose parts are shown and hidden.
export function buildTree(viewer) {
  const scene = viewer.models[0].scene;
  const panel = make("div", { class: "tree" });
  const parts = [
    make("div", { class: "panel-head" }, make("h2", { text: "Model" }),
      iconButton("close", "Close", () => viewer.setPanel("tree", false), { class: "plain" })),
    switches(viewer),
    section("Bodies", scene.bodies.map((body, index) => bodyRow(viewer, body, index))),
    section("Joints", scene.joints.map((joint) => row(viewer, joint.name, joint.kind))),
    section("Motions", scene.motions.map((motion) => row(viewer, motion.name, "motion"))),
    section("Springs", scene.springs.map((spring) => row(viewer, spring.name, spring.glyph))),
    section("Loads", scene.loads.map((load) => row(viewer, load.name, load.kind))),
    section("Markers", scene.markers.map((marker) => row(viewer, marker.name, ""))),
  ];
  panel.append(...parts.filter(Boolean));
  return panel;
}

function section(title, rows) {
  if (!rows.length) return null;
  const head = make("summary", {}, make("span", { text: title }), make("small", { text: String(rows.length) }));
  const made = make("details", {}, head, make("ul", {}, ...rows));
  made.open = rows.length <= 14;
  return made;
}

function row(viewer, name, kind) {
  const text = make("span", { class: "what", text: name, title: name });
  return make("li", { "data-name": name }, text, make("small", { text: kind }));
}

function bodyRow(viewer, body, index) {
  const dot = make("i", { class: "dot" });
  dot.style.background = body.colour;
  const name = make("span", { class: "what", text: body.name, title: `${body.name}: ${body.mass.toPrecision(4)} kg` });
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
  const made = make("li", { "data-name": body.name }, dot, name, path, follow, eye);
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
