// The 3-D view: the scene, the hand and the robot with its tool and their trail, the force, and the surface that the
// predictor believes in. Lengths in millimetres.

import * as THREE from "../vendor/three.module.min.js";
import { OrbitControls } from "../vendor/orbit_controls.js";
import { frame, hit, pixel, seen } from "./aim.js";
import { by, show } from "./dom.js";
import { modelName } from "./format.js";
import { PLANE, RINGS, SPHERE, SPOKES, patch, ribs, triangles } from "./patch.js";
import { extent, solids } from "./solids.js";
import { theme } from "./theme.js";

const MM = 1000;
const TRAIL_S = 4;
const TRAIL_POINTS = 1400;
const LEAST_REACH_MM = 55;
const MM_PER_N = 7;
const AXES_M = [[0.012, 0, 0], [0, 0.012, 0], [0, 0, 0.012]]; // for a tool of which only the orientation is known
const SOFT_INTERVAL_MS = 120; // a software renderer takes processor time from the daemons
const FADED = 0.3; // opacity of a packet's mark when it is old
const ON_TOP = { depthTest: false, depthWrite: false, transparent: true };
const UP = new THREE.Vector3(0, 1, 0); // of a cylinder

export class View {
  // Calls `redraw()` when the user turns the view. Throws without WebGL.
  constructor(place, store, redraw) {
    this.place = place;
    this.store = store;
    this.redraw = redraw;
    this.reach = LEAST_REACH_MM;
    this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, powerPreference: "low-power" });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.localClippingEnabled = true;
    this.interval = software(this.renderer.getContext()) ? SOFT_INTERVAL_MS : 0;
    this.drawn = -Infinity;
    this.live = false; // another one renders it
    this.aim = null; // where the visitor pulls the hand to
    place.prepend(this.renderer.domElement);
    this.camera = new THREE.PerspectiveCamera(32, 1, 1, 5000);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.addEventListener("change", () => this.redraw());
    this.controls.enablePan = false; // so that arrow keys without Shift are free for the handle
    this.controls.listenToKeyEvents(place);
    const sun = new THREE.DirectionalLight(0xffffff, 2.6);
    sun.position.set(-200, -20, 110);
    this.solids = new THREE.Group();
    this.world = new THREE.Scene().add(sun, new THREE.HemisphereLight(0xffffff, 0x8899aa, 0.9), this.solids);
    this.#actors();
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
    const ends = points.flatMap((each) => [new THREE.Vector3(), new THREE.Vector3(...each).multiplyScalar(MM)]);
    this.tool.geometry.dispose();
    this.tool.geometry = new THREE.BufferGeometry().setFromPoints(ends);
    this.#rebuild();
    this.#look();
  }

  restyle() {
    this.#rebuild();
    this.#colour();
  }

  // Draws the state at a time; false if the last drawing is too recent, then call it again later.
  draw(to, now) {
    if (!this.live && now - this.drawn < this.interval) return false;
    if (!this.live) this.render(to, now);
    return true;
  }

  // Draws the state at a time, now.
  render(to, now) {
    this.drawn = now;
    const { master, slave } = this.store.rings;
    const main = master.empty ? slave : master;
    const hand = point(master, to, "position");
    const robot = point(slave, to, "output");
    for (const [ball, at] of [[this.hand, hand], [this.robot, robot]]) {
      ball.visible = at !== null;
      if (at) ball.position.set(...at);
    }
    this.#turn(robot, this.store.rotates ? point(slave, to, "output", 1, 3) : null);
    this.#force(hand ?? robot, hand ? point(master, to, "output", 1) : point(slave, to, "raw", 1));
    this.#belief(main, to, hand ?? robot);
    this.spring.visible = this.target.visible = hand !== null && this.aim !== null;
    if (this.spring.visible) {
      stretch(this.spring, hand, new THREE.Vector3(...this.aim).sub(new THREE.Vector3(...hand)));
      this.target.position.set(...this.aim);
    }
    const { r, g, b } = this.hand.material.color;
    trail(this.trail, main, master.empty ? "output" : "position", to, (age) => [r, g, b, 1 - 0.9 * (age / TRAIL_S)]);
    const { sent } = slave.columns;
    trail(this.packets, slave, "output", to, (age) => [1, 1, 1, Math.max(FADED, 1 - age / 2)], (row) => sent?.[row] > 0);
    this.renderer.render(this.world, this.camera);
  }

  // The hand in the newest row; null while unknown.
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

  // What moves: balls, tool, arrow, predicted surface, trail, packets, and the spring from the hand to where it is pulled.
  #actors() {
    const basic = (more = {}) => new THREE.MeshBasicMaterial({ ...ON_TOP, ...more });
    const lines = (more = {}) => new THREE.LineBasicMaterial({ ...ON_TOP, ...more });
    const ball = (radius, opacity) =>
      new THREE.Mesh(new THREE.SphereGeometry(radius, 24, 18), new THREE.MeshLambertMaterial({ ...ON_TOP, opacity }));
    const rod = (radius, material) => new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, 1, 12).translate(0, 0.5, 0), material);
    this.hand = ball(1.9, 1);
    this.robot = ball(2.9, 0.5);
    this.tool = new THREE.LineSegments(new THREE.BufferGeometry(), lines());
    this.shaft = rod(0.5, basic());
    this.head = new THREE.Mesh(new THREE.ConeGeometry(1.5, 3.6, 16).translate(0, 1.8, 0), this.shaft.material);
    this.vertices = new Float32Array(3 * (RINGS + 1) * SPOKES);
    const positions = new THREE.BufferAttribute(this.vertices, 3);
    const surface = (index) => new THREE.BufferGeometry().setAttribute("position", positions).setIndex(index);
    this.belief = new THREE.Mesh(surface(triangles()), basic({ side: THREE.DoubleSide, opacity: 0.3 }));
    this.rim = new THREE.LineSegments(surface(ribs()), lines({ opacity: 0.75 }));
    this.trail = new THREE.Line(cloud(TRAIL_POINTS), lines({ vertexColors: true }));
    const dots = (count, size, map) =>
      new THREE.Points(cloud(count), new THREE.PointsMaterial({ ...ON_TOP, size, sizeAttenuation: false, map, vertexColors: true }));
    this.packets = dots(TRAIL_POINTS, 9, stamp((ctx) => ctx.arc(32, 32, 30, 0, 2 * Math.PI), "fill"));
    this.spring = rod(0.28, basic({ opacity: 0.75 }));
    this.target = dots(1, 22, stamp((ctx) => ctx.arc(32, 32, 25, 0, 2 * Math.PI), "stroke"));
    this.target.geometry.attributes.color.array.fill(1);
    this.target.geometry.setDrawRange(0, 1);
    const order = [this.belief, this.rim, this.trail, this.packets, this.robot, this.tool, this.spring, this.hand, this.shaft, this.head, this.target];
    for (const [k, actor] of order.entries()) {
      actor.renderOrder = 2 + k;
      actor.frustumCulled = false;
    }
    this.world.add(...order);
  }

  #colour() {
    const colours = { master: [this.hand, this.spring, this.target], slave: [this.robot, this.tool], text: [this.shaft], model: [this.belief, this.rim], packets: [this.packets] };
    for (const [name, actors] of Object.entries(colours)) for (const actor of actors) actor.material.color.set(theme[name]);
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
    if (!tool.visible) return;
    const axis = new THREE.Vector3(...turned);
    const angle = axis.length();
    tool.position.set(...at);
    tool.quaternion.setFromAxisAngle(axis.normalize(), angle);
  }

  #force(at, force) {
    const size = at && force ? Math.hypot(...force) : 0;
    this.shaft.visible = this.head.visible = size > 0.02;
    this.place.dataset.force = size; // [N]
    if (!this.shaft.visible) return;
    const way = new THREE.Vector3(...force).multiplyScalar(MM_PER_N);
    stretch(this.shaft, at, way);
    this.head.position.set(...at).add(way);
    this.head.quaternion.copy(this.shaft.quaternion);
  }

  #belief(ring, to, here) {
    const kind = ring.value("model", to);
    const surface = kind === PLANE || kind === SPHERE ? point(ring, to, "surface", kind === PLANE ? 1 : MM) : null;
    const size = surface ? MM * ring.value("surface_size", to) : NaN;
    const known = surface && here ? patch({ kind, surface, size }, here, 0.3 * this.reach, this.vertices) : null;
    this.belief.visible = this.rim.visible = known !== null;
    if (known) this.belief.geometry.attributes.position.needsUpdate = true;
    const sphere = `predicted surface: ${size < 0 ? "hollow " : ""}sphere, radius ${Math.abs(size).toFixed(1)} mm`;
    const words = ["predicted force: held constant", "predicted force: linear extrapolation", "predicted surface: plane", sphere];
    const stiffness = known ? ring.value("surface_stiffness", to) : NaN;
    const text = (words[kind] ?? "\u00a0") + (Number.isFinite(stiffness) ? `, ${stiffness.toFixed(0)} N/m` : "");
    show(by("model"), text, kind === kind ? modelName(kind) : "");
  }

  #resize() {
    const [width, height] = [Math.max(1, this.place.clientWidth), Math.max(1, this.place.clientHeight)];
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
function point(ring, to, name, scale = MM, first = 0) {
  const found = [0, 1, 2].map((axis) => scale * ring.value(`${name}_${first + axis}`, to));
  return found.every(Number.isFinite) ? found : null;
}

