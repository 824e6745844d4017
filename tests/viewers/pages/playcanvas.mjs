// PlayCanvas: PLY and GLB with KHR_gaussian_splatting.
import * as pc from "playcanvas";
import { canvas, nextFrame, readBack } from "./common.mjs";

const graphics = { deviceTypes: [pc.DEVICETYPE_WEBGL2], antialias: false, preserveDrawingBuffer: true, alpha: false };

/** `params` are those of scene.gsplat; `shaders` are changes of shader chunks, [chunk, what is there, what to put there]. */
export async function draw({ file, camera, params = {}, shaders = [] }) {
  const element = canvas(camera);
  const device = await pc.createGraphicsDevice(element, graphics);
  device.maxPixelRatio = 1;
  const app = new pc.AppBase(element);
  const options = new pc.AppOptions();
  options.graphicsDevice = device;
  options.componentSystems = [pc.CameraComponentSystem, pc.RenderComponentSystem, pc.GSplatComponentSystem];
  options.resourceHandlers = [pc.TextureHandler, pc.ContainerHandler, pc.GSplatHandler];
  app.init(options);
  app.setCanvasFillMode(pc.FILLMODE_NONE, camera.width, camera.height);
  app.setCanvasResolution(pc.RESOLUTION_FIXED, camera.width, camera.height);
  changeShaders(device, shaders);
  Object.assign(app.scene.gsplat, params);
  app.start();
  app.root.addChild(eye(camera));
  const asset = await loaded(app, file);
  app.root.addChild(splats(asset));
  let ready = 0;
  app.systems.gsplat.on("frame:ready", (_camera, _layer, isReady, loading) => (ready = isReady && !loading ? ready + 1 : 0));
  for (let frames = 0; ready < 5; frames++) {
    if (frames > 600) throw new Error("waited for a sorted frame");
    await nextFrame();
  }
  const answer = readBack(device.gl, camera, { version: pc.version });
  app.destroy();
  return answer;
}

function changeShaders(device, changes) {
  const chunks = pc.ShaderChunks.get(device, pc.SHADERLANGUAGE_GLSL);
  for (const [name, there, instead] of changes) {
    const text = chunks.get(name);
    if (!text?.includes(there)) throw new Error(`${name}: another shader than expected`);
    chunks.set(name, text.replaceAll(there, instead));
  }
}

function eye({ near, far, fov, background, view, projection }) {
  const entity = new pc.Entity("camera");
  entity.addComponent("camera", { clearColor: new pc.Color(...background, 1), nearClip: near, farClip: far, fov });
  entity.camera.calculateProjection = (matrix) => matrix.data.set(projection);
  const world = new pc.Mat4().set(view).invert();
  entity.setPosition(world.getTranslation());
  entity.setRotation(new pc.Quat().setFromMat4(world));
  return entity;
}

async function loaded(app, file) {
  const kind = file.endsWith(".glb") ? "container" : "gsplat";
  const asset = new pc.Asset(file, kind, { url: `/scenes/${file}`, filename: file }, { reorder: false });
  app.assets.add(asset);
  app.assets.load(asset);
  await new Promise((resolve, reject) => {
    asset.once("load", resolve);
    asset.once("error", (error) => reject(new Error(String(error))));
  });
  return asset;
}

function splats(asset) {
  if (asset.type === "container") return asset.resource.instantiateRenderEntity();
  const entity = new pc.Entity("splats");
  entity.addComponent("gsplat", { asset });
  return entity;
}
