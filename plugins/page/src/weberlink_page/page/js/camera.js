// Pictures of the robot: of each camera the newest one and its age, beside the age of the force.
//
// A message is the age of the picture when it was sent [s], the lengths of name, note and JPEG, and these three; little-endian.

import { by, element, show } from "./dom.js";
import { Link } from "./link.js";

const STALE_MS = 1000;
const LOOK_MS = 250;
const HEADER_BYTES = 16;
const words = new TextDecoder();

/** @param {ArrayBuffer} data */
export function read(data) {
  const view = new DataView(data);
  const [name, note] = [view.getUint16(8, true), view.getUint16(10, true)];
  const text = (from, length) => words.decode(new Uint8Array(data, HEADER_BYTES + from, length));
  const jpeg = data.slice(HEADER_BYTES + name + note);
  return { age: 1000 * view.getFloat64(0, true), name: text(0, name), note: text(name, note), jpeg };
}

export class Camera {
  // `forceAge()` is the age of the newest force [ms]; NaN while unknown.
  constructor(forceAge) {
    this.link = new Link("view", (data) => this.#take(data), () => {});
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
    this.shown.clear();
    by("frames").replaceChildren();
    clearInterval(this.timer);
    this.link.close();
    if (session === null) return;
    this.opened = performance.now();
    this.timer = setInterval(() => this.#say(), LOOK_MS);
    this.link.follow(session);
    this.#say();
  }

  // Of pictures that come faster than they can be decoded, only the newest is shown.
  #take(data) {
    if (!(data instanceof ArrayBuffer) || data.byteLength < HEADER_BYTES) return;
    const picture = read(data);
    let camera = this.shown.get(picture.name);
    if (!camera) {
      const canvas = element("canvas", { role: "img", ariaLabel: `Picture of ${picture.name}` });
      const caption = element("figcaption", {}, picture.name);
      by("frames").append(element("figure", {}, canvas, caption));
      camera = { canvas, caption, waiting: null, busy: false, came: null, taken: 0, note: "" };
      this.shown.set(picture.name, camera);
    }
    camera.note = picture.note;
    if (picture.jpeg.byteLength > 0) camera.waiting = { ...picture, came: performance.now() };
    if (!camera.busy) this.#draw(camera);
  }

  async #draw(camera) {
    camera.busy = true;
    while (camera.waiting) {
      const { jpeg, came, age } = camera.waiting;
      camera.waiting = null;
      try {
        const picture = await createImageBitmap(new Blob([jpeg], { type: "image/jpeg" }));
        Object.assign(camera.canvas, { width: picture.width, height: picture.height });
        camera.canvas.getContext("2d").drawImage(picture, 0, 0);
        picture.close();
        camera.came = came;
        camera.taken = came - age;
        camera.canvas.dataset.drawn = String(Number(camera.canvas.dataset.drawn ?? 0) + 1);
        this.#say();
      } catch {
        // not a picture: the text shows that none came
      }
    }
    camera.busy = false;
  }

  #say() {
    const now = performance.now();
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
