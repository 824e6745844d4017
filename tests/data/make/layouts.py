"""Subjects in the layouts of NeuMan, PeopleSnapshot (raw and prepared), X-Humans and GalaBasketball, a few kB each.

python tests/data/make/layouts.py            # compares the committed folder with one made anew; exit status 1 if they differ
python tests/data/make/layouts.py --write    # makes tests/data/small/layouts anew

The person is that of tests/data/blender, its pictures reduced to 64 pixels. Files are written by the libraries that the
authors use: h5py (LZF, as masks2hdf5.py of videoavatars), pickle (protocol 2), joblib, tifffile, Pillow, OpenCV (undistort, as
the preparation scripts of InstantAvatar and SplattingAvatar). The rig of GalaBasketball is made up here; its posed vertices
and their pixels are computed with the matrices of the authors' formulas (deformer/gala_model.py, dataset/galaBasketball.py),
written down anew.
"""

import filecmp
import json
import pickle
import shutil
import sys
import tempfile
from pathlib import Path

import cv2
import h5py
import joblib
import numpy as np
import tifffile
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
BLENDER = ROOT / "blender"
TARGET = ROOT / "small/layouts"
SIDE = 64
# Of camera.pkl: what a cheap lens does to 64 pixels, half a pixel at the edge.
DISTORTION = np.array([-0.06, 0.02, 0.003, -0.002, 0.004])


def rotation(vector):
    return cv2.Rodrigues(np.asarray(vector, np.float64))[0]


def vector(matrix):
    return cv2.Rodrigues(np.asarray(matrix, np.float64))[0].reshape(-1)


