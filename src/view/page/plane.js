// The stage of motions in the plane.

/// Pixels that the motion leaves free: for the clock and the buttons, and for the rule.
const inset = { top: 42, bottom: 32 };

class Stage {
  constructor(host, motion) {
    this.motion = motion;
    this.radii = motion.radii.map((radius) => (runs.length > 8 ? 0.5 * radius : radius));
    this.canvas = host.appendChild(element("canvas", { tabIndex: 0 }));
    this.pen = this.canvas.getContext("2d");
    this.places = runs.map(() => new Float64Array(motion.count * 2));
    this.rails = scene.points.map((_, i) => (kindOf(i) === "cart" ? motion.railOf(i) : null));
    this.paths = runs.map((run) => traced.map((point) => motion.path(run, point)));
    this.view = { x: 0, y: 0, zoom: 1 };
    this.onChange = () => {};
    watchGestures(this.canvas, {
      move: (dx, dy) => this.#moveBy(dx, dy),
      zoom: (factor, x, y) => this.zoom(factor, x, y),
    });
    this.reset();
  }

  static kind = "plane";

  get description() {
    return `${scene.subject}, moving. Plots of the same motion follow.`;
  }

  reset() {
    const { low, high, reach } = this.motion;
    const room = 0.08 * reach;
    this.home = {
      x: (low[0] + high[0]) / 2,
      y: (low[1] + high[1]) / 2,
      width: Math.max(high[0] - low[0], reach) + 2 * room,
      height: Math.max(high[1] - low[1], reach) + 2 * room,
    };
    this.view = { x: this.home.x, y: this.home.y, zoom: 1 };
    this.onChange();
  }

  resize() {
    fitStage(this);
    this.onChange();
  }

  /// Pixels of CSS to a metre.
  get scale() {
    const height = Math.max(this.height - inset.top - inset.bottom, 1);
    return Math.min(this.width / this.home.width, height / this.home.height) * this.view.zoom;
  }

  /// Where the middle of the view is, from the top.
  get middle() {
    return (this.height + inset.top - inset.bottom) / 2;
  }

  zoom(factor, x = this.width / 2, y = this.middle) {
    const before = this.scale;
    this.view.zoom = Math.min(Math.max(this.view.zoom * factor, 0.2), 200);
    const change = 1 / before - 1 / this.scale;
    this.view.x += (x - this.width / 2) * change;
    this.view.y -= (y - this.middle) * change;
    this.onChange();
  }

  /// By keys: in parts of what is seen.
  turn(x, y) {
    this.move(x, y);
  }
  move(x, y) {
    this.#moveBy(-x * this.width * 0.05, y * this.height * 0.05);
  }

