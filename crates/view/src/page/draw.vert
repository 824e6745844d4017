#version 300 es
precision highp float;
precision highp sampler2D;
// A quad per Gaussian, from back to front.
layout(location = 0) in vec2 corner;
layout(location = 1) in uint which;
uniform sampler2D means;
uniform sampler2D firsts;
uniform sampler2D seconds;
uniform sampler2D colours;
uniform int width;
// World to camera: the camera looks along -z, y up.
uniform mat4 view;
// Pixels per unit of x / depth, and half the picture in pixels.
uniform float focal;
uniform vec2 half_size;
// Degrees that are marked fully; 0 marks nothing.
uniform float limit;
out vec2 at;
out vec4 colour;

void main() {
  ivec2 place = ivec2(int(which) % width, int(which) / width);
  vec4 mean = texelFetch(means, place, 0);
  vec3 c = (view * vec4(mean.xyz, 1.0)).xyz;
  float depth = -c.z;
  gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
  at = vec2(0.0);
  colour = vec4(0.0);
  vec4 own = texelFetch(colours, place, 0);
  if (depth < 0.05 || own.w < 1.0 / 255.0) return;
  vec4 a = texelFetch(firsts, place, 0);
  vec4 b = texelFetch(seconds, place, 0);
  mat3 world = mat3(a.x, a.y, a.z, a.y, a.w, b.x, a.z, b.x, b.y);
  mat3 turn = mat3(view);
  mat3 seen = turn * world * transpose(turn);
  // Derivative of the projection, its slope held within 1.3 times the picture as 3DGS does.
  vec2 most = 1.3 * half_size / focal;
  vec2 slope = clamp(c.xy / depth, -most, most);
  vec3 jx = focal / depth * vec3(1.0, 0.0, slope.x);
  vec3 jy = focal / depth * vec3(0.0, 1.0, slope.y);
  vec3 sx = seen * jx;
  vec3 sy = seen * jy;
  // The dilation of 3DGS.
  float xx = dot(jx, sx) + 0.3;
  float xy = dot(jx, sy);
  float yy = dot(jy, sy) + 0.3;
  float middle = 0.5 * (xx + yy);
  float apart = sqrt(max(0.25 * (xx - yy) * (xx - yy) + xy * xy, 0.0));
  float large = middle + apart;
  float small = max(middle - apart, 0.05);
  vec2 axis = apart < 1e-6 ? vec2(1.0, 0.0) : normalize(abs(xx - yy) > 0.0 && xx >= yy ? vec2(large - yy, xy) : vec2(xy, large - xx));
  float reach = sqrt(2.0 * log(own.w * 255.0));
  at = corner * reach;
  vec2 offset = at.x * sqrt(large) * axis + at.y * sqrt(small) * vec2(-axis.y, axis.x);
  vec2 centre = focal * c.xy / depth;
  gl_Position = vec4((centre + offset) / half_size, 0.0, 1.0);
  colour = vec4(own.rgb, own.w);
  if (limit > 0.0) {
    float t = clamp(mean.w / limit, 0.0, 1.0);
    float grey = 0.25 + 0.5 * dot(own.rgb, vec3(0.3, 0.6, 0.1));
    // From grey over orange to magenta.
    vec3 mark = t < 0.5 ? mix(vec3(1.0, 0.85, 0.2), vec3(1.0, 0.35, 0.05), 2.0 * t) : mix(vec3(1.0, 0.35, 0.05), vec3(0.9, 0.0, 0.6), 2.0 * t - 1.0);
    colour.rgb = mix(vec3(grey), mark, smoothstep(0.0, 0.1, t));
  }
}
