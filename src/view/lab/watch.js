// The stopwatch, and the period of the first coordinate: from one passage upwards to the next.

class Watch {
  running = false;
  value = 0;
  period = 0;

  constructor(lab) {
    this.lab = lab;
  }

  press() {
    this.running = !this.running;
    if (this.running) this.from = this.lab.shown;
    else this.value = this.lab.shown - this.from;
    at("stopwatch").setAttribute("aria-pressed", this.running);
    this.lab.changed();
  }

  write() {
    const { running, value } = this;
    at("watch").hidden = !running && value === 0;
    if (at("watch").hidden) return;
    if (running) this.period = this.#measured();
    const time = running ? this.lab.shown - this.from : value;
    at("watch").textContent = `${text("tool.stopwatch")} ${time.toFixed(2)} s\n${text("period")} ${this.period ? `${this.period.toFixed(3)} s` : "–"}`;
  }

  #measured() {
    const { history, shown, isAngle } = this.lab;
    const found = [];
    for (let row = history.rowAt(shown); row > 0 && found.length < 2 && history.time(row) > this.from; --row) {
      const [a, b] = [history.get(row - 1, 1), history.get(row, 1)].map((x) => (isAngle[0] ? wrap(x) : x));
      if (a < 0 && b >= 0 && b - a < 2) found.push(history.time(row - 1) + (a / (a - b)) * (history.time(row) - history.time(row - 1)));
    }
    return found.length === 2 ? found[0] - found[1] : 0;
  }
}
