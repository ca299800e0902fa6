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
  let far = 0;
  for (const object of scene) {
    if (object.shape === "box") far = Math.max(far, length2(object.center_m) + Math.hypot(...object.size_m) / 2);
    if (object.shape === "sphere") far = Math.max(far, length2(object.center_m) + Math.min(object.radius_m, 0.05));
    if (object.shape === "height_field" && object.heights_m) {
      far = Math.max(
        far,
        length2(object.center_m) +
          0.5 * object.spacing_m * Math.max(object.heights_m.length, object.heights_m[0].length),
      );
    }
  }
  return MM * far;
}

const length2 = (v) => Math.hypot(v[0], v[1]);
const vector = (v) => new THREE.Vector3(...v).multiplyScalar(MM);

function half({ point_m: point, normal }) {
  const n = new THREE.Vector3(...normal).normalize();
  return new THREE.Plane(n, -n.dot(vector(point)));
}

function matter(clip, { inside = false, carve = [] } = {}, shade = "solid") {
  const thin = carve.length > 0;
  return new THREE.MeshLambertMaterial({
    color: theme[shade],
    side: inside ? THREE.BackSide : THREE.FrontSide,
    clippingPlanes: clip,
    transparent: thin,
    opacity: thin ? 0.4 : 1,
    polygonOffset: true,
    polygonOffsetFactor: 1,
    polygonOffsetUnits: 1,
  });
}

function lines(geometry, clip, opacity = 0.55) {
  const material = new THREE.LineBasicMaterial({ color: theme.wire, transparent: true, opacity, clippingPlanes: clip });
  return new THREE.LineSegments(geometry, material);
}

function grid(reach) {
  const points = [];
  const count = Math.floor(reach / GRID_MM);
  for (let k = -count; k <= count; k += 1) {
    points.push(k * GRID_MM, -reach, 0, k * GRID_MM, reach, 0, -reach, k * GRID_MM, 0, reach, k * GRID_MM, 0);
  }
  return new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
}

// Circles of longitude and latitude.
function globe(radius) {
  const points = [];
  const at = (longitude, latitude) => {
    const a = (Math.PI * longitude) / 36,
      b = (Math.PI * latitude) / 36;
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

function carved(group, object) {
  for (const cut of object.carve ?? []) {
    const made = MAKERS[cut.shape]?.({ ...cut, inside: true }, 0, []);
    if (made && cut.shape !== "plane") group.add(made);
  }
  return group;
}

const MAKERS = {
  plane(object, reach) {
    const group = new THREE.Group();
    group.add(
      new THREE.Mesh(new THREE.PlaneGeometry(2 * reach, 2 * reach), matter([], object, "floor")),
      lines(grid(reach), []),
    );
    const normal = new THREE.Vector3(...object.normal).normalize();
    group.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), normal);
    group.position.copy(normal).multiplyScalar(normal.dot(vector(object.point_m)));
    const outer = new THREE.Group();
    outer.add(group);
    return carved(outer, object);
  },
  sphere(object, reach, clip) {
    const radius = MM * object.radius_m;
    const group = new THREE.Group();
    // Pole on the z axis, so that the latitude circles are those of a dome.
    const round = new THREE.SphereGeometry(radius, 72, 72).rotateX(Math.PI / 2);
    group.add(new THREE.Mesh(round, matter(clip, object)), lines(globe(radius), clip, 0.4));
    group.position.copy(vector(object.center_m));
    const outer = new THREE.Group();
    outer.add(group);
    return carved(outer, object);
  },
  box(object, reach, clip) {
    const group = new THREE.Group();
    const block = new THREE.BoxGeometry(...object.size_m.map((edge) => MM * edge));
    group.add(new THREE.Mesh(block, matter(clip, object)), lines(new THREE.EdgesGeometry(block), clip, 1));
    group.position.copy(vector(object.center_m));
    const [roll, pitch, yaw] = (object.rotation_deg ?? [0, 0, 0]).map(THREE.MathUtils.degToRad);
    group.rotation.set(roll, pitch, yaw, "ZYX");
    const outer = new THREE.Group();
    outer.add(group);
    return carved(outer, object);
  },
  height_field(object, reach, clip) {
    const { heights_m: heights, spacing_m: spacing, center_m: center } = object;
    if (!heights) return null;
    const rows = heights.length;
    const columns = heights[0].length;
    const geometry = new THREE.PlaneGeometry(
      MM * spacing * (columns - 1),
      MM * spacing * (rows - 1),
      columns - 1,
      rows - 1,
    );
    const points = geometry.attributes.position;
    for (let k = 0; k < points.count; k += 1) {
      // three's rows begin at the largest y
      points.setZ(k, MM * heights[rows - 1 - Math.floor(k / columns)][k % columns]);
    }
    geometry.computeVertexNormals();
    const group = new THREE.Group();
    group.add(new THREE.Mesh(geometry, matter(clip, object)), lines(new THREE.WireframeGeometry(geometry), clip, 0.12));
    group.position.copy(vector(center));
    return group;
  },
};
