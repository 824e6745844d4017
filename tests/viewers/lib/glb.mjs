// GLB files, read without anybody's loader: the document, and accessors as numbers.
import { readFileSync } from "node:fs";

const widths = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4, MAT4: 16 };
const arrays = { 5121: Uint8Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array };

export function readGlb(path) {
  const bytes = readFileSync(path);
  if (bytes.toString("latin1", 0, 4) !== "glTF") throw new Error(`${path}: no GLB`);
  const length = bytes.readUInt32LE(12);
  const json = JSON.parse(bytes.toString("utf8", 20, 20 + length));
  const binary = bytes.subarray(20 + length + 8);
  const accessor = (index) => {
    const { bufferView, byteOffset = 0, componentType, count, type } = json.accessors[index];
    const view = json.bufferViews[bufferView];
    if (view.byteStride) throw new Error(`${path}: interleaved`);
    const start = binary.byteOffset + (view.byteOffset ?? 0) + byteOffset;
    return new arrays[componentType](binary.buffer, start, count * widths[type]);
  };
  return { json, bytes, accessor };
}
