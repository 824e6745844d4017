"""Small body models in the layouts of SMPL, SMPL-H and SMPL-X, poses as others store them, and the vertices that the smplx
package makes of them, in double precision.

python tests/data/make/bodies.py            # compares with tests/data/small/bodies; exit status 1 on a difference
python tests/data/make/bodies.py --write    # makes the files anew

The bodies are drawn at random from fixed seeds: a tree of joints with a few vertices, weights, and shape, pose and
expression directions. `bodies_python2.py` makes the SMPL file of 2015 out of `smpl.npz`; run it with Python 2.7 before.
"""

import pickle
import sys
from pathlib import Path

import numpy as np
import smplx
import torch

FOLDER = Path(__file__).resolve().parents[1] / "small/bodies"
TOLERANCE = 1e-12
VERTICES = 12

BODY_PARENTS = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19]


def hand_parents(wrist, first):
    return [p for finger in range(5) for p in (wrist, first + 3 * finger, first + 3 * finger + 1)]


PARENTS = {
    "smpl": [*BODY_PARENTS, 20, 21],
    "smplh": [*BODY_PARENTS, *hand_parents(20, 22), *hand_parents(21, 37)],
    "smplx": [*BODY_PARENTS, 15, 15, 15, *hand_parents(20, 25), *hand_parents(21, 40)],
}


def sparse_columns(draw, columns, used, size):
    """(V, 3, columns) offsets of which only the `used` columns are not zero, so that files stay small."""
    offsets = np.zeros((VERTICES, 3, columns))
    offsets[:, :, used] = draw.normal(size=(VERTICES, 3, len(used))) * size
    return offsets.astype(np.float32)


def body(kind, seed, shapes, expressions=0):
    draw = np.random.default_rng(seed)
    parents = np.array(PARENTS[kind])
    joints = len(parents)
    regressor = np.zeros((joints, VERTICES))
    for row in regressor:
        chosen = draw.choice(VERTICES, 3, replace=False)
        row[chosen] = draw.dirichlet(np.ones(3))
    weights = np.zeros((VERTICES, joints))
    for vertex, row in enumerate(weights):
        chosen = np.unique([vertex % joints, joints - 1 - vertex, *draw.choice(joints, 2)])
        row[chosen] = draw.dirichlet(np.ones(len(chosen)))
    used = [k for k in (0, 1, 9, 14, 299) if k < shapes] + [shapes + k for k in (0, 1, 9, 60) if k < expressions]
    table = np.stack([np.where(parents < 0, 2**32 - 1, parents), np.arange(joints)]).astype(np.uint32)
    faces = np.array([[i, (i + 1) % VERTICES, (i + 2) % VERTICES] for i in range(VERTICES)], np.uint32)
    pose_columns = sorted(draw.choice(9 * (joints - 1), 12, replace=False))
    arrays = {
        "v_template": draw.normal(size=(VERTICES, 3)),
        "f": faces,
        "weights": weights,
        "kintree_table": table,
        "J_regressor": regressor,
        "shapedirs": sparse_columns(draw, shapes + expressions, used, 0.1),
        "posedirs": sparse_columns(draw, 9 * (joints - 1), pose_columns, 0.02),
    }
    if kind != "smpl":
        for side in "lr":
            components = np.linalg.qr(draw.normal(size=(45, 45)))[0]
            arrays[f"hands_components{side}"] = components.round(4)
            arrays[f"hands_mean{side}"] = draw.normal(size=45).round(4) * 0.2
    if kind == "smplx":
        # Keys of the distributed files that nothing here reads, Python objects among them.
        arrays["lmk_faces_idx"] = np.arange(3)
        arrays["lmk_bary_coords"] = np.full((3, 3), 1 / 3)
        arrays["joint2num"] = np.array({"Pelvis": 0, "L_Hip": 1}, dtype=object)
        arrays["allow_pickle"] = np.array(True)
    return arrays


BODIES = {
    "smpl.npz": lambda: body("smpl", 1, 10),
    "smplh.npz": lambda: body("smplh", 2, 300),
    "smplx.npz": lambda: body("smplx", 3, 300, 100),
    "smplx_20.npz": lambda: body("smplx", 4, 10, 10),
}


def poses(seed, frames=2, **widths):
    draw = np.random.default_rng(seed)
    return {name: draw.normal(size=(frames, width)) * 0.4 for name, width in widths.items()}


SMPL = {"global_orient": 3, "body_pose": 69, "transl": 3}
BODY = {"global_orient": 3, "body_pose": 63, "transl": 3}
FACE = {"jaw_pose": 3, "leye_pose": 3, "reye_pose": 3}
HANDS = {"left_hand_pose": 45, "right_hand_pose": 45}


def with_betas(seed, arrays, betas, expression=0):
    draw = np.random.default_rng(seed + 100)
    arrays["betas"] = draw.normal(size=betas)
    if expression:
        arrays["expression"] = np.tile(draw.normal(size=expression), (len(arrays["transl"]), 1))
    return arrays


