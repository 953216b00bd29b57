// Places of the points at any time, between rows, too.

const origin = -1;
const free = -2;

// Places have three numbers here; the components of a point in the plane are the first and the last of them.
const components = scene.dimension === 2 ? [0, Infinity, 1] : [0, 1, 2];

/// A row as vectors: the rod of a point that hangs on another by a rod; the place of any other. `hangs[i]` is the point
/// that i hangs on, `origin`, or `free`.
class Motion {
  #kept = new Map(); // a few rows at a time, by run and row

  constructor() {
    this.count = scene.points.length;
    this.hangs = scene.points.map((_, i) => (scene.rods === "none" ? free : i - 1));
    if (scene.rods === "rigid") this.hangs = this.hangs.map((on, i) => (this.#isRod(i, on) ? on : free));
    this.#measure();
  }

  /// Places of all points of a run at a time, into `places`, one after the other.
  at(run, time, places) {
    const row = run.rowAt(time);
    const next = Math.min(row + 1, run.rows - 1);
    const here = this.#vectors(run, row);
    if (next === row || time <= run.t[row]) return this.#hang(here, places);
    const vectors = places; // mixed in place
    this.#mix(run, row, time, vectors);
    return this.#hang(vectors, places);
  }

  /// The same at a row.
  atRow(run, row, places) {
    return this.#hang(this.#vectors(run, row), places);
  }

  // Interpolates by a cubic in time through four rows (Catmull and Rom, for uneven spacing); rods keep their length.
  #mix(run, row, time, out) {
    const last = run.rows - 1;
    const t = run.t;
    const before = Math.max(row - 1, 0);
    const after = Math.min(row + 2, last);
    const [p0, p1, p2, p3] = [before, row, row + 1, after].map((r) => this.#vectors(run, r));
    const step = t[row + 1] - t[row];
    const s = (time - t[row]) / step;
    const lead = Math.max(t[row + 1] - t[before], step);
    const trail = Math.max(t[after] - t[row], step);
    const s2 = s * s;
    const s3 = s2 * s;
    const [h1, h2] = [2 * s3 - 3 * s2 + 1, 3 * s2 - 2 * s3];
    const m1 = ((s3 - 2 * s2 + s) * step) / lead;
    const m2 = ((s3 - s2) * step) / trail;
    for (let k = 0; k < out.length; ++k) {
      out[k] = h1 * p1[k] + h2 * p2[k] + m1 * (p2[k] - p0[k]) + m2 * (p3[k] - p1[k]);
    }
    for (let i = 0; i < this.count; ++i) {
      if (this.hangs[i] === free) continue;
      const length = norm(p1, i) * (1 - s) + norm(p2, i) * s;
      const factor = length / (norm(out, i) || 1);
      for (let axis = 0; axis < 3; ++axis) out[3 * i + axis] *= factor;
    }
  }

  // Places from vectors; the two may be the same array.
  #hang(vectors, places) {
    for (let i = 0; i < this.count; ++i) {
      const on = this.hangs[i];
      for (let axis = 0; axis < 3; ++axis) {
        places[3 * i + axis] = vectors[3 * i + axis] + (on >= 0 ? places[3 * on + axis] : 0);
      }
    }
    return places;
  }

  #vectors(run, row) {
    const key = runs.indexOf(run) * 8 + (row & 7);
    const kept = this.#kept.get(key);
    if (kept?.row === row) return kept.vectors;
    const vectors = kept?.vectors ?? new Float64Array(3 * this.count);
    if (run.column(scene.points[0][1])) this.#fromPoints(run, row, vectors);
    else this.#fromAngles(run, row, vectors);
    this.#kept.set(key, { row, vectors });
    return vectors;
  }

