// The stage of what moves in space: over a floor, in light, with shadows that the sun throws. What is far is drawn first.

const plus = (a, b, factor = 1) => a.map((x, axis) => x + factor * b[axis]);
const across = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

class Space {
  constructor(stage) {
    this.stage = stage;
    this.pictures = new BobPictures();
    this.floorSize = 3.2 * stage.radius;
    this.grid = this.#gridLines();
    this.pivotRadius = Math.min(0.014 * stage.reach, 1.4 * Math.max(...stage.radii));
    this.wireRadius = Math.max(0.006 * stage.reach, 0.2 * Math.min(...stage.radii));
  }

  draw(figures) {
    const { stage } = this;
    const { middle, axes, far } = stage;
    this.pen = stage.pen;
    this.eye = plus(middle, axes[2], far);
    this.mirror = mirrorOf(axes[2]);
    this.items = []; // {depth, draw, faint}
    const isFew = figures.length <= 8;
    this.#drawFloor();
    figures.forEach((figure, k) => this.#add(figure, isFew || k === figures.length - 1));
    if (holdsOrigin(stage)) this.#addPost();
    this.items.sort((a, b) => b.faint - a.faint || a.depth - b.depth); // solid items are drawn over faint copies
    for (const { draw } of this.items) draw();
  }

  // How far a line on the floor fades with distance, 0 to 1.
  #haze(depth) {
    const part = clamp((-depth / this.stage.radius - 0.8) / 3.2, 0, 1);
    return part * part * (3 - 2 * part);
  }

