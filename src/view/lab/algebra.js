// Small sums and linear systems for the engine.

/// The unit vector to which all ways are parallel; null if there is none.
function directionOf(ways) {
  const length = Math.hypot(...ways[0]);
  if (!(length > 0)) return null;
  const along = ways[0].map((x) => x / length);
  const isAlong = ways.every((way) => {
    const ahead = way.reduce((sum, x, axis) => sum + x * along[axis], 0);
    return Math.hypot(...way.map((x, axis) => x - ahead * along[axis])) < 1e-9 * (length + Math.abs(ahead));
  });
  return isAlong ? along : null;
}

function sumOf(vectors, space) {
  return Array.from({ length: space }, (_, axis) => vectors.reduce((sum, vector) => sum + vector[axis], 0));
}

/// Adds rod × force: of a link in the plane one number, in space three.
function putTorque(torques, space, link, rod, force) {
  if (space === 2) {
    torques[link] += rod[0] * force[1] - rod[1] * force[0];
    return;
  }
  for (let axis = 0; axis < 3; ++axis) {
    const [a, b] = [(axis + 1) % 3, (axis + 2) % 3];
    torques[3 * link + axis] += rod[a] * force[b] - rod[b] * force[a];
  }
}

/// The least change of coordinates that moves a point by `off`, where slopes[k] is its derivative by coordinate k:
/// x = Jᵀ (J Jᵀ + ε)⁻¹ off.
function leastChange(slopes, off) {
  const n = off.length;
  const square = off.map((_, a) => off.map((__, b) => slopes.reduce((sum, slope) => sum + slope[a] * slope[b], 0)));
  const trace = square.reduce((sum, row, a) => sum + row[a], 0);
  square.forEach((row, a) => (row[a] += 1e-3 * trace + 1e-12));
  const y = off.slice();
  for (let a = 0; a < n; ++a) {
    for (let b = a + 1; b < n; ++b) {
      const factor = square[b][a] / square[a][a];
      for (let c = a; c < n; ++c) square[b][c] -= factor * square[a][c];
      y[b] -= factor * y[a];
    }
  }
  for (let a = n - 1; a >= 0; --a) {
    for (let b = a + 1; b < n; ++b) y[a] -= square[a][b] * y[b];
    y[a] /= square[a][a];
  }
  return slopes.map((slope) => slope.reduce((sum, s, a) => sum + s * y[a], 0));
}

/// What one motion is beside another.
function differenceOf(there, here) {
  const [q, v] = ["q", "v"].map((part) => there[part].map((x, k) => x - here[part][k]));
  return { q, v };
}

function sizeOf({ q, v }) {
  return Math.sqrt([...q, ...v].reduce((sum, x) => sum + x * x, 0));
}
