// The stage of the laboratory: its motion and copies beside it, with velocities, angles, a ruler and the hand.

class Bench extends Stage {
  ruler = { from: [-0.5, -0.4, 0], to: [0.5, -0.4, 0] };

  /// As Stage.shape, with `arms` that turn from the vertical, [from, to].
  shape(told) {
    super.shape({ ...told, low: [-1, -1, -1].map((x) => x * told.reach), high: [1, 1, 1].map((x) => x * told.reach) });
    this.places = new Float64Array(3 * this.count);
  }

  /// The point that is nearest to a pixel; -1 if none is near. `before`: places of some moments ago, the newest first, since
  /// a press for a fast bob comes where it was.
  pointAt(pixelX, pixelY, most = 26, before = []) {
    for (const places of [this.places, ...before]) {
      let [found, nearest] = [-1, most];
      for (let i = 0; i < this.count; ++i) {
        const [x, y] = this.#shown(places, i);
        const distance = Math.hypot(x - pixelX, y - pixelY) - 0.6 * this.radii[i] * this.pixels;
        if (distance < nearest) [found, nearest] = [i, distance];
      }
      if (found >= 0) return found;
    }
    return -1;
  }

  #shown(places, i) {
    return i < 0 ? this.project(0, 0, 0) : this.project(places[3 * i], places[3 * i + 1], places[3 * i + 2]);
  }

  /// Draws all. `what`: {places, rates, trace, copies, held, show: Set}.
  draw(what) {
    const { rod, bob, trace } = palette.rgb;
    const copies = Array.from({ length: what.copies?.count ?? 0 }, (_, k, { count } = what.copies) => {
      const own = palette.ramp(count > 1 ? k / (count - 1) : 0);
      const each = 3 * this.count;
      return { places: what.copies.places.subarray(k * each, (k + 1) * each), rgb: { ball: own, tip: own, rod: own }, faint: true, traces: [] };
    });
    const traces = what.trace ? [{ way: what.trace, rgb: trace }] : [];
    super.draw([...copies, { places: what.places, rgb: { ball: bob, tip: trace, rod }, faint: false, traces }]);
    if (what.show.has("angles")) this.#drawAngles(what);
    if (what.show.has("velocities")) this.#drawVelocities(what);
    if (what.held) this.#drawHand(what.held);
    if (what.show.has("ruler")) this.#drawRuler();
  }

  #drawHand({ bob, place }) {
    const { pen } = this;
    const [x0, y0, near] = this.#shown(this.places, bob);
    const [x, y] = this.project(...place);
    pen.strokeStyle = palette.css("accent");
    pen.lineWidth = 2;
    pen.beginPath();
    pen.arc(x0, y0, Math.max(this.radii[bob] * this.pixels * near, 1.4) + 5, 0, 2 * Math.PI);
    pen.stroke();
    pen.strokeStyle = palette.css("accent", 0.8);
    pen.lineWidth = 1.5;
    pen.setLineDash([4, 4]);
    line(pen, x0, y0, x, y);
    pen.setLineDash([]);
  }

  #drawVelocities({ places, rates }) {
    if (!rates) return;
    const { pen } = this;
    pen.strokeStyle = pen.fillStyle = rgba(palette.curves[2]);
    pen.lineWidth = 2;
    const most = this.count > 12 ? Math.ceil(this.count / 12) : 1;
    for (let i = this.count - 1; i >= 0; i -= most) {
      const [x0, y0] = this.#shown(places, i);
      const k = 0.12; // s: an arrow is the way in that time
      const [x, y] = this.project(...[0, 1, 2].map((axis) => places[3 * i + axis] + k * rates[3 * i + axis]));
      arrow(pen, x0, y0, x, y);
    }
  }

  // From the vertical to the arm, in the plane of both.
  #drawAngles({ places }) {
    const { pen } = this;
    const radius = Math.min(0.16 * this.reach, 0.5 * this.reach / Math.sqrt(this.count));
    pen.font = "12px system-ui, sans-serif";
    pen.textAlign = "center";
    for (const [i, { from, theta, phi }] of anglesOf(this.space, this.arms.slice(0, 8), places).entries()) {
      const place = (angle, r) => this.project(
        from[0] + r * Math.sin(angle) * Math.cos(phi), from[1] + r * Math.sin(angle) * Math.sin(phi), from[2] - r * Math.cos(angle));
      pen.strokeStyle = palette.css("quiet", 0.7);
      pen.lineWidth = 1;
      pen.setLineDash([3, 4]);
      line(pen, ...place(0, 0).slice(0, 2), ...place(0, 1.5 * radius).slice(0, 2));
      pen.setLineDash([]);
      pen.strokeStyle = pen.fillStyle = rgba(palette.curves[i % 6]);
      pen.lineWidth = 2;
      pen.beginPath();
      for (let k = 0; k <= 32; ++k) pen.lineTo(...place((theta * k) / 32, radius).slice(0, 2));
      pen.stroke();
      const [x, y] = place(theta / 2, 1.35 * radius);
      pen.fillText(`${steady(Math.round((theta * 180) / Math.PI) || 0, 0)}°`, x, y + 4);
    }
  }

  #drawRuler() {
    const { pen, ruler } = this;
    const [a, b] = [this.project(...this.rulerEnd("from")), this.project(...this.rulerEnd("to"))];
    pen.strokeStyle = pen.fillStyle = rgba(palette.curves[4]);
    pen.lineWidth = 2;
    line(pen, a[0], a[1], b[0], b[1]);
    for (const [x, y] of [a, b]) {
      pen.beginPath();
      pen.arc(x, y, 6, 0, 2 * Math.PI);
      pen.fill();
    }
    const length = Math.hypot(...ruler.from.map((x, k) => x - ruler.to[k])) * this.reach;
    pen.font = "13px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.fillStyle = palette.css("ink");
    pen.fillText(`${readable(length, 3)} m`, (a[0] + b[0]) / 2, (a[1] + b[1]) / 2 - 9);
  }

  // In parts of the reach, on the screen.
  rulerEnd(end) {
    const [right, up] = this.axes;
    const [a, b] = this.ruler[end];
    return this.middle.map((c, axis) => c + this.reach * (a * right[axis] + b * up[axis]));
  }
  moveRuler(end, pixelX, pixelY) {
    this.ruler[end] = [(pixelX - this.left) / this.pixels / this.reach, (this.top - pixelY) / this.pixels / this.reach, 0];
  }
  rulerAt(pixelX, pixelY) {
    return ["from", "to"].find((end) => {
      const [x, y] = this.project(...this.rulerEnd(end));
      return Math.hypot(x - pixelX, y - pixelY) < 18;
    });
  }
}

