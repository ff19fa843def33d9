/* global THREE */
// One run in three dimensions: its bodies, joints, springs and arrows, moved to the poses of a time.
import { Beam } from "./beams.js";
import { Elastic } from "./elastic.js";
import { axesObject, jointObjects, markerObject, motionObject, turnTo } from "./glyphs.js";
import { Coil } from "./coil.js";
import { Damper, drumObject } from "./damper.js";
import { WIDTH } from "./motion.js";
import { bar, shapeObject, solid, stretch } from "./shapes.js";

const SPRING = "#6c7683";
const SPRINGS = { bushing: "bushing", damper: "damper", drum: "damper", strut: "spring and damper" };
const DOT = 0.004; // radius of a dot divided by its distance from the camera
const CLOSE = 10; // size of a glyph divided by the distance of joints of a body
export const GLOW = "#1c7ed6";
const PAINTED = 120; // times at which resultants of beams are looked at
const SAMPLES = 240; // times at which the extent of the motion is looked at

export class Model3d {
  // `look` is { opacity, tint }: of the second run of an overlay translucent, in one colour.
  constructor(scene, motion, look) {
    Object.assign(this, { scene, motion, look });
    this.root = new THREE.Group();
    this.parts = { joints: group(this.root), springs: group(this.root), frames: group(this.root) };
    this.movers = []; // functions of the poses' groups, called after these have moved
    this.ground = group(this.root);
    this.bodies = scene.bodies.map((body, index) => this.body(body, index));
    this.beams = scene.beams.map((entry) => new Beam(entry, look));
    // Scenes of stored motions may be older than elastic bodies.
    this.elastic = (scene.elastic ?? []).map((entry) => new Elastic(entry, look));
    this.skins = [...this.beams, ...this.elastic];
    for (const { object } of this.skins) this.root.add(object);
    for (const shape of scene.ground.shapes) {
      this.ground.add(shapeObject(shape, "#9aa3ad", look));
    }
    this.sizes = scene.joints.map((joint) => sizeAt(joint, scene));
    this.surveyMotion();
    this.dots = this.buildDots();
    scene.joints.forEach((joint, index) => this.joint(joint, index));
    scene.motions.forEach((motion) => this.motionGlyph(motion));
    scene.springs.forEach((spring) => this.spring(spring));
    this.markers();
    this.show(0);
  }

  body(body, index) {
    const made = group(this.root);
    made.userData = { kind: "body", name: body.beam === null ? body.name : this.scene.beams[body.beam].name };
    for (const shape of body.shapes) {
      const colour = this.look.tint ?? shape.colour ?? body.colour;
      const drawn = shapeObject({ ...shape, colour: null }, colour, this.look);
      drawn.userData = made.userData;
      made.add(drawn);
    }
    if (body.hidden) return made;
    const axes = axesObject((body.beam === null ? 0.09 : 0.03) * this.scene.size, this.look);
    axes.userData.isFrame = true;
    axes.visible = false;
    made.add(axes);
    return made;
  }

  // Dots for bodies that are too small to be seen from afar.
  buildDots() {
    const geometry = new THREE.SphereGeometry(1, 16, 12);
    return this.scene.bodies.map((body, index) => {
      const material = new THREE.MeshBasicMaterial({ color: this.look.tint ?? body.colour });
      const dot = new THREE.Mesh(geometry, material);
      dot.userData = this.bodies[index].userData;
      this.root.add(dot);
      return dot;
    });
  }

  // Gives the dots their size on the screen; larger bodies need none.
  showDots(camera) {
    this.dots.forEach((dot, index) => {
      this.pointOf(index, this.scene.bodies[index].centre, dot.position);
      const size = DOT * camera.position.distanceTo(dot.position);
      const { beam, hidden } = this.scene.bodies[index]; // of a node its beam is drawn
      dot.visible = beam === null && !hidden && this.bodies[index].visible && this.radii[index].radius < size;
      dot.scale.setScalar(size);
    });
  }

  // The object of a body by its number; -1 is the ground.
  holder(index) {
    return index < 0 ? this.ground : this.bodies[index];
  }

