// Spark's own skinning, driven with the joints, weights and clip of a skinned GLB: what it draws beside the posed files.
import assert from "node:assert/strict";
import * as THREE from "three";
import { readGlb } from "./lib/glb.mjs";
import { compared, rounded } from "./lib/pictures.mjs";
import { readPly } from "./lib/ply.mjs";
import { jointMotions } from "./load.mjs";
import { matched } from "./draw.mjs";

const seven = (matrix) => {
  const [place, turn, scale] = [new THREE.Vector3(), new THREE.Quaternion(), new THREE.Vector3()];
  matrix.decompose(place, turn, scale);
  assert(Math.hypot(scale.x - 1, scale.y - 1, scale.z - 1) < 1e-5, "joints that scale");
  return [...turn.toArray(), ...place.toArray()];
};

/** Joints and weights of each Gaussian, the four largest, their sum 1; as Spark takes them. */
function influences(path) {
  const { json, accessor } = readGlb(path);
  const { attributes } = json.meshes[0].primitives[0];
  const sets = [0, 1].filter((n) => attributes[`JOINTS_${n}`] !== undefined);
  const of = (name) => sets.map((n) => accessor(attributes[`${name}_${n}`]));
  const [joints, weights] = [of("JOINTS"), of("WEIGHTS")];
  const answer = { joints: [], weights: [], further: 0 };
  for (let i = 0; i < joints[0].length / 4; i++) {
    const row = sets.flatMap((_, s) => [0, 1, 2, 3].map((k) => [joints[s][4 * i + k], weights[s][4 * i + k]]));
    const kept = row.sort((a, b) => b[1] - a[1]).slice(0, 4);
    const sum = kept.reduce((total, [, weight]) => total + weight, 0);
    if (row[4]?.[1] > 0) answer.further++;
    answer.joints.push(...kept.map(([joint]) => joint));
    answer.weights.push(...kept.map(([, weight]) => weight / sum));
  }
  return answer;
}

/** The skin of a file at a key of its clip. Joints are given by their motion, or by where they are at rest and posed. */
async function skin(path, key, byPlaces) {
  const joints = await jointMotions(path, key);
  const still = new THREE.Matrix4();
  const rest = joints.map((joint) => seven(byPlaces ? joint.rest : still));
  const posed = joints.map(({ rest, motion }) => seven(byPlaces ? motion.clone().multiply(rest) : motion));
  return { rest, posed, ...influences(path) };
}

/** Draws the avatar as Spark skins it, and what it is to be held against. */
export async function skinInSpark(browser, camera, ours, at, key, log) {
  const { json, accessor } = readGlb(at("skinned.glb"));
  const { x, y, z } = readPly(at("avatar.ply")).columns;
  const places = accessor(json.meshes[0].primitives[0].attributes.POSITION);
  x.forEach((_, i) => assert.deepEqual([x[i], y[i], z[i]], [...places.subarray(3 * i, 3 * i + 3)], "another order"));

  const draw = (file, more = {}) => browser.draw("spark", { file, camera, ...matched.spark, ...more });
  const bones = await skin(at("skinned.glb"), key, false);
  const skinned = await draw("avatar.ply", { skin: bones });
  const byPlaces = await draw("avatar.ply", { skin: await skin(at("skinned.glb"), key, true) });
  // Linear mode takes extended splats only, whose SH are clipped: it is held against a file drawn alike.
  const extended = { mesh: { extSplats: true } };
  const linear = await draw("avatar.ply", { skin: { ...bones, linear: true }, ...extended });
  const posedExtended = await draw("posed.ply", extended);
  const posed = await draw("posed.ply");
  const turned = await draw("posed_spark_sh_turned.ply");
  const alone = await draw("posed_spark.ply");
  const sides = [
    ["Spark's skinning, against our average drawn by Spark", skinned, posed],
    ["our preset engine-spark drawn by Spark, against the same", alone, posed],
    ["the same with SH turned, against the same: its means and rotations alone", turned, posed],
    ["Spark's skinning, against its means and rotations with SH turned: SH alone", skinned, turned],
    ["Spark's skinning, against our preset engine-spark drawn by Spark", skinned, alone],
    ["Spark's skinning, against our renderer under the preset", skinned, ours("ours_spark.npy")],
    ["our average without SH turned against it with, our renderer", ours("ours_sh_alone.npy"), ours("ours.npy")],
    ["Spark's skinning in linear mode, against our average drawn by Spark", linear, posedExtended],
    ["joints by rest and posed places, against our average drawn by Spark", byPlaces, posed],
  ];
  const rows = sides.map(([what, one, two]) => ({ what, ...compared(rounded(one), rounded(two)) }));
  rows.forEach(({ what, psnr }) => log(`${what}: ${psnr.toFixed(2)} dB`));
  return { rows, skinned, posed, turned, byPlaces, further: bones.further };
}
