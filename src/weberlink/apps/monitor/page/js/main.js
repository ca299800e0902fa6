// The page: puts messages into the store and draws the store, at most 30 times a second.

import { Chart } from "./chart.js";
import { Controls } from "./controls.js";
import { Headline, fillFigures } from "./headline.js";
import { Link } from "./link.js";
import { PANELS } from "./panels.js";
import { Store } from "./store.js";
import { onThemeChange } from "./theme.js";
import { Timeline } from "./timeline.js";
import { Touch } from "./touch.js";

const LEAST_INTERVAL_MS = 1000 / 30;
const IDLE_SHARE = 3; // the page is idle at least this many times as long as a drawing took
const SESSIONS_EVERY_MS = 4000;

const by = (id) => document.getElementById(id);
const store = new Store();
const touch = new Touch(store, (message) => link.send(message));
const headline = new Headline(store);
const charts = PANELS.map((panel) => new Chart(panel, store, by("charts")));
charts.push(new Timeline(store, by("charts")));
const controls = new Controls(store, (message) => link.send(message));
const drawing = { window: 5, paused: null, due: false, again: 0, drawn: 0, rest: 0 };
let view = null;
let connected = false;

const link = new Link(receive, (state) => {
  connected = state === "open";
  document.body.dataset.connection = state;
  headline.connection = state;
  controls.refresh(connected);
  touch.connection(connected);
  if (connected) listSessions();
  schedule();
});

function receive(message) {
  store.take(message);
  if (message.type === "hello") greet(message);
  if (message.type === "figures") {
    fillFigures(message);
    if (message.settings || message.ended) controls.refresh(connected);
  }
  if (message.type === "answer") controls.answer(message);
  touch.take(message);
  schedule();
}

function greet(hello) {
  document.body.dataset.rotation = String(store.rotates);
  view?.setScene();
  controls.refresh(connected);
  fillFigures(store.figures);
  const title = [hello.sides?.master, hello.sides?.slave].find(Boolean)?.file;
  document.title = `WeberLink monitor${title ? ` · ${title.split("/").pop()}` : ""}`;
  listSessions();
}

// Requests one drawing, with the next frame after the idle time.
function schedule() {
  if (drawing.due) return;
  drawing.due = true;
  const wait = drawing.again - performance.now();
  if (wait > 4) setTimeout(() => requestAnimationFrame(draw), wait);
  else requestAnimationFrame(draw);
}

function draw(now) {
  drawing.due = false;
  const begin = performance.now();
  headline.draw();
  const newest = drawing.paused ?? store.newest;
  const from = Math.max(0, newest - drawing.window);
  const only = store.present.length === 1 ? store.present[0] : "master";
  for (const chart of charts) {
    if (chart.panel?.when?.(store) === false) continue;
    chart.prefer?.(only);
    chart.draw(from, from + drawing.window);
    touch.drive.beat();
  }
  const whole = view?.draw(newest, begin) ?? true;
  drawing.drawn += 1;
  const cost = performance.now() - begin;
  drawing.again = now + Math.max(LEAST_INTERVAL_MS, (1 + IDLE_SHARE) * cost);
  document.body.dataset.drawn = drawing.drawn;
  document.body.dataset.cost = cost.toFixed(1);
  clearTimeout(drawing.rest);
  if (!whole) drawing.rest = setTimeout(schedule, view.interval);
}

async function listSessions() {
  let names = [];
  try {
    const { sessions } = await (await fetch("api/sessions")).json();
    names = sessions.map(({ session }) => session);
  } catch {
    return; // the tile of the state shows the lost connection
  }
  const select = by("session");
  const current = store.hello?.session ?? "";
  if (current && !names.includes(current)) names.push(current);
  const wanted = names.join("\n");
  if (select.dataset.names !== wanted) {
    select.replaceChildren(...(names.length ? names : ["none"]).map((name) => new Option(name, name)));
    select.dataset.names = wanted;
  }
  select.disabled = names.length < 2;
  if (current && document.activeElement !== select) select.value = current;
}

by("session").addEventListener("change", (event) => {
  event.target.blur();
  link.follow(event.target.value);
});
by("pause").addEventListener("click", () => {
  drawing.paused = drawing.paused === null ? store.newest : null;
  const on = drawing.paused !== null;
  by("pause").setAttribute("aria-pressed", String(on));
  by("pause").textContent = on ? "Resume" : "Pause";
  schedule();
});
for (const button of document.querySelectorAll("[data-window]")) {
  button.addEventListener("click", () => {
    drawing.window = Number(button.dataset.window);
    for (const other of document.querySelectorAll("[data-window]"))
      other.setAttribute("aria-pressed", String(other === button));
    schedule();
  });
}
onThemeChange(() => {
  for (const chart of charts) chart.restyle();
  view?.restyle();
  schedule();
});
setInterval(() => {
  if (connected) listSessions();
}, SESSIONS_EVERY_MS);

controls.refresh(false);
link.follow(null);
schedule();
try {
  if (!document.createElement("canvas").getContext("webgl2")) throw new Error("no WebGL 2");
  const { View } = await import("./scene.js");
  view = new View(by("scene"), store, schedule);
  view.setScene();
  touch.attach(view);
  by("scene").dataset.value = "webgl";
} catch (error) {
  const note = document.createElement("p");
  note.className = "missing";
  note.textContent =
    "The 3-D view needs WebGL, which this browser does not offer. All figures and charts work without it.";
  by("scene").replaceChildren(note);
  by("scene").dataset.value = "missing";
  by("scene").title = String(error);
}
