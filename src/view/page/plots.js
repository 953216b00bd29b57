// Plots over time, and of a rate over its coordinate. Fixed parts are drawn once, moving ones on top of them.

const plotMargin = { left: 50, right: 10, top: 8, bottom: 22 };

/// Axes on two canvases, one for fixed parts and one for moving ones.
class Axes {
  constructor(host, description) {
    this.host = host;
    this.still = host.appendChild(element("canvas"));
    this.moving = host.appendChild(element("canvas"));
    this.still.setAttribute("role", "img");
    this.still.setAttribute("aria-label", description);
    this.moving.setAttribute("aria-hidden", "true");
    this.x = { low: 0, high: 1 };
    this.y = { low: 0, high: 1 };
  }

  /// Whether the size of the host has changed since it was drawn.
  get isStale() {
    return this.width !== this.host.clientWidth || this.height !== this.host.clientHeight;
  }

  describe(text) {
    this.still.setAttribute("aria-label", text);
  }

  /// Takes the size of the host; begins the still canvas.
  begin() {
    const { clientWidth: width, clientHeight: height } = this.host;
    for (const canvas of [this.still, this.moving]) fitCanvas(canvas, width, height);
    this.width = width;
    this.height = height;
    this.scale = this.still.width / Math.max(width, 1);
    return this.#cleared(this.still);
  }

  beginMoving() {
    return this.#cleared(this.moving);
  }

  #cleared(canvas) {
    const pen = canvas.getContext("2d");
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, canvas.width, canvas.height);
    pen.setTransform(this.scale, 0, 0, this.scale, 0, 0);
    pen.lineJoin = "round";
    return pen;
  }

  atX(x) {
    const { left, right } = plotMargin;
    return left + ((x - this.x.low) / (this.x.high - this.x.low)) * (this.width - left - right);
  }

  atY(y) {
    const { top, bottom } = plotMargin;
    return this.height - bottom - ((y - this.y.low) / (this.y.high - this.y.low)) * (this.height - top - bottom);
  }

  /// The x at a pixel.
  xAt(pixel) {
    const { left, right } = plotMargin;
    return this.x.low + ((pixel - left) / (this.width - left - right)) * (this.x.high - this.x.low);
  }

  /// How many numbers fit below the plot.
  get mostTicks() {
    return Math.max(2, (this.width - plotMargin.left - plotMargin.right) / 48);
  }

  /// Lines and numbers of the ticks; each tick is {at, text}.
  drawGrid(pen, xTicks, yTicks, xName) {
    const { left, right, top, bottom } = plotMargin;
    pen.font = "11px system-ui, sans-serif";
    pen.strokeStyle = palette.css("line");
    pen.fillStyle = palette.css("quiet");
    pen.lineWidth = 1;
    pen.textBaseline = "middle";
    pen.textAlign = "right";
    for (const { at, text } of yTicks) {
      const y = Math.round(this.atY(at)) + 0.5;
      line(pen, left, y, this.width - right, y);
      pen.fillText(text, left - 6, y);
    }
    pen.textAlign = "center";
    pen.textBaseline = "alphabetic";
    for (const { at, text } of xTicks) {
      const x = Math.round(this.atX(at)) + 0.5;
      line(pen, x, top, x, this.height - bottom);
      if (!xName || x < this.width - right - 34) pen.fillText(text, x, this.height - 7);
    }
    pen.textAlign = "right";
    pen.fillText(xName, this.width - right, this.height - 7);
    pen.save();
    pen.beginPath();
    pen.rect(left, top - 2, this.width - left - right, this.height - top - bottom + 4);
    pen.clip();
  }
}

function line(pen, x0, y0, x1, y1) {
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
}

function dot(pen, x, y, colour, radius = 3.5) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fillStyle = rgba(colour);
  pen.fill();
  pen.lineWidth = 1.5;
  pen.strokeStyle = palette.css("panel");
  pen.stroke();
}

/// An angle within a half turn of zero.
function wrap(angle) {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
}

/// Ticks of a linear axis, about `count`, and if possible not fewer than `least`; wrapped angles have ticks in parts of π.
function linearTicks(axis, count, wrapped, least = 0) {
  if (wrapped) {
    return [[-1, "−π"], [-0.5, "−π/2"], [0, "0"], [0.5, "π/2"], [1, "π"]].map(([k, text]) => ({ at: k * Math.PI, text }));
  }
  return niceTicks(axis.low, axis.high, count, least).map((at) => ({ at, text: readable(at, 6) }));
}

