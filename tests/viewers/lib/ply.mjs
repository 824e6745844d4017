// 3DGS PLY, little endian: a column per property, whole numbers too.
import { readFileSync } from "node:fs";

const readers = { float: ["readFloatLE", 4], uint: ["readUInt32LE", 4] };

export function readPly(path) {
  const bytes = readFileSync(path);
  const end = bytes.indexOf("end_header\n") + "end_header\n".length;
  const lines = bytes.toString("latin1", 0, end).split("\n");
  if (!lines.includes("format binary_little_endian 1.0")) throw new Error(`${path}: another encoding`);
  const count = Number(lines.find((line) => line.startsWith("element vertex ")).split(" ")[2]);
  const properties = lines.filter((line) => line.startsWith("property ")).map((line) => line.split(" "));
  const stride = properties.reduce((total, [, type]) => total + readers[type][1], 0);
  const columns = {};
  let offset = end;
  for (const [, type, name] of properties) {
    const [read, size] = readers[type];
    columns[name] = Float32Array.from({ length: count }, (_, i) => bytes[read](offset + i * stride));
    offset += size;
  }
  return { count, names: Object.keys(columns), columns };
}
