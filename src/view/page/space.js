// The stage of motions in space: three.js, with a floor, a light, and shadows that the light throws straight down it.

/// From so many balls on, they are drawn as impostors.
const manyBalls = 60;

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

  // Six frames at a time; below 40 a second they are drawn coarser.
  #count(interval) {
    this.#sum += interval;
    if (++this.#frames < 6) return;
    if (this.#sum / this.#frames > 25) this.now = this.#playing = Math.max(this.#playing * 0.7, 0.45);
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
    const fixed = scene.points.map((_, i) => (kindOf(i) === "bob" ? 0 : this.motion.farthest(i, this.middle)));
    this.radius = Math.max(half[0], half[1], half[2], 0.5 * reach, ...fixed) * 1.12;
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
    this.post.visible = this.pivot.visible = holdsOrigin(this.motion);
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
    // A material for meshes in instances, and one for others: three.js compiles each once.
    const flat = { material: new THREE.MeshBasicMaterial(), single: new THREE.MeshBasicMaterial(), disc: discMaterial(), rod: rodMaterial() };
    flat.disc.uniforms.shaded.value = flat.rod.uniforms.shaded.value = 0;
    return { matrix, ...flat };
  }

  #addBodies() {
    const { motion } = this;
    const radii = motion.radii.map((radius) => (runs.length > 8 ? 0.6 * radius : radius));
    this.shadow = this.#shadow();
    const Bodies = motion.count * runs.length > manyBalls ? FlatBodies : RoundBodies;
    this.bodies = runs.map((_, k) => new Bodies(motion, radii, runs.length <= 8 || k === 0 ? this.shadow : null));
    const most = runs.length > 8 ? 400 : 2000;
    const width = (runs.length > 8 ? 0.0025 : 0.004) * this.radius;
    this.traces = runs.map((run) => traced.map((point) => new Trace(motion.path(run, point), most, width)));
    for (const body of this.bodies) this.scene.add(...body.objects);
    this.fittings = runs.slice(0, runs.length <= 8 ? runs.length : 1).map(() => new Fittings(motion, radii, this.shadow));
    for (const object of this.fittings.flatMap((each) => each.objects)) this.scene.add(object);
    for (const trace of this.traces.flat()) this.scene.add(trace.mesh);
  }

  /// Takes the colours of the theme.
  themed() {
    const unit = (rgb) => rgb.map((c) => c / 255);
    const { rgb } = palette;
    this.scene.background = new THREE.Color(...unit(rgb.ground));
    this.scene.fog = new THREE.Fog(this.scene.background, 1, 2); // placed with each frame
    this.disc.material.color.setRGB(...unit(rgb.floor));
    for (const material of [this.shadow.material, this.shadow.single, this.shadow.disc, this.shadow.rod]) paint(material, unit(rgb.shade));
    this.post.material.color.setRGB(...unit(rgb.edge));
    this.pivot.material.color.setRGB(...unit(rgb.ink));
    this.#colourGrid(unit(rgb.line), unit(rgb.floor));
    this.bodies.forEach((body, k) => {
      const own = unit(palette.run(k));
      for (const trace of this.traces[k]) trace.colour(own);
      this.fittings[k]?.colour({ cart: runs.length > 1 ? own : unit(rgb.bob), spring: unit(rgb.rod), rail: unit(rgb.edge), pivot: unit(rgb.ink) });
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
      this.fittings[k]?.move(places);
      traced.forEach((point, n) => {
        this.traces[k][n].mesh.visible = trace > 0;
        if (trace === 0) return;
        const tip = places.subarray(3 * point, 3 * point + 3);
        this.traces[k][n].move(since, time, tip, eye, trace < 1);
      });
    });
    this.scene.fog.near = this.camera.distance + 0.8 * this.radius;
    this.scene.fog.far = this.camera.distance + 4 * this.radius;
    this.renderer.render(this.scene, this.camera.camera);
  }
}
