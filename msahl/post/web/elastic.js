/* global THREE */
// Reduced elastic bodies: their skin, moved by the amplitudes of their modes, times a scale.
import { WIDTH } from "./motion.js";

export const SCALES = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];

export class Elastic {
  constructor(entry, look) {
    this.entry = entry;
    this.scale = 1;
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(entry.points.length), 3));
    geometry.setIndex(entry.triangles);
    const material = new THREE.MeshStandardMaterial({
      color: look.tint ?? entry.colour, metalness: 0.05, roughness: 0.55, flatShading: true, side: THREE.DoubleSide,
      transparent: look.opacity < 1, opacity: look.opacity, depthWrite: look.opacity >= 1,
    });
    this.object = new THREE.Mesh(geometry, material);
    this.object.castShadow = this.object.receiveShadow = look.opacity >= 1;
    this.object.frustumCulled = false;
    this.object.userData = { kind: "body", name: entry.name };
  }

  // The amplitudes: displacements of carriers along the axes of the frame.
  amplitudes(poses) {
    const { frame, carriers, rest } = this.entry;
    const axes = axesOf(poses, frame * WIDTH);
    return carriers.map(([body, axis], j) => {
      let sum = -rest[j];
      for (let i = 0; i < 3; i++) sum += axes[3 * axis + i] * (poses[body * WIDTH + i] - poses[frame * WIDTH + i]);
      return sum;
    });
  }

  // Moves the skin to the poses of all bodies.
  show(poses) {
    const { frame, points, shapes } = this.entry;
    const position = this.object.geometry.attributes.position;
    const moved = Float64Array.from(points);
    this.amplitudes(poses).forEach((a, j) => {
      const size = this.scale * a;
      for (let i = 0, at = j * points.length; i < points.length; i++) moved[i] += size * shapes[at + i];
    });
    position.array.set(moved);
    position.needsUpdate = true;
    const at = frame * WIDTH;
    this.object.position.set(poses[at], poses[at + 1], poses[at + 2]);
    this.object.quaternion.set(poses[at + 4], poses[at + 5], poses[at + 6], poses[at + 3]);
    this.object.geometry.boundingSphere = null; // for the pointer
    this.object.geometry.boundingBox = null;
  }
}

// The axes x, y, z of a pose, one after the other, in inertial axes.
function axesOf(poses, at) {
  const [w, x, y, z] = [poses[at + 3], poses[at + 4], poses[at + 5], poses[at + 6]];
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y),
    2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x),
    2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y),
  ];
}
