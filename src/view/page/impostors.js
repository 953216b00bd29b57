// Balls and rods of long chains, and of many runs: two triangles each, that face the eye and are shaded as if they were
// round, all in one mesh. Without a GPU a triangle costs 2 µs, and an instance as much as many triangles.

/// Lit from above, a little from the right, in the directions of the screen.
const lit = "mix(1.0, 0.55 + 0.55 * max(0.0, dot(normal, vec3(0.26, 0.86, 0.44))), shaded)";

function impostorMaterial(vertex, fragment) {
  return new THREE.ShaderMaterial({
    uniforms: { color: { value: new THREE.Color() }, shaded: { value: 1 } },
    vertexShader: `attribute vec2 corner; attribute vec3 along; attribute float radius; varying vec2 at;\n${vertex}`,
    fragmentShader: `uniform vec3 color; uniform float shaded; varying vec2 at;\n${fragment}`,
    side: THREE.DoubleSide,
  });
}

const ballFragment = `void main() {
  float square = dot(at, at);
  if (square > 1.0) discard;
  vec3 normal = vec3(at, sqrt(1.0 - square));
  gl_FragColor = vec4(color * ${lit}, 1.0);
}`;

function ballMaterial() {
  return impostorMaterial(
    `void main() {
      at = corner;
      vec4 middle = modelViewMatrix * vec4(position, 1.0);
      middle.xy += corner * radius;
      gl_Position = projectionMatrix * middle;
    }`,
    ballFragment,
  );
}

/// The shadow of a ball lies flat.
function discMaterial() {
  return impostorMaterial(
    `void main() {
      at = corner;
      gl_Position = projectionMatrix * modelViewMatrix * vec4(position + vec3(corner * radius, 0.0), 1.0);
    }`,
    ballFragment,
  );
}

// At an edge `at` may lie a little beyond it.
function rodMaterial() {
  return impostorMaterial(
    `void main() {
      at = corner;
      vec4 middle = modelViewMatrix * vec4(position + 0.5 * corner.y * along, 1.0);
      vec3 across = cross((modelViewMatrix * vec4(along, 0.0)).xyz, middle.xyz);
      middle.xyz += corner.x * radius * across / max(length(across), 1e-12);
      gl_Position = projectionMatrix * middle;
    }`,
    `void main() {
      vec3 normal = vec3(at.x * 0.3, sqrt(max(1.0 - at.x * at.x, 0.0)), 0.4);
      gl_FragColor = vec4(color * ${lit}, 1.0);
    }`,
  );
}

/// Squares, four corners each, as one geometry.
class Squares {
  constructor(radii) {
    this.count = radii.length;
    this.geometry = new THREE.BufferGeometry();
    const four = (numbers, size) => new THREE.BufferAttribute(Float32Array.from(numbers), size);
    this.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(12 * this.count), 3));
    this.geometry.setAttribute("along", new THREE.BufferAttribute(new Float32Array(12 * this.count), 3));
    this.geometry.setAttribute("corner", four(radii.flatMap(() => [-1, -1, 1, -1, -1, 1, 1, 1]), 2));
    this.geometry.setAttribute("radius", four(radii.flatMap((r) => [r, r, r, r]), 1));
    this.geometry.setIndex(radii.flatMap((_, k) => [0, 1, 2, 2, 1, 3].map((c) => 4 * k + c)));
  }

  mesh(material) {
    const mesh = new THREE.Mesh(this.geometry, material);
    mesh.frustumCulled = false;
    mesh.visible = this.count > 0;
    return mesh;
  }

  /// Three numbers for all corners of square k.
  set(name, k, x, y, z) {
    const { array } = this.geometry.attributes[name];
    for (let at = 12 * k; at < 12 * k + 12; at += 3) {
      array[at] = x;
      array[at + 1] = y;
      array[at + 2] = z;
    }
  }

  changed() {
    this.geometry.attributes.position.needsUpdate = this.geometry.attributes.along.needsUpdate = true;
  }
}

/// The same as RoundBodies, flat.
class FlatBodies {
  constructor(motion, radii, shadow) {
    this.motion = motion;
    this.rods = rodsOf(motion);
    this.balls = new Squares(radii.slice(0, -1));
    this.tip = new Squares(radii.slice(-1));
    this.sticks = new Squares(this.rods.map(() => rodRadius(motion, radii)));
    const squares = [this.balls, this.tip, this.sticks];
    this.meshes = squares.map((each) => each.mesh(each === this.sticks ? rodMaterial() : ballMaterial()));
    this.shadows = shadow ? squares.map((each) => onFloor(each.mesh(shadow[each === this.sticks ? "rod" : "disc"]), shadow.matrix)) : [];
  }

  get objects() {
    return [...this.meshes, ...this.shadows];
  }

  colour({ ball, tip, rod }) {
    [ball, tip, rod].forEach((rgb, k) => paint(this.meshes[k].material, rgb));
  }

  move(places) {
    const last = this.motion.count - 1;
    const put = (squares, k, i) => squares.set("position", k, places[3 * i], places[3 * i + 1], places[3 * i + 2]);
    for (let i = 0; i < last; ++i) put(this.balls, i, i);
    put(this.tip, 0, last);
    this.rods.forEach(({ on, i }, k) => {
      const { middle, along } = rodBetween(places, on, i);
      this.sticks.set("position", k, ...middle);
      this.sticks.set("along", k, ...along);
    });
    for (const squares of [this.balls, this.tip, this.sticks]) squares.changed();
  }
}
