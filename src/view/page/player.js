// The time that is shown, its motion, and listeners to it.

const speeds = [1 / 128, 1 / 64, 1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2, 1, 2, 4, 8, 16, 32, 64, 128];

class Player {
  #listeners = [];
  #last = null;

  constructor() {
    this.start = Math.min(...runs.map((run) => run.start));
    this.end = Math.max(...runs.map((run) => run.end));
    this.time = this.start;
    this.playing = false;
    this.loop = true;
    this.speed = this.#pleasantSpeed();
  }

  get duration() {
    return this.end - this.start;
  }

  /// listener(what), what being "time" or "state".
  listen(listener) {
    this.#listeners.push(listener);
  }

  /// Moves on to the wall time `now` [ms]. Returns whether time moved.
  advance(now) {
    const passed = this.#last === null ? 0 : Math.min(now - this.#last, 250); // a page that slept does not leap
    this.#last = this.playing ? now : null;
    if (!this.playing || passed === 0) return this.playing;
    this.#goTo(this.time + (passed / 1000) * this.speed);
    return true;
  }

  play(on = !this.playing) {
    if (on && !this.loop && this.time >= this.end) this.time = this.start;
    this.playing = on && this.duration > 0;
    this.#last = null;
    this.#tell("state");
  }

  seek(time) {
    this.time = Math.min(Math.max(time, this.start), this.end);
    this.#tell("time");
  }

  /// Moves by whole rows of the first run.
  step(rows) {
    if (this.playing) this.play(false);
    const run = runs[0];
    const at = run.rowAt(this.time);
    const between = run.t[at] < this.time && rows < 0 ? 1 : 0;
    this.seek(run.t[Math.min(Math.max(at + rows + between, 0), run.rows - 1)]);
  }

  set(property, value) {
    this[property] = value;
    this.#tell("state");
  }

  faster(by) {
    const next = speeds.indexOf(this.speed) + by;
    if (speeds[next]) this.set("speed", speeds[next]);
  }

  #goTo(time) {
    if (time <= this.end) this.time = time;
    else if (this.loop) this.time = this.start + ((time - this.start) % this.duration);
    else {
      this.time = this.end;
      this.play(false);
    }
    this.#tell("time");
  }

  // Real time, unless the run would be over in less than 4 seconds or take more than 2 minutes.
  #pleasantSpeed() {
    const lasts = (speed) => this.duration / speed;
    const fits = (speed) => lasts(speed) >= 4 && lasts(speed) <= 120;
    if (fits(1) || this.duration === 0) return 1;
    return speeds.find((speed) => lasts(speed) <= (this.duration < 4 ? 12 : 60)) ?? speeds.at(-1);
  }

  #tell(what) {
    for (const listener of this.#listeners) listener(what);
  }
}
