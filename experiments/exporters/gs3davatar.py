"""3DGS-Avatar: `gs3davatar.export(scene.gaussians, scene.converter, camera, "377.npz")`, with any camera of the data set.

The Gaussians are canonical in the pose with the hips turned by 45 and -45 degrees. Non-rigid offsets and colours of the network are those of
the pose and place of `camera`: choose a test camera; they are fixed in the file, while the method makes them anew in each frame.
"""

import numpy as np

import gaussians as g

ITERATION = 10**9  # beyond every delay of a part of the model
HIP = np.pi / 4


def weights_of(rigid, gaussians):
    """Weights of its skinning field, or of the nearest vertex of the body."""
    if hasattr(rigid, "query_weights"):
        return rigid.query_weights(gaussians.get_xyz)
    return rigid.softmax(rigid.lbs_network(rigid.aabb.normalize(gaussians.get_xyz, sym=True)))


def export(gaussians, converter, camera, path):
    offset, _ = converter.deformer.non_rigid(gaussians, ITERATION, camera, False)
    weights = weights_of(converter.deformer.rigid, gaussians if not hasattr(offset, "get_xyz") else offset)
    if gaussians.use_sh:
        degree = int(gaussians.active_sh_degree)
        colours = {"sh": g.array(offset.get_features)[:, : (degree + 1) ** 2]}
    else:
        posed = converter.deformer.rigid(offset, ITERATION, camera)
        colours = {"rgb": g.array(converter.texture(posed, camera))}
    g.write(
        path,
        method="3DGS-Avatar",
        strategy="view-canonical",
        means=g.array(offset.get_xyz),
        quats=g.array(offset._rotation),
        log_scales=g.array(offset._scaling),
        logit_opacities=g.array(offset._opacity).reshape(-1),
        weights=g.array(weights),
        canonical_pose=g.pose(24, j1=(0, 0, HIP), j2=(0, 0, -HIP)),
        **colours,
    )