/// Ticks at powers of ten between two exponents, at most about `most`.
const powerStep = (low, high, most) => Math.max(1, Math.ceil((high - low) / most));
function powerTicks(low, high, most) {
  const step = powerStep(low, high, most);
  return Array.from({ length: Math.floor((high - low) / step) + 1 }, (_, k) => ({ at: low + k * step, text: powerOfTen(low + k * step) }));
}

/// Least and largest finite number of several arrays, with some room, also if all are equal. A range that is smaller than
/// rounding of numbers of size `scale` counts as constant.
function rangeOf(arrays, change = (x) => x, scale = 0) {
  let [low, high] = [Infinity, -Infinity];
  for (const numbers of arrays) {
    for (const number of numbers) {
      const x = change(number);
      if (x < low) low = x;
      if (x > high && x < Infinity) high = x;
    }
  }
  if (!(low <= high)) return { low: 0, high: 1 };
  if (high - low <= 1e-12 * scale) {
    const middle = Math.max(Math.abs(low), Math.abs(high)) <= 1e-12 * scale ? 0 : (low + high) / 2;
    return { low: middle - 0.5 * scale, high: middle + 0.5 * scale };
  }
  const size = Math.max(Math.abs(low), Math.abs(high));
  if (high - low <= 2e-5 * size) return { low: low - 0.1 * size, high: high + 0.1 * size }; // constant, but for rounding
  const room = (high - low) * 0.04 || 1;
  return { low: low - room, high: high + room };
}

/// A titled box: options, a place for a plot, a key to its curves.
function panel(title, options = [], kind = "") {
  const plot = element("div", { className: "plot" });
  const keys = element("div", { className: "keys" });
  const heading = element("h2", { textContent: title });
  const head = element("header", {}, heading, element("div", { className: "options" }, ...options));
  const section = element("section", { className: `panel ${kind}` }, head, plot, keys);
  document.getElementById("panels").append(section);
  return { section, heading, plot, keys };
}

/// A key to curves: [colour, words] of each, and further words without a colour.
function nameCurves(keys, curves, ...words) {
  const chips = curves.map(([colour, name]) => {
    const mark = element("i");
    mark.style.background = colour;
    return element("span", {}, mark, name);
  });
  keys.replaceChildren(...chips, ...words);
}

/// Curves over time. A curve is {run, numbers, colour(), alpha}, and {scale} if linear; `kind` is "linear", "wrapped" or "log".
class TimePlot {
  constructor(host, description, player) {
    this.axes = new Axes(host, description);
    this.player = player;
    this.curves = [];
    this.kind = "linear";
    this.#watchPointer(host);
  }

  show(curves, kind) {
    this.curves = curves;
    this.kind = kind;
    this.redraw();
  }

  redraw() {
    const { axes, player } = this;
    const pen = axes.begin();
    axes.x = { low: player.start, high: player.end > player.start ? player.end : player.start + 1 };
    const yTicks = this.kind === "log" ? this.#logAxis() : this.#linearAxis();
    axes.drawGrid(pen, linearTicks(axes.x, axes.mostTicks), yTicks, scene.timeUnit);
    pen.lineWidth = 1.3;
    for (const curve of this.curves) this.#draw(pen, curve);
    pen.restore();
    this.drawCursor();
  }

  drawCursor() {
    const { axes, player } = this;
    const pen = axes.beginMoving();
    const x = axes.atX(player.time);
    pen.strokeStyle = palette.css("ink", 0.65);
    pen.lineWidth = 1;
    line(pen, x, plotMargin.top, x, axes.height - plotMargin.bottom);
    if (this.curves.length > 8) return;
    for (const curve of this.curves) {
      const y = this.#height(curve.numbers[curve.run.rowAt(player.time)]);
      if (Number.isFinite(y)) dot(pen, x, axes.atY(y), curve.colour());
    }
  }