  #fromPoints(run, row, vectors) {
    for (let i = 0; i < this.count; ++i) {
      for (let axis = 0; axis < 3; ++axis) {
        vectors[3 * i + axis] = this.#place(i, axis, row, run) - this.#place(this.hangs[i], axis, row, run);
      }
    }
  }

  // Rods of a chain: (sin θ cos φ, sin θ sin φ, −cos θ), times their lengths.
  #fromAngles(run, row, vectors) {
    const each = scene.dimension - 1;
    for (let i = 0; i < this.count; ++i) {
      const length = scene.lengths[i];
      const [theta, phi] = [0, 1].map((k) => (k < each ? run.column(scene.coordinates[each * i + k][3])[row] : 0));
      vectors[3 * i] = length * Math.sin(theta) * Math.cos(phi);
      vectors[3 * i + 1] = length * Math.sin(theta) * Math.sin(phi);
      vectors[3 * i + 2] = -length * Math.cos(theta);
    }
  }

  // Whether a rod is drawn from `on` to point i: their distance is constant, no connection joins them, i is no cart or fixed
  // pivot, and neither is a weight or a floor.
  #isRod(i, on) {
    if (kindOf(i) === "cart" || [i, on].some((each) => each >= 0 && ["weight", "floor"].includes(kindOf(each)))) return false;
    if (scene.connections.some(([, a, b]) => (a === i && b === on) || (a === on && b === i))) return false;
    if (on === origin && kindOf(i) === "pivot" && this.#span(i).every((span) => span === 0)) return false;
    return this.#isRigid(i, on);
  }

  // One number of a place at a row.
  #place(j, axis, row, run = runs[0]) {
    const k = components[axis];
    return j >= 0 && k < scene.points[j][2] ? run.column(scene.points[j][1] + k)[row] : 0;
  }

  // The range of a point along each axis.
  #span(i) {
    return [0, 1, 2].map((axis) => {
      let [low, high] = [Infinity, -Infinity];
      for (let row = 0; row < runs[0].rows; ++row) {
        const x = this.#place(i, axis, row);
        [low, high] = [Math.min(low, x), Math.max(high, x)];
      }
      return high - low;
    });
  }

  /// The direction of a cart's rail, a unit vector: from its first place to the farthest one; x if it rests; null if it does
  /// not move on a line.
  railOf(i) {
    const run = runs[0];
    const from = (row) => [0, 1, 2].map((axis) => this.#place(i, axis, row) - this.#place(i, axis, 0));
    let [far, along] = [0, [1, 0, 0]];
    for (let row = 1; row < run.rows; ++row) {
      const way = from(row);
      const length = Math.hypot(...way);
      if (length > far) [far, along] = [length, way.map((x) => x / length)];
    }
    for (let row = 1; row < run.rows; ++row) {
      const way = from(row);
      const ahead = way.reduce((sum, x, axis) => sum + x * along[axis], 0);
      if (Math.hypot(...way.map((x, axis) => x - ahead * along[axis])) > 1e-4 * far) return null;
    }
    return along;
  }

  // Whether point i keeps its distance from the one before it, over the rows of the first run.
  #isRigid(i, on) {
    const run = runs[0];
    const distance = (row) => {
      let square = 0;
      for (let axis = 0; axis < 3; ++axis) square += (this.#place(i, axis, row) - this.#place(on, axis, row)) ** 2;
      return Math.sqrt(square);
    };
    const first = distance(0);
    const slack = (run.exact ? 1e-9 : 1e-5) * first;
    for (let row = 1; row < run.rows; ++row) {
      if (Math.abs(distance(row) - first) > slack) return false;
    }
    return first > 0;
  }

  // Finds the box of all runs and the origin, from at most 500 rows a run. `reach` is the scale of lengths.
  #measure() {
    this.low = [0, 0, 0];
    this.high = [0, 0, 0];
    const places = new Float64Array(3 * this.count);
    for (const run of this.count ? runs : []) {
      const stride = Math.max(1, Math.floor(run.rows / Math.min(500, Math.ceil(200000 / this.count))));
      for (let row = 0; row < run.rows; row += stride) {
        this.atRow(run, row, places);
        for (let k = 0; k < places.length; ++k) {
          const axis = k % 3;
          this.low[axis] = Math.min(this.low[axis], places[k]);
          this.high[axis] = Math.max(this.high[axis], places[k]);
        }
      }
    }
    const spans = this.high.map((high, axis) => high - this.low[axis]);
    const chain = scene.lengths.reduce((sum, length) => sum + length, 0);
    this.reach = chain || Math.max(...spans, 1e-9) / 2;
  }

  /// The path of a point, finer than the rows where these are few: times, and places one after the other.
  path(run, point) {
    const parts = Math.max(1, Math.min(6, Math.floor(3000 / run.rows), Math.floor(1e6 / (run.rows * this.count))));
    const samples = (run.rows - 1) * parts + 1;
    const path = { times: new Float64Array(samples), places: new Float32Array(3 * samples) };
    const places = new Float64Array(3 * this.count);
    for (let sample = 0; sample < samples; ++sample) {
      const row = Math.floor(sample / parts);
      const part = (sample % parts) / parts;
      const time = part ? run.t[row] + part * (run.t[row + 1] - run.t[row]) : run.t[row];
      this.at(run, time, places);
      path.times[sample] = time;
      path.places.set(places.subarray(3 * point, 3 * point + 3), 3 * sample);
    }
    return path;
  }

  /// The description for a stage.
  get shape() {
    const { hangs, low, high, reach } = this;
    const kinds = scene.points.map((_, i) => kindOf(i));
    return {
      space: scene.dimension, hangs, kinds, masses: scene.points.map((point) => point[3]), low, high, reach,
      rails: kinds.map((kind, i) => (kind === "cart" ? this.railOf(i) : null)),
      connections: scene.connections.map(([kind, ...ends]) => ({ kind, ends })),
    };
  }
}

/// What a point is drawn as: "bob", "cart", "pivot", "weight" or "floor".
function kindOf(i) {
  return scene.points[i][4];
}

function norm(vectors, i) {
  let square = 0;
  for (let k = 3 * i; k < 3 * i + 3; ++k) square += vectors[k] * vectors[k];
  return Math.sqrt(square);
}

/// Points whose paths are traced: the last of a chain; of a model all bobs and carts, if there are few.
const traced = (() => {
  const last = scene.points.length - 1;
  if (last < 0 || scene.rods !== "rigid" || last > 3) return last < 0 ? [] : [last];
  return scene.points.map((_, i) => i).filter((i) => i === last || (i > 0 && ["bob", "cart"].includes(kindOf(i))));
})();
