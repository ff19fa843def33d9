/* global THREE */
// Points of contact, coloured by what they do, and the impulses of impacts and of events of the
// deck, as msahl/post/view/happenings.py describes them.
import { Arrow } from "./arrows.js";
import { placeOf } from "./motion.js";

export const CONTACT_STATES = [
  ["open", "#adb5bd"],
  ["closed", "#1c7ed6"],
  ["sticks", "#2f9e44"],
  ["slides", "#f08c00"],
];
const IMPULSE_COLOUR = "#c2255c";
const CONTACT_SIZE = 0.013; // radius of a point that is closed, divided by the size of the model
const OPEN_SIZE = 0.5; // that of one that is open, divided by that
const LARGEST_IMPULSE = 0.3; // length of the arrow of the largest impulse, divided by the size of the model
const IMPULSE_SHOWN = 1 / 60; // part of the run for which an impulse is shown, at least an output interval
const MOST_IMPULSES = 40; // arrows at one time

export class Contacts {
  constructor(model, happenings) {
    this.model = model;
    this.root = new THREE.Group();
    model.root.add(this.root);
    this.contacts = happenings?.contacts ?? [];
    this.impulses = happenings?.impulses ?? [];
    this.times = this.impulses.map(({ time }) => time);
    // Of the bodies with their shapes: points of the model may be close together.
    const [low, high] = model.scene.extent;
    const size = (this.size = Math.max(model.scene.size, Math.hypot(...high.map((x, i) => x - low[i]))));
    const ball = new THREE.SphereGeometry(CONTACT_SIZE * size, 20, 14);
    this.points = this.contacts.map(() => {
      // In front of what touches: the point is inside of both surfaces.
      const material = new THREE.MeshBasicMaterial({ depthTest: false, transparent: true });
      const point = new THREE.Mesh(ball, material);
      point.renderOrder = 2;
      this.root.add(point);
      return point;
    });
    this.arrows = { 1: [], 2: [] }; // by their number of heads
    this.largest = { 1: 0, 2: 0 };
    for (const { angular, size: given } of this.impulses) {
      const heads = angular ? 2 : 1;
      this.largest[heads] = Math.max(this.largest[heads], Math.abs(given));
    }
    const { outputs, end } = model.motion;
    const interval = outputs.length > 1 ? outputs[1] - outputs[0] : 0;
    this.shown = Math.max(IMPULSE_SHOWN * end, interval);
  }

  get isEmpty() {
    return this.contacts.length + this.impulses.length === 0;
  }

  // States that a contact ever has.
  get states() {
    return new Set(this.contacts.flatMap(({ states }) => states));
  }

  show(time) {
    if (!this.root.visible) return;
    this.contacts.forEach((contact, index) => {
      const state = contact.states[placeOf(contact.times, time)];
      const point = this.points[index];
      point.position.copy(this.placeOf(contact).point);
      point.material.color.set(CONTACT_STATES[state][1]);
      point.material.opacity = state === 0 ? 0.6 : 1;
      point.scale.setScalar(state === 0 ? OPEN_SIZE : 1);
    });
    this.showImpulses(time);
  }

  // Draws the impulses of the last while, the latest first.
  showImpulses(time) {
    for (const arrow of [...this.arrows[1], ...this.arrows[2]]) arrow.object.visible = false;
    const used = { 1: 0, 2: 0 };
    for (let i = placeOf(this.times, time); i >= 0 && i < this.times.length && used[1] + used[2] < MOST_IMPULSES; i--) {
      if (this.times[i] > time || this.times[i] < time - this.shown) break;
      const impulse = this.impulses[i];
      const heads = impulse.angular ? 2 : 1;
      const arrow = (this.arrows[heads][used[heads]] ??= this.newArrow(heads));
      used[heads]++;
      const { point, normal } = impulse.contact < 0 ? this.given(impulse) : this.placeOf(this.contacts[impulse.contact]);
      arrow.set(point, normal.multiplyScalar(impulse.size), (LARGEST_IMPULSE * this.size) / this.largest[heads]);
    }
  }

  // An arrow in front of all: impulses begin at surfaces, and lead into bodies.
  newArrow(heads) {
    const arrow = new Arrow(IMPULSE_COLOUR, this.size, heads, this.root);
    Object.assign(arrow.material, { depthTest: false, transparent: true });
    arrow.object.traverse((part) => (part.renderOrder = 3));
    return arrow;
  }

