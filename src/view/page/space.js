// The stage of motions in space: three.js, with a floor, a light, and shadows that the light throws straight down it.

/// three.js, from the page; a loader of modules is what it takes us for, so that it leaves no global.
async function loadThree() {
  const packed = bytesOfBase64(document.getElementById("three").textContent);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const source = await new Response(stream).text();
  const door = `three ${Math.random()}`;
  window[door] = {};
  const script = element("script");
  script.textContent = `(function (exports, module, define) {${source}\n}).call({}, window["${door}"], {});`;
  document.head.append(script);
  const three = window[door];
  delete window[door];
  script.remove();
  return three;
}

const THREE = await loadThree().catch(() => null);

/// From so many balls on, they are drawn as impostors: without a GPU a triangle costs 2 µs.
const manyBalls = 60;

/// Balls and rods of one run, and what they throw on the floor: one instanced mesh each.
class Bodies {
  constructor(motion, radii, shadow) {
    this.motion = motion;
    this.radii = radii;
    this.rods = motion.hangs.map((on, i) => ({ on, i })).filter(({ on }) => on !== free);
    this.rodRadius = Math.min(0.008 * motion.reach, 0.35 * Math.min(...radii));
    this.flat = motion.count * runs.length > manyBalls;
    // A geometry for each mesh: three.js r111 takes two instanced meshes of one geometry, one after the other, for one.
    this.meshes = {
      balls: this.#mesh(this.#ball(), this.#ballMaterial(), motion.count - 1),
      tip: this.#mesh(this.#ball(), this.#ballMaterial(), 1),
      rods: this.#mesh(this.#rod(), this.flat ? rodMaterial() : this.#phong(), this.rods.length),
    };
    this.shadows = shadow ? Object.entries(this.meshes).map(([name, mesh]) => this.#shadowOf(name, mesh, shadow)) : [];
  }

  #ball() {
    return this.flat ? square() : new THREE.SphereBufferGeometry(1, 28, 18);
  }

  // Along z, as its matrix wants it.
  #rod() {
    return this.flat ? square() : new THREE.CylinderBufferGeometry(1, 1, 1, 10, 1, true).rotateX(Math.PI / 2);
  }

  #ballMaterial() {
    return this.flat ? ballMaterial() : this.#phong();
  }

  #phong() {
    return new THREE.MeshPhongMaterial({ shininess: 40, specular: 0x2a2a2a });
  }

  get objects() {
    return [...Object.values(this.meshes), ...this.shadows];
  }

  colour({ ball, tip, rod }) {
    const set = (mesh, rgb) => (mesh.material.color ?? mesh.material.uniforms.color.value).setRGB(...rgb);
    set(this.meshes.balls, ball);
    set(this.meshes.tip, tip);
    set(this.meshes.rods, rod);
  }

  /// Puts all where `places` says.
  move(places) {
    const last = this.motion.count - 1;
    const put = (mesh, k, i) => {
      const m = mesh.instanceMatrix.array;
      const r = this.radii[i];
      m[16 * k] = m[16 * k + 5] = m[16 * k + 10] = r;
      for (let axis = 0; axis < 3; ++axis) m[16 * k + 12 + axis] = places[3 * i + axis];
      m[16 * k + 15] = 1;
    };
    for (let i = 0; i < last; ++i) put(this.meshes.balls, i, i);
    put(this.meshes.tip, 0, last);
    this.rods.forEach(({ on, i }, k) => this.#putRod(k, places, on, i));
    for (const mesh of Object.values(this.meshes)) mesh.instanceMatrix.needsUpdate = true;
  }

  // A frame whose third axis is the rod; the first is across it, whichever way.
  #putRod(k, places, on, i) {
    const m = this.meshes.rods.instanceMatrix.array;
    const at = (j, axis) => (j >= 0 ? places[3 * j + axis] : 0);
    const [x, y, z] = [0, 1, 2].map((axis) => at(i, axis) - at(on, axis));
    const flat = Math.hypot(x, y);
    const [ax, ay] = flat > 1e-12 ? [-y / flat, x / flat] : [1, 0];
    const length = Math.hypot(flat, z) || 1;
    const b = [(-ay * z) / length, (ax * z) / length, (x * ay - y * ax) / length];
    const r = this.rodRadius;
    m.set([ax * r, ay * r, 0, 0, b[0] * r, b[1] * r, b[2] * r, 0, x, y, z, 0], 16 * k);
    for (let axis = 0; axis < 3; ++axis) m[16 * k + 12 + axis] = (at(i, axis) + at(on, axis)) / 2;
    m[16 * k + 15] = 1;
  }

  #mesh(geometry, material, count) {
    const mesh = new THREE.InstancedMesh(geometry, material, Math.max(count, 1));
    mesh.count = count;
    mesh.visible = count > 0;
    mesh.frustumCulled = false;
    return mesh;
  }

  // Of a ball a disc on the floor.
  #shadowOf(name, mesh, { matrix, material, flatRod }) {
    const isRod = name === "rods";
    const geometry = isRod ? mesh.geometry : new THREE.CircleBufferGeometry(1, this.flat ? 6 : 28);
    const shadow = this.#mesh(geometry, isRod && this.flat ? flatRod : material, mesh.count);
    shadow.instanceMatrix = mesh.instanceMatrix;
    shadow.matrixAutoUpdate = false;
    shadow.matrix.copy(matrix);
    shadow.renderOrder = 1;
    return shadow;
  }
}

