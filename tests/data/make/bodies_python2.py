"""The SMPL file of 2015, as Python 2.7 with chumpy and SciPy wrote it, from `smpl.npz`; and small pickles of Python 2.

python2.7 -m pip install --target /tmp/python2 numpy==1.16.6 scipy==1.2.3 chumpy==0.70 joblib==0.14.1
PYTHONPATH=/tmp/python2 python2.7 tests/data/make/bodies_python2.py
"""

from __future__ import print_function

import os
import pickle
from collections import OrderedDict

import chumpy
import joblib
import numpy as np
import scipy.sparse

HERE = os.path.dirname(os.path.abspath(__file__))
SMALL = os.path.join(HERE, "..", "small")


def dump(value, path, protocol):
    with open(os.path.join(SMALL, path), "wb") as file:
        pickle.dump(value, file, protocol=protocol)


def smpl():
    """Keys, types and memory orders of basicModel_neutral_lbs_10_207_0_v1.0.0.pkl."""
    source = np.load(os.path.join(SMALL, "bodies", "smpl.npz"))
    shapes = chumpy.array(source["shapedirs"].astype(np.float64))
    wide = np.concatenate([source["shapedirs"].astype(np.float64), np.ones((12, 3, 5))], axis=2)
    regressor = scipy.sparse.csc_matrix(source["J_regressor"])
    body = {
        "J_regressor_prior": scipy.sparse.csc_matrix(source["J_regressor"]),
        "f": source["f"],
        "J_regressor": regressor,
        "kintree_table": source["kintree_table"],
        "J": source["J_regressor"].dot(source["v_template"]),
        "weights_prior": source["weights"],
        "weights": np.asfortranarray(source["weights"]),
        "vert_sym_idxs": np.arange(12),
        "posedirs": np.asfortranarray(source["posedirs"]),
        "pose_training_info": {"gender": "neutral", "pose_sigma": np.float64(0.5)},
        "bs_style": "lbs",
        "v_template": source["v_template"],
        "shapedirs": shapes,
        "bs_type": "lrotmin",
    }
    dump(body, "bodies/smpl.pkl", 2)
    # As MANO and the first SMPL files have it: a slice of a longer constant.
    selected = dict(body, shapedirs=chumpy.array(wide)[:, :, :10], posedirs=np.zeros((12, 3, 207), np.float32)[:, :, :0])
    del selected["posedirs"]
    dump(selected, "bodies/smpl_select.pkl", 2)


def values():
    """One of everything."""
    return {
        "camera_f": np.array([2664.5, 2665.5]),
        "camera_t": np.zeros(3),
        "width": 1080,
        "height": np.int64(1080),
        "name": "female-3-casual",
        "unicode": u"\u00e9t\u00e9",
        "flag": True,
        "none": None,
        "long": 4294967295,
        "huge": 2 ** 100,
        "float": 0.1,
        "table": [[1, 2, 3], (4, 5, 6)],
        "rows": [np.arange(4.0), np.arange(4.0) + 10],
        "small": np.array([[1, -2], [3, -4]], np.int8),
        "big_endian": np.array([1.5, -2.5], ">f4"),
        "fortran": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        "bools": np.array([True, False]),
        "strings": np.array(["ab", "c"]),
        "objects": np.array([np.arange(2.0), np.arange(2.0) + 2, None])[:2],
        "scalar": np.float32(0.25),
        "nested": {1: {"pose": [np.zeros(3), np.ones(3)]}},
        "ordered": OrderedDict([("b", 1), ("a", 2)]),
        "set": {7},
        "csr": scipy.sparse.csr_matrix(np.array([[0, 2.0, 0], [1, 0, 3]])),
        "coo": scipy.sparse.coo_matrix(np.array([[0, 2.0, 0], [1, 0, 3]])),
        "ch": chumpy.array([1.0, 2.0]),
    }


def main():
    smpl()
    for protocol in (0, 1, 2):
        dump(values(), "pickles/python2_%d.pkl" % protocol, protocol)
    plain = {1: {"pose": [np.arange(6.0), np.arange(6.0) + 0.5], "betas": [np.zeros(3), np.zeros(3)]}}
    joblib.dump(plain, os.path.join(SMALL, "pickles/joblib_python2.pkl"))


if __name__ == "__main__":
    main()
