/* global THREE */
// Bodies of a scene as objects of three.js.

const FACETS = 40;

// Returns the geometry of a shape of a scene, in the shape's axes: axes of revolution along z.
export function shapeGeometry({ kind, size, vertices, faces }) {
  const upright = (geometry) => geometry.rotateX(Math.PI / 2);
  switch (kind) {
    case "box":
      return new THREE.BoxGeometry(...size);
    case "sphere":
      return upright(new THREE.SphereGeometry(size[0], FACETS, FACETS / 2));
    case "capsule":
      return upright(new THREE.CapsuleGeometry(size[0], size[1], 12, FACETS));
    case "cone":
      return upright(new THREE.ConeGeometry(size[0], size[1], FACETS));
    case "mesh":
      return meshGeometry(vertices, faces);
    default:
      return upright(new THREE.CylinderGeometry(size[0], size[0], size[1], FACETS));
  }
}

function meshGeometry(vertices, faces) {
  const indexed = new THREE.BufferGeometry();
  indexed.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(vertices), 3));
  indexed.setIndex(new THREE.BufferAttribute(Uint32Array.from(faces), 1));
  const geometry = indexed.toNonIndexed(); // flat faces: a file's normals are often wrong
  geometry.computeVertexNormals();
  return geometry;
}

// Returns a material; a translucent one for the second run of an overlay.
export function solid(colour, { opacity = 1, metalness = 0.05, roughness = 0.55 } = {}) {
  return new THREE.MeshStandardMaterial({
    color: colour,
    metalness,
    roughness,
    transparent: opacity < 1,
    opacity,
    depthWrite: opacity >= 1,
  });
}

// Puts a pose, or the position and orientation of a shape, into an object.
export function place(object, position, [w, x, y, z]) {
  object.position.set(...position);
  object.quaternion.set(x, y, z, w);
  return object;
}

// Returns a shape with thin edges, which tell its faces apart in any light.
export function shapeObject(shape, colour, look) {
  const geometry = shapeGeometry(shape);
  const mesh = new THREE.Mesh(geometry, solid(shape.colour ?? colour, look));
  if (shape.kind === "mesh") mesh.material.side = THREE.DoubleSide;
  mesh.castShadow = mesh.receiveShadow = look.opacity >= 1;
  const edges = new THREE.LineSegments(
    new THREE.EdgesGeometry(geometry, 40),
    new THREE.LineBasicMaterial({ color: 0x000000, transparent: true, opacity: 0.28 * look.opacity }),
  );
  edges.raycast = () => {};
  mesh.add(edges);
  return place(mesh, shape.position, shape.orientation);
}

// Returns a cylinder from a point to another, both arrays of three.
export function bar(from, to, radius, material, facets = 20) {
  const a = new THREE.Vector3(...from);
  const b = new THREE.Vector3(...to);
  const mesh = new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, 1, facets), material);
  stretch(mesh, a, b);
  mesh.castShadow = true;
  return mesh;
}

// Moves an object of length 1 along its y, with its middle at the origin, between two points.
export function stretch(object, a, b) {
  const along = new THREE.Vector3().subVectors(b, a);
  const length = along.length();
  object.position.addVectors(a, b).multiplyScalar(0.5);
  object.scale.set(1, length || 1e-9, 1);
  if (length > 0) object.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.divideScalar(length));
}
