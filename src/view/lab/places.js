// Where points are, and how fast, from rows: t, coordinates, rates, energies, and of models points and their velocities.

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

/// Places of a model's points from their columns: what is in the plane is in x and z.
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
  const sum = [0, 0, 0];
  const each = ratesOfRods(state.space, state.l, row.subarray(1, 1 + size), row.subarray(1 + size, 1 + 2 * size));
  each.forEach((rate, i) => {
    if (state.space === 2) sum[0] += rate[0], sum[2] += rate[1];
    else for (let axis = 0; axis < 3; ++axis) sum[axis] += rate[axis];
    rates.set(sum, 3 * i);
  });
  return rates;
}
