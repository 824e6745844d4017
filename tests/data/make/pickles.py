"""Small pickles of Python 3: every protocol, joblib's arrays, `numpy.save` of a dictionary, and what must be refused.

python tests/data/make/pickles.py    # writes tests/data/small/pickles
"""

import collections
import pickle
from pathlib import Path

import joblib
import numpy as np
import scipy.sparse

FOLDER = Path(__file__).resolve().parents[1] / "small/pickles"


def values():
    """One of everything; as bodies_python2.py has it, without chumpy."""
    table = np.array([[0, 2.0, 0], [1, 0, 3]])
    return {
        "camera_f": np.array([2664.5, 2665.5]),
        "camera_t": np.zeros(3),
        "width": 1080,
        "height": np.int64(1080),
        "name": "female-3-casual",
        "unicode": "\u00e9t\u00e9",
        "flag": True,
        "none": None,
        "long": 4294967295,
        "huge": 2**100,
        "float": 0.1,
        "table": [[1, 2, 3], (4, 5, 6)],
        "rows": [np.arange(4.0), np.arange(4.0) + 10],
        "small": np.array([[1, -2], [3, -4]], np.int8),
        "big_endian": np.array([1.5, -2.5], ">f4"),
        "fortran": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        "bools": np.array([True, False]),
        "strings": np.array(["ab", "c"]),
        "objects": np.array([np.arange(2.0), np.arange(2.0) + 2, None], dtype=object)[:2],
        "scalar": np.float32(0.25),
        "nested": {1: {"pose": [np.zeros(3), np.ones(3)]}},
        "ordered": collections.OrderedDict([("b", 1), ("a", 2)]),
        "set": {7},
        "csr": scipy.sparse.csr_matrix(table),
        "coo": scipy.sparse.coo_matrix(table),
        "bytes": b"\x00\xff",
        "default": collections.defaultdict(list, a=[1]),
    }


class Foreign:
    """An object of a class of its own."""

    def __init__(self):
        self.x = 1


class Runs:
    """What a hostile file does: a call while it is read."""

    def __reduce__(self):
        return print, ("this was run",)


def main():
    FOLDER.mkdir(parents=True, exist_ok=True)
    for protocol in range(6):
        with open(FOLDER / f"python3_{protocol}.pkl", "wb") as file:
            pickle.dump(values(), file, protocol=protocol)
    for name, value in {"foreign": {"a": 1, "b": Foreign()}, "runs": {"a": Runs()}}.items():
        (FOLDER / f"{name}.pkl").write_bytes(pickle.dumps(value))
    optimized = {1: {"pose": [np.arange(6.0), np.arange(6.0) + 0.5], "betas": [np.zeros(3), np.zeros(3)]}}
    joblib.dump(optimized, FOLDER / "joblib.pkl")
    joblib.dump(optimized, FOLDER / "joblib_zlib.pkl", compress=3)
    alignments = {"00000.png": np.arange(12.0).reshape(4, 3), "00001.png": np.arange(12.0).reshape(4, 3) + 1}
    np.save(FOLDER / "alignments.npy", alignments)


if __name__ == "__main__":
    main()
