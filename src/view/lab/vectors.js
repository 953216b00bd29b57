// Rods as vectors: for the page, and for the worker.

/// Vectors of a chain's rods from its angles: θ of all links, then φ.
function rodsOfAngles(space, lengths, q) {
  const n = lengths.length;
  return Array.from(lengths, (length, i) => {
    const [sin, cos] = [Math.sin(q[i]), Math.cos(q[i])];
    if (space === 2) return [length * sin, -length * cos];
    return [length * sin * Math.cos(q[n + i]), length * sin * Math.sin(q[n + i]), -length * cos];
  });
}

/// Velocities of a chain's rods.
function ratesOfRods(space, lengths, q, v) {
  const n = lengths.length;
  return Array.from(lengths, (length, i) => {
    const [sin, cos] = [Math.sin(q[i]), Math.cos(q[i])];
    if (space === 2) return [length * v[i] * cos, length * v[i] * sin];
    const [s, c] = [Math.sin(q[n + i]), Math.cos(q[n + i])];
    const [along, around] = [length * v[i], length * v[n + i] * sin];
    return [along * cos * c - around * s, along * cos * s + around * c, along * sin];
  });
}
