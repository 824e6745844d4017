// Posed files in viewers, from one camera, beside our own picture: as they come, matched to the original 3DGS, and matched but for one
// property at a time, which says what each is worth.
import assert from "node:assert/strict";
import { compared, rounded } from "./lib/pictures.mjs";
import { readPly } from "./lib/ply.mjs";

// The original 3DGS, and ours: 0.3 squared pixels on the diagonal, splats out to 3 1/3 deviations at most and 1/255 at least, by depth.
const reach = 10 / 3;
const least = 1 / 255;
const widen = reach / Math.sqrt(8);

const spark = {
  "low-pass": { spark: { preBlurAmount: 0.3, blurAmount: 0 } },
  "sorting": { spark: { sortRadial: false } },
  "cut-off": { spark: { maxStdDev: reach, minAlpha: least } },
  "quantised": { spark: { accumExtSplats: true } },
  "8 bits": { float: true },
  "opacity of 1": { cap: 0.99 },
};

const playcanvas = {
  "low-pass": { shaders: [["gsplatCornerVS", "+ 0.3;", "+ 1.2;"]] },
  "kernel": { shaders: [["gsplatPS", "(exp(x * -4.0) - EXP4) * INV_EXP4", "exp(x * -4.0)"]] },
  "cut-off": {
    shaders: [
      ["gsplatCornerVS", "sqrt(2.0 * lambda", `${widen} * sqrt(2.0 * lambda`],
      ["gsplatPS", "exp(x * -4.0)", `exp(x * ${-4 * widen ** 2})`],
      ["gsplatCommonVS", "* 0.5)", `* ${0.5 / widen})`],
    ],
    params: { minPixelSize: 0 },
  },
  "quantised": { params: { dataFormat: "large" } },
};

const babylon = {
  "low-pass": { kernel: 1.2 },
  "cut-off": {
    shaders: [
      ["gaussianSplatting", "min(sqrt(2.0*lambda", `min(${widen}*sqrt(2.0*lambda`],
      ["gaussianSplattingFragmentDeclaration", "-dot(vPosition,vPosition)", `${-(widen ** 2)}*dot(vPosition,vPosition)`],
      ["gaussianSplattingFragmentDeclaration", "A<-4.0", `A<${-4 * widen ** 2}||exp(A)*inColor.a<${least}`],
    ],
  },
};

const three = { "colours": { linear: true } };

const merged = (changes) => {
  const job = {};
  for (const change of changes) {
    for (const [key, value] of Object.entries(change)) {
      if (Array.isArray(value)) job[key] = [...(job[key] ?? []), ...value];
      else if (typeof value === "object") job[key] = { ...job[key], ...value };
      else job[key] = value;
    }
  }
  return job;
};

/** As it comes, matched, and matched but for one property. */
function variants(changes) {
  const all = Object.entries(changes);
  const but = all.map(([name]) => [`matched but ${name}`, all.filter(([other]) => other !== name).map(([, change]) => change)]);
  const cases = [["as it comes", []], ["matched", all.map(([, change]) => change)], ...(all.length > 1 ? but : [])];
  return cases.map(([how, list]) => ({ how, job: merged(list) }));
}

const everyProperty = [
  { viewer: "spark", file: "posed.ply", changes: spark },
  { viewer: "playcanvas", file: "posed.glb", changes: playcanvas },
  { viewer: "babylon", file: "posed.glb", changes: babylon },
  { viewer: "three", file: "posed.glb", changes: three, ours: "ours_antialiased.npy" },
];

const all = (changes) => merged(Object.values(changes));
/** What makes viewers draw as the original 3DGS. */
export const matched = { spark: all(spark), playcanvas: all(playcanvas), babylon: all(babylon) };
const extended = merged([matched.spark, { mesh: { extSplats: true } }]);

