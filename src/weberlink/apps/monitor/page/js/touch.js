// The visitor as the master: joins what moves the handle to the session, and what the session feels to the visitor.

import { Drive } from "./drive.js";
import { show } from "./format.js";
import { Gamepads } from "./gamepad.js";
import { Latency } from "./latency.js";
import { Pointing } from "./pointing.js";
import { Sound } from "./sound.js";

const M = 1e-3; // millimetres in metres
const CONTACT_N = 0.1; // force at which a contact begins
const FREE_N = 0.03; // and ends
const PING_MS = 2000;
const SMOOTH_MS = 12; // a frame of less leaves time enough
const QUIET_MS = 400; // without rows there is no tone
const ARIA = {
  true: "3-D view of the scene; arrow keys, Page Up and Page Down move the handle, Escape lets go, Shift and arrow keys orbit",
  false: "3-D view of the scene; arrow keys orbit",
};

const by = (id) => document.getElementById(id);

export class Touch {
  // `send(message, repeat)` returns whether the message was sent, see `Link`.
  constructor(store, send) {
    Object.assign(this, { store, send, view: null, connected: false, touches: false, state: "none", why: null });
    this.drive = new Drive(send, () => this.#held(), (...what) => this.latency.sent(...what, this.#handle()));
    this.latency = new Latency();
    this.sound = new Sound();
    by("sound").addEventListener("change", (event) => this.sound.choose(event.target.value));
    by("anywhere").addEventListener("click", () => this.#dragAnywhere(!this.pointing?.anywhere));
    setInterval(() => this.#ping(), PING_MS);
    this.#say();
  }

  // Takes the 3-D view, without which nobody can drive.
  attach(view) {
    this.view = view;
    this.pointing = new Pointing(by("scene"), view, this.drive);
    this.gamepads = new Gamepads(view, this.drive, () => this.#say());
    this.#dragAnywhere(matchMedia("(pointer: coarse)").matches);
    this.#say();
  }

  connection(connected) {
    this.connected = connected;
    if (!connected) [this.state, this.why] = ["none", null];
    this.#say();
  }

  // Takes one message of the server, after the store.
  take(message) {
    const now = performance.now();
    this.drive.beat();
    if (message.type === "hello") this.#greet(message);
    if (message.type === "handle") {
      [this.state, this.why] = [message.state, message.why ?? null];
      this.#say();
    }
    if (message.type === "figures" && message.ended) this.#say();
    if (message.type === "samples" && message.t.length) this.#feel(message, now);
    if (message.type === "pong") {
      this.latency.pong(message, now);
      this.#tellLatency();
    }
  }

  #greet(hello) {
    this.drive.half = hello.workspace_m ?? Infinity;
    if (hello.session !== this.session) this.drive.release();
    this.session = hello.session;
    by("drive").hidden = !hello.drivable;
    document.body.dataset.drivable = String(Boolean(hello.drivable));
    this.#ping();
    this.#say();
  }

  #handle() {
    return this.view?.handle?.map((value) => M * value) ?? null;
  }

  // What the newest rows let the visitor feel.
  #feel({ side, t, columns }, now) {
    if (side === "slave") {
      this.packets = (this.packets ?? 0) + (columns.sent ?? []).reduce((sum, sent) => sum + (sent > 0), 0);
      return;
    }
    this.latency.moved(this.#handle(), now);
    this.#tellLatency();
    if (!columns.output) return;
    const [x, y, z] = columns.output;
    const force = (row) => Math.hypot(x[row], y[row], z[row]) || 0;
    let contact = false;
    for (let row = 0; row < t.length; row += 1) {
      contact ||= !this.touches && force(row) > CONTACT_N;
      this.touches = force(row) > (this.touches ? FREE_N : CONTACT_N);
    }
    const newest = force(t.length - 1);
    this.sound.feel(newest, contact, this.packets ?? 0);
    this.gamepads?.feel(newest, contact);
    if (contact && this.drive.held && this.pointing.touched) navigator.vibrate?.(15);
    this.packets = 0;
    clearTimeout(this.quiet);
    this.quiet = setTimeout(() => this.sound.still(), QUIET_MS);
  }

  // A hold began or ended.
  #held() {
    const { held } = this.drive;
    this.view.live = held;
    if (held) requestAnimationFrame(() => this.#draw());
    else {
      this.pointing.forget();
      this.gamepads.still();
      this.view.aim = null;
      this.view.redraw();
    }
    this.#say();
  }

  // Draws the newest row and the target while the visitor drives, independently of the charts: up to 60 times a second, but
  // idle for as long as a frame took, because a software renderer takes processor time from messages and daemons.
  #draw() {
    if (!this.drive.held) return;
    const begin = performance.now();
    this.view.aim = this.drive.target.map((value) => value / M);
    this.drive.beat();
    this.view.render(this.store.newest, begin);
    this.drive.beat();
    setTimeout(() => {
      const cost = performance.now() - begin; // with what the browser did to show it
      setTimeout(() => requestAnimationFrame(() => this.#draw()), cost < SMOOTH_MS ? 0 : cost);
    });
  }

  #dragAnywhere(anywhere) {
    if (this.pointing) this.pointing.anywhere = anywhere;
    by("anywhere").setAttribute("aria-pressed", String(anywhere));
  }

  #ping() {
    if (this.connected && this.store.hello?.drivable) this.send({ type: "ping", at: performance.now() });
  }

  // Why the handle cannot be held; null if it can.
  #refusal() {
    const { hello, ended } = this.store;
    if (!this.connected) return "the monitor does not answer";
    if (!this.view) return "driving needs the 3-D view, which needs WebGL";
    if (!hello?.drivable) return this.why ?? "this session has no handle for the pointer";
    if (ended) return "the session has ended";
    if (this.state === "taken") return this.why ?? "somebody else drives";
    if (this.state === "none") return this.why ?? "waiting for the handle";
    return null;
  }

  #say() {
    const { drive } = this;
    const refusal = this.#refusal();
    if (refusal !== drive.refusal) drive.refuse(refusal);
    const pad = this.gamepads?.present ? ", or hold A on the gamepad" : "";
    const text =
      refusal ?? (drive.held ? "yours: release or Escape lets go" : `free: drag the blue ball${pad || ", or use the keys"}`);
    const state = drive.held ? "held" : refusal === null ? this.state : this.state === "taken" ? "taken" : "none";
    show(by("handle-state"), text, state);
    by("handle-state").hidden = !(this.store.hello?.drivable || this.why);
    by("scene").classList.toggle("held", drive.held);
    by("scene").setAttribute("aria-label", ARIA[refusal === null]);
    if (refusal !== null) by("scene").classList.remove("near");
  }

  #tellLatency() {
    const { times, rtt, offset } = this.latency;
    const [p50, p99] = [0.5, 0.99].map((share) => this.latency.percentile(share));
    const text = times.length ? `handle follows in ${p50.toFixed(0)} ms, p99 ${p99.toFixed(0)} ms` : "";
    show(by("latency"), text, times.length ? p50 : null);
    Object.assign(document.body.dataset, {
      latencies: times.map((each) => each.toFixed(1)).join(" "),
      serverRtt: Number.isFinite(rtt) ? rtt.toFixed(2) : "",
      clockOffset: Number.isFinite(offset) ? offset.toFixed(2) : "",
    });
  }
}