/// Where each arm begins, its angle from the downward vertical, and in space the direction of the plane of both.
function anglesOf(space, arms, places) {
  const place = (i) => (i < 0 ? [0, 0, 0] : [0, 1, 2].map((axis) => places[3 * i + axis]));
  return arms.map(([on, i]) => {
    const from = place(on);
    const [x, y, z] = place(i).map((c, axis) => c - from[axis]);
    return space === 2 ? { from, theta: Math.atan2(x, -z), phi: 0 } : { from, theta: Math.atan2(Math.hypot(x, y), -z), phi: Math.atan2(y, x) };
  });
}

/// The shape of a model for the stage; `seen` is the engine's shape of it, or null before that is known.
function shapeOf(model, seen) {
  const { connections } = model;
  const kinds = model.points.map((point) => point.kind);
  const isConnected = (i, on) => connections.some(({ ends }) => ends.includes(i) && ends.includes(on));
  const hangs = kinds.map((kind, i) => {
    const on = seen?.hangs[i] ?? -2;
    const isAlone = [kind, kinds[on]].some((each) => ["weight", "floor"].includes(each));
    return kind === "cart" || isAlone || isConnected(i, on) ? -2 : on;
  });
  const inSpace = (along) => along && (along.length === 2 ? [along[0], 0, along[1]] : along);
  const arms = (seen?.arms ?? []).filter(([on, i]) => hangs[i] === on || isConnected(i, on));
  return { kinds, connections, hangs, arms, rails: kinds.map((_, i) => inSpace(seen?.rails[i] ?? null)) };
}

function arrow(pen, x0, y0, x, y) {
  const length = Math.hypot(x - x0, y - y0);
  if (length < 3) return;
  const [dx, dy] = [(x - x0) / length, (y - y0) / length];
  line(pen, x0, y0, x - 5 * dx, y - 5 * dy);
  pen.beginPath();
  pen.moveTo(x, y);
  pen.lineTo(x - 9 * dx - 4 * dy, y - 9 * dy + 4 * dx);
  pen.lineTo(x - 9 * dx + 4 * dy, y - 9 * dy - 4 * dx);
  pen.fill();
}
