/* global THREE */
// Camera, light, floor and background around the models.

const THEMES = {
  light: { top: "#fbfcfd", bottom: "#dfe4ea", line: "#8a95a3", fog: 0.55, ambient: 1.35, key: 2.1 },
  dark: { top: "#20262e", bottom: "#0d1014", line: "#8fa0b5", fog: 0.4, ambient: 0.95, key: 2.3 },
};
const FIELD = 32; // degrees
const MARGIN = 1.12; // free space around what is fitted

export class Stage {
  // `box` holds the whole motion; `up` and `normal` are the scene's.
  constructor(canvas, box, { up, normal, size }) {
    this.canvas = canvas;
    this.up = new THREE.Vector3(...up);
    this.normal = normal && new THREE.Vector3(...normal);
    this.box = box;
    this.sphere = box.getBoundingSphere(new THREE.Sphere());
    if (!(this.sphere.radius > 0)) this.sphere.radius = size || 1;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(FIELD, 1, 0.01 * this.sphere.radius, 400 * this.sphere.radius);
    this.camera.up.copy(this.up);
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    Object.assign(this.controls, { zoomToCursor: true, enableDamping: false, screenSpacePanning: true });
    this.controls.minDistance = 0.05 * this.sphere.radius;
    this.controls.maxDistance = 100 * this.sphere.radius;
    this.addBackground();
    this.addLights();
    this.addFloor(box);
    this.frame = this.baseFrame();
    this.view("home");
  }

  addBackground() {
    this.background = new THREE.Mesh(
      new THREE.PlaneGeometry(2, 2),
      new THREE.ShaderMaterial({
        depthTest: false,
        depthWrite: false,
        uniforms: { top: { value: new THREE.Color() }, bottom: { value: new THREE.Color() } },
        vertexShader: "varying float h; void main() { h = 0.5 * position.y + 0.5; gl_Position = vec4(position.xy, 1.0, 1.0); }",
        fragmentShader: `uniform vec3 top; uniform vec3 bottom; varying float h;
          void main() { gl_FragColor = vec4(mix(bottom, top, smoothstep(0.0, 1.0, h)), 1.0);
          #include <colorspace_fragment>
          }`,
      }),
    );
    this.background.frustumCulled = false;
    this.background.renderOrder = -10;
    this.scene.add(this.background);
  }

