"""fixtures/goldens: worked examples in double precision, as each method sees them.

Data: theta; of three_bone bones, w, Rc, s; the triangles; viewdir d; coeffs_in; the signs of quaternions.
"""

import sys

import numpy as np
import roma
import torch
from scipy.spatial.transform import Rotation

from common import run
from formulas import (
    covariance,
    gram_schmidt,
    product,
    raw_quaternion,
    rotation,
    turned_bands,
    turned_sh,
    unit,
)

# The solve for D loses some ten roundings; angles are in degrees, and an eigenvector moves by a rounding over its gap.
TOLERANCES = {
    "default": (1e-14, 1e-15),
    "polar_angle": (1e-14, 1e-13),
    "avg_angle": (1e-14, 1e-12),
    "eig": (1e-14, 1e-16),
    "sh_rot": 5e-14,
}


def on_side_of(q, committed):
    """An eigenvector or a quaternion of a rotation, with the sign of the committed one."""
    return q * np.sign(q @ committed)


def quaternion(r, committed):
    return on_side_of(Rotation.from_matrix(r).as_quat(scalar_first=True), committed)


def nearest_rotation(m):
    return roma.special_procrustes(torch.from_numpy(np.array(m)), method="svd").numpy()


def average(quats, weights):
    """(top eigenvector of sum w q qᵀ, eigenvalues ascending, the matrix)."""
    quats = np.array(quats)
    a = np.einsum("i,ij,ik->jk", weights, quats, quats)
    values, vectors = np.linalg.eigh(a)
    return vectors[:, 3], values, a


def angle_about_z(q):
    return float(np.degrees(2 * np.arctan2(abs(q[3]), abs(q[0]))))


def matrix_angle_about_z(m):
    return float(np.degrees(np.arctan2(m[1, 0], m[0, 0])))


def fifteen_steps(a):
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for _ in range(15):
        q = unit(a @ q)
    return q


def two_bones(row):
    """The identity and a turn by theta about z, half of each."""
    half = np.radians(row["theta"]) / 2
    quats = [[1.0, 0.0, 0.0, 0.0], [np.cos(half), 0.0, 0.0, np.sin(half)]]
    blend = (rotation(quats[0]) + rotation(quats[1])) / 2
    hugs, _ = raw_quaternion(blend)
    drawn = rotation(hugs)
    q, values, a = average(quats, [0.5, 0.5])
    return {
        "hugs_q": hugs.tolist(),
        "hugs_norm": float(np.linalg.norm(hugs)),
        "hugs_angle_if_normalised": angle_about_z(hugs),
        "hugs_angle_rasterised": matrix_angle_about_z(drawn),
        "hugs_inplane_scale": float(np.hypot(drawn[0, 0], drawn[1, 0])),
        "lbs_inplane_scale": float(np.hypot(blend[0, 0], blend[1, 0])),
        "polar_angle": matrix_angle_about_z(nearest_rotation(blend)),
        "avg_angle": angle_about_z(q),
        "eig": values.tolist(),
        "power15_angle": angle_about_z(fifteen_steps(a)),
    }


def three_bones(golden):
    bones, weights, own = (np.array(golden[key]) for key in ("bones", "w", "Rc"))
    blend = np.einsum("i,ijk->jk", weights, bones)
    hugs, branch = raw_quaternion(blend @ own)
    q, values, _ = average(Rotation.from_matrix(bones).as_quat(scalar_first=True), weights)
    q = on_side_of(q, golden["markley_q"])
    skinned = on_side_of(product(q, quaternion(own, [1, 0, 0, 0])), golden["skinned_q"])
    factors = {
        "cov_hugs": rotation(hugs),
        "cov_lbs_TSTt": blend @ own,
        "cov_animatable_conj": blend @ own.T,
        "cov_skinned": rotation(skinned),
    }
    return {
        "blend": blend.tolist(),
        "hugs_q": hugs.tolist(),
        "hugs_branch": branch,
        "hugs_R": rotation(hugs).tolist(),
        **{name: covariance(factor * golden["s"]).tolist() for name, factor in factors.items()},
        "markley_q": q.tolist(),
        "eig": values.tolist(),
        "skinned_q": skinned.tolist(),
        "polar": nearest_rotation(blend).tolist(),
        "gs_rows": gram_schmidt(blend.T)[0].T.tolist(),
        "gs_cols": gram_schmidt(blend)[0].tolist(),
    }


def frame(method, triangle):
    """Columns of the frame that a method puts on a triangle."""
    a, b, c = np.array(triangle)
    normal = unit(np.cross(b - a, c - a))
    if method == "splatting":
        axis = unit(b - a)
        return np.stack([np.cross(axis, normal), -normal, axis], axis=1)
    if method == "ihuman":
        axis = unit(a - b)
        return np.stack([normal, axis, np.cross(normal, axis)], axis=1)
    axis = unit(c - b)
    return np.stack([axis, normal, np.cross(axis, normal)], axis=1)


def with_quaternion(r, golden):
    return {"R": r.tolist(), "q": quaternion(r, golden["q"]).tolist()}


def harmonics(golden, r):
    names = ("D1", "D2", "D3")
    bands = {name: d.tolist() for name, d in zip(names, turned_bands(r))}
    return {"R": r.tolist(), **bands, "coeffs_out": turned_sh(np.array(golden["coeffs_in"]), r).tolist()}


def recompute(file):
    three = three_bones(file["three_bone"])
    r = rotation(three["markley_q"])
    direction = np.array(file["viewdir"]["d"])
    rest = file["frame_splatting"]["tri"]
    turn = frame("splatting", file["splatting_face_rot"]["tri_def"]) @ frame("splatting", rest).T
    frames = {
        f"frame_{method}": with_quaternion(frame(method, rest), file[f"frame_{method}"])
        for method in ("splatting", "ihuman", "haha")
    }
    return {
        "two_bone_z_5050": [two_bones(row) for row in file["two_bone_z_5050"]],
        "three_bone": three,
        "viewdir": {
            "BTd": unit(np.array(three["blend"]).T @ direction).tolist(),
            "RTd": unit(r.T @ direction).tolist(),
        },
        **frames,
        "splatting_face_rot": with_quaternion(turn, file["splatting_face_rot"]),
        "sh_rot": harmonics(file["sh_rot"], r),
    }


FILES = {"goldens/goldens.json": recompute}

if __name__ == "__main__":
    raise SystemExit(run(FILES, TOLERANCES, sys.argv[1:]))
