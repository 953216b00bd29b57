// The stage: chains or points that move, in the plane or in space, of one motion or of several.

/// With more bobs, each is drawn in one colour in the plane, without shades.
const manyBalls = 60;

/// Radii of bobs: volumes are in proportion to masses, but none is too small to see.
function radiiOf({ space, kinds, masses, reach }) {
  const largest = Math.max(...masses, 0);
  const size = reach * clamp(0.07 / Math.sqrt(kinds.length), 0.005, 0.055);
  return kinds.map((kind, i) => {
    if (kind === "pivot") return 0.4 * size;
    if (kind === "floor") return space === 2 ? size : 0.1 * size;
    return largest > 0 && masses[i] > 0 ? size * Math.max(Math.cbrt(masses[i] / largest), 0.25) : 0.7 * size;
  });
}

/// Whether anything is fixed to the origin.
function holdsOrigin({ rods, connections }) {
  return rods.some(({ on }) => on === -1) || connections.some(({ ends }) => ends.includes(-1));
}

class Stage extends View {
  /// Sets what is drawn. Each point has the point that it hangs on by a rod (-1: the origin, -2: nothing), a kind, a rail and a
  /// mass; `connections` have kinds and ends; [low, high] is the box of all motions, `reach` the scale of lengths.
  shape(told) {
    const [rods, connections] = [true, false].map((are) => told.connections.filter(({ kind }) => (kind === "rod") === are));
    Object.assign(this, told, { count: told.kinds.length, radii: radiiOf(told), connections });
    this.rods = told.hangs.map((on, i) => ({ on, i })).filter(({ on }) => on !== -2);
    this.rods.push(...rods.map(({ ends }) => ({ on: Math.min(...ends), i: Math.max(...ends) })));
    this.fit(told);
    this.scenery = this.space === 2 ? new Plane(this) : new Space(this);
  }

  /// Draws figures, the last one on top: {places, rgb: {ball, tip, rod}, faint, traces: [{way, rgb, isUniform}]}.
  draw(figures) {
    const { pen } = this;
    this.aim();
    pen.setTransform(this.fine, 0, 0, this.fine, 0, 0);
    pen.clearRect(0, 0, this.width, this.height);
    pen.lineJoin = pen.lineCap = "round";
    this.scenery.draw(figures);
  }
}
