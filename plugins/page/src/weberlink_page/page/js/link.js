// A WebSocket to the server, in a thread of its own: opens it, parses its text messages, and reconnects until it is closed.

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 4000;

export class Link {
  // `onMessage(message)`; `onState("open" | "gone")`; `thread` is the file of the thread.
  constructor(path, onMessage, onState, thread = "socket_thread.js") {
    this.path = path;
    this.thread = thread;
    this.onMessage = onMessage;
    this.onState = onState;
    this.wait = FIRST_WAIT_MS;
    this.session = null;
    this.socket = null; // the thread
    this.isOpen = false;
    this.token = null; // of the greeting of a page with the key: a request that changes something is refused without it
  }

  // Follows a session; null is the newest.
  follow(session) {
    this.session = session;
    this.wait = FIRST_WAIT_MS;
    this.close();
    this.#open();
  }

  // Whether the message was sent. With `repeat`, it is repeated until one with `repeat` false, or this page stops.
  /** @param {import("./messages.js").Request} message @param {boolean} [repeat] */
  send(message, repeat) {
    if (!this.isOpen) return false;
    const text = JSON.stringify(this.token === null ? message : { ...message, token: this.token });
    this.socket.postMessage({ text, repeat });
    return true;
  }

  close() {
    clearTimeout(this.timer);
    const old = this.socket;
    this.socket = null;
    this.isOpen = false;
    old?.postMessage({ close: true });
  }

  #open() {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const query = new URLSearchParams(location.hash.slice(1)); // #key=...: who has it may change something
    if (this.session !== null) query.set("session", this.session);
    const socket = (this.socket = new Worker(new URL(this.thread, import.meta.url), { type: "module" }));
    socket.onmessage = ({ data: { state, data } }) => {
      if (socket !== this.socket) return;
      if (data !== undefined) this.onMessage(typeof data === "string" ? JSON.parse(data) : data);
      if (state === "open") this.#opened();
      if (state === "closed") this.#closed();
    };
    socket.onerror = () => socket === this.socket && this.#closed(); // the server did not give the thread its code
    socket.postMessage({ url: `${scheme}//${location.host}/${this.path}?${query}` });
  }

  #opened() {
    this.isOpen = true;
    this.wait = FIRST_WAIT_MS;
    this.onState("open");
  }

  #closed() {
    this.isOpen = false;
    this.socket = null;
    this.onState("gone");
    this.timer = setTimeout(() => this.#open(), this.wait);
    this.wait = Math.min(2 * this.wait, LONGEST_WAIT_MS);
  }
}
