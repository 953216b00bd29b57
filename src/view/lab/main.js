// Puts the parts together: the laboratory.

class Lab {
  constructor() {
    this.state = stateOf(location.hash.slice(1) || (moved === beginning && beginning.state) || "");
    this.history = new History((row) => this.#tipOf(row));
    this.stage = new Stage(at("canvas"));
    this.computer = new Computer();
    this.hand = new Hand();
    this.clock = this.shown = this.state.t;
    this.playing = false;
    this.since = 0;
    this.energy = 0;
    this.energyScale = 1;
    this.show = new Set(this.state.show);
    this.isMeasuring = false;
    this.copies = null;
    this.watch = { running: false, from: 0, value: 0, turns: [] };
    this.isDue = true;
    this.frames = 0;
  }

  async start() {
    this.#look();
    this.controls = new Controls(this);
    this.#begin();
    this.panels = [new EnergyPanel(this), new InputsPanel(this), new PhasePanel(this), new CopiesPanel(this), new ErrorPanel(this), new SectionPanel(this), new ExponentPanel(this)];
    for (const panel of this.panels) panel.begin?.();
    writeTexts(language);
    this.controls.make();
    this.#listen();
    this.stage.resize();
    this.#draw(); // what is at the start needs no module
    performance.mark("pendula first frame");
    requestAnimationFrame((now) => this.#frame(now));
    await this.computer.start();
    performance.mark("pendula module");
    await this.#send();
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) this.play(true);
  }

  // --- What moves ---

  get size() {
    return this.state.q.length;
  }
  get coordinates() {
    if (model) return model.coordinates.map((each) => each.name);
    const { n, space } = this.state;
    const names = Array.from({ length: n }, (_, k) => `theta_${k + 1}`);
    return space === 2 ? names : names.concat(names.map((name) => name.replace("theta", "phi")));
  }
  get units() {
    return model ? model.coordinates.map((each) => each.unit) : this.state.q.map(() => "rad");
  }
  get isAngle() {
    return this.units.map((unit) => unit === "rad");
  }

  // The shape of what is drawn, and its first row, from the state alone.
  #begin() {
    const { state, stage } = this;
    if (model) {
      const space = Math.max(2, ...model.points.map((point) => point.columns.length));
      const count = model.points.length;
      const spread = Math.max(...(this.#points ?? [0.8]).map(Math.abs), 1e-3);
      stage.shape({ space, count, ...shapeOf(model, this.#shape), masses: model.points.map(() => 1), reach: (model.points.some(({ kind }) => kind === "floor") ? 1.1 : 1.5) * spread });
      this.row = new Float64Array(3 + 2 * this.size);
    } else {
      const reach = state.l.reduce((sum, length) => sum + length, 0);
      stage.shape({ space: state.space, count: state.n, hangs: state.m.map((_, k) => k - 1), arms: state.m.map((_, k) => [k - 1, k]), kinds: [], rails: [], connections: [], masses: state.m, reach });
      this.row = new Float64Array(3 + 2 * this.size);
    }
    this.row.set(state.q, 1);
    this.row.set(state.v, 1 + this.size);
  }
  #points = null;
  #shape = null;

  /// Sends what moves to the worker, from the present row or the start.
  async #send() {
    const { state } = this;
    const start = { time: this.shown, q: Float64Array.from(this.row.subarray(1, 1 + this.size)), v: Float64Array.from(this.row.subarray(1 + this.size, 1 + 2 * this.size)) };
    const order = (this.order = (this.order ?? 0) + 1);
    this.isSending = true;
    try {
      const answer = await this.computer.ask("begin", { spec: specOf(state), start, copies: state.copies, apart: state.apart, measure: this.isMeasuring });
      if (order !== this.order) return;
      this.#trouble("");
      if (this.history.rowSize !== answer.rowSize || this.history.rows === 0) this.history.clear(answer.rowSize);
      else this.history.cut(start.time - 1e-9);
      this.history.add(answer.rows);
      this.since = start.time;
      const [kinetic, potential] = answer.rows.subarray(1 + 2 * this.size, 3 + 2 * this.size);
      this.energy = kinetic + potential;
      this.energyScale = this.#scaleOf(kinetic, potential);
      this.row = answer.rows.slice();
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
      if (order === this.order) this.#fail(error);
    } finally {
      if (order === this.order) this.isSending = false;
      this.isDue = true;
    }
  }

  // Σ M g l of a chain, as in the program's summaries; otherwise the energies themselves.
  #scaleOf(kinetic, potential) {
    const { m, l, g, n } = this.state;
    let [below, sum] = [0, 0];
    for (let k = n - 1; k >= 0 && !model; --k) sum += (below += m[k]) * Math.abs(g) * l[k];
    return sum || [Math.abs(kinetic), Math.abs(potential)].filter((each) => each > 1e-12).sort((a, b) => b - a)[0] || 1;
  }

  /// Changes numbers of what moves; the motion goes on from where it is shown.
  change(numbers) {
    Object.assign(this.state, numbers);
    this.#reshape();
    this.#later();
  }

  /// Another number of links, or another space: from the start.
  setLinks(n, space) {
    Object.assign(this.state, { n, space });
    resize(this.state);
    this.controls.make();
    this.again();
    for (const panel of this.panels) panel.begin?.();
  }

  /// Goes to another start, and begins there.
  startFrom(numbers) {
    Object.assign(this.state, numbers);
    this.again();
  }

  /// Something else moves, of so many links: the page begins again, with the same looks.
  go(name, links = 0) {
    const { level, lang, theme } = this.state;
    const looks = Object.entries({ level, lang, theme }).filter(([, value]) => value).map(([key, value]) => `&${key}=${value}`);
    clearTimeout(this.writing);
    location.hash = `model=${name || ""}${links ? `&n=${links}` : ""}${looks.join("")}`;
  }

  /// Begins again where the link begins.
  again() {
    this.hand.letGo();
    this.shown = this.clock = this.state.t;
    this.history.clear(this.history.rowSize);
    this.#begin();
    this.watch.turns = [];
    this.#later();
    this.panels.forEach((panel) => panel instanceof SectionPanel && panel.begin());
  }

  #reshape() {
    if (model) return;
    const row = this.row;
    this.#begin();
    if (row.length >= this.row.length) this.row = row;
  }

  // Sliders move faster than the worker begins.
  #later() {
    this.isDue = true;
    this.#writeLink();
    if (this.isWaiting) return;
    this.isWaiting = true;
    setTimeout(() => {
      this.isWaiting = false;
      this.#send();
    }, 30);
  }

  changed() {
    this.isDue = true;
  }

  setCopies(count, apart) {
    Object.assign(this.state, { copies: count, apart });
    this.panels.find((panel) => panel instanceof CopiesPanel).begin();
    this.copies = null;
    if (this.shown < this.history.end - 1e-9) this.#send();
    else this.computer.ask("copy", { copies: count, apart }).catch((error) => this.#fail(error));
    this.#writeLink();
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
    if (this.playing && !on) this.clock = this.shown; // where the computing is late, the clock is ahead of it
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

  /// One sixtieth of a second, back or on; at the end more is computed.
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

  // The hand changes the energy: what it is measured from is now.
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
      if (model) this.#placePoints(points.subarray(k * pointColumns, (k + 1) * pointColumns), places);
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

  // --- The hand ---

  /// Places of the points in the last quarter of a second of the clock on the wall, the newest first; none when paused.
  placesBefore() {
    const { history, stage, state, size } = this;
    if (!this.playing || history.rows === 0) return [];
    return Array.from({ length: 10 }, (_, k) => {
      const row = history.at(Math.max(this.shown - 0.025 * (k + 1) * state.speed, history.start), size, new Float64Array(history.rowSize));
      const places = new Float64Array(3 * stage.count);
      if (model) this.#placePoints(row.subarray(3 + 2 * size), places);
      else placesOfChain(state, row.subarray(1, 1 + size), places);
      return places;
    });
  }

  take(bob, x, y) {
    const place = Array.from(this.stage.places.subarray(3 * bob, 3 * bob + 3));
    this.hand.take(bob, place);
    this.grip = [place, this.stage.placeAt(x, y, place)];
    this.wasPlaying = this.playing;
    if (model) this.play(false);
    if (this.shown < this.history.end - 1e-9 && this.playing) this.#send(); // from what is shown, not from the end
    at("hint").classList.add("gone");
    this.changed();
  }

  drag(x, y) {
    if (!this.hand.isHolding) return;
    const [first, begin] = this.grip;
    const now = this.stage.placeAt(x, y, first);
    this.moveHand(now.map((c, axis) => first[axis] + c - begin[axis]));
  }

  moveHand(place) {
    this.hand.wanted = place;
    if (!this.playing && !this.throws) this.#pose(place);
    this.changed();
  }

  /// Whether a point of a model is held that will have the speed of the hand: time waits meanwhile.
  get throws() {
    return Boolean(model) && this.hand.isHolding && this.wasPlaying;
  }

  // At rest, and where the hand is.
  #pose(place) {
    const { hand, state, row, size } = this;
    if (model) {
      this.posing ??= this.#poseModel(hand.bob, place).finally(() => (this.posing = null));
      return;
    }
    row.set(posedChain(state, row.subarray(1, 1 + size), hand.bob, place), 1);
    row.fill(0, 1 + size, 1 + 2 * size);
    this.isPosed = true;
    this.changed();
  }
  async #poseModel(bob, place, speed = [0, 0, 0]) {
    const { size, order } = this;
    const first = model.points.slice(0, bob).reduce((sum, each) => sum + each.columns.length, 0);
    const of = ([x, y, z]) => (model.points[bob].columns.length === 2 ? [x, z] : [x, y, z]);
    const asked = { q: this.row.slice(1, 1 + size), time: this.state.t, first, place: of(place), speed: of(speed) };
    const answer = await this.computer.ask("pose", asked).catch(() => null);
    if (!answer || order !== this.order) return;
    this.row.set(answer.q, 1);
    this.row.set(answer.v, 1 + size);
    this.row.set(answer.points, 3 + 2 * size);
    this.row.set(answer.rates, 3 + 2 * size + pointColumns);
    this.isPosed = true;
    this.changed();
  }

  async drop() {
    const { hand, order, throws } = this;
    if (!hand.isHolding) return;
    const { bob } = hand;
    hand.letGo();
    if (model) {
      await this.posing;
      if (throws) await this.#poseModel(bob, hand.place, hand.speed);
      else if (this.isPosed) await this.#poseModel(bob, hand.wanted); // where the hand was last
      if (order !== this.order || hand.isHolding) return;
    }
    if (this.isPosed) {
      this.isPosed = false;
      this.#startIsNow(this.row);
      this.history.clear(this.history.rowSize);
      this.shown = this.clock = this.state.t;
      this.#later();
      this.play(model ? this.wasPlaying : false);
      this.controls.refresh();
    } else if (this.playing) {
      // What follows is a motion of its own, from here on.
      const last = this.history.rows - 1;
      const numbers = this.history.numbers.subarray(last * this.history.rowSize, (last + 1) * this.history.rowSize);
      this.#startIsNow(numbers);
      if (isDriven(this.state)) [this.state.t] = numbers; // what drives it does not begin again
      this.controls.refresh();
      this.#writeLink();
    }
    say(text("said.dropped"));
    this.changed();
  }

  #startIsNow(row) {
    const { size } = this;
    this.state.q = Array.from(row.subarray(1, 1 + size));
    this.state.v = Array.from(row.subarray(1 + size, 1 + 2 * size));
  }

