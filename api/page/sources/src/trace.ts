// Samples of one quantity in the order they came, in a ring of fixed size: nothing grows while the page stays open.
export class Trace {
  readonly times: Float64Array;
  readonly values: Float64Array;
  private next = 0;
  private filled = 0;

  constructor(readonly capacity: number) {
    this.times = new Float64Array(capacity);
    this.values = new Float64Array(capacity);
  }

  get length(): number {
    return this.filled;
  }

  /** Time of the newest sample [s]; NaN where there is none. */
  get last_s(): number {
    return this.filled ? this.times[(this.next + this.capacity - 1) % this.capacity]! : NaN;
  }

  push(time_s: number, value: number): void {
    // A sample that is not later than the newest has been here before.
    if (time_s <= this.last_s) return;
    this.times[this.next] = time_s;
    this.values[this.next] = value;
    this.next = (this.next + 1) % this.capacity;
    this.filled = Math.min(this.filled + 1, this.capacity);
  }

  clear(): void {
    this.next = this.filled = 0;
  }

  /** Index in the ring of the ``place``-th oldest sample. */
  at(place: number): number {
    return (this.next + this.capacity - this.filled + place) % this.capacity;
  }

  /** How many samples are older than ``time_s``, by halving. */
  before(time_s: number): number {
    let low = 0;
    let high = this.filled;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.times[this.at(middle)]! < time_s) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** The newest sample not later than ``time_s``, nor older than ``most_s`` by then; NaN where there is none. */
  value(time_s: number, most_s = Infinity): number {
    const place = this.before(time_s + 1e-9);
    if (!place) return NaN;
    const index = this.at(place - 1);
    return time_s - this.times[index]! <= most_s ? this.values[index]! : NaN;
  }
}

/** The least and the greatest of each of ``columns`` parts of a span, on the two times in each that a plot needs.

Peaks stay, whatever the width; traces of different clocks come on one grid; a part without samples is a gap. */
export function columns(traces: Trace[], from_s: number, to_s: number, columns: number): [Float64Array, ...(number | null)[][]] {
  const times = new Float64Array(2 * columns);
  const width = (to_s - from_s) / columns;
  for (let i = 0; i < columns; i++) {
    times[2 * i] = from_s + (i + 0.25) * width;
    times[2 * i + 1] = from_s + (i + 0.75) * width;
  }
  return [times, ...traces.map((trace) => extremes(trace, from_s, width, columns))];
}

function extremes(trace: Trace, from_s: number, width: number, columns: number): (number | null)[] {
  const found: (number | null)[] = new Array(2 * columns).fill(null);
  const end = trace.length;
  let place = trace.before(from_s);
  // The last sample before each column is where its line comes from.
  for (; place < end; place++) {
    const index = trace.at(place);
    const column = Math.floor((trace.times[index]! - from_s) / width);
    if (column >= columns) break;
    const value = trace.values[index]!;
    if (Number.isNaN(value)) continue;
    const first = found[2 * column]!;
    const second = found[2 * column + 1]!;
    if (first === null) found[2 * column] = found[2 * column + 1] = value;
    else if (value < Math.min(first, second)) found[first < second ? 2 * column : 2 * column + 1] = value;
    else if (value > Math.max(first, second)) found[first < second ? 2 * column + 1 : 2 * column] = value;
  }
  return found;
}
