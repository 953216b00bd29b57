// The hand: it takes a bob, and the rest follows.

/// Angles of a chain whose bob is brought as near as can be to a place; the rods below keep their directions. Rods above
/// are laid from both ends in turn (FABRIK: Aristidou and Lasenby).
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
  constructor() {
    this.bob = -1;
  }

  get isHolding() {
    return this.bob >= 0;
  }

  take(bob, place) {
    this.bob = bob;
    this.wanted = [...place];
    this.place = [...place];
    this.speed = [0, 0, 0];
  }

  letGo() {
    this.bob = -1;
  }

  /// Goes where it is wanted, without jerks: critically damped, within a few hundredths of a second.
  move(passed) {
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
  }

  /// What the engine is told: components of the chain's space.
  told(space) {
    if (!this.isHolding) return null;
    const of = ([x, y, z]) => (space === 2 ? [x, z] : [x, y, z]);
    return { bob: this.bob, place: of(this.place), speed: of(this.speed) };
  }
}

/// Pointers on the stage: of a bob the hand's, of a ruler's end, otherwise the view's. `before()`: places of some moments ago.
function watchStage(stage, { take, drag, drop, changed, before }) {
  const { canvas } = stage;
  const fingers = new Map();
  let holder = null; // the pointer that holds something
  let ruler = null;
  const place = (event) => [event.offsetX, event.offsetY];

  canvas.addEventListener("pointerdown", (event) => {
    const [x, y] = place(event);
    try {
      canvas.setPointerCapture(event.pointerId);
    } catch {
      // a pointer that is gone
    }
    fingers.set(event.pointerId, [x, y]);
    if (holder !== null || event.button > 0 || event.shiftKey || fingers.size > 1) return;
    ruler = document.documentElement.dataset.ruler ? stage.rulerAt(x, y) ?? null : null;
    const bob = ruler ? -1 : stage.pointAt(x, y, event.pointerType === "touch" ? 40 : 26, before());
    if (!ruler && bob < 0) return;
    holder = event.pointerId;
    if (bob >= 0) take(bob, x, y);
    canvas.classList.toggle("held", bob >= 0);
  });
  canvas.addEventListener("pointermove", (event) => {
    const [x, y] = place(event);
    const last = fingers.get(event.pointerId);
    if (!last) {
      canvas.classList.toggle("near", event.pointerType === "mouse" && stage.pointAt(x, y) >= 0);
      return;
    }
    if (holder === event.pointerId) {
      if (ruler) stage.moveRuler(ruler, x, y);
      else drag(x, y);
    } else if (fingers.size === 2) {
      const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
      const spread = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
      if (spread(last) > 0) stage.zoom(spread([x, y]) / spread(last));
    } else if (holder === null) {
      const turns = stage.space === 3 && !event.shiftKey && !(event.buttons & 6);
      stage[turns ? "turn" : "move"](x - last[0], y - last[1]);
    }
    fingers.set(event.pointerId, [x, y]);
    changed();
  });
  for (const ended of ["pointerup", "pointercancel", "lostpointercapture"]) {
    canvas.addEventListener(ended, (event) => {
      fingers.delete(event.pointerId);
      if (holder !== event.pointerId) return;
      holder = null;
      canvas.classList.remove("held");
      if (!ruler) drop();
      ruler = null;
      changed();
    });
  }
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === 1 ? 16 : 1);
    stage.zoom(Math.exp(-clamp(pixels, -200, 200) * 0.0016));
    changed();
  }, { passive: false });
}
