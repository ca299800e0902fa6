// How long after a message of the pointer the page shows that the handle moves.
//
// A measurement begins with the first message that moves a target that was still for 150 ms by 1 mm or more. It ends with
// the first row in which the handle has moved by 0.2 mm or more in that direction. It is dropped after 1 s, or when the hold
// ends: at a wall the handle does not follow.

const STILL_MS = 150;
const STEP_M = 0.001;
const MOVED_M = 0.0002;
const LONGEST_MS = 1000;
const KEPT = 500;

export class Latency {
  constructor() {
    this.times = []; // [ms]
    this.forget();
  }

  forget() {
    this.still = null; // {target, at}: the target that did not move, and since when [ms]
    this.running = null; // {begin, from, direction}
  }

  // A message of the pointer went at a time [ms]; `handle` is the newest position. All positions [m].
  sent(target, held, at, handle) {
    if (!held || !handle) {
      this.forget();
      return;
    }
    if (this.still === null) this.still = { target, at };
    const step = target.map((value, k) => value - this.still.target[k]);
    const size = Math.hypot(...step);
    if (size < STEP_M) return;
    if (at - this.still.at >= STILL_MS && !this.running) {
      this.running = { begin: at, from: handle, direction: step.map((value) => value / size) };
    }
    this.still = { target, at };
  }

  // The handle's newest position [m] came at a time [ms].
  moved(handle, at) {
    const { running } = this;
    if (!running || !handle) return;
    const way = running.direction.reduce((sum, value, k) => sum + value * (handle[k] - running.from[k]), 0);
    if (way >= MOVED_M) this.times = [...this.times, at - running.begin].slice(-KEPT);
    if (way >= MOVED_M || at - running.begin > LONGEST_MS) this.running = null;
  }

  // Percentile of the measured times [ms]; NaN before the first.
  percentile(share) {
    if (!this.times.length) return NaN;
    const sorted = [...this.times].sort((a, b) => a - b);
    return sorted[Math.min(sorted.length - 1, Math.ceil(share * sorted.length) - 1)];
  }
}