  #moveBy(dx, dy) {
    this.view.x -= dx / this.scale;
    this.view.y += dy / this.scale;
    this.onChange();
  }

  themed() {}
  pace() {}

  draw(time, trace) {
    const { pen } = this;
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
    pen.setTransform(this.fine, 0, 0, this.fine, 0, 0);
    pen.lineJoin = "round";
    pen.lineCap = "butt"; // pieces of traces let through what is behind them: round ends would be seen twice
    this.#drawGrid();
    runs.forEach((run, k) => this.motion.at(run, time, this.places[k]));
    runs.forEach((_, k) => this.#drawTraces(k, time, trace));
    this.#drawRails();
    for (let k = runs.length - 1; k >= 0; --k) this.#drawBodies(k);
    if (holdsOrigin(this.motion)) drawPivot(pen, [this.#x(0), this.#y(0)]);
  }

  #x(x) {
    return this.width / 2 + (x - this.view.x) * this.scale;
  }
  #y(y) {
    return this.middle - (y - this.view.y) * this.scale;
  }

  #drawGrid() {
    const { pen, width, height, scale } = this;
    const [left, right] = [this.view.x - width / 2 / scale, this.view.x + width / 2 / scale];
    const [bottom, top] = [this.view.y - (height - this.middle) / scale, this.view.y + this.middle / scale];
    const ticks = niceTicks(0, right - left, width / 110);
    const step = ticks.length > 1 ? ticks[1] - ticks[0] : right - left;
    pen.strokeStyle = palette.css("line");
    pen.lineWidth = 1;
    for (let k = Math.ceil(left / step); k * step < right; ++k) {
      const x = Math.round(this.#x(k * step)) + 0.5;
      line(pen, x, 0, x, height);
    }
    for (let k = Math.ceil(bottom / step); k * step < top; ++k) {
      const y = Math.round(this.#y(k * step)) + 0.5;
      line(pen, 0, y, width, y);
    }
    this.#drawRule(step);
  }

  // How long the side of a square of the grid is.
  #drawRule(step) {
    const { pen } = this;
    const y = this.height - 14;
    const x1 = this.width - 14;
    const x0 = x1 - step * this.scale;
    pen.strokeStyle = pen.fillStyle = palette.css("quiet");
    pen.lineWidth = 1.5;
    line(pen, x0, y, x1, y);
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.fillText(`${readable(step)} ${scene.lengthUnit}`, (x0 + x1) / 2, y - 6);
  }

  // In pieces of one brightness each: a stroke costs much more than a point.
  #drawTraces(k, time, trace) {
    if (trace === 0) return;
    const { pen } = this;
    const since = time - trace * (runs[0].end - runs[0].start);
    const pieces = runs.length > 8 ? 5 : 20;
    pen.lineWidth = runs.length > 8 ? 1.2 : 2;
    traced.forEach((point, n) => {
      const { times, places } = this.paths[k][n];
      const to = sampleAt(times, time);
      const from = Math.min(sampleAt(times, since), to);
      for (let piece = 0; piece < pieces; ++piece) {
        const begin = from + Math.floor(((to - from) * piece) / pieces);
        const end = from + Math.floor(((to - from) * (piece + 1)) / pieces);
        const fade = trace >= 1 ? 0.55 : ((piece + 1) / pieces) ** 1.5;
        pen.strokeStyle = rgba(this.#traceColour(k), fade * (runs.length > 8 ? 0.5 : 0.9));
        pen.beginPath();
        for (let s = begin; s <= end; ++s) pen.lineTo(this.#x(places[2 * s]), this.#y(places[2 * s + 1]));
        if (piece === pieces - 1) this.#lineTo(this.places[k], point);
        pen.stroke();
      }
    });
  }

  #traceColour(k) {
    return palette.run(k);
  }

  #lineTo(places, point) {
    this.pen.lineTo(this.#x(places[2 * point]), this.#y(places[2 * point + 1]));
  }

  // On the screen; of the origin, too.
  #shown(places, i) {
    return i < 0 ? [this.#x(0), this.#y(0)] : [this.#x(places[2 * i]), this.#y(places[2 * i + 1])];
  }

  #cartSize(i) {
    return Math.max(1.5 * this.radii[i] * this.scale, 4);
  }

  // As far as one sees.
  #drawRails() {
    const far = (this.width + this.height) / this.scale + Math.hypot(this.view.x, this.view.y);
    this.rails.forEach((along, i) => {
      if (!along) return;
      const place = Array.from(this.places[0].subarray(2 * i, 2 * i + 2));
      const end = (way) => this.#shown(place.map((x, axis) => x + way * along[axis]), 0);
      drawRail(this.pen, end(-far), end(far), this.#cartSize(i));
    });
  }

  #drawConnections(places) {
    const wide = Math.max(0.04 * this.motion.reach * this.scale, 3);
    for (const [kind, from, to] of scene.connections) {
      if (kind === "pulleys") drawPulleys(this.pen, this.#shown(places, from), this.#shown(places, to), this.#cartSize(from));
      else drawConnection(this.pen, kind, this.#shown(places, from), this.#shown(places, to), wide);
    }
  }

  #drawBodies(k) {
    const { pen, motion } = this;
    const many = runs.length > 1;
    const places = this.places[k];
    const alpha = runs.length > 8 ? 0.55 : 1;
    pen.lineCap = "round";
    pen.strokeStyle = many ? rgba(palette.run(k), alpha * 0.8) : palette.css("rod");
    pen.lineWidth = many ? 1.5 : Math.max(1.2, Math.min(4, (0.012 * motion.reach * this.scale) / Math.sqrt(motion.count / 4 + 1)));
    this.#drawConnections(places);
    pen.beginPath();
    for (let i = 0; i < motion.count; ++i) {
      const on = motion.hangs[i];
      if (on === free) continue;
      if (i === 0 || on !== i - 1) pen.moveTo(this.#x(on < 0 ? 0 : places[2 * on]), this.#y(on < 0 ? 0 : places[2 * on + 1]));
      else if (motion.hangs[i - 1] === free) pen.moveTo(this.#x(places[2 * on]), this.#y(places[2 * on + 1]));
      this.#lineTo(places, i);
    }
    pen.stroke();
    this.#drawBobs(k, places, alpha);
  }

  // The last one in the colour of its trace; of runs that are many only that one. Balls of one colour are one path.
  #drawBobs(k, places, alpha) {
    const { pen, motion } = this;
    const last = motion.count - 1;
    const own = runs.length > 1 ? palette.run(k) : null;
    const draw = (points, colour) => {
      for (const i of points.filter((each) => kindOf(each) !== "bob")) {
        if (kindOf(i) === "cart") this.#drawCart(i, places, colour);
        else if (kindOf(i) === "weight") drawWeight(pen, this.#shown(places, i), this.#cartSize(i), colour);
        else if (kindOf(i) === "floor") drawFloor(pen, this.#shown(places, i), this.#cartSize(i));
        else drawPivot(pen, this.#shown(places, i));
      }
      pen.fillStyle = colour;
      pen.beginPath();
      for (const i of points.filter((each) => kindOf(each) === "bob")) {
        const [x, y] = this.#shown(places, i);
        const radius = Math.max(this.radii[i] * this.scale, 1.2);
        pen.moveTo(x + radius, y);
        pen.arc(x, y, radius, 0, 2 * Math.PI);
      }
      pen.fill();
    };
    const points = Array.from({ length: motion.count }, (_, i) => i);
    if (runs.length <= 8) draw(points.slice(0, last), own ? rgba(own) : palette.css("bob"));
    draw(points.slice(last), rgba(own ?? palette.rgb.trace, alpha));
  }

  #drawCart(i, places, colour) {
    const [dx, dy] = this.rails[i] ?? [1, 0];
    drawCart(this.pen, this.#shown(places, i), uprightAngle(dx, -dy), this.#cartSize(i), colour);
  }
}
