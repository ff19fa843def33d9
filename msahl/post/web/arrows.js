/* global THREE */
// Arrows of reactions and loads: their length is proportional to the force or moment at the time.

const ARROW_COLOURS = { force: "#e8590c", moment: "#7048e8", load: "#099268" };
const SAMPLED = 160; // times at which forces are looked at to choose the scale
const LONGEST = 1.5; // of an arrow, divided by the size of the model
const HEAD = 0.035; // of an arrow, likewise
const HEAD_APART = 0.8; // distance of the two heads of a moment, divided by the length of one

export class Arrow {
  constructor(colour, size, heads, parent) {
    this.material = new THREE.MeshBasicMaterial({ color: colour });
    this.size = size;
    this.object = new THREE.Group();
    this.shaft = new THREE.Mesh(new THREE.CylinderGeometry(0.004 * size, 0.004 * size, 1, 10), this.material);
    this.heads = Array.from({ length: heads }, () => {
      return new THREE.Mesh(new THREE.ConeGeometry(0.012 * size, HEAD * size, 14), this.material);
    });
    this.object.add(this.shaft, ...this.heads);
    parent.add(this.object);
  }

  // Draws a vector from a point; `scale` is the length of a unit.
  set(point, vector, scale) {
    const length = Math.min(vector.length() * scale, LONGEST * this.size);
    this.object.visible = length > 0.01 * this.size;
    if (!this.object.visible) return;
    this.object.position.copy(point);
    this.object.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), vector.clone().normalize());
    // Heads of a short arrow are smaller: none begins behind the point.
    const shrunk = Math.min(1, length / (HEAD * this.size * (1 + HEAD_APART * (this.heads.length - 1))));
    const head = shrunk * HEAD * this.size;
    const shaft = Math.max(length - head, 1e-9 * this.size);
    this.shaft.scale.set(shrunk, shaft, shrunk);
    this.shaft.position.y = 0.5 * shaft;
    this.heads.forEach((cone, index) => {
      cone.scale.setScalar(shrunk);
      cone.position.y = length - head * (0.5 + HEAD_APART * index);
    });
  }
}

export class Arrows {
  // Forces and moments of the joints on their children, and loads with a constant direction.
  constructor(model, columns) {
    this.model = model;
    this.columns = columns;
    this.root = new THREE.Group();
    this.root.visible = false;
    model.root.add(this.root);
    this.scale = 1;
    this.unit = model.scene.size;
    this.entries = [];
    if (columns) model.scene.joints.forEach((joint) => this.addReaction(joint));
    model.scene.loads.forEach((load) => this.addLoad(load));
    this.lengths = {};
    for (const kind of ["force", "moment"]) this.lengths[kind] = this.usual(kind);
  }

  // Makes arrows of two runs comparable: equal forces have equal lengths.
  static share(all) {
    const [{ model }] = all;
    for (const arrows of all) arrows.unit = model.scene.size;
    for (const kind of ["force", "moment"]) {
      const largest = Math.max(...all.map(({ lengths }) => lengths[kind]));
      for (const { lengths } of all) lengths[kind] = largest;
    }
  }

  get isEmpty() {
    return this.entries.length === 0;
  }

  addReaction(joint) {
    for (const [letter, kind, heads] of [["F", "force", 1], ["M", "moment", 2]]) {
      const places = ["x", "y", "z"].map((axis) => this.place(`${joint.name}.${letter}${axis}`));
      if (places.includes(undefined)) continue;
      const arrow = new Arrow(ARROW_COLOURS[kind], this.model.scene.size, heads, this.root);
      this.entries.push({ arrow, kind, places, body: joint.child, point: joint.childPoint });
    }
  }

  addLoad(load) {
    for (const [key, heads] of [["force", 1], ["moment", 2]]) {
      if (load[key] === null || load.body === null) continue;
      const arrow = new Arrow(ARROW_COLOURS.load, this.model.scene.size, heads, this.root);
      const factor = load.varies ? this.place(`${load.name}.factor`) : undefined;
      const vector = new THREE.Vector3(...load[key]);
      // Forces and moments have no common unit: each is drawn relative to itself.
      this.entries.push({ arrow, kind: "load", vector, factor, basis: load[`${key}Basis`], body: load.body, point: load.point });
    }
  }

  place(name) {
    return this.columns?.places.get(name);
  }

  // What an arrow of ordinary length stands for: in three of four instants the longest is shorter.
  usual(kind) {
    const entries = this.entries.filter((entry) => entry.kind === kind && entry.places);
    if (!entries.length) return 0;
    const { times } = this.columns;
    const most = Array.from({ length: SAMPLED }, (_, i) => {
      const time = (times[times.length - 1] * i) / (SAMPLED - 1);
      return Math.max(...entries.map(({ places }) => Math.hypot(...places.map((place) => this.columns.at(place, time)))));
    });
    most.sort((a, b) => a - b);
    return most[Math.floor(0.75 * SAMPLED)] || most[SAMPLED - 1];
  }

  show(time) {
    if (!this.root.visible) return;
    const vector = new THREE.Vector3();
    const point = new THREE.Vector3();
    for (const { arrow, kind, places, vector: constant, factor, basis, body, point: at } of this.entries) {
      if (places) vector.set(...places.map((place) => this.columns.at(place, time)));
      else {
        vector.copy(constant);
        if (factor !== undefined) vector.multiplyScalar(this.columns.at(factor, time));
        if (basis >= 0) vector.applyQuaternion(this.model.bodies[basis].quaternion);
      }
      const unit = constant ? 0.15 / (constant.length() || 1) : 0.2 / (this.lengths[kind] || 1);
      arrow.set(this.model.pointOf(body, at, point), vector, this.scale * unit * this.unit);
    }
  }
}