  // Poses at a time: moves everything that depends on them.
  show(time) {
    const poses = this.motion.at(time);
    this.bodies.forEach((body, index) => setPose(body, poses, index * WIDTH));
    for (const skin of this.skins) skin.show(poses);
    for (const { object, entry } of this.elastic) object.visible = this.bodies[entry.frame].visible;
    this.root.updateMatrixWorld();
    for (const move of this.movers) move(time);
  }

  // Colours all beams by a resultant (see beams.js), null: by none. Returns its least and greatest
  // value during the motion.
  colourBeams(resultant) {
    const range = [Infinity, -Infinity];
    for (const beam of this.beams) beam.setResultant(resultant, [0, 0]);
    if (resultant) {
      for (const time of this.times(PAINTED)) {
        const poses = this.motion.at(time);
        for (const beam of this.beams) {
          for (const value of beam.values(beam.nodes(poses))) {
            range[0] = Math.min(range[0], value);
            range[1] = Math.max(range[1], value);
          }
        }
      }
    }
    for (const beam of this.beams) beam.setResultant(resultant, range);
    return range;
  }

  // Scales the displacements of elastic bodies in their frames.
  deform(scale) {
    for (const body of this.elastic) body.scale = scale;
  }

  // Evenly spaced times of the motion.
  times(count) {
    const { motion } = this;
    return Array.from({ length: motion.isStill ? 1 : count }, (_, i) => (motion.end * i) / (count - 1));
  }

  // A point of a body in inertial axes, as it stands now.
  pointOf(index, point, into = new THREE.Vector3()) {
    return into.set(...point).applyMatrix4(this.holder(index).matrixWorld);
  }

  // Finds the box of the whole motion, and the travel of sliding joints.
  surveyMotion() {
    const { motion, scene } = this;
    this.box = new THREE.Box3();
    this.travel = scene.joints.map(() => [0, 0]);
    this.radii = this.bodies.map((body, index) =>
      radiusOf(body, scene.beams[scene.bodies[index].beam], scene.elastic?.find(({ frame }) => frame === index)));
    const poses = new THREE.Vector3();
    const sphere = new THREE.Sphere();
    for (const time of this.times(SAMPLES)) {
      const now = motion.at(time);
      this.bodies.forEach((body, index) => setPose(body, now, index * WIDTH));
      this.root.updateMatrixWorld();
      this.bodies.forEach((body, index) => {
        sphere.center.copy(this.radii[index].center).applyMatrix4(body.matrixWorld);
        sphere.radius = this.radii[index].radius;
        this.box.union(sphere.getBoundingBox(new THREE.Box3()));
      });
      scene.joints.forEach((joint, index) => {
        if (!joint.axis || joint.joints) return;
        this.pointOf(joint.child, joint.childPoint, poses);
        const inParent = this.holder(joint.parent).worldToLocal(poses).sub(new THREE.Vector3(...joint.parentPoint));
        const slide = inParent.dot(new THREE.Vector3(...joint.axis));
        this.travel[index] = [Math.min(this.travel[index][0], slide), Math.max(this.travel[index][1], slide)];
      });
    }
    for (const joint of scene.joints) {
      if (joint.parent < 0) this.box.expandByPoint(this.pointOf(-1, joint.parentPoint, poses));
    }
    for (const spring of scene.springs) {
      if (spring.a < 0) this.box.expandByPoint(this.pointOf(-1, spring.aPoint, poses));
      if (spring.b < 0) this.box.expandByPoint(this.pointOf(-1, spring.bPoint, poses));
    }
    this.ground.children.forEach((child) => this.box.expandByObject(child));
  }

