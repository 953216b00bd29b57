// The view: from places to the canvas, and back. Places have three numbers; in the plane the second is 0.

/// Pixels that a motion in the plane leaves free: for clock and buttons, and for the scale.
const inset = { top: 42, bottom: 32 };

/// Distance of the eye from the middle, in the radius of what is shown, so that 32° hold it.
const eyeDistance = 1 / Math.sin((16 * Math.PI) / 180);

function clamp(x, low, high) {
  return Math.min(Math.max(x, low), high);
}

class View {
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    this.view = { zoom: 1, x: 0, y: 0, azimuth: -1.05, elevation: 0.24 };
  }

  reset() {
    Object.assign(this.view, { zoom: 1, x: 0, y: 0, azimuth: -1.05, elevation: 0.24 });
  }

  /// Sets the box that is shown. In space a floor lies a little below the box, and `radius` is that of a sphere around both.
  fit({ space, low, high, reach }) {
    Object.assign(this, { space, reach });
    this.middle = low.map((x, axis) => (x + high[axis]) / 2);
    if (space === 2) {
      this.home = [0, 2].map((axis) => Math.max(high[axis] - low[axis], reach) + 0.16 * reach);
      return;
    }
    this.floor = Math.min(low[2], -0.02 * reach) - 0.16 * reach;
    this.middle[2] = (this.floor + Math.max(high[2], 0)) / 2;
    this.radius = Math.max(0.5 * reach, ...high.map((x, axis) => x - this.middle[axis]), ...low.map((x, axis) => this.middle[axis] - x)) * 1.12;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    fitCanvas(this.canvas, width, height);
    Object.assign(this, { width, height, fine: this.canvas.width / Math.max(width, 1) });
  }

  /// CSS pixels of a metre at the distance of the middle.
  get scale() {
    const { width, height, view } = this;
    if (this.space === 3) return ((0.48 * Math.max(Math.min(width, height), 60)) / this.radius) * view.zoom;
    return Math.min(width / this.home[0], Math.max(height - inset.top - inset.bottom, 1) / this.home[1]) * view.zoom;
  }

  /// The height of the middle from the top, unless the view was moved.
  get centre() {
    return (this.height + (this.space === 2 ? inset.top - inset.bottom : 0)) / 2;
  }

  /// Computes the projection for the present view.
  aim() {
    const { azimuth, elevation } = this.view;
    const [sa, ca, se, ce] = [Math.sin(azimuth), Math.cos(azimuth), Math.sin(elevation), Math.cos(elevation)];
    // Axes of the screen: to the right, up, and to the eye.
    this.axes = this.space === 2
      ? [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
      : [[-sa, ca, 0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]];
    this.pixels = this.scale;
    this.far = this.space === 2 ? Infinity : eyeDistance * this.radius;
    this.left = this.width / 2 + this.view.x * this.pixels;
    this.top = this.centre - this.view.y * this.pixels;
  }

  /// [x, y, nearness, depth] of a place on the screen; what is nearer is larger, and has more depth.
  project(x, y, z) {
    return this.projected([x, y, z]);
  }

  /// The same for consecutive places.
  projected(places) {
    const { far, left, top, pixels, middle } = this;
    const [right, up, eye] = this.axes;
    const out = new Float64Array((places.length / 3) * 4);
    for (let k = 0, at = 0; k < places.length; k += 3, at += 4) {
      const [x, y, z] = [places[k] - middle[0], places[k + 1] - middle[1], places[k + 2] - middle[2]];
      const depth = x * eye[0] + y * eye[1] + z * eye[2];
      const near = far === Infinity ? 1 : far / Math.max(far - depth, 0.02 * far);
      out[at] = left + pixels * near * (x * right[0] + y * right[1] + z * right[2]);
      out[at + 1] = top - pixels * near * (x * up[0] + y * up[1] + z * up[2]);
      out[at + 2] = near;
      out[at + 3] = depth;
    }
    return out;
  }

  /// The place under a pixel, as deep as another place.
  placeAt(pixelX, pixelY, like = this.middle) {
    this.aim();
    const [right, up, eye] = this.axes;
    const [, , near, depth] = this.project(...like);
    const [a, b] = [(pixelX - this.left) / (this.pixels * near), (this.top - pixelY) / (this.pixels * near)];
    return this.middle.map((c, axis) => c + a * right[axis] + b * up[axis] + (this.space === 2 ? 0 : depth * eye[axis]));
  }

  /// Zooms about a pixel.
  zoom(factor, pixelX = this.width / 2, pixelY = this.centre) {
    this.aim();
    const { view, pixels } = this;
    view.zoom = clamp(view.zoom * factor, 0.2, 200);
    const change = 1 / this.scale - 1 / pixels;
    view.x += (pixelX - this.width / 2) * change;
    view.y -= (pixelY - this.centre) * change;
    this.aim();
  }
  /// Turns the view, by pixels.
  turn(dx, dy) {
    this.view.azimuth -= dx * 0.008;
    this.view.elevation = clamp(this.view.elevation + dy * 0.008, -1.5, 1.5);
  }
  move(dx, dy) {
    this.view.x += dx / this.pixels;
    this.view.y -= dy / this.pixels;
  }
}
