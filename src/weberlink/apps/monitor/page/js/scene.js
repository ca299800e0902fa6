// The 3-D view: the scene, the hand and the robot with its tool and their trail, the force, and the surface that the
// predictor believes in.

import * as THREE from "../vendor/three.module.min.js";
import { OrbitControls } from "../vendor/orbit_controls.js";
import { SPLASHES, TRAIL_POINTS, actors } from "./actors.js";
import { frame, hit, pixel, seen } from "./aim.js";
import { modelName } from "./names.js";
import { PLANE, SPHERE, patch } from "./patch.js";
import { extent, solids } from "./solids.js";
import { theme } from "./theme.js";

const MM = 1000;
const TRAIL_S = 4;
const LEAST_REACH_MM = 55;
const MM_PER_N = 7;
const ORBIT_STEP = 0.08;
const AXES_M = [
  [0.012, 0, 0],
  [0, 0.012, 0],
  [0, 0, 0.012],
]; // for a tool of which only the orientation is known
const SOFT_INTERVAL_MS = 120; // a software renderer takes processor time from the daemons
const DROP_S = 0.3; // time and height of a packet's fall onto its place
const DROP_MM = 16;
const SPLASH_S = 0.7; // of the ring around a new packet
const FADED = 0.3; // opacity of a packet's mark when it is old
const BETWEEN_ROWS_S = 0.2; // longest time by which marks age without a new row

