"""Writes tests/data/small/avatars: avatars as other programs store them, with plyfile, NumPy, torch and splat-transform.

python tests/data/make/avatars.py [--write]   # without it: compares what can be compared, exit status 1 on a difference

Numbers are drawn with a fixed seed. The Gaussians lie around the body of tests/data/small/tiny. `haha_expected.npz` holds what HAHA
draws of `haha.ckpt`, from the formulas of its runner in float64. `splat-transform` (npm: @playcanvas/splat-transform 2.7.1) is run if
the environment's SPLAT_TRANSFORM names it; without it compressed files are left as they are.
"""

import io
import os
import subprocess
import sys
import tempfile
from collections import OrderedDict
from pathlib import Path

import numpy as np
import torch
from plyfile import PlyData, PlyElement

REPOSITORY = Path(__file__).resolve().parents[3]
FOLDER = REPOSITORY / "tests/data/small/avatars"
BODY = REPOSITORY / "tests/data/small/tiny/models/body.npz"
C0 = 0.28209479177387814
HEAD = 40  # Gaussians of the smaller files


def unit(q):
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def base():
    """Canonical Gaussians as 3DGS keeps them: 260 (two chunks of a compressed file), SH degree 1."""
    draw = np.random.default_rng(7)
    vertices = np.load(BODY)["v_template"]
    n = 260
    means = vertices[draw.integers(len(vertices), size=n)] + draw.normal(0, 0.02, (n, 3))
    return {
        "means": means.astype("f4"),
        "quats": draw.normal(size=(n, 4)).astype("f4"),
        "log_scales": draw.uniform(-4.5, -2.5, (n, 3)).astype("f4"),
        "logits": draw.normal(0, 2, (n, 1)).astype("f4"),
        "sh": np.concatenate([draw.normal(0, 1, (n, 1, 3)), draw.normal(0, 0.2, (n, 3, 3))], axis=1).astype("f4"),
    }


def head(g, n=HEAD):
    return {key: value[:n] for key, value in g.items()}


def columns(g, channel_major=True):
    """Names and values in the order of 3DGS."""
    rest = g["sh"][:, 1:]
    rest = rest.transpose(0, 2, 1) if channel_major else rest
    parts = [
        (["x", "y", "z"], g["means"]),
        (["nx", "ny", "nz"], np.zeros_like(g["means"])),
        ([f"f_dc_{i}" for i in range(3)], g["sh"][:, 0]),
        ([f"f_rest_{i}" for i in range(rest[0].size)], rest.reshape(len(rest), -1)),
        (["opacity"], g["logits"]),
        ([f"scale_{i}" for i in range(3)], g["log_scales"]),
        ([f"rot_{i}" for i in range(4)], g["quats"]),
    ]
    return [(name, values[:, i]) for names, values in parts for i, name in enumerate(names)]


def ply(named, kind="f4", text=False, byte_order="<", more=(), comments=()):
    rows = np.empty(len(named[0][1]), dtype=[(name, kind) for name, _ in named])
    for name, values in named:
        rows[name] = values
    elements = [*(e for e in more if e.name < "vertex"), PlyElement.describe(rows, "vertex")]
    elements += [e for e in more if e.name > "vertex"]
    out = io.BytesIO()
    PlyData(elements, text=text, byte_order=byte_order, comments=list(comments)).write(out)
    return out.getvalue()


def dialects(g):
    """The same six Gaussians in forms that PLY allows."""
    few = head(g, 6)
    named = columns(few)
    no_normals = [column for column in named if not column[0].startswith("n")]
    shuffled = [named[i] for i in np.random.default_rng(1).permutation(len(named))]
    faces = np.array([([0, 1, 2], 7), ([2, 3, 4, 5], 8)], dtype=[("vertex_indices", "O"), ("id", "i4")])
    edges = np.array([(1.5, 2)], dtype=[("length", "f8"), ("kind", "u1")])
    more = [PlyElement.describe(faces, "face", val_types={"vertex_indices": "u2"}, len_types={"vertex_indices": "u1"})]
    more.append(PlyElement.describe(edges, "zone"))
    return {
        "six.ply": ply(named),
        "six_big_endian.ply": ply(no_normals, byte_order=">", more=more),
        "six_ascii.ply": ply(shuffled, text=True, comments=["von Hand"]),
        "six_double.ply": ply(named, kind="f8", more=more[:1]),
    }


