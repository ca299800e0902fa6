// The data of one session: messages of the server, and what is computed from them. Draws nothing.

import { Ring } from "./ring.js";

const LONGEST_WINDOW_S = 60;
const ROWS_PER_S = 330; // 250, and the rows that sent an update
const RATE_SPAN_S = 1;
const RATE_STEP_S = 0.1;
const NEAR_S = 1.5; // largest time between a change and the first record with it
const COUNTED = ["updates_sent", "datagrams_sent", "lateness_us", "work_us"];

export class Store {
  constructor() {
    const [rows, steps] = [LONGEST_WINDOW_S * ROWS_PER_S, (2 * LONGEST_WINDOW_S) / RATE_STEP_S];
    /** @type {Record<string, Ring>} */
    this.rings = { master: new Ring(rows), slave: new Ring(rows), felt: new Ring(rows), masterRates: new Ring(steps), slaveRates: new Ring(steps) };
    this.may = false; // whether this page may change anything now
    this.begun = 0; // how many sessions were shown
    this.forget();
  }

  forget() {
    this.begun += 1;
    for (const ring of Object.values(this.rings)) ring.clear();
    /** @type {import("./messages.js").Hello} */
    this.hello = null;
    /** @type {import("./messages.js").Figures} */
    this.figures = null;
    this.changes = []; // {t, label}: live changes, as marks in the charts
    this.switched = -Infinity; // time of the last change of settings in the records
    this.settings = {}; // in force
    this.agreed = null; // {generation, settings}: agreed by both ends, and in force from a later tick on
    this.ended = false;
    this.stopped = false; // by the emergency stop of this page
  }

  get running() {
    return Boolean(this.hello?.session) && !this.ended;
  }
  get newest() {
    return Math.max(0, this.rings.master.newest, this.rings.slave.newest);
  }
  get rate() {
    return this.hello?.rate_hz ?? 1000;
  }
  // Whether the session has torque and orientation, too.
  get rotates() {
    return Boolean(this.description?.torque_bank);
  }
  // Names of the axes of an arm that is led joint by joint; null in a Cartesian session.
  get axes() {
    return this.hello?.axes ?? null;
  }
  // The points of the robot's tool from its tip [m], where they are known.
  get tool() {
    return this.description?.system?.slave?.robot?.tool?.points_m;
  }
  /** @returns {any} */
  get description() {
    return this.hello?.sides?.master ?? this.hello?.sides?.slave;
  }

  get file() {
    return this.hello?.names?.file ?? this.hello?.sides?.master?.file ?? this.hello?.sides?.slave?.file;
  }

  // Names of the numbers in a record, as the greeting lists them.
  stateName(number) {
    return this.hello?.states?.[number] ?? "unknown";
  }
  faultName(number) {
    return this.hello?.faults?.[number]?.replaceAll("_", " ") ?? "unknown";
  }

  // Settings in force, or agreed and about to be.
  get wanted() {
    return { ...this.settings, ...this.agreed?.settings };
  }

  // The sides with at least one row.
  get present() {
    return ["master", "slave"].filter((side) => !this.rings[side].empty);
  }

  // Takes one message of the server; ignores those of a type that this page does not know.
  /** @param {import("./messages.js").Message} message */
  take(message) {
    if (message.type === "hello") this.#greet(message);
    if (message.type === "samples") this.#samples(message);
    if (message.type === "felt") {
      const { t, deadbands, error_n, bound_n } = message;
      this.rings.felt.push(t, { deadbands, error_n, bound_n });
    }
    if (message.type === "figures") {
      this.figures = message;
      this.ended = Boolean(message.ended);
    }
    if (message.type === "answer" && message.accepted && message.pending)
      this.agreed = { generation: message.generation, settings: message.pending };
    if ((message.type === "answer" || message.type === "figures") && message.settings)
      this.#adopt(message.settings, message.generation);
  }

