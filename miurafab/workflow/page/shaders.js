// How a scene draws its facets and its creases: both take their places from a table of points.

const SPOT = `
precision highp float;
precision highp int;
precision highp sampler2D;
vec4 of(sampler2D table, uint row) { return texelFetch(table, ivec2(row & 1023u, row >> 10u), 0); }`;

// A corner stands at the first of three vertices, or of a plate beside it: `local` is in mm along the
// first side, across it in the plane, and out of the plane. `facing` is the normal in the same frame.
const FACET_VERTEX = `#version 300 es
${SPOT}
in uvec3 corners;
in uint owner;
in vec3 local, facing;
uniform sampler2D points, traits;
uniform mat4 camera;
uniform mat3 turned;
uniform vec3 eye, along, front, back, wall, ramp[5], chosen;
uniform float apart;
uniform int marked;
uniform bool strained, solid;
flat out vec3 colour;
void main() {
  vec3 p = of(points, corners.x).xyz, q = of(points, corners.y).xyz, r = of(points, corners.z).xyz;
  vec4 trait = of(traits, owner);
  vec3 u = q - p, n = cross(u, r - p);
  u /= max(length(u), 1e-20);
  n /= max(length(n), 1e-20);
  vec3 v = cross(n, u);
  vec3 at = p + local.x * u + local.y * v + local.z * n + apart * trait.y * along;
  vec3 normal = facing.x * u + facing.y * v + facing.z * n;
  bool up = dot(normal, eye - at) > 0.0;
  vec3 seen = turned * (up ? normal : -normal);
  float key = max(dot(seen, vec3(-0.451, 0.601, 0.661)), 0.0);
  float fill = max(dot(seen, vec3(0.801, -0.172, 0.573)), 0.0);
  vec3 paper = solid ? (abs(facing.z) < 0.5 ? wall : facing.z > 0.0 ? front : back) : up ? front : back;
  if (strained) {
    float level = clamp(trait.x, 0.0, 1.0) * 4.0;
    int low = min(int(level), 3);
    paper = mix(ramp[low], ramp[low + 1], level - float(low));
  }
  if (int(owner) == marked) paper = mix(paper, chosen, 0.6);
  colour = paper * (0.56 + 0.4 * key + 0.12 * fill);
  gl_Position = camera * vec4(at, 1.0);
}`;

const FACET_FRAGMENT = `#version 300 es
precision mediump float;
flat in vec3 colour;
out vec4 result;
void main() { result = vec4(colour, 1.0); }`;

// `ends` are the two vertices and the facet with which the line is lifted. A sketched line is one pixel wide.
const CREASE_VERTEX = `#version 300 es
${SPOT}
in uvec3 ends;
in float kind;
uniform sampler2D points, traits;
uniform mat4 camera;
uniform vec3 along;
uniform vec2 size;
uniform float apart, nearer;
uniform int shown;
uniform bool sketched;
uniform vec3 colours[8];
uniform float widths[8];
out vec2 place;
flat out float half_width;
flat out vec3 colour;
void main() {
  int k = int(kind + 0.5);
  vec3 lift = apart == 0.0 ? vec3(0.0) : apart * of(traits, ends.z).y * along;
  vec4 p = camera * vec4(of(points, ends.x).xyz + lift, 1.0);
  vec4 q = camera * vec4(of(points, ends.y).xyz + lift, 1.0);
  if (((shown >> k) & 1) == 0 || p.w <= 0.0 || q.w <= 0.0) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    return;
  }
  colour = colours[k];
  if (sketched) {
    place = vec2(0.0);
    half_width = 1.0;
    gl_Position = (gl_VertexID & 1) == 0 ? p : q;
    gl_Position.z -= nearer * gl_Position.w;
    return;
  }
  float reach;
${WIDEN}}`;

// Without the dashes and the ends of LINE_FRAGMENT, and without `discard`, so that hidden lines cost nothing.
const CREASE_FRAGMENT = `#version 300 es
precision highp float;
in vec2 place;
flat in float half_width;
flat in vec3 colour;
uniform float strength;
out vec4 result;
void main() {
  result = vec4(colour, 1.0) * (clamp(half_width + 0.5 - abs(place.y), 0.0, 1.0) * strength);
}`;
