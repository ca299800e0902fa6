// The hold on the handle: one target, whoever moves it, and the messages that carry it to the session.

const LEAST_MS = 8; // between two messages: 125 Hz
const REPEAT_MS = 25; // the server releases a handle of which it hears nothing for 100 ms
const LEASH_M = 0.03; // largest distance of a target under rate control from the handle, so that it does not run away at a wall

export class Drive {
  // `send(message, repeat)` returns whether the message was sent, see `Link`; `changed()` is called when a hold begins or ends;
  // `sent(target, held, at)` after each message.
  /** @param {import("./link.js").Link["send"]} send */
  constructor(send, changed, sent) {
    this.send = send;
    this.changed = changed;
    this.sent = sent;
    this.sources = new Set(); // of those that hold: pointer, keys
    this.target = null; // [m]; beyond the workspace while the pointer is
    this.half = Infinity; // half an edge of the workspace [m]
    this.refusal = "no session"; // why the handle cannot be held; null if it can
    this.sentAt = -Infinity;
    for (const leaving of ["blur", "pagehide"]) addEventListener(leaving, () => this.release());
    document.addEventListener("visibilitychange", () => document.hidden && this.release());
    addEventListener("keydown", (event) => this.#escape(event), true);
  }

  get held() {
    return this.sources.size > 0;
  }

  // Begins a hold at the handle's position [m]; false if it is refused.
  grab(source, handle) {
    if (this.refusal !== null || !handle) return false;
    if (!this.held) this.target = [...handle];
    this.sources.add(source);
    this.#post();
    this.changed();
    return true;
  }

  // Moves the target by a vector [m], for a pointer.
  move(by) {
    if (!this.held) return;
    this.target = this.target.map((value, k) => value + by[k]);
    this.#post();
  }

  // Moves the target by a vector [m] under rate control: within the workspace and near the handle [m].
  steer(by, handle) {
    if (!this.held || !handle) return;
    const lag = (point) => point.map((value, k) => value - handle[k]);
    const longest = Math.max(LEASH_M, Math.hypot(...lag(this.target)));
    const wanted = lag(this.#inside(this.target.map((value, k) => value + by[k])));
    const factor = Math.min(1, longest / Math.max(1e-9, Math.hypot(...wanted)));
    this.target = wanted.map((value, k) => handle[k] + factor * value);
    this.#post();
  }

  // Repeats the message if it is time. Drawings call it, for a slow one keeps the timer waiting.
  beat() {
    if (this.held && performance.now() - this.sentAt >= REPEAT_MS) this.#post();
  }

  // Ends the hold of a source, or of all.
  release(source = null) {
    if (!this.held || (source !== null && !this.sources.delete(source))) return;
    if (source === null) this.sources.clear();
    if (this.held) return;
    this.#put(false);
    clearTimeout(this.timer);
    this.changed();
  }

  // Nobody may hold for this reason; null to permit it.
  refuse(why) {
    this.refusal = why;
    if (why !== null) this.release();
  }

  // Escape lets go, and means nothing else then.
  #escape(event) {
    if (event.key !== "Escape" || !this.held) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    this.release();
  }

  #inside(target) {
    return target.map((value) => Math.max(-this.half, Math.min(this.half, value)));
  }

  // Sends the target now, or as soon as the rate permits it; then again while it is held.
  #post() {
    clearTimeout(this.timer);
    const wait = this.sentAt + LEAST_MS - performance.now();
    if (wait > 0) {
      this.timer = setTimeout(() => this.#post(), wait);
      return;
    }
    if (!this.#put(true)) {
      this.sources.clear();
      this.changed();
      return;
    }
    this.timer = setTimeout(() => this.#post(), REPEAT_MS);
  }

  #put(held) {
    const target = this.#inside(this.target).map((value) => Math.round(1e6 * value) / 1e6);
    const went = this.send({ type: "drive", target, held }, held);
    this.sentAt = performance.now();
    if (went) this.sent(target, held, this.sentAt);
    return went;
  }
}
