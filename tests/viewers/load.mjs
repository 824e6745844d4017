// Both kinds of GLB through three.js's GLTFLoader in Node: what we wrote comes out, splats, skin and clip.
import assert from "node:assert/strict";
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { readGlb } from "./lib/glb.mjs";

async function load(path) {
  const { bytes } = readGlb(path);
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
  return new GLTFLoader().parseAsync(buffer, "");
}

function points(gltf) {
  const found = [];
  gltf.scene.traverse((object) => object.isPoints && found.push(object));
  assert.equal(found.length, 1);
  return found[0];
}

/** Every attribute of a file is in the geometry of three.js, value by value. Custom names come in lower case. */
export async function attributesArrive(path) {
  const { json, accessor } = readGlb(path);
  const gltf = await load(path);
  const { geometry } = points(gltf);
  const known = { POSITION: "position", JOINTS_0: "skinIndex", WEIGHTS_0: "skinWeight" };
  const { attributes } = json.meshes[0].primitives[0];
  for (const [name, index] of Object.entries(attributes)) {
    const attribute = geometry.getAttribute(known[name] ?? name.toLowerCase());
    assert(attribute, `${path}: ${name} did not arrive`);
    assert.deepEqual(attribute.array, accessor(index), `${path}: ${name}`);
  }
  return { attributes: Object.keys(attributes).length, count: geometry.getAttribute("position").count };
}

/** Skin and clip of a file: joints, their inverse bind matrices and every key of every track as the file has them. */
export async function skinAndClipArrive(path) {
  const { json, accessor } = readGlb(path);
  const gltf = await load(path);
  const [skin, clip] = [json.skins[0], json.animations[0]];
  const skinned = json.nodes.findIndex((node) => node.skin !== undefined);
  const inverses = accessor(skin.inverseBindMatrices);
  assert.equal(inverses.length, 16 * skin.joints.length);
  const joints = await gltf.parser.getDependencies("node");
  assert.equal(joints.length, json.nodes.length);
  assert.equal(gltf.animations.length, json.animations.length);
  assert.equal(gltf.animations[0].name, clip.name);
  assert.equal(gltf.animations[0].tracks.length, clip.channels.length);
  for (const { sampler, target } of clip.channels) {
    const node = joints[target.node];
    const property = { rotation: "quaternion", translation: "position", scale: "scale" }[target.path];
    const track = gltf.animations[0].tracks.find(({ name }) => name === `${node.uuid}.${property}` || name === `${node.name}.${property}`);
    assert(track, `${path}: no track of ${node.name}.${property}`);
    assert.deepEqual(track.times, accessor(clip.samplers[sampler].input));
    assert.deepEqual(track.values, accessor(clip.samplers[sampler].output));
  }
  return { joints: skin.joints.length, tracks: clip.channels.length, node: skinned };
}

/** The motion of each joint relative to the rest pose, at a key of the clip: matrices that take rest places to posed ones. */
export async function jointMotions(path, key) {
  const { json, accessor } = readGlb(path);
  const gltf = await load(path);
  const [clip] = gltf.animations;
  const mixer = new THREE.AnimationMixer(gltf.scene);
  const action = mixer.clipAction(clip);
  action.setLoop(THREE.LoopOnce);
  action.clampWhenFinished = true;
  action.play();
  mixer.setTime(clip.tracks[0].times[key]);
  gltf.scene.updateMatrixWorld(true);
  const skin = json.skins[0];
  const inverses = accessor(skin.inverseBindMatrices);
  const nodes = await gltf.parser.getDependencies("node");
  return skin.joints.map((node, j) => {
    const inverse = new THREE.Matrix4().fromArray(inverses, 16 * j);
    return { rest: inverse.clone().invert(), motion: nodes[node].matrixWorld.clone().multiply(inverse) };
  });
}
