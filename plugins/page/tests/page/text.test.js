import assert from "node:assert/strict";
import { test } from "node:test";

import { AS, amount, three } from "../../src/weberlink_page/page/js/format.js";
import { PANELS, padded, upward } from "../../src/weberlink_page/page/js/panels.js";
import { Ring, merge } from "../../src/weberlink_page/page/js/ring.js";

test("three significant digits, without an exponent", () => {
  for (const [value, text] of [[0, "0.00"], [9.994, "9.99"], [9.996, "10.0"], [99.96, "100"], [-12345.6, "\u221212346"], [NaN, "–"], [null, "–"]])
    assert.equal(three(value), text);
});

test("every format has a text for what is unknown", () => {
  for (const [name, text] of Object.entries(AS)) for (const value of [null, undefined, NaN, Infinity]) assert.equal(text(value), "–", name);
});

test("units and factors of the report", () => {
  for (const [name, value, text] of [["count", 12345, "12\u202f345"], ["percent", 0.988, "98.8 %"], ["ms", 320, "0.32 ms"], ["mm", 0.00012, "0.120 mm"], ["degrees", Math.PI, "180.000°"], ["pace", 12.3, "12"], ["rate", 12.3, "12.3 /s"], ["mnm", -0.05, "\u221250.00 mN\u202fm"]])
    assert.equal(AS[name](value), text);
  assert.equal(amount(1234.6, { digits: 0, unit: "/s" }), "1\u202f235 /s");
  assert.equal(amount(NaN, { unit: "N" }), "–");
});

test("ranges hold the data and change rarely", () => {
  for (let high = 0.01; high < 1e4; high *= 1.1) {
    const [low, top] = upward(1)(0, high);
    assert.ok(low === 0 && top >= high && top <= Math.max(1.01, 2.2 * high), `${high}: ${top}`);
    const [under, over] = padded(5)(-high, 2 * high);
    assert.ok(under <= -high && over >= 2 * high);
  }
});

test("every panel has names, a help, and sources that draw a ring without rows of theirs", () => {
  const ring = new Ring(4);
  ring.push([1, 2], { t2: [0, 0] });
  assert.equal(new Set(PANELS.map(({ name }) => name)).size, PANELS.length);
  for (const { name, help, empty, sources, range, choices = [0] } of PANELS) {
    assert.ok(help && empty, name);
    for (const choice of choices) {
      const values = sources(choice, ["gripper"]).map(({ series }) => ({ ring, values: series.map((s) => s.of) }));
      for (const list of merge(values, 0, 9, []).slice(1)) assert.ok(list.every((value) => value === null), name);
      const [low, high] = range(choice)(0, 1);
      assert.ok(low < high, name);
    }
  }
});

test("the force panel has the deadband around the measured force, and a dot for each packet", () => {
  const ring = new Ring(8);
  ring.push([1, 2], { raw: [[3, 3], [4, 4], [0, 0]], bound: [0.5, 6], output: [[0, 0], [0, 0], [5, 5]], sent: [1, 0] });
  const sources = PANELS[0].sources("norm").map(({ series }) => ({ ring, values: series.map((s) => s.of) }));
  const [, raw, high, low, felt, packet] = merge(sources, 0, 9, []);
  assert.deepEqual([raw, high, low, felt, packet], [[5, 5], [5.5, 11], [4.5, 0], [5, 5], [5, null]]);
});

test("a stretch of the timeline is one value in a row", async () => {
  Object.assign(globalThis, {
    matchMedia: () => ({ addEventListener() {} }),
    getComputedStyle: () => ({ color: "" }),
    document: { createElement: () => ({ style: {}, remove() {} }), documentElement: { append() {} } },
  });
  const { stretches } = await import("../../src/weberlink_page/page/js/timeline.js");
  const ring = new Ring(16);
  assert.deepEqual(stretches(ring, "state", 0, 9), []);
  ring.push([0, 1, 2, 3, 4, 5], { state: [2, 2, 4, 4, 4, 5] });
  assert.deepEqual(stretches(ring, "state", 0, 9), [{ value: 2, from: 0, to: 2 }, { value: 4, from: 2, to: 5 }, { value: 5, from: 5, to: 5 }]);
  assert.deepEqual(stretches(ring, "state", 2.5, 3.5), [{ value: 4, from: 2, to: 5 }]); // a row beyond the end
  assert.deepEqual(stretches(ring, "nothing", 0, 9), []);
});
