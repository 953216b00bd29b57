// The stage of a page: all its runs, and the paths of some points.

class Theatre extends Stage {
  constructor(host, motion) {
    super(host.appendChild(element("canvas", { tabIndex: 0 })));
    this.motion = motion;
    this.shape(motion.shape);
    this.runPlaces = runs.map(() => new Float64Array(3 * motion.count));
    this.paths = runs.map((run) => traced.map((point) => motion.path(run, point)));
    this.onChange = () => {};
    watchGestures(this, { changed: () => this.onChange() });
  }

  get description() {
    return `${scene.subject}, moving${this.space === 3 ? ", in perspective over a floor" : ""}. Plots of the same motion follow.`;
  }

  reset() {
    super.reset();
    this.onChange();
  }
  resize() {
    super.resize();
    this.onChange();
  }
  zoom(...how) {
    super.zoom(...how);
    this.onChange();
  }
  /// Keys turn the view in space, or move it if `moves`; in the plane they move it.
  steer(x, y, moves) {
    if (this.space === 3 && !moves) this.turn(-12.5 * x, 12.5 * y);
    else this.move(-0.05 * x * this.width, 0.05 * y * this.height);
    this.onChange();
  }

  /// `trace`: length of traces, as a part of the first run's time.
  draw(time, trace) {
    const since = time - trace * (runs[0].end - runs[0].start);
    const figures = runs.map((run, k) => {
      const places = this.motion.at(run, time, this.runPlaces[k]);
      const own = palette.run(k);
      const rgb = runs.length > 1 ? { ball: own, tip: own, rod: own } : { ball: palette.rgb.bob, tip: own, rod: palette.rgb.rod };
      const traces = trace === 0 ? [] : traced.map((point, n) => ({ way: this.#way(k, n, since, time), rgb: own, isUniform: trace >= 1, point }));
      return { places, rgb, faint: runs.length > 8, traces };
    });
    super.draw(figures.reverse()); // the first one on top
  }

  // The way of a traced point since a time, to where it is now.
  #way(k, n, since, time) {
    const { times, places } = this.paths[k][n];
    const at = (when) => lastBy(when, times.length, (sample) => times[sample]);
    const to = at(time);
    const from = Math.min(at(since), to);
    const way = new Float32Array(3 * (to - from + 2));
    way.set(places.subarray(3 * from, 3 * to + 3));
    way.set(this.runPlaces[k].subarray(3 * traced[n], 3 * traced[n] + 3), way.length - 3);
    return way;
  }
}
