// The panels beside the stage. Each is drawn a few times a second, in turn, so that no frame draws all of them.

const windowOfTime = 20; // s that panels over time show

/// A panel for a level, whose title is a text.
function labPanel(key, level, options = [], kind = "") {
  const box = panel(text(key), options, `${level} ${kind}`);
  box.heading.dataset.text = key;
  return { ...box, level, axes: new Axes(box.plot, text(key)) };
}

/// A list of names to choose from.
function picker(label, change) {
  const select = element("select");
  select.dataset.label = label;
  select.addEventListener("change", change);
  return select;
}

function fillPicker(select, names) {
  const before = Number(select.value) || 0;
  const shown = Math.min(names.length, 60);
  select.replaceChildren(...Array.from({ length: shown }, (_, k) => element("option", { value: k, textContent: names[k] })));
  select.value = before < shown ? before : shown - 1;
}

class Panel {
  constructor(lab, box) {
    this.lab = lab;
    this.box = box;
    this.axes = box.axes;
  }

  get isSeen() {
    const { section } = this.box;
    if (section.offsetParent === null) return false;
    const { top, bottom } = section.getBoundingClientRect();
    return bottom > 0 && top < innerHeight;
  }

  /// Starts or stops. A running panel is shown at every level, so that it can be stopped.
  run(on) {
    const { button, box, key } = this;
    box.section.classList.toggle(box.level, !on);
    button.dataset.text = `${key}.${on ? "end" : "start"}`;
    button.textContent = text(button.dataset.text);
    button.setAttribute("aria-pressed", on);
  }

  describe(words) {
    if (words !== this.said) this.axes.describe((this.said = words));
  }

  /// Keys to curves: [colour, words].
  name(...curves) {
    const all = curves.map(([colour, words]) => `${colour}${words}`).join();
    if (all === this.named) return;
    this.named = all;
    nameCurves(this.box.keys, curves.filter(([colour]) => colour), ...curves.filter(([colour]) => !colour).map(([, words]) => words));
  }

  /// Rows of the window up to the shown time: from, to, and a stride that leaves at most `most`.
  rows(most = 600) {
    const { history, shown } = this.lab;
    const to = history.rowAt(shown);
    const from = history.rowAt(Math.max(shown - windowOfTime, history.start));
    const stride = Math.max(1, Math.floor((to - from) / most));
    return { from: Math.ceil(from / stride) * stride, to, stride };
  }

  timeAxis() {
    const { shown, history } = this.lab;
    const high = Math.max(shown, history.start + windowOfTime);
    this.axes.x = { low: high - windowOfTime, high };
    return linearTicks(this.axes.x, this.axes.mostTicks);
  }

  /// Draws a curve over the window.
  curve(pen, colour, value, width = 1.5) {
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    drawCurve(pen, this.axes, this.rows(2400), (row) => this.lab.history.time(row), value, { isOverTime: true });
  }

  /// The range of values over the window; `scale` is that of their rounding.
  range(values, scale) {
    let [low, high] = [Infinity, -Infinity];
    const { from, to, stride } = this.rows(2400);
    for (let row = from; row <= to; row += stride) {
      for (const value of values) {
        const y = value(row);
        if (y < low) low = y;
        if (y > high) high = y;
      }
    }
    return low <= high ? rangeOf([[low, high]], undefined, scale) : { low: 0, high: 1 };
  }
}

/// Kinetic, potential and total energy.
class EnergyPanel extends Panel {
  constructor(lab) {
    super(lab, labPanel("panel.energy", ""));
  }

