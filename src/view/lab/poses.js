// What a hand does with a model: a point is where it is held, and moves as it is moved; a linkage follows.

/// Coordinates near to q at which the components of a point, from `first` on, are nearest to a place, by damped least
/// squares.
function pose(engine, q, first, place, time) {
  const wanted = Array.from(place);
  const near = 1e-9 * (Math.hypot(...wanted) + 1);
  const rest = new Float64Array(q.length);
  const offAt = (there) => {
    const points = engine.pointsAt(there, time);
    return wanted.map((x, k) => x - points[first + k]);
  };
  let now = engine.closed({ time, q: Float64Array.from(q), v: rest }).q;
  let off = offAt(now);
  for (let round = 0; round < 40 && Math.hypot(...off) > near; ++round) {
    const change = nearestChange(engine, now, first, off, time);
    let next = null;
    for (let part = 1; part > 1e-2 && !next; part /= 2) next = nearerAt(now.map((x, k) => x + part * change[k]));
    if (!next) break;
    const gained = Math.hypot(...off) - Math.hypot(...next.off);
    ({ now, off } = next);
    if (gained < near) break;
  }
  return now;

  function nearerAt(there) {
    try {
      const closed = engine.closed({ time, q: there, v: rest }).q;
      const left = offAt(closed);
      return Math.hypot(...left) < Math.hypot(...off) ? { now: closed, off: left } : null;
    } catch (error) {
      if (error instanceof OpenLinkage) return null;
      throw error;
    }
  }
}

/// Rates at which the velocity of the point is nearest to a given one.
function ratesFor(engine, q, first, velocity, time) {
  const own = engine.closed({ time, q, v: new Float64Array(q.length) }).v; // constraints may move
  const driven = engine.pointRates({ time, q, v: own });
  const change = leastChangeAlong(engine, q, first, Array.from(velocity, (x, k) => x - driven[first + k]), time);
  return own.map((x, k) => x + change[k]);
}

/// A change of coordinates that brings the point nearer by `off`. That of a linkage is short, so that it does not come out put
/// together in another way.
function nearestChange(engine, q, first, off, time) {
  const change = leastChangeAlong(engine, q, first, off, time);
  const short = engine.isLinkage ? Math.min(1, 0.1 / Math.max(...change.map(Math.abs))) : 1;
  return change.map((x) => x * short);
}

function leastChangeAlong(engine, q, first, off, time) {
  const ways = waysAt(engine, q, time);
  const parts = leastChange(slopesAlong(engine, q, ways, first, off.length, time), off);
  return q.map((_, i) => ways.reduce((sum, way, k) => sum + parts[k] * way[i], 0));
}

/// Ways in which coordinates can go: each by itself, or what constraints leave of that.
function waysAt(engine, q, time) {
  const along = (v) => engine.closed({ time, q, v }).v;
  const own = along(new Float64Array(q.length));
  return Array.from(q, (_, k) => along(Float64Array.from(q, (__, i) => Number(i === k))).map((x, i) => x - own[i]));
}

// Derivatives of the components of a point along each way, by differences.
function slopesAlong(engine, q, ways, first, count, time) {
  const here = engine.pointsAt(q, time);
  const by = 1e-6 * (1 + Math.max(...q.map(Math.abs)));
  return ways.map((way) => {
    const there = engine.pointsAt(q.map((x, i) => x + by * way[i]), time);
    return Array.from({ length: count }, (_, axis) => (there[first + axis] - here[first + axis]) / by);
  });
}