/// The path of a point behind it: a ribbon that faces the eye, and runs out thin and pale.
class Trace {
  constructor(path, most, width) {
    this.path = path;
    this.most = most;
    this.width = width;
    this.geometry = new THREE.BufferGeometry();
    const attribute = () => new THREE.BufferAttribute(new Float32Array(6 * most), 3).setUsage(THREE.DynamicDrawUsage);
    this.geometry.setAttribute("position", attribute());
    this.geometry.setAttribute("color", attribute());
    const corners = Array.from({ length: most - 1 }, (_, k) => [0, 1, 2, 2, 1, 3].map((c) => 2 * k + c)).flat();
    this.geometry.setIndex(corners);
    const material = new THREE.MeshBasicMaterial({ vertexColors: THREE.VertexColors, side: THREE.DoubleSide });
    this.mesh = new THREE.Mesh(this.geometry, material);
    this.mesh.frustumCulled = false;
    this.middle = new Float64Array(3 * most);
  }

  /// From one time to another, with `tip` as the last place; `eye` is where it is seen from.
  move(since, time, tip, colour, background, eye, fades) {
    const count = this.#gather(since, time, tip);
    const { position, color } = this.geometry.attributes;
    for (let k = 0; k < count; ++k) {
      const fade = fades ? (k + 1) / count : 1;
      this.#widen(position.array, k, count, eye, this.width * Math.sqrt(fade));
      const strength = fades ? fade ** 1.4 : 0.75;
      for (let c = 0; c < 3; ++c) {
        color.array[6 * k + c] = color.array[6 * k + 3 + c] = background[c] + (colour[c] - background[c]) * strength;
      }
    }
    this.geometry.setDrawRange(0, 6 * (count - 1));
    position.needsUpdate = color.needsUpdate = true;
  }

  #gather(since, time, tip) {
    const { times, places } = this.path;
    const to = sampleAt(times, time);
    const from = Math.min(sampleAt(times, since), to);
    const stride = Math.max(1, Math.ceil((to - from + 2) / (this.most - 1)));
    let count = 0;
    for (let s = from; s <= to; s += stride, ++count) {
      for (let axis = 0; axis < 3; ++axis) this.middle[3 * count + axis] = places[3 * s + axis];
    }
    for (let axis = 0; axis < 3; ++axis) this.middle[3 * count + axis] = tip[axis];
    return count + 1;
  }

  // Two corners, across the path and the ray to the eye.
  #widen(position, k, count, eye, width) {
    const m = this.middle;
    const [before, after] = [3 * Math.max(k - 1, 0), 3 * Math.min(k + 1, count - 1)];
    const [tx, ty, tz] = [m[after] - m[before], m[after + 1] - m[before + 1], m[after + 2] - m[before + 2]];
    const [rx, ry, rz] = [m[3 * k] - eye.x, m[3 * k + 1] - eye.y, m[3 * k + 2] - eye.z];
    const [cx, cy, cz] = [ty * rz - tz * ry, tz * rx - tx * rz, tx * ry - ty * rx];
    const factor = width / (Math.hypot(cx, cy, cz) || 1);
    const [x, y, z] = [m[3 * k], m[3 * k + 1], m[3 * k + 2]];
    position.set([x - cx * factor, y - cy * factor, z - cz * factor, x + cx * factor, y + cy * factor, z + cz * factor], 6 * k);
  }
}

/// How much of the screen's resolution is used.
class Fineness {
  now = 1;
  #playing = 1; // while frames come
  #sum = 0;
  #frames = 0;

  /// Whether another resolution is due after a frame of so many milliseconds, or, without a number, a pause.
  changes(interval) {
    const before = this.now;
    this.now = interval === undefined ? 1 : this.#playing;
    if (interval === undefined) this.#sum = this.#frames = 0;
    else this.#count(interval);
    return this.now !== before;
  }

