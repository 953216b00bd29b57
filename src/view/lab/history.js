// The computed rows. Where there are too many, the newest ones.

const mostBytes = 96e6;

class History {
  /// tipOf(row) returns the place of the last point, [x, y, z], which is kept beside the rows, for its trace.
  constructor(tipOf) {
    this.tipOf = tipOf;
    this.clear(1);
  }

  clear(rowSize) {
    this.tips = new Float32Array(3 * 1024);
    this.rowSize = rowSize;
    this.rows = 0;
    this.numbers = new Float64Array(1024 * rowSize);
    this.version = (this.version ?? 0) + 1;
  }

  get start() {
    return this.rows ? this.numbers[0] : 0;
  }
  get end() {
    return this.rows ? this.numbers[(this.rows - 1) * this.rowSize] : 0;
  }

  time(row) {
    return this.numbers[row * this.rowSize];
  }
  get(row, column) {
    return this.numbers[row * this.rowSize + column];
  }

  add(rows) {
    const needed = this.rows * this.rowSize + rows.length;
    if (needed > this.numbers.length) this.#grow(needed);
    this.numbers.set(rows, this.rows * this.rowSize);
    for (let from = 0; from < rows.length; from += this.rowSize, ++this.rows) {
      this.tips.set(this.tipOf(rows.subarray(from, from + this.rowSize)), 3 * this.rows);
    }
  }

  /// Removes the rows after a time.
  cut(time) {
    while (this.rows > 0 && this.time(this.rows - 1) > time + 1e-9) --this.rows;
    ++this.version;
  }

  // Drops the older half if memory is full.
  #grow(needed) {
    if (8 * needed > mostBytes) {
      const half = this.rows >> 1;
      this.numbers.copyWithin(0, half * this.rowSize, this.rows * this.rowSize);
      this.tips.copyWithin(0, 3 * half, 3 * this.rows);
      this.rows -= half;
      ++this.version;
      return;
    }
    const larger = new Float64Array(Math.max(2 * this.numbers.length, needed));
    larger.set(this.numbers.subarray(0, this.rows * this.rowSize));
    this.numbers = larger;
    const tips = new Float32Array(3 * Math.floor(larger.length / this.rowSize));
    tips.set(this.tips.subarray(0, 3 * this.rows));
    this.tips = tips;
  }

  /// The last row that is not later than a time.
  rowAt(time) {
    return lastBy(time + 1e-12, this.rows, (row) => this.time(row));
  }

  /// The row at a time, between two rows by a cubic through coordinates and rates; into `out`.
  at(time, size, out) {
    const row = this.rowAt(time);
    const begin = row * this.rowSize;
    const here = this.numbers.subarray(begin, begin + this.rowSize);
    out.set(here);
    if (row + 1 >= this.rows || time <= here[0]) return out;
    const next = this.numbers.subarray(begin + this.rowSize, begin + 2 * this.rowSize);
    const step = next[0] - here[0];
    const s = (time - here[0]) / step;
    for (let k = 0; k < this.rowSize; ++k) out[k] = here[k] + s * (next[k] - here[k]);
    const [h0, h1, h2, h3] = [(1 + 2 * s) * (1 - s) ** 2, s * (1 - s) ** 2, s * s * (3 - 2 * s), s * s * (s - 1)];
    for (let k = 1; k <= size; ++k) {
      out[k] = h0 * here[k] + h1 * step * here[k + size] + h2 * next[k] + h3 * step * next[k + size];
    }
    return out;
  }
}
