// The bar at the top: which session is shown, starting and stopping one, and recording it.

import { by, fill, notice, show } from "./dom.js";

const LOOK_EVERY_MS = 4000;
const HELP_AFTER_MS = 800; // a greeting that is on its way comes first

const last = (path) => path?.split("/").pop();

// The sessions by name, what takes part in the shown one, and how to start one when there is none.
export class Sessions {
  // `follow(name)` shows another session.
  constructor(store, follow) {
    this.store = store;
    this.connected = false;
    by("session").addEventListener("change", ({ target }) => {
      target.blur();
      follow(target.value);
    });
    setInterval(() => this.#list(), LOOK_EVERY_MS);
  }

  // After a greeting, or when the connection came or went.
  refresh(connected) {
    this.connected = connected;
    const { hello, file } = this.store;
    const { master, slave } = this.store.description?.system ?? {};
    const names = { device: master?.device?.driver, robot: slave?.robot?.driver, ...hello?.names, file };
    for (const kind of ["file", "device", "robot", "peer"]) {
      const name = names[kind] ?? "";
      show(by(`name-${kind}`), kind === "file" ? last(name) : name, name);
      by(`name-${kind}`).title = name;
      by(`name-${kind}`).parentElement.hidden = !name;
    }
    document.title = ["WeberLink monitor", last(file)].filter(Boolean).join(" · ");
    this.#list();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.#help(), hello?.session ? 0 : HELP_AFTER_MS);
  }

  async #list() {
    if (!this.connected) return;
    let sessions = [];
    try {
      ({ sessions } = await (await fetch("api/sessions")).json());
    } catch {
      return; // the tile of the state shows the lost connection
    }
    const { store } = this;
    const current = store.hello?.session ?? "";
    if (current && !sessions.some(({ session }) => session === current))
      sessions.push({ session: current, file: store.file, live: !store.ended });
    const text = ({ session, file, live }) => [session, last(file), live ? "running" : "ended"].filter(Boolean).join(" · ");
    fill(by("session"), sessions.length ? sessions.map((each) => [each.session, text(each)]) : [["none", "none"]]);
    by("session").disabled = sessions.length < 2;
    if (current && document.activeElement !== by("session")) by("session").value = current;
    by("session").title = by("session").selectedOptions[0]?.text ?? "";
  }

  #help() {
    const { hello } = this.store;
    const none = this.connected && !hello?.session;
    by("start-help").hidden = !none;
    by("start-here").hidden = !hello?.rooms.start;
    document.body.dataset.session = none ? "none" : "some";
  }
}

// Starting and stopping a session from the page.
export class Room {
  // `send(message)` returns whether the message was sent.
  /** @param {import("./link.js").Link["send"]} send */
  constructor(store, send) {
    this.store = store;
    this.send = send;
    this.starting = false;
    this.state = "";
    this.stops = 0; // emergency stops so far: the host does no start from before one
    this.asked = "";
    by("start").addEventListener("click", () => this.#ask("start", { scene: by("room-scene").value || null, stops: this.stops }));
    by("stop").addEventListener("click", () => this.#ask("stop"));
  }

  /** @param {import("./messages.js").Launcher} message */
  take({ state, scene, why, stops }) {
    this.stops = stops;
    if (state === this.state) return;
    this.state = state;
    const title = this.store.hello?.rooms.scenes.find(({ name }) => name === scene)?.title ?? scene ?? "the session";
    this.starting = state === "starting";
    if (state === "starting") notice(`starting ${title} …`);
    if (state === "running") notice(`${title} is running`, "good");
    if (state === "failed") notice(`not started: ${why ?? "unknown reason"}`, "bad");
    if (state !== "starting") this.asked = "";
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
    by("start").disabled = !may || this.starting;
    by("stop").disabled = !may || !(running || this.starting);
    fill(by("room-scene"), (rooms?.scenes ?? []).map(({ name, title }) => [name, title ?? name]));
    if (rooms?.scene && rooms.scene !== this.scene) by("room-scene").value = this.scene = rooms.scene;
  }

  #ask(action, more = {}) {
    this.asked = action;
    if (!this.send({ type: "session", do: action, ...more })) notice(`not ${action}ed: the monitor does not answer`, "bad");
  }
}

// Recording of the session: start, stop, markers, and how it stands.
export class Recording {
  // `send(message)` returns whether the message was sent.
  /** @param {import("./link.js").Link["send"]} send */
  constructor(store, send) {
    this.store = store;
    this.send = send;
    this.clear();
    by("record-switch").addEventListener("click", () =>
      this.#ask(this.on ? { do: "stop" } : { do: "start", name: this.#text() || null }), // without a name: session and time
    );
    by("mark").addEventListener("click", () => this.#mark());
    addEventListener("keydown", (event) => {
      const { target } = /** @type {{target: any}} */ (event);
      if (event.key.toLowerCase() !== "m" || event.repeat || event.ctrlKey || event.altKey || event.metaKey) return;
      if (!target.closest?.("input:not([type=range]), select, textarea")) this.#mark();
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
    if (state !== before && state === "done") notice(`recorded: ${path} (${progress(message)})`, "good");
    if (state !== before && state === "failed") notice(`recording failed: ${why ?? "unknown reason"}${path ? ` (${path})` : ""}`, "bad");
    this.refresh();
  }

  answer({ accepted, why }) {
    if (!accepted) notice(`recording: ${why ?? "refused"}`, "bad");
  }

  // After a greeting, an end, or when the connection came or went.
  refresh() {
    const { on } = this;
    const { hello, may, running } = this.store;
    by("record").hidden = !hello?.records && this.last.state === "off";
    by("record-why").textContent = (running && hello.records_why) || "";
    by("record-why").hidden = !by("record-why").textContent;
    by("record-switch").textContent = on ? "Stop recording" : "Record";
    by("record-switch").setAttribute("aria-pressed", String(on));
    by("record-switch").disabled = by("record-text").disabled = !(may && running);
    by("mark").disabled = !(may && running && on);
    by("record-text").placeholder = on ? "text of the mark" : "name";
    by("record-text").setAttribute("aria-label", on ? "Text of the next mark" : "Name of the recording");
  }

  #mark() {
    if (!this.store.hello?.records) return;
    if (!this.on) notice("no mark: nothing is being recorded", "warn");
    else if (this.#ask({ do: "mark", text: this.#text() })) notice(`marked at ${this.store.newest.toFixed(1)} s`, "good");
  }

  #ask(message) {
    const sent = this.send({ type: "record", ...message });
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
  const size = bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
  return [`${seconds.toFixed(1)} s`, size, marks && `${marks} mark${marks === 1 ? "" : "s"}`].filter(Boolean).join(", ");
}
