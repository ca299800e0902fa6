// What is listed: alarms, events, paths of the link, and the axes of an arm that is led joint by joint.

import { all, announce, by, element, press, show } from "./dom.js";
import { AS } from "./format.js";

const MOST_EVENTS = 200;
const TABLE_EVERY_MS = 200;
const CHANNELS = { joint_angle: "joints, angles", joint_torque: "joints, torques", gripper_angle: "gripper, angle", gripper_torque: "gripper, torque" };
// Of each cell of an axis: the ring, the field and the text of its value.
/** @type {[string, string, (value: number) => string][]} */
const CELLS = [
  ["master", "position", AS.degrees1],
  ["slave", "position", AS.degrees1],
  ["slave", "raw", AS.number3],
  ["master", "output", AS.number3],
];

// The alarms that are present. A new one is spoken once, its changing numbers are not.
export class Alarms {
  constructor() {
    this.known = new Set();
  }

  /** @param {import("./messages.js").Alarm[]} alarms */
  show(alarms = []) {
    const list = by("alarms");
    const wanted = alarms.map(({ level, text }) => `${level}\t${text}`).join("\n");
    if (list.dataset.value !== wanted || !list.children.length) {
      list.dataset.value = wanted;
      const items = alarms.length ? alarms : [{ level: "none", text: "no alarms" }];
      list.replaceChildren(...items.map(({ level, text }) => element("li", { "data-level": level, title: text }, text)));
      by("strip").dataset.alarms = alarms.length;
    }
    const fresh = alarms.filter(({ name }) => !this.known.has(name));
    this.known = new Set(alarms.map(({ name }) => name));
    if (fresh.length) announce(fresh.map(({ level, text }) => `${level}: ${text}`).join("; "));
  }
}

// The log of events of a session, the newest first.
export class EventLog {
  constructor() {
    this.clear();
    const buttons = all("#panel-book button[data-page]");
    for (const button of buttons)
      button.addEventListener("click", () => {
        by("panel-book").dataset.page = button.dataset.page;
        press(button, buttons);
      });
  }

  clear() {
    this.known = new Set();
    this.total = 0;
    by("events").replaceChildren();
    this.#count();
  }

  // Events of a message; those already known, of a greeting that was repeated, are left out.
  /** @param {import("./messages.js").LogEvent[]} events */
  take(events) {
    const key = ({ at, wall, side, text }) => `${at}\t${wall}\t${side}\t${text}`;
    const fresh = events.filter((event) => !this.known.has(key(event)));
    this.known = new Set([...this.known, ...fresh.map(key)].slice(-2 * MOST_EVENTS));
    by("events").prepend(...fresh.slice(-MOST_EVENTS).reverse().map(event));
    while (by("events").children.length > MOST_EVENTS) by("events").lastChild.remove();
    this.total += fresh.filter(({ level }) => level !== "info").length;
    this.#count();
  }

  #count() {
    show(by("events-count"), this.total ? String(this.total) : "", this.total);
    by("panel-events").dataset.empty = String(!by("events").children.length);
  }
}

/** @param {import("./messages.js").LogEvent} event */
function event({ at, wall, level, side, text }) {
  const words = element("span", {}, ...(level === "info" ? [] : [element("b", {}, level), " "]));
  words.append(...(side ? [element("i", { className: side }, side), " "] : []), text);
  const clock = Number.isFinite(wall) ? new Date(1000 * wall).toLocaleTimeString("en-GB") : "";
  const time = element("time", { title: Number.isFinite(at) ? `${at.toFixed(3)} s of the session` : "" }, clock);
  return element("li", { "data-level": level }, time, words);
}

// The paths of the link: a line for each in the panel, and how they go in the tile of the round trip.
export function showPaths(paths = []) {
  const wanted = JSON.stringify(paths);
  if (by("paths").dataset.value !== wanted) {
    by("paths").dataset.value = wanted;
    by("paths").replaceChildren(...paths.map(path));
  }
  const routes = [...new Set(paths.map(({ route }) => route).filter(Boolean))];
  show(by("route"), routes.length > 1 ? "mixed" : (routes[0] ?? ""), routes.sort().join(" "));
}

function path({ side, place, words, remote, changes, class: service }) {
  const more = [words, remote && `to ${remote}`, changes && `${changes} change${changes === 1 ? "" : "s"}`, service];
  const name = element("i", { className: side }, place ? `${side}, path ${place + 1}` : side);
  return element("li", {}, name, ` ${more.filter(Boolean).join(", ")}`);
}

// Angles and torques of the axes now, and packets of joints and gripper.
export class ArmTable {
  constructor(store) {
    this.store = store;
    this.drawn = -Infinity;
  }

  // Makes a row for each axis and each channel of the session.
  build() {
    const axes = this.store.axes ?? [];
    const row = (name, count, channel = "") =>
      element("tr", { "data-channel": channel }, element("th", { scope: "row", title: name }, name), ...Array.from({ length: count }, () => element("td")));
    by("axes").replaceChildren(...axes.map((name) => row(name, CELLS.length)));
    const channels = Object.keys(CHANNELS).filter((name) => axes.length && (!name.startsWith("gripper") || axes.at(-1) === "gripper"));
    by("arm-channels").replaceChildren(...channels.map((name) => row(CHANNELS[name], 3, name)));
    this.drawn = -Infinity;
  }

  draw(time) {
    const { store } = this;
    const now = performance.now();
    clearTimeout(this.later);
    if (!store.axes) return;
    if (now - this.drawn < TABLE_EVERY_MS) {
      this.later = setTimeout(() => this.draw(time), TABLE_EVERY_MS);
      return;
    }
    this.drawn = now;
    // Of the same moment: one side may have come later than the other.
    const common = Math.min(time, ...store.present.map((side) => store.rings[side].newest));
    for (const [axis, { cells }] of [...by("axes").rows].entries())
      for (const [k, [side, field, text]] of CELLS.entries()) {
        const value = store.rings[side].value(`${field}_${axis}`, common);
        show(cells[k + 1], text(value), value);
      }
    const { figures, ended, rate } = store;
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