  // Ten frames at a time; below 35 a second they are drawn coarser.
  #count(interval) {
    this.#sum += interval;
    if (++this.#frames < 10) return;
    if (this.#sum / this.#frames > 28) this.now = this.#playing = Math.max(this.#playing * 0.7, 0.34);
    this.#sum = this.#frames = 0;
  }
}

class Stage {
  constructor(host, motion) {
    if (!THREE) throw new Error("three.js did not load");
    this.motion = motion;
    this.canvas = host.appendChild(element("canvas", { tabIndex: 0 }));
    this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: true, alpha: false });
    this.scene = new THREE.Scene();
    this.places = runs.map(() => new Float64Array(motion.count * 3));
    this.#measure();
    this.#light();
    this.#layFloor();
    this.#addBodies();
    this.onChange = () => {};
    this.camera = new OrbitCamera(new THREE.PerspectiveCamera(32, 1, 0.1, 100), this.middle, this.radius);
    this.#watch();
    this.themed();
  }

  static kind = "space";

  get description() {
    return `${scene.subject}, moving, in perspective over a floor. Plots of the same motion follow.`;
  }

  #watch() {
    watchGestures(this.canvas, {
      turn: (dx, dy) => this.#change(() => this.camera.turn(-dx * 0.008, dy * 0.008)),
      move: (dx, dy) => this.#change(() => this.camera.move(-dx / this.height, dy / this.height)),
      zoom: (factor) => this.zoom(factor),
    });
  }

  #change(change) {
    change();
    this.onChange();
  }

  reset() {
    this.#change(() => this.camera.reset());
  }
  zoom(factor) {
    this.#change(() => this.camera.zoom(factor));
  }
  turn(x, y) {
    this.#change(() => this.camera.turn(x * 0.1, y * 0.1));
  }
  move(x, y) {
    this.#change(() => this.camera.move(x * 0.05, y * 0.05));
  }

  /// Told how long each frame took while playing [ms], nothing when paused: where no GPU helps, motion is drawn coarser
  /// until frames come in time, and stills are drawn as fine as the screen.
  pace(interval) {
    this.fineness ??= new Fineness();
    if (this.fineness.changes(interval)) this.resize();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.height = Math.max(height, 1);
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2) * (this.fineness?.now ?? 1));
    this.renderer.setSize(width, height, false);
    this.camera.fit(width / this.height);
    this.onChange();
  }

  // The middle of what moves, and the sphere about it; the floor is a little below.
  #measure() {
    const { low, high, reach } = this.motion;
    this.floor = Math.min(low[2], -0.02 * reach) - 0.16 * reach;
    this.middle = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (this.floor + Math.max(high[2], 0)) / 2];
    const half = [0, 1, 2].map((axis) => Math.max(high[axis] - this.middle[axis], this.middle[axis] - low[axis]));
    this.radius = Math.max(half[0], half[1], half[2], 0.5 * reach) * 1.12;
  }

  #light() {
    const sky = new THREE.HemisphereLight(0xffffff, 0x8a8a8a, 0.75);
    sky.position.set(0, 0, 1);
    const sun = new THREE.DirectionalLight(0xffffff, 0.6);
    this.sun = [0.35, -0.25, 1];
    sun.position.set(...this.sun);
    const side = new THREE.DirectionalLight(0xffffff, 0.2);
    side.position.set(-1, 0.6, 0.2);
    this.scene.add(sky, sun, side);
  }

  // A disc with a grid, which fades at its rim into what is behind.
  #layFloor() {
    const size = this.radius * 3.2;
    const disc = new THREE.CircleBufferGeometry(size, 96);
    this.disc = new THREE.Mesh(disc, new THREE.MeshBasicMaterial({ polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 2 }));
    this.disc.position.set(this.middle[0], this.middle[1], this.floor);
    const ticks = niceTicks(0, size, 7);
    this.square = ticks[1] - ticks[0];
    this.grid = new THREE.LineSegments(this.#gridGeometry(size), new THREE.LineBasicMaterial({ vertexColors: THREE.VertexColors }));
    this.grid.position.copy(this.disc.position);
    const post = new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(0, 0, 0), new THREE.Vector3(0, 0, this.floor)]);
    this.post = new THREE.Line(post, new THREE.LineBasicMaterial());
    this.pivot = new THREE.Mesh(new THREE.SphereBufferGeometry(Math.min(0.014 * this.motion.reach, 1.4 * Math.max(...this.motion.radii)), 16, 12), new THREE.MeshBasicMaterial());
    this.post.visible = this.pivot.visible = this.motion.hangs.includes(origin);
    this.scene.add(this.disc, this.grid, this.post, this.pivot);
  }

  #gridGeometry(size) {
    const points = [];
    this.rim = [];
    const parts = 24;
    const add = (x, y) => {
      points.push(new THREE.Vector3(x, y, 0));
      this.rim.push(Math.min(1, Math.hypot(x, y) / size));
    };
    const count = Math.floor(size / this.square);
    for (let k = -count; k <= count; ++k) {
      const across = k * this.square;
      const half = Math.sqrt(Math.max(size * size - across * across, 0));
      for (let part = 0; part < parts; ++part) {
        const [a, b] = [part, part + 1].map((p) => -half + (2 * half * p) / parts);
        add(a, across), add(b, across), add(across, a), add(across, b);
      }
    }
    const geometry = new THREE.BufferGeometry().setFromPoints(points);
    geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(3 * points.length), 3));
    return geometry;
  }

  // Straight onto the floor, along the sun's rays: a matrix, no second look from the light.
  #shadow() {
    const [x, y, z] = this.sun;
    const height = this.floor + 0.001 * this.radius;
    const matrix = new THREE.Matrix4().set(1, 0, -x / z, (x / z) * height, 0, 1, -y / z, (y / z) * height, 0, 0, 0, height, 0, 0, 0, 1);
    const flatRod = rodMaterial();
    flatRod.uniforms.shaded.value = 0;
    return { matrix, material: new THREE.MeshBasicMaterial(), flatRod };
  }

  #addBodies() {
    const { motion } = this;
    const radii = motion.radii.map((radius) => (runs.length > 8 ? 0.6 * radius : radius));
    this.shadow = this.#shadow();
    this.bodies = runs.map((_, k) => new Bodies(motion, radii, runs.length <= 8 || k === 0 ? this.shadow : null));
    const most = runs.length > 8 ? 400 : 2000;
    const width = (runs.length > 8 ? 0.0025 : 0.004) * this.radius;
    this.traces = runs.map((run) => traced.map((point) => new Trace(motion.path(run, point), most, width)));
    for (const body of this.bodies) this.scene.add(...body.objects);
    for (const trace of this.traces.flat()) this.scene.add(trace.mesh);
  }

  /// Takes the colours of the theme.
  themed() {
    const unit = (rgb) => rgb.map((c) => c / 255);
    const { rgb } = palette;
    this.background = unit(rgb.ground);
    this.scene.background = new THREE.Color(...this.background);
    this.scene.fog = new THREE.Fog(this.scene.background, 1, 2); // placed with each frame
    this.disc.material.color.setRGB(...unit(rgb.floor));
    this.shadow.material.color.setRGB(...unit(rgb.shade));
    this.shadow.flatRod.uniforms.color.value.setRGB(...unit(rgb.shade));
    this.post.material.color.setRGB(...unit(rgb.edge));
    this.pivot.material.color.setRGB(...unit(rgb.ink));
    this.#colourGrid(unit(rgb.line), unit(rgb.floor));
    this.bodies.forEach((body, k) => {
      const own = unit(palette.run(k));
      body.colour(runs.length > 1 ? { ball: own, tip: own, rod: own } : { ball: unit(rgb.bob), tip: own, rod: unit(rgb.rod) });
    });
  }

  #colourGrid(colour, floor) {
    const colours = this.grid.geometry.attributes.color;
    this.rim.forEach((rim, k) => {
      for (let c = 0; c < 3; ++c) colours.array[3 * k + c] = colour[c] + (floor[c] - colour[c]) * rim;
    });
    colours.needsUpdate = true;
  }

  draw(time, trace) {
    const since = time - trace * (runs[0].end - runs[0].start);
    const eye = this.camera.camera.position;
    runs.forEach((run, k) => {
      const places = this.motion.at(run, time, this.places[k]);
      this.bodies[k].move(places);
      traced.forEach((point, n) => {
        this.traces[k][n].mesh.visible = trace > 0;
        if (trace === 0) return;
        const tip = places.subarray(3 * point, 3 * point + 3);
        const colour = palette.run(k).map((c) => c / 255);
        this.traces[k][n].move(since, time, tip, colour, this.background, eye, trace < 1);
      });
    });
    this.scene.fog.near = this.camera.distance + 0.8 * this.radius;
    this.scene.fog.far = this.camera.distance + 4 * this.radius;
    this.renderer.render(this.scene, this.camera.camera);
  }
}