def smplx_cases():
    """Name, model, poses in the smplx package's names, what the package is told besides."""
    hands = {"use_pca": False}
    yield "smpl", "smpl.npz", with_betas(11, poses(11, **SMPL), 10), {}
    yield "smpl_short_betas", "smpl.npz", with_betas(12, poses(12, **SMPL), 4), {}
    full = with_betas(13, poses(13, **BODY, **FACE, **HANDS), 10, 10)
    yield "smplx_axis_angle", "smplx.npz", full, hands
    yield "smplx_flat", "smplx.npz", {**full, "flat_hand_mean": np.array(True)}, {**hands, "flat_hand_mean": True}
    principal = poses(14, **BODY, **FACE, left_hand_pose=6, right_hand_pose=6)
    yield "smplx_principal", "smplx.npz", with_betas(14, principal, 10, 10), {"num_pca_comps": 6}
    yield "smplx_body_only", "smplx.npz", with_betas(15, poses(15, **BODY), 10), hands
    yield "smplx_no_face", "smplx.npz", with_betas(16, poses(16, **BODY, **HANDS), 16), hands
    yield "smplx_one_hand", "smplx.npz", with_betas(17, poses(17, **BODY, right_hand_pose=45), 300, 100), hands
    yield "smplx_20", "smplx_20.npz", with_betas(18, poses(18, **BODY, **FACE), 10, 10), hands
    yield "smplh_principal", "smplh.npz", with_betas(19, poses(19, **BODY, left_hand_pose=12, right_hand_pose=12), 10), {"num_pca_comps": 12}


class AnyVertex(dict):
    """Vertices of key points, which nobody here asks for."""

    def __missing__(self, name):
        return 0


smplx.body_models.VERTEX_IDS = {name: AnyVertex() for name in ("smplh", "smplx")}


def vertices(model, arrays, **told):
    """What smplx makes of arrays in its own names."""
    path = str(FOLDER / model)
    kind = {"smpl": smplx.SMPL, "smplh": smplx.SMPLH, "smplx": smplx.SMPLX}[Path(model).stem.split("_")[0]]
    inputs = {k: v for k, v in arrays.items() if k in {*SMPL, *FACE, *HANDS, "betas", "expression"}}
    frames = len(inputs["transl"])
    counts = {"num_betas": len(inputs["betas"])}
    if "expression" in inputs:
        counts["num_expression_coeffs"] = inputs["expression"].shape[1]
    if kind is smplx.SMPL:
        # The package takes SMPL from a pickle only, or as it is.
        told = {**told, "data_struct": smplx.utils.Struct(**np.load(path))}
    else:
        told = {**told, "ext": "npz"}
    net = kind(path, batch_size=frames, dtype=torch.float64, **counts, **told)
    tensors = {k: torch.tensor(np.tile(v, (frames, 1)) if v.ndim == 1 else v) for k, v in inputs.items()}
    return net(**tensors).vertices.detach().numpy()


def files():
    """Name, content and vertices of every pose file."""
    for name, model, arrays, told in smplx_cases():
        yield f"{name}_poses.npz", arrays, (model, vertices(model, arrays, **told))
    # AMASS: SMPL-H with hands as they are.
    arrays = with_betas(21, poses(21, **BODY, **HANDS), 16)
    whole = np.concatenate([arrays[k] for k in ("global_orient", "body_pose", "left_hand_pose", "right_hand_pose")], 1)
    amass = {"poses": whole, "trans": arrays["transl"], "betas": arrays["betas"], "gender": np.array("neutral"),
             "mocap_framerate": np.array(120.0), "dmpls": np.zeros((2, 8)), "marker_labels": np.array(["LFHD"])}
    expected = vertices("smplh.npz", arrays, use_pca=False, flat_hand_mean=True)
    yield "amass_poses.npz", amass, ("smplh.npz", expected)
    # AIST++: a pickle; scaled, then moved.
    arrays = with_betas(22, poses(22, **SMPL), 10)
    still = {**arrays, "transl": np.zeros((2, 3)), "betas": np.zeros(10)}
    aist = {"smpl_poses": np.concatenate([arrays["global_orient"], arrays["body_pose"]], 1),
            "smpl_trans": arrays["transl"] * 90, "smpl_scaling": np.array([93.77]), "smpl_loss": 0.25}
    expected = 93.77 * vertices("smpl.npz", still) + aist["smpl_trans"][:, None]
    yield "aist_poses.pkl", aist, ("smpl.npz", expected)
    # HUGS: a scale per frame.
    arrays = {**with_betas(23, poses(23, **SMPL), 10), "scale": np.array([1.25, 0.8])}
    still = {**arrays, "transl": np.zeros((2, 3))}
    expected = arrays["scale"][:, None, None] * vertices("smpl.npz", still) + arrays["transl"][:, None]
    arrays["betas"] = np.tile(arrays["betas"], (2, 1))
    yield "hugs_poses.npz", arrays, ("smpl.npz", expected)


def write(path, arrays):
    if path.suffix == ".pkl":
        with open(path, "wb") as file:
            pickle.dump(arrays, file, protocol=4)
    else:
        np.savez_compressed(path, **arrays)


def main(arguments):
    writes = arguments == ["--write"]
    if writes:
        FOLDER.mkdir(parents=True, exist_ok=True)
        for name, make in BODIES.items():
            write(FOLDER / name, make())
    answers = {}
    for name, arrays, (model, expected) in files():
        if writes:
            write(FOLDER / name, arrays)
        answers[f"{name}/{model}"] = expected
    path = FOLDER / "expected.npz"
    if writes:
        np.savez_compressed(path, **answers)
        print(f"{FOLDER}: written")
        return 0
    old = np.load(path)
    off = {key: np.abs(old[key] - value).max() for key, value in answers.items()}
    for key, value in off.items():
        print(f"{key}: {'ok' if value <= TOLERANCE else 'DIFFERS'}: {value:.2g} m at most")
    return int(max(off.values()) > TOLERANCE or set(old.files) != set(answers))


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
