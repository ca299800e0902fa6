// The tiles at the top (state, packets, felt error, round trip, faults), and every number that the report has, too.

import { all, by, show } from "./dom.js";
import { AS, ENGAGED, RELEASED, three } from "./format.js";

// The figures of what the operator feels.
const felt = (figures) => figures?.force ?? figures?.joint_torque;
const bar = (name, share) => (by(name).style.transform = `scaleX(${Math.min(1, Math.max(0, share || 0))})`);

export class Tiles {
  constructor(store) {
    this.store = store;
    this.connection = "connecting";
  }

  draw() {
    this.#state();
    this.#packets();
    this.#felt();
    const { rings, ended, figures } = this.store;
    const ring = rings.master.empty ? rings.slave : rings.master;
    const rtt = ended ? figures.figures.link?.rtt_us?.p50 : ring.last("rtt_us");
    show(by("rtt-now"), three((rtt ?? NaN) / 1000), rtt);
    this.#faults();
  }

  #state() {
    const { store } = this;
    const [name, detail] = this.#summary(store.present.map((side) => this.#stateOf(store.rings[side])));
    by("tile-state").dataset.state = name;
    show(by("state"), name === "lost" ? "no monitor" : name, name);
    show(by("state-detail"), detail, detail);
    by("state-detail").title = detail; // where it does not fit
    const seconds = store.ended ? store.figures.figures.duration_s : store.newest;
    show(by("duration"), seconds > 0 ? `${seconds.toFixed(1)} s` : "", seconds || null);
    // Which sides are engaged, and whether the operator holds the button that lets the robot follow.
    const { figures, present, rings } = store;
    const told = figures?.engaged ?? Object.fromEntries(present.map((side) => [side, rings[side].last("state") === ENGAGED]));
    const sides = Object.keys(told).filter((side) => told[side]);
    const running = store.running && !store.stopped;
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
    const finding = store.figures?.finding;
    const sides = new Set(states);
    if (connection === "gone") return ["lost", "connection to the monitor lost; reconnecting"];
    if (store.stopped) return ["stopped", "by the emergency stop"];
    if (store.ended) return ["ended", "these are the final figures"];
    if (!store.hello?.session) return ["no session", "waiting for a session to begin"];
    if (!states.length) return ["connecting", "waiting for the first tick"];
    if (finding && !sides.has("engaged")) return [states[0], finding];
    if (sides.has("released")) return ["released", "hold the button to engage"];
    if (sides.size === 1) return [states[0], states.length === 2 ? "master and slave" : `${store.present[0]} only`];
    const worst = ["silent", "closed", "connecting", "listening", "idle"].find((state) => sides.has(state)) ?? states[0];
    return [worst, store.present.map((side, k) => `${side} ${states[k]}`).join(", ")];
  }

  #packets() {
    const { figures, ended, axes, rate } = this.store;
    const channel = axes ? "joint_torque" : "force";
    const now = ended ? figures.figures[channel]?.packets_per_s : figures?.packets_per_s_now?.[channel];
    const saved = ended ? figures.figures[channel]?.reduction : figures?.reduction_now?.[channel];
    show(by("force-packets-now"), AS.pace(now), now);
    show(by("force-reduction-now"), AS.percent(saved), saved);
    show(by("rate"), AS.count(rate), rate);
    bar("packets-bar", 1 - (saved ?? 1));
  }

  #felt() {
    const { store } = this;
    const deadbands = store.ended ? (felt(store.figures.figures)?.error_p99_deadbands ?? NaN) : store.feltNow();
    show(by("felt-of"), store.ended ? "deadbands, p99" : "deadbands", null);
    show(by("felt-deadbands-now"), AS.number2(deadbands), deadbands);
    bar("felt-bar", deadbands / 2);
    const zone = deadbands > 1 ? "over" : deadbands <= 1 ? "within" : "";
    show(by("felt-zone"), zone && `${zone} 1 deadband`, zone);
    for (const name of ["felt-bar", "felt-zone"]) by(name).classList.toggle("over", zone === "over");
  }

  #faults() {
    const { store } = this;
    const { rings, figures, present } = store;
    const active = present.map((side) => [side, rings[side].last("fault")]).filter(([, fault]) => fault > 0);
    // {"master": {"silence": 1}} as [["master silence", 1]], without faults that never occurred.
    const met = Object.entries(figures?.faults ?? {}).flatMap(([side, named]) =>
      Object.entries(named).flatMap(([name, count]) => (count ? [[`${side} ${name}`, count]] : [])),
    );
    const total = met.reduce((sum, [, count]) => sum + Number(count), 0);
    by("tile-faults").dataset.level = active.length ? "bad" : total ? "warn" : "good";
    const text = active.length ? store.faultName(active[0][1]) : total ? `${total} over` : "none";
    show(by("faults"), text, Math.max(total, active.length));
    const now = active.map(([side, fault]) => `${side}: ${store.faultName(fault)}`);
    const detail = (now.length ? now : met.map(([name, count]) => `${name} ${count}`)).join(", ");
    show(by("faults-detail"), detail || "\u00a0", detail);
  }
}

// Fills every element that names a figure of the report; `felt` stands for the channel that the operator feels, `now` for
// the newest measurements of the link.
/** @param {import("./messages.js").Figures} message */
export function fillFigures(message) {
  const figures = message?.figures && { ...message.figures, felt: felt(message.figures), now: message.ways_now };
  for (const place of all("[data-figure]")) {
    const value = place.dataset.figure.split(".").reduce((inner, key) => inner?.[key], figures);
    show(place, AS[place.dataset.as](value), value);
  }
  const late = message && message.seen_from_start === false;
  show(by("seen-from-start"), late ? "; since the monitor began" : "", message ? String(!late) : null);
}