  draw() {
    const { lab, axes } = this;
    const { history, size } = lab;
    const [kinetic, potential] = [1 + 2 * size, 2 + 2 * size];
    const values = [(row) => history.get(row, kinetic), (row) => history.get(row, potential),
      (row) => history.get(row, kinetic) + history.get(row, potential)];
    const pen = axes.begin();
    axes.beginMoving();
    axes.y = this.range(values, lab.energyScale);
    axes.drawGrid(pen, this.timeAxis(), linearTicks(axes.y, axes.height / 30, false, 3), "s");
    const colours = [1, 0, 5].map((k) => rgba(palette.curves[k]));
    values.forEach((value, k) => this.curve(pen, colours[k], value, k === 2 ? 2.2 : 1.6));
    pen.restore();
    const digits = clamp(2 - Math.floor(Math.log10(lab.energyScale)), 0, 6); // three digits of the pendulum's energy
    const now = [lab.row[kinetic], lab.row[potential], lab.row[kinetic] + lab.row[potential]].map((x) => `${steady(x, digits)} J`);
    const names = ["kinetic", "potential", "total"].map((key, k) => `${text(key)} ${now[k]}`);
    this.name(...names.map((name, k) => [colours[k], name]));
    this.describe(`${text("panel.energy")}: ${names.join(", ")}`);
  }
}

/// Inputs, constant parts and sines, since they were last changed.
class InputsPanel extends Panel {
  constructor(lab) {
    super(lab, labPanel("panel.inputs", "student"));
  }

  begin() {
    const { state } = this.lab;
    this.acting = state.u.map((_, k) => k).filter((k) => state.u[k] !== 0 || actingSines(state).some(([input]) => input === k)).slice(0, 6);
    this.box.section.hidden = this.acting.length === 0;
  }

  draw() {
    const { lab, axes, acting } = this;
    const { state, history } = lab;
    const sines = actingSines(state);
    const value = (k, time) => sines.reduce((sum, [input, amplitude, frequency, phase]) => sum + (input === k ? amplitude * Math.sin(frequency * time + phase) : 0), state.u[k]);
    const since = (k) => (row) => (history.time(row) < lab.since - 1e-9 ? NaN : value(k, history.time(row)));
    const inputs = model?.inputs ?? torquesOf(state);
    const pen = axes.begin();
    axes.beginMoving();
    axes.y = this.range(acting.map(since));
    axes.drawGrid(pen, this.timeAxis(), linearTicks(axes.y, axes.height / 30, false, 3), "s");
    acting.forEach((k, place) => this.curve(pen, rgba(palette.curves[place]), since(k)));
    pen.restore();
    const names = acting.map((k) => `${symbol(inputs[k].name)} ${steady(value(k, lab.shown))} ${unitWords(inputs[k].unit)}`);
    this.name(...names.map((name, place) => [rgba(palette.curves[place]), name]));
    this.describe(`${text("panel.inputs")}: ${names.join(", ")}`);
  }
}

/// The energy error since the last change of anything.
class ErrorPanel extends Panel {
  constructor(lab) {
    super(lab, labPanel("panel.error", "all"));
  }

  draw() {
    const { lab, axes } = this;
    const { history, size } = lab;
    const scale = lab.energyScale;
    const value = (row) => {
      if (history.time(row) < lab.since) return NaN;
      const off = Math.abs(history.get(row, 1 + 2 * size) + history.get(row, 2 + 2 * size) - lab.energy) / scale;
      return Math.log10(Math.max(off, 1e-17));
    };
    const pen = axes.begin();
    axes.beginMoving();
    const { low, high } = this.range([value]);
    axes.y = { low: Math.min(Math.floor(low), -16), high: Math.max(Math.ceil(high), -12) };
    axes.drawGrid(pen, this.timeAxis(), powerTicks(axes.y.low, axes.y.high, 5), "s");
    this.curve(pen, palette.css("accent"), value);
    pen.restore();
    const off = Math.abs(lab.row[1 + 2 * size] + lab.row[2 + 2 * size] - lab.energy) / scale;
    this.name(["", (model ? off > 1e-8 : lab.state.d > 0 || isDriven(lab.state)) ? text("error.damped") : text("error.now", { error: readable(off, 2) })]);
  }
}

/// The rate of a coordinate against it.
class PhasePanel extends Panel {
  constructor(lab) {
    const select = picker("coordinate", () => lab.changed());
    super(lab, labPanel("panel.phase", "student", [select], "square"));
    this.select = select;
  }

  begin() {
    fillPicker(this.select, this.lab.coordinates.map(symbol));
  }

