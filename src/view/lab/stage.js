// The stage: a chain or a model's points, in the plane or in space, on a canvas. In space the eye turns about the pivot.

const balls = 60; // that are shaded; of more each is one colour

/// Places of a chain's bobs, one after the other, three numbers each.
function placesOfChain(state, q, places) {
  const { n, space, l } = state;
  let [x, y, z] = [0, 0, 0];
  for (let i = 0; i < n; ++i) {
    const [sin, cos] = [Math.sin(q[i]), Math.cos(q[i])];
    if (space === 2) {
      x += l[i] * sin;
    } else {
      x += l[i] * sin * Math.cos(q[n + i]);
      y += l[i] * sin * Math.sin(q[n + i]);
    }
    z -= l[i] * cos;
    places[3 * i] = x, places[3 * i + 1] = y, places[3 * i + 2] = z;
  }
  return places;
}

class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    this.view = { zoom: 1, x: 0, y: 0, azimuth: -0.9, elevation: 0.22 };
    this.ruler = { from: [-0.5, -0.4], to: [0.5, -0.4] };
    this.ruler.from.push(0), this.ruler.to.push(0);
  }

  /// What there is to draw: how many points, what each hangs on, its kind and its rail, what is between points, `arms` that turn
  /// from the vertical, [from, to], masses, and how far it all reaches.
  shape({ space, count, hangs, arms, kinds, rails, connections, masses, reach }) {
    Object.assign(this, { space, count, hangs, arms, kinds, rails, connections, masses, reach });
    this.places = new Float64Array(3 * count);
    const largest = Math.max(...masses, 1e-300);
    const size = reach * clamp(0.075 / Math.sqrt(Math.max(count, 1)), 0.006, 0.05);
    this.radii = Array.from(masses, (mass) => size * clamp(Math.cbrt(mass / largest), 0.3, 1));
  }

  reset() {
    this.view = { zoom: 1, x: 0, y: 0, azimuth: -0.9, elevation: 0.22 };
  }

  resize() {
    fitStage(this);
    this.turned = null;
  }

  /// Pixels to a metre.
  get scale() {
    const room = Math.min(this.width - 24, this.height - 64);
    return (Math.max(room, 60) / (2.16 * this.reach)) * this.view.zoom;
  }

  #aim() {
    const { azimuth, elevation } = this.view;
    const [sa, ca, se, ce] = [Math.sin(azimuth), Math.cos(azimuth), Math.sin(elevation), Math.cos(elevation)];
    // Axes of the screen: to the right, up, and to the eye.
    this.axes = this.space === 2
      ? [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
      : [[-sa, ca, 0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]];
    this.pixels = this.scale;
    this.far = 7 * this.reach;
    this.left = this.width / 2 + this.view.x * this.pixels;
    this.top = (this.height + 10) / 2 - this.view.y * this.pixels;
  }

  /// [x, y, nearness] of a place on the screen; in space what is nearer is larger.
  project(x, y, z) {
    const [right, up, eye] = this.axes;
    const depth = x * eye[0] + y * eye[1] + z * eye[2];
    const near = this.space === 2 ? 1 : this.far / (this.far - depth);
    const k = this.pixels * near;
    return [this.left + k * (x * right[0] + y * right[1] + z * right[2]), this.top - k * (x * up[0] + y * up[1] + z * up[2]), near, depth];
  }

  /// The place under a pixel, as deep as another place.
  placeAt(pixelX, pixelY, like = [0, 0, 0]) {
    this.#aim();
    const [right, up, eye] = this.axes;
    const depth = like[0] * eye[0] + like[1] * eye[1] + like[2] * eye[2];
    const near = this.space === 2 ? 1 : this.far / (this.far - depth);
    const [a, b] = [(pixelX - this.left) / (this.pixels * near), (this.top - pixelY) / (this.pixels * near)];
    return [0, 1, 2].map((axis) => a * right[axis] + b * up[axis] + (this.space === 2 ? 0 : depth * eye[axis]));
  }

  /// The point that is nearest to a pixel, -1 where none is near. `before`: places of some moments ago, the newest first:
  /// whoever reaches for a fast ball presses where it was.
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

  zoom(factor) {
    this.view.zoom = clamp(this.view.zoom * factor, 0.2, 50);
  }
  turn(dx, dy) {
    this.view.azimuth -= dx * 0.008;
    this.view.elevation = clamp(this.view.elevation + dy * 0.008, -1.5, 1.5);
  }
  move(dx, dy) {
    this.view.x += dx / this.pixels;
    this.view.y -= dy / this.pixels;
  }

  /// Draws all. `what`: {places, rates, trace, copies, held, show: Set}.
  draw(what) {
    const { pen } = this;
    this.#aim();
    pen.setTransform(this.fine, 0, 0, this.fine, 0, 0);
    pen.fillStyle = palette.css("ground");
    pen.fillRect(0, 0, this.width, this.height);
    pen.lineJoin = pen.lineCap = "round";
    this.space === 2 ? this.#drawGrid() : this.#drawFloor();
    if (what.trace) this.#drawTrace(what.trace);
    if (what.copies) this.#drawCopies(what.copies);
    if (what.show.has("angles")) this.#drawAngles(what);
    this.#drawBodies(what);
    if (what.show.has("velocities")) this.#drawVelocities(what);
    if (what.held) this.#drawHand(what.held);
    if (what.show.has("ruler")) this.#drawRuler();
  }

  #drawGrid() {
    const { pen, width, height, pixels } = this;
    const ticks = niceTicks(0, width / pixels, width / 110);
    const step = ticks.length > 1 ? ticks[1] - ticks[0] : width / pixels;
    pen.strokeStyle = palette.css("line");
    pen.lineWidth = 1;
    pen.beginPath();
    for (let x = this.left % (step * pixels); x < width; x += step * pixels) pen.moveTo(Math.round(x) + 0.5, 0), pen.lineTo(Math.round(x) + 0.5, height);
    for (let y = this.top % (step * pixels); y < height; y += step * pixels) pen.moveTo(0, Math.round(y) + 0.5), pen.lineTo(width, Math.round(y) + 0.5);
    pen.stroke();
    pen.strokeStyle = pen.fillStyle = palette.css("quiet");
    pen.lineWidth = 1.5;
    const [x1, y] = [width - 14, height - 14];
    line(pen, x1 - step * pixels, y, x1, y);
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.fillText(`${readable(step)} m`, x1 - (step * pixels) / 2, y - 6);
  }

  #drawFloor() {
    const { pen, reach } = this;
    const floor = -1.12 * reach;
    const rings = niceTicks(0, 1.6 * reach, 4).slice(1);
    const ground = (x, y) => this.project(x, y, floor);
    const last = rings.at(-1) ?? reach;
    pen.fillStyle = palette.css("floor");
    pen.beginPath();
    for (let k = 0; k < 64; ++k) pen.lineTo(...ground(last * Math.cos((k * Math.PI) / 32), last * Math.sin((k * Math.PI) / 32)).slice(0, 2));
    pen.fill();
    pen.strokeStyle = palette.css("line");
    pen.lineWidth = 1;
    for (const radius of rings) {
      pen.beginPath();
      for (let k = 0; k <= 64; ++k) pen.lineTo(...ground(radius * Math.cos((k * Math.PI) / 32), radius * Math.sin((k * Math.PI) / 32)).slice(0, 2));
      pen.stroke();
    }
    for (let k = 0; k < 12; ++k) {
      const [c, s] = [last * Math.cos((k * Math.PI) / 6), last * Math.sin((k * Math.PI) / 6)];
      line(pen, ...ground(0, 0).slice(0, 2), ...ground(c, s).slice(0, 2));
    }
    pen.strokeStyle = palette.css("edge", 0.5);
    line(pen, ...this.project(0, 0, 0).slice(0, 2), ...ground(0, 0).slice(0, 2));
    // Shadows.
    pen.fillStyle = palette.css("shade", 0.8);
    pen.strokeStyle = palette.css("shade", 0.8);
    pen.lineWidth = 3;
    pen.beginPath();
    for (let i = 0; i < this.count; ++i) {
      const from = this.hangs[i];
      if (from < 0) pen.moveTo(...ground(0, 0).slice(0, 2));
      const b = ground(this.places[3 * i], this.places[3 * i + 1]);
      pen.lineTo(b[0], b[1]);
    }
    pen.stroke();
    if (this.count > balls) return;
    for (let i = 0; i < this.count; ++i) {
      const [x, y, near] = ground(this.places[3 * i], this.places[3 * i + 1]);
      const radius = this.radii[i] * this.pixels * near;
      pen.beginPath();
      pen.ellipse(x, y, radius, radius * Math.max(Math.abs(this.axes[2][2]), 0.12), 0, 0, 2 * Math.PI);
      pen.fill();
    }
  }

  // In pieces of one brightness each; of pieces that go to and fro too closely to be seen what they cover. `trace`: places of
  // the last point, one after the other, oldest first.
  #drawTrace(trace) {
    const { pen } = this;
    const samples = trace.length / 3;
    const pieces = 16;
    pen.lineWidth = 2;
    pen.lineCap = "butt";
    for (let piece = 0; piece < pieces; ++piece) {
      const [from, to] = [piece, piece + 1].map((k) => Math.floor(((samples - 1) * k) / pieces));
      if (to <= from) continue;
      const strength = 0.85 * ((piece + 1) / pieces) ** 1.5;
      const way = Array.from({ length: to - from + 1 }, (_, k) => this.project(...trace.subarray(3 * (from + k), 3 * (from + k) + 3)));
      const cover = coverOf(way);
      pen.strokeStyle = palette.css("trace", strength);
      pen.fillStyle = palette.css("trace", 0.4 * strength);
      pen.beginPath();
      for (const [x, y] of cover ?? way) pen.lineTo(x, y);
      cover ? pen.fill() : pen.stroke();
    }
    pen.lineCap = "round";
  }

  #drawCopies({ places, count }) {
    const { pen } = this;
    const each = 3 * this.count;
    pen.lineWidth = 1.2;
    for (let k = 0; k < count; ++k) {
      const colour = palette.ramp(count > 1 ? k / (count - 1) : 0);
      pen.strokeStyle = rgba(colour, 0.5);
      const part = places.subarray(k * each, (k + 1) * each);
      const points = Array.from({ length: this.count }, (_, i) => this.#shown(part, i));
      this.#drawRods(points);
      for (const { ends } of this.connections) {
        const [from, to] = ends.map((end) => (end < 0 ? this.project(0, 0, 0) : points[end]));
        line(pen, from[0], from[1], to[0], to[1]);
      }
      const [x, y, near] = points.at(-1);
      pen.fillStyle = rgba(colour, 0.9);
      pen.beginPath();
      pen.arc(x, y, Math.max(0.5 * this.radii[this.count - 1] * this.pixels * near, 2), 0, 2 * Math.PI);
      pen.fill();
    }
  }

  #drawBodies({ places, held }) {
    const { pen, count } = this;
    const points = Array.from({ length: count }, (_, i) => this.#shown(places, i));
    const pivot = this.project(0, 0, 0);
    this.#drawRails(places);
    pen.strokeStyle = palette.css("rod");
    pen.lineWidth = 2;
    for (const { kind, ends } of this.connections) {
      const [from, to] = ends.map((end) => (end < 0 ? pivot : points[end]));
      if (kind === "pulleys") drawPulleys(pen, from, to, this.#cartSize);
      else drawConnection(pen, kind, from, to, 0.045 * this.reach * this.pixels);
    }
    const thick = clamp((0.014 * this.reach * this.pixels) / Math.sqrt(count / 3 + 1), 1.3, 5);
    pen.lineWidth = thick;
    this.#drawRods(points);
    if (this.hangs.includes(-1) || this.connections.some(({ ends }) => ends.includes(-1))) drawPivot(pen, pivot);
    if (count > balls) {
      this.#drawManyBalls(points);
      if (held) this.#drawBall(points[held.bob], held.bob, true);
      return;
    }
    const order = points.map((_, i) => i);
    if (this.space === 3) order.sort((a, b) => points[a][3] - points[b][3]);
    for (const i of order) {
      if (this.kinds[i] === "cart") this.#drawCart(places, i);
      else if (this.kinds[i] === "pivot") drawPivot(pen, points[i]);
      else if (this.kinds[i] === "weight") drawWeight(pen, points[i], this.#cartSize, palette.css("bob"));
      else if (this.kinds[i] === "floor") drawFloor(pen, points[i], this.#cartSize);
      else this.#drawBall(points[i], i, i === held?.bob);
    }
  }

  #drawRods(points) {
    const { pen } = this;
    pen.beginPath();
    points.forEach(([x, y], i) => {
      const on = this.hangs[i];
      if (on === -2) pen.moveTo(x, y);
      else if (on !== i - 1 || i === 0) pen.moveTo(...(on < 0 ? this.project(0, 0, 0) : points[on]).slice(0, 2));
      pen.lineTo(x, y);
    });
    pen.stroke();
  }

  // Two places on the rail of a cart, on the screen: before and behind the origin, as far as one sees.
  #railEnds(places, i) {
    const along = this.rails[i] ?? [1, 0, 0];
    const place = Array.from(places.subarray(3 * i, 3 * i + 3));
    const ahead = place.reduce((sum, x, axis) => sum + x * along[axis], 0);
    const far = this.space === 2 ? (this.width + this.height) / this.pixels + Math.hypot(this.view.x, this.view.y) : 1.6 * this.reach;
    return [-far, far].map((way) => this.project(...place.map((x, axis) => x + (way - ahead) * along[axis])));
  }

  get #cartSize() {
    return 0.065 * this.reach * this.pixels;
  }

  #drawRails(places) {
    this.kinds.forEach((kind, i) => {
      if (kind === "cart" && this.rails[i]) drawRail(this.pen, ...this.#railEnds(places, i), this.#cartSize);
    });
  }

  #drawCart(places, i) {
    const [[x0, y0], [x1, y1]] = this.#railEnds(places, i);
    const place = this.#shown(places, i);
    drawCart(this.pen, place, uprightAngle(x1 - x0, y1 - y0), this.#cartSize * place[2], palette.css("bob"));
  }

  // All in one colour, but for the last.
  #drawManyBalls(points) {
    const { pen } = this;
    pen.fillStyle = palette.css("bob");
    pen.beginPath();
    for (let i = 0; i < points.length - 1; ++i) {
      const [x, y, near] = points[i];
      const radius = Math.max(this.radii[i] * this.pixels * near, 1.4);
      pen.moveTo(x + radius, y);
      pen.arc(x, y, radius, 0, 2 * Math.PI);
    }
    pen.fill();
    this.#drawBall(points.at(-1), points.length - 1, false);
  }

  #drawBall([x, y, near], i, isHeld) {
    const { pen } = this;
    const radius = Math.max(this.radii[i] * this.pixels * near, 1.4);
    const rgb = i === this.count - 1 ? palette.rgb.trace : palette.rgb.bob;
    pen.beginPath();
    pen.arc(x, y, radius, 0, 2 * Math.PI);
    if (this.count <= balls && radius > 4) {
      const light = pen.createRadialGradient(x - 0.35 * radius, y - 0.4 * radius, 0.1 * radius, x, y, radius);
      light.addColorStop(0, rgba(rgb.map((c) => Math.round(c + (255 - c) * 0.45))));
      light.addColorStop(0.55, rgba(rgb));
      light.addColorStop(1, rgba(rgb.map((c) => Math.round(c * 0.78))));
      pen.fillStyle = light;
    } else {
      pen.fillStyle = rgba(rgb);
    }
    pen.fill();
    if (!isHeld) return;
    pen.beginPath();
    pen.arc(x, y, radius + 5, 0, 2 * Math.PI);
    pen.strokeStyle = palette.css("accent");
    pen.lineWidth = 2;
    pen.stroke();
  }

  #drawHand({ bob, place }) {
    const { pen } = this;
    const [x0, y0] = this.#shown(this.places, bob);
    const [x, y] = this.project(...place);
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
      pen.fillText(`${Math.round((theta * 180) / Math.PI) || 0}°`.replace("-", "−"), x, y + 4);
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
    return [0, 1, 2].map((axis) => this.reach * (a * right[axis] + b * up[axis]));
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

