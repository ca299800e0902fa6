// The tiles at the top: state, packets, felt error, round trip, faults.

import { AS, show, three } from "./format.js";
import { ENGAGED, RELEASED } from "./names.js";

const by = (id) => document.getElementById(id);

export class Headline {
  constructor(store) {
    this.store = store;
    this.connection = "connecting";
  }

  draw() {
    this.#state();
    this.#packets();
    this.#felt();
    this.#delay();
    this.#faults();
  }

  #state() {
    const { store } = this;
    const states = store.present.map((side) => this.#stateOf(store.rings[side]));
    const [name, detail] = this.#summary(states);
    const tile = by("tile-state");
    if (tile.dataset.state !== name) tile.dataset.state = name;
    show(by("state"), name === "lost" ? "no monitor" : name, name);
    show(by("state-detail"), detail, detail);
    if (by("state-detail").title !== detail) by("state-detail").title = detail; // where it does not fit
    const seconds = store.ended ? store.figures.figures.duration_s : store.newest;
    show(by("duration"), seconds > 0 ? `${seconds.toFixed(1)} s` : "", seconds || null);
    this.#engagement();
  }

  // Which sides are engaged, and whether the operator holds the button that lets the robot follow.
  #engagement() {
    const { figures, present, rings, stopped } = this.store;
    const running = this.store.running && !stopped;
    const told = figures?.engaged ?? Object.fromEntries(present.map((side) => [side, rings[side].last("state") === ENGAGED]));
    const sides = Object.keys(told).filter((side) => told[side]);
    const known = running && Object.keys(told).length > 0;
    const text = sides.length === 2 ? "both engaged" : sides.length === 1 ? `${sides[0]} engaged` : "not engaged";
    show(by("engagement"), known ? text : "\u00a0", known ? sides.join(" ") || "none" : null);
    const button = running ? (figures?.button ?? null) : null;
    show(by("hold"), button ? `button ${button}` : "", button);
  }

  #stateOf(ring) {
    const number = ring.last("state");
    return number === ENGAGED && ring.last("ramping") === RELEASED ? "released" : this.store.stateName(number);
  }

  // State of the tile and its explanation, from the states of the sides.
  #summary(states) {
    const { store, connection } = this;
    if (connection === "gone") return ["lost", "connection to the monitor lost; reconnecting"];
    if (store.stopped) return ["stopped", "by the emergency stop"];
    if (store.ended) return ["ended", "these are the final figures"];
    if (!store.hello?.session) return ["no session", "waiting for a session to begin"];
    if (!states.length) return ["connecting", "waiting for the first tick"];
    const finding = store.figures?.finding;
    if (finding && !states.includes("engaged")) return [states[0], finding];
    const where = store.present.length === 2 ? "master and slave" : `${store.present[0]} only`;
    const sides = new Set(states);
    if (sides.has("released")) return ["released", "hold the button to engage"];
    if (sides.size === 1) return [states[0], where];
    const order = ["silent", "closed", "connecting", "listening", "idle", "engaged"];
    const worst = order.find((state) => sides.has(state)) ?? states[0];
    return [worst, store.present.map((side, k) => `${side} ${states[k]}`).join(", ")];
  }

  #packets() {
    const { figures, ended } = this.store;
    const channel = this.store.axes ? "joint_torque" : "force";
    const now = ended ? figures?.figures?.[channel]?.packets_per_s : figures?.packets_per_s_now?.[channel];
    const saved = ended ? figures?.figures?.[channel]?.reduction : figures?.reduction_now?.[channel];
    show(by("force-packets-now"), AS.pace(now), now);
    show(by("force-reduction-now"), AS.percent(saved), saved);
    show(by("rate"), AS.count(this.store.rate), this.store.rate);
    by("packets-bar").style.transform = `scaleX(${Math.min(1, Math.max(0, 1 - (saved ?? 1)))})`;
  }

  #felt() {
    const { store } = this;
    const deadbands = store.ended ? (felt(store.figures.figures)?.error_p99_deadbands ?? NaN) : store.feltNow();
    show(by("felt-of"), store.ended ? "deadbands, p99" : "deadbands", null);
    show(by("felt-deadbands-now"), Number.isFinite(deadbands) ? deadbands.toFixed(2) : "–", deadbands);
    by("felt-bar").style.transform = `scaleX(${Number.isFinite(deadbands) ? Math.min(1, deadbands / 2) : 0})`;
    const zone = deadbands > 1 ? "over" : deadbands <= 1 ? "within" : "";
    show(by("felt-zone"), zone && `${zone} 1 deadband`, zone);
    for (const name of ["felt-bar", "felt-zone"]) by(name).classList.toggle("over", zone === "over");
  }

  #delay() {
    const { rings, ended, figures } = this.store;
    const ring = rings.master.empty ? rings.slave : rings.master;
    const rtt = ended ? figures.figures?.link?.rtt_us?.p50 : ring.last("rtt_us");
    show(by("rtt-now"), three(rtt === null ? NaN : rtt / 1000), rtt);
  }

  #faults() {
    const { store } = this;
    const { rings, figures, present } = store;
    const active = present.map((side) => [side, rings[side].last("fault")]).filter(([, fault]) => fault > 0);
    const met = counts(figures?.faults);
    const total = Object.values(met).reduce((sum, count) => sum + count, 0);
    by("tile-faults").dataset.level = active.length ? "bad" : total ? "warn" : "good";
    const text = active.length ? store.faultName(active[0][1]) : total ? `${total} over` : "none";
    show(by("faults"), text, Math.max(total, active.length));
    const told = Object.entries(met)
      .map(([name, count]) => `${name} ${count}`)
      .join(", ");
    const now = active.map(([side, fault]) => `${side}: ${store.faultName(fault)}`).join(", ");
    show(by("faults-detail"), now || told || "\u00a0", now || told);
  }
}

// {"master": {"silence": 1}} as {"master silence": 1}, without faults that never occurred.
function counts(faults) {
  const flat = {};
  for (const [side, named] of Object.entries(faults ?? {})) {
    for (const [name, count] of Object.entries(named ?? {})) if (count) flat[`${side} ${name}`] = count;
  }
  return flat;
}

// The figures of what the operator feels.
const felt = (figures) => figures?.force ?? figures?.joint_torque;

// Fills every element that names a figure of the report; `felt` stands for the channel that the operator feels, `now` for
// the newest measurements of the link.
export function fillFigures(message) {
  const figures = message?.figures && { ...message.figures, felt: felt(message.figures), now: message.ways_now };
  for (const place of document.querySelectorAll("[data-figure]")) {
    const value = place.dataset.figure.split(".").reduce((inner, key) => inner?.[key], figures);
    show(place, AS[place.dataset.as](value), value);
  }
  const late = message && message.seen_from_start === false;
  show(
    by("seen-from-start"),
    late ? "; since the monitor began" : "",
    message ? String(message.seen_from_start !== false) : null,
  );
}
