// The sessions by name, what takes part in the shown one, and how to start one when there is none.

import { show } from "./format.js";

const LOOK_EVERY_MS = 4000;
const HELP_AFTER_MS = 800; // a greeting that is on its way comes first

const by = (id) => document.getElementById(id);
const last = (path) => path?.split("/").pop();

export class Sessions {
  // `follow(name)` shows another session.
  constructor(store, follow) {
    Object.assign(this, { store, connected: false });
    by("session").addEventListener("change", ({ target }) => {
      target.blur();
      follow(target.value);
    });
    for (const button of document.querySelectorAll("[data-copy]"))
      button.addEventListener("click", () => copy(button));
    setInterval(() => this.list(), LOOK_EVERY_MS);
  }

  // After a greeting, or when the connection came or went.
  refresh(connected) {
    this.connected = connected;
    this.#names();
    this.list();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.#help(), this.store.hello?.session ? 0 : HELP_AFTER_MS);
  }

  async list() {
    if (!this.connected) return;
    let sessions = [];
    try {
      ({ sessions } = await (await fetch("api/sessions")).json());
    } catch {
      return; // the tile of the state shows the lost connection
    }
    const { store } = this;
    const current = store.hello?.session ?? "";
    const items = sessions.map(({ session, file, live }) => [
      session,
      [session, last(file), live ? "running" : "ended"].filter(Boolean).join(" · "),
    ]);
    if (current && !items.some(([name]) => name === current))
      items.push([current, [current, last(this.#file()), store.ended ? "ended" : "running"].filter(Boolean).join(" · ")]);
    fill(by("session"), items.length ? items : [["none", "none"]]);
    by("session").disabled = items.length < 2;
    if (current && document.activeElement !== by("session")) by("session").value = current;
    by("session").title = by("session").selectedOptions[0]?.text ?? "";
  }

  #file() {
    const { hello } = this.store;
    return hello?.names?.file ?? hello?.sides?.master?.file ?? hello?.sides?.slave?.file;
  }

  #names() {
    const { hello } = this.store;
    const { master, slave } = (hello?.sides?.master ?? hello?.sides?.slave)?.system ?? {};
    const names = { device: master?.device?.driver, robot: slave?.robot?.driver, ...hello?.names, file: this.#file() };
    for (const kind of ["file", "device", "robot", "peer"]) {
      const name = names[kind] ?? "";
      const place = by(`name-${kind}`);
      show(place, kind === "file" ? last(name) : name, name);
      place.title = name;
      place.parentElement.hidden = !name;
    }
    const title = last(names.file);
    document.title = `WeberLink monitor${title ? ` · ${title}` : ""}`;
  }

  #help() {
    const { hello } = this.store;
    const none = this.connected && !hello?.session;
    by("start-help").hidden = !none;
    by("start-here").hidden = !hello?.rooms?.start;
    by("start-there").hidden = Boolean(hello?.rooms?.start);
    document.body.dataset.session = none ? "none" : "some";
  }
}

// Options of a select, as [value, text]; left as they are if they are the same.
export function fill(select, items) {
  const wanted = items.map((item) => item.join("\t")).join("\n");
  if (select.dataset.names === wanted) return;
  const { value } = select;
  select.replaceChildren(...items.map(([name, text]) => new Option(text, name)));
  select.dataset.names = wanted;
  if (items.some(([name]) => name === value)) select.value = value;
}

async function copy(button) {
  const code = button.parentElement.querySelector("code");
  try {
    await navigator.clipboard.writeText(button.dataset.copy);
    button.textContent = "Copied";
  } catch {
    getSelection().selectAllChildren(code); // a page from another host may not write to the clipboard
    button.textContent = "Press Ctrl-C";
  }
  setTimeout(() => {
    button.textContent = "Copy";
  }, 2000);
}
