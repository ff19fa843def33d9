// The motion of a mode: poses at rest, moved by the amplitude times Re(shape e^(i phase)), one
// period of which is played again and again. The data is that of msahl/post/view/modes.py.
import { iconButton, make } from "./dom.js";
import { WIDTH } from "./motion.js";
import { unpackIntegers } from "./packing.js";

const PERIOD = 2; // s of a period as it is played
const PHASES = 48; // of a period, for the keys that step
const SHAPE_PARTS = 12; // of a body's shape: real and imaginary parts of x, y, z, rx, ry, rz
const FIRST_SWING = 0.12; // amplitude at first, divided by the size of the scene
const LARGEST_SWING = 0.5; // likewise, at most

// Returns the motion of the modes that a page holds; choose(k) changes the mode that at(t) shows.
export async function readModes(packed, scene) {
  const shapes = await unpackIntegers(packed.shapes);
  const bodies = packed.poses.length / WIDTH;
  const poses = new Float64Array(packed.poses.length);
  const motion = {
    bodies, modes: packed.modes, end: PERIOD, isStill: false, chosen: packed.first ?? 0,
    size: scene.size, amplitude: FIRST_SWING * scene.size,
    outputs: Float64Array.from({ length: PHASES + 1 }, (_, step) => (PERIOD * step) / PHASES),
    at,
  };

  function at(time) {
    const phase = (2 * Math.PI * time) / PERIOD;
    const [real, imaginary] = [motion.amplitude * Math.cos(phase), -motion.amplitude * Math.sin(phase)];
    for (let body = 0; body < bodies; body++) {
      const from = (motion.chosen * bodies + body) * SHAPE_PARTS;
      const part = (k) => packed.unit * (real * shapes[from + 2 * k] + imaginary * shapes[from + 2 * k + 1]);
      const place = body * WIDTH;
      for (let k = 0; k < 3; k++) poses[place + k] = packed.poses[place + k] + part(k);
      rotate(poses, place + 3, packed.poses, [part(3), part(4), part(5)]);
    }
    return poses;
  }

  return motion;
}

// Sets the Euler parameters at a place to those of `before` there, rotated by a rotation vector.
function rotate(poses, at, before, vector) {
  const angle = Math.hypot(...vector);
  const scale = angle > 1e-12 ? Math.sin(angle / 2) / angle : 0.5;
  const [a, b, c, d] = [Math.cos(angle / 2), ...vector.map((x) => scale * x)];
  const [w, x, y, z] = [before[at], before[at + 1], before[at + 2], before[at + 3]];
  poses[at] = a * w - b * x - c * y - d * z;
  poses[at + 1] = a * x + b * w + c * z - d * y;
  poses[at + 2] = a * y - b * z + c * w + d * x;
  poses[at + 3] = a * z + b * y - c * x + d * w;
}

export function phaseText(time) {
  return `${Math.round((360 * time) / PERIOD)}° of a period`;
}

// Returns the bar that chooses the mode and the amplitude, and says what the mode is.
export function buildModes(viewer) {
  const { motion } = viewer.runs[0];
  const names = motion.modes.map((mode, place) => make("option", { value: String(place), text: mode.name }));
  const chooser = make("select", { class: "mode", "aria-label": "Mode", title: "Mode (Page Up, Page Down)" }, ...names);
  const slider = make("input", { type: "range", class: "amplitude", min: 0, max: 1, step: "any", "aria-label": "Amplitude", title: "Amplitude" });
  const facts = make("output", { class: "mode-facts" });
  slider.value = Math.sqrt(FIRST_SWING / LARGEST_SWING);
  slider.addEventListener("input", () => {
    motion.amplitude = LARGEST_SWING * motion.size * Number(slider.value) ** 2;
    viewer.changeMotion();
  });
  const choose = (place) => {
    motion.chosen = Math.min(Math.max(place, 0), motion.modes.length - 1);
    chooser.value = String(motion.chosen);
    facts.textContent = motion.modes[motion.chosen].facts;
    viewer.changeMotion();
  };
  chooser.addEventListener("change", () => {
    choose(Number(chooser.value));
    chooser.blur();
  });
  viewer.stepMode = (count) => choose(motion.chosen + count);
  chooser.value = String(motion.chosen);
  facts.textContent = motion.modes[motion.chosen].facts;
  return make("div", { class: "modes-bar" },
    iconButton("back", "Mode before (Page Up)", () => viewer.stepMode(-1)), chooser,
    iconButton("next", "Mode after (Page Down)", () => viewer.stepMode(1)), facts,
    make("label", { class: "amplitude-label" }, make("span", { text: "Amplitude" }), slider));
}