def ihuman(g):
    """What iHuman's SavePly writes: activated, SH coefficient by coefficient; and the same as 3DGS has it."""
    few = head(g, 30)
    scales = np.exp(few["log_scales"])
    scales[:, 0] = 1e-3
    opacities = 1 / (1 + np.exp(-few["logits"].astype("f8")))
    opacities[:20] = 0.99
    activated = few | {"quats": unit(few["quats"]), "log_scales": scales, "logits": opacities.astype("f4")}
    plain = activated | {
        "log_scales": np.log(scales.astype("f8")).astype("f4"),
        "logits": np.log(opacities / (1 - opacities)).astype("f4"),
    }
    return {"ihuman.ply": ply(columns(activated, channel_major=False)), "ihuman_plain.ply": ply(columns(plain))}


def archive(**arrays):
    out = io.BytesIO()
    np.savez_compressed(out, **arrays)
    return out.getvalue()


def arrays(g):
    """The neutral npz, in its two spellings."""
    few = head(g)
    body = np.load(BODY)
    nearest = np.argmin(((few["means"][:, None] - body["v_template"][None]) ** 2).sum(-1), axis=1)
    weights = body["weights"][nearest]
    order = np.argsort(-weights, axis=1)[:, :2]
    two = np.take_along_axis(weights, order, axis=1)
    linear = {
        "means": few["means"],
        "quats": few["quats"],
        "scales": np.exp(few["log_scales"].astype("f8")),
        "opacities": 1 / (1 + np.exp(-few["logits"][:, 0].astype("f8"))),
        "sh": few["sh"],
        "weights": weights,
        "method": "Someone et al.",
        "strategy": "quaternion-average",
    }
    logs = {
        "means": few["means"].astype("f8"),
        "quats": np.asfortranarray(few["quats"]),
        "log_scales": few["log_scales"],
        "logit_opacities": few["logits"],
        "sh": few["sh"],
        "joint_indices": order.astype("i4"),
        "joint_weights": two / two.sum(1, keepdims=True),
        "features": np.zeros((len(few["means"]), 8), "f2"),
    }
    return {"gaussians.npz": archive(**linear), "gaussians_logs.npz": archive(**logs)}


def saved(value, device=None, zipped=True):
    """A torch file, as if its tensors had been on a device."""
    tag = torch.serialization.location_tag
    if device:
        torch.serialization.location_tag = lambda storage: device
    out = io.BytesIO()
    torch.save(value, out, _use_new_zipfile_serialization=zipped)
    torch.serialization.location_tag = tag
    return out.getvalue()


