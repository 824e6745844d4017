// Skinning into textures, then drawing from them.
function openGl(canvas) {
  const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, preserveDrawingBuffer: true });
  if (!gl) throw new Error("this browser has no WebGL 2");
  if (!gl.getExtension("EXT_color_buffer_float")) throw new Error("this graphics driver cannot draw into textures of floats");
  if (gl.getParameter(gl.MAX_TEXTURE_SIZE) < 12 * meta.rows) throw new Error("the avatar is larger than this graphics driver's textures");
  return gl;
}

function compiled(gl, vertex, fragment) {
  const program = gl.createProgram();
  for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  return program;
}

function texture(gl, format, width, height, layout, type, numbers) {
  const made = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, made);
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
  for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
  gl.texImage2D(gl.TEXTURE_2D, 0, format, width, height, 0, layout, type, numbers);
  return made;
}

const FULL_SCREEN = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }`;

const DIFFERENCE = `#version 300 es
precision highp float;
uniform sampler2D a;
uniform sampler2D b;
out vec4 drawn;
void main() {
  ivec2 place = ivec2(gl_FragCoord.xy);
  drawn = vec4(min(10.0 * abs(texelFetch(a, place, 0).rgb - texelFetch(b, place, 0).rgb), vec3(1.0)), 1.0);
}`;

const COPY = `#version 300 es
precision highp float;
uniform sampler2D a;
out vec4 drawn;
void main() { drawn = vec4(texelFetch(a, ivec2(gl_FragCoord.xy), 0).rgb, 1.0); }`;

// Poses all Gaussians: each call of `pose` fills one set of four textures.
class Skinner {
  constructor(gl) {
    this.gl = gl;
    this.program = compiled(gl, FULL_SCREEN, shaders.skin);
    gl.uniformBlockBinding(this.program, gl.getUniformBlockIndex(this.program, "View_block_0Fragment"), 0);
    const { width, rows, influenceSets } = meta;
    const floats = (planes, numbers) => texture(gl, gl.RGBA32F, width, planes * rows, gl.RGBA, gl.FLOAT, numbers);
    const shTexels = Math.ceil((3 * (meta.shDegree + 1) ** 2) / 4);
    this.inputs = [
      floats(3, data.gaussians),
      floats(influenceSets, Float32Array.from(data.indices)),
      floats(influenceSets, data.weights),
      texture(gl, gl.RGBA32F, 2 * meta.joints, 1, gl.RGBA, gl.FLOAT, null),
      texture(gl, gl.RGBA16F, width, shTexels * rows, gl.RGBA, gl.HALF_FLOAT, data.sh),
    ];
    this.block = gl.createBuffer();
    this.numbers = new ArrayBuffer(48);
  }

  target() {
    const gl = this.gl;
    const textures = [0, 1, 2, 3].map(() => texture(gl, gl.RGBA32F, meta.width, meta.rows, gl.RGBA, gl.FLOAT, null));
    const frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    const places = textures.map((made, k) => {
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + k, gl.TEXTURE_2D, made, 0);
      return gl.COLOR_ATTACHMENT0 + k;
    });
    gl.drawBuffers(places);
    return { frame, textures };
  }

  useFrame(number) {
    const gl = this.gl;
    const row = 8 * meta.joints;
    gl.bindTexture(gl.TEXTURE_2D, this.inputs[3]);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 2 * meta.joints, 1, gl.RGBA, gl.FLOAT, data.motion.subarray(number * row, (number + 1) * row));
  }

  pose(target, { choice, turned, steps, eye }) {
    const gl = this.gl;
    new Float32Array(this.numbers, 0, 3).set(eye);
    new Uint32Array(this.numbers, 12).set([meta.count, meta.width, meta.rows, meta.influenceSets, choice, steps, meta.shDegree, turned ? 1 : 0, 0]);
    gl.bindBuffer(gl.UNIFORM_BUFFER, this.block);
    gl.bufferData(gl.UNIFORM_BUFFER, this.numbers, gl.DYNAMIC_DRAW);
    gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, this.block);
    gl.useProgram(this.program);
    this.inputs.forEach((made, k) => {
      gl.activeTexture(gl.TEXTURE0 + k);
      gl.bindTexture(gl.TEXTURE_2D, made);
      gl.uniform1i(gl.getUniformLocation(this.program, `_group_0_binding_${k + 1}_fs`), k);
    });
    gl.activeTexture(gl.TEXTURE0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    gl.viewport(0, 0, meta.width, meta.rows);
    gl.disable(gl.BLEND);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  // Asks for the degrees off the average of every Gaussian.
  ask(target) {
    const gl = this.gl;
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
    gl.bufferData(gl.PIXEL_PACK_BUFFER, 16 * meta.width * meta.rows, gl.STREAM_READ);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    gl.readBuffer(gl.COLOR_ATTACHMENT0);
    gl.readPixels(0, 0, meta.width, meta.rows, gl.RGBA, gl.FLOAT, 0);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    return { buffer, fence };
  }

  isThere({ fence }) {
    return this.gl.getSyncParameter(fence, this.gl.SYNC_STATUS) === this.gl.SIGNALED;
  }

  degrees({ buffer, fence }) {
    const gl = this.gl;
    const numbers = new Float32Array(4 * meta.width * meta.rows);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, numbers);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    gl.deleteBuffer(buffer);
    gl.deleteSync(fence);
    return Float32Array.from({ length: meta.count }, (_, i) => numbers[4 * i + 3]);
  }
}

class Drawer {
  constructor(gl) {
    this.gl = gl;
    this.program = compiled(gl, shaders.drawVertex, shaders.drawFragment);
    this.difference = compiled(gl, FULL_SCREEN, DIFFERENCE);
    this.copy = compiled(gl, FULL_SCREEN, COPY);
    this.uniform = (name) => gl.getUniformLocation(this.program, name);
    this.array = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
    this.order = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.order);
    gl.bufferData(gl.ARRAY_BUFFER, 4 * meta.count, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribIPointer(1, 1, gl.UNSIGNED_INT, 0, 0);
    gl.vertexAttribDivisor(1, 1);
    gl.bindVertexArray(null);
    this.pictures = [];
  }

  useOrder(order) {
    const gl = this.gl;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.order);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, order);
  }

  // Pictures as large as the canvas, in more than 8 bits: a pixel is the sum of many small parts.
  picture(k, width, height) {
    const gl = this.gl;
    const old = this.pictures[k];
    if (old && old.width === width && old.height === height) return old;
    if (old) {
      gl.deleteTexture(old.made);
      gl.deleteFramebuffer(old.frame);
    }
    const made = texture(gl, gl.RGBA16F, width, height, gl.RGBA, gl.HALF_FLOAT, null);
    const frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, made, 0);
    this.pictures[k] = { made, frame, width, height };
    return this.pictures[k];
  }

  clear(frame, width, height, light) {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.viewport(0, 0, width, height);
    const level = light ? 1 : 0;
    gl.clearColor(level, level, level, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
  }

  // `area` is where in the picture, in pixels; `only` the part of it that is drawn.
  draw(frame, target, camera, area, only, limit) {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.viewport(...area);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(...only);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.useProgram(this.program);
    ["means", "firsts", "seconds", "colours"].forEach((name, k) => {
      gl.activeTexture(gl.TEXTURE0 + k);
      gl.bindTexture(gl.TEXTURE_2D, target.textures[k]);
      gl.uniform1i(this.uniform(name), k);
    });
    gl.activeTexture(gl.TEXTURE0);
    gl.uniform1i(this.uniform("width"), meta.width);
    gl.uniformMatrix4fv(this.uniform("view"), false, camera.matrix);
    gl.uniform1f(this.uniform("focal"), camera.focal(area[3]));
    gl.uniform2f(this.uniform("half_size"), area[2] / 2, area[3] / 2);
    gl.uniform1f(this.uniform("limit"), limit);
    gl.bindVertexArray(this.array);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, meta.count);
    gl.bindVertexArray(null);
    gl.disable(gl.SCISSOR_TEST);
  }

  // A picture, or the difference of two, on the canvas.
  show(pictures, width, height) {
    const gl = this.gl;
    const program = pictures.length > 1 ? this.difference : this.copy;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, width, height);
    gl.disable(gl.BLEND);
    gl.useProgram(program);
    pictures.forEach((picture, k) => {
      gl.activeTexture(gl.TEXTURE0 + k);
      gl.bindTexture(gl.TEXTURE_2D, picture.made);
      gl.uniform1i(gl.getUniformLocation(program, k ? "b" : "a"), k);
    });
    gl.activeTexture(gl.TEXTURE0);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}
