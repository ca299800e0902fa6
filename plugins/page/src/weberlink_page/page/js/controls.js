// Settings that can be changed while the session runs: sends the request and shows the answer.

import { by, fill, show } from "./dom.js";

const AGREED = ["weber", "predictor"]; // by both ends
const LINK = ["delay_ms", "loss"]; // of the emulated network
const NAMES = [...AGREED, ...LINK];
const percent = (value) => `${Math.round(1000 * value) / 10} %`;
const SLIDERS = { weber: percent, delay_ms: (value) => `${value} ms`, loss: percent };
const PATIENCE_MS = 4000;
const SETTLED_MS = 120; // a key held on a slider changes it many times

export class Controls {
  // `send(message)` returns whether the message was sent.
  /** @param {import("./link.js").Link["send"]} send */
  constructor(store, send) {
    this.store = store;
    this.send = send;
    this.waiting = {};
    for (const name of NAMES) by(name).addEventListener("change", () => this.#settle(name));
    for (const name in SLIDERS) by(name).addEventListener("input", () => this.#label(name, Number(by(name).value)));
  }

  // After a greeting, a change, an end, or when the connection came or went.
  refresh(connected, reset = false) {
    const { hello, wanted, ended } = this.store;
    const settings = { ...wanted, ...hello?.link };
    by("link").hidden = !hello?.link;
    fill(by("predictor"), (hello?.predictors ?? []).map((name) => [name, name]));
    if (settings.predictor && (reset || document.activeElement !== by("predictor"))) by("predictor").value = settings.predictor;
    for (const name in SLIDERS) {
      if (typeof settings[name] !== "number" || name in this.waiting) continue;
      if (reset || document.activeElement !== by(name)) by(name).value = settings[name];
      this.#label(name, settings[name]);
    }
    const shown = hello?.link ? NAMES : AGREED;
    const reasons = shown.map((name) => this.#reason(name, connected, hello, ended));
    for (const [k, name] of shown.entries()) {
      by(name).disabled = Boolean(reasons[k]);
      by(name).dataset.value = settings[name] ?? "";
      by(`control-${name}`).classList.toggle("off", Boolean(reasons[k]));
      by(`control-${name}`).title = reasons[k];
    }
    if (reasons[0] && new Set(reasons).size === 1) this.#say(reasons[0], "");
    else if (by("answer").dataset.value === "") this.#say("", "");
  }

  /** @param {import("./messages.js").AnswerMessage} message */
  answer(message) {
    clearTimeout(this.timer);
    const { hello } = this.store;
    if (message.link && hello) hello.link = { ...hello.link, ...message.link };
    if (!message.accepted) this.#say(`not changed: ${message.why ?? "refused"}`, "refused");
    else if (message.tick === undefined) this.#say("in force, both ends", "accepted");
    else this.#say(`from tick ${message.tick} on, both ends`, "accepted", String(message.tick));
    this.refresh(true, true);
  }

  // Why a setting cannot be changed now; empty if it can.
  #reason(name, connected, hello, ended) {
    if (!connected) return "the monitor does not answer";
    if (!hello?.session) return "no session";
    if (ended) return "the session has ended";
    const link = LINK.includes(name);
    const permitted = (hello.sides?.master ?? hello.sides?.slave)?.changes ?? hello.changes ?? [];
    if (hello.readonly && (link || permitted.length)) return "read-only: open the address with the key, which weberlink printed";
    if (link || (hello.changes ?? []).includes(name)) return "";
    if (permitted.length) return "this session does not permit changing it";
    return "the configuration does not permit it (control.live_changes)";
  }

  // Asks once the control has not changed for a while.
  #settle(name) {
    clearTimeout(this.waiting[name]);
    const value = name in SLIDERS ? Number(by(name).value) : by(name).value;
    this.waiting[name] = setTimeout(() => this.#ask(name, value), SETTLED_MS);
  }

  #ask(name, value) {
    delete this.waiting[name];
    if (!this.send({ type: "change", [name]: value })) return this.#say("not changed: the monitor does not answer", "refused");
    this.#say("asking both ends …", "asked");
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.answer({ type: "answer", accepted: false, why: "no answer" }), PATIENCE_MS);
  }

  #label(name, value) {
    show(by(`${name}-value`), SLIDERS[name](value), value);
  }

  #say(text, kind, tick = "") {
    show(by("answer"), text || "\u00a0", kind);
    by("answer").dataset.tick = tick;
  }
}
