// Geometry in space without a canvas: how points look to an eye, what a ray meets, which facets meet where.

const FIELD = Math.tan((16 * Math.PI) / 180);

/** The screen's axes in space: right, up, and out of it towards the eye. Z is up in space. */
function axes({ yaw, pitch }) {
  const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  return { right: [cy, sy, 0], up: [-sy * sp, cy * sp, cp], out: [sy * cp, -cy * cp, sp] };
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const at3 = (points, vertex) => [points[3 * vertex], points[3 * vertex + 1], points[3 * vertex + 2]];

/**
 * How points look to an eye: their middle, the distance from it at which the eye sees all of them, the radius
 * of a ball around them, and how much of the view they fill.
 */
function framed(points, { right, up, out }, aspect, every = 1) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  [right, up, out].forEach(([a, b, c], axis) => {
    for (let at = 0; at < points.length; at += 3 * every) {
      const far = a * points[at] + b * points[at + 1] + c * points[at + 2];
      if (far < low[axis]) low[axis] = far;
      if (far > high[axis]) high[axis] = far;
    }
  });
  const middle = low.map((least, axis) => (least + high[axis]) / 2);
  const [rx, ry, rz] = right;
  const [ux, uy, uz] = up;
  const [ox, oy, oz] = out;
  let distance = 0;
  for (let at = 0; at < points.length; at += 3 * every) {
    const [px, py, pz] = [points[at], points[at + 1], points[at + 2]];
    const x = Math.abs(rx * px + ry * py + rz * pz - middle[0]) / (FIELD * aspect);
    const y = Math.abs(ux * px + uy * py + uz * pz - middle[1]) / FIELD;
    const far = ox * px + oy * py + oz * pz - middle[2] + (x > y ? x : y);
    if (far > distance) distance = far;
  }
  const wide = [high[0] - low[0], high[1] - low[1]];
  return {
    middle: [0, 1, 2].map((axis) => right[axis] * middle[0] + up[axis] * middle[1] + out[axis] * middle[2]),
    distance: Math.max(distance, 1e-3) * 1.05,
    radius: Math.hypot(...wide, high[2] - low[2]) / 2,
    fill: (wide[0] * wide[1]) / (distance * distance),
  };
}

/** How far along a ray from `eye` it meets the triangle at p with the sides u and v; Möller and Trumbore 1997. */
function hit(eye, ray, p, u, v) {
  const across = cross(ray, v);
  const scale = dot(u, across);
  if (Math.abs(scale) < 1e-12) return Infinity;
  const from = minus(eye, p);
  const a = dot(from, across) / scale;
  const turned = cross(from, u);
  const b = dot(ray, turned) / scale;
  const far = dot(v, turned) / scale;
  return a >= 0 && b >= 0 && a + b <= 1 && far > 0 ? far : Infinity;
}

/** The edge of `edges` that is nearest to a point of the screen; `ends` gives its two ends there. */
function nearestSide(edges, ends, x, y) {
  let found = { edge: -1, pixels: Infinity };
  for (const edge of edges) {
    const [[x0, y0], [x1, y1]] = ends(edge);
    const [dx, dy] = [x1 - x0, y1 - y0];
    const part = Math.min(Math.max(((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy || 1), 0), 1);
    const pixels = Math.hypot(x0 + part * dx - x, y0 + part * dy - y);
    if (pixels < found.pixels) found = { edge, pixels };
  }
  return found;
}

/** The sides of each facet (edges), and the facets at each edge, from the triangles alone. */
function neighbours(triangles, owners, edges) {
  const facets = owners.reduce((most, owner) => Math.max(most, owner), -1) + 1;
  const known = new Map();
  const key = (a, b) => Math.min(a, b) * 4294967296 + Math.max(a, b);
  for (let edge = 0; edge < edges.length / 2; edge += 1) known.set(key(edges[2 * edge], edges[2 * edge + 1]), edge);
  const sides = Array.from({ length: facets }, () => []);
  const sidesOf = Array.from({ length: edges.length / 2 }, () => []);
  for (let at = 0; at < triangles.length; at += 1) {
    const first = at - (at % 3);
    const edge = known.get(key(triangles[at], triangles[first + ((at + 1) % 3)]));
    if (edge === undefined) continue;
    const facet = owners[first / 3];
    if (sidesOf[edge].includes(facet)) continue;
    sides[facet].push(edge);
    sidesOf[edge].push(facet);
  }
  return { facets, sides, sidesOf };
}

/** How far points reach along each of `rows`, unit vectors. */
function extents(points, rows) {
  return rows.map(([a, b, c]) => {
    let [low, high] = [Infinity, -Infinity];
    for (let at = 0; at < points.length; at += 3) {
      const far = a * points[at] + b * points[at + 1] + c * points[at + 2];
      if (far < low) low = far;
      if (far > high) high = far;
    }
    return high - low;
  });
}

/** Two directions at right angles in the plane with a normal, in which the box around `points` is smallest. */
function plane(normal, points) {
  const side = Math.abs(normal[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  const first = cross(normal, side);
  const size = Math.hypot(...first);
  const u = first.map((value) => value / size);
  const v = cross(normal, u);
  let best = { area: Infinity, rows: [u, v] };
  for (let step = 0; step < 90; step += 1) {
    const [c, s] = [Math.cos((step * Math.PI) / 180), Math.sin((step * Math.PI) / 180)];
    const rows = [u.map((value, at) => c * value + s * v[at]), v.map((value, at) => c * value - s * u[at])];
    const [wide, high] = extents(points, rows);
    if (wide * high < best.area) best = { area: wide * high, rows: wide > high ? rows : [rows[1], rows[0]] };
  }
  return best.rows;
}
