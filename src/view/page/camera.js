// A camera that circles a target, z up: told by mouse, touch and keys.

class OrbitCamera {
  /// radius: of a sphere that is to be seen whole.
  constructor(camera, target, radius) {
    this.camera = camera;
    this.home = { azimuth: -1.05, elevation: 0.24, target: [...target] };
    this.radius = radius;
    this.reset();
  }

  reset() {
    Object.assign(this, this.home, { target: [...this.home.target], zoomed: 1 });
    this.place();
  }

  /// By angles [rad].
  turn(azimuth, elevation) {
    this.azimuth += azimuth;
    this.elevation = Math.min(Math.max(this.elevation + elevation, -1.5), 1.5);
    this.place();
  }

  /// Along the screen, in parts of its height.
  move(x, y) {
    const size = 2 * this.distance * Math.tan((this.camera.fov * Math.PI) / 360);
    const [sin, cos] = [Math.sin(this.azimuth), Math.cos(this.azimuth)];
    const up = [-Math.sin(this.elevation) * cos, -Math.sin(this.elevation) * sin, Math.cos(this.elevation)];
    const right = [-sin, cos, 0];
    this.target = this.target.map((c, axis) => c + size * (x * right[axis] + y * up[axis]));
    this.place();
  }

  zoom(factor) {
    this.zoomed = Math.min(Math.max(this.zoomed * factor, 0.25), 40);
    this.place();
  }

  fit(aspect) {
    this.camera.aspect = aspect;
    this.place();
  }

  get distance() {
    const half = (this.camera.fov * Math.PI) / 360;
    const narrow = Math.min(half, Math.atan(Math.tan(half) * this.camera.aspect));
    return this.radius / Math.sin(narrow) / this.zoomed;
  }

  place() {
    const { camera, distance, target } = this;
    const flat = Math.cos(this.elevation) * distance;
    camera.position.set(
      target[0] + flat * Math.cos(this.azimuth),
      target[1] + flat * Math.sin(this.azimuth),
      target[2] + Math.sin(this.elevation) * distance,
    );
    camera.up.set(0, 0, 1);
    camera.lookAt(...target);
    camera.near = distance / 100;
    camera.far = distance * 4 + 40 * this.radius;
    camera.updateProjectionMatrix();
  }
}
