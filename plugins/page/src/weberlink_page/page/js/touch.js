// The visitor as the master: joins what moves the handle to the session, and shows what the session does with it.

import { by, show } from "./dom.js";
import { Drive } from "./drive.js";
import { Latency } from "./latency.js";
import { Pointing } from "./pointing.js";

const M = 1e-3; // millimetres in metres
const SMOOTH_MS = 12; // a frame of less leaves time enough
const ORBIT = "3-D view of the scene; Shift and arrow keys orbit";
const DRIVE = "3-D view of the scene; arrow keys, Page Up and Page Down move the handle, Escape lets go, Shift and arrow keys orbit";

export class Touch {
  // `send(message, repeat)` returns whether the message was sent, see `Link`.
  /** @param {import("./link.js").Link["send"]} send */
  constructor(store, send) {
    this.store = store;
    this.send = send;
    this.view = this.pointing = this.why = null;
    this.connected = false;
    this.state = "none";
    this.latency = new Latency();
    this.drive = new Drive(send, () => this.#held(), (target, held, at) => this.latency.sent(target, held, at, this.#handle()));
    by("anywhere").addEventListener("click", () => this.#dragAnywhere(!this.pointing?.anywhere));
    this.#say();
  }

  // Takes the 3-D view, without which nobody can drive.
  attach(view) {
    this.view = view;
    this.pointing = new Pointing(by("scene"), view, this.drive);
    this.#dragAnywhere(matchMedia("(pointer: coarse)").matches);
    this.#say();
  }

  connection(connected) {
    this.connected = connected;
    if (!connected) [this.state, this.why] = ["none", null];
    this.#say();
  }

  // Takes one message of the server, after the store.
  /** @param {import("./messages.js").Message} message */
  take(message) {
    this.drive.beat();
    if (message.type === "hello") {
      this.drive.half = message.workspace_m ?? Infinity;
      if (message.session !== this.session) this.drive.release();
      this.session = message.session;
      by("drive").hidden = !message.drivable;
      document.body.dataset.drivable = String(Boolean(message.drivable));
    }
    if (message.type === "handle") [this.state, this.why] = [message.state, message.why];
    if (message.type === "samples" && message.side === "master" && message.t.length) {
      this.latency.moved(this.#handle(), performance.now());
      this.#tellLatency();
    } else if (message.type !== "samples" && message.type !== "felt") this.#say();
  }

  #handle() {
    return this.view?.handle?.map((value) => M * value) ?? null;
  }

  // A hold began or ended.
  #held() {
    const { held } = this.drive;
    this.view.live = held;
    if (held) requestAnimationFrame(() => this.#draw());
    else {
      this.pointing.forget();
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
    const text = refusal ?? (drive.held ? "yours: release or Escape lets go" : "free: drag the blue ball, or use the keys");
    const state = drive.held ? "held" : refusal === null ? this.state : this.state === "taken" ? "taken" : "none";
    show(by("handle-state"), text, state);
    by("handle-state").hidden = !(this.store.hello?.drivable || this.why);
    by("scene").classList.toggle("held", drive.held);
    by("scene").setAttribute("aria-label", refusal === null ? DRIVE : ORBIT);
    if (refusal !== null) by("scene").classList.remove("near");
  }

  #tellLatency() {
    const { times } = this.latency;
    const [p50, p99] = [0.5, 0.99].map((share) => this.latency.percentile(share));
    show(by("latency"), times.length ? `handle follows in ${p50.toFixed(0)} ms, p99 ${p99.toFixed(0)} ms` : "", times.length ? p50 : null);
    document.body.dataset.latencies = times.map((each) => each.toFixed(1)).join(" ");
  }
}
