// A WebSocket to the server: opens it, parses its text messages, and reconnects until it is closed.

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 4000;

export class Link {
  // `onMessage(message)`, an ArrayBuffer for a binary one; `onState("open" | "gone")`.
  constructor(path, onMessage, onState) {
    this.path = path;
    this.onMessage = onMessage;
    this.onState = onState;
    this.wait = FIRST_WAIT_MS;
    this.session = null;
    this.socket = null;
    this.token = null; // of the greeting: a request that changes something is refused without it
  }

  // Follows a session; null is the newest.
  follow(session) {
    this.session = session;
    this.wait = FIRST_WAIT_MS;
    this.close();
    this.#open();
  }

  // Whether the message was sent.
  send(message) {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(this.token === null ? message : { ...message, token: this.token }));
    return true;
  }

  close() {
    clearTimeout(this.timer);
    const old = this.socket;
    this.socket = null;
    old?.close();
  }

  #open() {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const query = new URLSearchParams(location.hash.slice(1)); // #key=...: who has it may drive
    if (this.session !== null) query.set("session", this.session);
    const socket = new WebSocket(`${scheme}//${location.host}/${this.path}?${query}`);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      if (socket !== this.socket) return;
      this.wait = FIRST_WAIT_MS;
      this.onState("open");
    };
    socket.onmessage = (event) => {
      if (socket === this.socket) this.onMessage(typeof event.data === "string" ? JSON.parse(event.data) : event.data);
    };
    socket.onclose = () => {
      if (socket !== this.socket) return;
      this.onState("gone");
      this.timer = setTimeout(() => this.#open(), this.wait);
      this.wait = Math.min(2 * this.wait, LONGEST_WAIT_MS);
    };
  }
}
