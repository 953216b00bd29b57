// The motion, computed by the module: a system, rows of its motion, and copies that start beside it. Runs in a worker, and
// in the tests.

/// Time between rows of a motion [s]; steps are adaptive, and end at rows.
const rowInterval = 1 / 120;

/// The tolerance of all steps: energies stay at rounding (docs/reference/laboratory.md).
const tolerance = 1e-10;

/// Starts the module, a WebAssembly.Module. It imports nothing but the clock.
async function startModule(module) {
  let memory = null;
  const nothing = () => 0;
  const noEnvironment = (count, size) => {
    const view = new DataView(memory.buffer);
    view.setUint32(count, 0, true);
    view.setUint32(size, 0, true);
    return 0;
  };
  const imports = {};
  for (const { module: from, name } of WebAssembly.Module.imports(module)) {
    imports[from] ??= {};
    imports[from][name] = name === "environ_sizes_get" ? noEnvironment : nothing;
  }
  const { exports } = await WebAssembly.instantiate(module, imports);
  memory = exports.memory;
  exports._initialize?.();
  return exports;
}

class Engine {
  #at;
  #kept = []; // pieces of memory that are freed with the model

  constructor(exports) {
    this.module = exports;
    this.model = this.simulation = 0;
    this.copies = [];
    this.shadow = null;
    this.forces = null;
  }

  // Numbers move when memory grows.
  get #numbers() {
    if (this.#at?.buffer !== this.module.memory.buffer) this.#at = new Float64Array(this.module.memory.buffer);
    return this.#at;
  }

