// A camera of the robot, or a rendering of its scene: the newest picture, and how old it is.
//
// A message is the age of the picture when it was sent [s], 8 bytes, little-endian, and a JPEG file.

import { by, show } from "./dom.js";
import { Link } from "./link.js";

const STALE_MS = 1000;
const LOOK_MS = 250;
const HEADER_BYTES = 8;

export class Camera {
  constructor() {
    this.link = new Link("view", (data) => this.#take(data), () => {});
    this.followed = null;
  }

  // Follows the view of a session; null for none.
  follow(session) {
    by("panel-view").hidden = session === null;
    document.body.dataset.view = String(session !== null);
    if (session === this.followed) return;
    this.followed = session;
    this.waiting = this.came = null;
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
    if (!(data instanceof ArrayBuffer) || data.byteLength <= HEADER_BYTES) return;
    const idle = this.waiting === null;
    this.waiting = { data, came: performance.now() };
    if (idle) this.#draw();
  }

  async #draw() {
    const { followed } = this;
    while (this.waiting?.data) {
      const { data, came } = this.waiting;
      this.waiting = {};
      try {
        const picture = await createImageBitmap(new Blob([data.slice(HEADER_BYTES)], { type: "image/jpeg" }));
        if (followed !== this.followed) return;
        Object.assign(by("frame"), { width: picture.width, height: picture.height });
        by("frame").getContext("2d").drawImage(picture, 0, 0);
        picture.close();
        this.came = came;
        this.taken = came - 1000 * new DataView(data).getFloat64(0, true);
        this.#say();
      } catch {
        // not a picture: the text shows that none came
      }
    }
    this.waiting = null;
  }

  #say() {
    const now = performance.now();
    const since = now - (this.came ?? this.opened);
    by("panel-view").dataset.stale = String(since > STALE_MS);
    if (since > STALE_MS) show(by("frame-age"), `no frame for ${(since / 1000).toFixed(1)} s`, since / 1000);
    else if (this.came === null) show(by("frame-age"), "no frame yet", null);
    else show(by("frame-age"), `${Math.round(now - this.taken)} ms old`, (now - this.taken) / 1000);
  }
}
