// Puts the parts together: the laboratory.

class Lab {
  constructor() {
    this.state = stateOf(location.hash.slice(1) || (moved === beginning && beginning.state) || "");
    this.history = new History((row) => this.#tipOf(row));
    this.stage = new Bench(at("canvas"));
    this.computer = new Computer();
    this.hand = new Hand(this);
    this.looks = new Looks(this);
    this.clock = this.shown = this.state.t;
    this.playing = false;
    this.since = 0;
    this.energy = 0;
    this.energyScale = 1;
    this.show = new Set(this.state.show);
    this.isMeasuring = false;
    this.copies = null;
    this.watch = new Watch(this);
    this.isDue = true;
    this.frames = 0;
  }

  async start() {
    this.looks.read();
    this.controls = new Controls(this);
    this.#begin();
    this.panels = [new EnergyPanel(this), new InputsPanel(this), new PhasePanel(this), new CopiesPanel(this), new ErrorPanel(this), new SectionPanel(this), new ExponentPanel(this)];
    for (const panel of this.panels) panel.begin?.();
    writeTexts(language);
    this.controls.make();
    new Keys(this);
    this.stage.resize();
    this.#draw(); // the start needs no module
    performance.mark("pendula first frame");
    requestAnimationFrame((now) => this.#frame(now));
    await this.computer.start();
    performance.mark("pendula module");
    await this.send();
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) this.play(true);
  }

  // --- What moves ---

  get size() {
    return this.state.q.length;
  }
  get coordinates() {
    return coordinatesOf(this.state);
  }
  get units() {
    return model ? model.coordinates.map((each) => each.unit) : this.state.q.map(() => "rad");
  }
  get isAngle() {
    return this.units.map((unit) => unit === "rad");
  }

  // Sets the shape of the stage and the first row, from the state alone.
  #begin() {
    const { state, stage } = this;
    if (model) {
      const space = Math.max(2, ...model.points.map((point) => point.columns.length));
      const count = model.points.length;
      const spread = Math.max(...(this.#points ?? [0.8]).map(Math.abs), 1e-3);
      stage.shape({ space, count, ...shapeOf(model, this.#shape), masses: model.points.map(() => 0), reach: (model.points.some(({ kind }) => kind === "floor") ? 1.1 : 1.5) * spread });
      this.row = new Float64Array(3 + 2 * this.size);
    } else {
      const reach = state.l.reduce((sum, length) => sum + length, 0);
      stage.shape({ space: state.space, count: state.n, hangs: state.m.map((_, k) => k - 1), arms: state.m.map((_, k) => [k - 1, k]), kinds: state.m.map(() => "bob"), rails: [], connections: [], masses: state.m, reach });
      this.row = new Float64Array(3 + 2 * this.size);
    }
    this.row.set(state.q, 1);
    this.row.set(state.v, 1 + this.size);
  }
  #points = null;
  #shape = null;

  /// Sends the system to the worker, with the present row as its start.
  async send() {
    const { state } = this;
    const start = { time: this.shown, q: Float64Array.from(this.row.subarray(1, 1 + this.size)), v: Float64Array.from(this.row.subarray(1 + this.size, 1 + 2 * this.size)), ...this.given };
    this.given = {};
    const order = (this.order = (this.order ?? 0) + 1);
    this.isSending = true;
    try {
      const answer = await this.computer.ask("begin", { spec: specOf(state), start, copies: state.copies, apart: state.apart, measure: this.isMeasuring });
      if (order !== this.order || this.isWaiting) return; // another one follows
      this.#trouble("");
      if (this.history.rowSize !== answer.rowSize || this.history.rows === 0) this.history.clear(answer.rowSize);
      else this.history.cut(start.time - 1e-9);
      this.history.add(answer.rows);
      this.since = start.time;
      const [kinetic, potential] = answer.rows.subarray(1 + 2 * this.size, 3 + 2 * this.size);
      this.energy = kinetic + potential;
      this.energyScale = energyScaleOf(state, kinetic, potential);
      this.row = answer.rows.slice();
      if (model && start.time === state.t) {
        this.startsAt(this.row); // a linkage was put together
        this.controls.refresh();
      }
      this.good = { p: state.p.slice(), q: state.q.slice(), v: state.v.slice() };
      this.clock = this.shown = start.time;
      this.copies = null;
      for (const panel of this.panels) if (panel instanceof CopiesPanel || panel instanceof ExponentPanel || panel instanceof InputsPanel) panel.begin();
      if (model && !this.#points) {
        this.#points = answer.rows.subarray(3 + 2 * this.size, 3 + 2 * this.size + pointColumns);
        this.#shape = answer.shape;
        this.#begin();
        this.row = answer.rows.slice();
      }
    } catch (error) {
      if (order !== this.order || this.isWaiting) return;
      if (error.isOpen && this.good) this.#goBack(error);
      else this.#fail(error);
    } finally {
      if (order === this.order) this.isSending = false;
      this.isDue = true;
    }
  }

  // A linkage that cannot be put together so goes on as it was.
  async #goBack(error) {
    const { good } = this;
    this.good = null; // it is tried once
    Object.assign(this.state, good);
    if (this.history.rows === 0) this.#begin();
    this.controls.refresh();
    this.looks.writeLink();
    await this.send();
    if (this.good) this.#trouble(text("open", { what: error.message }));
  }

  /// Changes numbers of the system; the motion goes on from the shown state.
  change(numbers) {
    Object.assign(this.state, numbers);
    this.#reshape();
    this.later();
  }

  /// Sets another number of links, or another space, and starts again.
  setLinks(n, space) {
    Object.assign(this.state, { n, space });
    resize(this.state);
    this.controls.make();
    this.again();
    for (const panel of this.panels) panel.begin?.();
  }

  /// Sets another start, and begins there. `given`: the one coordinate that was set; those of a linkage follow it.
  startFrom(numbers, given) {
    Object.assign(this.state, numbers);
    this.given = { given, from: this.good?.q };
    this.again();
  }

  /// Begins again at the start of the link.
  again() {
    this.hand.letGo();
    this.#begin();
    this.restart();
    this.panels.forEach((panel) => panel instanceof SectionPanel && panel.begin());
  }

  /// Drops all computed rows.
  restart() {
    this.shown = this.clock = this.state.t;
    this.history.clear(this.history.rowSize);
    this.later();
  }

  #reshape() {
    if (model) return;
    const row = this.row;
    this.#begin();
    if (row.length >= this.row.length) this.row = row;
  }

  // Sends the state a little later: sliders move faster than the worker can begin.
  later() {
    this.isDue = true;
    this.looks.writeLink();
    if (this.isWaiting) return;
    this.isWaiting = true;
    setTimeout(() => {
      this.isWaiting = false;
      this.send();
    }, 30);
  }

  changed() {
    this.isDue = true;
  }

  setCopies(count, apart) {
    Object.assign(this.state, { copies: count, apart });
    this.panels.find((panel) => panel instanceof CopiesPanel).begin();
    this.copies = null;
    if (this.shown < this.history.end - 1e-9) this.send();
    else this.computer.ask("copy", { copies: count, apart }).catch((error) => this.#fail(error));
    this.looks.writeLink();
    if (count) this.play(true);
    this.changed();
  }

  measure(on) {
    this.isMeasuring = on;
    this.panels.find((panel) => panel instanceof ExponentPanel).begin();
    this.computer.ask("measure", { on }).catch((error) => this.#fail(error));
    if (on) this.play(true);
    this.changed();
  }

  // --- Time ---

  play(on = !this.playing) {
    if (this.playing && !on) this.clock = this.shown; // the clock may be ahead of the computed rows
    this.playing = on;
    this.last = null;
    document.documentElement.classList.toggle("playing", on);
    at("play").setAttribute("aria-label", text(on ? "pause" : "play"));
    at("play").title = text(on ? "pause" : "play");
    this.changed();
  }

  get isLive() {
    return this.clock >= this.history.end - 2 * 0.02;
  }

  seek(time) {
    this.clock = this.shown = clamp(time, this.history.start, this.history.end);
    this.changed();
  }

  /// Steps by one sixtieth of a second, back or forth; at the end more rows are computed.
  step(way) {
    this.play(false);
    const target = this.clock + way / 60;
    if (target > this.history.end) this.#ask(target);
    this.clock = Math.max(target, this.history.start);
    this.changed();
  }

  #ask(until) {
    if (this.asked || this.isSending || this.isWaiting || this.history.rows === 0 || this.isBroken) return;
    this.asked = true;
    const { order } = this;
    const holds = this.hand.isHolding && !model;
    this.computer.ask("advance", { until, hand: holds ? this.hand.told(this.state.space) : null }).then((answer) => {
      if (order !== this.order || this.isWaiting) return;
      this.history.add(answer.rows);
      this.work = answer.milliseconds;
      this.isLate = answer.isLate;
      if (holds && answer.rows.length) this.#rebase();
      if (answer.copies && answer.rows.length) this.#takeCopies(answer.copies);
      if (answer.exponent) this.panels.find((panel) => panel instanceof ExponentPanel).add(...answer.exponent);
      this.changed();
    }).catch((error) => order === this.order && this.#fail(error)).finally(() => (this.asked = false));
  }

  // The hand changes the energy: from now on, energy errors are relative to the present one.
  #rebase() {
    const { history, size } = this;
    const row = history.rows - 1;
    this.since = history.time(row);
    this.energy = history.get(row, 1 + 2 * size) + history.get(row, 2 + 2 * size);
  }

  #takeCopies({ all, points }) {
    const { size, stage, state } = this;
    const count = all.length / size;
    const each = 3 * stage.count;
    if (!this.copies || this.copies.count !== count) this.copies = { count, places: new Float64Array(count * each) };
    for (let k = 0; k < count; ++k) {
      const places = this.copies.places.subarray(k * each, (k + 1) * each);
      if (model) placePoints(points.subarray(k * pointColumns, (k + 1) * pointColumns), places);
      else placesOfChain(state, all.subarray(k * size, (k + 1) * size), places);
    }
    const { history } = this;
    const row = history.rows - 1;
    let largest = 0;
    const { isAngle } = this;
    for (let k = 0; k < count; ++k) {
      for (let i = 0; i < size; ++i) {
        const off = all[k * size + i] - history.get(row, 1 + i);
        largest = Math.max(largest, Math.abs(isAngle[i] ? wrap(off) : off));
      }
    }
    this.panels.find((panel) => panel instanceof CopiesPanel).add(history.end, largest);
  }

  #fail(error) {
    this.isBroken = true;
    this.play(false);
    this.#trouble(text("trouble", { what: error.message }));
  }
  #trouble(words) {
    if (!words) this.isBroken = false;
    at("trouble").hidden = !words;
    at("trouble").textContent = words;
  }

  /// Places of the points in the last quarter of a second of wall time, the newest first; none when paused.
  placesBefore() {
    const { history, stage, state, size } = this;
    if (!this.playing || history.rows === 0) return [];
    return Array.from({ length: 10 }, (_, k) => {
      const row = history.at(Math.max(this.shown - 0.025 * (k + 1) * state.speed, history.start), size, new Float64Array(history.rowSize));
      return placesOf(state, row, new Float64Array(3 * stage.count));
    });
  }

  /// Makes a row the start of the motion.
  startsAt(row) {
    const { size } = this;
    this.state.q = Array.from(row.subarray(1, 1 + size));
    this.state.v = Array.from(row.subarray(1 + size, 1 + 2 * size));
  }

  // --- Frames ---

  #frame(now) {
    const passed = this.last === null || this.last === undefined ? 0 : Math.min((now - this.last) / 1000, 0.1);
    this.last = now;
    const { history } = this;
    this.hand.move(passed);
    if (this.playing && history.rows) {
      this.clock = Math.min(this.clock + passed * this.state.speed, history.end + 0.05);
      this.isDue = true;
    }
    if (history.rows && this.clock + 0.012 > history.end && (this.playing || this.clock > history.end)) this.#ask(this.clock + 0.02);
    if (this.isDue) {
      this.isDue = false;
      this.#draw();
    }
    requestAnimationFrame((next) => this.#frame(next));
  }

  #draw() {
    const { history, stage, state, size } = this;
    ++this.frames;
    if (history.rows && !this.hand.isPosed && !this.isSending && !this.isWaiting) {
      this.shown = Math.min(this.clock, history.end);
      if (this.row.length !== history.rowSize) this.row = new Float64Array(history.rowSize);
      history.at(this.shown, size, this.row);
    }
    placesOf(state, this.row, stage.places);
    stage.draw({
      places: stage.places,
      rates: this.show.has("velocities") ? ratesOf(state, this.row, new Float64Array(3 * stage.count)) : null,
      trace: this.show.has("trace") ? this.#trace() : null,
      copies: state.copies ? this.copies : null,
      held: this.hand.isHolding ? this.hand.seen : null,
      show: this.show,
    });
    const due = this.playing ? [this.panels[this.frames % this.panels.length]] : this.panels;
    if (history.rows) for (const panel of due) if (panel.isSeen) panel.draw(); // energies are those of a computed row
    this.#writeTime();
    if (this.shown > 12) at("hint").classList.add("gone"); // after some seconds it is not needed
  }

