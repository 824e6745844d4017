"""fixtures/rotation: averages of rotations in 50 digits, and the projections of the blend in double precision.

Data: name, kind, n, quats_wxyz, weights, note, err_rad_after. The exact problem: quaternions normalised in 50 digits,
A = sum w q qᵀ, M = sum w R(q); its answers are rounded to double precision once. What other programs compute in
double precision (Gram-Schmidt, PyTorch3D's quaternion, nlerp) starts from the rounded M. RoMa's solution of the
Procrustes problem is compared with the 50-digit average on the way.
"""

import sys

import mpmath as mp
import numpy as np
import roma
import torch

from common import run
from formulas import doubled_axis, doubled_sizes, gram_schmidt, heaviest_side_sum, raw_quaternion, rotation

mp.mp.dps = 50
# Fields of 50 digits, rounded, and exact selections must be equal; eigenvalues that are zero hold noise of 1e-50.
TOLERANCES = {
    "default": 0.0,
    "eigenvalues_desc": 1e-45,
    "gap": (4e-16, 1e-45),
    "gap_rel": (4e-16, 1e-45),
    "cond_lambda1_over_gap": 4e-16,
    "polar_so3_minus_markley_fro_50digits": (0.0, 1e-30),
    "gram_schmidt_cols": 1e-15,
    "gram_schmidt_rows": 1e-15,
    "p3d_matrix_to_quaternion_raw_wxyz": 1e-15,
    "p3d_raw_norm": 1e-15,
    "copysign_matrix_to_quaternion_raw_wxyz": 1e-15,
    "nlerp_maxw_wxyz": 1e-15,
}
# Gram-Schmidt is left out (null) where less than this share of the second vector stands off the first.
ILL_POSED = 1e-9
# 32 roundings, over the relative gap; not below what a solver loses anyway.
FLOOR_F64 = 1e-13


def floats(values):
    return [float(v) for v in values]


def exact_problem(case):
    """A (4 x 4) and M (3 x 3) in 50 digits."""
    a, m = mp.zeros(4), mp.zeros(3)
    for weight, quat in zip(case["weights"], case["quats_wxyz"]):
        q = mp.matrix(quat)
        q /= mp.norm(q)
        a += mp.mpf(weight) * q * q.T
        m += mp.mpf(weight) * mp.matrix(rotation(list(q)).tolist())
    return a, m


def sign(x):
    return int(mp.sign(x)) if abs(x) > mp.mpf(10) ** -40 else 0


def blend_answers(m):
    singular = mp.svd_r(m, compute_uv=False)
    return {"lbs": floats(m), "lbs_det": float(mp.det(m)), "lbs_singular_values": floats(singular)}


def exact_average(vectors, m, gap_rel):
    """The top eigenvector, largest component positive, and how far the polar factor of M is from it."""
    q = [vectors[i, 3] for i in range(4)]
    q = [c * mp.sign(max(q, key=abs)) for c in q]
    r = mp.matrix(rotation(q).tolist())
    u, _, vt = mp.svd_r(m)
    polar = u * mp.diag([1, 1, mp.det(u * vt)]) * vt
    second_opinion(m, r, gap_rel)
    return {
        "markley_wxyz": floats(q),
        "markley_rotmat": floats(r),
        "polar_so3_minus_markley_fro_50digits": float(mp.mnorm(polar - r, "f")),
        "suggested_tol_f64_rad": max(FLOOR_F64, 32 * 2.0**-52 / gap_rel),
        "suggested_tol_f32_rad": 32 * 2.0**-23 / gap_rel,
    }


def second_opinion(m, r, gap_rel):
    """RoMa's solution of the orthogonal Procrustes problem is the same rotation."""
    blend, exact = (torch.tensor(floats(x), dtype=torch.float64).reshape(3, 3) for x in (m, r))
    off = (roma.special_procrustes(blend / blend.abs().max(), method="svd") - exact).norm().item()
    assert off < 64 * 2.0**-52 / gap_rel, f"RoMa is {off:.3g} off"


def in_double_precision(case, m):
    """What other programs make of the rounded blend."""
    blend = np.array(floats(m)).reshape(3, 3)
    quat, branch = raw_quaternion(blend)
    signs = np.copysign(1, [1, *doubled_axis(blend)])
    with np.errstate(invalid="ignore"):
        frames = {"cols": gram_schmidt(blend), "rows": gram_schmidt(blend.T)}
    posed = {name: left > ILL_POSED * sum(case["weights"]) for name, (_, left) in frames.items()}
    return {
        "gram_schmidt_cols": frames["cols"][0].ravel().tolist() if posed["cols"] else None,
        "gram_schmidt_rows": frames["rows"][0].T.ravel().tolist() if posed["rows"] else None,
        "p3d_matrix_to_quaternion_raw_wxyz": quat.tolist(),
        "p3d_branch": branch,
        "p3d_raw_norm": float(np.linalg.norm(quat)),
        "copysign_matrix_to_quaternion_raw_wxyz": (doubled_sizes(blend) / 2 * signs).tolist(),
        "nlerp_maxw_wxyz": heaviest_side_sum(case["quats_wxyz"], case["weights"]).tolist(),
    }


def recompute(case):
    a, m = exact_problem(case)
    values, vectors = mp.eigsy(a)
    first, second = values[3], values[2]
    gap = first - second
    degenerate = gap < first * mp.mpf(10) ** -40
    relative = 0.0 if degenerate else float(gap / first)
    answers = {
        "eigenvalues_desc": floats(reversed(list(values))),
        "gap": 0.0 if degenerate else float(gap),
        "gap_rel": relative,
        "cond_lambda1_over_gap": None if degenerate else float(first / gap),
        "degenerate": bool(degenerate),
        **blend_answers(m),
        "lbs_det_sign": sign(mp.det(m) / mp.mpf(sum(case["weights"])) ** 3),
    }
    if degenerate:
        top = [i for i in range(4) if values[i] > first * (1 - mp.mpf(10) ** -40)]
        answers["top_eigenspace_basis_wxyz"] = [floats(vectors[:, i]) for i in top]
    else:
        answers |= exact_average(vectors, m, relative)
    if "polar_o3_is_reflection" in case:
        answers["polar_o3_is_reflection"] = answers["lbs_det_sign"] < 0
    return answers | in_double_precision(case, m)


def recompute_all(cases):
    return [recompute(case) for case in cases]


FILES = {"rotation/random.json": recompute_all, "rotation/extreme.json": recompute_all}

if __name__ == "__main__":
    raise SystemExit(run(FILES, TOLERANCES, sys.argv[1:]))