  draw() {
    const { lab, axes } = this;
    const { history, size } = lab;
    const k = Number(this.select.value) || 0;
    const wrapped = lab.isAngle[k];
    const pen = axes.begin();
    axes.beginMoving();
    const place = (row) => (wrapped ? wrap(history.get(row, 1 + k)) : history.get(row, 1 + k));
    const rate = (row) => history.get(row, 1 + size + k);
    const scale = wrapped ? 1 : lab.stage.reach;
    axes.x = wrapped ? turnOfAngles : this.range([place], scale);
    axes.y = this.range([rate], scale);
    axes.drawGrid(pen, degreeTicks(axes.x, axes.mostTicks, wrapped), linearTicks(axes.y, axes.height / 30, false, 3), "");
    const { from, to, stride } = this.rows(900);
    const pieces = 6;
    for (let piece = 0; piece < pieces; ++piece) {
      const [begin, end] = [piece, piece + 1].map((p) => from + stride * Math.floor(((to - from) / stride) * (p / pieces)));
      pen.strokeStyle = rgba(palette.curves[0], 0.15 + (0.85 * (piece + 1)) / pieces);
      pen.lineWidth = 1.3;
      drawCurve(pen, axes, { from: begin, to: Math.min(end, to), stride }, place, rate, { wrapped: wrapped ? 0 : -1 });
    }
    const now = lab.row[1 + k];
    dot(pen, axes.atX(wrapped ? wrap(now) : now), axes.atY(lab.row[1 + size + k]), palette.rgb.trace, 4);
    pen.restore();
    const name = symbol(lab.coordinates[k]);
    this.name(["", text("phase.key", { name, unit: wrapped ? "°" : lab.units[k], rate: `${lab.units[k]}/s` })]);
  }
}

/// A whole turn, and room for its numbers.
const turnOfAngles = { low: -1.06 * Math.PI, high: 1.06 * Math.PI };

/// Ticks: wrapped angles in degrees, other numbers as they are.
function degreeTicks(axis, count, wrapped) {
  if (!wrapped) return linearTicks(axis, count, false);
  return [-180, -90, 0, 90, 180].map((k) => ({ at: (k * Math.PI) / 180, text: `${steady(k, 0)}°` }));
}

/// A Poincaré section: the last coordinate and its rate where the first one goes through zero upwards.
class SectionPanel extends Panel {
  constructor(lab) {
    super(lab, labPanel("panel.section", "all", [], "square"));
    this.begin();
  }

  begin() {
    this.points = [];
    this.seen = 0;
    this.version = -1;
  }

  /// Takes the rows since the last call.
  collect() {
    const { history, size } = this.lab;
    if (this.version !== history.version) {
      this.version = history.version;
      this.seen = 0;
      this.points = [];
    }
    const last = size - 1;
    const of = (row, k) => (this.lab.isAngle[k] ? wrap(history.get(row, 1 + k)) : history.get(row, 1 + k));
    for (let row = Math.max(this.seen, 1); row < history.rows; ++row) {
      const [a, b] = [of(row - 1, 0), of(row, 0)];
      if (!(a < 0 && b >= 0 && b - a < 2)) continue;
      const s = a / (a - b);
      const q = of(row - 1, last) + s * (history.get(row, 1 + last) - history.get(row - 1, 1 + last));
      const v = history.get(row - 1, 1 + size + last) * (1 - s) + s * history.get(row, 1 + size + last);
      this.points.push(this.lab.isAngle[last] ? wrap(q) : q, v);
    }
    this.seen = history.rows;
  }

  draw() {
    this.collect();
    const { axes, points, lab } = this;
    const pen = axes.begin();
    axes.beginMoving();
    const last = lab.size - 1;
    const wrapped = lab.isAngle[last];
    const [xs, ys] = [points.filter((_, k) => k % 2 === 0), points.filter((_, k) => k % 2 === 1)];
    axes.x = wrapped ? turnOfAngles : rangeOf([xs]);
    axes.y = rangeOf([ys]);
    axes.drawGrid(pen, degreeTicks(axes.x, axes.mostTicks, wrapped), linearTicks(axes.y, axes.height / 30, false, 3), "");
    pen.fillStyle = rgba(palette.curves[2], 0.85);
    for (let k = 0; k < points.length; k += 2) pen.fillRect(axes.atX(points[k]) - 1.2, axes.atY(points[k + 1]) - 1.2, 2.4, 2.4);
    pen.restore();
    const names = [lab.coordinates[0], lab.coordinates[last]].map(symbol);
    this.name(["", text("section.key", { first: names[0], last: names[1], count: points.length / 2 })]);
    this.describe(text("section.key", { first: names[0], last: names[1], count: points.length / 2 }));
  }
}

