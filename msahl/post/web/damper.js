/* global THREE */
// A damper between two points: a cylinder that follows the first, a rod with a piston the second.
import { solid } from "./shapes.js";

const CYLINDER = "#aab2bd";
const ROD = "#3b424c";
// Lengths, by that at first: of the foot, of the cylinder, and of the rod from the piston.
const [FOOT, BARREL, SHAFT] = [0.16, 0.48, 0.44];
const WALL = 0.04; // of the cylinder, which the piston does not enter, by its length

const round = (radius, material) => {
  // Of length 1 along z, from 0.
  const geometry = new THREE.CylinderGeometry(radius, radius, 1, 28).rotateX(Math.PI / 2).translate(0, 0, 0.5);
  const made = new THREE.Mesh(geometry, material);
  made.castShadow = true;
  made.frustumCulled = false; // its length changes
  return made;
};

const setEnds = (mesh, from, to) => {
  mesh.position.z = from;
  mesh.scale.z = Math.max(to - from, 1e-9);
};

export class Damper {
  // `least` is the least length that the proportions are those of.
  constructor(radius, least, look) {
    this.least = least;
    const dark = solid(look.tint ?? ROD, { ...look, metalness: 0.4, roughness: 0.35 });
    const glass = solid(look.tint ?? CYLINDER, { ...look, metalness: 0.3, roughness: 0.3 });
    glass.transparent = true;
    glass.opacity = 0.5 * look.opacity;
    glass.depthWrite = false;
    this.foot = round(0.3 * radius, dark);
    this.floor = round(radius, dark);
    this.barrel = round(radius, glass);
    this.piston = round(0.86 * radius, dark);
    this.shaft = round(0.3 * radius, dark);
    this.object = new THREE.Group();
    this.object.add(this.foot, this.floor, this.piston, this.shaft, this.barrel);
  }

  between(a, b) {
    const along = new THREE.Vector3().subVectors(b, a);
    const length = along.length();
    this.first ??= Math.max(length, this.least);
    this.object.position.copy(a);
    if (length > 0) this.object.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), along.divideScalar(length));
    // A damper that is pushed together farther than its cylinder is drawn smaller.
    const unit = Math.min(this.first, (0.9 * length) / (FOOT + BARREL));
    const [from, to] = [FOOT * unit, (FOOT + BARREL) * unit];
    const wall = WALL * (to - from);
    const piston = Math.min(Math.max(length - SHAFT * this.first, from + 2 * wall), to - 2 * wall);
    setEnds(this.foot, 0, from);
    setEnds(this.floor, from, from + wall);
    setEnds(this.barrel, from, to);
    setEnds(this.piston, piston - wall, piston + wall);
    setEnds(this.shaft, piston, length);
  }
}

// A damper of rotation about z: a drum, and the shaft within it.
export function drumObject(radius, material) {
  const drum = new THREE.Group();
  const [shell, shaft] = [round(radius, material.clone()), round(0.35 * radius, material)];
  shell.material.transparent = true;
  shell.material.opacity *= 0.6;
  setEnds(shell, -0.3 * radius, 0.3 * radius);
  setEnds(shaft, -0.7 * radius, 0.7 * radius);
  drum.add(shaft, shell);
  return drum;
}
