#version 300 es
precision highp float;
in vec2 at;
in vec4 colour;
out vec4 drawn;

void main() {
  float alpha = min(0.99, colour.w * exp(-0.5 * dot(at, at)));
  if (alpha < 1.0 / 255.0) discard;
  drawn = vec4(min(colour.rgb, vec3(1.0)) * alpha, alpha);
}