  #linearAxis() {
    const { axes } = this;
    const wrapped = this.kind === "wrapped";
    axes.y = wrapped ? { low: -Math.PI, high: Math.PI } : rangeOf(this.curves.map((curve) => curve.numbers), undefined, this.curves[0]?.scale);
    return linearTicks(axes.y, axes.height / 28, wrapped, 3);
  }

  // Zeros are drawn at the bottom, a tick below the least positive number.
  #logAxis() {
    const arrays = this.curves.map((curve) => curve.numbers);
    const { low, high } = rangeOf(arrays, (x) => (x > 0 ? Math.log10(x) : NaN));
    const empty = !arrays.some((numbers) => numbers.some((x) => x > 0));
    const top = empty ? -15 : Math.ceil(high);
    const bottom = Math.min(empty ? -17 : Math.floor(low), top - 2);
    const most = Math.max(2, this.axes.height / 32);
    const step = powerStep(bottom, top, most);
    const isZero = empty || arrays.some((numbers) => numbers.includes(0));
    this.floor = isZero ? bottom - step : -Infinity;
    this.axes.y = { low: (isZero ? this.floor : bottom) - 0.15 * step, high: top + 0.15 * step };
    return [...(isZero ? [{ at: this.floor, text: "0" }] : []), ...powerTicks(bottom, top, most)];
  }

  #height(number) {
    if (this.kind === "log") return number > 0 ? Math.log10(number) : number === 0 ? this.floor : NaN;
    return this.kind === "wrapped" ? wrap(number) : number;
  }

  #draw(pen, curve) {
    const { axes } = this;
    if (this.kind === "log") {
      this.#drawLog(pen, curve);
      return;
    }
    pen.strokeStyle = rgba(curve.colour(), curve.alpha ?? 1);
    const rows = { from: 0, to: curve.run.rows - 1 };
    drawCurve(pen, axes, rows, (row) => curve.run.t[row], (row) => this.#height(curve.numbers[row]), { wrapped: this.kind === "wrapped" ? 1 : -1, isOverTime: true });
  }

  // Draws a point for each number, and lines only between near neighbours: otherwise zeros would make a comb of the curve.
  #drawLog(pen, curve) {
    const { axes } = this;
    const { t } = curve.run;
    pen.strokeStyle = pen.fillStyle = rgba(curve.colour(), curve.alpha ?? 1);
    pen.beginPath();
    let before = NaN;
    for (let row = 0; row < curve.run.rows; ++row) {
      const y = this.#height(curve.numbers[row]);
      const [px, py] = [axes.atX(t[row]), axes.atY(y)];
      pen[Math.abs(y - before) < 0.5 && y > this.floor ? "lineTo" : "moveTo"](px, py);
      if (Number.isFinite(y)) pen.fillRect(px - 0.75, py - 0.75, 1.5, 1.5);
      before = y;
    }
    pen.stroke();
  }

  #watchPointer(host) {
    const seek = (event) => {
      const left = host.getBoundingClientRect().left;
      this.player.seek(this.axes.xAt(event.clientX - left));
    };
    host.addEventListener("pointerdown", (event) => {
      host.setPointerCapture(event.pointerId);
      seek(event);
    });
    host.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) seek(event);
    });
  }
}

/// The rate of a coordinate against it, for one run or several.
class PhasePlot {
  constructor(host, description, player) {
    this.axes = new Axes(host, description);
    this.player = player;
    host.classList.add("still");
  }

  /// wrapped: as an angle within a half turn
  show(member, wrapped) {
    this.wrapped = wrapped;
    this.member = member;
    this.curves = runs.map((run, k) => ({
      run, colour: () => palette.run(k), q: run.column(member.column), rate: run.column(member.rate),
    }));
    this.redraw();
  }

  redraw() {
    const { axes } = this;
    const pen = axes.begin();
    const turned = this.wrapped ? { low: -Math.PI, high: Math.PI } : rangeOf(this.curves.map((curve) => curve.q), undefined, this.member.scale);
    axes.x = turned;
    axes.y = rangeOf(this.curves.map((curve) => curve.rate), undefined, this.member.rateScale);
    const xTicks = linearTicks(axes.x, axes.mostTicks, this.wrapped);
    axes.drawGrid(pen, xTicks, linearTicks(axes.y, axes.height / 28, false, 3), "");
    pen.lineWidth = 1.1;
    const alpha = runs.length > 1 ? Math.max(0.12, 0.6 / Math.sqrt(runs.length)) : 0.4;
    for (const curve of this.curves) {
      pen.strokeStyle = rgba(runs.length > 1 ? curve.colour() : palette.rgb.edge, alpha);
      this.#trace(pen, curve, 0, curve.run.rows - 1);
    }
    pen.restore();
    this.drawCursor();
  }

  drawCursor() {
    const { axes, player } = this;
    const pen = axes.beginMoving();
    const tail = 0.1 * player.duration;
    for (const curve of this.curves) {
      const row = curve.run.rowAt(player.time);
      if (runs.length <= 6) {
        pen.strokeStyle = rgba(curve.colour());
        pen.lineWidth = 2;
        this.#trace(pen, curve, curve.run.rowAt(player.time - tail), row);
      }
      dot(pen, axes.atX(this.#place(curve.q[row])), axes.atY(curve.rate[row]), curve.colour(), runs.length > 6 ? 2.5 : 4);
    }
  }

  #place(q) {
    return this.wrapped ? wrap(q) : q;
  }

  #trace(pen, curve, from, to) {
    drawCurve(pen, this.axes, { from, to }, (row) => this.#place(curve.q[row]), (row) => curve.rate[row], { wrapped: this.wrapped ? 0 : -1 });
  }
}
