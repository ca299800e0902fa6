// The choice of a scene, where the monitor may start sessions, and the state of the session that it started.

import { show } from "./format.js";

const by = (id) => document.getElementById(id);
const PATIENCE_MS = 10000;
const STATES = {
  idle: () => "no session runs: choose a scene and start it",
  starting: (title) => `starting: ${title}`,
  running: (title) => `running: ${title}`,
  failed: (title, why) => `not started: ${why ?? "unknown reason"}`,
};

export class Scenes {
  // `send(message)` returns whether the message was sent.
  constructor(send) {
    Object.assign(this, { send, rooms: null, keeper: null, chosen: null });
    by("scene-start").addEventListener("click", () => this.#start());
    by("scene-choice").addEventListener("change", (event) => {
      this.chosen = event.target.value;
      this.#show();
    });
  }

  // Takes one message of the server.
  take(message) {
    if (message.type === "hello") this.rooms = message.rooms ?? null;
    if (message.type === "keeper") this.#said(message);
    if (message.type === "answer" && message.to === "session" && !message.accepted)
      this.#said({ state: "failed", scene: this.rooms?.scene, why: message.why });
    if (["hello", "keeper", "answer"].includes(message.type)) this.#show();
  }

  #said({ state, scene, why }) {
    clearTimeout(this.timer);
    this.keeper = { state, scene: scene ?? null, why: why ?? null };
  }

  #start() {
    const scene = by("scene-choice").value;
    this.chosen = null;
    const went = this.send({ type: "session", do: "start", scene });
    this.#said(went ? { state: "starting", scene } : { state: "failed", scene, why: "the monitor does not answer" });
    if (went)
      this.timer = setTimeout(() => {
        this.#said({ state: "failed", scene, why: "no answer" });
        this.#show();
      }, PATIENCE_MS);
    this.#show();
  }

  #show() {
    const { rooms, keeper } = this;
    by("scenes").hidden = !rooms?.start;
    if (!rooms?.start) return;
    const scenes = rooms.scenes ?? [];
    const select = by("scene-choice");
    const wanted = JSON.stringify(scenes);
    if (select.dataset.names !== wanted) {
      select.replaceChildren(...scenes.map(({ name, title }) => new Option(title ?? name, name)));
      select.dataset.names = wanted;
    }
    const current = keeper?.scene ?? rooms.scene;
    if (this.chosen ?? current) select.value = this.chosen ?? current;
    const state = keeper?.state ?? (rooms.scene ? "running" : "idle");
    const title = scenes.find(({ name }) => name === current)?.title ?? current ?? "";
    show(by("keeper"), STATES[state]?.(title, keeper?.why) ?? state, state);
    select.disabled = by("scene-start").disabled = state === "starting";
    by("scene-start").textContent = state === "running" && select.value === current ? "Restart" : "Start";
  }
}
