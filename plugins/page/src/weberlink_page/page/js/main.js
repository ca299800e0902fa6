// The page: puts messages into the store and draws the store, at most 30 times a second.

import { Recording, Room, Sessions } from "./bar.js";
import { Alarms, ArmTable, EventLog, showPaths } from "./book.js";
import { Camera } from "./camera.js";
import { Chart } from "./chart.js";
import { Controls } from "./controls.js";
import { all, by, element, press } from "./dom.js";
import { Emergency } from "./emergency.js";
import { Link } from "./link.js";
import { PANELS } from "./panels.js";
import { Store } from "./store.js";
import { onThemeChange } from "./theme.js";
import { Tiles, fillFigures } from "./tiles.js";
import { Timeline } from "./timeline.js";
import { Touch } from "./touch.js";

const LEAST_INTERVAL_MS = 1000 / 30;
const IDLE_SHARE = 3; // the page is idle at least this many times as long as a drawing took
const LONGEST_SLICE_MS = 12; // a drawing lets the emergency stop in between

const store = new Store();
const link = new Link("ws", receive, connect);
/** @type {Link["send"]} */
const send = (message, repeat) => link.send(message, repeat);
const touch = new Touch(store, send);
const emergency = new Emergency(store, link, () => schedule());
const tiles = new Tiles(store);
const charts = [...PANELS.map((panel) => new Chart(panel, store, by("charts"))), new Timeline(store, by("charts"))];
const arm = new ArmTable(store);
const controls = new Controls(store, send);
const sessions = new Sessions(store, (name) => link.follow(name));
const room = new Room(store, send);
const recording = new Recording(store, send);
const events = new EventLog();
const alarms = new Alarms();
const camera = new Camera(() => Number(store.figures?.ways_now?.to_master?.one_way_us ?? NaN) / 1000);
const drawing = { window: 5, paused: null, due: false, more: false, again: 0, drawn: 0, rest: 0 };
const inSight = new Set(); // the charts and the scene that are in the window: only these are drawn
let [view, connected] = [null, false];

function connect(state) {
  connected = state === "open";
  document.body.dataset.connection = state;
  tiles.connection = state;
  refresh();
  touch.connection(connected);
  sessions.refresh(connected);
  schedule();
}

// What each type of message does besides what the store takes from it; others are ignored.
/** @param {import("./messages.js").Message} message */
function receive(message) {
  const before = store.begun;
  store.take(message);
  if (store.begun !== before) renew();
  if (message.type === "hello") greet(message);
  if (message.type === "figures") {
    fillFigures(message);
    alarms.show(message.alarms);
    showPaths(message.paths);
    if (message.ended) emergency.ended();
    if (message.settings || message.ended) refresh();
  }
  if (message.type === "answer") ({ session: room, record: recording, emergency }[message.to] ?? controls).answer(message);
  if (message.type === "events") events.take(message.events);
  if (message.type === "recording") recording.take(message);
  if (message.type === "launcher") room.take(message);
  touch.take(message);
  schedule();
}

/** @param {import("./messages.js").Hello} hello */
function greet(hello) {
  link.token = hello.token;
  document.body.dataset.rotation = String(store.rotates);
  document.body.dataset.arm = String(store.axes !== null);
  arm.build();
  for (const chart of charts) if (chart instanceof Chart) chart.offer(store.axes ?? []);
  view?.setScene();
  fillFigures(store.figures);
  camera.follow(hello.view && hello.session ? hello.session : null);
  refresh();
  sessions.refresh(connected);
}

// Another session is shown.
function renew() {
  for (const part of [emergency, recording, events]) part.clear();
  alarms.show();
  showPaths();
}

function refresh() {
  store.may = connected && link.token !== null;
  controls.refresh(connected);
  for (const part of [room, recording]) part.refresh();
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
    document.body.dataset.drawn = String(drawing.drawn);
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
  const from = Math.max(0, newest - drawing.window);
  const only = store.present.length === 1 ? store.present[0] : "master";
  return [
    () => tiles.draw(),
    () => arm.draw(newest),
    ...charts.filter(({ body }) => inSight.has(body)).map((chart) => () => chart.draw(from, from + drawing.window, only)),
    () => {
      clearTimeout(drawing.rest);
      const drawn = !inSight.has(by("scene")) || (view?.draw(newest, performance.now()) ?? true);
      if (!drawn) drawing.rest = window.setTimeout(schedule, view.interval);
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
for (const button of all("[data-window]"))
  button.addEventListener("click", () => {
    drawing.window = Number(button.dataset.window);
    press(button, all("[data-window]"));
    schedule();
  });
onThemeChange(() => {
  for (const { plot } of charts) plot.redraw();
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
  const text = "The 3-D view needs WebGL, which this browser does not offer. All figures and charts work without it.";
  by("scene").replaceChildren(element("p", { className: "missing" }, text));
  by("scene").dataset.value = "missing";
  by("scene").title = String(error);
}
