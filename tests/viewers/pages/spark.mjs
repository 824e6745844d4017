// Spark: posed PLY files, and its own skinning.
import { SparkRenderer, SplatMesh, SplatSkinning, SplatSkinningMode } from "@sparkjsdev/spark";
import * as THREE from "three";
import { answer, bytesOf, canvas, readBack, until } from "./common.mjs";

/**
 * `spark` and `mesh` are options of SparkRenderer and SplatMesh; `float` draws into floats in place of 8 bits; no splat covers more
 * than `cap` of a pixel.
 */
export async function draw({ file, camera, spark: options = {}, mesh: meshOptions = {}, float = false, cap = 1, skin = null }) {
  // Without this, Spark turns colours to linear ones for targets other than the canvas.
  if (float) THREE.ColorManagement.workingColorSpace = THREE.SRGBColorSpace;
  const renderer = new THREE.WebGLRenderer({ canvas: canvas(camera), antialias: false, preserveDrawingBuffer: true });
  renderer.setSize(camera.width, camera.height, false);
  renderer.setClearColor(new THREE.Color(...camera.background), 1);
  const scene = new THREE.Scene();
  const covSplats = skin?.linear ?? false; // what linear blend skinning asks for
  const spark = new SparkRenderer({ renderer, autoUpdate: false, covSplats, ...options });
  capAlpha(spark.material, cap);
  scene.add(spark);
  const mesh = new SplatMesh({ fileBytes: await bytesOf(file), fileName: file, covSplats, ...meshOptions });
  await mesh.initialized;
  scene.add(mesh);
  if (skin) mesh.skinning = skinning(mesh, skin);
  const eye = threeCamera(camera);
  const target = float ? new THREE.WebGLRenderTarget(camera.width, camera.height, { type: THREE.FloatType }) : null;
  renderer.setRenderTarget(target);
  renderer.render(scene, eye); // the size, which updates ask for
  await spark.update({ scene, camera: eye });
  await until(() => !spark.sorting && !spark.sortDirty, "sorting");
  renderer.render(scene, eye);
  const said = { splats: mesh.numSplats, drawn: spark.activeSplats };
  if (!float) return readBack(renderer.getContext(), camera, said);
  const pixels = new Float32Array(4 * camera.width * camera.height);
  renderer.readRenderTargetPixels(target, 0, 0, camera.width, camera.height, pixels);
  return answer(pixels, camera, said);
}

function capAlpha(material, cap) {
  const line = "if (rgba.a < minAlpha)";
  if (!material.fragmentShader.includes(line)) throw new Error("another shader than expected");
  if (cap < 1) material.fragmentShader = material.fragmentShader.replace(line, `rgba.a = min(rgba.a, ${cap});\n${line}`);
}

export function threeCamera({ width, height, near, far, fov, view, projection }) {
  const camera = new THREE.PerspectiveCamera(fov, width / height, near, far);
  camera.matrixAutoUpdate = false;
  camera.matrix.fromArray(view).invert();
  camera.matrix.decompose(camera.position, camera.quaternion, camera.scale);
  camera.updateMatrixWorld(true);
  camera.projectionMatrix.fromArray(projection);
  camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
  return camera;
}

/**
 * Bones as Spark takes them. `rest` and `posed` are seven numbers a joint, quaternion (x, y, z, w) and place; `joints` and `weights`
 * are four a splat; `linear` blends matrices, not dual quaternions.
 */
function skinning(mesh, { rest, posed, joints, weights, linear = false }) {
  const mode = linear ? SplatSkinningMode.LINEAR_BLEND : SplatSkinningMode.DUAL_QUATERNION;
  const skinning = new SplatSkinning({ mesh, numBones: rest.length, mode });
  const parts = (bone) => [new THREE.Quaternion(...bone.slice(0, 4)), new THREE.Vector3(...bone.slice(4))];
  rest.forEach((bone, j) => skinning.setRestQuatPos(j, ...parts(bone)));
  posed.forEach((bone, j) => skinning.setBoneQuatPos(j, ...parts(bone)));
  for (let i = 0; i < mesh.numSplats; i++) {
    const four = (values) => new THREE.Vector4(...values.slice(4 * i, 4 * i + 4));
    skinning.setSplatBones(i, four(joints), four(weights));
  }
  skinning.updateBones();
  return skinning;
}

/** The first band of SH in Spark's extended form, three words a splat: as it holds them, base64. */
export async function extendedSh({ file }) {
  const mesh = new SplatMesh({ fileBytes: await bytesOf(file), fileName: file, extSplats: true });
  await mesh.initialized;
  const words = mesh.extSplats.extra.sh1;
  return answer(words.slice(0, 4 * mesh.numSplats), { width: 4, height: mesh.numSplats });
}
