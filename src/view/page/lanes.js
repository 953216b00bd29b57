// The stage of systems without points: each coordinate in a lane of its own, up to the time that is shown.

class Lanes {
  constructor(host) {
    this.canvas = host.appendChild(element("canvas", { tabIndex: 0, className: "still" }));
    this.pen = this.canvas.getContext("2d");
    this.shown = scene.coordinates.slice(0, 12);
    const members = groups.flatMap((group) => group.members);
    const scaleOf = (column) => members.find((member) => member.column === column).scale;
    this.ranges = this.shown.map(([, , , column]) => rangeOf(runs.map((run) => run.column(column)), undefined, scaleOf(column)));
    this.onChange = () => {};
  }

  get description() {
    return `${scene.subject}, which has no points: its coordinates over time. Plots of the same motion follow.`;
  }

  reset() {}
  zoom() {}
  steer() {}

  resize() {
    View.prototype.resize.call(this);
    this.onChange();
  }

  draw(time) {
    const { pen } = this;
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
    pen.setTransform(this.fine, 0, 0, this.fine, 0, 0);
    pen.lineJoin = "round";
    const [top, bottom] = [52, 30];
    const height = (this.height - top - bottom) / this.shown.length;
    this.shown.forEach((_, lane) => this.#drawLane(lane, top + lane * height, height, time));
  }

  #drawLane(lane, top, height, time) {
    const { pen } = this;
    const [name, unit, , column] = this.shown[lane];
    const { low, high } = this.ranges[lane];
    const [left, right] = [110, this.width - 24];
    const x = (t) => left + ((t - runs[0].start) / (runs[0].end - runs[0].start || 1)) * (right - left);
    const y = (q) => top + height * 0.92 - ((q - low) / (high - low)) * height * 0.84;
    pen.fillStyle = palette.css("line", 0.35);
    pen.fillRect(left, top + height * 0.05, right - left, height * 0.9);
    this.#drawName(symbol(name), unit, runs[0].column(column)[runs[0].rowAt(time)], top + height / 2);
    runs.forEach((run, k) => {
      const colour = runs.length > 1 ? palette.run(k) : palette.curves[lane % palette.curves.length];
      const numbers = run.column(column);
      const now = run.rowAt(time);
      this.#drawCurve(run, numbers, 0, run.rows - 1, x, y, rgba(colour, 0.25), 1);
      this.#drawCurve(run, numbers, 0, now, x, y, rgba(colour), 2);
      dot(pen, x(run.t[now]), y(numbers[now]), colour, 5);
    });
  }

  #drawName(name, unit, value, y) {
    const { pen } = this;
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    pen.fillStyle = palette.css("ink");
    pen.font = "600 15px system-ui, sans-serif";
    pen.fillText(name, 16, y - 9);
    pen.fillStyle = palette.css("quiet");
    pen.font = "12px system-ui, sans-serif";
    pen.fillText(`${readable(value)} ${unit}`, 16, y + 10);
  }

  #drawCurve(run, numbers, from, to, x, y, colour, width) {
    const { pen } = this;
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.beginPath();
    for (let row = from; row <= to; ++row) pen.lineTo(x(run.t[row]), y(numbers[row]));
    pen.stroke();
  }
}
