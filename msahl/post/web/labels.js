/* global THREE */
// Names of bodies beside them, and of what the pointer is over.
import { make } from "./dom.js";

export class Labels {
  constructor(holder, model) {
    this.holder = holder;
    this.model = model;
    this.isShown = false;
    const { bodies, beams } = model.scene;
    const middles = new Map(beams.map(({ name, nodes }) => [nodes[nodes.length >> 1], name]));
    this.texts = bodies.map((body, index) => {
      const text = body.hidden ? "" : body.beam === null ? body.name : middles.get(index); // of a beam at its middle
      return make("span", { class: "name", text: text ?? "" });
    });
    this.tip = make("span", { class: "name tip" });
    this.tip.hidden = true;
    holder.append(...this.texts, this.tip);
    this.point = new THREE.Vector3();
  }

  // Puts the names where the mass centres are seen.
  show(camera, width, height) {
    this.texts.forEach((text, index) => {
      const body = this.model.scene.bodies[index];
      text.hidden = !this.isShown || !text.textContent || !this.model.bodies[index].visible;
      if (text.hidden) return;
      this.model.pointOf(index, body.centre, this.point).project(camera);
      text.hidden = Math.abs(this.point.z) > 1;
      const x = 0.5 * (1 + this.point.x) * width;
      const y = 0.5 * (1 - this.point.y) * height;
      text.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(9px, -50%)`;
    });
  }

  tipAt(found, x, y) {
    this.tip.hidden = !found;
    if (!found) return;
    this.tip.textContent = found.kind === "body" ? found.name : `${found.name} (${found.what ?? found.kind})`;
    this.tip.style.transform = `translate(${x + 14}px, ${y + 12}px)`;
  }
}

// What is under the pointer: the data of the nearest object, null if there is none.
export function pick(model, camera, x, y) {
  const caster = new THREE.Raycaster();
  caster.setFromCamera(new THREE.Vector2(x, y), camera);
  for (const hit of caster.intersectObjects(model.targets(), true)) {
    for (let object = hit.object; object; object = object.parent) {
      if (object.visible === false) break;
      if (object.userData.name) return object.userData;
    }
  }
  return null;
}
