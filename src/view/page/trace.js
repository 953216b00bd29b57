// What a point leaves behind it.

/// One colour, as strong as each corner says.
function fadingMaterial() {
  return new THREE.ShaderMaterial({
    uniforms: { color: { value: new THREE.Color() } },
    vertexShader: `attribute float strength; varying float seen;
      void main() { seen = strength; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`,
    fragmentShader: `uniform vec3 color; varying float seen;
      void main() { gl_FragColor = vec4(color, seen); }`,
    transparent: true,
    depthWrite: false, // where it crosses itself the newer part lies on the older
    side: THREE.DoubleSide,
  });
}

/// The path of a point behind it: a ribbon that faces the eye, and runs out thin and pale.
class Trace {
  constructor(path, most, width) {
    this.path = path;
    this.most = most;
    this.width = width;
    this.geometry = new THREE.BufferGeometry();
    const attribute = (size) =>
      new THREE.BufferAttribute(new Float32Array(2 * size * most), size).setUsage(THREE.DynamicDrawUsage);
    this.geometry.setAttribute("position", attribute(3));
    this.geometry.setAttribute("strength", attribute(1));
    const corners = Array.from({ length: most - 1 }, (_, k) => [0, 1, 2, 2, 1, 3].map((c) => 2 * k + c)).flat();
    this.geometry.setIndex(corners);
    this.mesh = new THREE.Mesh(this.geometry, fadingMaterial());
    this.mesh.renderOrder = 2; // after the bodies: it lets through what is behind it
    this.mesh.frustumCulled = false;
    this.middle = new Float64Array(3 * most);
  }

  /// From one time to another, with `tip` as the last place; `eye` is where it is seen from.
  move(since, time, tip, eye, fades) {
    const count = this.#gather(since, time, tip);
    const { position, strength } = this.geometry.attributes;
    for (let k = 0; k < count; ++k) {
      const fade = fades ? (k + 1) / count : 1;
      this.#widen(position.array, k, count, eye, this.width * Math.sqrt(fade));
      strength.array[2 * k] = strength.array[2 * k + 1] = fades ? fade ** 1.4 : 0.75;
    }
    this.geometry.setDrawRange(0, 6 * (count - 1));
    position.needsUpdate = strength.needsUpdate = true;
  }

  colour(rgb) {
    paint(this.mesh.material, rgb);
  }

  #gather(since, time, tip) {
    const { times, places } = this.path;
    const to = sampleAt(times, time);
    const from = Math.min(sampleAt(times, since), to);
    const stride = Math.max(1, Math.ceil((to - from + 2) / (this.most - 1)));
    let count = 0;
    for (let s = from; s <= to; s += stride, ++count) {
      for (let axis = 0; axis < 3; ++axis) this.middle[3 * count + axis] = places[3 * s + axis];
    }
    for (let axis = 0; axis < 3; ++axis) this.middle[3 * count + axis] = tip[axis];
    return count + 1;
  }

  // Two corners, across the path and the ray to the eye.
  #widen(position, k, count, eye, width) {
    const m = this.middle;
    const [before, after] = [3 * Math.max(k - 1, 0), 3 * Math.min(k + 1, count - 1)];
    const [tx, ty, tz] = [m[after] - m[before], m[after + 1] - m[before + 1], m[after + 2] - m[before + 2]];
    const [rx, ry, rz] = [m[3 * k] - eye.x, m[3 * k + 1] - eye.y, m[3 * k + 2] - eye.z];
    const [cx, cy, cz] = [ty * rz - tz * ry, tz * rx - tx * rz, tx * ry - ty * rx];
    const factor = width / (Math.hypot(cx, cy, cz) || 1);
    const [x, y, z] = [m[3 * k], m[3 * k + 1], m[3 * k + 2]];
    position.set([x - cx * factor, y - cy * factor, z - cz * factor, x + cx * factor, y + cy * factor, z + cz * factor], 6 * k);
  }
}
