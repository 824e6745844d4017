// The program, and the files that it makes here.
import { execFileSync } from "node:child_process";
import { mkdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

export const here = fileURLToPath(new URL("..", import.meta.url));
export const root = fileURLToPath(new URL("../../..", import.meta.url));
const program = process.env.REPRODUCE ?? join(root, "target/release/reproduce");

const body = join(root, "tests/data/blender/models/anny_smpl24.npz");
const sequence = join(root, "tests/data/blender/datasets/snapshot_ava/test_twist/transforms.json");
const frame = 1;

/** The pose: what `export`, `render` and `skin` take. */
export const pose = ["--body", body, "--poses", sequence, "--frame", String(frame)];
export const poseNumber = frame;

/** Runs `reproduce`; its complaints are those of this test. */
export function reproduce(...args) {
  return execFileSync(program, args, { cwd: root, encoding: "utf8", stdio: ["ignore", "pipe", "inherit"] });
}

/** An avatar fitted to built-in data, SH of degree 3, and what is exported of it. Returns where a file of a name lies. */
export function makeFiles(folder) {
  mkdirSync(folder, { recursive: true });
  const at = (name) => join(folder, name);
  const fit = (recipe, iterations, name) =>
    reproduce("fit", "snapshot_ava", "-q", "--recipe", recipe, "--iterations", iterations, "--out", at(name));
  fit("hugs-skinned", "600", "avatar.ply");
  const exported = (kind, name, ...more) =>
    reproduce("export", at("avatar.ply"), ...pose, "--to", kind, ...more, "--out", at(name));
  exported("posed-ply", "posed.ply");
  exported("posed-ply", "posed_degree_0.ply", "--degree", "0");
  exported("posed-ply", "posed_degree_1.ply", "--degree", "1");
  // As Spark poses, and the same with SH turned.
  exported("posed-ply", "posed_spark.ply", "--strategy", "engine-spark");
  exported("posed-ply", "posed_spark_sh_turned.ply", "--strategy", "engine-spark+colour=rotate-sh");
  exported("glb", "posed.glb");
  exported("glb", "posed_degree_0.glb", "--degree", "0");
  exported("skinned-glb", "skinned.glb");
  // SH of degree 2, padded to 3 for viewers that expect 62 properties.
  fit("splattingavatar-skinned", "20", "degree_2.ply");
  for (const [name, more] of [["posed_degree_2.ply", []], ["posed_padded.ply", ["--degree", "3"]]]) {
    reproduce("export", at("degree_2.ply"), ...pose, "--to", "posed-ply", ...more, "--out", at(name));
  }
  // A rig with eight influences: JOINTS_1, WEIGHTS_1, and the clips of another program.
  const rig = join(root, "tests/data/blender/models/ava_smplx55_8inf.glb");
  const more = ["--body", rig, "--poses", rig, "--to", "skinned-glb", "-q"];
  reproduce("export", at("posed.ply"), ...more, "--out", at("skinned_8.glb"));
  return at;
}

/** Our own pictures, by the name of the file that `render` writes: f32. */
export function makePictures(at, camera) {
  writeFileSync(at("camera.json"), JSON.stringify(camera));
  const render = (file, name, ...more) =>
    reproduce("render", at(file), "--camera", at("camera.json"), "--out", at(name), "-q", ...more);
  render("posed.ply", "ours.npy");
  render("posed.ply", "ours_antialiased.npy", "--antialiased");
  render("avatar.ply", "ours_canonical.npy");
  render("avatar.ply", "ours_canonical_antialiased.npy", "--antialiased");
  ["0", "1", "2"].forEach((degree) => render(`posed_degree_${degree}.ply`, `ours_degree_${degree}.npy`));
  render("avatar.ply", "ours_spark.npy", ...pose, "--strategy", "engine-spark");
  render("avatar.ply", "ours_sh_alone.npy", ...pose, "--strategy", "quaternion-average+colour=none");
}
