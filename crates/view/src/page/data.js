// What the page holds.
const element = (id) => document.getElementById(id);
const parsed = (id) => JSON.parse(element(id).textContent);
const meta = parsed("meta");
const shaders = parsed("shaders");

function bytesOf(name) {
  const holder = element(`data-${name}`);
  const text = atob(holder.textContent);
  holder.remove();
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes.buffer;
}

const data = {
  gaussians: new Float32Array(bytesOf("gaussians")),
  indices: new Uint16Array(bytesOf("indices")),
  weights: new Float32Array(bytesOf("weights")),
  sh: new Uint16Array(bytesOf("sh")),
  motion: new Float32Array(bytesOf("motion")),
};

// The choices of the skinning shader, in its order.
const choices = [
  ["average", "Average (closed form)", 0],
  ["power", "Average by power steps", 1],
  ["aligned", "Sum of aligned quaternions", 2],
  ["dual", "Dual quaternions", 3],
  ["unaligned", "Sum, signs not aligned", 4],
  ["gram-schmidt", "Gram-Schmidt of the blended matrix", 5],
];
const DUAL = 3;
