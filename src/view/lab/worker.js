// Orders to the worker, and its answers.

/// Longest time for rows before the worker answers [ms].
const mostWork = 25;

let engine = null;

const orders = {
  async start({ module }) {
    const stream = new Blob([module]).stream().pipeThrough(new DecompressionStream("gzip"));
    engine = new Engine(await startModule(await WebAssembly.compile(await new Response(stream).arrayBuffer())));
    return { ready: true };
  },

  /// Begins another motion.
  begin({ spec, start, copies, apart, measure }) {
    engine.begin(spec, start);
    if (copies) engine.copy(copies, apart);
    if (measure) engine.measure(true);
    return { begun: true, rows: engine.present(), rowSize: engine.rowSize, shape: spec.program ? engine.shape(engine.motion().q, spec.components, spec.connections) : null };
  },

  copy({ copies, apart }) {
    engine.copy(copies, apart);
    return {};
  },

  measure({ on }) {
    engine.measure(on);
    return {};
  },

  /// Finds a state with a point at a place, at a speed.
  pose({ q, time, first, place, speed }) {
    const posed = pose(engine, q, first, place, time);
    const rest = new Float64Array(q.length);
    const v = speed.some((each) => each !== 0) ? ratesFor(engine, posed, first, speed, time) : engine.closed({ time, q: posed, v: rest }).v;
    return { q: posed, v, points: engine.pointsAt(posed, time), rates: engine.pointRates({ time, q: posed, v }) };
  },

  /// Computes rows up to a time.
  advance({ until, hand }) {
    const began = performance.now();
    const rows = [];
    while (engine.time < until - 1e-9 && performance.now() - began < mostWork) {
      engine.next(hand ?? null);
      rows.push(engine.present());
    }
    const all = new Float64Array(rows.length * engine.rowSize);
    rows.forEach((row, k) => all.set(row, k * engine.rowSize));
    const { exponent } = engine;
    return {
      rows: all, rowSize: engine.rowSize, copies: engine.copies.length ? { all: engine.copiesNow(), points: engine.copyPoints() } : null,
      exponent: exponent && Number.isFinite(exponent.value) ? [exponent.last, exponent.value] : null,
      isLate: engine.time < until - 1e-9, milliseconds: performance.now() - began,
    };
  },
};

// Orders are done one after the other: the first one takes a while.
let before = Promise.resolve();
self.onmessage = ({ data }) => {
  before = before.then(async () => {
    try {
      const answer = await orders[data.order](data);
      self.postMessage({ ...answer, number: data.number, order: data.order });
    } catch (error) {
      self.postMessage({ error: error.message, isOpen: error instanceof OpenLinkage, number: data.number, order: data.order });
    }
  });
};