  joint(joint, index) {
    if (joint.joints) return; // a coupling acts between joints that are drawn already
    const { fixed, moving } = jointObjects(joint, this.sizes[index], this.travel[index], this.look);
    const name = { kind: "joint", name: joint.name, what: joint.kind };
    for (const [part, body] of [[fixed, joint.parent], [moving, joint.child]]) {
      part.traverse((child) => (child.userData = name));
      this.follow(part, body, this.parts.joints);
    }
    if (joint.glyph === "rod") {
      const rod = bar([0, 0, 0], [0, 1, 0], 0.006 * this.sizes[index], solid("#8b95a3", this.look));
      rod.userData = name;
      this.parts.joints.add(rod);
      this.movers.push(() => {
        stretch(rod, this.pointOf(joint.parent, joint.parentPoint), this.pointOf(joint.child, joint.childPoint));
      });
    }
  }

  // Makes an object of a part of the scene move with a body. It is no child of the body's object,
  // so that kinds of parts and bodies are shown and hidden apart.
  follow(object, body, part) {
    const carrier = group(part);
    carrier.add(object);
    if (body < 0) return;
    const source = this.bodies[body];
    this.movers.push(() => {
      carrier.position.copy(source.position);
      carrier.quaternion.copy(source.quaternion);
    });
  }

  motionGlyph(motion) {
    if (motion.joint === null) return;
    const joint = this.scene.joints[motion.joint];
    if (!joint.axis) return;
    const glyph = motionObject(motion.coordinate, this.sizes[motion.joint], this.look);
    glyph.position.set(...joint.parentPoint);
    glyph.quaternion.copy(turnTo(joint.axis));
    glyph.traverse((child) => (child.userData = { kind: "motion", name: motion.name }));
    this.follow(glyph, joint.parent, this.parts.joints);
  }

  spring(spring) {
    const size = this.scene.size;
    const material = solid(this.look.tint ?? SPRING, { ...this.look, metalness: 0.4, roughness: 0.35 });
    const name = { kind: "spring", name: spring.name, what: SPRINGS[spring.glyph] ?? "spring" };
    if (spring.glyph === "bushing") {
      const rubber = new THREE.Mesh(new THREE.TorusGeometry(0.028 * size, 0.013 * size, 14, 36), solid("#30363d", this.look));
      rubber.position.set(...spring.aPoint);
      rubber.userData = name;
      this.follow(rubber, spring.a, this.parts.springs);
    } else if (spring.glyph === "torsion") {
      const spiral = spiralObject(0.05 * size, 0.003 * size, material);
      spiral.position.set(...spring.aPoint);
      if (spring.axis) spiral.quaternion.copy(turnTo(spring.axis));
      spiral.traverse((child) => (child.userData = name));
      this.follow(spiral, spring.a, this.parts.springs);
    } else if (spring.glyph === "drum") {
      const drum = drumObject(0.035 * size, material);
      drum.position.set(...spring.aPoint);
      if (spring.axis) drum.quaternion.copy(turnTo(spring.axis));
      drum.traverse((child) => (child.userData = name));
      this.follow(drum, spring.a, this.parts.springs);
    } else {
      const parts = [];
      if (spring.glyph !== "damper") parts.push(new Coil(0.022 * size, 0.0045 * size, 9, material));
      if (spring.glyph !== "coil") parts.push(new Damper((spring.glyph === "damper" ? 0.02 : 0.011) * size, 0.05 * size, this.look));
      for (const part of parts) {
        part.object.traverse((child) => (child.userData = name));
        this.parts.springs.add(part.object);
      }
      const [a, b] = [new THREE.Vector3(), new THREE.Vector3()];
      this.movers.push(() => {
        this.pointOf(spring.a, spring.aPoint, a);
        this.pointOf(spring.b, spring.bPoint, b);
        for (const part of parts) part.between(a, b);
      });
    }
  }

  markers() {
    for (const marker of this.scene.markers) {
      const object = markerObject(marker, this.scene.size, this.look);
      object.traverse((child) => (child.userData = { kind: "marker", name: marker.name }));
      this.follow(object, marker.body, this.parts.frames);
    }
  }

  // Lets the objects of one element glow; null: of none.
  highlight(found) {
    this.root.traverse(({ userData, material }) => {
      if (!material?.emissive) return;
      const isFound = found !== null && userData.kind === found.kind && userData.name === found.name;
      material.emissive.set(isFound ? GLOW : "#000000");
      material.emissiveIntensity = isFound ? 0.75 : 0;
    });
  }

