"""Animatable 3D Gaussians: `animatable.export(deformer, "shot.npz", player=0)`, where `deformer` is its SMPLModel or GalaModel.

The Gaussians are canonical on the template. Their quaternions are stored as the kernel gets them; it reads their conjugate, as the
strategy animatable-original does. Left out: ambient occlusion, learned joints (the body's own are used), the other players.
"""

import gaussians as g


def export(deformer, path, player=0):
    rest = deformer.J * 0
    means, opacities, scales, quats, sh, *_ = deformer.forward(rest[:, 1:], rest[:, 0], rest[:, 0], None, False)
    count = len(g.array(means)) // int(deformer.num_players)
    own = slice(player * count, (player + 1) * count)
    weights = g.array(deformer.bone_weights)[player] if hasattr(deformer, "bone_weights") else g.array(deformer.weights)
    g.write(
        path,
        method="Animatable 3D Gaussians",
        strategy="animatable-original",
        means=g.array(means)[own],
        quats=g.array(quats)[own],
        scales=g.array(scales)[own],
        opacities=g.array(opacities).reshape(-1)[own],
        sh=g.array(sh)[own],
        weights=weights,
    )