  // --- Frames ---

  #frame(now) {
    const passed = this.last === null || this.last === undefined ? 0 : Math.min((now - this.last) / 1000, 0.1);
    this.last = now;
    const { history } = this;
    if (this.hand.isHolding && (this.playing || this.throws)) this.hand.move(passed);
    if (this.throws) this.#pose(this.hand.place);
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
    if (history.rows && !this.isPosed && !this.isSending && !this.isWaiting) {
      this.shown = Math.min(this.clock, history.end);
      if (this.row.length !== history.rowSize) this.row = new Float64Array(history.rowSize);
      history.at(this.shown, size, this.row);
    }
    const q = this.row.subarray(1, 1 + size);
    if (model) this.#placePoints(this.row.subarray(3 + 2 * size));
    else placesOfChain(state, q, stage.places);
    stage.draw({
      places: stage.places,
      rates: this.show.has("velocities") ? this.#rates() : null,
      trace: this.show.has("trace") ? this.#trace() : null,
      copies: state.copies ? this.copies : null,
      held: this.hand.isHolding ? { bob: this.hand.bob, place: this.playing || this.throws ? this.hand.place : this.hand.wanted } : null,
      show: this.show,
    });
    const panel = this.panels[this.frames % this.panels.length];
    if (this.playing && panel.isSeen) panel.draw();
    if (!this.playing) for (const each of this.panels) if (each.isSeen) each.draw();
    this.#writeTime();
    if (this.shown > 12) at("hint").classList.add("gone"); // whoever looks on needs it no more
  }

  #placePoints(points, places = this.stage.places) {
    let k = 0;
    model.points.forEach((point, i) => {
      const [x, y, z] = point.columns.map(() => points[k++] ?? 0);
      places.set(z === undefined ? [x, 0, y] : [x, y, z], 3 * i);
    });
  }

  // By the rates of a chain; of a model rows have them.
  #rates() {
    const { state, row, size, stage } = this;
    const rates = new Float64Array(3 * stage.count);
    if (model) {
      this.#placePoints(row.subarray(3 + 2 * size + pointColumns), rates);
      return rates;
    }
    const sum = [0, 0, 0];
    const each = ratesOfRods(state.space, state.l, row.subarray(1, 1 + size), row.subarray(1 + size, 1 + 2 * size));
    each.forEach((rate, i) => {
      if (state.space === 2) sum[0] += rate[0], sum[2] += rate[1];
      else for (let axis = 0; axis < 3; ++axis) sum[axis] += rate[axis];
      rates.set(sum, 3 * i);
    });
    return rates;
  }

  // The way of the last point, of 3 seconds at most, to where it is now.
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
    const { stage, state, size } = this;
    const last = 3 * (stage.count - 1);
    const spare = this.spare?.length === last + 3 ? this.spare : (this.spare = new Float64Array(last + 3));
    if (model) this.#placePoints(row.subarray(3 + 2 * size), spare);
    else placesOfChain(state, row.subarray(1, 1 + size), spare);
    return spare.subarray(last, last + 3);
  }

  #writeTime() {
    const { history, shown } = this;
    const words = `${shown.toFixed(2)} s`;
    if (words !== this.written) at("clock").textContent = at("time").textContent = this.written = words;
    const scrub = at("scrub");
    if (this.frames % 4 === 0 || !this.playing) {
      scrub.min = history.start, scrub.max = Math.max(history.end, history.start + 1e-3), scrub.value = shown;
      scrub.setAttribute("aria-valuetext", words);
      at("now").hidden = this.isLive || history.rows < 2;
      this.#writeWatch();
    }
  }

  // The stopwatch, and the period of the first coordinate: from one passage upwards to the next.
  #writeWatch() {
    const { watch } = this;
    at("watch").hidden = !watch.running && watch.value === 0;
    if (at("watch").hidden) return;
    const time = watch.running ? this.shown - watch.from : watch.value;
    const period = watch.running ? this.#period() : watch.period;
    watch.period = period;
    at("watch").textContent = `${text("tool.stopwatch")} ${time.toFixed(2)} s\n${text("period")} ${period ? `${period.toFixed(3)} s` : "–"}`;
  }

  #period() {
    const { history } = this;
    const found = [];
    for (let row = history.rowAt(this.shown); row > 0 && found.length < 2 && history.time(row) > this.watch.from; --row) {
      const [a, b] = [history.get(row - 1, 1), history.get(row, 1)].map((x) => (this.isAngle[0] ? wrap(x) : x));
      if (a < 0 && b >= 0 && b - a < 2) found.push(history.time(row - 1) + (a / (a - b)) * (history.time(row) - history.time(row - 1)));
    }
    return found.length === 2 ? found[0] - found[1] : 0;
  }

  // --- Looks, links, keys ---

  #look() {
    const { state } = this;
    if (state.theme) document.documentElement.dataset.theme = state.theme;
    palette.read();
    document.documentElement.dataset.level = state.level;
    if (window.parent !== window) document.documentElement.dataset.embedded = "yes";
    at("title").dataset.text = models[named] ? `model.${named}` : beginning.title && moved === beginning ? "" : "title";
    writeTexts(state.lang || navigator.languages.map((each) => each.split("-")[0]).find((each) => texts[each]) || "en");
    at("language").replaceChildren(...Object.keys(texts).map((each) => element("option", { value: each, textContent: texts[each]["language.name"], selected: each === language })));
    at("level").value = state.level;
    at("speed").replaceChildren(...speedChoices.map((speed) => element("option", { value: speed, textContent: speed < 1 ? `1/${1 / speed}` : `${speed}×` })));
    if (!speedChoices.includes(state.speed)) at("speed").append(element("option", { value: state.speed, textContent: `${readable(state.speed)}×` }));
    at("speed").value = state.speed;
    for (const name of ["velocities", "angles", "ruler", "trace"]) at(`show-${name}`).setAttribute("aria-pressed", this.show.has(name));
    document.documentElement.dataset.ruler = this.show.has("ruler") ? "yes" : "";
  }

  #writeLink() {
    clearTimeout(this.writing);
    this.writing = setTimeout(() => {
      this.state.show = [...this.show];
      try {
        window.history.replaceState(null, "", `#${linkOf(this.state)}`);
      } catch {
        // some frames may not change their address
      }
    }, 250);
  }

  #relook() {
    this.#look();
    writeTexts(language);
    this.controls.refresh();
    for (const panel of this.panels) panel.named = null;
    this.play(this.playing);
    this.#writeLink();
    this.changed();
  }

  toggle(name) {
    if (this.show.has(name)) this.show.delete(name);
    else this.show.add(name);
    at(`show-${name}`).setAttribute("aria-pressed", this.show.has(name));
    document.documentElement.dataset.ruler = this.show.has("ruler") ? "yes" : "";
    this.#writeLink();
    this.changed();
  }

  switchTheme() {
    this.state.theme = palette.isDark ? "light" : "dark";
    this.#relook();
  }

  async copyLink() {
    this.state.show = [...this.show];
    const words = `#${linkOf(this.state)}`;
    window.history.replaceState(null, "", words);
    const address = location.href.split("#")[0] + words;
    const copied = await navigator.clipboard?.writeText(address).then(() => true, () => false);
    say(text(copied ? "said.copied" : "said.address"));
    at("link").textContent = text(copied ? "said.copied" : "said.address");
    setTimeout(() => (at("link").textContent = text("link")), 1600);
  }

  #listen() {
    const on = (id, event, act) => at(id).addEventListener(event, act);
    on("play", "click", () => this.play());
    on("again", "click", () => this.again());
    on("back", "click", () => this.step(-1));
    on("forward", "click", () => this.step(1));
    on("now", "click", () => this.seek(this.history.end));
    on("scrub", "input", () => {
      this.play(false);
      this.seek(Number(at("scrub").value));
    });
    on("speed", "change", () => {
      this.state.speed = Number(at("speed").value);
      this.#writeLink();
    });
    on("level", "change", () => {
      this.state.level = at("level").value;
      this.#relook();
    });
    on("language", "change", () => {
      this.state.lang = at("language").value;
      this.#relook();
    });
    on("theme", "click", () => this.switchTheme());
    on("link", "click", () => this.copyLink());
    on("open-help", "click", () => this.#help());
    on("reset-view", "click", () => {
      this.stage.reset();
      this.changed();
    });
    for (const name of ["velocities", "angles", "ruler", "trace"]) on(`show-${name}`, "click", () => this.toggle(name));
    on("stopwatch", "click", () => {
      const { watch } = this;
      watch.running = !watch.running;
      if (watch.running) watch.from = this.shown;
      else watch.value = this.shown - watch.from;
      at("stopwatch").setAttribute("aria-pressed", watch.running);
      this.changed();
    });
    watchStage(this.stage, {
      take: (bob, x, y) => this.take(bob, x, y),
      drag: (x, y) => this.drag(x, y),
      drop: () => this.drop(),
      changed: () => this.changed(),
      before: () => this.placesBefore(),
    });
    addEventListener("hashchange", () => this.#follow());
    addEventListener("keydown", (event) => this.#key(event));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#relook());
    new ResizeObserver(() => {
      this.stage.resize();
      this.changed();
    }).observe(at("stage"));
    new ResizeObserver(() => this.changed()).observe(at("panels"));
    addEventListener("scroll", () => this.changed(), { passive: true });
    at("panels").addEventListener("scroll", () => this.changed(), { passive: true });
  }

  // Somebody typed another link.
  #follow() {
    if (location.hash.slice(1) === linkOf(this.state)) return;
    const words = location.hash.slice(1);
    if (new URLSearchParams(words).get("model") !== named || movedBy(words) !== moved) {
      location.reload(); // something else moves
      return;
    }
    this.state = stateOf(location.hash.slice(1));
    this.show = new Set(this.state.show);
    this.#look();
    this.controls.make();
    this.again();
    for (const panel of this.panels) panel.begin?.();
  }

  #help() {
    const keys = [["Space", "play"], ["← →", "key.step"], ["Home", "again"], ["+ −", "key.speed"], ["B", "key.bob"], ["← → ↑ ↓", "key.move"], ["Enter", "key.drop"], ["V", "tool.velocities"], ["A", "tool.angles"], ["U", "tool.ruler"], ["R", "view.reset"], ["T", "theme"]];
    at("keys").replaceChildren(...keys.map(([key, words]) => element("div", {}, element("dt", {}, element("kbd", { textContent: key })), element("dd", { textContent: text(words) }))));
    at("help").showModal();
  }

  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || at("help").open) return;
    const { target } = event;
    if (target.matches?.("input, select, textarea")) return;
    if (target.matches?.("button") && (event.key === " " || event.key === "Enter")) return;
    const act = this.hand.isHolding ? this.#handKey(event.key) : this.#plainKey(event.key);
    if (!act) return;
    event.preventDefault();
    act();
  }

  #handKey(key) {
    const by = 0.05 * this.stage.reach;
    const [right, up] = this.stage.axes;
    const move = (a, b) => () => this.moveHand(this.hand.wanted.map((x, axis) => x + by * (a * right[axis] + b * up[axis])));
    return { ArrowLeft: move(-1, 0), ArrowRight: move(1, 0), ArrowUp: move(0, 1), ArrowDown: move(0, -1), Enter: () => this.drop(), Escape: () => this.drop(), b: () => this.#takeNext(), B: () => this.#takeNext() }[key] ?? this.#plainKey(key);
  }

  #plainKey(key) {
    const faster = (by) => () => {
      const next = speedChoices[speedChoices.indexOf(this.state.speed) + by];
      if (!next) return;
      this.state.speed = next;
      at("speed").value = next;
      this.#writeLink();
    };
    return {
      " ": () => this.play(), ArrowLeft: () => this.step(-1), ArrowRight: () => this.step(1), Home: () => this.again(), End: () => this.seek(this.history.end),
      "+": faster(1), "-": faster(-1), "−": faster(-1), b: () => this.#takeNext(), B: () => this.#takeNext(), v: () => this.toggle("velocities"), a: () => this.toggle("angles"), u: () => this.toggle("ruler"),
      r: () => {
        this.stage.reset();
        this.changed();
      },
      t: () => this.switchTheme(), "?": () => this.#help(),
    }[key];
  }

  #takeNext() {
    const { stage, hand } = this;
    const bob = hand.isHolding ? (hand.bob + stage.count - 1) % stage.count : stage.count - 1;
    if (hand.isHolding) hand.letGo();
    this.take(bob, 0, 0);
    say(text("said.taken", { k: bob + 1 }));
  }
}

const lab = new Lab();
lab.start().catch((error) => {
  at("trouble").hidden = false;
  at("trouble").textContent = text("trouble", { what: error.message });
});
// Tests, and whoever embeds the page, may look.
window.pendulaLab = lab;
