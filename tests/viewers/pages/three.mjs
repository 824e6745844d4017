// three.js: PLY and GLB with KHR_gaussian_splatting, by its own splats (WebGPURenderer, here on WebGL 2).
import { GaussianSplatPLYLoader } from "three/addons/loaders/GaussianSplatPLYLoader.js";
import { GLTFGaussianSplatLoaderExtension } from "three/addons/loaders/GLTFGaussianSplatLoaderExtension.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { GaussianSplat } from "three/addons/objects/GaussianSplat.js";
import * as THREE from "three/webgpu";
import { canvas, nextFrame, readBack } from "./common.mjs";

/** `linear` keeps the renderer from turning what splats say into sRGB once more. */
export async function draw({ file, camera, linear = false }) {
  const element = canvas(camera);
  const context = element.getContext("webgl2", { preserveDrawingBuffer: true, alpha: false, antialias: false });
  const renderer = new THREE.WebGPURenderer({ canvas: element, context, forceWebGL: true, antialias: false });
  await renderer.init();
  if (linear) renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
  renderer.setSize(camera.width, camera.height, false);
  renderer.setClearColor(new THREE.Color(...camera.background), 1);
  const splats = await loaded(file);
  const world = new THREE.Scene();
  world.add(splats);
  const eye = new THREE.PerspectiveCamera(camera.fov, camera.width / camera.height, camera.near, camera.far);
  eye.matrix.fromArray(camera.view).invert().decompose(eye.position, eye.quaternion, eye.scale);
  for (let frames = 0; frames < 5; frames++) {
    renderer.render(world, eye);
    await nextFrame();
  }
  return readBack(context, camera, { revision: THREE.REVISION });
}

async function loaded(file) {
  if (file.endsWith(".ply")) return new GaussianSplat(await new GaussianSplatPLYLoader().loadAsync(`/scenes/${file}`));
  const loader = new GLTFLoader();
  loader.register((parser) => new GLTFGaussianSplatLoaderExtension(parser));
  return (await loader.loadAsync(`/scenes/${file}`)).scene;
}
