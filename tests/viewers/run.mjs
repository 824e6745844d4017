// Everything: files, validator, loader, viewers, Spark's skinning. Fails where something is not as expected.
//   node run.mjs [--scenes FOLDER] [--docs]
// --scenes keeps the files there, and uses those that it finds; --docs writes docs/viewers.
import assert from "node:assert/strict";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { parseArgs } from "node:util";
import { drawAll, lossOfExtendedSh } from "./draw.mjs";
import { openBrowser } from "./lib/browser.mjs";
import { camera, forViewers } from "./lib/camera.mjs";
import { readGlb } from "./lib/glb.mjs";
import { compared, readNpy, rounded } from "./lib/pictures.mjs";
import { here, makeFiles, makePictures, poseNumber, root } from "./lib/program.mjs";
import { difference, drawn, writeStrip } from "./lib/strip.mjs";
import { attributesArrive, skinAndClipArrive } from "./load.mjs";
import { skinInSpark } from "./skin.mjs";
import { samePose, validate } from "./validate.mjs";

const { values: options } = parseArgs({ options: { scenes: { type: "string" }, docs: { type: "boolean" } } });
const scenes = options.scenes ?? mkdtempSync(join(tmpdir(), "viewers-"));
const at = (name) => join(scenes, name);
const log = console.log;

if (!existsSync(at("ours_spark.npy"))) {
  makeFiles(scenes);
  makePictures(at, camera);
}
await checkFiles();
const ours = (name) => readNpy(at(name));
const browser = await openBrowser(scenes);
try {
  const viewers = forViewers(camera);
  const rows = await drawAll(browser, viewers, ours, log);
  const skinned = await skinInSpark(browser, viewers, ours, at, poseNumber, log);
  const loss = await lossOfExtendedSh(browser, "posed_degree_1.ply", at("posed_degree_1.ply"));
  log(`Spark's extSplats and SH of degree 1: ${JSON.stringify(loss)}`);
  checkPictures(rows, skinned);
  if (options.docs) await writeDocs(rows, skinned, loss);
} finally {
  await browser.close();
  if (!options.scenes) rmSync(scenes, { recursive: true });
}
log("viewers: all as expected");

async function checkFiles() {
  for (const name of ["posed.glb", "posed_degree_0.glb", "skinned.glb", "skinned_8.glb"]) {
    log(`${name}: valid but for ${JSON.stringify(await validate(at(name)))}`);
    log(`${name}: three.js loads ${JSON.stringify(await attributesArrive(at(name)))}`);
  }
  for (const name of ["skinned.glb", "skinned_8.glb"]) {
    log(`${name}: three.js loads ${JSON.stringify(await skinAndClipArrive(at(name)))}`);
  }
  samePose(at("posed.glb"), at("posed.ply"));
  samePose(at("posed_degree_0.glb"), at("posed_degree_0.ply"));
  await theChecksCanFail();
}

/** Damaged files are refused: a name that the extension has not, a quaternion that is none, an accessor out of its buffer. */
async function theChecksCanFail() {
  const damaged = async (name, change) => {
    const bytes = Buffer.from(readFileSync(at("posed_degree_0.glb")));
    change(bytes);
    writeFileSync(at(name), bytes);
    await assert.rejects(validate(at(name)), name);
    rmSync(at(name));
  };
  const replaced = (there, instead) => (bytes) => {
    const place = bytes.indexOf(there);
    assert(place > 0 && there.length === instead.length);
    bytes.write(instead, place, "latin1");
  };
  await damaged("misnamed.glb", replaced("splatting:OPACITY", "splatting:OPACITI"));
  await damaged("mode.glb", replaced('"mode":0', '"mode":1'));
  await damaged("space.glb", replaced("srgb_rec709_display", "srgb_rec709_displax"));
  const { json } = readGlb(at("posed_degree_0.glb"));
  const view = json.accessors[json.meshes[0].primitives[0].attributes["KHR_gaussian_splatting:ROTATION"]].bufferView;
  await damaged("turned.glb", (bytes) => {
    const start = 28 + bytes.readUInt32LE(12) + (json.bufferViews[view].byteOffset ?? 0);
    bytes.writeFloatLE(2, start);
  });
}

