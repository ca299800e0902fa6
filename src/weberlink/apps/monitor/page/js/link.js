// The WebSocket to the server: opens it, parses its messages, and reconnects for as long as the page is open.

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 4000;

export class Link {
  // `onMessage(message)`; `onState("connecting" | "open" | "gone")`.
  constructor(onMessage, onState) {
    this.onMessage = onMessage;
    this.onState = onState;
    this.wait = FIRST_WAIT_MS;
    this.session = null;
    this.socket = null;
    this.token = null; // of the greeting: shows the server that a request comes from this page
  }

  // Follows a session; null is the newest.
  follow(session) {
    this.session = session;
    this.wait = FIRST_WAIT_MS;
    this.#close();
    this.#open();
  }

  send(message) {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(this.token === null ? message : { ...message, token: this.token }));
    return true;
  }

  #open() {
    clearTimeout(this.timer);
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const query = this.session === null ? "" : `?session=${encodeURIComponent(this.session)}`;
    const socket = new WebSocket(`${scheme}//${location.host}/ws${query}`);
    this.socket = socket;
    socket.onopen = () => {
      if (socket !== this.socket) return;
      this.wait = FIRST_WAIT_MS;
      this.onState("open");
    };
    socket.onmessage = (event) => {
      if (socket !== this.socket) return;
      const message = JSON.parse(event.data);
      if (message.type === "hello") this.token = message.token ?? null;
      this.onMessage(message);
    };
    socket.onclose = () => {
      if (socket !== this.socket) return;
      this.onState("gone");
      this.timer = setTimeout(() => this.#open(), this.wait);
      this.wait = Math.min(2 * this.wait, LONGEST_WAIT_MS);
    };
  }

  #close() {
    const old = this.socket;
    this.socket = null;
    old?.close();
  }
}