def checkpoints(g):
    few = {key: torch.from_numpy(value.copy()) for key, value in head(g).items()}
    parameter = torch.nn.Parameter
    parts = [few["means"], few["sh"][:, :1], few["sh"][:, 1:], few["log_scales"], few["quats"], few["logits"]]
    model = torch.nn.ParameterList([parameter(part.clone()) for part in parts])
    optimizer = torch.optim.Adam([{"params": [p], "name": str(i)} for i, p in enumerate(model)], lr=0.1)
    sum(p.sum() for p in model).backward()
    optimizer.step()
    for p, part in zip(model, parts):
        p.data = part.clone(memory_format=torch.contiguous_format)
    n = len(few["means"])
    capture = (1, *model, torch.zeros(n), torch.zeros(n, 1), torch.zeros(n, 1), optimizer.state_dict(), 2.5)
    gsplat = {
        "step": 6999,
        "splats": torch.nn.ParameterDict(
            {
                "means": few["means"],
                "quats": few["quats"],
                "scales": few["log_scales"],
                "opacities": few["logits"][:, 0],
                "sh0": few["sh"][:, :1],
                "shN": few["sh"][:, 1:].contiguous(),
            }
        ).state_dict(),
    }
    prefix = "_model.gauss_params."
    nerfstudio = {
        "step": 29999,
        "pipeline": {
            prefix + "means": few["means"].double(),
            prefix + "features_dc": few["sh"][:, 0],
            # a view: strides and an offset of its own
            prefix + "features_rest": few["sh"][:, 1:],
            prefix + "opacities": few["logits"],
            prefix + "quats": few["quats"].t().contiguous().t(),
            prefix + "scales": few["log_scales"],
            "_model.lpips.half": torch.ones(3, dtype=torch.bfloat16),
        },
    }
    half = {f"_{name}": value.half() for name, value in zip(("xyz", "features_dc", "features_rest"), parts)}
    half |= {"_scaling": parts[3].half(), "_rotation": parts[4].half(), "_opacity": parts[5].half()}
    return {
        "capture.pth": saved((capture, 30000), "cuda:0"),
        "gsplat.pt": saved(gsplat, "cuda:1"),
        "splatfacto.ckpt": saved(nerfstudio),
        "half.pth": saved(half),
        "legacy.pth": saved(half, zipped=False),
    }


class Runs:
    """Calls something when a pickle of it is read by Python."""

    def __reduce__(self):
        return os.system, ("touch /tmp/skinsplat_was_here",)


def hostile(g):
    few = torch.from_numpy(head(g, 4)["means"])
    networks = {"xyz": few, "triplane": {"planes": torch.zeros(2)}, "geometry_dec": {"w": torch.zeros(2)}}
    wide = {"_xyz": torch.zeros(1).expand(1 << 40, 3), "_rotation": few}
    return {
        "foreign.pth": saved({"_xyz": few, "config": Runs()}),
        "networks.pth": saved(networks),
        "expanded.pth": saved(wide),
    }


def rotation_matrix(q):
    w, x, y, z = np.moveaxis(unit(q), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def rodrigues(axis):
    angle = np.linalg.norm(axis)
    if angle == 0:
        return np.eye(3)
    x, y, z = axis / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)


def posed_vertices(betas, pose, transl):
    """SMPL's linear blend skinning, with its pose blend shapes."""
    body = {key: np.asarray(value) for key, value in np.load(BODY).items()}
    v = body["v_template"].astype("f8") + body["shapedirs"].astype("f8") @ betas
    joints = body["J_regressor"].astype("f8") @ v
    rotations = np.array([rodrigues(r) for r in pose])
    v = v + body["posedirs"].astype("f8") @ (rotations[1:] - np.eye(3)).ravel()
    world = []
    for j, parent in enumerate(body["kintree_table"][0]):
        local = np.eye(4)
        local[:3, :3] = rotations[j]
        local[:3, 3] = joints[j] - (joints[parent] if j else 0)
        world.append(world[parent] @ local if j else local)
    relative = np.array(world)
    relative[:, :3, 3] -= np.einsum("jrc,jc->jr", relative[:, :3, :3], joints)
    blend = np.einsum("vj,jrc->vrc", body["weights"].astype("f8"), relative)
    return np.einsum("vrc,vc->vr", blend[:, :3, :3], v) + blend[:, :3, 3] + transl


def haha_posed(state, vertices, faces):
    """Means, covariances of Gaussians on posed vertices (runners/train_gaussians.py, 471-493 and 538-561)."""
    a, b, c = np.moveaxis(vertices[faces[state["_gaussian_to_face"]]], 1, 0)
    cross = np.cross(c - b, a - b)
    e, n = unit(c - b), unit(cross)
    frame = np.stack([e, n, np.cross(e, n)], axis=-1)
    length = np.linalg.norm(a - c, axis=-1)
    k = (np.linalg.norm(cross, axis=-1) / length + length) / 2 / 0.05
    means = (a + b + c) / 3 + np.einsum("nrc,nc->nr", frame, state["_xyz"]) * k[:, None]
    scales = 0.1 / (1 + np.exp(-state["_scaling"])) * k[:, None]
    factor = frame @ rotation_matrix(state["_rotation"]) * scales[:, None, :]
    return means, factor @ factor.transpose(0, 2, 1)