  // The trace of the last point, up to the shown time, of 3 seconds at most.
  #trace() {
    const { history, stage } = this;
    if (history.rows < 2) return null;
    const to = history.rowAt(this.shown);
    const from = history.rowAt(Math.max(this.shown - 3, history.start));
    const trace = new Float32Array(3 * (to - from + 2));
    trace.set(history.tips.subarray(3 * from, 3 * (to + 1)));
    trace.set(stage.places.subarray(3 * (stage.count - 1), 3 * stage.count), 3 * (to - from + 1));
    return trace;
  }

  #tipOf(row) {
    const { stage, state } = this;
    const last = 3 * (stage.count - 1);
    const spare = this.spare?.length === last + 3 ? this.spare : (this.spare = new Float64Array(last + 3));
    return placesOf(state, row, spare).subarray(last, last + 3);
  }

  #writeTime() {
    const { history, shown } = this;
    const words = `${steady(shown)} s`;
    if (words !== this.written) at("clock").textContent = this.written = words;
    const scrub = at("scrub");
    if (this.frames % 4 === 0 || !this.playing) {
      scrub.min = history.start, scrub.max = Math.max(history.end, history.start + 1e-3), scrub.value = shown;
      scrub.setAttribute("aria-valuetext", words);
      at("now").hidden = this.isLive || history.rows < 2;
      this.watch.write();
    }
  }
}

const lab = new Lab();
lab.start().catch((error) => {
  at("trouble").hidden = false;
  at("trouble").textContent = text("trouble", { what: error.message });
});
// For tests, and for pages that embed this one.
window.pendulaLab = lab;
