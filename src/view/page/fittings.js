// Carts, rails, springs, threads and pivots of one run in space, and their shadows.

class Fittings {
  constructor(motion, radii, { matrix, single }) {
    this.motion = motion;
    this.floor = matrix;
    this.pairs = []; // meshes and their shadows
    this.radius = Math.max(0.006 * motion.reach, 0.2 * Math.min(...radii));
    const lit = () => new THREE.MeshPhongMaterial({ shininess: 40, specular: 0x2a2a2a });
    this.materials = { cart: lit(), spring: lit(), rail: lit(), pivot: lit() };
    const add = (geometry, kind) => {
      const mesh = new THREE.Mesh(geometry, this.materials[kind]);
      const shadow = onFloor(new THREE.Mesh(geometry, single), matrix);
      for (const each of [mesh, shadow]) {
        each.matrixAutoUpdate = false;
        each.frustumCulled = false;
      }
      this.pairs.push([mesh, shadow]);
      return [mesh, shadow];
    };
    const ofKind = (kind) => scene.points.map((_, i) => i).filter((i) => kindOf(i) === kind);
    this.pivots = ofKind("pivot").map((i) => ({ i, pair: add(new THREE.SphereBufferGeometry(1.15 * radii[i], 16, 12), "pivot") }));
    this.carts = ofKind("cart").map((i) => this.#cart(i, 1.4 * radii[i], add));
    this.connections = scene.connections.map(([kind, from, to]) => {
      const long = motion.reach;
      const geometry = kind === "spring" ? springGeometry(long, 0.05 * long, this.radius) : threadGeometry(long, 0.5 * this.radius);
      return { from, to, pair: add(geometry, "spring") };
    });
  }

  // x is the way it runs, z up if it can be.
  #cart(i, size, add) {
    const along = new THREE.Vector3(...(this.motion.railOf(i) ?? [1, 0, 0]));
    const across = new THREE.Vector3(0, 0, 1).cross(along);
    if (across.length() < 1e-6) across.set(0, 1, 0);
    across.normalize();
    const frame = new THREE.Matrix4().makeBasis(along, across, along.clone().cross(across));
    const { cartLong, cartHigh, wheelAside, wheelBelow, wheel: round } = proportions;
    const wheels = [-wheelAside, wheelAside].flatMap((x) => [-0.8, 0.8].map((y) => {
      const wheel = new THREE.CylinderBufferGeometry(round * size, round * size, 0.2 * size, 16);
      return add(wheel.translate(x * size, y * size, -wheelBelow * size), "rail");
    }));
    const box = add(new THREE.BoxBufferGeometry(2 * cartLong * size, 1.6 * size, 2 * cartHigh * size), "cart");
    const rails = !this.motion.railOf(i) ? [] : [-0.8, 0.8].map((y) => {
      const rail = new THREE.BoxBufferGeometry(4 * this.motion.reach, 0.1 * size, 0.1 * size);
      return add(rail.translate(0, y * size, -1.06 * size), "rail");
    });
    return { i, along, frame, moving: [...wheels, box], rails };
  }

  get objects() {
    return this.pairs.flat();
  }

  colour(colours) {
    for (const [kind, colour] of Object.entries(colours)) paint(this.materials[kind], colour);
  }

  move(places) {
    const at = (i) => (i < 0 ? new THREE.Vector3() : new THREE.Vector3(places[3 * i], places[3 * i + 1], places[3 * i + 2]));
    for (const { i, pair } of this.pivots) this.#put(pair, new THREE.Matrix4().setPosition(at(i)));
    for (const { i, along, frame, moving, rails } of this.carts) {
      const place = at(i);
      for (const pair of moving) this.#put(pair, frame.clone().setPosition(place));
      // Rails lie still, about the place next to the origin.
      const middle = place.clone().addScaledVector(along, -place.dot(along));
      for (const pair of rails) this.#put(pair, frame.clone().setPosition(middle));
    }
    for (const { from, to, pair } of this.connections) this.#put(pair, between(at(from), at(to), this.motion.reach));
  }

  #put([mesh, shadow], matrix) {
    mesh.matrix.copy(matrix);
    shadow.matrix.multiplyMatrices(this.floor, matrix);
  }
}

/// The matrix that lays what is `long` along z from one place to another.
function between(from, to, long) {
  const along = to.clone().sub(from);
  const length = Math.max(along.length(), 1e-9);
  const z = along.divideScalar(length);
  const x = (Math.abs(z.x) < 0.9 ? new THREE.Vector3(1, 0, 0) : new THREE.Vector3(0, 1, 0)).cross(z).normalize();
  const matrix = new THREE.Matrix4().makeBasis(x, z.clone().cross(x), z.clone().multiplyScalar(length / long));
  return matrix.setPosition(from);
}

/// A spring along z, `long` before it is stretched: its wire keeps its thickness about there.
function springGeometry(long, wide, radius) {
  const curve = new THREE.Curve();
  curve.arcLengthDivisions = 400;
  // Straight to the axis at both ends, half a turn from there.
  curve.getPoint = (t) => {
    const { springEnd } = proportions;
    const part = clampPart((t - springEnd) / (1 - 2 * springEnd));
    const angle = 2 * Math.PI * springTurns * part;
    const grown = wide * clampPart(2 * springTurns * Math.min(part, 1 - part));
    return new THREE.Vector3(grown * Math.cos(angle), grown * Math.sin(angle), t * long);
  };
  return new THREE.TubeBufferGeometry(curve, 12 * springTurns, radius, 5);
}

function clampPart(x) {
  return Math.min(Math.max(x, 0), 1);
}

function threadGeometry(long, radius) {
  return new THREE.CylinderBufferGeometry(radius, radius, long, 8, 1, true).rotateX(Math.PI / 2).translate(0, 0, long / 2);
}
