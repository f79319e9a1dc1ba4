// What every vertex and every pixel of a 3-D view is computed by; see view.js.
// Modes: 0 faces, 1 edges, 2 part numbers, 3 the sphere's haze, 4 what is chosen, 5 shadow map, 6 ground.
const VERTEX = `#version 300 es
  in vec3 place, shift; in uint part;
  uniform mat4 camera; uniform float lift, explode, ground; uniform highp int mode;
  uniform highp sampler2D states;
  flat out vec4 tint; flat out uint who; out vec3 at;
  void main() {
    if (mode == 6) {
      at = vec3(4.0 * vec2(gl_VertexID & 1, gl_VertexID >> 1) - 2.0, ground);
      gl_Position = camera * vec4(at, 1);
      return;
    }
    tint = texelFetch(states, ivec2(part & 1023u, part >> 10), 0);
    who = part;
    at = place + explode * shift;
    gl_Position = tint.a < 0.2 || (mode == 4 && tint.a > 0.55) ? vec4(0, 0, 2, 1) : camera * vec4(at, 1);
    gl_Position.z -= lift * gl_Position.w;
  }`;
const FRAGMENT = `#version 300 es
  precision highp float; precision highp int;
  flat in vec4 tint; flat in uint who; in vec3 at;
  uniform vec3 eye, sun; uniform mat4 light; uniform bool shaded; uniform highp int mode; uniform uint hot; uniform float dark;
  uniform highp sampler2DShadow shade;
  out vec4 colour;
  const vec3 AMBER = vec3(0.99, 0.70, 0.08);
  float reach(vec3 p) {  // the share of the sun that gets to p
    if (!shaded) return 1.0;
    vec3 q = (light * vec4(p, 1)).xyz * 0.5 + 0.5;
    float sum = 0.0;
    for (int i = 0; i < 4; i++) sum += texture(shade, vec3(q.xy + (vec2(i & 1, i >> 1) - 0.5) * 0.0016, q.z));
    return sum / 4.0;
  }
  void main() {
    if (mode == 5) return;
    if (mode == 2) {  // for pointing: the part's number, one up
      uint n = who + 1u;
      colour = vec4(n & 255u, (n >> 8) & 255u, (n >> 16) & 255u, 255u) / 255.0;
      return;
    }
    if (mode == 6) {  // the ground: nothing but shadow, gone before it ends
      float fade = 1.0 - smoothstep(0.75, 1.7, length(at.xy));
      colour = vec4(vec3(0.06, 0.08, 0.10), (1.0 - reach(at)) * fade * mix(0.20, 0.55, dark));
      return;
    }
    if (mode == 4) { colour = vec4(AMBER, 0.5); return; }
    bool chosen = tint.a < 0.55;
    if (mode == 1) { colour = vec4(0.07, 0.10, 0.14, chosen ? 0.9 : 0.5); return; }
    vec3 back = normalize(eye - at);
    if (mode == 3) {  // the sphere: a haze, denser towards its rim
      float rim = 1.0 - abs(dot(normalize(at), back));
      colour = vec4(mix(tint.rgb, vec3(0.22, 0.26, 0.31), dark), 0.50 + 0.35 * rim);
      return;
    }
    vec3 n = normalize(cross(dFdx(at), dFdy(at)));
    if (dot(n, back) < 0.0) n = -n;
    float direct = max(dot(n, sun), 0.0);
    if (direct > 0.0) direct *= reach(at + 0.006 * n + 0.002 * sun);
    float strength = 0.42 + 0.18 * (0.5 + 0.5 * n.z) + 0.36 * direct + 0.12 * dot(n, back);
    float warm = chosen || who == hot ? 0.85 : tint.a < 0.85 ? 0.28 : 0.0;
    colour = vec4(min(mix(tint.rgb, AMBER, warm) * strength, 1.0), 1);
  }`;
