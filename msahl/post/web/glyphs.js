/* global THREE */
// What stands for joints, motions and markers: each is drawn as what it does.
import { bar, place, solid } from "./shapes.js";
import { Coil } from "./coil.js";

const STEEL = "#8b95a3";
const DARK = "#4a525e";
const MOTOR = "#d6336c";

// Returns the object of a joint in the axes of its parent, and that in the axes of its child.
// `size` is the scene's; `travel` the least and greatest displacement of the child along the axis.
export function jointObjects(joint, size, travel, look) {
  const unit = 0.012 * size;
  const fixed = new THREE.Group();
  const moving = new THREE.Group();
  fixed.position.set(...joint.parentPoint);
  moving.position.set(...joint.childPoint);
  if (joint.axis) fixed.quaternion.copy(turnTo(joint.axis));
  if (joint.childAxis) moving.quaternion.copy(turnTo(joint.childAxis));
  const steel = solid(look.tint ?? STEEL, { ...look, metalness: 0.35, roughness: 0.4 });
  const dark = solid(look.tint ?? DARK, { ...look, metalness: 0.3, roughness: 0.5 });
  const draw = DRAWN[joint.glyph];
  if (draw) draw({ fixed, moving, steel, dark, unit, travel, joint });
  return { fixed, moving };
}

const mesh = (geometry, material) => {
  const made = new THREE.Mesh(geometry, material);
  made.castShadow = true;
  return made;
};

// Cylinders, rings and springs of glyphs stand along z, the joint's axis.
const tube = (radius, length, material, at = 0) => {
  const made = mesh(new THREE.CylinderGeometry(radius, radius, length, 28).rotateX(Math.PI / 2), material);
  made.position.z = at;
  return made;
};
const ball = (radius, material) => mesh(new THREE.SphereGeometry(radius, 28, 18), material);
const box = (x, y, z, material) => mesh(new THREE.BoxGeometry(x, y, z), material);
const ring = (radius, thickness, material) => mesh(new THREE.TorusGeometry(radius, thickness, 12, 36), material);

function rail({ fixed, travel, unit, steel }, section) {
  const from = travel[0] - 4 * unit;
  const to = travel[1] + 4 * unit;
  const made = section(to - from, steel);
  made.position.z = (from + to) / 2;
  fixed.add(made);
}

function translucent(material, opacity = 0.35) {
  const made = material.clone();
  made.transparent = true;
  made.opacity = opacity * material.opacity;
  made.depthWrite = false;
  made.side = THREE.DoubleSide;
  return made;
}

const DRAWN = {
  axis: ({ fixed, moving, steel, dark, unit }) => {
    moving.add(tube(1.5 * unit, 3 * unit, steel));
    fixed.add(tube(0.8 * unit, 5 * unit, dark));
  },
  ball: ({ fixed, moving, steel, dark, unit }) => {
    moving.add(ball(1.6 * unit, steel));
    fixed.add(ring(1.75 * unit, 0.4 * unit, dark));
  },
  slide: (all) => {
    const { moving, unit, dark } = all;
    rail(all, (length, material) => box(0.9 * unit, 0.9 * unit, length, material));
    moving.add(box(2.4 * unit, 2.4 * unit, 4 * unit, dark));
  },
  cylinder: (all) => {
    const { moving, unit, dark } = all;
    rail(all, (length, material) => tube(0.6 * unit, length, material));
    moving.add(tube(1.5 * unit, 4 * unit, dark));
  },
  cross: ({ fixed, moving, steel, dark, unit }) => {
    fixed.add(tube(0.7 * unit, 5 * unit, steel));
    moving.add(tube(0.7 * unit, 5 * unit, steel));
    fixed.add(ball(1.2 * unit, dark));
  },
  fixed: ({ fixed, dark, unit }) => {
    fixed.add(box(2.4 * unit, 2.4 * unit, 2.4 * unit, dark));
  },
  plane: ({ fixed, moving, steel, dark, unit }) => {
    fixed.add(box(16 * unit, 16 * unit, 0.2 * unit, translucent(steel)));
    moving.add(tube(1.5 * unit, 0.6 * unit, dark));
  },
  thread: (all) => {
    const { fixed, moving, unit, dark, steel, travel } = all;
    rail(all, (length, material) => tube(0.6 * unit, length, material));
    const thread = new Coil(0.75 * unit, 0.2 * unit, 14, steel);
    thread.between(
      new THREE.Vector3(0, 0, travel[0] - 4 * unit),
      new THREE.Vector3(0, 0, travel[1] + 4 * unit),
    );
    fixed.add(thread.object);
    moving.add(tube(1.7 * unit, 3 * unit, dark));
  },
  contact: ({ fixed, steel, unit }) => {
    fixed.add(ring(1.5 * unit, 0.25 * unit, steel));
  },
  line: (all) => {
    const { moving, unit, dark } = all;
    rail(all, (length, material) => tube(0.5 * unit, length, material));
    moving.add(ball(1.4 * unit, dark));
  },
  rod: ({ fixed, moving, dark, unit }) => {
    fixed.add(ball(1.2 * unit, dark));
    moving.add(ball(1.2 * unit, dark));
  },
  knife: ({ moving, steel, unit }) => {
    moving.add(box(6 * unit, 0.3 * unit, 3 * unit, steel));
  },
};

// Returns the rotation that takes z to a direction.
export function turnTo(direction) {
  const along = new THREE.Vector3(...direction).normalize();
  return new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 0, 1), along);
}

// Returns a curved arrow around z for a motion by an angle, a straight one for a slide.
export function motionObject(coordinate, size, look) {
  const unit = 0.012 * size;
  const material = solid(look.tint ?? MOTOR, look);
  const group = new THREE.Group();
  const head = mesh(new THREE.ConeGeometry(0.9 * unit, 2 * unit, 16), material);
  if (coordinate === "angle") {
    const arc = new THREE.TorusGeometry(3.2 * unit, 0.3 * unit, 10, 40, 1.5 * Math.PI);
    group.add(mesh(arc, material));
    head.position.set(0.6 * unit, -3.2 * unit, 0);
    head.rotation.z = -Math.PI / 2;
  } else {
    group.add(tube(0.3 * unit, 6 * unit, material, 6 * unit));
    head.position.z = 9.5 * unit;
    head.rotation.x = Math.PI / 2;
  }
  group.add(head);
  return group;
}

// Returns three short axes: x red, y green, z blue.
export function axesObject(length, look) {
  const group = new THREE.Group();
  ["#e03131", "#2f9e44", "#1c7ed6"].forEach((colour, axis) => {
    const end = [0, 0, 0];
    end[axis] = length;
    const material = new THREE.MeshBasicMaterial({
      color: colour,
      transparent: look.opacity < 1,
      opacity: look.opacity,
    });
    const line = bar([0, 0, 0], end, 0.022 * length, material, 8);
    line.castShadow = false;
    const head = new THREE.Mesh(new THREE.ConeGeometry(0.06 * length, 0.2 * length, 12), material);
    head.position.set(...end);
    head.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), new THREE.Vector3(...end).normalize());
    group.add(line, head);
  });
  return group;
}

export function markerObject(marker, size, look) {
  return place(axesObject(0.05 * size, look), marker.point, marker.orientation);
}
