// The alarms that are present, in the words of the verdict.

import { announce } from "./notice.js";

const by = (id) => document.getElementById(id);

export class Alarms {
  constructor() {
    this.known = new Set();
  }

  // The alarms of a message of figures: [{name, level, text}]. A new one is spoken once, its changing numbers are not.
  show(alarms = []) {
    const list = by("alarms");
    const wanted = alarms.map(({ level, text }) => `${level}\t${text}`).join("\n");
    if (list.dataset.value !== wanted || !list.children.length) {
      list.dataset.value = wanted;
      list.replaceChildren(...(alarms.length ? alarms : [{ level: "none", text: "no alarms" }]).map(item));
      by("strip").dataset.alarms = alarms.length;
    }
    const fresh = alarms.filter(({ name }) => !this.known.has(name));
    this.known = new Set(alarms.map(({ name }) => name));
    if (fresh.length) announce(fresh.map(({ level, text }) => `${level}: ${text}`).join("; "));
  }
}

function item({ level, text }) {
  const made = document.createElement("li");
  made.dataset.level = level;
  made.textContent = text;
  made.title = text;
  return made;
}
