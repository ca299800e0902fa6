// The axes of an arm that is led joint by joint: angles and torques now, and packets of joints and gripper.

import { AS, show } from "./format.js";

const EVERY_MS = 200;
const DEGREES = 180 / Math.PI;
const CHANNELS = { joint_angle: "joints, angles", joint_torque: "joints, torques", gripper_angle: "gripper, angle", gripper_torque: "gripper, torque" };
// Of each cell of an axis: the ring, the field and the text of its value.
const degrees = (value) => (Number.isFinite(value) ? `${AS.number1(DEGREES * value)}°` : AS.number1(value));
const CELLS = [
  ["master", "joint_position", degrees],
  ["slave", "joint_position", degrees],
  ["slave", "joint_raw", AS.number3],
  ["master", "joint_output", AS.number3],
];

const by = (id) => document.getElementById(id);

export class ArmTable {
  constructor(store) {
    this.store = store;
    this.drawn = -Infinity; // when the figures were last written
  }

  // Makes a row for each axis and each channel of the session.
  build() {
    const axes = this.store.axes ?? [];
    by("axes").replaceChildren(...axes.map((name) => row(name, CELLS.length)));
    const channels = Object.keys(CHANNELS).filter((name) => !name.startsWith("gripper") || axes.at(-1) === "gripper");
    by("arm-channels").replaceChildren(...(axes.length ? channels : []).map((name) => row(CHANNELS[name], 3, name)));
    this.drawn = -Infinity;
  }

  draw(time) {
    const now = performance.now();
    clearTimeout(this.later);
    if (!this.store.axes) return;
    if (now - this.drawn < EVERY_MS) {
      this.later = setTimeout(() => this.draw(time), EVERY_MS);
      return;
    }
    this.drawn = now;
    // Of the same moment: one side may have come later than the other.
    const common = Math.min(time, ...this.store.present.map((side) => this.store.rings[side].newest));
    for (const [axis, { cells }] of [...by("axes").rows].entries())
      CELLS.forEach(([side, field, text], k) => {
        const value = at(this.store.rings[side], `${field}_${axis}`, common);
        show(cells[k + 1], text(value), value);
      });
    const { figures, ended, rate } = this.store;
    for (const { dataset, cells } of by("arm-channels").rows) {
      const over = figures?.figures?.[dataset.channel];
      const packets = ended ? over?.packets_per_s : figures?.packets_per_s_now?.[dataset.channel];
      const saved = ended ? over?.reduction : figures?.reduction_now?.[dataset.channel];
      show(cells[1], AS.number1(packets), packets);
      show(cells[2], AS.count(rate), rate);
      show(cells[3], AS.percent(saved), saved);
    }
  }
}

function row(name, count, channel = "") {
  const made = document.createElement("tr");
  const head = document.createElement("th");
  Object.assign(head, { scope: "row", textContent: name, title: name });
  made.append(head, ...Array.from({ length: count }, () => document.createElement("td")));
  if (channel) made.dataset.channel = channel;
  return made;
}

// A column of a ring at a time; not-a-number while it is unknown.
function at(ring, name, time) {
  if (ring.empty || !ring.has(name)) return NaN;
  return ring.columns[name][Math.min(ring.at(time), ring.end - 1)];
}
