"""Formulas that several scripts need, in double precision. Quaternions (w, x, y, z), matrices act on columns."""

import numpy as np
from scipy.special import sph_harm_y

BANDS = [slice(1, 4), slice(4, 9), slice(9, 16)]
UPPER = np.triu_indices(3)


def rotation(q):
    """R(q) as the polynomial that the 3DGS kernels evaluate: a rotation only if |q| = 1."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def unit(v):
    v = np.asarray(v, float)
    return v / np.linalg.norm(v)


def product(a, b):
    """Hamilton product a b."""
    (aw, av), (bw, bv) = ((q[0], np.asarray(q[1:])) for q in (a, b))
    return np.array([aw * bw - av @ bv, *(aw * bv + bw * av + np.cross(av, bv))])


def heaviest_side_sum(quats, weights):
    """Nlerp: the unit sum of the quaternions, each on the side of the heaviest."""
    quats = np.asarray(quats, float)
    heaviest = quats[np.argmax(weights)]
    return unit(sum(w * (q if q @ heaviest >= 0 else -q) for w, q in zip(weights, quats)))


def gram_schmidt(m):
    """Columns made orthonormal, the first one first, the third by the cross product; and what is left of the second."""
    first = unit(m[:, 0])
    second = m[:, 1] - (first @ m[:, 1]) * first
    left = np.linalg.norm(second)
    second = second / left
    return np.stack([first, second, np.cross(first, second)], axis=1), left


SIGNS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])


def doubled_sizes(m):
    """2 |w|, 2 |x|, 2 |y|, 2 |z| of a rotation, from its diagonal."""
    return np.sqrt([max(1 + a * m[0, 0] + b * m[1, 1] + c * m[2, 2], 0) for a, b, c in SIGNS])


def doubled_axis(m):
    return np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])


def raw_quaternion(m):
    """PyTorch3D's conversion: of 4 q qᵀ (for a rotation m) the row with the largest diagonal, over twice its root."""
    sizes = doubled_sizes(m)
    rows = np.empty((4, 4))
    rows[0, 1:] = rows[1:, 0] = doubled_axis(m)
    rows[1:, 1:] = m + m.T
    np.fill_diagonal(rows, sizes**2)
    branch = int(sizes.argmax())
    return rows[branch] / (2 * max(sizes[branch], 0.1)), branch


def covariance(factor):
    return factor @ factor.T


def sh_basis(direction):
    """The 16 real spherical harmonics of degree 3 in 3DGS's order and signs (with the Condon-Shortley phase)."""
    x, y, z = direction
    values = []
    for degree in range(4):
        for order in range(-degree, degree + 1):
            value = sph_harm_y(degree, abs(order), np.arccos(z), np.arctan2(y, x))
            part = value.imag if order < 0 else value.real
            values.append(part * (np.sqrt(2) if order else 1))
    return np.array(values)


def turned_bands(r):
    """D^1, D^2, D^3 of the rotation r: eval(D s, r d) = eval(s, d), solved over more directions than coefficients."""
    directions = np.random.default_rng(1).normal(size=(40, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    here, there = (np.array([sh_basis(d) for d in directions @ turn.T]) for turn in (np.eye(3), r))
    return [np.linalg.lstsq(there[:, band], here[:, band])[0] for band in BANDS]


def turned_sh(sh, r):
    return np.concatenate([sh[:1], *(d @ sh[band] for d, band in zip(turned_bands(r), BANDS))])


def rgb(sh, direction):
    """Colour of 16 x 3 coefficients before the clamp."""
    return sh_basis(direction) @ sh + 0.5