  // Pieces of the floor's grid lines, and how near to the rim each is.
  #gridLines() {
    const size = this.floorSize;
    const [first, second] = niceTicks(0, size, 7);
    const square = second - first;
    const [places, rims] = [[], []];
    const { middle: [x0, y0], floor } = this.stage;
    const add = (x, y) => (places.push(x0 + x, y0 + y, floor), rims.push(Math.min(Math.hypot(x, y) / size, 1)));
    for (let k = -Math.floor(size / square); k * square <= size; ++k) {
      const half = Math.sqrt(Math.max(size * size - (k * square) ** 2, 0));
      for (let part = 0; part < 24; ++part) {
        const [a, b] = [part, part + 1].map((p) => -half + (half * p) / 12);
        add(a, k * square), add(b, k * square), add(k * square, a), add(k * square, b);
      }
    }
    return { places, rims };
  }

  // The floor fades with depth, which follows from the height on the screen. It is not drawn when seen from below.
  #drawFloor() {
    const { pen, stage, floorSize } = this;
    const { middle: [x0, y0], floor, view } = stage;
    const isAbove = this.eye[2] > floor;
    if (isAbove) {
      const rim = Array.from({ length: 96 }, (_, k) => [x0 + floorSize * Math.cos((k * Math.PI) / 48), y0 + floorSize * Math.sin((k * Math.PI) / 48), floor]);
      const along = Array.from({ length: 17 }, (_, k) => stage.project(x0 + (k / 8 - 1) * floorSize * Math.cos(view.azimuth), y0 + (k / 8 - 1) * floorSize * Math.sin(view.azimuth), floor));
      const [first, last] = [along[0][1], along.at(-1)[1]];
      const colours = pen.createLinearGradient(0, first, 0, last);
      const mixed = (haze) => palette.rgb.floor.map((c, k) => c + (palette.rgb.ground[k] - c) * haze);
      for (const [, y, , depth] of along) colours.addColorStop(clamp((y - first) / (last - first || 1), 0, 1), rgba(mixed(this.#haze(depth))));
      this.#fill(stage.projected(rim.flat()), colours);
    }
    const shown = stage.projected(this.grid.places);
    const byStrength = Array.from({ length: 8 }, () => []);
    for (let k = 0; k < shown.length; k += 8) {
      const strength = (1 - this.grid.rims[k / 4]) * (1 - this.#haze(shown[k + 3]));
      byStrength[Math.min(Math.floor(8 * strength), 7)].push(k);
    }
    pen.lineWidth = 1;
    byStrength.forEach((pieces, level) => {
      pen.strokeStyle = palette.css("line", (level + 0.5) / 8);
      pen.beginPath();
      for (const k of pieces) pen.moveTo(shown[k], shown[k + 1]), pen.lineTo(shown[k + 4], shown[k + 5]);
      pen.stroke();
    });
    this.shadow = isAbove ? palette.css("shade") : null;
  }

  #fill(shown, style) {
    const { pen } = this;
    pen.beginPath();
    for (let k = 0; k < shown.length; k += 4) pen.lineTo(shown[k], shown[k + 1]);
    pen.closePath();
    pen.fillStyle = style;
    pen.fill();
  }

  #put(depth, draw) {
    this.items.push({ depth, draw, faint: this.faint });
  }

  // The place on the floor where the shadow of a place falls.
  #onFloor([x, y, z]) {
    const high = (z - this.stage.floor) / sun[2];
    return [x - high * sun[0], y - high * sun[1], this.stage.floor];
  }

  #add(figure, hasShadow) {
    const { stage } = this;
    const { places, rgb, faint, traces } = figure;
    const radii = faint ? stage.radii.map((radius) => 0.6 * radius) : stage.radii;
    this.faint = faint;
    const at = (i) => (i < 0 ? [0, 0, 0] : Array.from(places.subarray(3 * i, 3 * i + 3)));
    this.rodRadius = Math.min(0.008 * stage.reach, 0.35 * Math.min(...radii)) * (faint ? 0.6 : 1);
    this.throws = hasShadow && this.shadow !== null;
    const rods = this.#rodsOf(places, radii);
    if (this.throws) this.#drawShadows(places, radii, rods);
    this.#addBobs(places, radii, rgb);
    const parts = clamp(Math.round(24 / stage.count), 1, 6);
    for (const { from, to } of rods) this.#addBar(from, to, parts, this.rodRadius, rgb.rod);
    for (const { kind, ends } of stage.connections) this.#addConnection(kind, ...ends.map(at), rgb.rod);
    stage.kinds.forEach((kind, i) => kind === "cart" && this.#addCart(at(i), stage.rails[i], 1.4 * radii[i], rgb));
    for (const each of traces) this.#addTrace(each, faint, radii);
  }

  // The visible part of each rod: from the surface of one bob to that of the other, if there is one.
  #rodsOf(places, radii) {
    const rods = [];
    for (const { on, i } of this.stage.rods) {
      const [x0, y0, z0] = on < 0 ? [0, 0, 0] : [places[3 * on], places[3 * on + 1], places[3 * on + 2]];
      const [x, y, z] = [places[3 * i] - x0, places[3 * i + 1] - y0, places[3 * i + 2] - z0];
      const length = Math.hypot(x, y, z);
      const [begin, end] = [on < 0 ? this.pivotRadius : radii[on], length - radii[i]];
      if (end > begin) rods.push({ from: plus([x0, y0, z0], [x, y, z], begin / length), to: plus([x0, y0, z0], [x, y, z], end / length) });
    }
    return rods;
  }

  // Shadows of rods are bands of their width, those of bobs discs.
  #drawShadows(places, radii, rods) {
    const { pen, stage } = this;
    for (const { from, to } of rods) this.#throw([from, to], this.rodRadius);
    const shown = stage.projected(radii.flatMap((_, i) => this.#onFloor(places.subarray(3 * i, 3 * i + 3))));
    const high = this.eye[2] - stage.floor;
    pen.fillStyle = this.shadow;
    pen.beginPath();
    radii.forEach((radius, i) => {
      if (stage.kinds[i] === "cart") return;
      const [x, y, near, depth] = shown.subarray(4 * i, 4 * i + 4);
      const wide = radius * stage.pixels * near;
      pen.moveTo(x + wide, y);
      pen.ellipse(x, y, wide, wide * Math.min(high / (stage.far - depth), 1), 0, 0, 2 * Math.PI);
    });
    pen.fill();
  }

  // The shadow of a line through places.
  #throw(places, radius) {
    if (!this.throws) return;
    const { pen, stage } = this;
    const flat = places.map((place) => this.#onFloor(place));
    pen.fillStyle = this.shadow;
    pen.beginPath();
    for (let k = 0; k + 1 < flat.length; ++k) {
      const [dx, dy] = [0, 1].map((axis) => flat[k + 1][axis] - flat[k][axis]);
      const wide = radius / (Math.hypot(dx, dy) || 1);
      const corners = [[k, 1], [k + 1, 1], [k + 1, -1], [k, -1]].flatMap(([at, side]) => plus(flat[at], [-dy, dx, 0], side * wide));
      const shown = stage.projected(corners);
      pen.moveTo(shown[0], shown[1]), pen.lineTo(shown[4], shown[5]), pen.lineTo(shown[8], shown[9]), pen.lineTo(shown[12], shown[13]);
    }
    pen.fill();
  }

  #addBobs(places, radii, rgb) {
    const { pen, stage } = this;
    const { axes, pixels, fine, kinds, count } = stage;
    const shown = stage.projected(places);
    const colour = (i) => (kinds[i] === "pivot" ? palette.rgb.ink : i === count - 1 ? rgb.tip : rgb.ball);
    for (let i = 0; i < count; ++i) {
      if (kinds[i] === "cart") continue;
      const radius = Math.max(radii[i] * pixels * shown[4 * i + 2] * (kinds[i] === "pivot" ? 1.15 : 1), 0.8);
      const picture = this.pictures.of(colour(i), 2 * radius * fine, axes);
      this.#put(shown[4 * i + 3], () => pen.drawImage(picture, shown[4 * i] - radius, shown[4 * i + 1] - radius, 2 * radius, 2 * radius));
    }
  }

  // A round bar, drawn in parts: it may be in front of one thing and behind another.
  #addBar(from, to, parts, radius, rgb) {
    const along = plus(to, from, -1);
    const shown = this.stage.projected(Array.from({ length: parts + 1 }, (_, k) => plus(from, along, k / parts)).flat());
    const [a, b] = [shown, shown.subarray(4 * parts)];
    const style = rgb ? this.#shadesOf(from, to, a, b, radius, rgb) : palette.css("edge");
    for (let k = 0; k < parts; ++k) {
      this.#addPart(shown.subarray(4 * k, 4 * k + 4), shown.subarray(4 * k + 4, 4 * k + 8), radius, style, k < parts - 1);
    }
  }

  // A round wire through places.
  #addWire(places, radius, rgb) {
    const shown = this.stage.projected(places.flat());
    for (let k = 0; k + 1 < places.length; ++k) {
      const [a, b] = [shown.subarray(4 * k, 4 * k + 4), shown.subarray(4 * k + 4, 4 * k + 8)];
      this.#addPart(a, b, radius, this.#shadesOf(places[k], places[k + 1], a, b, radius, rgb), true);
    }
  }

  #widthOf(a, b, radius) {
    return Math.max(radius * this.stage.pixels * (a[2] + b[2]), 1);
  }

  // A part that another one follows is a little longer, so that no gap shows.
  #addPart(a, b, radius, style, goesOn) {
    const { pen } = this;
    const further = goesOn ? 0.6 / (Math.hypot(b[0] - a[0], b[1] - a[1]) || 1) : 0;
    this.#put((a[3] + b[3]) / 2, () => {
      pen.strokeStyle = style;
      pen.lineWidth = this.#widthOf(a, b, radius);
      pen.lineCap = "butt";
      line(pen, a[0], a[1], b[0] + further * (b[0] - a[0]), b[1] + further * (b[1] - a[1]));
      pen.lineCap = "round";
    });
  }

  // The shades across a round bar between places, which are a and b on the screen; a thin bar has one shade.
  #shadesOf(from, to, a, b, radius, rgb) {
    const { pen, stage: { axes } } = this;
    const along = unit(plus(to, from, -1));
    const eye = unit(plus(this.eye, plus(from, to).map((x) => x / 2), -1));
    const facing = unit(plus(eye, along, -dotOf(eye, along)));
    const width = this.#widthOf(a, b, radius);
    if (!facing.every(Number.isFinite)) return rgba(rgb); // seen from its end
    if (width < 2) return rgba(lit(rgb, lightOn(facing, this.mirror)));
    const side = across(along, facing);
    const [dx, dy] = [a[1] - b[1], b[0] - a[0]];
    const half = (Math.sign(dx * dotOf(side, axes[0]) - dy * dotOf(side, axes[1])) * width) / 2 / (Math.hypot(dx, dy) || 1);
    const [x, y] = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
    const shades = pen.createLinearGradient(x - half * dx, y - half * dy, x + half * dx, y + half * dy);
    for (const s of [-1, -0.5, 0, 0.5, 1]) {
      const normal = plus(side.map((c) => s * c), facing, Math.sqrt(1 - s * s));
      shades.addColorStop((s + 1) / 2, rgba(lit(rgb, lightOn(normal, this.mirror))));
    }
    return shades;
  }

  // A spring with its windings, or a thread.
  #addConnection(kind, from, to, rgb) {
    const along = plus(to, from, -1);
    const isSpring = kind === "spring";
    const z = unit(along.map((x) => x || 1e-12));
    const x = unit(across(Math.abs(z[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0], z));
    const y = across(z, x);
    const { springEnd } = proportions;
    const parts = isSpring ? 12 * springTurns : 8;
    // At both ends the wire goes straight to the axis.
    const places = Array.from({ length: parts + 1 }, (_, k) => {
      const part = clamp((k / parts - springEnd) / (1 - 2 * springEnd), 0, 1);
      const angle = 2 * Math.PI * springTurns * part;
      const wide = isSpring ? 0.05 * this.stage.reach * clamp(2 * springTurns * Math.min(part, 1 - part), 0, 1) : 0;
      return plus(plus(plus(from, along, k / parts), x, wide * Math.cos(angle)), y, wide * Math.sin(angle));
    });
    const radius = isSpring ? this.wireRadius : 0.5 * this.wireRadius;
    this.#addWire(places, radius, rgb);
    this.#throw(places, radius);
  }

  // x is the direction of the rail, z as near to up as possible.
  #addCart(place, rail, size, rgb) {
    const x = rail ?? [1, 0, 0];
    const level = across([0, 0, 1], x);
    const y = Math.hypot(...level) > 1e-6 ? unit(level) : [0, 1, 0];
    const frame = [x, y, across(x, y)];
    const { cartLong, cartHigh, wheelAside, wheelBelow, wheel } = proportions;
    const box = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, c]) => [a * cartLong * size, c * cartHigh * size]);
    for (const side of [-0.8, 0.8]) {
      for (const aside of [-wheelAside, wheelAside]) {
        const disc = Array.from({ length: 14 }, (_, k) => [aside, -wheelBelow].map((c, axis) => size * (c + wheel * (axis ? Math.sin : Math.cos)((k * Math.PI) / 7))));
        this.#addPrism(place, frame, disc, side * size, 0.1 * size, palette.rgb.edge);
      }
      if (!rail) continue;
      // The rail does not move: its middle is the point of its line next to the origin.
      const middle = plus(plus(plus(place, rail, -dotOf(place, rail)), frame[1], side * size), frame[2], -1.06 * size);
      const ends = [-2, 2].map((way) => plus(middle, rail, way * this.stage.reach));
      this.#addBar(...ends, 16, 0.05 * size, palette.rgb.edge);
      this.#throw(ends, 0.05 * size);
    }
    this.#addPrism(place, frame, box, 0, 0.8 * size, rgb.ball);
  }

  // A convex polygon in the plane of the frame's x and z, `deep` to both sides of `aside` along its y.
  #addPrism(place, [x, y, z], polygon, aside, deep, rgb) {
    const { stage } = this;
    const corner = ([a, c], b) => plus(plus(plus(place, x, a), y, aside + b), z, c);
    const [front, back] = [-deep, deep].map((b) => polygon.map((each) => corner(each, b)));
    const faces = [front, back, ...polygon.map((_, k) => [front[k], front[(k + 1) % polygon.length], back[(k + 1) % polygon.length], back[k]])];
    const middleOf = (corners) => corners.reduce((sum, each) => plus(sum, each, 1 / corners.length), [0, 0, 0]);
    const middle = middleOf([...front, ...back]);
    if (this.throws) for (const face of faces) this.#fill(stage.projected(face.flatMap((each) => this.#onFloor(each))), this.shadow);
    this.#put(stage.project(...middle)[3], () => {
      for (const face of faces) {
        const here = middleOf(face);
        let normal = unit(across(plus(face[1], face[0], -1), plus(face[2], face[0], -1)));
        if (dotOf(normal, plus(here, middle, -1)) < 0) normal = normal.map((c) => -c);
        if (dotOf(normal, plus(this.eye, here, -1)) > 0) this.#fill(stage.projected(face.flat()), rgba(lit(rgb, lightOn(normal, this.mirror))));
      }
    });
  }

  // A post from the origin down to the floor.
  #addPost() {
    const { pen, stage } = this;
    this.#addBar([0, 0, 0], [0, 0, stage.floor], 12, 0);
    const [x, y, near, depth] = stage.project(0, 0, 0);
    this.#put(depth, () => drawDisc(pen, x, y, Math.max(this.pivotRadius * stage.pixels * near, 2), palette.css("ink")));
  }

  // The trace ends at the surface of its bob; its old end is thin and pale.
  #addTrace({ way, rgb, isUniform, point = this.stage.count - 1 }, isFaint, radii) {
    const { pen, stage } = this;
    const last = way.length - 3;
    const gone = (k) => Math.hypot(way[k] - way[last], way[k + 1] - way[last + 1], way[k + 2] - way[last + 2]);
    let end = last;
    while (end > 0 && gone(end) < radii[point]) end -= 3;
    const seen = way.slice(0, end + 6);
    if (end < last && gone(end) > 0) for (let axis = 0; axis < 3; ++axis) seen[end + 3 + axis] = way[last + axis] + (way[end + axis] - way[last + axis]) * (radii[point] / gone(end));
    const width = (isFaint ? 0.005 : 0.008) * stage.radius * stage.pixels;
    for (const piece of piecesOf(stage.projected(seen), isFaint ? 5 : 40, isUniform)) {
      const middle = 4 * Math.floor(piece.line.length / 8);
      this.#put(piece.line[middle + 3], () => drawPiece(pen, piece, rgb, Math.max(width * piece.line[middle + 2] * (isUniform ? 1 : Math.sqrt(piece.age)), 0.5)));
    }
  }
}