class Recording:
    """A sequence of the Blender set at 64 pixels: pictures before a patterned wall, masks of 0 and 1."""

    def __init__(self, *parts):
        self.images, self.masks, self.k, self.w2c, poses = [], [], [], [], []
        for part in parts:
            folder = BLENDER / "datasets" / part
            cameras, pose = np.load(folder / "cameras.npz"), np.load(folder / "poses.npz")
            poses.append(pose)
            scale = SIDE / float(cameras["width"])
            for path in sorted((folder / "images").glob("*.png")):
                rgba = Image.open(path).resize((SIDE, SIDE), Image.BOX)
                rgba = np.asarray(rgba, np.float64) / 255
                y, x = np.mgrid[0:SIDE, 0:SIDE]
                wall = np.stack([0.3 + 0.2 * (x // 8 % 2), 0.4 + 0.2 * (y // 8 % 2), 0.5 + 0 * x], -1)
                alpha = rgba[..., 3:]
                self.images.append(np.round(255 * (rgba[..., :3] * alpha + wall * (1 - alpha))).astype(np.uint8))
                self.masks.append((alpha[..., 0] >= 0.5).astype(np.uint8))
                k = cameras["intrinsic"].copy()
                k[:2] *= scale
                self.k.append(k)
                self.w2c.append(cameras["extrinsic"])
        self.betas = poses[0]["betas"].astype(np.float64)
        keys = [key for key in poses[0].files if key not in ("betas", "source_frame")]
        self.poses = {key: np.concatenate([pose[key] for pose in poses]) for key in keys}

    def __len__(self):
        return len(self.images)


def save(path, image):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(image).save(path)


def dump(path, value, protocol=2):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(pickle.dumps(value, protocol=protocol))


def text(path, lines):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")


def as_folder(target, recording, parts, model):
    """The layout of this project: what the others are compared with."""
    for name, frames in parts.items():
        folder = target / name
        listed, cameras, poses = [], [], []
        for row, i in enumerate(frames):
            save(folder / f"images/image_{i:04}.png", recording.images[i])
            save(folder / f"masks/mask_{i:04}.png", recording.masks[i] * 255)
            k, w2c = recording.k[i].tolist(), recording.w2c[i].tolist()
            cameras.append({"id": row, "K": k, "w2c": w2c, "width": SIDE, "height": SIDE})
            names = {"file_path": f"images/image_{i:04}.png", "mask_path": f"masks/mask_{i:04}.png"}
            listed.append(names | {"camera": row, "time": row})
            thetas = recording.poses["thetas"][i].astype(float).reshape(-1, 3).tolist()
            poses.append({"time": row, "transl": recording.poses["transl"][i].astype(float).tolist(), "thetas": thetas})
        # One camera that all frames share is written once.
        if all(c["K"] == cameras[0]["K"] and c["w2c"] == cameras[0]["w2c"] for c in cameras):
            cameras = cameras[:1]
            for frame in listed:
                frame["camera"] = 0
        content = {"model": model, "betas": recording.betas.tolist(), "cameras": cameras, "poses": poses, "frames": listed}
        (folder / "transforms.json").write_text(json.dumps(content))


def prepared(target, recording, split):
    """PeopleSnapshot as InstantAvatar and SplattingAvatar prepare it."""
    for i, (image, mask) in enumerate(zip(recording.images, recording.masks)):
        save(target / f"images/image_{i:04}.png", image)
        (target / "masks").mkdir(exist_ok=True)
        np.save(target / f"masks/mask_{i:04}.npy", mask)
    np.savez(target / "cameras.npz", intrinsic=recording.k[0], extrinsic=recording.w2c[0], height=SIDE, width=SIDE)
    poses = recording.poses
    np.savez(target / "poses.npz", betas=recording.betas, thetas=poses["thetas"], transl=poses["transl"])
    first, last, step = split["test"]
    rows = slice(first, last + 1, step)
    (target / "poses").mkdir()
    refined = {key: poses[key][rows] for key in ("global_orient", "body_pose", "transl")}
    np.savez(target / "poses/anim_nerf_test.npz", betas=recording.betas[None], **refined)
    ranges = {part: dict(zip(("start", "end", "skip"), split[part])) for part in ("train", "test")}
    (target / "config.json").write_text(json.dumps({"gender": "neutral", "val": ranges["test"]} | ranges))


def raw(target, pictures, masks, recording):
    """PeopleSnapshot as distributed. `pictures` and `masks` are distorted."""
    target.mkdir(parents=True)
    for i, picture in enumerate(pictures):
        save(target / f"frames/{i:06}.png", picture)
    k, w2c = recording.k[0], recording.w2c[0]
    camera = {
        "camera_t": w2c[:3, 3], "camera_rt": vector(w2c[:3, :3]), "camera_f": np.array([k[0, 0], k[1, 1]]),
        "camera_c": k[:2, 2].copy(), "camera_k": DISTORTION, "width": SIDE, "height": SIDE,
    }
    dump(target / "camera.pkl", camera)
    with h5py.File(target / "masks.hdf5", "w") as file:
        # As masks2hdf5.py: signed bytes, LZF. Chunks of 5 x 30 x 30 leave partial ones at every edge.
        data = file.create_dataset("masks", (len(masks), SIDE, SIDE), "b", chunks=(5, 30, 30), compression="lzf")
        for i, mask in enumerate(masks):
            data[i] = mask.astype(bool)
    with h5py.File(target / "reconstructed_poses.hdf5", "w") as file:
        file.create_dataset("pose", data=recording.poses["thetas"], compression="lzf")
        file.create_dataset("trans", data=recording.poses["transl"], compression="lzf")
        file.create_dataset("betas", data=recording.betas)


def quaternion(matrix):
    """w x y z."""
    axis = vector(matrix)
    angle = np.linalg.norm(axis)
    return np.concatenate([[np.cos(angle / 2)], axis / max(angle, 1e-300) * np.sin(angle / 2)])


def colmap(target, recording, numbers, model):
    cameras, images = [], []
    for i, number in enumerate(numbers):
        k, w2c = recording.k[i], recording.w2c[i]
        key = (k[0, 0], k[0, 2], k[1, 2])
        if key not in cameras:
            cameras.append(key)
        place = [*quaternion(w2c[:3, :3]), *w2c[:3, 3]]
        line = f"{40 - i} " + " ".join(repr(float(v)) for v in place) + f" {cameras.index(key) + 3} {number:05}.png"
        # Every second image has no points: its second line is empty.
        images.append((line, "" if i % 2 else "1.5 2.25 -1 3.5 4.25 7"))
    rows = [
        f"{c + 3} PINHOLE {SIDE} {SIDE} {f!r} {f!r} {x!r} {y!r}" if model == "PINHOLE"
        else f"{c + 3} SIMPLE_RADIAL {SIDE} {SIDE} {f!r} {x!r} {y!r} 0.01"
        for c, (f, x, y) in enumerate((float(f), float(x), float(y)) for f, x, y in cameras)
    ]
    text(target / "sparse/cameras.txt", [
        "# Camera list with one line of data per camera:", "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]",
        f"# Number of cameras: {len(rows)}", *rows,
    ])
    # Not in the order of names.
    order = sorted(range(len(images)), key=lambda i: (i * 7) % len(images))
    text(target / "sparse/images.txt", [
        "# Image list with two lines of data per image:",
        "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME", "#   POINTS2D[] as (X, Y, POINT3D_ID)",
        f"# Number of images: {len(images)}, mean observations per image: 1.0",
        *(line for i in order for line in images[i]),
    ])


def neuman(target, recording, numbers, model="PINHOLE"):
    """NeuMan: pictures, COLMAP's model, Detectron's masks (255 is the background)."""
    for i, number in enumerate(numbers):
        save(target / f"images/{number:05}.png", recording.images[i])
        save(target / f"segmentations/{number:05}.png", np.where(recording.masks[i] > 0, 0, 255).astype(np.uint8))
    colmap(target, recording, numbers, model)


def hugs(target, recording):
    """What HUGS adds: masks (255 is the person) and poses."""
    count = len(recording)
    for i, mask in enumerate(recording.masks):
        save(target / f"4d_humans/sam_segmentations/mask_{i:04}.png", mask * 255)
    poses = {key: recording.poses[key] for key in ("global_orient", "body_pose", "transl")}
    betas = np.repeat(recording.betas[None], count, 0)
    np.savez(target / "4d_humans/smpl_optimized_aligned_scale.npz", betas=betas, scale=np.ones(count), **poses)
    # The same with a scale of its own for each frame, as HUGS writes it.
    np.savez(target.parent / "scaled.npz", betas=betas, scale=1 + 0.125 * np.arange(count), **poses)


def aligned(target, recording, numbers):
    """NeuMan's own poses: another root, and matrices that lead back to the same place."""
    body = np.load(BLENDER / "models/anny_smpl24.npz")
    shaped = body["v_template"] + body["shapedirs"].astype(np.float64) @ recording.betas
    root = body["J_regressor"][0].astype(np.float64) @ shaped
    poses, matrices = [], {}
    for i, number in enumerate(numbers):
        turn, scale = rotation([0.3, -0.2 * i, 0.5]), 1.0
        theta = recording.poses["thetas"][i].astype(np.float64)
        shift = root + recording.poses["transl"][i] - scale * turn @ root
        theta[:3] = vector(turn.T @ rotation(theta[:3]))
        poses.append(theta)
        matrices[f"{number:05}.png"] = np.concatenate([scale * turn, shift[:, None]], 1).T
    rows = [np.zeros(72)] * (max(numbers) + 1)
    for number, pose in zip(numbers, poses):
        rows[number] = pose
    person = {"pose": rows, "betas": [recording.betas] * len(rows)}
    joblib.dump({1: person}, target / "smpl_output_optimized.pkl")
    np.save(target / "alignments.npy", matrices, allow_pickle=True)


def xhumans(target, takes):
    """X-Humans: pictures of 64 x 96, of which the middle 64 rows are the recording's."""
    first = next(iter(takes.values()))[0]
    text(target / "gender.txt", ["neutral"])
    np.save(target / "mean_shape_smplx.npy", first.betas.astype(np.float32))
    pad = SIDE // 4
    for name, (recording, numbers) in takes.items():
        folder = target / name
        black = np.zeros((pad, SIDE, 3), np.uint8)
        far = np.full((pad, SIDE), 1000, np.float32)
        (folder / "render/depth").mkdir(parents=True)
        for i, number in enumerate(numbers):
            save(folder / f"render/image/color_{number:06}.png", np.concatenate([black, recording.images[i], black]))
            depth = np.where(recording.masks[i] > 0, 3.25, 1000).astype(np.float32)
            path = folder / f"render/depth/depth_{number:06}.tiff"
            depth = np.concatenate([far, depth, far])
            # As OpenCV writes (LZW with a predictor), deflated, and plain.
            if i % 3 == 0:
                cv2.imwrite(str(path), depth)
            else:
                tifffile.imwrite(path, depth, compression="zlib" if i % 3 == 1 else None)
            pose = {
                key: recording.poses[key][i]
                for key in ("global_orient", "transl", "body_pose", "left_hand_pose", "right_hand_pose", "jaw_pose",
                            "leye_pose", "reye_pose")
            }
            junk = {"betas": np.full(10, 9, np.float32), "expression": np.zeros(10, np.float32)}
            dump(folder / f"SMPLX/mesh-f{number:05}_smplx.pkl", pose | junk, protocol=4)
        k = recording.k[0].copy()
        k[1, 2] += pad
        np.savez(folder / "render/cameras.npz", intrinsic=k, extrinsic=np.stack(recording.w2c))


def euler(degrees):
    """Unity's order: about z, then x, then y."""
    x, y, z = np.radians(degrees)
    about = lambda i, a: rotation(np.eye(3)[i] * a)
    return about(1, y) @ about(0, x) @ about(2, z)


def degrees(turn):
    """The angles of which `euler` makes this rotation."""
    x = np.arcsin(np.clip(-turn[1, 2], -1, 1))
    return np.degrees([x, np.arctan2(turn[0, 2], turn[2, 2]), np.arctan2(turn[1, 0], turn[1, 1])])


def affine(turn, shift):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, shift
    return matrix


def line(values):
    return ",".join(f"{v:.7g}" for v in np.ravel(values))


def gala(target, cameras=7, times=range(0, 8), side=40):
    """A made-up left-handed rig of 27 joints in GalaBasketball's files, and where its vertices are."""
    rng = np.random.default_rng(12)
    joints = 27
    # Parents before children, but no joint after its neighbour.
    parents = [-1] + [int(rng.integers(max(0, j - 4), j)) for j in range(1, joints)]
    positions = np.concatenate([[[0, 1, 0]], rng.uniform(-0.25, 0.25, (joints - 1, 3))])
    positions = np.array([[float(f"{v:.7g}") for v in row] for row in positions])
    rest = rng.uniform(-40, 40, (joints, 3))
    chain = []
    for j in range(joints):
        local = affine(euler(rest[j]), positions[j])
        chain.append(local if j == 0 else chain[parents[j]] @ local)
    inverse_bind = np.array([[float(f"{v:.9g}") for v in np.linalg.inv(m).ravel()] for m in chain]).reshape(-1, 4, 4)
    owner = np.repeat(np.arange(joints), 6)
    # A small octahedron about each joint, with its normals.
    normals = np.tile(np.concatenate([np.eye(3), -np.eye(3)]), (joints, 1))
    radius = np.repeat(rng.uniform(0.05, 0.12, joints), 6)[:, None]
    vertices = np.array([chain[j][:3, 3] for j in owner]) + radius * normals
    vertices = np.array([[float(f"{v:.7g}") for v in row] for row in vertices])
    weights = np.zeros((len(owner), joints), np.float32)
    for v, j in enumerate(owner):
        share = np.float32(rng.integers(8, 17) / 16)
        weights[v, j] += share
        weights[v, max(parents[j], 0)] += 1 - share
    model = target / "model"
    mesh = []
    for v, j in enumerate(owner):
        mesh += [line(vertices[v]), line(normals[v]), "0.5,0.5", "1,0,0,0", f"{j},0,0,0"]
    text(model / "mesh.txt", mesh)
    text(model / "tpose.txt", [row for j in range(joints) for row in (line(positions[j]), line(rest[j]), "1,1,1")])
    text(model / "tpose_mat.txt", [",".join(f"{v:.9g}" for v in m.ravel()) for m in inverse_bind])
    text(model / "jointParent.txt", [str(p) for p in parents])
    np.save(model / "weights.npy", weights)

    posed = []
    for t in times:
        angles = np.round(rest + rng.uniform(-25, 25, (joints, 3)), 4)
        root = np.round([0.1 * t, 1.1, 0.02 * t], 4)
        rows = [row for j in range(joints) for row in (line(root if j == 0 else rng.normal(size=3)), line(angles[j]), "1,1,1")]
        text(target / f"pose/{t:04}.txt", rows)
        world = []
        for j in range(joints):
            local = affine(euler(angles[j]), root if j == 0 else positions[j])
            world.append(local if j == 0 else world[parents[j]] @ local)
        blend = np.einsum("vj,jrc->vrc", weights.astype(np.float64), np.stack(world) @ inverse_bind)
        posed.append(np.einsum("vrc,vc->vr", blend[:, :3], np.c_[vertices, np.ones(len(vertices))]))

    colours = rng.uniform(0.6, 1, (len(owner), 3))
    pixels = np.zeros((len(posed), cameras, len(owner), 2))
    for c in range(cameras):
        angle = 2 * np.pi * c / cameras
        place = np.round([3 * np.sin(angle) + 0.3, 1.3, -3 * np.cos(angle)], 4)
        # Unity cameras look along their z.
        turn = euler([4.0, -np.degrees(angle), 2.0])
        w, *xyz = quaternion(turn)
        field = 40.0 + c
        text(target / f"camera/{c}.txt", [f"{field},{side},{side}", line(place), ",".join(f"{v:.9g}" for v in (*xyz, w)), "1,1,1"])
        y, x = np.mgrid[0:side, 0:side]
        wall = np.stack([20 + 3 * x, 30 + 2 * y, 40 + 4 * c + 0 * x], -1).astype(np.uint8)
        save(target / f"bg/{c}.png", wall)
        focal = side / 2 / np.tan(np.radians(field) / 2)
        for row, t in enumerate(times):
            local = (posed[row] - place) @ turn
            uv = side / 2 + focal * local[:, :2] * [1, -1] / local[:, 2:]
            pixels[row, c] = uv
            if t % 2:
                continue
            picture = wall.copy()
            for v in np.argsort(-local[:, 2]):
                near = (x + 0.5 - uv[v, 0]) ** 2 + (y + 0.5 - uv[v, 1]) ** 2 < 2.5
                picture[near] = np.round(255 * colours[v])
            save(target / f"{c}/{t:04}.png", picture)
    np.savez(target / "expected.npz", vertices=np.stack(posed), pixels=pixels.astype(np.float32))


def player(target, every=5):
    """The clothed person of multiview_ben as a player: every fifth vertex of its body, six cameras and the third of them again."""
    folder = BLENDER / "datasets/multiview_ben/train"
    cameras, poses = np.load(folder / "cameras.npz"), np.load(folder / "poses.npz")
    model = np.load(BLENDER / "models/anny_smpl24.npz")
    # Unity's world is that of the others with z turned about.
    flip = np.diag([1.0, 1.0, -1.0])
    template = model["v_template"] + model["shapedirs"][..., :10] @ poses["betas"]
    centres, parents = (model["J_regressor"] @ template) @ flip, model["kintree_table"][0].astype(np.int64)
    parents[0] = -1
    corners = template[model["f"].astype(int)]
    around = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(template)
    for corner in range(3):
        np.add.at(normals, model["f"][:, corner], around)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True) @ flip
    # Three joints more, which nothing hangs on.
    parents, centres = np.concatenate([parents, [15, 22, 23]]), np.concatenate([centres, centres[[15, 22, 23]]])
    joints = len(parents)
    weights = np.pad(model["weights"], ((0, 0), (0, joints - 24)))[::every].astype(np.float32)
    weights /= weights.sum(1, keepdims=True)
    offsets = np.array([centres[j] - (centres[parents[j]] if j else 0) for j in range(joints)])
    mesh = []
    for place, normal in zip((template @ flip)[::every], normals[::every]):
        mesh += [line(np.round(place, 5)), line(np.round(normal, 3)), "0.5,0.5", "1,0,0,0", "0,0,0,0"]
    text(target / "model/mesh.txt", mesh)
    text(target / "model/tpose.txt", [row for j in range(joints) for row in (line(offsets[j]), "0,0,0", "1,1,1")])
    text(target / "model/tpose_mat.txt", [line(affine(np.eye(3), -centre)) for centre in centres])
    text(target / "model/jointParent.txt", [str(p) for p in parents])
    np.save(target / "model/weights.npy", weights)

    for t, thetas in enumerate(poses["thetas"].astype(float).reshape(-1, 24, 3)):
        turns = [flip @ rotation(theta) @ flip for theta in thetas] + [np.eye(3)] * (joints - 24)
        places = [centres[0] + flip @ poses["transl"][t]] + list(offsets[1:])
        text(target / f"pose/{t:04}.txt", [row for j in range(joints) for row in (line(places[j]), line(degrees(turns[j])), "1,1,1")])
    for c, source in enumerate([0, 1, 2, 3, 4, 5, 2]):
        turn, shift = cameras["extrinsic"][source][:3, :3], cameras["extrinsic"][source][:3, 3]
        # Unity cameras look along z with y up.
        up = np.diag([1.0, -1.0, 1.0])
        turn, shift = up @ turn @ flip, up @ shift
        w, *xyz = quaternion(turn.T)
        height = float(cameras["height"])
        field = np.degrees(2 * np.arctan(height / 2 / cameras["intrinsic"][source][1, 1]))
        text(target / f"camera/{c}.txt", [f"{field:.9g},{SIDE},{SIDE}", line(-turn.T @ shift), ",".join(f"{v:.9g}" for v in (*xyz, w)), "1,1,1"])
        y, x = np.mgrid[0:SIDE, 0:SIDE]
        wall = np.stack([20 + x, 130 + y, 40 + 4 * c + 0 * x], -1) / 255
        save(target / f"bg/{c}.png", np.round(255 * wall).astype(np.uint8))
        for t, path in enumerate(sorted((folder / f"cam{source:02}/images").glob("*.png"))):
            rgba = np.asarray(Image.open(path).convert("RGBA").resize((SIDE, SIDE), Image.BOX), np.float64) / 255
            alpha = rgba[..., 3:]
            save(target / f"{c}/{t:04}.png", np.round(255 * (rgba[..., :3] * alpha + wall * (1 - alpha))).astype(np.uint8))


def small_body(target, joints=24, per_joint=2):
    """A body model in SMPL's keys with pose and shape directions, small enough for a clothed shape of its own."""
    rng = np.random.default_rng(3)
    parents = np.array([-1] + [int(rng.integers(max(0, j - 3), j)) for j in range(1, joints)])
    centres = np.zeros((joints, 3))
    for j in range(1, joints):
        centres[j] = centres[parents[j]] + rng.uniform(-0.2, 0.2, 3)
    owner = np.repeat(np.arange(joints), per_joint)
    count = len(owner)
    template = centres[owner] + rng.uniform(-0.05, 0.05, (count, 3))
    regressor = np.zeros((joints, count))
    weights = np.zeros((count, joints))
    for v, j in enumerate(owner):
        regressor[j, v] = 1 / per_joint
        weights[v, j] += 0.75
        weights[v, max(parents[j], 0)] += 0.25
    faces = np.array([[v, v + 1, v + 2] for v in range(0, count - 2)], np.uint32)
    model = {
        "v_template": template, "f": faces, "weights": weights, "J_regressor": regressor,
        "kintree_table": np.stack([parents % 2**32, np.arange(joints)]).astype(np.uint32),
        "shapedirs": rng.normal(size=(count, 3, 10)) * 0.01, "posedirs": (rng.integers(-3, 4, (count, 3, 9 * (joints - 1))) / 1024).astype(np.float32),
    }
    target.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(target, **model)
    return model


def clothed(target, model):
    """Raw PeopleSnapshot with a clothed shape, a camera that is not at the origin, and numpy's posed vertices in camera axes."""
    rng = np.random.default_rng(5)
    count, joints = 6, 24
    target.mkdir(parents=True)
    turn, shift = np.array([0.2, -0.4, 0.1]), np.array([0.3, -0.2, 2.5])
    dump(target / "camera.pkl", {
        "camera_t": shift, "camera_rt": turn, "camera_f": np.array([30.0, 31.0]), "camera_c": np.array([8.5, 7.25]),
        "camera_k": np.zeros(5), "width": 16, "height": 16,
    })
    pose, trans = rng.normal(size=(count, 72)) * 0.3, rng.normal(size=(count, 3)) * 0.2
    betas = rng.normal(size=10)
    personal = rng.normal(size=model["v_template"].shape) * 0.02
    dump(target / "consensus.pkl", {"v_personal": personal, "betas": betas})
    with h5py.File(target / "masks.hdf5", "w") as file:
        masks = (rng.uniform(size=(count, 16, 16)) > 0.5).astype(np.uint8)
        file.create_dataset("masks", data=masks, chunks=(4, 7, 16), compression="gzip", shuffle=True, fletcher32=True)
    with h5py.File(target / "reconstructed_poses.hdf5", "w") as file:
        for key, value in (("pose", pose), ("trans", trans), ("betas", betas)):
            file.create_dataset(key, data=value.astype(np.float32))
    for i in range(count):
        # As ffmpeg counts when nobody tells it otherwise.
        save(target / f"images/frame_{i + 1}.png", rng.integers(0, 256, (16, 16, 3)).astype(np.uint8))
    pose, trans, betas = (np.float32(v).astype(np.float64) for v in (pose, trans, betas))
    shaped = model["v_template"] + model["shapedirs"] @ betas
    centres = model["J_regressor"] @ shaped
    parents = model["kintree_table"][0].astype(np.int64)
    vertices = []
    for theta, shift_of_frame in zip(pose.reshape(count, joints, 3), trans):
        turns = [rotation(v) for v in theta]
        # models/smpl.py, model_params_in_camera_coords: the camera's rotation goes into the root.
        moved = rotation(turn) @ (centres[0] + shift_of_frame) - centres[0] + shift
        features = np.concatenate([(r - np.eye(3)).ravel() for r in turns[1:]])
        rest = shaped + personal + model["posedirs"] @ features
        turns[0] = rotation(turn) @ turns[0]
        world = []
        for j in range(joints):
            local = affine(turns[j], centres[j] - (centres[parents[j]] if j else 0))
            world.append(local if j == 0 else world[parents[j]] @ local)
        relative = np.stack([w @ affine(np.eye(3), -centres[j]) for j, w in enumerate(world)])
        blend = np.einsum("vj,jrc->vrc", model["weights"], relative)
        vertices.append(np.einsum("vrc,vc->vr", blend[:, :3], np.c_[rest, np.ones(len(rest))]) + moved)
    np.savez(target / "expected.npz", in_camera=np.stack(vertices), masks=masks)


def make(target):
    ava = Recording("snapshot_ava/train_casual")
    # What the lens has seen, and what a preparation script makes of it.
    pictures, masks = ava.images, ava.masks
    ava.images = [cv2.undistort(picture, ava.k[0], DISTORTION) for picture in pictures]
    ava.masks = [cv2.undistort(mask, ava.k[0], DISTORTION) for mask in masks]
    split = {"train": [0, 5, 1], "test": [6, 7, 1]}
    as_folder(target / "folder/ava", ava, {"train": range(0, 6), "test": range(6, 8)}, "anny_smpl24.npz")
    prepared(target / "peoplesnapshot/ava", ava, split)
    raw(target / "peoplesnapshot-raw/ava", pictures, masks, ava)
    clothed(target / "peoplesnapshot-raw/someone", small_body(target / "models/SMPL_NEUTRAL.npz"))
    neuman(target / "neuman/ava", ava, range(8))
    hugs(target / "neuman/ava", ava)
    numbers = [3, 4, 5, 7, 8, 9, 10, 12]
    neuman(target / "neuman/own", ava, numbers, "SIMPLE_RADIAL")
    aligned(target / "neuman/own", ava, numbers)
    takes = {"train": Recording("xhands_ava/train_take1"), "test": Recording("xhands_ava/test_take2")}
    hands = {"train/Take4": (takes["train"], [11, 12, 14, 15, 16]), "test/Take10": (takes["test"], [1, 2, 3])}
    xhumans(target / "xhumans/00099", hands)
    for name, recording in takes.items():
        as_folder(target / "folder/hands", recording, {name: range(len(recording))}, "anny_smplx55.npz")
    gala(target / "galabasketball/ball")
    player(target / "galabasketball/ben")


def files(folder):
    return sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())


def main(arguments):
    if arguments == ["--write"]:
        shutil.rmtree(TARGET, ignore_errors=True)
        make(TARGET)
        print(f"{TARGET}: {len(files(TARGET))} files written")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder)
        make(made)
        different = set(files(made)) ^ set(files(TARGET))
        both = set(files(made)) & set(files(TARGET))
        different |= {path for path in both if not filecmp.cmp(made / path, TARGET / path, shallow=False)}
        for path in sorted(different):
            print(f"small/layouts/{path}: differs")
        print(f"small/layouts: {'DIFFERS' if different else 'ok'}: {len(both)} files made anew")
        return 1 if different else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