const furtherFiles = [
  { viewer: "spark", file: "posed.ply", how: "as it comes, against ours with --antialiased", job: {}, ours: "ours_antialiased.npy" },
  { viewer: "spark", file: "posed.ply", how: "matched, extSplats", job: extended },
  { viewer: "spark", file: "posed_degree_0.ply", how: "matched, extSplats", job: extended, ours: "ours_degree_0.npy" },
  { viewer: "playcanvas", file: "posed.ply", how: "matched", job: matched.playcanvas },
  { viewer: "three", file: "posed.ply", how: "matched", job: all(three), ours: "ours_antialiased.npy" },
  { viewer: "babylon", file: "posed.glb", how: "matched, left-handed", job: { ...matched.babylon, leftHanded: true } },
  { viewer: "babylon", file: "posed.ply", how: "matched, scaling.y = 1", job: { ...matched.babylon, upright: true } },
  // Nobody skins: what is drawn is the rest pose.
  { viewer: "playcanvas", file: "skinned.glb", how: "matched", job: matched.playcanvas, ours: "ours_canonical.npy" },
  { viewer: "babylon", file: "skinned.glb", how: "matched", job: matched.babylon, ours: "ours_canonical.npy" },
  { viewer: "three", file: "skinned.glb", how: "matched", job: all(three), ours: "ours_canonical_antialiased.npy" },
  { viewer: "spark", file: "avatar.ply", how: "matched", job: matched.spark, ours: "ours_canonical.npy" },
  ...["0", "1", "2"].flatMap((degree) => [
    { viewer: "spark", file: `posed_degree_${degree}.ply`, how: "matched", job: matched.spark, ours: `ours_degree_${degree}.npy` },
    { viewer: "playcanvas", file: `posed_degree_${degree}.ply`, how: "matched", job: matched.playcanvas, ours: `ours_degree_${degree}.npy` },
  ]),
  { viewer: "spark", file: "posed_padded.ply", how: "matched", job: matched.spark, ours: "ours_degree_2.npy" },
  { viewer: "playcanvas", file: "posed_padded.ply", how: "matched", job: matched.playcanvas, ours: "ours_degree_2.npy" },
];

/** All rows: { viewer, file, how, psnr, largest, far, picture, complaints }. `ours` opens one of our own pictures. */
export async function drawAll(browser, camera, ours, log) {
  const jobs = everyProperty.flatMap(({ changes, ...rest }) => variants(changes).map((variant) => ({ ...rest, ...variant })));
  const rows = [];
  for (const { viewer, file, how, job, ours: name = "ours.npy" } of [...jobs, ...furtherFiles]) {
    const start = Date.now();
    const picture = await browser.draw(viewer, { file, camera, ...job });
    const row = { viewer, file, how, ...compared(rounded(picture), rounded(ours(name))), picture, complaints: picture.complaints };
    log(`${viewer} ${file}, ${how}: ${row.psnr.toFixed(2)} dB, ${((Date.now() - start) / 1000).toFixed(1)} s`);
    rows.push(row);
  }
  for (const file of ["posed.glb", "skinned.glb"]) {
    await assert.rejects(browser.draw("spark", { file, camera }), /Unknown file type/, `Spark opens ${file}`);
  }
  return rows;
}

/** What Spark's `extSplats` loses of SH of degree 1: the share of coefficients whose largest channel is off by over 1 %, and the most. */
export async function lossOfExtendedSh(browser, file, path) {
  const { answer } = await browser.ask("spark", "extendedSh", { file });
  const bytes = Buffer.from(answer.base64, "base64");
  const { count, columns } = readPly(path);
  let [off, most] = [0, 0];
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < 3; k++) {
      const word = bytes.readUInt32LE(4 * (4 * i + k));
      const unit = 2 ** ((word >>> 27) - 15) / 255;
      const held = [0, 8, 16].map((shift) => ((word >>> shift) & 255) * unit);
      const given = [0, 1, 2].map((c) => Math.abs(columns[`f_rest_${3 * c + k}`][i]));
      const largest = Math.max(...given);
      const loss = largest > 1e-4 ? 1 - held[given.indexOf(largest)] / largest : 0;
      if (loss > 0.01) off++;
      most = Math.max(most, loss);
    }
  }
  return { share: off / (3 * count), most };
}
