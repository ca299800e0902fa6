// The moving objects of the 3-D view: balls, tool, arrow, predicted surface, trail, packets.

import * as THREE from "../vendor/three.module.min.js";
import { RINGS, SPOKES, ribs, triangles } from "./patch.js";

export const TRAIL_POINTS = 1400;
export const SPLASHES = 64;
const ON_TOP = { depthTest: false, depthWrite: false, transparent: true };

export function actors() {
  const made = {};
  const ball = (radius, order) => {
    const mesh = new THREE.Mesh(new THREE.SphereGeometry(radius, 24, 18), new THREE.MeshLambertMaterial(ON_TOP));
    mesh.renderOrder = order;
    return mesh;
  };
  made.hand = ball(1.9, 8);
  made.robot = ball(2.9, 6);
  made.robot.material.opacity = 0.5;
  made.tool = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial(ON_TOP));
  made.tool.renderOrder = 7;
  const shaft = new THREE.Mesh(
    new THREE.CylinderGeometry(0.5, 0.5, 1, 12).translate(0, 0.5, 0),
    new THREE.MeshBasicMaterial(ON_TOP),
  );
  const head = new THREE.Mesh(new THREE.ConeGeometry(1.5, 3.6, 16).translate(0, 1.8, 0), shaft.material);
  shaft.renderOrder = head.renderOrder = 9;
  made.shaft = shaft;
  made.head = head;
  made.arrow = new THREE.Group().add(shaft, head);
  const surface = new THREE.BufferGeometry();
  made.vertices = new Float32Array(3 * (RINGS + 1) * SPOKES);
  surface.setAttribute("position", new THREE.BufferAttribute(made.vertices, 3));
  surface.setIndex(triangles());
  made.belief = new THREE.Mesh(
    surface,
    new THREE.MeshBasicMaterial({ ...ON_TOP, side: THREE.DoubleSide, opacity: 0.3 }),
  );
  const net = new THREE.BufferGeometry().setAttribute("position", surface.attributes.position).setIndex(ribs());
  made.rim = new THREE.LineSegments(net, new THREE.LineBasicMaterial({ ...ON_TOP, opacity: 0.75 }));
  made.belief.renderOrder = 2;
  made.rim.renderOrder = 3;
  made.trail = new THREE.Line(
    cloud(TRAIL_POINTS, true),
    new THREE.LineBasicMaterial({ ...ON_TOP, vertexColors: true }),
  );
  made.trail.renderOrder = 4;
  made.packets = marks(TRAIL_POINTS, 9, disc());
  made.packets.renderOrder = 5;
  made.splash = marks(SPLASHES, 26, ring(3));
  made.splash.renderOrder = 5;
  made.spring = new THREE.Mesh(
    new THREE.CylinderGeometry(0.28, 0.28, 1, 8).translate(0, 0.5, 0),
    new THREE.MeshBasicMaterial({ ...ON_TOP, opacity: 0.75 }),
  );
  made.spring.renderOrder = 7;
  made.target = marks(1, 22, ring(5));
  made.target.geometry.setDrawRange(0, 1);
  made.target.renderOrder = 10;
  made.spring.visible = made.target.visible = false;
  for (const actor of [made.belief, made.rim, made.trail, made.packets, made.splash, made.target])
    actor.frustumCulled = false;
  return made;
}

// Points of one size [px], each with its own opacity.
function marks(count, size, map) {
  const material = new THREE.PointsMaterial({ ...ON_TOP, size, sizeAttenuation: false, map, vertexColors: true });
  const made = new THREE.Points(cloud(count, true), material);
  made.geometry.attributes.color.array.fill(1);
  return made;
}

function cloud(count, coloured = false) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * count), 3));
  if (coloured) geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(4 * count), 4));
  geometry.setDrawRange(0, 0);
  return geometry;
}

const disc = () => stamp((ctx) => ctx.arc(32, 32, 30, 0, 2 * Math.PI), "fill");
const ring = (width) =>
  stamp((ctx) => {
    ctx.lineWidth = 2 * width;
    ctx.arc(32, 32, 30 - width, 0, 2 * Math.PI);
  }, "stroke");

function stamp(draw, finish) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 64;
  const ctx = canvas.getContext("2d");
  ctx.fillStyle = ctx.strokeStyle = "#fff";
  draw(ctx);
  ctx[finish]();
  return new THREE.CanvasTexture(canvas);
}