// Places a rod of length 1 along a vector.
function stretch(rod, from, way) {
  rod.position.set(...from);
  rod.scale.y = Math.max(0.01, way.length());
  rod.quaternion.setFromUnitVectors(UP, way.clone().normalize());
}

// Fills an actor with the rows of the last seconds, of those that are wanted, or every n-th one if there are too many.
function trail(actor, ring, name, to, colour, wanted = null) {
  const { t, [`${name}_0`]: x, [`${name}_1`]: y, [`${name}_2`]: z } = ring.columns;
  const { position, color } = actor.geometry.attributes;
  const [begin, end] = [ring.at(to - TRAIL_S), Math.min(ring.end, ring.at(to) + 1)];
  const step = wanted ? 1 : Math.max(1, Math.ceil((end - begin) / TRAIL_POINTS));
  let k = 0;
  for (let row = begin; z && row < end && k < TRAIL_POINTS; row += step) {
    if ((wanted && !wanted(row)) || z[row] !== z[row]) continue;
    position.setXYZ(k, MM * x[row], MM * y[row], MM * z[row]);
    color.setXYZW(k, ...colour(to - t[row]));
    k += 1;
  }
  position.needsUpdate = color.needsUpdate = true;
  actor.geometry.setDrawRange(0, k);
}

// Points, each with its own colour and opacity.
function cloud(count) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * count), 3));
  geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(4 * count), 4));
  geometry.setDrawRange(0, 0);
  return geometry;
}

function stamp(draw, finish) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 64;
  const ctx = canvas.getContext("2d");
  ctx.fillStyle = ctx.strokeStyle = "#fff";
  ctx.lineWidth = 10;
  draw(ctx);
  ctx[finish]();
  return new THREE.CanvasTexture(canvas);
}
