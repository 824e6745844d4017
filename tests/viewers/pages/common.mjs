// What the pages of all viewers share.

export function canvas({ width, height }) {
  const element = document.createElement("canvas");
  Object.assign(element, { width, height });
  document.body.append(element);
  return element;
}

export async function bytesOf(name) {
  const response = await fetch(`/scenes/${name}`);
  if (!response.ok) throw new Error(`${name}: ${response.status}`);
  return new Uint8Array(await response.arrayBuffer());
}

/** What is on a WebGL canvas now, rows from below. */
export function readBack(gl, { width, height }, said = {}) {
  const pixels = new Uint8Array(4 * width * height);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  return answer(pixels, { width, height }, said);
}

export function answer(pixels, { width, height }, said = {}) {
  const bytes = new Uint8Array(pixels.buffer, pixels.byteOffset, pixels.byteLength);
  let text = "";
  for (let k = 0; k < bytes.length; k += 0x8000) text += String.fromCharCode(...bytes.subarray(k, k + 0x8000));
  return { width, height, base64: btoa(text), float: pixels instanceof Float32Array, said };
}

export const nextFrame = () => new Promise((resolve) => requestAnimationFrame(resolve));

export async function until(condition, what, seconds = 60) {
  const end = performance.now() + 1000 * seconds;
  while (!condition()) {
    if (performance.now() > end) throw new Error(`waited ${seconds} s for ${what}`);
    await nextFrame();
  }
}
