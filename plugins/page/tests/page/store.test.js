import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import { Store } from "../../src/weberlink_page/page/js/store.js";

let store;
const hello = (more = {}) => store.take({ type: "hello", session: "7", rate_hz: 1000, settings: { weber: 0.1 }, generation: 0, ...more });
const samples = (side, first, count, more = {}) => {
  const k = Array.from({ length: count }, (_, i) => i);
  const columns = { updates_sent: k, datagrams_sent: k.map((v) => 2 * v), lateness_us: k.map((v) => v % 5), work_us: k.map(() => 9), settings: k.map(() => 0) };
  store.take({ type: "samples", side, t: k.map((v) => first + v / 100), columns: { ...columns, ...more } });
};
beforeEach(() => (store = new Store()));

test("another session forgets the rows; a repeated greeting keeps them", () => {
  hello();
  samples("master", 0, 50);
  hello({ present: ["master", "slave"] });
  assert.equal(store.begun, 2);
  assert.deepEqual(store.present, ["master"]);
  hello({ session: "8" });
  assert.equal(store.begun, 3);
  assert.deepEqual([store.present, store.newest], [[], 0]);
});

test("the same session begins again after its end", () => {
  hello();
  store.take({ type: "figures", ended: true, figures: {} });
  assert.equal(store.running, false);
  hello();
  assert.equal(store.running, true);
  assert.equal(store.figures, null);
});

test("rates are those of the last second, whichever rows were left out", () => {
  hello();
  samples("slave", 0, 300);
  const { slaveRates } = store.rings;
  assert.ok(slaveRates.newest > 2.8);
  for (const [name, wanted] of [["updates", 100], ["datagrams", 200], ["late_us", 4], ["work_us", 9]])
    assert.ok(Math.abs(slaveRates.last(name) - wanted) < 1e-9, name);
});

test("a clock that starts again drops the older rows", () => {
  hello();
  samples("master", 50, 20);
  samples("master", 0, 20);
  assert.ok(store.newest < 1);
});

test("a change has the time of the first record with it, whichever comes first", () => {
  const change = () => store.take({ type: "answer", to: "change", accepted: true, settings: { weber: 0.2 }, generation: 1 });
  const rows = () => samples("master", 1, 100, { settings: Array.from({ length: 100 }, (_, k) => Number(k >= 50)) });
  for (const order of [[change, rows], [rows, change]]) {
    store = new Store();
    hello();
    samples("master", 0, 100);
    for (const step of order) step();
    assert.equal(store.changes.length, 1);
    assert.ok(Math.abs(store.changes[0].t - 1.5) < 1e-9 && store.changes[0].exact);
    assert.equal(store.changes[0].label, "k = 0.2");
  }
});

test("settings that are agreed hold once they are in force", () => {
  hello();
  store.take({ type: "answer", to: "change", accepted: true, pending: { weber: 0.3 }, generation: 0, settings: { weber: 0.1 } });
  assert.deepEqual([store.wanted.weber, store.settings.weber], [0.3, 0.1]);
  store.take({ type: "figures", figures: {}, settings: { weber: 0.3 }, generation: 1 });
  assert.deepEqual([store.wanted.weber, store.settings.weber, store.agreed], [0.3, 0.3, null]);
});

test("the felt error is the root mean square of the last second, unknown while none comes", () => {
  hello();
  samples("slave", 0, 250);
  assert.ok(Number.isNaN(store.feltNow()));
  const t = Array.from({ length: 250 }, (_, k) => k / 100);
  store.take({ type: "felt", t, deadbands: t.map((v) => (v < 1 ? 9 : v < 2 ? null : 0.5)), error_n: t, bound_n: t });
  assert.equal(store.feltNow(), 0.5);
  samples("slave", 9, 2);
  assert.ok(Number.isNaN(store.feltNow()));
});

test("names of numbers come from the greeting", () => {
  hello({ states: { 4: "engaged" }, faults: { 2: "link_silent" } });
  assert.deepEqual([store.stateName(4), store.stateName(9), store.faultName(2)], ["engaged", "unknown", "link silent"]);
});
