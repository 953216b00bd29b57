// Light in space: the brightness of a surface by its direction, and pictures of bobs in that light.

const unit = (vector) => vector.map((x) => x / Math.hypot(...vector));
const dotOf = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/// The direction to the sun, which throws the shadows.
const sun = [0.35, -0.25, 1];
const sunward = unit(sun);
const sideward = unit([-1, 0.6, 0.2]);

/// The direction halfway between sun and eye: a surface that faces there mirrors the sun to the eye.
const mirrorOf = (eye) => unit(sunward.map((x, axis) => x + eye[axis]));

/// [light, gloss] of a surface by its outward normal. Light comes from sky and ground, the sun, and the side; gloss (Blinn
/// and Phong) is about `mirror`. A colour is multiplied by light, and gloss is added.
function lightOn(normal, mirror) {
  const bySun = Math.max(dotOf(normal, sunward), 0);
  const light = 0.75 * (0.541 + 0.459 * (0.5 + 0.5 * normal[2])) + 0.6 * bySun + 0.2 * Math.max(dotOf(normal, sideward), 0);
  return [light, 0.52 * bySun * Math.max(dotOf(normal, mirror), 0) ** 40];
}

/// A colour in that light.
function lit(rgb, [light, gloss]) {
  return rgb.map((c) => Math.min(Math.round(c * light + 255 * gloss), 255));
}

/// Pictures of bobs, balls lit from the sun, for some axes of the screen, by colour and size.
class BobPictures {
  #pictures = new Map();
  #axes = "";
  #last = {}; // most bobs are alike

  /// A picture that is at least `size` pixels wide, up to 256.
  of(rgb, size, axes) {
    const wide = size > 128 ? 256 : size > 64 ? 128 : size > 32 ? 64 : size > 16 ? 32 : 16;
    const last = this.#last;
    if (last.rgb === rgb && last.wide === wide && last.axes === axes) return last.picture;
    const now = axes.join();
    if (now !== this.#axes) this.#pictures.clear();
    this.#axes = now;
    const key = `${rgb} ${wide}`;
    if (!this.#pictures.has(key)) this.#pictures.set(key, this.#draw(rgb, wide, axes));
    this.#last = { rgb, wide, axes, picture: this.#pictures.get(key) };
    return this.#last.picture;
  }

  #draw(rgb, wide, axes) {
    const picture = element("canvas", { width: wide, height: wide });
    const pen = picture.getContext("2d");
    const image = pen.createImageData(wide, wide);
    const radius = wide / 2;
    const lights = this.#lights(wide, axes);
    for (let k = 0; k < wide * wide; ++k) {
      const [light, gloss] = [lights[2 * k], lights[2 * k + 1]];
      for (let c = 0; c < 3; ++c) image.data[4 * k + c] = rgb[c] * light + 255 * gloss;
      const [x, y] = [(k % wide) + 0.5 - radius, Math.floor(k / wide) + 0.5 - radius];
      image.data[4 * k + 3] = 255 * clamp(radius - Math.hypot(x, y) + 0.5, 0, 1);
    }
    pen.putImageData(image, 0, 0);
    return picture;
  }

  // [light, gloss] of each pixel, for all colours.
  #lights(wide, axes) {
    const key = `lights ${wide}`;
    if (this.#pictures.has(key)) return this.#pictures.get(key);
    const lights = new Float32Array(2 * wide * wide);
    const mirror = mirrorOf(axes[2]);
    for (let k = 0; k < wide * wide; ++k) {
      let [a, b] = [((k % wide) + 0.5) / (wide / 2) - 1, 1 - (Math.floor(k / wide) + 0.5) / (wide / 2)];
      const far = Math.hypot(a, b);
      if (far > 1) a /= far, b /= far;
      const c = Math.sqrt(Math.max(1 - a * a - b * b, 0));
      lights.set(lightOn([0, 1, 2].map((axis) => a * axes[0][axis] + b * axes[1][axis] + c * axes[2][axis]), mirror), 2 * k);
    }
    this.#pictures.set(key, lights);
    return lights;
  }
}
