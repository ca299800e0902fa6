// A gamepad as the master: its sticks set the speed of the target in the frame of the view, its motors show the force.

const M = 1e-3;
const DEAD_MAN = [0, 5, 7]; // buttons of the standard layout: A, right shoulder, right trigger
const SPEED_MM_S = 80;
const DEAD_ZONE = 0.12;
const TICK_MS = 10;
const FULL_N = 5; // force of the strongest rumble
const LEAST_SHARE = 0.03;
const RUMBLE_MS = 120;
const RUMBLE_EVERY_MS = 90;
const CONTACT_MS = 70;

const pads = () => [...(navigator.getGamepads?.() ?? [])].filter((pad) => pad?.connected);

export class Gamepads {
  // `heard()` is called when a gamepad came or went.
  constructor(view, drive, heard) {
    Object.assign(this, { view, drive, heard, pressed: false, rumbledAt: -Infinity });
    addEventListener("gamepadconnected", () => this.#look());
    addEventListener("gamepaddisconnected", () => this.#look());
    this.#look();
  }

  get present() {
    return pads().length > 0;
  }

  // Shows a force [N]; `contact` is its beginning.
  feel(force, contact) {
    const now = performance.now();
    const share = Math.min(1, force / FULL_N);
    if (!this.drive.held || !(contact || share > LEAST_SHARE)) return;
    if (!contact && now - this.rumbledAt < RUMBLE_EVERY_MS) return;
    this.rumbledAt = now;
    const effect = contact
      ? { duration: CONTACT_MS, strongMagnitude: Math.max(0.4, share), weakMagnitude: 1 }
      : { duration: RUMBLE_MS, strongMagnitude: share, weakMagnitude: 0.4 * share };
    for (const pad of pads()) pad.vibrationActuator?.playEffect?.("dual-rumble", effect)?.catch?.(() => {});
  }

  // After a hold has ended.
  still() {
    for (const pad of pads()) pad.vibrationActuator?.reset?.()?.catch?.(() => {});
  }

  #look() {
    clearInterval(this.timer);
    this.before = performance.now();
    if (this.present) this.timer = setInterval(() => this.#tick(), TICK_MS);
    else this.drive.release("gamepad");
    this.heard();
  }

  #tick() {
    const { drive, view } = this;
    const now = performance.now();
    const seconds = Math.min(0.1, (now - this.before) / 1000);
    this.before = now;
    const pad = pads().find(({ buttons }) => DEAD_MAN.some((k) => buttons[k]?.pressed));
    const begins = pad && !this.pressed; // a hold that the page ended needs a new press
    this.pressed = Boolean(pad);
    if (!pad) {
      drive.release("gamepad");
      return;
    }
    const handle = view.handle?.map((value) => M * value);
    if (begins) drive.grab("gamepad", handle);
    if (!drive.sources.has("gamepad")) return;
    const { right, up, away } = view.plane();
    const [x, y, z] = [pad.axes[0], -pad.axes[1], -pad.axes[3]].map(deflection);
    if (!(x || y || z)) return;
    const by = right.multiplyScalar(x).addScaledVector(up, y).addScaledVector(away, z);
    drive.steer(by.multiplyScalar(M * SPEED_MM_S * seconds).toArray(), handle);
  }
}

// Of a stick's axis: none near the middle, fine beside it.
function deflection(value) {
  const size = Math.abs(value ?? 0);
  if (!(size > DEAD_ZONE)) return 0;
  return Math.sign(value) * ((size - DEAD_ZONE) / (1 - DEAD_ZONE)) ** 2;
}
