// Mouse, finger, pen and keyboard as the master: what they do in the 3-D view moves the target.

const M = 1e-3; // millimetres in metres
const REACH_PX = { mouse: 24, pen: 30, touch: 44 }; // around the handle
const DEPTH_MM_PER_PX = 0.04; // of a wheel: 4 mm for a notch
const LINE_PX = 33;
const KEY_SPEED_MM_S = 30;
const TICK_MS = 10;
const MOVES = {
  ArrowLeft: ["right", -1],
  ArrowRight: ["right", 1],
  ArrowUp: ["up", 1],
  ArrowDown: ["up", -1],
  PageUp: ["away", 1],
  PageDown: ["away", -1],
  " ": ["up", 0],
};

export class Pointing {
  constructor(place, view, drive) {
    this.place = place;
    this.view = view;
    this.drive = drive;
    this.anywhere = false; // whether a drag beside the handle moves it, too
    this.pointer = this.finger = null;
    this.keys = new Set();
    const early = { capture: true, passive: false }; // before the controls of the camera
    place.addEventListener("pointerdown", (event) => this.#down(event), early);
    // Raw updates come between two drawings, too. The window hears of pointers of which the place has lost the capture.
    for (const kind of ["pointerrawupdate", "pointermove"]) addEventListener(kind, (event) => this.#move(event));
    for (const kind of ["pointerup", "pointercancel"]) addEventListener(kind, (event) => this.#up(event));
    place.addEventListener("wheel", (event) => this.#wheel(event), early);
    place.addEventListener("contextmenu", (event) => drive.held && event.preventDefault());
    place.addEventListener("keydown", (event) => this.#key(event), early);
    place.addEventListener("blur", () => this.#letKeysGo());
    addEventListener("keyup", (event) => this.keys.delete(event.key) && !this.keys.size && this.#letKeysGo());
  }

  // After a hold has ended, whoever ended it.
  forget() {
    this.pointer = this.finger = null;
    this.#letKeysGo();
  }

  #down(event) {
    const { view, drive } = this;
    if (this.pointer) {
      event.stopPropagation(); // a second finger is depth
      if (event.pointerType === "touch" && !this.finger) this.finger = { id: event.pointerId, y: event.clientY };
      return;
    }
    const turns = event.button !== 0 || event.shiftKey || event.ctrlKey || event.metaKey;
    const handle = view.handle;
    if (turns || !handle || !(this.anywhere || this.#isNear(event))) return;
    if (!drive.grab("pointer", handle.map((value) => M * value))) return;
    event.stopPropagation();
    event.preventDefault();
    this.place.focus({ preventScroll: true });
    this.place.setPointerCapture(event.pointerId);
    const at = [event.clientX, event.clientY];
    const plane = view.plane();
    this.pointer = { id: event.pointerId, at, plane, hit: view.hit(at, handle, plane.away) };
  }

  #move(event) {
    const { pointer, finger, view } = this;
    if (finger && event.pointerId === finger.id) {
      this.#deepen((finger.y - event.clientY) * view.pixel(view.handle));
      finger.y = event.clientY;
    } else if (pointer && event.pointerId === pointer.id) {
      if (event.buttons === 0) return this.#up(event); // released where this page could not hear it
      pointer.at = [event.clientX, event.clientY];
      this.#follow(pointer);
    } else if (!pointer && event.type === "pointermove" && this.place.contains(event.target)) {
      this.place.classList.toggle("near", !this.drive.refusal && (this.anywhere || this.#isNear(event)));
    }
  }

  #up(event) {
    if (event.pointerId === this.finger?.id) this.finger = null;
    if (event.pointerId !== this.pointer?.id) return;
    this.pointer = this.finger = null;
    this.drive.release("pointer");
  }

  #wheel(event) {
    if (!this.drive.held) return;
    event.stopPropagation();
    event.preventDefault();
    this.#deepen(-event.deltaY * (event.deltaMode ? LINE_PX : 1) * DEPTH_MM_PER_PX);
  }

  // Moves the target, and the plane of the pointer with it, straight away from the viewer; its height stays.
  #deepen(mm) {
    const { pointer, view, drive } = this;
    const { away } = pointer?.plane ?? view.plane();
    drive.move(away.clone().multiplyScalar(M * mm).toArray());
    if (pointer) pointer.hit = view.hit(pointer.at, pointer.hit.clone().addScaledVector(away, mm), away) ?? pointer.hit;
  }

  #follow(pointer) {
    const hit = this.view.hit(pointer.at, pointer.hit, pointer.plane.away);
    if (!hit) return; // the line of sight does not meet the plane
    this.drive.move(hit.clone().sub(pointer.hit).multiplyScalar(M).toArray());
    pointer.hit = hit;
  }

  #isNear(event) {
    const { handle } = this.view;
    if (!handle) return false;
    const [x, y] = this.view.seen(handle);
    return Math.hypot(event.clientX - x, event.clientY - y) < (REACH_PX[event.pointerType] ?? REACH_PX.mouse);
  }

  #key(event) {
    const { drive } = this;
    if (event.target !== this.place || !(event.key in MOVES) || event.shiftKey || event.ctrlKey || event.altKey) return;
    if (drive.refusal !== null) return; // arrow keys turn the view
    event.preventDefault();
    if (event.repeat || !drive.grab("keys", this.view.handle?.map((value) => M * value))) return;
    this.keys.add(event.key);
    this.before = performance.now();
    this.timer ??= setInterval(() => this.#steer(), TICK_MS);
  }

  #steer() {
    const now = performance.now();
    const step = KEY_SPEED_MM_S * M * Math.min(0.1, (now - this.before) / 1000);
    this.before = now;
    const plane = this.view.plane();
    const sum = plane.up.clone().setScalar(0);
    for (const key of this.keys) sum.addScaledVector(plane[MOVES[key][0]], step * MOVES[key][1]);
    if (sum.lengthSq()) this.drive.steer(sum.toArray(), this.view.handle?.map((value) => M * value));
  }

  #letKeysGo() {
    clearInterval(this.timer);
    this.timer = null;
    this.keys.clear();
    this.drive.release("keys");
  }
}
