import assert from "node:assert/strict";
import { test } from "node:test";

import { Ring, merge } from "../../src/weberlink_page/page/js/ring.js";

const times = (first, count) => Array.from({ length: count }, (_, k) => first + k);

test("a ring keeps the newest rows, in ascending order and without repeats", () => {
  const ring = new Ring(10);
  for (let first = 0; first < 100; first += 7) ring.push(times(first, 9), { v: times(10 * first, 9) }); // two rows again
  const kept = [...ring.columns.t.slice(ring.begin, ring.end)];
  assert.equal(kept.length, 10);
  assert.deepEqual(kept, times(ring.newest - 9, 10));
  assert.equal(ring.newest, 106);
  assert.equal(ring.oldest, 97);
});

test("more rows than the capacity leave the last ones", () => {
  const ring = new Ring(4);
  assert.equal(ring.push(times(0, 50), { v: times(0, 50) }), 4);
  assert.deepEqual([...ring.columns.v.slice(ring.begin, ring.end)], [46, 47, 48, 49]);
});

test("vectors are a column for each axis; what is unknown is not a number", () => {
  const ring = new Ring(8);
  ring.push([1, 2], { output: [[1, 2], [3, 4], [5, null]], raw: [[7, 8], [9, 10]], sent: [0, null] });
  assert.deepEqual([ring.last("output_0"), ring.last("output_1"), ring.last("output_2")], [2, 4, NaN]);
  assert.deepEqual([ring.last("raw_0"), ring.last("raw_1")], [8, 10]);
  assert.ok(Number.isNaN(ring.last("sent")) && Number.isNaN(ring.last("nothing")));
});

test("a column that comes later is unknown before", () => {
  const ring = new Ring(8);
  ring.push([1], { a: [1] });
  ring.push([2], { a: [2], b: [5] });
  assert.deepEqual([...ring.columns.b.slice(ring.begin, ring.end)], [NaN, 5]);
});

test("a row is found by its time", () => {
  const ring = new Ring(8);
  ring.push([1, 2, 4], { v: [10, 20, 40] });
  assert.deepEqual([0, 1, 1.5, 4, 9].map((t) => ring.at(t) - ring.begin), [0, 0, 1, 2, 3]);
  assert.deepEqual([0, 2, 3, 9].map((t) => ring.value("v", t)), [10, 20, 40, 40]);
  assert.ok(Number.isNaN(new Ring(2).value("v", 0)));
});

test("rings are merged on one time line", () => {
  const [one, other] = [new Ring(8), new Ring(8)];
  one.push([1, 2, 3], { v: [1, null, 3] });
  other.push([2, 2.5], { v: [20, 25] });
  const values = [(c, i) => c.v[i]];
  const made = merge([{ ring: one, values }, { ring: other, values }], 0, 10, []);
  assert.deepEqual(made, [[1, 2, 2.5, 3], [1, null, undefined, 3], [undefined, 20, 25, undefined]]);
  assert.deepEqual(merge([{ ring: one, values }], 2.5, 10, made).map((list) => list.length), [2, 2, 2]); // one row before
});