  // Makes bodies translucent, so that what is inside them is seen.
  setSeeThrough(isOn) {
    for (const body of [...this.bodies, ...this.skins.map((skin) => skin.object)]) {
      body.traverse((child) => {
        if (!child.material?.isMeshStandardMaterial) return;
        child.material.transparent = isOn || this.look.opacity < 1;
        child.material.opacity = isOn ? 0.32 * this.look.opacity : this.look.opacity;
        child.material.depthWrite = !child.material.transparent;
      });
    }
  }

  // Whether a body's derived shape contains another body: it would hide it.
  get hasHidden() {
    this.show(0);
    const centre = new THREE.Vector3();
    return this.bodies.some((body, outer) =>
      body.children.some((child, place) => {
        if (child.userData.isFrame || !this.scene.bodies[outer].shapes[place]?.derived) return false;
        return this.scene.bodies.some((other, inner) => {
          if (inner === outer) return false;
          child.worldToLocal(this.pointOf(inner, other.centre, centre));
          const room = child.geometry.boundingBox.clone().expandByScalar(-0.6 * this.radii[inner].radius);
          return !room.isEmpty() && room.containsPoint(centre);
        });
      }),
    );
  }

  // Objects that the pointer can be over.
  targets() {
    const all = [...this.bodies, ...this.skins.map((skin) => skin.object), this.parts.joints, this.parts.springs, this.parts.frames, this.ground];
    return all.filter((part) => part.visible);
  }
}

export function setPose(object, poses, at) {
  object.position.set(poses[at], poses[at + 1], poses[at + 2]);
  object.quaternion.set(poses[at + 4], poses[at + 5], poses[at + 6], poses[at + 3]);
}

// The length to which a joint's glyph is relative: the scene's size, but smaller where joints of a
// body are close together.
function sizeAt(joint, scene) {
  const ends = (one) => [[one.parent, one.parentPoint], [one.child, one.childPoint]];
  let size = scene.size;
  for (const other of scene.joints) {
    if (other === joint || other.joints) continue;
    for (const [body, point] of ends(joint)) {
      for (const [another, there] of ends(other)) {
        const distance = Math.hypot(...point.map((x, axis) => x - there[axis]));
        if (body >= 0 && body === another && distance > 1e-6 * scene.size) size = Math.min(size, CLOSE * distance);
      }
    }
  }
  return size;
}

function group(parent) {
  const made = new THREE.Group();
  parent.add(made);
  return made;
}

// The sphere around a body's shapes, in its axes.
function radiusOf(body, beam, elastic) {
  const box = new THREE.Box3();
  for (const child of body.children) {
    if (child.userData.isFrame) continue;
    child.updateMatrix();
    child.geometry.computeBoundingBox();
    box.union(child.geometry.boundingBox.clone().applyMatrix4(child.matrix));
  }
  for (const outline of beam?.outlines ?? []) {
    for (let i = 0; i < outline.length; i += 2) box.expandByPoint(new THREE.Vector3(0, outline[i], outline[i + 1]));
  }
  for (let i = 0; i < (elastic?.points.length ?? 0); i += 3) {
    box.expandByPoint(new THREE.Vector3(...elastic.points.slice(i, i + 3)));
  }
  if (box.isEmpty()) box.setFromCenterAndSize(new THREE.Vector3(), new THREE.Vector3());
  return box.getBoundingSphere(new THREE.Sphere());
}

// A flat spiral around z.
function spiralObject(radius, thickness, material) {
  const points = [];
  for (let i = 0; i <= 90; i++) {
    const angle = (i / 90) * 6 * Math.PI;
    const r = radius * (0.25 + (0.75 * i) / 90);
    points.push([r * Math.cos(angle), r * Math.sin(angle), 0]);
  }
  const made = new THREE.Group();
  for (let i = 1; i < points.length; i++) made.add(bar(points[i - 1], points[i], thickness, material, 6));
  return made;
}