  addLights() {
    const { radius, center } = this.sphere;
    this.sky = new THREE.HemisphereLight("#ffffff", "#8d9096", 1);
    this.sky.position.copy(this.up);
    this.key = new THREE.DirectionalLight("#ffffff", 2);
    const aside = perpendicular(this.up);
    const across = new THREE.Vector3().crossVectors(this.up, aside);
    this.key.position.copy(center).addScaledVector(this.up, 3 * radius);
    this.key.position.addScaledVector(aside, 1.3 * radius).addScaledVector(across, -1.7 * radius);
    this.key.target.position.copy(center);
    this.key.castShadow = true;
    this.key.shadow.mapSize.set(2048, 2048);
    const reach = 1.35 * radius;
    Object.assign(this.key.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.1 * radius, far: 8 * radius });
    this.key.shadow.normalBias = 0.004 * radius;
    this.key.shadow.radius = 3;
    this.head = new THREE.DirectionalLight("#ffffff", 0.5);
    this.scene.add(this.sky, this.key, this.key.target, this.head, this.head.target);
  }

  // A grid that fades out, at the lowest point of the motion; lines at a round distance.
  addFloor(box) {
    const { radius, center } = this.sphere;
    const lowest = Math.min(...corners(box).map((corner) => corner.dot(this.up)));
    this.spacing = roundLength(radius / 4);
    const reach = 6 * radius;
    this.floorMaterial = new THREE.ShaderMaterial({
      transparent: true,
      depthWrite: false,
      side: THREE.DoubleSide,
      uniforms: {
        colour: { value: new THREE.Color() },
        spacing: { value: this.spacing },
        reach: { value: reach },
        strength: { value: 0.5 },
      },
      vertexShader: "varying vec2 p; void main() { p = position.xy; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",
      fragmentShader: `uniform vec3 colour; uniform float spacing; uniform float reach; uniform float strength;
        varying vec2 p;
        float lines(float apart) {
          vec2 q = p / apart;
          vec2 d = abs(fract(q - 0.5) - 0.5) / fwidth(q);
          return (1.0 - min(min(d.x, d.y), 1.0)) * clamp(1.2 - 2.0 * max(fwidth(q).x, fwidth(q).y), 0.0, 1.0);
        }
        void main() {
          float fade = 1.0 - smoothstep(0.12 * reach, 0.8 * reach, length(p));
          float a = max(0.45 * lines(spacing), lines(5.0 * spacing));
          gl_FragColor = vec4(colour, a * fade * strength);
          #include <colorspace_fragment>
        }`,
    });
    const plane = new THREE.PlaneGeometry(2 * reach, 2 * reach);
    const aside = perpendicular(this.up);
    const basis = new THREE.Matrix4().makeBasis(aside, new THREE.Vector3().crossVectors(this.up, aside), this.up);
    this.floor = new THREE.Group();
    this.floor.quaternion.setFromRotationMatrix(basis);
    // A whole number of lines from the origin, so that the lines stand at round coordinates.
    const inPlane = center.clone().addScaledVector(this.up, -center.dot(this.up));
    for (const axis of [aside, new THREE.Vector3().crossVectors(this.up, aside)]) {
      const along = inPlane.dot(axis);
      inPlane.addScaledVector(axis, Math.round(along / (5 * this.spacing)) * 5 * this.spacing - along);
    }
    this.floor.position.copy(inPlane).addScaledVector(this.up, lowest - 0.004 * radius);
    const grid = new THREE.Mesh(plane, this.floorMaterial);
    grid.renderOrder = -5;
    this.shade = new THREE.Mesh(plane, new THREE.ShadowMaterial({ opacity: 0.2, depthWrite: false }));
    this.shade.receiveShadow = true;
    this.shade.position.z = -0.001 * radius;
    this.shade.renderOrder = -6;
    for (const part of [grid, this.shade]) part.raycast = () => {};
    this.floor.add(this.shade, grid);
    this.scene.add(this.floor);
  }

  setTheme(name) {
    const { top, bottom, line, fog, ambient, key } = THEMES[name];
    this.background.material.uniforms.top.value.set(top);
    this.background.material.uniforms.bottom.value.set(bottom);
    this.floorMaterial.uniforms.colour.value.set(line);
    this.floorMaterial.uniforms.strength.value = fog;
    this.sky.intensity = ambient;
    this.key.intensity = key;
    this.shade.material.opacity = name === "dark" ? 0.45 : 0.2;
  }

  // The directions that standard views look along: front from -y, with z up.
  baseFrame() {
    const up = this.up;
    let front = new THREE.Vector3(0, -1, 0);
    if (Math.abs(up.y) > 0.7) front = new THREE.Vector3(0, 0, 1);
    front.addScaledVector(up, -front.dot(up)).normalize();
    return { up, front, right: new THREE.Vector3().crossVectors(up, front) };
  }

  // Puts the camera to a standard view that shows the whole motion.
  view(name) {
    const { up, front, right } = this.frame;
    const from = new THREE.Vector3();
    const set = (f, r, u) => from.addScaledVector(front, f).addScaledVector(right, r).addScaledVector(up, u);
    const directions = {
      front: [1, 0, 0], back: [-1, 0, 0], right: [0, 1, 0], left: [0, -1, 0],
      top: [1e-4, 0, 1], bottom: [1e-4, 0, -1], corner: [1, 0.75, 0.62],
    };
    if (name === "home") this.homeDirection(from, set);
    else set(...directions[name]);
    this.fit(from.normalize());
  }

  // Of a planar mechanism nearly along its axes, otherwise from a corner.
  homeDirection(from, set) {
    if (!this.normal) return set(1, 0.75, 0.5);
    const { up, front, right } = this.frame;
    const n = this.normal.clone();
    if (n.dot(front) + 0.3 * n.dot(right) + 0.1 * n.dot(up) < 0) n.negate();
    const level = n.clone().addScaledVector(up, -n.dot(up));
    from.copy(n);
    if (level.length() > 0.3) {
      const aside = new THREE.Vector3().crossVectors(up, n);
      from.addScaledVector(aside, 0.32).addScaledVector(up, 0.22);
    } else from.addScaledVector(front, 0.45).addScaledVector(right, 0.2);
    return from;
  }

  // Moves the camera so that the box of the whole motion fills the view, seen from a direction.
  fit(direction) {
    const tall = Math.tan((0.5 * FIELD * Math.PI) / 180);
    const wide = tall * (this.camera.aspect || 1);
    this.camera.position.copy(direction);
    this.camera.lookAt(0, 0, 0);
    const turn = this.camera.quaternion.clone().invert();
    const seen = corners(this.box).map((corner) => corner.sub(this.sphere.center).applyQuaternion(turn));
    const middle = new THREE.Vector3();
    let distance = 0;
    // The middle of what is seen depends on the distance, because nearer corners look larger.
    for (let turnOver = 0; turnOver < 8; turnOver++) {
      distance = Math.max(...seen.map(({ x, y, z }) => z + MARGIN * Math.max(Math.abs(x - middle.x) / wide, Math.abs(y - middle.y) / tall)));
      for (const axis of ["x", "y"]) {
        const slopes = seen.map((corner) => (corner[axis] - middle[axis]) / (distance - corner.z));
        middle[axis] += 0.5 * (Math.max(...slopes) + Math.min(...slopes)) * distance;
      }
    }
    distance = Math.max(distance, 0.5 * this.sphere.radius);
    this.controls.target.copy(middle).applyQuaternion(this.camera.quaternion).add(this.sphere.center);
    this.camera.position.copy(this.controls.target).addScaledVector(direction, distance);
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.isFitted = direction.clone();
  }

  resize(width, height) {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  // Moves camera and target together, to follow something.
  shift(by) {
    this.camera.position.add(by);
    this.controls.target.add(by);
    this.controls.update();
  }

  render() {
    this.head.position.copy(this.camera.position);
    this.head.target.position.copy(this.controls.target);
    this.renderer.render(this.scene, this.camera);
  }
}

// Some unit vector at a right angle to another, along an axis where that is possible.
function perpendicular(up) {
  const axis = Math.abs(up.x) < 0.7 ? new THREE.Vector3(1, 0, 0) : new THREE.Vector3(0, 1, 0);
  return axis.addScaledVector(up, -axis.dot(up)).normalize();
}

function corners({ min, max }) {
  const found = [];
  for (const x of [min.x, max.x]) {
    for (const y of [min.y, max.y]) for (const z of [min.z, max.z]) found.push(new THREE.Vector3(x, y, z));
  }
  return found;
}

// The nearest of 1, 2, 5 times a power of ten.
export function roundLength(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  const digit = length / power;
  return power * (digit < 1.5 ? 1 : digit < 3.5 ? 2 : digit < 7.5 ? 5 : 10);
}
