// Pictures of the robot: of each camera the newest one and its age, beside the age of the force.

import { by, element, show } from "./dom.js";
import { Link } from "./link.js";

const STALE_MS = 1000;
const LOOK_MS = 250;

export class Camera {
  // `forceAge()` is the age of the newest force [ms]; NaN while unknown.
  constructor(forceAge) {
    this.link = new Link("view", (data) => this.#take(data), (state) => state === "open" && this.#clear(), "picture_thread.js");
    this.forceAge = forceAge;
    this.followed = null;
    this.shown = new Map();
  }

  // Follows the pictures of a session; null for none.
  follow(session) {
    by("panel-view").hidden = session === null;
    document.body.dataset.view = String(session !== null);
    if (session === this.followed) return;
    this.followed = session;
    this.#clear();
    clearInterval(this.timer);
    this.link.close();
    if (session === null) return;
    this.opened = performance.timeOrigin + performance.now();
    this.timer = setInterval(() => this.#say(), LOOK_MS);
    this.link.follow(session);
    this.#say();
  }

  // Each thread draws on canvases of its own.
  #clear() {
    this.shown.clear();
    by("frames").replaceChildren();
  }

  // Takes what the thread says of a picture: at first {name, note}, then, as it is drawn, when it came and was taken.
  #take({ name, note, came, taken }) {
    let camera = this.shown.get(name);
    if (!camera) {
      const canvas = element("canvas", { role: "img", ariaLabel: `Picture of ${name}` });
      const caption = element("figcaption", {}, name);
      by("frames").append(element("figure", {}, canvas, caption));
      camera = { canvas, caption, came: null, taken: 0, note: "" };
      this.shown.set(name, camera);
      const surface = canvas.transferControlToOffscreen();
      this.link.socket.postMessage({ name, canvas: surface }, [surface]);
    }
    if (note !== undefined) camera.note = note;
    if (came !== undefined) Object.assign(camera, { came, taken });
  }

  #say() {
    const now = performance.timeOrigin + performance.now(); // the clock of all threads
    let [age, stale] = [NaN, this.shown.size === 0];
    for (const [name, camera] of this.shown) {
      const since = now - (camera.came ?? this.opened);
      const isStale = since > STALE_MS;
      const own = camera.came === null ? NaN : now - camera.taken;
      stale ||= isStale;
      age = isStale || Number.isNaN(own) ? age : Math.max(own, Number.isNaN(age) ? own : age);
      camera.canvas.dataset.stale = String(isStale);
      camera.caption.textContent = camera.note || (isStale ? `${name}: no picture for ${(since / 1000).toFixed(1)} s` : name);
    }
    by("panel-view").dataset.stale = String(stale);
    const force = this.forceAge();
    const felt = Number.isNaN(force) ? "" : `, force ${force.toFixed(force < 10 ? 1 : 0)} ms`;
    const none = this.shown.size === 0 ? "no picture yet" : "no picture";
    show(by("frame-age"), Number.isNaN(age) ? none : `${Math.round(age)} ms old${felt}`, Number.isNaN(age) ? null : age / 1000);
  }
}
