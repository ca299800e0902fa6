import assert from "node:assert/strict";
import { beforeEach, mock, test } from "node:test";

const listeners = {};
const listen = (kind, act) => (listeners[kind] = act);
Object.assign(globalThis, { addEventListener: listen, document: { hidden: false, addEventListener: listen } });
const { Drive } = await import("../../src/weberlink_page/page/js/drive.js");
const { Latency } = await import("../../src/weberlink_page/page/js/latency.js");

let now, sent, changes, drive, connected;
mock.method(performance, "now", () => now);
beforeEach(() => {
  mock.timers.reset();
  mock.timers.enable({ apis: ["setTimeout"] });
  [now, sent, changes, connected] = [1000, [], 0, true];
  drive = new Drive((message, repeat) => connected && sent.push({ ...message, repeat }) > 0, () => (changes += 1), () => {});
  drive.refuse(null);
});
function pass(ms) {
  for (let k = 0; k < ms; k += 1) {
    now += 1;
    mock.timers.tick(1);
  }
}

test("a hold sends its target at once and repeats it while it lasts", () => {
  assert.ok(drive.grab("pointer", [0, 0, 0.02]));
  assert.deepEqual(sent, [{ type: "drive", target: [0, 0, 0.02], held: true, repeat: true }]);
  pass(260);
  assert.ok(sent.length >= 10 && sent.length <= 12, `${sent.length} in 260 ms`);
  drive.release();
  assert.deepEqual([sent.at(-1).held, sent.at(-1).repeat], [false, false]);
  const count = sent.length;
  pass(200);
  assert.equal(sent.length, count);
});

test("moves are sent at 125 Hz at most, and the last one is never lost", () => {
  drive.grab("pointer", [0, 0, 0]);
  for (let k = 0; k < 100; k += 1) {
    drive.move([0.0001, 0, 0]);
    pass(1);
  }
  pass(10);
  assert.ok(sent.length <= 15, `${sent.length} in 110 ms`);
  assert.ok(Math.abs(sent.at(-1).target[0] - 0.01) < 1e-9);
});

test("nobody holds for as long as it is refused, and a refusal lets go", () => {
  drive.refuse("no session");
  assert.equal(drive.grab("pointer", [0, 0, 0]), false);
  drive.refuse(null);
  assert.equal(drive.grab("pointer", null), false);
  drive.grab("pointer", [0, 0, 0]);
  drive.refuse("the session has ended");
  assert.deepEqual([drive.held, sent.at(-1).held], [false, false]);
});

test("two sources hold until both have let go", () => {
  drive.grab("pointer", [0, 0, 0]);
  drive.grab("keys", [9, 9, 9]);
  assert.deepEqual(drive.target, [0, 0, 0]);
  drive.release("pointer");
  assert.ok(drive.held);
  drive.release("keys");
  assert.equal(sent.at(-1).held, false);
});

test("targets stay in the workspace, and near the handle under rate control", () => {
  drive.half = 0.05;
  drive.grab("pointer", [0, 0, 0]);
  drive.move([1, 0, 0]);
  pass(10);
  assert.deepEqual(sent.at(-1).target, [0.05, 0, 0]);
  drive.release();
  drive.grab("keys", [0, 0, 0]);
  for (let k = 0; k < 100; k += 1) drive.steer([0.01, 0, 0], [0, 0, 0]);
  assert.ok(Math.abs(drive.target[0] - 0.03) < 1e-9);
});

for (const [leaving, event] of [["blur", {}], ["pagehide", {}], ["visibilitychange", {}], ["keydown", { key: "Escape", preventDefault() {}, stopImmediatePropagation() {} }]])
  test(`${leaving} lets go`, () => {
    document.hidden = true;
    drive.grab("pointer", [0, 0, 0]);
    listeners[leaving](event);
    assert.equal(drive.held, false);
  });

test("a lost connection ends the hold", () => {
  drive.grab("pointer", [0, 0, 0]);
  connected = false;
  pass(50);
  assert.deepEqual([drive.held, changes], [false, 2]);
});

test("latency is the time from a step of a resting target to the first row that follows", () => {
  const latency = new Latency();
  assert.ok(Number.isNaN(latency.percentile(0.5)));
  latency.sent([0, 0, 0], true, 0, [0, 0, 0]);
  latency.sent([0, 0, 0.002], true, 200, [0, 0, 0]);
  latency.moved([0, 0, 0.0001], 210); // not far enough
  latency.moved([0, 0.005, 0], 220); // beside
  latency.moved([0, 0, 0.0003], 240);
  latency.moved([0, 0, 0.001], 260); // measured already
  assert.deepEqual(latency.times, [40]);
  latency.sent([0, 0, 0.004], true, 300, [0, 0, 0]); // the target was not at rest
  latency.moved([0, 0, 0.004], 310);
  latency.sent([0, 0, 0.009], true, 600, [0, 0, 0.004]);
  latency.moved([0, 0, 0.004], 1700); // a wall
  latency.moved([0, 0, 0.009], 1701);
  assert.deepEqual(latency.times, [40]);
  latency.times = [5, 1, 2, 3, 4];
  assert.deepEqual([0.5, 0.99].map((share) => latency.percentile(share)), [3, 5]);
});
