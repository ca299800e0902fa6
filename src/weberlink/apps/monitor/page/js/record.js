// Recording of the session: start, stop, markers, and how it stands.

import { show } from "./format.js";
import { notice } from "./notice.js";

const by = (id) => document.getElementById(id);

export class Recording {
  // `ask(message)` returns whether the message was sent.
  constructor(store, ask) {
    Object.assign(this, { store, ask });
    this.clear();
    by("record-switch").addEventListener("click", () => this.#switch());
    by("mark").addEventListener("click", () => this.#mark());
    addEventListener("keydown", (event) => {
      if (event.key.toLowerCase() !== "m" || event.repeat || event.ctrlKey || event.altKey || event.metaKey) return;
      if (!event.target.closest?.("input:not([type=range]), select, textarea")) this.#mark();
    });
  }

  clear() {
    this.take({ state: "off" });
  }

  get on() {
    return this.last.state === "on";
  }

  // A message of type `recording`.
  take(message) {
    const before = this.last?.state;
    this.last = message;
    const { state, path, why } = message;
    show(by("recording"), this.on ? progress(message) : "", state);
    if (state === before) return this.refresh();
    if (state === "done") notice(`recorded: ${path} (${progress(message)})`, "good");
    if (state === "failed") notice(`recording failed: ${why ?? "unknown reason"}${path ? ` (${path})` : ""}`, "bad");
    this.refresh();
  }

  answer({ accepted, why }) {
    if (!accepted) notice(`recording: ${why ?? "refused"}`, "bad");
  }

  // After a greeting, an end, or when the connection came or went.
  refresh() {
    const { on } = this;
    const { hello, may, running } = this.store;
    const possible = may && running;
    by("record").hidden = !hello?.records && this.last.state === "off";
    by("record-why").textContent = (running && hello.records_why) || "";
    by("record-why").hidden = !by("record-why").textContent;
    const button = by("record-switch");
    button.textContent = on ? "Stop recording" : "Record";
    button.setAttribute("aria-pressed", String(on));
    button.disabled = !possible;
    by("mark").disabled = !(possible && on);
    const text = by("record-text");
    text.disabled = !possible;
    text.placeholder = on ? "text of the mark" : "name";
    text.setAttribute("aria-label", on ? "Text of the next mark" : "Name of the recording");
  }

  #switch() {
    if (this.on) this.#ask({ do: "stop" });
    else this.#ask({ do: "start", name: this.#text() || null }); // without a name: one of the session and the time
  }

  #mark() {
    if (!this.store.hello?.records) return;
    if (!this.on) notice("no mark: nothing is being recorded", "warn");
    else if (this.#ask({ do: "mark", text: this.#text() })) notice(`marked at ${this.store.newest.toFixed(1)} s`, "good");
  }

  #ask(message) {
    const sent = this.ask({ type: "record", ...message });
    if (!sent) notice("recording: the monitor does not answer", "bad");
    return sent;
  }

  #text() {
    const text = by("record-text").value.trim();
    by("record-text").value = "";
    return text;
  }
}

function progress({ seconds, bytes, marks }) {
  const parts = [];
  if (Number.isFinite(seconds)) parts.push(`${seconds.toFixed(1)} s`);
  if (Number.isFinite(bytes)) parts.push(bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`);
  if (marks) parts.push(`${marks} mark${marks === 1 ? "" : "s"}`);
  return parts.join(", ");
}
