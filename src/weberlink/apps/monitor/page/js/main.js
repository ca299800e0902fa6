// The page: puts messages into the store and draws the store, at most 30 times a second.

import { Alarms } from "./alarms.js";
import { ArmTable } from "./arm.js";
import { ARM_PANELS } from "./arm_panels.js";
import { Chart } from "./chart.js";
import { Controls } from "./controls.js";
import "./dismiss.js";
import { Emergency } from "./emergency.js";
import { EventLog } from "./events.js";
import { Headline, fillFigures } from "./headline.js";
import { HISTORY } from "./history.js";
import { Link } from "./link.js";
import { PANELS } from "./panels.js";
import { Paths } from "./paths.js";
import { Recording } from "./record.js";
import { Room } from "./room.js";
import { Sessions } from "./sessions.js";
import { Store } from "./store.js";
import { chooseTheme, chosenTheme, onThemeChange } from "./theme.js";
import { Timeline } from "./timeline.js";
import { Touch } from "./touch.js";
import { PictureView } from "./view.js";

const LEAST_INTERVAL_MS = 1000 / 30;
const IDLE_SHARE = 3; // the page is idle at least this many times as long as a drawing took
const LONGEST_SLICE_MS = 12; // a drawing lets the emergency stop in between
const ALL = "all";

const by = (id) => document.getElementById(id);
const store = new Store();
const link = new Link("ws", receive, connect);
const ask = (message, repeat) => link.send(message, repeat);
const touch = new Touch(store, ask);
const emergency = new Emergency(store, link, () => schedule());
const headline = new Headline(store);
const charts = [...PANELS, ...ARM_PANELS, ...HISTORY].map((panel) => new Chart(panel, store, by("charts")));
charts.push(new Timeline(store, by("charts")));
const arm = new ArmTable(store);
const controls = new Controls(store, ask);
const sessions = new Sessions(store, (name) => link.follow(name));
const room = new Room(store, ask);
const recording = new Recording(store, ask);
const events = new EventLog();
const alarms = new Alarms();
const paths = new Paths();
const picture = new PictureView();
const drawing = { window: 5, paused: null, due: false, again: 0, drawn: 0, rest: 0 };
const inSight = new Set(); // the charts and the scene that are in the window: only these are drawn
let view = null;
let connected = false;

// What each type of message does besides what the store takes from it; others are ignored.
const TAKE = {
  hello: greet,
  figures(message) {
    fillFigures(message);
    alarms.show(message.alarms);
    paths.show(message.paths);
    if (message.ended) emergency.ended();
    if (message.settings || message.ended) refresh();
  },
  answer(message) {
    const { to = "change" } = message;
    if (to === "change") controls.answer(message);
    else if (to === "emergency") emergency.answer(message);
    else if (to === "session") room.answer(message);
    else if (to === "record") recording.answer(message);
  },
  events: (message) => events.take(message.events),
  recording: (message) => recording.take(message),
  launcher: (message) => room.take(message),
};

function connect(state) {
  connected = state === "open";
  document.body.dataset.connection = state;
  headline.connection = state;
  if (connected && drawing.window === ALL) subscribe();
  refresh();
  touch.connection(connected);
  sessions.refresh(connected);
  schedule();
}

function receive(message) {
  const before = store.begun;
  store.take(message);
  if (store.begun !== before) renew();
  TAKE[message.type]?.(message);
  touch.take(message);
  schedule();
}

function greet(hello) {
  link.token = hello.token ?? null;
  document.body.dataset.rotation = String(store.rotates);
  document.body.dataset.arm = String(store.axes !== null);
  arm.build();
  for (const chart of charts) chart.offer?.(store.axes ?? []);
  view?.setScene();
  fillFigures(store.figures);
  picture.follow(hello.view && hello.session ? hello.session : null);
  refresh();
  sessions.refresh(connected);
}

// Another session is shown.
function renew() {
  emergency.clear();
  recording.clear();
  events.clear();
  alarms.show();
  paths.show();
}

function refresh() {
  store.may = connected && link.token !== null;
  controls.refresh(connected);
  for (const part of [room, recording]) part.refresh();
}

function subscribe() {
  link.send({ type: "subscribe", history: drawing.window === ALL });
}

// Requests one drawing, with the next frame after the idle time.
function schedule() {
  drawing.more = true;
  if (drawing.due) return;
  drawing.due = true;
  const wait = drawing.again - performance.now();
  if (wait > 4) setTimeout(() => requestAnimationFrame(draw), wait);
  else requestAnimationFrame(draw);
}

async function draw(now) {
  drawing.more = false;
  let cost = 0;
  try {
    cost = await inSlices(steps(drawing.paused ?? store.newest));
  } finally {
    drawing.drawn += 1;
    drawing.due = false;
    drawing.again = now + Math.max(LEAST_INTERVAL_MS, (1 + IDLE_SHARE) * cost);
    document.body.dataset.drawn = drawing.drawn;
    document.body.dataset.cost = cost.toFixed(1);
    if (drawing.more) schedule();
  }
}

// Runs the parts of a drawing, in several frames if they take long: input comes in between. Returns how long they took [ms].
async function inSlices(parts) {
  let cost = 0;
  let begin = performance.now();
  for (const part of parts) {
    part();
    await null; // a chart draws in the microtask that it has just queued
    touch.drive.beat();
    const slice = performance.now() - begin;
    if (slice < LONGEST_SLICE_MS) continue;
    cost += slice;
    await new Promise(requestAnimationFrame);
    begin = performance.now();
  }
  return cost + performance.now() - begin;
}

// The parts of one drawing.
function steps(newest) {
  const all = drawing.window === ALL;
  const from = all ? 0 : Math.max(0, newest - drawing.window);
  const to = all ? Math.max(1, newest, store.rings.history.newest) : from + drawing.window;
  const only = store.present.length === 1 ? store.present[0] : "master";
  return [
    () => headline.draw(),
    () => arm.draw(newest),
    ...charts.filter(({ body }) => inSight.has(body)).map((chart) => () => {
      chart.prefer?.(only);
      chart.draw(from, to);
    }),
    () => {
      clearTimeout(drawing.rest);
      if (inSight.has(by("scene")) && view?.draw(newest, performance.now()) === false) drawing.rest = setTimeout(schedule, view.interval);
    },
  ];
}

by("pause").addEventListener("click", () => {
  drawing.paused = drawing.paused === null ? store.newest : null;
  const on = drawing.paused !== null;
  by("pause").setAttribute("aria-pressed", String(on));
  by("pause").textContent = on ? "Resume" : "Pause";
  schedule();
});
for (const button of document.querySelectorAll("[data-window]")) {
  button.addEventListener("click", () => {
    const { window: length } = button.dataset;
    const before = drawing.window;
    drawing.window = length === ALL ? ALL : Number(length);
    document.body.dataset.length = length;
    for (const other of document.querySelectorAll("[data-window]"))
      other.setAttribute("aria-pressed", String(other === button));
    if ((before === ALL) !== (drawing.window === ALL)) subscribe();
    schedule();
  });
}
by("theme").value = chosenTheme();
by("theme").addEventListener("change", ({ target }) => chooseTheme(target.value));
onThemeChange(() => {
  for (const chart of charts) chart.restyle();
  view?.restyle();
  schedule();
});

const sight = new IntersectionObserver(
  (entries) => {
    for (const { isIntersecting, target } of entries) isIntersecting ? inSight.add(target) : inSight.delete(target);
    schedule();
  },
  { rootMargin: "50px" },
);
for (const place of [by("scene"), ...charts.map(({ body }) => body)]) sight.observe(place);

refresh();
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
