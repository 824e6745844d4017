"""HUGS: `hugs.export(human_gs, "lab.npz")`, where `human_gs` is the HUGS_TRIMLP of a trainer.

The Gaussians are canonical in HUGS's own pose: left and right hip turned by 1 and -1 rad about z, in the shape `betas`. Weights are those
that its network predicts. Left out: optimised poses, betas and scale of frames, which are no part of an avatar.
"""

import numpy as np

import gaussians as g


def rotations(six):
    """Gram-Schmidt over two rows (N, 6); the three axes are the rows."""
    first = g.unit(six[:, :3])
    second = g.unit(six[:, 3:] - (first * six[:, 3:]).sum(1, keepdims=True) * first)
    return np.stack([first, second, np.cross(first, second)], axis=1)


def export(model, path):
    out = model.canon_forward()
    scales = g.array(out["scales"])
    if getattr(model, "isotropic", False):
        scales = np.repeat(scales.mean(1, keepdims=True), 3, axis=1)
    weights = out.get("lbs_weights")
    degree = int(model.active_sh_degree)
    g.write(
        path,
        method="HUGS",
        strategy="hugs-original",
        means=g.array(model.get_xyz) + g.array(out["xyz_offsets"]),
        quats=g.quaternions(rotations(g.array(out["rot6d_canon"], np.float64))),
        scales=scales,
        opacities=g.array(out["opacity"]).reshape(-1),
        sh=g.array(out["shs"]).reshape(-1, 16, 3)[:, : (degree + 1) ** 2],
        weights=None if weights is None else g.array(weights),
        canonical_pose=g.pose(24, j1=(0, 0, 1), j2=(0, 0, -1)),
        betas=g.array(model.betas).reshape(-1) if hasattr(model, "betas") else None,
    )
