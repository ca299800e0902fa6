// From the picture to the scene and back: the plane on which a pointer moves the handle. Lengths in millimetres.

import * as THREE from "../vendor/three.module.min.js";

const STEEPEST = Math.cos(Math.PI / 3);
const UP = new THREE.Vector3(0, 0, 1);

// Unit vectors of a drag: `right` and `up` span its plane, `away` is depth. The plane is vertical and faces the camera,
// so that a drag downwards presses on what lies below; a camera that looks down by more than 60 degrees gets the plane
// parallel to its picture.
export function frame(camera) {
  const forward = camera.getWorldDirection(new THREE.Vector3());
  const level = new THREE.Vector3(forward.x, forward.y, 0);
  const steep = level.length() < STEEPEST;
  const away = steep ? forward : level.normalize();
  const right = new THREE.Vector3().crossVectors(away, UP);
  if (right.length() < 1e-6) right.setFromMatrixColumn(camera.matrixWorld, 0);
  right.normalize();
  return { right, up: new THREE.Vector3().crossVectors(right, away), away };
}

// Where a point of the scene is seen [px of the window].
export function seen(camera, canvas, point) {
  const box = canvas.getBoundingClientRect();
  const { x, y } = new THREE.Vector3(...point).project(camera);
  return [box.left + 0.5 * (1 + x) * box.width, box.top + 0.5 * (1 - y) * box.height];
}

// Where the line of sight through a pixel of the window meets the plane through `origin`; null beside it.
export function hit(camera, canvas, [x, y], origin, normal) {
  const box = canvas.getBoundingClientRect();
  const spot = new THREE.Vector2((2 * (x - box.left)) / box.width - 1, 1 - (2 * (y - box.top)) / box.height);
  const caster = new THREE.Raycaster();
  caster.setFromCamera(spot, camera);
  const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(normal, origin);
  return caster.ray.intersectPlane(plane, new THREE.Vector3());
}

// Size of a pixel at a point of the scene [mm].
export function pixel(camera, canvas, point) {
  const far = new THREE.Vector3(...point).sub(camera.position).dot(camera.getWorldDirection(new THREE.Vector3()));
  return (2 * far * Math.tan((camera.fov * Math.PI) / 360)) / Math.max(1, canvas.clientHeight);
}