/// The convex hull of a way on the screen that runs to and fro with less than a few pixels between; null of any other.
function coverOf(way) {
  const lengthOf = (a, b) => Math.hypot(b[0] - a[0], b[1] - a[1]);
  const length = way.reduce((sum, place, k) => sum + (k ? lengthOf(way[k - 1], place) : 0), 0);
  const [xs, ys] = [0, 1].map((axis) => way.map((place) => place[axis]));
  const across = Math.hypot(Math.max(...xs) - Math.min(...xs), Math.max(...ys) - Math.min(...ys));
  if (length < 3 * across || length < 12) return null;
  const side = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  const half = (places) => {
    const kept = [];
    for (const place of places) {
      while (kept.length > 1 && side(kept.at(-2), kept.at(-1), place) <= 0) kept.pop();
      kept.push(place);
    }
    return kept.slice(0, -1);
  };
  const sorted = way.slice().sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const hull = [...half(sorted), ...half(sorted.reverse())];
  const area = hull.reduce((sum, [x, y], k) => sum + x * hull.at(k - 1)[1] - hull.at(k - 1)[0] * y, 0) / 2;
  return Math.abs(area) < 4 * length ? hull : null;
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

/// How a model is drawn; `seen` is what the engine knows of its shape, null before it does.
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
