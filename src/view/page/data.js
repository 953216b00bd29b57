// What the page holds: the scene, and the rows of its runs.

const scene = JSON.parse(document.getElementById("scene").textContent);
for (const unit of ["timeUnit", "lengthUnit"]) scene[unit] = unitText(scene[unit]);

/// The rows of one run, column by column.
class Run {
  #columns = new Map();

  constructor(described, base64) {
    Object.assign(this, described);
    this.label = described.label.replace(/^\w+(?= \+ )/, symbol); // labels of copies tell their start, "theta_1 + …"
    const bytes = bytesOfBase64(base64);
    let offset = 0;
    const take = (Kind) => {
      const numbers = new Kind(bytes.buffer, bytes.byteOffset + offset, this.rows);
      offset += numbers.byteLength;
      return numbers;
    };
    this.t = take(Float64Array);
    for (const column of described.columns) {
      this.#columns.set(column, take(this.exact ? Float64Array : Float32Array));
    }
    this.energyError = described.energy ? take(Float32Array) : null;
    this.separations = described.separation ? take(Float32Array) : null;
    this.stepSizes = described.steps ? take(Float32Array) : null;
  }

  /// The numbers of a column; undefined if the page does not have them.
  column(index) {
    return index === 0 ? this.t : this.#columns.get(index);
  }

  get start() {
    return this.t[0];
  }
  get end() {
    return this.t[this.rows - 1];
  }

  /// The last row that is not later than a time.
  rowAt(time) {
    return lastBy(time, this.rows, (row) => this.t[row]);
  }

  /// The rows as text, with the columns that the page has: 17 digits of doubles, 9 of floats.
  csv() {
    const held = scene.columns.map((name, index) => ({ name, numbers: this.column(index) })).filter((c) => c.numbers);
    const lines = [held.map((c) => c.name).join(",")];
    const write = this.exact ? exactNumber : (x) => String(Number(x.toPrecision(9)));
    for (let row = 0; row < this.rows; ++row) {
      lines.push(held.map((c, k) => (k === 0 ? exactNumber : write)(c.numbers[row])).join(","));
    }
    return `${lines.join("\n")}\n`;
  }

  /// How the run was thinned, in a sentence; empty if it was not.
  get thinning() {
    if (this.stride === 1) return "";
    return `Thinned: every ${ordinal(this.stride)} of ${this.seen} rows, and the last.`;
  }
}

const runs = [...document.querySelectorAll("script.run")].map((text, k) => new Run(scene.runs[k], text.textContent));

/// Coordinates that can be plotted on one axis: the angles of a chain's links by name, otherwise those of one unit.
const groups = (() => {
  const byKind = new Map();
  scene.coordinates.forEach(([name, unit, isAngle, column, rate]) => {
    const stem = scene.lengths.length ? name.split("_")[0] : unit;
    if (!byKind.has(stem)) byKind.set(stem, { unit, isAngle, isLink: scene.lengths.length > 0, stem, members: [] });
    byKind.get(stem).members.push({ name, column, rate });
  });
  // The scale of a coordinate's rounding: the largest coordinate of its kind; for lengths, of points, too.
  const largest = (columns) => columns.reduce((most, column) => (runs[0].column(column) ?? []).reduce((m, x) => Math.max(m, Math.abs(x) || 0), most), 0);
  const farthest = largest(scene.points.flatMap(([, first, components]) => Array.from({ length: components }, (_, axis) => first + axis)));
  const duration = runs[0].end - runs[0].start || 1;
  for (const { unit, isAngle, members } of byKind.values()) {
    const least = isAngle ? 1 : unit === "m" ? farthest : 0;
    const scale = Math.max(largest(members.map(({ column }) => column)), least) || 1;
    const rateScale = Math.max(largest(members.map(({ rate }) => rate)), scale / duration);
    for (const member of members) Object.assign(member, { scale, rateScale });
  }
  for (const group of byKind.values()) {
    const names = group.members.length <= 3 ? group.members.map((m) => symbol(m.name)).join(", ") : "";
    group.label = group.isLink ? symbol(group.stem) : names || `in ${group.unit}`;
  }
  return [...byKind.values()].sort((a, b) => b.isAngle - a.isAngle); // angles first
})();
