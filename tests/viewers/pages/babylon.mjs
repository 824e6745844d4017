// Babylon.js: PLY and GLB with KHR_gaussian_splatting.
import { FreeCamera } from "@babylonjs/core/Cameras/freeCamera.js";
import { Engine } from "@babylonjs/core/Engines/engine.js";
import { ShaderStore } from "@babylonjs/core/Engines/shaderStore.js";
import { LoadAssetContainerAsync } from "@babylonjs/core/Loading/sceneLoader.js";
import { GaussianSplattingMaterial } from "@babylonjs/core/Materials/GaussianSplatting/gaussianSplattingMaterial.js";
import { Color4 } from "@babylonjs/core/Maths/math.color.js";
import { Matrix, Vector3 } from "@babylonjs/core/Maths/math.vector.js";
import { Scene } from "@babylonjs/core/scene.js";
import "@babylonjs/core/Shaders/gaussianSplatting.fragment.js";
import "@babylonjs/core/Shaders/gaussianSplatting.vertex.js";
import "@babylonjs/loaders/glTF/2.0/index.js";
import "@babylonjs/loaders/SPLAT/splatFileLoader.js";
import { canvas, nextFrame, readBack } from "./common.mjs";

/**
 * `kernel` is the low-pass in Babylon's unit, a quarter of a squared pixel; `shaders` are changes of shader includes, [include, what is
 * there, what to put there]; `leftHanded` is how Babylon's scenes are by default; `upright` takes back the
 * mirroring of y by which its loader of PLY expects y down.
 */
export async function draw({ file, camera, kernel = null, shaders = [], leftHanded = false, upright = false }) {
  if (kernel !== null) GaussianSplattingMaterial.KernelSize = kernel;
  const engine = new Engine(canvas(camera), false, { preserveDrawingBuffer: true, alpha: false });
  changeShaders(shaders);
  const scene = new Scene(engine);
  scene.useRightHandedSystem = !leftHanded;
  scene.clearColor = new Color4(...camera.background, 1);
  place(scene, camera, leftHanded);
  const container = await LoadAssetContainerAsync(`/scenes/${file}`, scene);
  container.addAllToScene();
  const splats = scene.meshes.find((mesh) => mesh.getClassName() === "GaussianSplattingMesh");
  if (!splats) throw new Error(`no splats among ${scene.meshes.map((mesh) => mesh.getClassName())}`);
  if (upright) splats.scaling.y = 1;
  await scene.whenReadyAsync();
  for (let frames = 0; frames < 20; frames++) {
    scene.render();
    await nextFrame();
  }
  return readBack(engine._gl, camera, { version: Engine.Version, splats: splats.splatCount });
}

function changeShaders(changes) {
  const includes = ShaderStore.IncludesShadersStore;
  for (const [name, there, instead] of changes) {
    if (!includes[name]?.includes(there)) throw new Error(`${name}: another shader than expected`);
    includes[name] = includes[name].replaceAll(there, instead);
  }
}

/** In a left-handed scene the loader mirrors x, and so does this. */
function place(scene, { near, far, view, projection }, leftHanded) {
  const world = Matrix.FromArray(view).invert();
  const mirrored = (x, y, z) => new Vector3(leftHanded ? -x : x, y, z);
  const m = world.m;
  const eye = mirrored(m[12], m[13], m[14]);
  const camera = new FreeCamera("camera", eye, scene);
  camera.upVector = mirrored(m[4], m[5], m[6]);
  camera.setTarget(eye.subtract(mirrored(m[8], m[9], m[10])));
  [camera.minZ, camera.maxZ] = [near, far];
  // Depth grows along +z in left-handed views.
  const turned = projection.map((v, k) => (leftHanded && k >= 8 && k < 12 ? -v : v));
  camera.freezeProjectionMatrix(Matrix.FromArray(turned));
}
