// The hand, which takes a bob.

/// Angles of a chain with a bob as near as possible to a place. The rods below keep their directions; those above are
/// placed from both ends in turn (FABRIK: Aristidou and Lasenby).
function posedChain(state, q, bob, place) {
  const { n, space, l } = state;
  const points = [[0, 0, 0]];
  const flat = placesOfChain(state, q, new Float64Array(3 * n));
  for (let i = 0; i <= bob; ++i) points.push([flat[3 * i], flat[3 * i + 1], flat[3 * i + 2]]);
  const reach = l.slice(0, bob + 1).reduce((sum, length) => sum + length, 0);
  const far = Math.hypot(...place);
  const wanted = far > reach ? place.map((x) => (x / far) * reach) : place;
  const toward = (from, to, length) => {
    const along = to.map((x, axis) => x - from[axis]);
    const size = Math.hypot(...along) || 1;
    return from.map((x, axis) => x + (along[axis] / size) * length);
  };
  for (let round = 0; round < 30; ++round) {
    points[bob + 1] = wanted.slice();
    for (let i = bob; i >= 1; --i) points[i] = toward(points[i + 1], points[i], l[i]);
    for (let i = 0; i <= bob; ++i) points[i + 1] = toward(points[i], points[i + 1], l[i]);
    if (Math.hypot(...wanted.map((x, axis) => x - points[bob + 1][axis])) < 1e-12 * reach) break;
  }
  const posed = Float64Array.from(q);
  for (let i = 0; i <= bob; ++i) {
    const [x, y, z] = points[i + 1].map((c, axis) => c - points[i][axis]);
    const near = (angle, before) => angle + 2 * Math.PI * Math.round((before - angle) / (2 * Math.PI));
    if (space === 2) {
      posed[i] = near(Math.atan2(x, -z), q[i]);
    } else {
      const level = Math.hypot(x, y);
      posed[i] = Math.atan2(level, -z);
      if (level > 1e-9 * l[i]) posed[n + i] = near(Math.atan2(y, x), q[n + i]);
    }
  }
  return posed;
}

class Hand {
  isPosed = false; // the shown state was set by the hand, and is not part of a motion yet
  posing = null;

  constructor(lab) {
    this.lab = lab;
    this.bob = -1;
  }

  get isHolding() {
    return this.bob >= 0;
  }

  /// Whether a held point of a model will be thrown, with the speed of the hand. Time waits meanwhile.
  get throws() {
    return Boolean(model) && this.isHolding && this.wasPlaying;
  }

  /// The place where the hand is shown.
  get seen() {
    return { bob: this.bob, place: this.lab.playing || this.throws ? this.place : this.wanted };
  }

  take(bob, x, y) {
    const { lab } = this;
    const place = Array.from(lab.stage.places.subarray(3 * bob, 3 * bob + 3));
    Object.assign(this, { bob, wanted: [...place], place: [...place], speed: [0, 0, 0], wasPlaying: lab.playing });
    this.grip = [place, lab.stage.placeAt(x, y, place)];
    if (model) lab.play(false);
    if (lab.shown < lab.history.end - 1e-9 && lab.playing) lab.send(); // from what is shown, not from the end
    at("hint").classList.add("gone");
    lab.changed();
  }

  /// Takes the bob before the held one; the last bob if none is held.
  takeNext() {
    const { count } = this.lab.stage;
    this.take(this.isHolding ? (this.bob + count - 1) % count : count - 1, 0, 0);
    say(text("said.taken", { k: this.bob + 1 }));
  }

  letGo() {
    this.bob = -1;
  }

  drag(x, y) {
    if (!this.isHolding) return;
    const [first, begin] = this.grip;
    const now = this.lab.stage.placeAt(x, y, first);
    this.moveTo(now.map((c, axis) => first[axis] + c - begin[axis]));
  }

  moveTo(place) {
    this.wanted = place;
    if (!this.lab.playing && !this.throws) this.#pose(place);
    this.lab.changed();
  }

