// Curves on canvases.

const closest = 4; // least pixels of a line's up and down that can be seen

/// The envelope of a line that goes up and down faster than that: {x, low, high, mean} in pixels; empty for other lines.
function bandOf(points) {
  let turns = 0;
  for (let k = 2; k < points.length; ++k) {
    if ((points[k][1] - points[k - 1][1]) * (points[k - 1][1] - points[k - 2][1]) < 0) ++turns;
  }
  const width = points.length ? points.at(-1)[0] - points[0][0] : 0;
  if (turns < 8 || (2 * width) / turns > closest) return [];
  const band = [];
  for (const [x, y] of points) {
    const last = band.at(-1);
    if (!last || x >= last.begin + closest) band.push({ begin: x, x, low: y, high: y, sum: y, count: 1 });
    else Object.assign(last, { low: Math.max(last.low, y), high: Math.min(last.high, y), sum: last.sum + y, count: last.count + 1, x: (last.begin + x) / 2 });
  }
  return band.map(({ x, low, high, sum, count }) => ({ x, low, high, mean: sum / count }));
}

/// Draws a line through pixels. Over time, if it goes up and down too fast to be seen, the band that it stays in, and its mean.
function drawLine(pen, points, isOverTime) {
  const band = isOverTime ? bandOf(points) : [];
  if (band.length) {
    const { globalAlpha, strokeStyle } = pen;
    pen.fillStyle = strokeStyle;
    pen.globalAlpha = 0.3 * globalAlpha;
    pen.beginPath();
    for (const { x, low } of band) pen.lineTo(x, low);
    for (const { x, high } of band.slice().reverse()) pen.lineTo(x, high);
    pen.fill();
    pen.globalAlpha = globalAlpha;
  }
  pen.beginPath();
  for (const [x, y] of band.length ? band.map(({ x, mean }) => [x, mean]) : points) pen.lineTo(x, y);
  pen.stroke();
}

/// Draws the points x(row), y(row), with gaps where one is not finite, and where coordinate `wrapped` (0 or 1), an angle, jumps.
function drawCurve(pen, axes, { from, to, stride = 1 }, x, y, { wrapped = -1, isOverTime = false } = {}) {
  let [piece, before] = [[], null];
  for (let row = from; row <= to; row += stride) {
    const at = [x(row), y(row)];
    const isGap = !at.every(Number.isFinite);
    if (isGap || (before && wrapped >= 0 && Math.abs(at[wrapped] - before[wrapped]) > Math.PI)) {
      drawLine(pen, piece, isOverTime);
      piece = [];
    }
    if (!isGap) piece.push([axes.atX(at[0]), axes.atY(at[1])]);
    before = isGap ? null : at;
  }
  drawLine(pen, piece, isOverTime);
}
