"""fixtures/sh: rotations of spherical harmonics from a solve in 50 digits, and the basis.

Data: name, quat_wxyz, sh_16x3, dirs. D^l is defined by eval(D s, R d) = eval(s, d) for all s and d: with 2l + 1
directions, a linear system. The basis in 50 digits is mpmath's; e3nn's D^2 and D^3 are compared on the way.
"""

import sys

import mpmath as mp
import numpy as np
import torch
from e3nn import o3

from common import run
from formulas import rotation, sh_basis

mp.mp.dps = 50
# D is rounded once, but for zeros, which hold noise of 1e-49. The rest was computed in double precision.
BAND = (0.0, 1e-45)
TOLERANCES = {"default": 1e-14, "rotmat": 1e-15, "D1": BAND, "D2": BAND, "D3": BAND, "basis_n_x16": 4e-15}
# The basis of degree 1 is (-y, z, -x), up to a factor.
P1 = [[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]
# e3nn's constants have single precision.
E3NN_TOLERANCE = 4e-6
# Any directions for which the systems are well conditioned.
DIRECTIONS = [
    mp.matrix(d) / mp.norm(mp.matrix(d)) for d in np.random.default_rng(1).normal(size=(7, 3)).tolist()
]


def band(degree, direction):
    """The 2l + 1 harmonics of a degree in 50 digits, in 3DGS's order and signs."""
    x, y, z = direction
    values = []
    for order in range(-degree, degree + 1):
        value = mp.spherharm(degree, abs(order), mp.acos(z), mp.atan2(y, x))
        values.append((mp.im(value) if order < 0 else mp.re(value)) * (mp.sqrt(2) if order else 1))
    return values


def band_matrix(degree, r):
    """D^l of the rotation r."""
    directions = DIRECTIONS[: 2 * degree + 1]
    here = mp.matrix([band(degree, d) for d in directions])
    there = mp.matrix([band(degree, r * d) for d in directions])
    return mp.inverse(there) * here


def second_opinion(degree, r, found):
    """e3nn orders the axes (y, z, x) and has no Condon-Shortley phase."""
    axes = np.eye(3)[[1, 2, 0]]
    theirs = o3.Irrep(degree, 1).D_from_matrix(torch.tensor(axes @ r @ axes.T)).numpy()
    signs = [(-1.0) ** order for order in range(-degree, degree + 1)]
    off = np.abs(theirs * np.outer(signs, signs) - found).max()
    assert off < E3NN_TOLERANCE, f"e3nn is {off:.3g} off"


def recompute_case(case):
    quat = mp.matrix(case["quat_wxyz"]) / mp.norm(mp.matrix(case["quat_wxyz"]))
    exact = mp.matrix(rotation(list(quat)).tolist())
    r = np.array(exact.tolist(), float)
    bands = [np.array(band_matrix(degree, exact).tolist(), float) for degree in (1, 2, 3)]
    second_opinion(2, r, bands[1])
    second_opinion(3, r, bands[2])
    sh = np.array(case["sh_16x3"]).reshape(16, 3)
    turned = np.concatenate([sh[:1], bands[0] @ sh[1:4], bands[1] @ sh[4:9], bands[2] @ sh[9:]])
    dirs = np.array(case["dirs"]).reshape(3, 3)

    def evaluate(coefficients, directions):
        return np.concatenate([sh_basis(d) @ coefficients for d in directions]).tolist()

    return {
        "rotmat": r.ravel().tolist(),
        **{f"D{degree}": d.ravel().tolist() for degree, d in zip((1, 2, 3), bands)},
        "sh_rotated_16x3": turned.ravel().tolist(),
        "eval_canonical_dirs": evaluate(sh, dirs),
        "eval_rotated_at_R_dirs": evaluate(turned, dirs @ r.T),
        "eval_unrotated_sh_at_R_dirs": evaluate(sh, dirs @ r.T),
    }


def recompute_rotations(file):
    return {"P1_for_D1": sum(P1, []), "cases": [recompute_case(case) for case in file["cases"]]}


def recompute_basis(file):
    directions = np.array(file["dirs"]).reshape(-1, 3)
    return {"basis_n_x16": np.concatenate([sh_basis(d) for d in directions]).tolist()}


FILES = {"sh/sh_rotation.json": recompute_rotations, "sh/sh_basis.json": recompute_basis}

if __name__ == "__main__":
    raise SystemExit(run(FILES, TOLERANCES, sys.argv[1:]))