  given({ body, point, direction, basis }) {
    return { point: this.model.pointOf(body, point), normal: this.turned(basis, direction) };
  }

  turned(body, direction) {
    const vector = new THREE.Vector3(...direction);
    return body < 0 ? vector : vector.applyQuaternion(this.model.bodies[body].quaternion);
  }

  // The point of a contact, and its normal: that along which the parent pushes the child.
  placeOf(contact) {
    const { shape, parent, child, radius, sign } = contact;
    const a = this.model.pointOf(parent, contact.parentPoint);
    const b = this.model.pointOf(child, contact.childPoint);
    if (shape === "joint") return { point: b, normal: this.turned(parent, contact.axis).multiplyScalar(sign) };
    if (shape === "box") return this.onBox(contact, a, b);
    if (shape === "curve") return this.onCurve(contact, b);
    const axis = contact.axis && this.turned(parent, contact.axis);
    if (shape === "capsules") return this.betweenCapsules(contact, a, b, axis);
    if (shape === "plane") return { point: b.addScaledVector(axis, -radius), normal: axis };
    if (shape === "rim") {
      const about = this.turned(child, contact.rim);
      const down = about.multiplyScalar(axis.dot(about)).sub(axis);
      return { point: down.length() > 1e-9 ? b.addScaledVector(down.normalize(), radius) : b, normal: axis };
    }
    const normal = b.clone().sub(a);
    if (axis) normal.addScaledVector(axis, -normal.dot(axis));
    const foot = axis ? b.clone().sub(normal) : a;
    normal.normalize();
    return { point: foot.addScaledVector(normal, radius), normal: normal.multiplyScalar(sign) };
  }

  // Between the nearest points of the middle lines.
  betweenCapsules({ child, rim, half, radius }, a, b, axis) {
    const other = this.turned(child, rim);
    const way = b.clone().sub(a);
    const within = (x, most) => Math.min(Math.max(x, -most), most);
    const [p, q, s] = [way.dot(axis), way.dot(other), axis.dot(other)];
    let u = within((p - s * q) / Math.max(1 - s * s, 1e-15), half[0]);
    const w = within(s * u - q, half[1]);
    u = within(p + s * w, half[0]);
    const foot = a.clone().addScaledVector(axis, u);
    const normal = b.clone().addScaledVector(other, w).sub(foot).normalize();
    return { point: foot.addScaledVector(normal, radius), normal };
  }

  onBox({ parent, axes, half, radius }, a, b) {
    const along = [0, 1, 2].map((i) => this.turned(parent, axes.slice(3 * i, 3 * i + 3)));
    const way = b.clone().sub(a);
    const nearest = a.clone();
    along.forEach((axis, i) => nearest.addScaledVector(axis, Math.min(Math.max(way.dot(axis), -half[i]), half[i])));
    const normal = b.clone().sub(nearest).normalize();
    return { point: nearest.addScaledVector(normal, radius), normal };
  }

  // The nearest point of a curve, in the axes of its body; a pin of some radius touches towards it.
  onCurve({ parent, curve, axis, radius }, b) {
    const way = b.clone().sub(this.model.pointOf(parent, [0, 0, 0]));
    const from = (point) => new THREE.Vector3(...point);
    const units = [from([1, 0, 0]), from([0, 1, 0]), from([0, 0, 1])];
    const pin = from(units.map((unit) => way.dot(this.turned(parent, unit.toArray()))));
    const up = from(axis);
    pin.addScaledVector(up, -pin.clone().sub(from(curve[0])).dot(up));
    let [least, nearest, along] = [Infinity, null, null];
    for (let i = 1; i < curve.length; i++) {
      const [start, span] = [from(curve[i - 1]), from(curve[i]).sub(from(curve[i - 1]))];
      const part = pin.clone().sub(start).dot(span) / Math.max(span.lengthSq(), 1e-300);
      const foot = start.addScaledVector(span, Math.min(Math.max(part, 0), 1));
      const distance = foot.distanceTo(pin);
      if (distance < least) [least, nearest, along] = [distance, foot, span];
    }
    // Of a point on the curve the direction is that across it, away from what is on its left.
    const normal = radius > 0 ? pin.sub(nearest) : along.cross(up);
    return {
      point: this.model.pointOf(parent, nearest.toArray()),
      normal: this.turned(parent, normal.normalize().toArray()),
    };
  }
}