export class View {
  // Calls `redraw()` when the user turns the view. Throws without WebGL.
  constructor(place, store, redraw) {
    Object.assign(this, { place, store, redraw, reach: LEAST_REACH_MM });
    this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, powerPreference: "low-power" });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.localClippingEnabled = true;
    this.interval = software(this.renderer.getContext()) ? SOFT_INTERVAL_MS : 0;
    this.drawn = -Infinity;
    this.newest = { t: 0, came: 0 }; // row of the last drawing [s], and when it came [ms]
    this.live = false; // another one renders it
    this.aim = null; // where the visitor pulls the hand to [mm]
    this.calm = matchMedia("(prefers-reduced-motion: reduce)");
    place.prepend(this.renderer.domElement);
    this.world = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(32, 1, 1, 5000);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.addEventListener("change", () => this.redraw());
    place.addEventListener("keydown", (event) => this.#key(event));
    const sun = new THREE.DirectionalLight(0xffffff, 2.6);
    sun.position.set(-200, -20, 110);
    this.world.add(sun, new THREE.HemisphereLight(0xffffff, 0x8899aa, 0.9));
    this.solids = new THREE.Group();
    this.world.add(this.solids);
    Object.assign(this, actors());
    this.world.add(this.hand, this.robot, this.tool, this.arrow, this.belief, this.rim, this.trail, this.packets);
    this.world.add(this.splash, this.spring, this.target);
    this.#colour();
    this.#resize();
    this.#look();
    new ResizeObserver(() => {
      this.#resize();
      this.redraw();
    }).observe(place);
  }

  // Takes the scene of the greeting.
  setScene() {
    const scene = this.store.hello?.scene ?? [];
    const points = this.store.tool ?? AXES_M;
    const drawn = JSON.stringify([scene, points]);
    if (drawn === this.shown) return; // the same scene again: keep the user's view
    this.shown = drawn;
    this.reach = Math.max(LEAST_REACH_MM, 1.15 * extent(scene));
    this.tool.geometry.dispose();
    this.tool.geometry = new THREE.BufferGeometry().setFromPoints(
      points.flatMap((each) => [new THREE.Vector3(), new THREE.Vector3(...each).multiplyScalar(MM)]),
    );
    this.#rebuild();
    this.#look();
  }

  restyle() {
    this.#rebuild();
    this.#colour();
  }

  // Draws the state at a time; false if the last drawing is too recent, then call it again later.
  draw(to, now) {
    if (this.live) return true;
    if (now - this.drawn < this.interval) return false;
    this.render(to, now);
    return true;
  }

  // Draws the state at a time, now.
  render(to, now) {
    this.drawn = now;
    if (to !== this.newest.t) this.newest = { t: to, came: now };
    const { master, slave } = this.store.rings;
    const hand = point(master, to, "position") ?? null;
    const robot = point(slave, to, "output") ?? null;
    const here = hand ?? robot;
    place(this.hand, hand);
    place(this.robot, robot);
    this.#turn(robot, this.store.rotates ? point(slave, to, "rotation_output", 1) : null);
    this.#arrow(here, hand ? point(master, to, "output", 1) : point(slave, to, "raw", 1));
    this.#belief(master.empty ? slave : master, to, here);
    this.#spring(hand);
    this.#trail(master.empty ? slave : master, master.empty ? "output" : "position", to);
    this.#packets(slave, to, Math.min(BETWEEN_ROWS_S, (now - this.newest.came) / 1000));
    this.renderer.render(this.world, this.camera);
  }

  // The hand in the newest row [mm]; null while unknown.
  get handle() {
    return point(this.store.rings.master, Infinity, "position");
  }
  plane() {
    return frame(this.#placed());
  }
  hit(at, origin, normal) {
    return hit(this.#placed(), this.renderer.domElement, at, new THREE.Vector3(...origin), normal);
  }
  seen(where) {
    return seen(this.#placed(), this.renderer.domElement, where);
  }
  pixel(where) {
    return pixel(this.#placed(), this.renderer.domElement, where);
  }

  // The camera where it is now, which may be later than the last drawing.
  #placed() {
    this.camera.updateMatrixWorld();
    return this.camera;
  }

  #colour() {
    for (const actor of [this.hand, this.spring, this.target]) actor.material.color.set(theme.master);
    this.robot.material.color.set(theme.slave);
    this.tool.material.color.set(theme.slave);
    this.shaft.material.color.set(theme.text);
    this.belief.material.color.set(theme.model);
    this.rim.material.color.set(theme.model);
    for (const actor of [this.packets, this.splash]) actor.material.color.set(theme.packets);
  }

  #rebuild() {
    this.world.remove(this.solids);
    this.solids.traverse((thing) => {
      thing.geometry?.dispose();
      thing.material?.dispose();
    });
    this.solids = solids(this.store.hello?.scene ?? [], this.reach);
    this.world.add(this.solids);
  }

  #look() {
    const away = this.reach * Math.max(1, 1.02 / this.camera.aspect);
    this.camera.position.set(-0.85 * away, -2.1 * away, 1.3 * away);
    this.controls.target.set(0, 0, 0);
    this.controls.minDistance = 0.3 * this.reach;
    this.controls.maxDistance = 20 * this.reach;
    this.controls.update();
  }

  // `turned` is a rotation vector [rad], from level.
  #turn(at, turned) {
    const { tool } = this;
    tool.visible = at !== null && turned !== null;
    this.place.dataset.turned = tool.visible ? Math.hypot(...turned) : "";
    if (!tool.visible) return;
    const axis = new THREE.Vector3(...turned);
    const angle = axis.length();
    tool.position.set(...at);
    tool.quaternion.setFromAxisAngle(axis.normalize(), angle);
  }

  #arrow(at, force) {
    const size = at && force ? Math.hypot(...force) : 0;
    this.arrow.visible = size > 0.02;
    this.place.dataset.force = size; // [N]
    if (!this.arrow.visible) return;
    const length = Math.max(0.1, MM_PER_N * size);
    this.arrow.position.set(...at);
    this.arrow.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), new THREE.Vector3(...force).normalize());
    this.shaft.scale.y = length;
    this.head.position.y = length;
  }

  #belief(ring, to, here) {
    const row = Math.min(ring.at(to), ring.end - 1);
    const kind = ring.empty || !ring.has("model") ? NaN : ring.columns.model[row];
    const surface = kind === PLANE || kind === SPHERE ? point(ring, to, "surface", kind === PLANE ? 1 : MM) : null;
    const size = surface ? MM * ring.columns.surface_size[row] : NaN;
    const known = surface && here ? patch({ kind, surface, size }, here, 0.3 * this.reach, this.vertices) : null;
    this.belief.visible = this.rim.visible = known !== null;
    if (known) this.belief.geometry.attributes.position.needsUpdate = true;
    caption(kind, size, known ? ring.columns.surface_stiffness?.[row] : NaN);
  }

  // From the hand to where the visitor pulls it: the lag of the hand is visible.
  #spring(hand) {
    const { spring, target, aim } = this;
    spring.visible = target.visible = hand !== null && aim !== null;
    if (!spring.visible) return;
    const way = new THREE.Vector3(...aim).sub(new THREE.Vector3(...hand));
    target.position.set(...aim);
    spring.position.set(...hand);
    spring.scale.y = Math.max(0.01, way.length());
    spring.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), way.normalize());
  }

  #trail(ring, name, to) {
    const { r, g, b } = this.hand.material.color;
    const { position, color } = this.trail.geometry.attributes;
    const count = along(ring, name, to - TRAIL_S, to, (k, x, y, z, age) => {
      position.setXYZ(k, x, y, z);
      color.setXYZW(k, r, g, b, 1 - 0.9 * (age / TRAIL_S));
    });
    position.needsUpdate = color.needsUpdate = true;
    this.trail.geometry.setDrawRange(0, count);
  }

  // The places where the robot sent a packet: each mark falls onto its place and fades. `since` is the age of the newest
  // row [s].
  #packets(slave, to, since) {
    const { sent } = slave.columns;
    const wanted = (row) => sent?.[row] > 0;
    const moves = !this.calm.matches;
    let falling = 0;
    const place = (mesh, most, from, opacity, height) => {
      const { position, color } = mesh.geometry.attributes;
      const put = (k, x, y, z, age) => {
        const above = height(age + since);
        falling += above > 0;
        position.setXYZ(k, x, y, z + above);
        color.setW(k, opacity(age + since));
      };
      mesh.geometry.setDrawRange(0, along(slave, "output", from, to, put, wanted, most));
      position.needsUpdate = color.needsUpdate = true;
    };
    const fall = (age) => (moves && age < DROP_S ? DROP_MM * (1 - (age / DROP_S) ** 2) : 0);
    place(this.packets, TRAIL_POINTS, to - TRAIL_S, (age) => Math.max(FADED, 1 - age / 2), fall);
    const ripple = (age) => (moves && age > DROP_S ? Math.max(0, 1 - (age - DROP_S) / SPLASH_S) : 0);
    place(this.splash, SPLASHES, to - DROP_S - SPLASH_S, ripple, () => 0);
    this.place.dataset.falling = falling;
  }

  #key(event) {
    const turn = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!turn || event.defaultPrevented) return; // the key has moved the handle
    event.preventDefault();
    const arm = this.camera.position.clone().sub(this.controls.target);
    const angles = new THREE.Spherical().setFromVector3(
      arm.clone().applyAxisAngle(new THREE.Vector3(1, 0, 0), -Math.PI / 2),
    );
    angles.theta += ORBIT_STEP * turn[0];
    angles.phi += ORBIT_STEP * turn[1];
    angles.makeSafe();
    arm.setFromSpherical(angles).applyAxisAngle(new THREE.Vector3(1, 0, 0), Math.PI / 2);
    this.camera.position.copy(this.controls.target).add(arm);
    this.controls.update();
    this.redraw();
  }

  #resize() {
    const width = Math.max(1, this.place.clientWidth);
    const height = Math.max(1, this.place.clientHeight);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.renderer.setSize(width, height);
  }
}

