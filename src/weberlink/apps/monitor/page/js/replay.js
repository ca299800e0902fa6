// Replay of a recording: play and pause, the time, and the speed.

import { show } from "./format.js";
import { notice } from "./notice.js";

const LEAST_BETWEEN_SEEKS_MS = 100;

const by = (id) => document.getElementById(id);

export class Replay {
  // `ask(message)` returns whether the message was sent.
  constructor(store, ask) {
    Object.assign(this, { store, ask, playing: false, asked: 0, held: false });
    const slider = by("replay-at");
    by("replay-play").addEventListener("click", () => this.#ask({ do: this.playing ? "pause" : "play" }));
    by("replay-speed").addEventListener("change", () => this.#ask({ do: this.playing ? "play" : "pause" }));
    slider.addEventListener("input", () => this.#seek());
    slider.addEventListener("change", () => this.#seek(true));
    for (const kind of ["pointerdown", "pointerup", "pointercancel"])
      slider.addEventListener(kind, () => {
        this.held = kind === "pointerdown";
      });
  }

  // A message of type `replay`.
  take({ playing, at, speed }) {
    this.playing = Boolean(playing);
    const button = by("replay-play");
    button.textContent = this.playing ? "Pause" : "Play";
    button.setAttribute("aria-pressed", String(this.playing));
    const choice = by("replay-speed");
    if (Number.isFinite(speed) && document.activeElement !== choice) {
      if (![...choice.options].some(({ value }) => Number(value) === speed)) choice.add(new Option(`${speed} ×`, speed));
      choice.value = [...choice.options].find(({ value }) => Number(value) === speed).value;
    }
    if (Number.isFinite(at) && !this.held) this.#at(at);
  }

  answer({ accepted, why }) {
    if (!accepted) notice(`replay: ${why ?? "refused"}`, "bad");
  }

  // After a greeting, or when the connection came or went.
  refresh() {
    const { hello, may } = this.store;
    by("replay").hidden = !hello?.replay;
    if (!hello?.replay) return;
    by("replay-at").max = hello.replay.duration_s;
    for (const id of ["replay-play", "replay-at", "replay-speed"]) by(id).disabled = !may;
    this.#label(Number(by("replay-at").value));
  }

  #seek(last = false) {
    const at = Number(by("replay-at").value);
    this.#label(at);
    clearTimeout(this.timer);
    const wait = this.asked + LEAST_BETWEEN_SEEKS_MS - performance.now();
    if (!last && wait > 0) this.timer = setTimeout(() => this.#seek(), wait);
    else this.#ask({ do: "seek", at });
  }

  #ask(message) {
    this.asked = performance.now();
    if (!this.ask({ type: "replay", ...message, speed: Number(by("replay-speed").value) }))
      notice("replay: the monitor does not answer", "bad");
  }

  #at(at) {
    by("replay-at").value = at;
    this.#label(at);
  }

  #label(at) {
    const end = this.store.hello?.replay?.duration_s;
    show(by("replay-time"), `${at.toFixed(1)} of ${Number.isFinite(end) ? end.toFixed(1) : "–"} s`, at);
  }
}
