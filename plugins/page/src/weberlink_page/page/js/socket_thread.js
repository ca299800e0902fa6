// Thread of a WebSocket. It repeats what holds the handle, on time also while the page draws slowly; a page that has said
// nothing for longer has stopped, and lets go.

const REPEAT_MS = 30;
const PATIENCE_MS = 500;

let socket = null;
let held = null; // the text to repeat
let heardAt = 0;
let timer = null;
let take = (data) => postMessage({ data });

// Gives what comes to a function instead of the page.
export const receive = (by) => (take = by);

// Takes {url}, once; {text, repeat}: repeat is true for a text to repeat, false for the last of these, or undefined; {close}.
onmessage = ({ data: { url, text, repeat, close } }) => {
  if (url) open(url);
  if (close) socket.close();
  if (text === undefined || socket.readyState !== WebSocket.OPEN) return;
  socket.send(text);
  if (repeat === undefined) return;
  heardAt = performance.now();
  held = repeat ? text : null;
  wait();
};

function open(url) {
  socket = new WebSocket(url);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => postMessage({ state: "open" });
  socket.onmessage = ({ data }) => take(data);
  socket.onclose = () => {
    postMessage({ state: "closed" });
    self.close();
  };
}

function wait() {
  clearTimeout(timer);
  if (held !== null) timer = setTimeout(again, REPEAT_MS);
}

function again() {
  if (performance.now() - heardAt > PATIENCE_MS || socket.readyState !== WebSocket.OPEN) return;
  socket.send(held);
  wait();
}