  #take(count) {
    const place = this.module.malloc(8 * Math.max(count, 1));
    this.#kept.push(place);
    return place;
  }
  #put(numbers) {
    const place = this.#take(numbers.length);
    this.#numbers.set(numbers, place / 8);
    return place;
  }
  #read(place, count) {
    return this.#numbers.slice(place / 8, place / 8 + count);
  }
  #text(place) {
    const bytes = new Uint8Array(this.module.memory.buffer);
    let end = place;
    while (bytes[end]) ++end;
    return new TextDecoder().decode(bytes.slice(place, end));
  }
  #putText(text) {
    const bytes = new TextEncoder().encode(text);
    const place = this.module.malloc(bytes.length + 1);
    this.#kept.push(place);
    new Uint8Array(this.module.memory.buffer).set([...bytes, 0], place);
    return place;
  }

  /// Throws an Error with the module's message of its last failure.
  #fail() {
    throw new Error(this.#text(this.module.pendula_error()));
  }
  #require(good) {
    if (!good) this.#fail();
    return good;
  }

  free() {
    const { module } = this;
    for (const copy of [this.simulation, this.shadow, ...this.copies]) if (copy) module.pendula_simulation_free(copy);
    if (this.model) module.pendula_model_free(this.model);
    for (const place of this.#kept) module.free(place);
    this.#kept = [];
    this.model = this.simulation = 0;
    this.shadow = null;
    this.copies = [];
  }

  /// Begins a motion. `spec`: {space, masses, lengths, gravity, damping} of a chain, or {program, parameters}; both with
  /// `inputs`, constant parts (torques of a chain), and `sines` on them: [input, amplitude, frequency, phase] each. `start`:
  /// {time, q, v}; that of a linkage is put together, from a start {given, from} in which one coordinate was set. `step`:
  /// constant steps of 4 stages, in place of the tolerance. Throws if that makes no sense.
  begin(spec, start, step = 0) {
    this.free();
    const { module } = this;
    this.spec = spec;
    this.step = step;
    this.model = this.#require(spec.program ? this.#program(spec) : this.#chain(spec));
    this.size = module.pendula_coordinates(this.model);
    this.columns = module.pendula_columns(this.model);
    this.inputs = module.pendula_inputs(this.model);
    this.q = this.#take(this.size);
    this.v = this.#take(this.size);
    this.energies = this.#take(2);
    this.row = this.#take(this.columns);
    this.held = this.#take(this.inputs);
    this.kept = this.#take(this.size);
    this.#write(this.#closedStart(start));
    this.simulation = this.#simulation(start.time);
    this.time = start.time;
    this.isHeld = false;
    this.exponent = null;
  }

  #chain({ space, masses, lengths, gravity, damping, sines = [] }) {
    const numbers = [masses, lengths, damping, sines.flat()].map((each) => this.#put(each));
    return this.module.lab_chain(space, masses.length, numbers[0], numbers[1], gravity, numbers[2], numbers[3], sines.length);
  }
  #program({ program, parameters, sines = [] }) {
    const { module } = this;
    let model = module.pendula_model_of_program(this.#putText(program), this.#put(parameters), parameters.length);
    for (const sine of model ? sines : []) {
      const driven = module.pendula_model_driven(model, ...sine);
      module.pendula_model_free(model);
      model = this.#require(driven);
    }
    return model;
  }

  #write({ q, v }) {
    this.#numbers.set(q, this.q / 8);
    this.#numbers.set(v, this.v / 8);
  }
  // A simulation from a time, with its inputs held.
  #simulation(time) {
    const simulation = this.#require(this.module.lab_simulation(this.model, time, this.q, this.v, this.step, tolerance, this.step ? 4 : 8));
    if (this.spec.inputs?.some((each) => each !== 0)) {
      this.#numbers.set(this.spec.inputs, this.held / 8);
      this.#require(this.module.pendula_hold(simulation, this.held, this.inputs) === 0);
    }
    return simulation;
  }

  /// Names of the columns of a row of the model.
  get names() {
    return Array.from({ length: this.columns }, (_, k) => this.#text(this.module.pendula_column_name(this.model, k)));
  }

  motion(simulation = this.simulation) {
    this.module.pendula_motion(simulation, this.q, this.v);
    return { time: this.time, q: this.#read(this.q, this.size), v: this.#read(this.v, this.size) };
  }

  /// Size of a row: t, q, v, kinetic and potential energy, and for programs components of points and of their velocities.
  get rowSize() {
    return 3 + 2 * this.size + 2 * this.pointCount;
  }
  get pointCount() {
    return this.spec.program ? this.spec.components.reduce((sum, count) => sum + count, 0) : 0;
  }
  /// Whether there are constraints: the columns that are left are their forces.
  get isLinkage() {
    return Boolean(this.spec.program) && this.columns > 2 + 2 * this.size + this.inputs + this.pointCount;
  }

  /// The row of the present motion.
  present() {
    const { module, size } = this;
    const row = new Float64Array(this.rowSize);
    module.pendula_motion(this.simulation, this.q, this.v);
    module.pendula_energies(this.model, this.time, this.q, this.v, this.energies);
    row[0] = this.time;
    row.set(this.#read(this.q, size), 1);
    row.set(this.#read(this.v, size), 1 + size);
    row.set(this.#read(this.energies, 2), 1 + 2 * size);
    if (this.pointCount) {
      const motion = { time: this.time, q: row.subarray(1, 1 + size), v: row.subarray(1 + size, 1 + 2 * size) };
      row.set(this.pointsAt(motion.q), 3 + 2 * size);
      row.set(this.pointRates(motion), 3 + 2 * size + this.pointCount);
    }
    return row;
  }

  /// Velocities of points, by central differences along the motion: pivots may move by themselves.
  pointRates({ time, q, v }) {
    const by = 1e-5 / (1 + Math.max(...v.map(Math.abs)));
    const [before, after] = [-by, by].map((h) => this.pointsAt(q.map((x, k) => x + h * v[k]), time + h));
    return after.map((x, k) => (x - before[k]) / (2 * by));
  }

  /// Points at any coordinates, of a program.
  pointsAt(q, time = this.time) {
    const v = new Float64Array(this.size);
    this.#write({ q, v });
    this.#require(this.module.pendula_row(this.model, time, this.q, this.v, 0, this.row) === 0);
    return this.#read(this.row + 8 * (1 + 2 * this.size + this.inputs), this.pointCount);
  }

  /// The motion on the constraints that is nearest; coordinates whose numbers are in `kept` stay. Throws OpenLinkage.
  closed(motion, kept = []) {
    if (!this.isLinkage) return motion;
    const { module, size } = this;
    this.#write(motion);
    new Int32Array(module.memory.buffer, this.kept, size).set(Array.from({ length: size }, (_, k) => Number(kept.includes(k))));
    if (module.pendula_assemble(this.model, motion.time, this.kept, this.q, this.v) !== 0) throw new OpenLinkage(this.#text(module.pendula_error()));
    return { time: motion.time, q: this.#read(this.q, size), v: this.#read(this.v, size) };
  }

  /// A start on the constraints. The coordinate `given` of a linkage goes from where it is in `from` as far towards what it is
  /// in q as it can, in short parts, lest the linkage comes out put together in another way.
  #closedStart({ time, q, v, given, from }) {
    if (!from || !this.isLinkage) return this.closed({ time, q, v });
    let now = this.closed({ time, q: from, v });
    for (let part = 0.02; part > 1e-4 && now.q[given] !== q[given]; ) {
      const next = now.q.slice();
      const left = q[given] - next[given];
      next[given] = Math.abs(left) > part ? next[given] + Math.sign(left) * part : q[given];
      try {
        now = this.closed({ ...now, q: next }, [given]);
      } catch {
        part /= 4;
      }
    }
    return now;
  }

  /// Advances to the next row. `hand`: a pull at a chain, {bob, place, speed}, or null.
  next(hand) {
    const target = Math.round((this.time + rowInterval) / rowInterval) * rowInterval;
    if (hand || this.isHeld) {
      const middle = (this.time + target) / 2;
      for (const time of [middle, target]) {
        this.#hold(hand);
        this.#advance(this.simulation, time);
        this.time = time;
      }
    } else {
      this.#advance(this.simulation, target);
    }
    this.time = target;
    for (const copy of this.copies) this.#advance(copy, target);
    if (this.shadow) this.#follow();
  }

  #advance(simulation, time) {
    this.#require(this.module.pendula_advance_to(simulation, time) === 0);
  }

  /// A damped spring between a bob and the hand, as torques on the links from the pivot to the bob, held for half a row.
  #hold(hand) {
    const { space, lengths, masses, gravity } = this.spec;
    const own = this.spec.inputs ?? [];
    const torques = Float64Array.from({ length: this.inputs }, (_, k) => own[k] ?? 0);
    this.isHeld = hand !== null;
    if (hand) {
      const { q, v } = this.motion();
      const rods = rodsOfAngles(space, lengths, q);
      const rates = ratesOfRods(space, lengths, q, v);
      const [place, speed] = [rods, rates].map((all) => sumOf(all.slice(0, hand.bob + 1), space));
      const stiff = masses[hand.bob] * 40 ** 2;
      const weight = gravity * masses.slice(hand.bob).reduce((sum, mass) => sum + mass, 0);
      const most = 0.25 * lengths.reduce((sum, length) => sum + length, 0);
      const off = place.map((x, axis) => hand.place[axis] - x);
      const far = Math.max(1, Math.hypot(...off) / most);
      const force = off.map((d, axis) => (stiff * d) / far + 2 * masses[hand.bob] * 40 * (hand.speed[axis] - speed[axis]));
      force[space - 1] += weight;
      for (let link = 0; link <= hand.bob; ++link) putTorque(torques, space, link, rods[link], force);
    }
    this.#numbers.set(torques, this.held / 8);
    this.#require(this.module.pendula_hold(this.simulation, this.held, this.inputs) === 0);
  }

  /// The shape of a program's points, found from several coordinates about q. `hangs`: what each point hangs on rigidly: the
  /// point before, for the first the origin (-1) if it moves, or nothing (-2). `rails`: the constant direction in which each
  /// moves, else null. `arms`: rods and `connections`, [from, to], that turn. `components`: number for each point.
  shape(q, components, connections) {
    const firsts = components.map((_, k) => components.slice(0, k).reduce((sum, count) => sum + count, 0));
    const draws = [0, 0.37, -0.81, 1.3].map((by) => this.pointsAt(q.map((x, k) => x + by * (1 + 0.4 * k))));
    const way = (points, k) => Array.from({ length: components[k] }, (_, axis) => points[firsts[k] + axis] - draws[0][firsts[k] + axis]);
    const distance = (points, k) => {
      let square = 0;
      for (let axis = 0; axis < components[k]; ++axis) {
        const before = k > 0 && axis < components[k - 1] ? points[firsts[k - 1] + axis] : 0;
        square += (points[firsts[k] + axis] - before) ** 2;
      }
      return Math.sqrt(square);
    };
    const hangs = components.map((_, k) => {
      const all = draws.map((points) => distance(points, k));
      const moves = k > 0 || draws.some((points) => way(points, k).some((x) => x !== 0));
      return moves && all[0] > 0 && all.every((each) => Math.abs(each - all[0]) < 1e-9 * all[0]) ? k - 1 : -2;
    });
    const place = (points, k) => (k < 0 ? [0, 0, 0] : points.slice(firsts[k], firsts[k] + components[k]));
    const upward = (points, [from, to]) => {
      const start = place(points, from);
      const along = Array.from(place(points, to), (x, axis) => x - start[axis]);
      return along.at(-1) / Math.hypot(...along);
    };
    const turns = (ends) => {
      const all = draws.map((points) => upward(points, ends));
      return all.every(Number.isFinite) && all.some((each) => Math.abs(each - all[0]) > 1e-9);
    };
    const rods = hangs.map((on, k) => [on, k]).filter(([on]) => on > -2);
    return {
      hangs, arms: [...rods, ...connections].filter(turns),
      rails: components.map((_, k) => directionOf(draws.slice(1).map((points) => way(points, k)))),
    };
  }

  /// Advances to a time without rows in between.
  go(time) {
    this.#advance(this.simulation, time);
    this.time = time;
  }

  get steps() {
    return this.module.pendula_steps(this.simulation);
  }

  /// Makes copies, each a little further from the one before in every coordinate, since a motion may not depend on some;
  /// of a linkage as far as that goes.
  copy(count, apart) {
    for (const copy of this.copies) this.module.pendula_simulation_free(copy);
    let last = this.motion();
    this.copies = Array.from({ length: count }, () => {
      last = this.closed({ ...last, q: last.q.map((x) => x + apart) });
      this.#write(last);
      return this.#simulation(this.time);
    });
  }

  /// Coordinates of the copies, one after the other.
  copiesNow() {
    const all = new Float64Array(this.copies.length * this.size);
    this.copies.forEach((copy, k) => all.set(this.motion(copy).q, k * this.size));
    return all;
  }
  /// Points of the copies, of a program.
  copyPoints() {
    const all = new Float64Array(this.copies.length * this.pointCount);
    if (this.pointCount) this.copies.forEach((copy, k) => all.set(this.pointsAt(this.motion(copy).q), k * this.pointCount));
    return all;
  }

  /// Begins or ends to measure the leading Lyapunov exponent, by a copy that is brought back to the motion every half second.
  measure(on) {
    if (this.shadow) this.module.pendula_simulation_free(this.shadow);
    this.shadow = null;
    this.exponent = null;
    if (!on) return;
    const here = this.motion();
    const way = { q: here.q.map(() => 1), v: here.v.map(() => 0) };
    const distance = this.#besides(here, way);
    this.shadow = this.#simulation(this.time);
    this.exponent = { since: this.time, last: this.time, sum: 0, value: NaN, distance };
  }

  #follow() {
    const { exponent } = this;
    this.#advance(this.shadow, this.time);
    if (this.time - exponent.last < 0.5 - 1e-9) return;
    const here = this.motion();
    const way = differenceOf(this.motion(this.shadow), here);
    exponent.sum += Math.log(sizeOf(way) / exponent.distance);
    exponent.last = this.time;
    exponent.value = exponent.sum / (this.time - exponent.since);
    exponent.distance = this.#besides(here, way);
    this.#require(this.module.pendula_restart(this.shadow, this.time, this.q, this.v) === 0);
  }

  // Writes a motion that is about shadowDistance away from another one, and gives the distance.
  #besides(here, way) {
    const factor = shadowDistance / sizeOf(way);
    const there = this.closed({ ...here, q: here.q.map((x, k) => x + factor * way.q[k]), v: here.v.map((x, k) => x + factor * way.v[k]) });
    this.#write(there);
    return this.isLinkage ? sizeOf(differenceOf(there, here)) : shadowDistance;
  }
}

/// A linkage that cannot be put together, and what is left over.
class OpenLinkage extends Error {}

const shadowDistance = 1e-7;
