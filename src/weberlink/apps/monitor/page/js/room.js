// Starting and stopping a session from the page.

import { notice } from "./notice.js";
import { fill } from "./sessions.js";

const by = (id) => document.getElementById(id);

export class Room {
  // `ask(message)` returns whether the message was sent.
  constructor(store, ask) {
    Object.assign(this, { store, ask, keeper: { state: "idle" }, asked: "" });
    by("start").addEventListener("click", () => this.#ask("start", { scene: by("room-scene").value }));
    by("stop").addEventListener("click", () => this.#ask("stop"));
  }

  // A message of type `keeper`: the session that was started by the page.
  take(message) {
    this.keeper = message;
    if (message.state === "starting") notice(`starting ${this.#title(message.scene)} …`);
    if (message.state === "running") notice(`${this.#title(message.scene)} is running`, "good");
    if (message.state === "failed") notice(`not started: ${message.why ?? "unknown reason"}`, "bad");
    if (message.state !== "starting") this.asked = "";
    this.refresh();
  }

  answer({ accepted, why }) {
    if (!accepted) notice(`not ${this.asked === "stop" ? "stopped" : "started"}: ${why ?? "refused"}`, "bad");
    else if (this.asked === "stop") notice("stopping the session …");
  }

  // After a greeting, an end, or when the connection came or went.
  refresh() {
    const { hello, may, running } = this.store;
    const rooms = hello?.rooms;
    by("room").hidden = !hello;
    by("start").hidden = by("room-scene").hidden = !rooms?.start;
    by("start").textContent = running ? "Restart" : "Start";
    by("start").disabled = !may || this.keeper.state === "starting";
    by("stop").disabled = !may || !running;
    fill(by("room-scene"), (rooms?.scenes ?? []).map(({ name, title }) => [name, title ?? name]));
    if (rooms?.scene && rooms.scene !== this.scene) by("room-scene").value = this.scene = rooms.scene;
  }

  #ask(action, more = {}) {
    this.asked = action;
    if (!this.ask({ type: "session", do: action, ...more })) notice(`not ${action}ed: the monitor does not answer`, "bad");
  }

  #title(scene) {
    return this.store.hello?.rooms?.scenes?.find(({ name }) => name === scene)?.title ?? scene ?? "the session";
  }
}