/// A computation beside the motion that the user starts and stops: numbers over time, [time, number] each.
class RunningPanel extends Panel {
  values = [];

  constructor(lab, key, level, options = []) {
    const button = element("button", { type: "button" });
    super(lab, labPanel(`panel.${key}`, level, [...options, button]));
    Object.assign(this, { button, key });
  }

  begin() {
    this.values = [];
    this.run(this.isOn);
  }

  add(time, value) {
    if (this.values.length && time <= this.values.at(-1)[0] + this.apart) return;
    this.values.push([time, value]);
    if (this.values.length > 4000) this.values = this.values.filter((_, k) => k % 2 === 0);
  }

  draw() {
    const { axes, values, box } = this;
    box.section.classList.toggle("off", !this.isOn);
    box.plot.hidden = !this.isOn;
    this.name(["", this.isOn ? this.words : text(`${this.key}.key`)]);
    if (!this.isOn) return;
    const pen = axes.begin();
    axes.beginMoving();
    const first = values[0]?.[0] ?? 0;
    axes.x = { low: first, high: Math.max(values.at(-1)?.[0] ?? 0, first + 10) };
    axes.drawGrid(pen, linearTicks(axes.x, axes.mostTicks), this.upright(), "s");
    pen.strokeStyle = this.colour;
    pen.lineWidth = 1.7;
    drawCurve(pen, axes, { from: 0, to: values.length - 1 }, (k) => values[k][0], (k) => this.height(values[k][1]));
    pen.restore();
  }
}

/// Copies that start beside the motion, and their distance from it.
class CopiesPanel extends RunningPanel {
  apart = 0.05;

  constructor(lab) {
    const apart = picker("copies.apart", () => lab.setCopies(lab.state.copies, 10 ** -Number(apart.value)));
    for (const power of [3, 6, 9, 12]) apart.append(element("option", { value: power, textContent: `${powerOfTen(-power)}${model ? "" : " rad"}`, selected: power === 6 }));
    super(lab, "copies", "student", [apart]);
    this.button.addEventListener("click", () => lab.setCopies(lab.state.copies ? 0 : 50, 10 ** -Number(apart.value)));
  }

  get isOn() {
    return this.lab.state.copies > 0;
  }
  get colour() {
    return palette.css("trace");
  }
  get words() {
    return text(this.lab.isAngle.every(Boolean) ? "copies.distance" : "copies.distance.any", { count: this.lab.state.copies });
  }

  height(distance) {
    return Math.log10(Math.max(distance, 1e-16));
  }
  upright() {
    const least = Math.min(...this.values.map(([, distance]) => this.height(distance)), 0);
    this.axes.y = { low: Math.min(-6, Math.floor(least)), high: 1 };
    return powerTicks(this.axes.y.low, 1, 5);
  }
}

/// The leading Lyapunov exponent, as it converges.
class ExponentPanel extends RunningPanel {
  apart = 0;

  constructor(lab) {
    super(lab, "exponent", "all");
    this.button.addEventListener("click", () => lab.measure(!lab.isMeasuring));
  }

  get isOn() {
    return this.lab.isMeasuring;
  }
  get colour() {
    return rgba(palette.curves[3]);
  }
  get words() {
    return text("exponent.now", { value: this.values.length ? readable(this.values.at(-1)[1], 3) : "–" });
  }

  height(value) {
    return value;
  }
  upright() {
    const range = rangeOf([this.values.map(([, value]) => value)]);
    this.axes.y = { low: Math.min(0, range.low), high: range.high };
    return linearTicks(this.axes.y, this.axes.height / 30, false, 3);
  }
}