function software(gl) {
  const facts = gl.getExtension("WEBGL_debug_renderer_info");
  return facts !== null && /swiftshader|llvmpipe|software/i.test(gl.getParameter(facts.UNMASKED_RENDERER_WEBGL));
}

// A vector of a ring at a time, scaled; null while unknown.
function point(ring, to, name, scale = MM) {
  if (ring.empty || !ring.has(`${name}_z`)) return null;
  const row = Math.min(ring.at(to), ring.end - 1);
  const found = ["x", "y", "z"].map((axis) => scale * ring.columns[`${name}_${axis}`][row]);
  return found.every(Number.isFinite) ? found : null;
}

// Calls `put(k, x, y, z, age)` for the rows between two times, for every n-th one if there are too many.
function along(ring, name, from, to, put, wanted = null, most = TRAIL_POINTS) {
  const { t, [`${name}_x`]: x, [`${name}_y`]: y, [`${name}_z`]: z } = ring.columns;
  if (!z) return 0;
  const end = Math.min(ring.end, ring.at(to) + 1);
  const begin = ring.at(from);
  const step = wanted ? 1 : Math.max(1, Math.ceil((end - begin) / TRAIL_POINTS));
  let k = 0;
  for (let row = begin; row < end && k < most; row += step) {
    if ((wanted && !wanted(row)) || z[row] !== z[row]) continue;
    put(k, MM * x[row], MM * y[row], MM * z[row], to - t[row]);
    k += 1;
  }
  return k;
}

function place(ball, at) {
  ball.visible = at !== null;
  if (at) ball.position.set(...at);
}

function caption(kind, size, stiffness) {
  const text =
    {
      [SPHERE]: `predicted surface: ${size < 0 ? "hollow " : ""}sphere, radius ${Math.abs(size).toFixed(1)} mm`,
      [PLANE]: "predicted surface: plane",
      1: "predicted force: linear extrapolation",
      0: "predicted force: held constant",
    }[kind] ?? "\u00a0";
  const known = Number.isFinite(stiffness) ? `, ${stiffness.toFixed(0)} N/m` : "";
  const element = document.getElementById("model");
  element.textContent = text + known;
  element.dataset.value = kind === kind ? modelName(kind) : "";
}