def haha():
    draw = np.random.default_rng(11)
    body = np.load(BODY)
    faces = body["f"].astype("i8")
    n = 30
    texture = draw.integers(0, 256, (3, 16, 12)) / 255
    state = {
        "_betas": np.array([[0.6, -0.4]], "f4"),
        "_trainable_texture": texture.astype("f4"),
        "_xyz": draw.normal(0, 0.008, (n, 3)).astype("f4"),
        "_color": draw.uniform(0, 1, (n, 3)).astype("f4"),
        "_rotation": (draw.normal(size=(n, 4)) * draw.uniform(0.2, 3, (n, 1))).astype("f4"),
        "_scaling": draw.normal(-1, 1, (n, 3)).astype("f4"),
        "_opacity": draw.normal(2, 1, (n, 1)).astype("f4"),
        "_gaussian_to_face": draw.integers(0, len(faces), n),
    }
    tensors = OrderedDict((key, torch.from_numpy(value)) for key, value in state.items())
    tensors["_xyz_gradient_accum"] = torch.zeros(n)
    tensors["_body_pose_dict.frame_0.transl"] = torch.ones(1, 3)
    tensors["_smplx_model.shapedirs"] = torch.zeros(4, 3, 2)
    tensors["lpips.net.weight"] = torch.zeros(2, 2)
    wide = {key: np.asarray(value, "f8") for key, value in state.items() if key != "_gaussian_to_face"}
    wide["_gaussian_to_face"] = state["_gaussian_to_face"]
    pose = draw.normal(0, 0.5, (3, 3)).astype("f4").astype("f8")
    transl = np.array([0.1, -0.2, 0.3], "f4").astype("f8")
    expected = {"pose": pose, "transl": transl}
    betas = wide["_betas"][0]
    for name, p, t in (("rest", np.zeros((3, 3)), np.zeros(3)), ("posed", pose, transl)):
        means, covariances = haha_posed(wide, posed_vertices(betas, p, t), faces)
        expected |= {f"{name}_means": means, f"{name}_covariances": covariances}
    checkpoint = saved({"step": 10000, "state_dict": tensors}, "cuda:0")
    return {"haha.ckpt": checkpoint, "haha_expected.npz": archive(**expected)}


def compressed(content):
    """The base through splat-transform, and what it makes of that again."""
    program = os.environ.get("SPLAT_TRANSFORM")
    if not program:
        print("base.compressed.ply: left as it is (SPLAT_TRANSFORM names no program)")
        return {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        (path / "base.ply").write_bytes(content)
        for source, target in (("base.ply", "base.compressed.ply"), ("base.compressed.ply", "base_decompressed.ply")):
            subprocess.run([program, "-w", path / source, path / target], check=True, stdout=subprocess.DEVNULL)
        names = ("base.compressed.ply", "base_decompressed.ply")
        return {name: (path / name).read_bytes() for name in names}


def main(arguments):
    g = base()
    files = {"base.ply": ply(columns(g))} | dialects(g) | ihuman(g) | arrays(g) | checkpoints(g) | hostile(g) | haha()
    files |= compressed(files["base.ply"])
    if arguments == ["--write"]:
        FOLDER.mkdir(exist_ok=True)
        for name, content in files.items():
            (FOLDER / name).write_bytes(content)
            print(f"{name}: {len(content)} bytes")
        return 0
    # Archives hold times and versions: only plain files are compared byte by byte.
    plain = {name: content for name, content in files.items() if name.endswith(".ply")}
    different = [name for name, content in plain.items() if (FOLDER / name).read_bytes() != content]
    print(f"{len(plain)} PLY files recomputed, {len(different)} differ: {', '.join(different)}")
    return 1 if different else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
