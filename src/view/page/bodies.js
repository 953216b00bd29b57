// Balls and rods of one run in space, round, and their shadows.

/// The colour of a material, whichever way it has it.
function paint(material, [red, green, blue]) {
  (material.color ?? material.uniforms.color.value).setRGB(red, green, blue);
}

/// One instanced mesh each for the balls, the last ball, the rods, and what each of them throws on the floor.
class RoundBodies {
  constructor(motion, radii, shadow) {
    this.motion = motion;
    this.radii = radii;
    this.rods = rodsOf(motion);
    this.rodRadius = rodRadius(motion, radii);
    // A geometry for each mesh: three.js r111 takes two instanced meshes of one geometry, one after the other, for one.
    const ball = () => new THREE.SphereBufferGeometry(1, 28, 18);
    const rod = new THREE.CylinderBufferGeometry(1, 1, 1, 10, 1, true).rotateX(Math.PI / 2); // along z
    this.balls = this.#mesh(ball(), this.#phong(), motion.count - 1);
    this.tip = this.#mesh(ball(), this.#phong(), 1);
    this.sticks = this.#mesh(rod, this.#phong(), this.rods.length);
    this.meshes = [this.balls, this.tip, this.sticks];
    this.shadows = shadow ? this.meshes.map((mesh) => this.#shadowOf(mesh, shadow)) : [];
  }

  get objects() {
    return [...this.meshes, ...this.shadows];
  }

  colour({ ball, tip, rod }) {
    paint(this.balls.material, ball);
    paint(this.tip.material, tip);
    paint(this.sticks.material, rod);
  }

  /// Puts all where `places` says.
  move(places) {
    const last = this.motion.count - 1;
    for (let i = 0; i < last; ++i) this.#putBall(this.balls, i, places, i);
    this.#putBall(this.tip, 0, places, last);
    this.rods.forEach(({ on, i }, k) => this.#putRod(k, places, on, i));
    for (const mesh of this.meshes) mesh.instanceMatrix.needsUpdate = true;
  }

  #putBall(mesh, k, places, i) {
    const r = this.radii[i];
    mesh.instanceMatrix.array.set(
      [r, 0, 0, 0, 0, r, 0, 0, 0, 0, r, 0, places[3 * i], places[3 * i + 1], places[3 * i + 2], 1], 16 * k);
  }

  // A frame whose third axis is the rod; the first is across it, whichever way.
  #putRod(k, places, on, i) {
    const { middle, along } = rodBetween(places, on, i);
    const [x, y, z] = along;
    const flat = Math.hypot(x, y);
    const [ax, ay] = flat > 1e-12 ? [-y / flat, x / flat] : [1, 0];
    const length = Math.hypot(flat, z) || 1;
    const [bx, by, bz] = [(-ay * z) / length, (ax * z) / length, (x * ay - y * ax) / length];
    const r = this.rodRadius;
    this.sticks.instanceMatrix.array.set(
      [ax * r, ay * r, 0, 0, bx * r, by * r, bz * r, 0, x, y, z, 0, ...middle, 1], 16 * k);
  }

  #phong() {
    return new THREE.MeshPhongMaterial({ shininess: 40, specular: 0x2a2a2a });
  }

  #mesh(geometry, material, count) {
    const mesh = new THREE.InstancedMesh(geometry, material, Math.max(count, 1));
    mesh.count = count;
    mesh.visible = count > 0;
    mesh.frustumCulled = false;
    return mesh;
  }

  // Of a ball a disc on the floor.
  #shadowOf(mesh, { matrix, material }) {
    const geometry = mesh === this.sticks ? mesh.geometry : new THREE.CircleBufferGeometry(1, 28);
    const shadow = this.#mesh(geometry, material, mesh.count);
    shadow.instanceMatrix = mesh.instanceMatrix;
    return onFloor(shadow, matrix);
  }
}

/// Makes a mesh a shadow. It is flat, so that three.js finds no inverse for its normals, which nobody asks for, and says so.
function onFloor(mesh, matrix) {
  mesh.normalMatrix.getNormalMatrix = () => mesh.normalMatrix;
  mesh.matrixAutoUpdate = false;
  mesh.matrix.copy(matrix);
  mesh.renderOrder = 1;
  return mesh;
}

/// The points that hang on others, and on which.
function rodsOf(motion) {
  return motion.hangs.map((on, i) => ({ on, i })).filter(({ on }) => on !== free);
}

function rodRadius(motion, radii) {
  return Math.min(0.008 * motion.reach, 0.35 * Math.min(...radii));
}

/// Where a rod is, and from where to where.
function rodBetween(places, on, i) {
  const at = (j, axis) => (j >= 0 ? places[3 * j + axis] : 0);
  const axes = [0, 1, 2];
  return {
    middle: axes.map((axis) => (at(i, axis) + at(on, axis)) / 2),
    along: axes.map((axis) => at(i, axis) - at(on, axis)),
  };
}
