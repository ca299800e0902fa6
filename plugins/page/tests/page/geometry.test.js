import assert from "node:assert/strict";
import { test } from "node:test";

import * as THREE from "../../src/weberlink_page/page/vendor/three.module.min.js";
import { frame, hit, pixel, seen } from "../../src/weberlink_page/page/js/aim.js";
import { PLANE, RINGS, SPHERE, SPOKES, patch, ribs, triangles } from "../../src/weberlink_page/page/js/patch.js";

const near = (a, b, tolerance = 1e-6) => a.every((value, k) => Math.abs(value - b[k]) < tolerance);
const CANVAS = { getBoundingClientRect: () => ({ left: 10, top: 20, width: 400, height: 300 }), clientHeight: 300 };

function camera(...at) {
  const made = new THREE.PerspectiveCamera(32, 4 / 3, 1, 5000);
  made.up.set(0, 0, 1);
  made.position.set(...at);
  made.lookAt(0, 0, 0);
  made.updateMatrixWorld();
  return made;
}

function vertices(surface, point, reach) {
  const flat = patch(surface, point, reach, new Float32Array(3 * (RINGS + 1) * SPOKES));
  return flat && Array.from({ length: flat.length / 3 }, (_, k) => [...flat.slice(3 * k, 3 * k + 3)]);
}

test("the patch of a plane lies in it, around the foot of the point", () => {
  const made = vertices({ kind: PLANE, surface: [0, 0, 1], size: -2 }, [3, 4, 9], 10);
  assert.ok(made.every(([x, y, z]) => Math.abs(z - 2) < 1e-4 && Math.hypot(x - 3, y - 4) < 10.001));
  assert.ok(near(made[0], [3, 4, 2], 1e-4));
});

for (const size of [20, -20])
  test(`the patch of a sphere of size ${size} lies on it, and reaches along it`, () => {
    const made = vertices({ kind: SPHERE, surface: [1, 2, 3], size }, [1, 2, 50], 10);
    for (const [x, y, z] of made) assert.ok(Math.abs(Math.hypot(x - 1, y - 2, z - 3) - 20) < 1e-3);
    const angle = Math.acos((made.at(-1)[2] - 3) / 20);
    assert.ok(Math.abs(20 * angle - 10) < 1e-3);
  });

test("what is no surface has no patch", () => {
  for (const wrong of [{ kind: 0 }, { kind: PLANE, surface: [0, 0, 0], size: 1 }, { kind: SPHERE, surface: [0, 0, 0], size: 0 }, { kind: SPHERE, surface: [0, 0, 0], size: NaN }])
    assert.equal(vertices(wrong, [0, 0, 1], 5), null);
});

test("faces and ribs of a patch use vertices that are there", () => {
  for (const indices of [triangles(), ribs()]) assert.ok(indices.every((k) => k >= 0 && k < (RINGS + 1) * SPOKES));
  assert.equal(triangles().length, 6 * RINGS * SPOKES);
});

test("the plane of a drag is vertical and faces the camera, or the picture from above", () => {
  const level = frame(camera(0, -200, 60));
  assert.ok(near(level.up.toArray(), [0, 0, 1]) && near(level.right.toArray(), [1, 0, 0]) && near(level.away.toArray(), [0, 1, 0]));
  const above = frame(camera(0, -10, 200));
  assert.ok(above.away.z < -0.9 && Math.abs(above.up.z) < 0.2);
  for (const { right, up, away } of [level, above])
    for (const [a, b] of [[right, up], [up, away], [right, away]]) assert.ok(Math.abs(a.dot(b)) < 1e-9);
});

test("a pixel hits the plane where it is seen", () => {
  const eye = camera(-85, -210, 130);
  const { away } = frame(eye);
  const point = new THREE.Vector3(12, 5, -7);
  const found = hit(eye, CANVAS, seen(eye, CANVAS, point.toArray()), point, away);
  assert.ok(near(found.toArray(), point.toArray(), 1e-6));
});

test("the size of a pixel is that of a step beside it", () => {
  const eye = camera(0, -300, 0);
  const [x, y] = seen(eye, CANVAS, [0, 0, 0]);
  const [there] = [hit(eye, CANVAS, [x, y - 10], new THREE.Vector3(), frame(eye).away)];
  assert.ok(Math.abs(there.z - 10 * pixel(eye, CANVAS, [0, 0, 0])) < 1e-6);
});
