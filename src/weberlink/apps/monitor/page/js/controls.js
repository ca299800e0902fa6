// Settings that can be changed while the session runs: sends the request and shows the answer.

import { show } from "./format.js";

const by = (id) => document.getElementById(id);
const NAMES = ["weber", "predictor", "scheme"];
const PATIENCE_MS = 4000;

export class Controls {
  // `send(message)` returns whether the message was sent.
  constructor(store, send) {
    this.store = store;
    this.send = send;
    for (const name of NAMES) by(name).addEventListener("change", () => this.#ask(name));
    by("weber").addEventListener("input", () => this.#label(Number(by("weber").value)));
  }

  // After a greeting, a change, an end, or when the connection came or went.
  refresh(connected, reset = false) {
    const { hello, wanted: settings, ended } = this.store;
    fill(by("predictor"), hello?.predictors ?? [], settings.predictor, reset);
    fill(by("scheme"), hello?.schemes ?? [], settings.scheme, reset);
    if (typeof settings.weber === "number" && (reset || document.activeElement !== by("weber")))
      by("weber").value = settings.weber;
    if (typeof settings.weber === "number") this.#label(settings.weber);
    const reasons = NAMES.map((name) => this.#reason(name, connected, hello, ended));
    NAMES.forEach((name, k) => {
      const reason = reasons[k];
      const place = by(`control-${name}`);
      by(name).disabled = Boolean(reason);
      by(name).dataset.value = settings[name] ?? "";
      place.classList.toggle("off", Boolean(reason));
      place.title = reason;
    });
    const [first] = reasons;
    if (first && reasons.every((reason) => reason === first)) this.#say(first, "");
    else if (by("answer").dataset.value === "") this.#say("", "");
  }

  answer(message) {
    clearTimeout(this.timer);
    if (message.accepted) this.#say(`from tick ${message.tick} on, both ends`, "accepted", message.tick);
    else this.#say(`not changed: ${message.why ?? "refused"}`, "refused");
    this.refresh(true, true);
  }

  // Why a setting cannot be changed now; empty if it can.
  #reason(name, connected, hello, ended) {
    if (!connected) return "the monitor does not answer";
    if (!hello?.session) return "no session";
    if (ended) return "the session has ended";
    if (hello.remote) return "read-only: watched from another host";
    const permitted = (hello.sides?.master ?? hello.sides?.slave)?.changes ?? hello.changes ?? [];
    if (hello.readonly && permitted.length)
      return "read-only: only the user who runs the session can change settings";
    if ((hello.changes ?? []).includes(name)) return "";
    if (permitted.length) return "this session does not permit changing it";
    return "the configuration does not permit it (control.live_changes)";
  }

  #ask(name) {
    const value = name === "weber" ? Number(by("weber").value) : by(name).value;
    if (!this.send({ type: "change", [name]: value })) {
      this.#say("not changed: the monitor does not answer", "refused");
      return;
    }
    this.#say("asking both ends …", "asked");
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.answer({ accepted: false, why: "no answer" }), PATIENCE_MS);
  }

  #label(k) {
    show(by("weber-value"), `${Math.round(1000 * k) / 10} %`, k);
  }

  #say(text, kind, tick) {
    const place = by("answer");
    place.textContent = text || "\u00a0";
    place.dataset.value = kind;
    place.dataset.tick = tick ?? "";
  }
}

function fill(select, names, chosen, reset) {
  const wanted = names.join("\n");
  if (select.dataset.names !== wanted) {
    select.replaceChildren(...names.map((name) => new Option(name, name)));
    select.dataset.names = wanted;
  }
  if (chosen && (reset || document.activeElement !== select)) select.value = chosen;
}
