// The newest rows of a stream, in typed arrays; column `t` ascends.

export class Ring {
  // `capacity` rows are kept; storage is twice that, so that they always lie in one piece, from `begin` to `end`.
  constructor(capacity) {
    this.capacity = capacity;
    this.clear();
  }

  clear() {
    /** @type {Record<string, Float64Array>} */
    this.columns = { t: new Float64Array(2 * this.capacity) };
    this.begin = 0;
    this.end = 0;
  }

  get empty() {
    return this.begin === this.end;
  }
  get newest() {
    return this.empty ? -Infinity : this.columns.t[this.end - 1];
  }
  get oldest() {
    return this.empty ? Infinity : this.columns.t[this.begin];
  }

  // Appends rows: a vector is a column for each of its axes, with their number, `null` is not-a-number. Rows no newer than the newest are left out.
  push(t, columns) {
    let first = 0;
    while (first < t.length && t[first] <= this.newest) first += 1;
    const last = t.length;
    if (last - first > this.capacity) first = last - this.capacity;
    const count = last - first;
    if (count <= 0) return 0;
    if (this.end + count > 2 * this.capacity) this.#compact(count);
    this.#write("t", t, first, last);
    for (const [name, values] of Object.entries(columns)) {
      if (Array.isArray(values[0])) values.forEach((axis, k) => this.#write(`${name}_${k}`, axis, first, last));
      else this.#write(name, values, first, last);
    }
    this.end += count;
    this.begin = Math.max(this.begin, this.end - this.capacity);
    return count;
  }

  // First row at or after a time.
  at(time) {
    const { t } = this.columns;
    let [low, high] = [this.begin, this.end];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (t[middle] < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  has(name) {
    return name in this.columns;
  }
  // A column at a time; not-a-number while it is unknown.
  value(name, time) {
    return this.empty || !this.has(name) ? NaN : this.columns[name][Math.min(this.at(time), this.end - 1)];
  }
  last(name) {
    return this.empty || !this.has(name) ? NaN : this.columns[name][this.end - 1];
  }

  #compact(count) {
    const keep = Math.min(this.end - this.begin, this.capacity - count);
    for (const column of Object.values(this.columns)) column.copyWithin(0, this.end - keep, this.end);
    this.begin = 0;
    this.end = keep;
  }

  #write(name, values, first, last) {
    const column = (this.columns[name] ??= new Float64Array(2 * this.capacity).fill(NaN));
    for (let i = first, j = this.end; i < last; i += 1, j += 1) {
      const value = values[i];
      column[j] = value === null || value === undefined ? NaN : value;
    }
  }
}

// Rows of several rings between two times, on one ascending time line, as a chart takes them.
//
// `sources` are {ring, values: [(columns, row) => number]}. Fills and returns `into`: [t, ...one list per value], where a
// value is null if it is unknown, and undefined in a row of another ring.
export function merge(sources, from, to, into) {
  const live = sources.map(({ ring, values }) => {
    const begin = Math.max(ring.begin, ring.at(from) - 1);
    return { t: ring.columns.t, columns: ring.columns, values, row: begin, end: Math.min(ring.end, ring.at(to) + 1) };
  });
  const width = 1 + sources.reduce((sum, { values }) => sum + values.length, 0);
  while (into.length < width) into.push([]);
  let count = 0;
  for (;;) {
    let time = Infinity;
    for (const s of live) if (s.row < s.end && s.t[s.row] < time) time = s.t[s.row];
    if (time === Infinity) break;
    into[0][count] = time;
    let k = 1;
    for (const s of live) {
      const here = s.row < s.end && s.t[s.row] === time;
      for (const value of s.values) {
        if (here) {
          const v = value(s.columns, s.row);
          into[k][count] = v === v ? v : null;
        } else into[k][count] = undefined;
        k += 1;
      }
      if (here) s.row += 1;
    }
    count += 1;
  }
  for (const list of into) list.length = count;
  return into;
}
