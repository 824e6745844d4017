"""How should a Gaussian rotate on a skinned body? Pose, draw and score Gaussian avatars.

Arrays are NumPy's; whatever has ``__array__`` or DLPack (a torch tensor on the CPU, say) will do. Quaternions are (w, x, y, z),
matrices are row by row, lengths are metres, cameras look along +z with y down (OpenCV), images are (height, width, 3) with
sRGB values in [0, 1]. Every value is the program's own, bit for bit. Bad input is a ``ValueError`` of one line.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from typing import Any, Dict, Iterable, List, Mapping, Optional, Sequence, Union

import numpy as np

from . import _skinsplat
from ._skinsplat import Body as _Body
from ._skinsplat import Avatar as _Avatar
from ._skinsplat import Camera as _Camera
from ._skinsplat import Pose, Posed, __version__

__all__ = [
    "Avatar",
    "Body",
    "Camera",
    "Pose",
    "Posed",
    "average",
    "lpips",
    "make_avatar",
    "metrics",
    "pose",
    "psnr",
    "read_avatar",
    "read_body",
    "read_cameras",
    "render",
    "rotate_sh",
    "score",
    "ssim",
    "write_avatar",
    "__version__",
]

Avatar, Body, Camera = _Avatar, _Body, _Camera
PathLike = Union[str, "os.PathLike[str]"]


def _array(value: Any, dtype: Any, name: str) -> np.ndarray:
    """A contiguous array of whatever the caller has."""
    if hasattr(value, "detach"):  # a torch tensor that may be part of a graph
        value = value.detach()
    if not hasattr(value, "__array__") and hasattr(value, "__dlpack__"):
        value = np.from_dlpack(value)
    try:
        return np.ascontiguousarray(value, dtype=dtype)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: {error}; expected an array of numbers") from None


def average(quats: Any, weights: Any, solver: str = "closed-form") -> np.ndarray:
    """The weighted average of rotations (Eq. 7).

    quats (..., k, 4), (w, x, y, z), signs do not matter; weights (..., k), 0 or more. Returns (..., 4) in float64, of unit
    length. ``reproduce list solvers`` names the solvers.
    """
    quats, weights = _array(quats, np.float64, "quats"), _array(weights, np.float64, "weights")
    if quats.ndim < 2 or quats.shape[-1] != 4 or quats.shape[:-1] != weights.shape:
        raise ValueError(
            f"quats, weights: shapes {quats.shape} and {weights.shape}; expected (..., k, 4) and (..., k)"
        )
    ahead, k = quats.shape[:-2], quats.shape[-2]
    flat = _skinsplat.average(quats.reshape(-1, k, 4), weights.reshape(-1, k), solver)
    return flat.reshape(*ahead, 4)


def rotate_sh(sh: Any, quats: Any) -> np.ndarray:
    """Spherical harmonics turned with a Gaussian (Eq. 9).

    sh (..., c, 3), c = 1, 4, 9 or 16 coefficients in the basis and order of 3DGS; quats (..., 4). Returns sh's shape in float64.
    """
    sh, quats = _array(sh, np.float64, "sh"), _array(quats, np.float64, "quats")
    if sh.ndim < 2 or sh.shape[-1] != 3 or quats.shape != sh.shape[:-2] + (4,):
        raise ValueError(f"sh, quats: shapes {sh.shape} and {quats.shape}; expected (..., c, 3) and (..., 4)")
    flat = _skinsplat.rotate_sh(sh.reshape(-1, *sh.shape[-2:]), quats.reshape(-1, 4))
    return flat.reshape(sh.shape)


def read_avatar(path: PathLike) -> Avatar:
    """Reads an avatar of any format that the program reads: PLY, npz, torch checkpoints, exports of SplattingAvatar."""
    return Avatar.read(os.fspath(path))


def write_avatar(path: PathLike, avatar: Avatar) -> None:
    """Writes a 3DGS PLY with its binding."""
    avatar.write(os.fspath(path))


def make_avatar(
    means: Any,
    rotations: Any,
    scales: Any,
    opacities: Any,
    sh: Any,
    joints: Any = None,
    weights: Any = None,
) -> Avatar:
    """An avatar of arrays.

    means (n, 3), rotations (n, 4), scales (n, 3) as standard deviations in metres, opacities (n) in [0, 1], sh (n, c, 3);
    joints and weights (n, k) bind it to a body, without them it takes the weights of the nearest points of the body.
    """
    single = [_array(a, np.float32, n) for a, n in ((means, "means"), (rotations, "rotations"), (scales, "scales"))]
    rest = [_array(opacities, np.float32, "opacities"), _array(sh, np.float32, "sh")]
    joints = None if joints is None else _array(joints, np.int64, "joints")
    weights = None if weights is None else _array(weights, np.float32, "weights")
    return Avatar(*single, *rest, joints, weights)


def read_body(
    path: PathLike,
    betas: Optional[Sequence[float]] = None,
    expression: Optional[Sequence[float]] = None,
) -> Body:
    """Reads a body model (SMPL, SMPL-H, SMPL-X, npz of that style, glTF) and gives it a shape."""
    as_list = lambda values: None if values is None else [float(v) for v in np.ravel(values)]
    return Body.read(os.fspath(path), as_list(betas), as_list(expression))


def read_cameras(path: PathLike) -> List[Camera]:
    """Every camera of a file: JSON of this program, of 3DGS or nerfstudio, or cameras.npz."""
    return Camera.read(os.fspath(path))


def pose(avatar: Avatar, body: Body, pose: Pose, strategy: str = "quaternion-average") -> Posed:
    """Poses an avatar on a body. ``reproduce list strategies`` names the strategies and their axes."""
    return _skinsplat.pose(avatar, body, pose, strategy)


def render(
    posed: Union[Posed, Avatar],
    camera: Camera,
    background: Sequence[float] = (0.0, 0.0, 0.0),
    antialiased: bool = False,
) -> np.ndarray:
    """Draws Gaussians as the original 3DGS rasterizer does: (height, width, 3) in float32, not clamped."""
    if isinstance(posed, Avatar):
        posed = Posed.static_(posed)
    colour = [float(c) for c in np.ravel(background)]
    if len(colour) != 3:
        raise ValueError(f"background: {len(colour)} values; expected 3")
    return _skinsplat.render(posed, camera, colour, bool(antialiased))


def _image(value: Any, name: str) -> np.ndarray:
    """Values in [0, 1]; integers of 8 and 16 bits as v / 255 and v / 65535, as the program reads files."""
    raw = np.asarray(value.detach() if hasattr(value, "detach") else value)
    most = {np.dtype(np.uint8): 255.0, np.dtype(np.uint16): 65535.0}.get(raw.dtype)
    if most is None and raw.dtype.kind not in "f":
        raise ValueError(f"{name}: values of type {raw.dtype}; expected floats, uint8 or uint16")
    if most is not None:
        raw = (raw.astype(np.float64) / most).astype(np.float32)
    return np.ascontiguousarray(raw, dtype=np.float32)


def metrics(
    render: Any,
    truth: Any,
    names: Iterable[str] = ("psnr", "ssim", "lpips"),
    protocol: str = "default",
    mask: Any = None,
) -> Dict[str, float]:
    """Metrics of a render and its truth, (height, width, 3) both, under a protocol (``reproduce list protocols``).

    Images are scored as they are: a truth with alpha is composited by the caller. mask (height, width) in [0, 1] is needed
    by protocols that look at a part of the image. A metric that cannot be computed is an error that says why.
    """
    names = list(names)
    mask = None if mask is None else _image(mask, "mask")
    values, missing = _skinsplat.score_images(_image(render, "render"), _image(truth, "truth"), protocol, mask, names)
    for name in names:
        if name in missing:
            raise ValueError(f"{name}: not computed: {missing[name]}")
    return values


def psnr(render: Any, truth: Any, protocol: str = "default", mask: Any = None) -> float:
    """Peak signal-to-noise ratio, dB; see :func:`metrics`."""
    return metrics(render, truth, ["psnr"], protocol, mask)["psnr"]


def ssim(render: Any, truth: Any, protocol: str = "default", mask: Any = None) -> float:
    """Structural similarity; see :func:`metrics`."""
    return metrics(render, truth, ["ssim"], protocol, mask)["ssim"]


def lpips(render: Any, truth: Any, protocol: str = "default", mask: Any = None) -> float:
    """Learned perceptual distance by the network that the protocol names; see :func:`metrics`."""
    return metrics(render, truth, ["lpips"], protocol, mask)["lpips"]


def score(
    renders: PathLike,
    truths: PathLike,
    protocol: str = "default",
    mask: Optional[PathLike] = None,
) -> Mapping[str, Any]:
    """Two folders of frames that pair up by name (or two images), as ``reproduce score --format json`` scores them.

    Of folders: ``{"frames": {name: {...}}, "mean": {...}, "protocol": {...}}``; of images one frame's dictionary. An infinite
    PSNR is ``math.inf``.
    """
    command = [sys.executable, "-m", "skinsplat", "score", os.fspath(renders), os.fspath(truths)]
    command += ["--protocol", protocol, "--format", "json", "--quiet"]
    if mask is not None:
        command += ["--mask", os.fspath(mask)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise ValueError(done.stderr.strip().removeprefix("error: "))
    return _finite(json.loads(done.stdout))


def _finite(value: Any) -> Any:
    """JSON has no infinity: a number that is null is an infinite PSNR."""
    if isinstance(value, dict):
        return {key: math.inf if inner is None else _finite(inner) for key, inner in value.items()}
    return value
