// Facets as plates: of paper that is thick, or panels that are cut back beside their creases so that they fold.
//
// The creases stay in the middle of a plate of thickness t. On the side that closes (the top of a valley) a side of the
// plate keeps (t / 2) tan(rho / 2) from its crease at the largest fold angle rho: T. Tachi, "Rigid-foldable thick
// origami", 2011. A corner between sides with inward normals m and n moves by (t / 2) w, m.w = tan(rho_m / 2), n.w alike.

/** The corners of each facet in order, from its triangles. */
function outlines({ triangles, owners, facets }) {
  const found = Array.from({ length: facets }, () => new Map());
  for (let at = 0; at < triangles.length; at += 1) {
    const first = at - (at % 3);
    const [from, to] = [triangles[at], triangles[first + ((at + 1) % 3)]];
    const next = found[owners[first / 3]];
    if (next.get(to) === from) next.delete(to); // the diagonal between two triangles
    else next.set(from, to);
  }
  return found.map((next) => {
    const [start] = next.keys();
    const loop = [];
    for (let at = start; loop.length < next.size; at = next.get(at)) loop.push(at);
    return loop;
  });
}

/** By how much the corners of each facet move on the top (0) and on the bottom (1), for each mm of half the thickness. */
function tapers(loops, mesh, flat, angles) {
  const angleOf = new Map();
  mesh.sides.forEach((edges) => edges.forEach((edge) => {
    const [a, b] = [mesh.edges[2 * edge], mesh.edges[2 * edge + 1]];
    if (mesh.sidesOf[edge].length > 1) [`${a} ${b}`, `${b} ${a}`].forEach((key) => angleOf.set(key, angles[edge]));
  }));
  return loops.map((loop) => [1, -1].map((sign) => {
    const sides = loop.map((vertex, at) => {
      const next = loop[(at + 1) % loop.length];
      const [dx, dy] = [flat[3 * next] - flat[3 * vertex], flat[3 * next + 1] - flat[3 * vertex + 1]];
      const length = Math.hypot(dx, dy) || 1;
      const closing = Math.max(sign * (angleOf.get(`${vertex} ${next}`) ?? 0), 0);
      return { m: [-dy / length, dx / length], way: [dx / length, dy / length], length, k: Math.tan(closing / 2) };
    });
    return loop.map((_, at) => {
      const [one, other] = [sides[(at + loop.length - 1) % loop.length], sides[at]];
      const det = one.m[0] * other.m[1] - one.m[1] * other.m[0];
      const move = Math.abs(det) < 1e-9 ? other.m.map((value) => value * other.k) : [
        (one.k * other.m[1] - other.k * one.m[1]) / det, (other.k * one.m[0] - one.k * other.m[0]) / det,
      ];
      return { move, side: other };
    });
  }));
}

/** The thickness up to which each side of each plate keeps a length, mm. */
function thickest(moves) {
  let least = Infinity;
  for (const plies of moves) {
    for (const corners of plies) {
      corners.forEach(({ move, side: { way, length } }, at) => {
        const next = corners[(at + 1) % corners.length].move;
        const loss = (move[0] - next[0]) * way[0] + (move[1] - next[1]) * way[1];
        if (loss > 0) least = Math.min(least, (2 * length) / loss);
      });
    }
  }
  return least;
}

/** The plates for a Scene: for each corner of a triangle its facet, where it stands beside it, and how it faces. */
function plates({ triangles, owners }, loops, moves, flat, thickness) {
  const [corners, facetOf, local, facing] = [[], [], [], []];
  const parts = loops.map(() => []);
  owners.forEach((owner, at) => parts[owner].push(triangles.subarray(3 * at, 3 * at + 3)));
  loops.forEach((loop, facet) => {
    const [frame] = parts[facet];
    const [ax, ay] = [flat[3 * frame[0]], flat[3 * frame[0] + 1]];
    const [ux, uy] = [flat[3 * frame[1]] - ax, flat[3 * frame[1] + 1] - ay];
    const long = Math.hypot(ux, uy) || 1;
    // the top, the bottom, and between them the outline through the creases
    const [top, bottom, middle] = [1, -1, 0].map((side, ply) => loop.map((vertex, at) => {
      const move = side ? moves[facet][ply][at].move : [0, 0];
      const x = flat[3 * vertex] + (thickness / 2) * move[0] - ax;
      const y = flat[3 * vertex + 1] + (thickness / 2) * move[1] - ay;
      return [(x * ux + y * uy) / long, (y * ux - x * uy) / long, side * (thickness / 2)];
    }));
    const add = (p, q, r) => {
      const normal = cross(minus(q, p), minus(r, p));
      const size = Math.hypot(...normal) || 1;
      for (const point of [p, q, r]) {
        corners.push(frame);
        facetOf.push(facet);
        local.push(...point);
        facing.push(...normal.map((value) => value / size));
      }
    };
    for (const part of parts[facet]) {
      const [p, q, r] = Array.from(part, (vertex) => loop.indexOf(vertex));
      add(top[p], top[q], top[r]);
      add(bottom[p], bottom[r], bottom[q]);
    }
    loop.forEach((_, at) => {
      const next = (at + 1) % loop.length;
      for (const [low, high] of [[bottom, middle], [middle, top]]) {
        add(low[at], low[next], high[next]);
        add(low[at], high[next], high[at]);
      }
    });
  });
  return { corners, owners: facetOf, local: Float32Array.from(local), facing: Float32Array.from(facing) };
}
