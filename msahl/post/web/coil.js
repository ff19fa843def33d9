/* global THREE */
// A wire wound into a coil between two points, which keeps its thickness when it is stretched.

const AROUND = 8;
const PER_TURN = 18;
const END = 0.1; // share of the length that is straight, at each end

export class Coil {
  constructor(radius, thickness, turns, material) {
    Object.assign(this, { radius, thickness, turns });
    this.count = PER_TURN * turns + 3;
    const geometry = new THREE.BufferGeometry();
    for (const name of ["position", "normal"]) {
      const attribute = new THREE.BufferAttribute(new Float32Array(3 * AROUND * this.count), 3);
      geometry.setAttribute(name, attribute.setUsage(THREE.DynamicDrawUsage));
    }
    const index = [];
    for (let i = 0; i + 1 < this.count; i++) {
      for (let k = 0; k < AROUND; k++) {
        const a = i * AROUND + k;
        const b = i * AROUND + ((k + 1) % AROUND);
        index.push(a, a + AROUND, b, b, a + AROUND, b + AROUND);
      }
    }
    geometry.setIndex(index);
    this.object = new THREE.Mesh(geometry, material);
    this.object.castShadow = true;
    this.object.frustumCulled = false; // its bounds change with its length
  }

  // Winds the coil between two points.
  between(a, b) {
    const along = new THREE.Vector3().subVectors(b, a);
    const length = along.length();
    this.object.position.copy(a);
    if (length > 0) {
      this.object.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), along.divideScalar(length));
    }
    this.wind(length);
  }

  // The point of the wire's centre: 0 and 1 are the ends.
  centre(i, length) {
    if (i === 0) return [0, 0, 0];
    if (i === this.count - 1) return [0, 0, length];
    const part = (i - 1) / (this.count - 3);
    const angle = 2 * Math.PI * this.turns * part;
    // The first and last half turn grow from the axis.
    const radius = this.radius * Math.min(1, 2 * this.turns * Math.min(part, 1 - part));
    return [radius * Math.cos(angle), radius * Math.sin(angle), length * (END + (1 - 2 * END) * part)];
  }

  wind(length) {
    const { position, normal } = this.object.geometry.attributes;
    const before = new THREE.Vector3();
    const after = new THREE.Vector3();
    const out = new THREE.Vector3();
    const aside = new THREE.Vector3();
    for (let i = 0; i < this.count; i++) {
      const centre = this.centre(i, length);
      before.set(...this.centre(Math.max(i - 1, 0), length));
      after.set(...this.centre(Math.min(i + 1, this.count - 1), length));
      const along = after.sub(before).normalize();
      const angle = (2 * Math.PI * (i - 1)) / PER_TURN;
      out.set(Math.cos(angle), Math.sin(angle), 0);
      out.addScaledVector(along, -out.dot(along)).normalize();
      aside.crossVectors(along, out);
      for (let k = 0; k < AROUND; k++) {
        const c = Math.cos((2 * Math.PI * k) / AROUND);
        const s = Math.sin((2 * Math.PI * k) / AROUND);
        const at = i * AROUND + k;
        const [x, y, z] = [c * out.x + s * aside.x, c * out.y + s * aside.y, c * out.z + s * aside.z];
        normal.setXYZ(at, x, y, z);
        const t = this.thickness;
        position.setXYZ(at, centre[0] + t * x, centre[1] + t * y, centre[2] + t * z);
      }
    }
    position.needsUpdate = normal.needsUpdate = true;
  }
}
