// The emergency stop: asks for it by the WebSocket and by HTTP, as soon as the button goes down, and says what happened.
// It asks whatever the page believes of the session: the page may be behind. It asks again until a stop is acknowledged.

import { announce, by, notice } from "./dom.js";

const PATIENCE_MS = 3000;
const REPEAT_MS = 500;
const GIVE_UP_MS = 60000;
const SAME_PRESS_MS = 1000;
const INSTEAD = "use the emergency stop of the robot or the device, or press Ctrl-C in the terminal of the session";

const button = by("emergency");
const KEY = button.getAttribute("aria-keyshortcuts");

export class Emergency {
  // `said()` is called when the state has changed.
  constructor(store, link, said) {
    this.store = store;
    this.link = link;
    this.said = said;
    this.pressed = -Infinity;
    this.clear();
    button.addEventListener("pointerdown", (event) => event.button === 0 && this.press());
    const pressed = (event) => {
      event.preventDefault();
      if (!event.repeat) this.press();
    };
    button.addEventListener("keydown", (event) => [" ", "Enter"].includes(event.key) && pressed(event));
    // A click without pointer or key: assistive technology.
    button.addEventListener("click", () => performance.now() - this.pressed > SAME_PRESS_MS && this.press());
    // Whatever has the focus: the key writes nothing, and moves nothing, in any control.
    // With another key held it belongs to the desktop or a screen reader.
    const others = (event) => event.ctrlKey || event.altKey || event.metaKey;
    addEventListener("keydown", (event) => event.key === KEY && !others(event) && pressed(event), true);
  }

  press() {
    clearTimeout(this.timer);
    clearTimeout(this.again);
    this.pressed = performance.now();
    this.waiting = 0;
    this.reasons = new Set();
    this.state = "asked";
    this.#ask();
    this.#show(`emergency stop asked for at ${clock()}`, "warn");
    this.timer = setTimeout(() => this.#fail([...this.reasons, "no answer"].join("; ")), PATIENCE_MS);
  }

  answer({ accepted, why }) {
    if (!this.#isOpen()) return;
    if (accepted) this.#stopped();
    else this.#refused(why ?? "refused");
  }

  #isOpen() {
    return this.state === "asked" || this.state === "failed";
  }

  // Both ways. The age keeps what is started after the press from being stopped by a repetition.
  #ask() {
    const age_ms = performance.now() - this.pressed;
    if (this.link.send({ type: "emergency", age_ms })) this.waiting += 1;
    if (!this.posting) {
      this.waiting += 1;
      this.#post(age_ms);
    }
    if (age_ms < GIVE_UP_MS) this.again = setTimeout(() => this.#ask(), REPEAT_MS);
  }

  // The session is over: whatever the answers were, it is stopped.
  ended() {
    if (this.#isOpen()) this.#stopped();
  }

  // Another session is shown.
  clear() {
    clearTimeout(this.timer);
    clearTimeout(this.again);
    if (this.state) notice("");
    this.state = "";
    this.store.stopped = false;
    button.dataset.value = "";
  }

  async #post(age_ms) {
    const session = this.store.hello?.session; // without one, all sessions of the host are stopped
    const query = new URLSearchParams({ ...(session && { session }), age_ms: age_ms.toFixed() });
    const headers = { "X-WeberLink-Token": this.link.token ?? "" };
    this.posting = true;
    try {
      const response = await fetch(`api/emergency?${query}`, { method: "POST", keepalive: true, headers });
      const text = await response.text();
      if (response.headers.get("Content-Type")?.startsWith("application/json")) this.answer(JSON.parse(text));
      else this.#refused(text.trim() || `the monitor answered ${response.status}`);
    } catch {
      this.#refused("the monitor does not answer");
    } finally {
      this.posting = false;
    }
  }

  #stopped() {
    if (this.state === "stopped") return;
    clearTimeout(this.timer);
    clearTimeout(this.again);
    this.state = "stopped";
    this.store.stopped = true;
    this.#show(`Stopped at ${clock()}: the force is zero and the robot holds. To start again: ${this.#again()}.`, "bad");
  }

  #again() {
    const { hello, file } = this.store;
    if (hello?.rooms?.start) return "press Start";
    return `start the session again in its terminal${file ? ` (${file.split("/").pop()})` : ""}`;
  }

  #refused(why) {
    if (this.state !== "asked") return;
    this.reasons.add(why);
    this.waiting -= 1;
    if (this.waiting <= 0) this.#fail([...this.reasons].join("; "));
  }

  #fail(why) {
    clearTimeout(this.timer);
    this.state = "failed";
    this.#show(`NOT stopped: ${why}. The page asks on. Now: ${INSTEAD}.`, "bad");
  }

  #show(text, kind) {
    button.dataset.value = this.state;
    notice(text, kind);
    announce(text);
    this.said();
  }
}

const clock = () => new Date().toLocaleTimeString("en-GB");
