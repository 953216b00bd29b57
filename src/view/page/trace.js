// Traces that points leave behind.

/// A trace in pieces of one brightness each, oldest first: {line, strength, age}; `line` is a piece as View.projected
/// returns it, `age` runs to 1. Few pieces, because a stroke costs much more than a point.
function piecesOf(line, count, isUniform) {
  const last = line.length / 4 - 1;
  const pieces = [];
  for (let piece = 0; piece < count; ++piece) {
    const [from, to] = [piece, piece + 1].map((k) => Math.floor((last * k) / count));
    if (to <= from) continue;
    const age = (piece + 1) / count;
    pieces.push({ line: line.subarray(4 * from, 4 * to + 4), age, strength: isUniform ? 0.55 : age ** 1.5 });
  }
  return pieces;
}

/// Draws a piece. Of one that goes to and fro too closely to be seen, it draws the area that the piece covers.
function drawPiece(pen, { line, strength }, rgb, width) {
  const cover = coverOf(line);
  pen.strokeStyle = rgba(rgb, strength);
  pen.fillStyle = rgba(rgb, 0.4 * strength);
  pen.lineWidth = width;
  pen.lineCap = "butt"; // pieces are transparent: round ends would overlap visibly
  pen.beginPath();
  if (cover) for (const [x, y] of cover) pen.lineTo(x, y);
  else for (let k = 0; k < line.length; k += 4) pen.lineTo(line[k], line[k + 1]);
  cover ? pen.fill() : pen.stroke();
  pen.lineCap = "round";
}

/// The convex hull of a way on the screen that runs to and fro with less than a few pixels between; null of any other.
function coverOf(line) {
  let [left, right, high, low, length] = [Infinity, -Infinity, Infinity, -Infinity, 0];
  for (let k = 0; k < line.length; k += 4) {
    const [x, y] = [line[k], line[k + 1]];
    left = Math.min(left, x), right = Math.max(right, x), high = Math.min(high, y), low = Math.max(low, y);
    if (k) length += Math.hypot(x - line[k - 4], y - line[k - 3]);
  }
  if (length < 3 * Math.hypot(right - left, low - high) || length < 12) return null;
  const side = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  const half = (places) => {
    const kept = [];
    for (const place of places) {
      while (kept.length > 1 && side(kept.at(-2), kept.at(-1), place) <= 0) kept.pop();
      kept.push(place);
    }
    return kept.slice(0, -1);
  };
  const sorted = Array.from({ length: line.length / 4 }, (_, k) => [line[4 * k], line[4 * k + 1]]).sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const hull = [...half(sorted), ...half(sorted.reverse())];
  const area = hull.reduce((sum, [x, y], k) => sum + x * hull.at(k - 1)[1] - hull.at(k - 1)[0] * y, 0) / 2;
  return Math.abs(area) < 4 * length ? hull : null;
}