/** Right way up and in the right colours, and matched viewers draw as we do. Least PSNR in dB, a little under what was measured. */
function checkPictures(rows, { rows: skinning }) {
  const least = { spark: [27, 48], playcanvas: [29, 50], babylon: [29, 50], three: [18, 25] };
  for (const { viewer, file, how, psnr, complaints } of rows) {
    const floor = how.includes("but") || how.includes("extSplats") ? 27 : least[viewer][how.startsWith("matched") ? 1 : 0];
    assert(psnr >= floor, `${viewer} ${file}, ${how}: ${psnr} dB; expected ${floor}`);
    assert.deepEqual(complaints, [], `${viewer} ${file}, ${how}`);
  }
  const [, alone, , sh, preset] = skinning;
  assert(alone.psnr < 40 && sh.psnr < 40, "SH that are not turned should show");
  assert(preset.psnr > 48, `our preset of Spark's skinning: ${preset.psnr} dB`);
  const picture = rounded(ours("ours.npy"));
  const upsideDown = { ...picture, values: picture.values.slice() };
  const row = 3 * picture.width;
  for (let y = 0; y < picture.height; y++) upsideDown.values.set(picture.values.subarray(y * row, (y + 1) * row), (picture.height - 1 - y) * row);
  assert(compared(upsideDown, picture).psnr < 20, "a picture upside down should be far off");
}

async function writeDocs(rows, skinning, loss) {
  const folder = join(root, "docs/viewers");
  mkdirSync(folder, { recursive: true });
  const average = ours("ours.npy");
  const crop = drawn(average, camera.background);
  const factor = 4;
  const titles = { spark: "Spark", playcanvas: "PlayCanvas", babylon: "Babylon.js", three: "three.js" };
  const write = (name, panels) => writeStrip(browser, join(folder, `${name}.jpg`), panels, crop);
  for (const [viewer, title] of Object.entries(titles)) {
    const of = (how) => rows.find((row) => row.viewer === viewer && row.how === how);
    const own = (how) => (viewer === "three" && how === "matched" ? ours("ours_antialiased.npy") : average);
    const pair = (how) => [
      [`${title}, ${how}: ${of(how).psnr.toFixed(1)} dB`, of(how).picture],
      [`difference, times ${factor}`, difference(of(how).picture, own(how), factor)],
    ];
    await write(viewer, [["ours", average], ...pair("as it comes"), ...pair("matched")]);
  }
  const { skinned, posed, turned, byPlaces } = skinning;
  await write("spark-skinning", [
    ["our average, in Spark", posed],
    ["Spark's skinning", skinned],
    [`difference, times ${factor}`, difference(skinned, posed, factor)],
    [`of this SH, times ${factor}`, difference(skinned, turned, factor)],
    ["joints by places", byPlaces],
  ]);
  writeFileSync(join(folder, "measured.md"), tables(rows, skinning, loss));
}

function tables(rows, { rows: skinning, further }, { share, most }) {
  const { dependencies } = JSON.parse(readFileSync(join(here, "package.json"), "utf8"));
  const versions = Object.entries(dependencies).map(([name, version]) => `${name} ${version}`);
  const row = (cells) => `| ${cells.join(" | ")} |`;
  const numbers = ({ psnr, largest, far }) => [psnr.toFixed(2), (255 * largest).toFixed(0), (100 * far).toFixed(2)];
  const head = ["PSNR dB", "largest, of 255", "% of pixels off by more than 8"];
  const table = (names, body) => [row([...names, ...head]), row([...names.map(() => "---"), ...head.map(() => "--:")]), ...body.map(row)];
  return [
    "# What viewers drew, measured",
    "",
    `Written by \`node tests/viewers/run.mjs --docs\`, ${browser.version} on SwiftShader; ${versions.join(", ")}.`,
    `${camera.width} x ${camera.height} pixels, 8 bits, white behind; against our own picture of the same Gaussians, degree by degree`,
    "(three.js matched: against ours with `--antialiased`).",
    "",
    ...table(["viewer", "file", "how"], rows.map((r) => [r.viewer, r.file, r.how, ...numbers(r)])),
    "",
    `Spark's skinning (${further} Gaussians have more than four bones and were cut to four):`,
    "",
    ...table(["what"], skinning.map((r) => [r.what, ...numbers(r)])),
    "",
    `Spark's \`extSplats\`, SH of degree 1: ${(100 * share).toFixed(0)} % of coefficients have their largest channel cut by more than`,
    `1 %, at most by ${(100 * most).toFixed(0)} %.`,
    "",
  ].join("\n");
}
