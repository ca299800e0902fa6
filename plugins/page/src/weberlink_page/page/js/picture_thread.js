// Thread of the pictures: receives, decodes and draws them, so that a page that is busy delays none.
//
// A message is the age of the picture when it was sent [s], the lengths of name, note and JPEG, and these three; little-endian.

import { receive } from "./socket_thread.js";

const HEADER_BYTES = 16;
const words = new TextDecoder();
const cameras = new Map(); // by name: the canvas, once the page has given it, the newest picture that waits, and whether one is decoded

// The page answers the first message of a camera with its canvas.
addEventListener("message", ({ data: { name, canvas } }) => {
  if (!canvas) return;
  cameras.get(name).canvas = canvas;
  draw(name);
});

receive((data) => {
  if (!(data instanceof ArrayBuffer) || data.byteLength < HEADER_BYTES) return;
  const view = new DataView(data);
  const [ofName, ofNote] = [view.getUint16(8, true), view.getUint16(10, true)];
  const text = (from, length) => words.decode(new Uint8Array(data, HEADER_BYTES + from, length));
  const [name, note, jpeg] = [text(0, ofName), text(ofName, ofNote), data.slice(HEADER_BYTES + ofName + ofNote)];
  const came = performance.timeOrigin + performance.now();
  if (!cameras.has(name)) cameras.set(name, { canvas: null, waiting: null, busy: false });
  if (jpeg.byteLength > 0) cameras.get(name).waiting = { jpeg, came, taken: came - 1000 * view.getFloat64(0, true) };
  postMessage({ data: { name, note } });
  draw(name);
});

// Of pictures that come faster than they can be decoded, only the newest is shown.
async function draw(name) {
  const camera = cameras.get(name);
  if (camera.busy || !camera.canvas) return;
  camera.busy = true;
  while (camera.waiting) {
    const { jpeg, came, taken } = camera.waiting;
    camera.waiting = null;
    try {
      const picture = await createImageBitmap(new Blob([jpeg], { type: "image/jpeg" }));
      Object.assign(camera.canvas, { width: picture.width, height: picture.height });
      camera.canvas.getContext("2d").drawImage(picture, 0, 0);
      picture.close();
      postMessage({ data: { name, came, taken } });
    } catch {
      // not a picture: the page shows that none came
    }
  }
  camera.busy = false;
}