  #greet(hello) {
    const same = this.hello && !this.ended && this.hello.session === hello.session;
    if (!same) this.forget();
    this.hello = hello;
    this.ended = false;
    if (hello.settings) same ? this.#adopt(hello.settings, hello.generation) : (this.settings = { ...hello.settings });
  }

  #samples({ side, t, columns }) {
    const ring = this.rings[side];
    if (!ring || !t.length) return;
    if (t[t.length - 1] < ring.newest - 1) this.#rewind(); // the clock of the session has started again
    ring.push(t, columns);
    this.#switch(ring, t.length);
    this.#rates(ring, this.rings[`${side}Rates`]);
  }

  // The rows that come next are older than those that are here.
  #rewind() {
    for (const ring of Object.values(this.rings)) ring.clear();
  }

  // Every 0.1 s: packets and datagrams per second over the last second, from the counters, which omitted rows do not
  // change; the slowest tick of the last 0.1 s.
  #rates(ring, rates) {
    const { t } = ring.columns;
    if (!COUNTED.every((name) => ring.has(name))) return;
    const { updates_sent: updates, datagrams_sent: datagrams, lateness_us: late, work_us: work } = ring.columns;
    const { second_updates_sent: gripper } = ring.columns;
    let time = Math.max(rates.newest + RATE_STEP_S, ring.oldest + RATE_STEP_S);
    for (; time <= ring.newest; time += RATE_STEP_S) {
      const end = Math.min(ring.at(time), ring.end - 1);
      const begin = ring.at(Math.max(ring.oldest, t[end] - RATE_SPAN_S));
      const span = t[end] - t[begin];
      if (!(span > 0.2)) continue;
      rates.push([time], {
        updates: [(updates[end] - updates[begin]) / span],
        datagrams: [(datagrams[end] - datagrams[begin]) / span],
        gripper: [gripper ? (gripper[end] - gripper[begin]) / span : NaN],
        late_us: [largest(late, ring.at(time - RATE_STEP_S), end)],
        work_us: [largest(work, ring.at(time - RATE_STEP_S), end)],
      });
    }
  }

  // The first record with new settings has the exact time of a change; the message about it may come before or after.
  #switch(ring, count) {
    const { t, settings } = ring.columns;
    if (!settings) return;
    for (let i = Math.max(ring.begin + 1, ring.end - count); i < ring.end; i += 1) {
      if (settings[i] === settings[i - 1] || t[i] - this.switched < NEAR_S) continue;
      this.switched = t[i];
      const change = this.changes.at(-1);
      if (change && !change.exact && Math.abs(change.t - t[i]) < NEAR_S)
        Object.assign(change, { t: t[i], exact: true });
    }
  }

  #adopt(settings, generation) {
    if (this.agreed && generation !== this.agreed.generation) this.agreed = null;
    const changed = Object.entries(settings).filter(
      ([name, value]) => this.settings[name] !== undefined && this.settings[name] !== value,
    );
    this.settings = { ...this.settings, ...settings };
    if (!changed.length) return;
    const label = changed.map(([name, value]) => (name === "weber" ? `k = ${value}` : `${value}`)).join(", ");
    const exact = this.newest - this.switched < NEAR_S && this.changes.at(-1)?.t !== this.switched;
    this.changes.push({ t: exact ? this.switched : this.newest, label, exact });
  }

  // Root mean square of the felt error over the last second, in deadbands; NaN while unknown.
  feltNow(span = 1) {
    const { felt } = this.rings;
    if (felt.empty || felt.newest < this.newest - 2 * span) return NaN;
    const { deadbands } = felt.columns;
    let [sum, count] = [0, 0];
    for (let i = felt.at(felt.newest - span); i < felt.end; i += 1) {
      if (deadbands[i] === deadbands[i]) {
        sum += deadbands[i] * deadbands[i];
        count += 1;
      }
    }
    return count ? Math.sqrt(sum / count) : NaN;
  }
}

function largest(values, begin, end) {
  let found = NaN;
  for (let i = begin; i <= end; i += 1) if (values[i] === values[i] && !(values[i] <= found)) found = values[i];
  return found;
}
