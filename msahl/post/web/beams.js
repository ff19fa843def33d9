/* global THREE */
// Elastic beams: their outline, swept along the polynomials through the nodes as they stand.
import { WIDTH } from "./motion.js";

// What a beam can be coloured by: its name, its unit, and the value of six stress resultants.
export const RESULTANTS = {
  n1: ["Normal force", "N", (r) => r[0]],
  shear: ["Shear force", "N", (r) => Math.hypot(r[1], r[2])],
  m1: ["Torque", "N m", (r) => r[3]],
  bending: ["Bending moment", "N m", (r) => Math.hypot(r[4], r[5])],
};
// Blue, green, yellow: as dark as bright in grey (the colours of viridis).
const SCALE = ["#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#fde725"];

export class Beam {
  constructor(entry, look) {
    this.entry = entry;
    this.elements = entry.lengths.length;
    this.perElement = entry.rings.length - 1;
    this.rings = this.elements * this.perElement + 1;
    this.corners = entry.outlines[0].length / 2;
    this.length = entry.lengths.reduce((a, b) => a + b, 0);
    const geometry = new THREE.BufferGeometry();
    for (const name of ["position", "color"]) {
      geometry.setAttribute(name, new THREE.BufferAttribute(new Float32Array(3 * this.rings * this.corners), 3));
    }
    geometry.setIndex(this.faces());
    this.colour = look.tint ?? entry.colour;
    const material = new THREE.MeshStandardMaterial({
      color: this.colour, metalness: 0.05, roughness: 0.55, flatShading: true, side: THREE.DoubleSide,
      transparent: look.opacity < 1, opacity: look.opacity, depthWrite: look.opacity >= 1,
    });
    this.object = new THREE.Mesh(geometry, material);
    this.object.castShadow = this.object.receiveShadow = look.opacity >= 1;
    this.object.frustumCulled = false;
    this.object.userData = { kind: "body", name: entry.name };
    this.scale = SCALE.map((colour) => new THREE.Color(colour));
    this.resultant = null;
    this.range = [0, 0];
  }

  // Triangles of the surface and of both ends.
  faces() {
    const n = this.corners;
    const found = [];
    for (let k = 0; k + 1 < this.rings; k++) {
      for (let c = 0; c < n; c++) {
        const [a, b] = [k * n + c, k * n + ((c + 1) % n)];
        found.push(a, b, b + n, a, b + n, a + n);
      }
    }
    const last = (this.rings - 1) * n;
    for (let c = 1; c + 1 < n; c++) found.push(0, c + 1, c, last, last + c, last + c + 1);
    return found;
  }

  // Positions and directions d_1, d_2, d_3 of the nodes: twelve numbers for each.
  nodes(poses) {
    return this.entry.nodes.map((body) => {
      const at = body * WIDTH;
      const [w, x, y, z] = [poses[at + 3], poses[at + 4], poses[at + 5], poses[at + 6]];
      return [
        poses[at], poses[at + 1], poses[at + 2],
        1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y),
        2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x),
        2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y),
      ];
    });
  }

  // Moves the surface to the poses of all bodies.
  show(poses) {
    const nodes = this.nodes(poses);
    const position = this.object.geometry.attributes.position;
    const [from, to] = this.entry.outlines;
    let station = 0;
    for (let e = 0; e < this.elements; e++) {
      for (let k = e ? 1 : 0; k <= this.perElement; k++) {
        const at = combined(this.entry.rings[k], nodes, e * this.entry.degree);
        const share = (station + (k / this.perElement) * this.entry.lengths[e]) / this.length;
        const [s2, s3] = [Math.hypot(at[6], at[7], at[8]), Math.hypot(at[9], at[10], at[11])];
        for (let c = 0; c < this.corners; c++) {
          const y = ((1 - share) * from[2 * c] + share * to[2 * c]) / s2;
          const z = ((1 - share) * from[2 * c + 1] + share * to[2 * c + 1]) / s3;
          position.setXYZ(
            (e * this.perElement + k) * this.corners + c,
            at[0] + y * at[6] + z * at[9], at[1] + y * at[7] + z * at[10], at[2] + y * at[8] + z * at[11],
          );
        }
      }
      station += this.entry.lengths[e];
    }
    position.needsUpdate = true;
    this.object.geometry.boundingSphere = null; // for the pointer
    this.object.geometry.boundingBox = null;
    if (this.resultant) this.paint(this.values(nodes));
  }

  // The chosen resultant at every ring: by its values at the Gauss points of each element.
  values(nodes) {
    const { degree, values, slopes, fromPoints, lengths } = this.entry;
    const found = new Float64Array(this.rings);
    const of = RESULTANTS[this.resultant][2];
    for (let e = 0; e < this.elements; e++) {
      const at = values.map((row, g) => {
        const d = combined(row, nodes, e * degree);
        const rate = combined(slopes[g], nodes, e * degree).map((x) => (2 * x) / lengths[e]);
        return this.resultants(e * degree + g, d, rate);
      });
      for (let k = 0; k <= this.perElement; k++) {
        const six = [0, 1, 2, 3, 4, 5].map((i) => fromPoints[k].reduce((sum, w, g) => sum + w * at[g][i], 0));
        const ring = e * this.perElement + k;
        found[ring] = e && !k ? 0.5 * (found[ring] + of(six)) : of(six);
      }
    }
    return found;
  }

  // n and m at a Gauss point from directors `d` and slopes of positions and directors.
  resultants(point, d, rate) {
    const dot = (a, i, b, j) => a[i] * b[j] + a[i + 1] * b[j + 1] + a[i + 2] * b[j + 2];
    const half = (i, j) => 0.5 * (dot(d, j, rate, i) - dot(d, i, rate, j));
    const strain = [dot(d, 3, rate, 0), dot(d, 6, rate, 0), dot(d, 9, rate, 0), half(6, 9), half(9, 3), half(3, 6)];
    strain[0] += 0.5 * (1 - dot(d, 3, d, 3));
    const eps = strain.map((value, i) => value - this.entry.strain[point][i]);
    const K = this.entry.stiffness[point];
    return eps.map((_, i) => eps.reduce((sum, value, j) => sum + K[6 * i + j] * value, 0));
  }

  paint(values) {
    const colour = this.object.geometry.attributes.color;
    const [low, high] = this.range;
    const made = new THREE.Color();
    values.forEach((value, ring) => {
      const share = high > low ? Math.min(Math.max((value - low) / (high - low), 0), 1) : 0;
      const place = Math.min(Math.floor(share * (SCALE.length - 1)), SCALE.length - 2);
      made.lerpColors(this.scale[place], this.scale[place + 1], share * (SCALE.length - 1) - place);
      for (let c = 0; c < this.corners; c++) colour.setXYZ(ring * this.corners + c, made.r, made.g, made.b);
    });
    colour.needsUpdate = true;
  }

  // Colours the beam by a resultant, null: by its own colour.
  setResultant(resultant, range) {
    this.resultant = resultant;
    this.range = range;
    const { material } = this.object;
    material.vertexColors = resultant !== null;
    material.color.set(resultant === null ? this.colour : "#ffffff");
    material.needsUpdate = true;
  }
}

// The sum of the nodes of an element, from number `first` on, by weights.
function combined(weights, nodes, first) {
  const sum = new Float64Array(12);
  weights.forEach((weight, a) => {
    const node = nodes[first + a];
    for (let i = 0; i < 12; i++) sum[i] += weight * node[i];
  });
  return sum;
}
