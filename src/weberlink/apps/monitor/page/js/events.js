// The log of events of a session, the newest first.

import { show } from "./format.js";

const MOST = 200;

const by = (id) => document.getElementById(id);

export class EventLog {
  constructor() {
    this.list = by("events");
    this.clear();
    for (const button of document.querySelectorAll("#panel-book button[data-page]"))
      button.addEventListener("click", () => this.#turn(button));
  }

  clear() {
    this.known = new Set();
    this.total = 0;
    this.list.replaceChildren();
    this.#count();
  }

  // Events of a message; those already known, of a greeting that was repeated, are left out.
  take(events) {
    const fresh = events.filter((event) => !this.known.has(key(event)));
    for (const event of fresh) this.known.add(key(event));
    this.list.prepend(...fresh.slice(-MOST).reverse().map(entry));
    while (this.list.children.length > MOST) this.list.lastChild.remove();
    this.known = new Set([...this.known].slice(-2 * MOST));
    this.total += fresh.filter(({ level }) => level !== "info").length;
    this.#count();
  }

  #turn(chosen) {
    by("panel-book").dataset.page = chosen.dataset.page;
    for (const button of document.querySelectorAll("#panel-book button[data-page]"))
      button.setAttribute("aria-pressed", String(button === chosen));
  }

  #count() {
    show(by("events-count"), this.total ? String(this.total) : "", this.total);
    by("panel-events").dataset.empty = String(!this.list.children.length);
  }
}

const key = ({ at, wall, side, text }) => `${at}\t${wall}\t${side}\t${text}`;

function entry({ at, wall, level, side, text }) {
  const item = document.createElement("li");
  item.dataset.level = level;
  const time = document.createElement("time");
  time.textContent = Number.isFinite(wall) ? new Date(1000 * wall).toLocaleTimeString("en-GB") : "";
  time.title = Number.isFinite(at) ? `${at.toFixed(3)} s of the session` : "";
  const words = document.createElement("span");
  if (level !== "info") words.append(part("b", level), " ");
  if (side) words.append(part("i", side, side), " ");
  words.append(text);
  item.append(time, words);
  return item;
}

function part(tag, text, kind = "") {
  return Object.assign(document.createElement(tag), { textContent: text, className: kind });
}
