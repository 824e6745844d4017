// Both kinds of GLB by the Khronos validator, and by us what it does not know: the names of KHR_gaussian_splatting and their values.
import assert from "node:assert/strict";
import validator from "gltf-validator";
import { readGlb } from "./lib/glb.mjs";
import { readPly } from "./lib/ply.mjs";

const extension = "KHR_gaussian_splatting";
const types = { ROTATION: "VEC4", SCALE: "VEC3", OPACITY: "SCALAR" };
const degrees = [0, 1, 2, 3].map((l) => Array.from({ length: 2 * l + 1 }, (_, n) => `SH_DEGREE_${l}_COEF_${n}`));
degrees.flat().forEach((name) => (types[name] = "VEC3"));

// What follows from the validator not knowing the extension. Anything else is a fault of the file.
const overridden = {
  UNSUPPORTED_EXTENSION: (pointer, json) => json.extensionsUsed[pointer.split("/").pop()] === extension,
  MESH_PRIMITIVE_INVALID_ATTRIBUTE: (pointer) => {
    const [prefix, name] = pointer.split("/").pop().split(":");
    return pointer.startsWith("/meshes/") && prefix === extension && name in types;
  },
};

/** Validates a file; returns how many messages of which code were overridden. */
export async function validate(path) {
  const { bytes, json } = readGlb(path);
  const { issues } = await validator.validateBytes(new Uint8Array(bytes), { maxIssues: 0 });
  const counts = {};
  for (const { code, pointer = "", message } of issues.messages) {
    assert(overridden[code]?.(pointer, json), `${path}: ${code} at ${pointer}: ${message}`);
    counts[code] = (counts[code] ?? 0) + 1;
  }
  checkNames(path);
  return counts;
}

/** The names, types, counts and ranges that the extension asks for. */
function checkNames(path) {
  const { json, accessor } = readGlb(path);
  assert.deepEqual(json.extensionsUsed, [extension]);
  assert.equal(json.extensionsRequired, undefined, "points may be drawn without the extension");
  const splats = json.meshes.flatMap((mesh) => mesh.primitives);
  assert.equal(splats.length, 1);
  const [{ attributes, mode, extensions }] = splats;
  assert.equal(mode, 0);
  assert.deepEqual(extensions[extension], { kernel: "ellipse", colorSpace: "srgb_rec709_display" });
  const count = json.accessors[attributes.POSITION].count;
  const prefixed = Object.keys(attributes).filter((name) => name.includes(":"));
  const bands = degrees.filter((names) => attributes[`${extension}:${names[0]}`] !== undefined);
  const expected = ["ROTATION", "SCALE", "OPACITY", ...degrees.slice(0, bands.length).flat()];
  assert.deepEqual(prefixed.sort(), expected.map((name) => `${extension}:${name}`).sort());
  for (const name of expected) {
    const { componentType, type, count: own, normalized } = json.accessors[attributes[`${extension}:${name}`]];
    assert.deepEqual([componentType, type, own, normalized ?? false], [5126, types[name], count, false], name);
  }
  const rotations = accessor(attributes[`${extension}:ROTATION`]);
  for (let i = 0; i < rotations.length; i += 4) {
    assert(Math.abs(Math.hypot(...rotations.subarray(i, i + 4)) - 1) < 1e-6, `ROTATION[${i / 4}] is no unit quaternion`);
  }
  assert(accessor(attributes[`${extension}:SCALE`]).every((s) => s >= 0 && Number.isFinite(s)), "SCALE");
  assert(accessor(attributes[`${extension}:OPACITY`]).every((o) => o >= 0 && o <= 1), "OPACITY");
}

/** A GLB and a PLY of one pose hold the same Gaussians: the PLY logarithms and logits, channels one after the other. */
export function samePose(glbPath, plyPath) {
  const { json, accessor } = readGlb(glbPath);
  const { attributes } = json.meshes[0].primitives[0];
  const read = (name) => accessor(attributes[name]);
  const { count, names, columns } = readPly(plyPath);
  const rest = names.filter((name) => name.startsWith("f_rest_")).length / 3;
  const near = (one, two, what) => assert(Math.abs(one - two) <= 2e-6 * Math.max(1, Math.abs(two)), `${what}: ${one}, ${two}`);
  const [position, rotation] = [read("POSITION"), read(`${extension}:ROTATION`)];
  const [scale, opacity] = [read(`${extension}:SCALE`), read(`${extension}:OPACITY`)];
  const sh = degrees.flat().slice(0, rest + 1).map((name) => read(`${extension}:${name}`));
  assert.equal(position.length, 3 * count);
  for (let i = 0; i < count; i++) {
    ["x", "y", "z"].forEach((name, c) => assert.equal(position[3 * i + c], columns[name][i]));
    [1, 2, 3, 0].forEach((from, c) => near(rotation[4 * i + c], columns[`rot_${from}`][i], "rotation"));
    [0, 1, 2].forEach((c) => near(Math.log(scale[3 * i + c]), columns[`scale_${c}`][i], "scale"));
    near(opacity[i], 1 / (1 + Math.exp(-columns.opacity[i])), "opacity");
    sh.forEach((values, k) => {
      for (let c = 0; c < 3; c++) {
        const column = k === 0 ? `f_dc_${c}` : `f_rest_${c * rest + k - 1}`;
        assert.equal(values[3 * i + c], columns[column][i], column);
      }
    });
  }
}
