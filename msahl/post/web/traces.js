/* global THREE */
// The paths of mass centres: faint over the whole run, bright up to the time shown.
import { setPose } from "./model3d.js";
import { WIDTH } from "./motion.js";

const POINTS = 1200;

export class Traces {
  constructor(model) {
    this.model = model;
    this.root = new THREE.Group();
    this.lines = new Map();
    model.root.add(this.root);
  }

  has(body) {
    return this.lines.has(body);
  }

  set(body, isShown) {
    if (isShown && !this.has(body)) this.lines.set(body, this.trace(body));
    if (!isShown && this.has(body)) {
      this.root.remove(this.lines.get(body).group);
      this.lines.delete(body);
    }
  }

  trace(body) {
    const { motion, scene, look } = this.model;
    const positions = new Float32Array(3 * POINTS);
    const carrier = new THREE.Group();
    const point = new THREE.Vector3();
    for (let i = 0; i < POINTS; i++) {
      setPose(carrier, motion.at((motion.end * i) / (POINTS - 1)), body * WIDTH);
      carrier.updateMatrix();
      point.set(...scene.bodies[body].centre).applyMatrix4(carrier.matrix).toArray(positions, 3 * i);
    }
    const attribute = new THREE.BufferAttribute(positions, 3);
    const colour = look.tint ?? scene.bodies[body].colour;
    const made = new THREE.Group();
    const [whole, past] = [0.3, 1].map((opacity) => {
      const geometry = new THREE.BufferGeometry().setAttribute("position", attribute);
      const material = new THREE.LineBasicMaterial({ color: colour, transparent: true, opacity: opacity * look.opacity });
      const line = new THREE.Line(geometry, material);
      line.raycast = () => {};
      line.frustumCulled = false;
      made.add(line);
      return line;
    });
    this.root.add(made);
    return { group: made, whole, past };
  }

  show(time) {
    const part = Math.min(time / (this.model.motion.end || 1), 1);
    for (const { past } of this.lines.values()) past.geometry.setDrawRange(0, 1 + Math.floor(part * (POINTS - 1)));
  }
}
