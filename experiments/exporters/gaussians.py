"""The npz of canonical Gaussians: checks what an exporter hands over and writes it. The README of crates/data defines it."""

import numpy as np


def array(value, dtype=np.float32):
    """A tensor of whatever library, or an array, as NumPy's."""
    for method in ("detach", "cpu", "numpy"):
        value = getattr(value, method)() if hasattr(value, method) else value
    return np.asarray(value, dtype)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def quaternions(matrices):
    """Quaternions (w, x, y, z) of rotation matrices (N, 3, 3): the largest component is computed first."""
    m = np.asarray(matrices, np.float64)
    d = np.stack([m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]], axis=1)
    trace = d.sum(1)
    squares = np.concatenate([1 + trace[:, None], 1 - trace[:, None] + 2 * d], axis=1)
    skew = [m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]]
    same = [m[:, 1, 0] + m[:, 0, 1], m[:, 0, 2] + m[:, 2, 0], m[:, 2, 1] + m[:, 1, 2]]
    rows = np.stack(
        [
            np.stack([squares[:, 0], skew[0], skew[1], skew[2]], axis=1),
            np.stack([skew[0], squares[:, 1], same[0], same[1]], axis=1),
            np.stack([skew[1], same[0], squares[:, 2], same[2]], axis=1),
            np.stack([skew[2], same[1], same[2], squares[:, 3]], axis=1),
        ],
        axis=1,
    )
    return unit(rows[np.arange(len(m)), squares.argmax(1)])


def pose(joints, **turns):
    """Axis-angle vectors (joints, 3): `pose(24, j1=(0, 0, 1))` turns joint 1."""
    angles = np.zeros((joints, 3))
    for joint, turn in turns.items():
        angles[int(joint[1:])] = turn
    return angles


def write(path, *, method, strategy, **arrays):
    """Writes the file. Arrays that are None are left out; what does not fit is an error before anything is written."""
    arrays = {name: np.asarray(value) for name, value in arrays.items() if value is not None}
    n = len(arrays["means"])
    widths = {"means": 3, "quats": 4, "scales": 3, "log_scales": 3, "barycentric": 3}
    for name, values in arrays.items():
        if name.startswith("canonical") or name in ("betas", "comment"):
            continue
        if len(values) != n or (name in widths and values.shape != (n, widths[name])):
            raise ValueError(f"{name}: shape {values.shape}; expected {n} rows of {widths.get(name, 'any')}")
        if values.dtype.kind == "f" and np.isnan(values).any():
            raise ValueError(f"{name}: NaN; expected numbers")
    if arrays["sh"].shape[1:] not in ((1, 3), (4, 3), (9, 3), (16, 3)) if "sh" in arrays else False:
        raise ValueError(f"sh: shape {arrays['sh'].shape}; expected (N, 1, 4, 9 or 16, 3)")
    np.savez_compressed(path, method=method, strategy=strategy, **arrays)
