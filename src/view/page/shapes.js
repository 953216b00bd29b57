// What carts, springs and pivots look like on a canvas: here and in the laboratory. Bobs are drawn in plane.js and
// space.js.

/// Lengths relative to the size of a cart, or to a spring; films have the same (plotting/pendula_plot/shapes.py).
const proportions = {
  "springTurns": 10, "springEnd": 0.1,
  "pulley": 0.6, "weightWide": 0.8, "weightHigh": 1.1, "floorWide": 14,
  "cartLong": 1.6, "cartHigh": 0.62, "wheelAside": 0.95, "wheelBelow": 0.66, "wheel": 0.36, "railBelow": 1.02
};

/// Zigzags of a spring, however long it is.
const { springTurns } = proportions;

/// The angle at which to draw a cart on a rail along (dx, dy) or its opposite, so that its upper side is up.
function uprightAngle(dx, dy) {
  const angle = Math.atan2(dy, dx);
  if (angle > Math.PI / 2 + 1e-9) return angle - Math.PI;
  return angle <= -Math.PI / 2 + 1e-9 ? angle + Math.PI : angle;
}

function drawDisc(pen, x, y, radius, style) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fillStyle = style;
  pen.fill();
}

function drawRail(pen, [x0, y0], [x1, y1], size) {
  const angle = uprightAngle(x1 - x0, y1 - y0);
  const [dx, dy] = [-Math.sin(angle), Math.cos(angle)].map((x) => x * proportions.railBelow * size);
  pen.strokeStyle = palette.css("edge");
  pen.lineWidth = 2;
  line(pen, x0 + dx, y0 + dy, x1 + dx, y1 + dy);
}

/// A box with wheels, whose middle is [x, y].
function drawCart(pen, [x, y], angle, size, colour) {
  const { cartLong, cartHigh, wheelAside, wheelBelow, wheel } = proportions;
  pen.save();
  pen.translate(x, y);
  pen.rotate(angle);
  pen.fillStyle = colour;
  pen.strokeStyle = palette.css("panel");
  pen.lineWidth = Math.min(1.5, 0.12 * size);
  pen.beginPath();
  pen.rect(-cartLong * size, -cartHigh * size, 2 * cartLong * size, 2 * cartHigh * size);
  pen.fill();
  pen.fillStyle = palette.css("rod");
  for (const side of [-wheelAside, wheelAside]) {
    pen.beginPath();
    pen.arc(side * size, wheelBelow * size, wheel * size, 0, 2 * Math.PI);
    pen.fill();
    pen.stroke();
  }
  pen.restore();
}

/// A spring with its windings, `wide` to each side, or a thread.
function drawConnection(pen, kind, [x0, y0], [x1, y1], wide) {
  const [dx, dy] = [x1 - x0, y1 - y0];
  const length = Math.hypot(dx, dy) || 1;
  const corners = kind === "spring" ? 2 * springTurns : 0;
  const [first, last] = [proportions.springEnd, 1 - proportions.springEnd];
  pen.beginPath();
  pen.moveTo(x0, y0);
  for (let k = 0; k <= corners && corners; ++k) {
    const along = first + ((last - first) * k) / corners;
    const across = k === 0 || k === corners ? 0 : ((k % 2 ? wide : -wide) / length);
    pen.lineTo(x0 + along * dx - across * dy, y0 + along * dy + across * dx);
  }
  pen.lineTo(x1, y1);
  pen.stroke();
}

/// A thread straight up from [x0, y0], over a wheel there, to a wheel at [x1, y1]; wheels in the size of a cart.
function drawPulleys(pen, [x0, y0], [x1, y1], size) {
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x0, y1);
  pen.lineTo(x1, y1);
  pen.stroke();
  const rod = pen.strokeStyle;
  for (const x of [x0, x1]) {
    pen.beginPath();
    pen.arc(x, y1, proportions.pulley * size, 0, 2 * Math.PI);
    pen.fillStyle = palette.css("panel");
    pen.fill();
    pen.stroke();
    pen.beginPath();
    pen.arc(x, y1, 0.15 * size, 0, 2 * Math.PI);
    pen.fillStyle = rod;
    pen.fill();
  }
}

/// A box whose upper edge hangs at [x, y].
function drawWeight(pen, [x, y], size, colour) {
  const { weightWide, weightHigh } = proportions;
  pen.fillStyle = colour;
  pen.fillRect(x - weightWide * size, y, 2 * weightWide * size, 2 * weightHigh * size);
}

/// A level line, and strokes below.
function drawFloor(pen, [x, y], size) {
  const wide = proportions.floorWide * size;
  pen.strokeStyle = palette.css("edge");
  pen.lineWidth = 2;
  line(pen, x - wide, y, x + wide, y);
  pen.lineWidth = 1;
  for (let k = -wide; k < wide; k += 0.7 * size) line(pen, x + k + 0.5 * size, y, x + k, y + 0.5 * size);
}

function drawPivot(pen, [x, y]) {
  pen.beginPath();
  pen.arc(x, y, 4.5, 0, 2 * Math.PI);
  pen.fillStyle = palette.css("panel");
  pen.strokeStyle = palette.css("ink");
  pen.lineWidth = 2;
  pen.fill();
  pen.stroke();
}
