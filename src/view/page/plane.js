// The stage of what moves in the plane.

class Plane {
  constructor(stage) {
    this.stage = stage;
  }

  draw(figures) {
    this.pen = this.stage.pen;
    this.#drawGrid();
    for (const { traces, faint } of figures) for (const each of traces) this.#drawTrace(each, faint);
    this.#drawRails(figures.at(-1));
    for (const figure of figures) this.#drawBodies(figure);
    if (holdsOrigin(this.stage)) drawPivot(this.pen, this.stage.project(0, 0, 0));
  }

  #drawGrid() {
    const { pen, stage } = this;
    const { width, height, pixels } = stage;
    const [left, top] = stage.project(0, 0, 0);
    const ticks = niceTicks(0, width / pixels, width / 110);
    const step = (ticks.length > 1 ? ticks[1] - ticks[0] : width / pixels) * pixels;
    pen.strokeStyle = palette.css("line");
    pen.lineWidth = 1;
    pen.beginPath();
    for (let x = left % step; x < width; x += step) pen.moveTo(Math.round(x) + 0.5, 0), pen.lineTo(Math.round(x) + 0.5, height);
    for (let y = top % step; y < height; y += step) pen.moveTo(0, Math.round(y) + 0.5), pen.lineTo(width, Math.round(y) + 0.5);
    pen.stroke();
    // A scale: the side of a square of the grid.
    const [x, y] = [width - 14, height - 14];
    pen.strokeStyle = pen.fillStyle = palette.css("quiet");
    pen.lineWidth = 1.5;
    line(pen, x - step, y, x, y);
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.fillText(`${readable(step / pixels)} ${scene.lengthUnit}`, x - step / 2, y - 6);
  }

  #drawTrace({ way, rgb, isUniform }, isFaint) {
    const pieces = piecesOf(this.stage.projected(way), isFaint ? 5 : 20, isUniform);
    for (const piece of pieces) drawPiece(this.pen, { ...piece, strength: piece.strength * (isFaint ? 0.5 : 0.9) }, rgb, isFaint ? 1.2 : 2);
  }

  #cartSize(i) {
    return Math.max(1.5 * this.stage.radii[i] * this.stage.pixels, 4);
  }

  // Rails reach beyond the visible part.
  #drawRails({ places }) {
    const { stage } = this;
    const far = (stage.width + stage.height) / stage.pixels + Math.hypot(stage.view.x, stage.view.y) + stage.reach;
    stage.rails.forEach((along, i) => {
      if (stage.kinds[i] !== "cart" || !along) return;
      const end = (way) => stage.project(...along.map((x, axis) => places[3 * i + axis] + way * x));
      drawRail(this.pen, end(-far), end(far), this.#cartSize(i));
    });
  }

  #drawBodies(figure) {
    const { pen, stage } = this;
    const { places, rgb, faint } = figure;
    const shown = stage.projected(places);
    const at = (i) => (i < 0 ? stage.project(0, 0, 0) : shown.subarray(4 * i, 4 * i + 2));
    pen.strokeStyle = rgba(rgb.rod, faint ? 0.45 : 1);
    pen.lineWidth = faint ? 1.3 : clamp((0.014 * stage.reach * stage.pixels) / Math.sqrt(stage.count / 3 + 1), 1.3, 5);
    pen.beginPath();
    let last = null;
    for (const { on, i } of stage.rods) {
      if (on !== last) pen.moveTo(...at(on).slice(0, 2));
      pen.lineTo(...at(i));
      last = i;
    }
    pen.stroke();
    pen.lineWidth = faint ? 1.2 : 2;
    for (const { kind, ends } of stage.connections) {
      if (kind === "pulleys") drawPulleys(pen, ...ends.map(at), this.#cartSize(ends[0]));
      else drawConnection(pen, kind, ...ends.map(at), Math.max(0.04 * stage.reach * stage.pixels, 3));
    }
    this.#drawBobs(figure, shown);
    if (!faint) stage.kinds.forEach((kind, i) => this.#drawThing(kind, i, at(i), rgba(i === stage.count - 1 ? rgb.tip : rgb.ball)));
  }

  #drawThing(kind, i, place, colour) {
    const [dx, , dz] = this.stage.rails[i] ?? [1, 0, 0];
    if (kind === "cart") drawCart(this.pen, place, uprightAngle(dx, -dz), this.#cartSize(i), colour);
    else if (kind === "weight") drawWeight(this.pen, place, this.#cartSize(i), colour);
    else if (kind === "floor") drawFloor(this.pen, place, this.#cartSize(i));
    else if (kind === "pivot") drawPivot(this.pen, place);
  }

  // The last bob has the colour of its trace; faint figures have only that one. Bobs without shades are one path.
  #drawBobs({ rgb, faint }, shown) {
    const { pen, stage } = this;
    const { count, kinds, radii, pixels } = stage;
    const radius = (i) => Math.max(radii[i] * pixels * (faint ? 0.5 : 1), 1.3);
    const isShaded = (i) => !faint && count <= manyBalls && radius(i) > 4;
    const draw = (balls, colour) => {
      for (const i of balls.filter(isShaded)) drawDisc(pen, shown[4 * i], shown[4 * i + 1], radius(i), this.#shades(shown[4 * i], shown[4 * i + 1], radius(i), colour));
      pen.fillStyle = rgba(colour, faint ? 0.55 : 1);
      pen.beginPath();
      for (const i of balls.filter((each) => !isShaded(each))) {
        pen.moveTo(shown[4 * i] + radius(i), shown[4 * i + 1]);
        pen.arc(shown[4 * i], shown[4 * i + 1], radius(i), 0, 2 * Math.PI);
      }
      pen.fill();
    };
    const balls = Array.from({ length: count }, (_, i) => i).filter((i) => kinds[i] === "bob");
    if (!faint) draw(balls.filter((i) => i < count - 1), rgb.ball);
    draw(balls.filter((i) => i === count - 1), rgb.tip);
  }

  #shades(x, y, radius, rgb) {
    const light = this.pen.createRadialGradient(x - 0.35 * radius, y - 0.4 * radius, 0.1 * radius, x, y, radius);
    light.addColorStop(0, rgba(rgb.map((c) => Math.round(c + (255 - c) * 0.45))));
    light.addColorStop(0.55, rgba(rgb));
    light.addColorStop(1, rgba(rgb.map((c) => Math.round(c * 0.78))));
    return light;
  }
}
