// The predicted surface near a point: a round piece of a plane or of a sphere. Pure geometry.

export const RINGS = 10;
export const SPOKES = 40;
export const PLANE = 2;
export const SPHERE = 3;

// Vertices (x, y, z flat) of the patch around `point`, rings from the middle out; null without a valid surface.
//
// A plane is {kind, surface: unit normal n, size: d} with n.p + d the height above the wall; a sphere {kind,
// surface: centre, size: radius, negative concave}. `reach` is how far the patch goes along the surface. One unit of
// length throughout.
export function patch({ kind, surface, size }, point, reach, into) {
  const normal = outward(kind, surface, point);
  if (!normal || !Number.isFinite(size)) return null;
  const radius = kind === SPHERE ? Math.abs(size) : Infinity;
  if (radius === 0) return null;
  const [first, second] = across(normal);
  const height = kind === PLANE ? dot(normal, point) + size : 0;
  const middle = kind === PLANE ? point.map((p, k) => p - height * normal[k]) : surface;
  const far = Math.min(reach, Math.PI * radius);
  let place = 0;
  for (let ring = 0; ring <= RINGS; ring += 1) {
    const arc = (far * ring) / RINGS;
    const along = kind === SPHERE ? radius * Math.cos(arc / radius) : 0;
    const out = kind === SPHERE ? radius * Math.sin(arc / radius) : arc;
    for (let spoke = 0; spoke < SPOKES; spoke += 1) {
      const angle = (2 * Math.PI * spoke) / SPOKES;
      const [a, b] = [out * Math.cos(angle), out * Math.sin(angle)];
      for (let k = 0; k < 3; k += 1) into[place++] = middle[k] + along * normal[k] + a * first[k] + b * second[k];
    }
  }
  return into;
}

// Triangles between the rings, for any patch.
export function triangles() {
  const faces = [];
  for (let ring = 0; ring < RINGS; ring += 1) {
    for (let spoke = 0; spoke < SPOKES; spoke += 1) {
      const next = (spoke + 1) % SPOKES;
      const [a, b] = [ring * SPOKES + spoke, ring * SPOKES + next];
      faces.push(a, a + SPOKES, b, b, a + SPOKES, b + SPOKES);
    }
  }
  return faces;
}

// Lines between the vertices that show how it bends: two rings and eight spokes.
export function ribs() {
  const pairs = [];
  for (const ring of [RINGS / 2, RINGS]) {
    for (let spoke = 0; spoke < SPOKES; spoke += 1)
      pairs.push(ring * SPOKES + spoke, ring * SPOKES + ((spoke + 1) % SPOKES));
  }
  for (let spoke = 0; spoke < SPOKES; spoke += SPOKES / 8) {
    for (let ring = 0; ring < RINGS; ring += 1) pairs.push(ring * SPOKES + spoke, (ring + 1) * SPOKES + spoke);
  }
  return pairs;
}

function outward(kind, surface, point) {
  const direction = kind === PLANE ? surface : kind === SPHERE ? point.map((p, k) => p - surface[k]) : null;
  const length = direction ? Math.hypot(...direction) : 0;
  return length > 0 && Number.isFinite(length) ? direction.map((v) => v / length) : null;
}

function across(n) {
  const helper = Math.abs(n[0]) < 0.7 ? [1, 0, 0] : [0, 1, 0];
  const first = cross(helper, n);
  const length = Math.hypot(...first);
  const unit = first.map((v) => v / length);
  return [unit, cross(n, unit)];
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
