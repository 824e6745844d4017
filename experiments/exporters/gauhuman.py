"""GauHuman: `gauhuman.export(scene.gaussians, camera, "my_392.npz")`, with any camera of the data set.

The Gaussians are canonical in the camera's "big pose". Weights are those of the nearest vertex, corrected by its network. Left out:
corrections of poses, pose blend shapes of single Gaussians, and that GauHuman inverts the blended matrix of the big pose where the strategy
here blends the joints' motions from it (the two differ where a Gaussian hangs on several joints).
"""

import numpy as np

import gaussians as g


def export(gaussians, camera, path):
    means = gaussians.get_xyz
    corrections = None
    if gaussians.motion_offset_flag:
        corrections = gaussians.lweight_offset_decoder(means[None]).permute(0, 2, 1)
    big = camera.big_pose_smpl_param
    vertices = camera.big_pose_world_vertex[None]
    _, _, weights, *_ = gaussians.coarse_deform_c2source(
        means[None], camera.smpl_param, big, vertices, lbs_weights=corrections
    )
    degree = int(gaussians.active_sh_degree)
    g.write(
        path,
        method="GauHuman",
        strategy="view-canonical+colour=none",
        means=g.array(means),
        quats=g.array(gaussians.get_rotation),
        scales=g.array(gaussians.get_scaling),
        opacities=g.array(gaussians.get_opacity).reshape(-1),
        sh=g.array(gaussians.get_features)[:, : (degree + 1) ** 2],
        weights=g.array(weights)[0],
        canonical_pose=g.array(big["poses"], np.float64).reshape(-1, 3),
        canonical_transl=g.array(big["Th"], np.float64).reshape(-1),
    )
