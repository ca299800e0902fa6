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
    this.token = null; // of the greeting: a request that changes something is refused without it
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
    const query = new URLSearchParams(location.hash.slice(1)); // #key=...: who has it may drive
    if (this.session !== null) query.set("session", this.session);
    const socket = new WebSocket(`${scheme}//${location.host}/ws?${query}`);
    this.socket = socket;
    socket.onopen = () => {
      if (socket !== this.socket) return;
      this.wait = FIRST_WAIT_MS;
      this.onState("open");
    };
    socket.onmessage = (event) => {
      if (socket === this.socket) this.onMessage(JSON.parse(event.data));
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