  /// Moves to the wanted place smoothly: critically damped, within a few hundredths of a second.
  move(passed) {
    if (!this.isHolding || !(this.lab.playing || this.throws)) return;
    const rate = 40;
    const parts = Math.max(1, Math.ceil(passed / 0.004));
    const h = passed / parts;
    for (let part = 0; part < parts; ++part) {
      for (let axis = 0; axis < 3; ++axis) {
        const push = rate * rate * (this.wanted[axis] - this.place[axis]) - 2 * rate * this.speed[axis];
        this.speed[axis] += h * push;
        this.place[axis] += h * this.speed[axis];
      }
    }
    if (this.throws) this.#pose(this.place);
  }

  /// The hand for the engine, with the components of the chain's space.
  told(space) {
    if (!this.isHolding) return null;
    const of = ([x, y, z]) => (space === 2 ? [x, z] : [x, y, z]);
    return { bob: this.bob, place: of(this.place), speed: of(this.speed) };
  }

  // Sets the state at rest with the bob at the hand.
  #pose(place) {
    const { state, row, size } = this.lab;
    if (model) {
      this.posing ??= this.#poseModel(this.bob, place).finally(() => (this.posing = null));
      return;
    }
    row.set(posedChain(state, row.subarray(1, 1 + size), this.bob, place), 1);
    row.fill(0, 1 + size, 1 + 2 * size);
    this.isPosed = true;
    this.lab.changed();
  }
  async #poseModel(bob, place, speed = [0, 0, 0]) {
    const { lab } = this;
    const { size, order } = lab;
    const first = model.points.slice(0, bob).reduce((sum, each) => sum + each.columns.length, 0);
    const of = ([x, y, z]) => (model.points[bob].columns.length === 2 ? [x, z] : [x, y, z]);
    const asked = { q: lab.row.slice(1, 1 + size), time: lab.state.t, first, place: of(place), speed: of(speed) };
    const answer = await lab.computer.ask("pose", asked).catch(() => null);
    if (!answer || order !== lab.order) return;
    lab.row.set(answer.q, 1);
    lab.row.set(answer.v, 1 + size);
    lab.row.set(answer.points, 3 + 2 * size);
    lab.row.set(answer.rates, 3 + 2 * size + pointColumns);
    this.isPosed = true;
    lab.changed();
  }

  async drop() {
    const { lab, throws, bob } = this;
    const { order } = lab;
    if (!this.isHolding) return;
    this.letGo();
    if (model) {
      await this.posing;
      if (throws) await this.#poseModel(bob, this.place, this.speed);
      else if (this.isPosed) await this.#poseModel(bob, this.wanted); // at the last place of the hand
      if (order !== lab.order || this.isHolding) return;
    }
    if (this.isPosed) {
      this.isPosed = false;
      lab.startsAt(lab.row);
      lab.restart();
      lab.play(model ? this.wasPlaying : false);
      lab.controls.refresh();
    } else if (lab.playing) {
      // From here on it is a new motion.
      const { rows, rowSize, numbers } = lab.history;
      const last = numbers.subarray((rows - 1) * rowSize, rows * rowSize);
      lab.startsAt(last);
      if (isDriven(lab.state)) [lab.state.t] = last; // drives go on at this time
      lab.controls.refresh();
      lab.looks.writeLink();
    }
    say(text("said.dropped"));
    lab.changed();
  }
}

/// Lets pointers on the stage take a bob, or an end of the ruler.
function watchHand(lab) {
  const { stage, hand } = lab;
  const { classList } = stage.canvas;
  let ruler = null;
  watchGestures(stage, {
    changed: () => lab.changed(),
    take(event, x, y) {
      ruler = (document.documentElement.dataset.ruler && stage.rulerAt(x, y)) || null;
      const bob = ruler ? -1 : stage.pointAt(x, y, event.pointerType === "touch" ? 40 : 26, lab.placesBefore());
      if (bob >= 0) hand.take(bob, x, y);
      classList.toggle("held", bob >= 0);
      return ruler !== null || bob >= 0;
    },
    drag: (x, y) => (ruler ? stage.moveRuler(ruler, x, y) : hand.drag(x, y)),
    drop() {
      classList.remove("held");
      if (!ruler) hand.drop();
      ruler = null;
    },
    pass: (event, x, y) => classList.toggle("near", event.pointerType === "mouse" && stage.pointAt(x, y) >= 0),
  });
}
