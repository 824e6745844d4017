"""fixtures/power_iteration: what k steps of power iteration give in double precision, and how far that is off.

Data: quats_wxyz, weights, init_name, and the sign of exact_wxyz (an eigenvector has none of its own).
"""

import sys

import numpy as np

from common import run
from formulas import heaviest_side_sum, unit

# Ten roundings; an angle that is rounding itself (1e-16) holds nothing else.
TOLERANCES = {"default": 1e-14, "err15_rad": (1e-9, 1e-14), "bound15_rad": 1e-8}


def start(name, quats, weights, a):
    return {
        "max-weight bone": quats[np.argmax(weights)],
        "nlerp": heaviest_side_sum(quats, weights),
        "ones/2": np.full(4, 0.5),
        "column of A with largest diagonal": a[:, a.diagonal().argmax()],
        "identity (1,0,0,0)": np.array([1.0, 0.0, 0.0, 0.0]),
        "first bone": quats[0],
    }[name]


def steps(a, x, wanted):
    """The unit iterates after the wanted numbers of steps."""
    found = {}
    for k in range(1, max(wanted) + 1):
        x = unit(a @ x)
        if k in wanted:
            found[str(k)] = x.tolist()
    return found


def rotation_angle(p, q):
    """Between the rotations of two unit quaternions; exact to rounding for small angles too."""
    q = q if p @ q >= 0 else -q
    return 4 * np.arctan2(np.linalg.norm(p - q), np.linalg.norm(p + q))


def recompute(case):
    quats, weights = np.array(case["quats_wxyz"]), np.array(case["weights"])
    a = np.einsum("i,ij,ik->jk", weights, quats, quats)
    x = start(case["init_name"], quats, weights, a)
    iterates = steps(a, x, [int(k) for k in case["iterates"]])
    values, vectors = np.linalg.eigh(a)
    exact = vectors[:, 3] * np.sign(vectors[:, 3] @ case["exact_wxyz"])
    # The tangent of the angle to the answer (in R⁴) shrinks by λ2 / λ1 a step at least.
    along = unit(x) @ exact
    tangent = np.linalg.norm(unit(x) - along * exact) / abs(along) * (values[2] / values[3]) ** 15
    return {
        "A": a.ravel().tolist(),
        "init_wxyz": x.tolist(),
        "iterates": iterates,
        "exact_wxyz": exact.tolist(),
        "eigenvalues_desc": values[::-1].tolist(),
        "err15_rad": float(rotation_angle(np.array(iterates["15"]), exact)),
        "bound15_rad": float(2 * np.arctan(tangent)),
    }


FILES = {"power_iteration/cases.json": lambda cases: [recompute(case) for case in cases]}

if __name__ == "__main__":
    raise SystemExit(run(FILES, TOLERANCES, sys.argv[1:]))
