// Places and velocities of points from rows: t, coordinates, rates, energies, and for models points and their velocities.

/// Sums of vectors along a chain, three numbers each; in the plane x and z are used.
function summed(vectors, out) {
  let [x, y, z] = [0, 0, 0];
  vectors.forEach((each, i) => {
    x += each[0], y += each.length > 2 ? each[1] : 0, z += each.at(-1);
    out[3 * i] = x, out[3 * i + 1] = y, out[3 * i + 2] = z;
  });
  return out;
}

function placesOfChain({ space, l }, q, places) {
  return summed(rodsOfAngles(space, l, q), places);
}

/// Places of a model's points from their columns; in the plane x and z are used.
function placePoints(points, places) {
  let k = 0;
  model.points.forEach((point, i) => {
    const [x, y, z] = point.columns.map(() => points[k++] ?? 0);
    places.set(z === undefined ? [x, 0, y] : [x, y, z], 3 * i);
  });
  return places;
}

function placesOf(state, row, places) {
  const size = state.q.length;
  return model ? placePoints(row.subarray(3 + 2 * size), places) : placesOfChain(state, row.subarray(1, 1 + size), places);
}

function ratesOf(state, row, rates) {
  const size = state.q.length;
  if (model) return placePoints(row.subarray(3 + 2 * size + pointColumns), rates);
  return summed(ratesOfRods(state.space, state.l, row.subarray(1, 1 + size), row.subarray(1 + size, 1 + 2 * size)), rates);
}
