// The objects of a scene as meshes, in millimetres.

import * as THREE from "../vendor/three.module.min.js";
import { theme } from "./theme.js";

const MM = 1000;
const GRID_MM = 10;

export function solids(scene, reach) {
  const group = new THREE.Group();
  const planes = scene.filter(({ shape }) => shape === "plane");
  for (const object of scene) {
    const clip = planes.filter((plane) => plane !== object).map(half);
    const made = MAKERS[object.shape]?.(object, reach, clip);
    if (made) group.add(made);
  }
  return group;
}

// How far the bounded objects reach from the middle [mm], above the planes only.
export function extent(scene) {
  const reach = {
    box: ({ size_m: size }) => Math.hypot(...size) / 2,
    sphere: ({ radius_m: radius }) => Math.min(radius, 0.05),
    height_field: ({ heights_m: rows, spacing_m: spacing }) => (rows ? 0.5 * spacing * Math.max(rows.length, rows[0].length) : -Infinity),
  };
  const bounded = scene.filter(({ shape }) => shape in reach);
  return MM * Math.max(0, ...bounded.map((object) => Math.hypot(object.center_m[0], object.center_m[1]) + reach[object.shape](object)));
}

const vector = (v) => new THREE.Vector3(...v).multiplyScalar(MM);

function half({ point_m: point, normal }) {
  const n = new THREE.Vector3(...normal).normalize();
  return new THREE.Plane(n, -n.dot(vector(point)));
}

function matter(clip, { inside = false, carve = [] } = {}, shade = "solid") {
  const look = { color: theme[shade], side: inside ? THREE.BackSide : THREE.FrontSide, clippingPlanes: clip };
  const below = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 }; // its lines
  return new THREE.MeshLambertMaterial({ ...look, ...below, transparent: carve.length > 0, opacity: carve.length ? 0.4 : 1 });
}

function lines(geometry, clip, opacity = 0.55) {
  const material = new THREE.LineBasicMaterial({ color: theme.wire, transparent: true, opacity, clippingPlanes: clip });
  return new THREE.LineSegments(geometry, material);
}

function grid(reach) {
  const points = [];
  const count = Math.floor(reach / GRID_MM);
  for (let at = -count * GRID_MM; at <= count * GRID_MM; at += GRID_MM)
    points.push(at, -reach, 0, at, reach, 0, -reach, at, 0, reach, at, 0);
  return new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
}

// Circles of longitude and latitude.
function globe(radius) {
  const points = [];
  const at = (longitude, latitude) => {
    const [a, b] = [longitude, latitude].map((steps) => (Math.PI * steps) / 36);
    return [radius * Math.cos(b) * Math.cos(a), radius * Math.cos(b) * Math.sin(a), radius * Math.sin(b)];
  };
  for (let a = 0; a < 72; a += 1) {
    for (let b = -18; b < 18; b += 1) {
      if (a % 6 === 0) points.push(...at(a, b), ...at(a, b + 1));
      if (b % 2 === 0) points.push(...at(a, b), ...at(a + 1, b));
    }
  }
  return new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
}

// An object in a group of its own, beside what is cut out of it.
function carved(body, object) {
  const group = new THREE.Group().add(body);
  for (const cut of object.carve ?? []) if (cut.shape !== "plane" && cut.shape in MAKERS) group.add(MAKERS[cut.shape]({ ...cut, inside: true }, 0, []));
  return group;
}

const MAKERS = {
  plane(object, reach) {
    const ground = new THREE.Mesh(new THREE.PlaneGeometry(2 * reach, 2 * reach), matter([], object, "floor"));
    const body = new THREE.Group().add(ground, lines(grid(reach), []));
    const normal = new THREE.Vector3(...object.normal).normalize();
    body.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), normal);
    body.position.copy(normal).multiplyScalar(normal.dot(vector(object.point_m)));
    return carved(body, object);
  },
  sphere(object, reach, clip) {
    const radius = MM * object.radius_m;
    // Pole on the z axis, so that the latitude circles are those of a dome.
    const round = new THREE.SphereGeometry(radius, 72, 72).rotateX(Math.PI / 2);
    const body = new THREE.Group().add(new THREE.Mesh(round, matter(clip, object)), lines(globe(radius), clip, 0.4));
    body.position.copy(vector(object.center_m));
    return carved(body, object);
  },
  box(object, reach, clip) {
    const block = new THREE.BoxGeometry(...object.size_m.map((edge) => MM * edge));
    const body = new THREE.Group().add(new THREE.Mesh(block, matter(clip, object)), lines(new THREE.EdgesGeometry(block), clip, 1));
    body.position.copy(vector(object.center_m));
    const [roll, pitch, yaw] = (object.rotation_deg ?? [0, 0, 0]).map(THREE.MathUtils.degToRad);
    body.rotation.set(roll, pitch, yaw, "ZYX");
    return carved(body, object);
  },
  height_field(object, reach, clip) {
    const { heights_m: heights, spacing_m: spacing, center_m: center } = object;
    if (!heights) return null;
    const [rows, columns] = [heights.length, heights[0].length];
    const [width, height] = [columns - 1, rows - 1].map((count) => MM * spacing * count);
    const geometry = new THREE.PlaneGeometry(width, height, columns - 1, rows - 1);
    const points = geometry.attributes.position;
    // three's rows begin at the largest y
    for (let k = 0; k < points.count; k += 1) points.setZ(k, MM * heights[rows - 1 - Math.floor(k / columns)][k % columns]);
    geometry.computeVertexNormals();
    const wires = lines(new THREE.WireframeGeometry(geometry), clip, 0.12);
    const body = new THREE.Group().add(new THREE.Mesh(geometry, matter(clip, object)), wires);
    body.position.copy(vector(center));
    return body;
  },
};
