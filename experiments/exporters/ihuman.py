"""iHuman: `ihuman.export(deformer, "male-3.npz", "…/vertices.txt")`, where `deformer` is the MMTriangleModel of its model.

The Gaussians are the discs of the faces of the displaced template, which iHuman moves to the mean of its vertices: `vertices` is the file of
that template, or its array, and gives that mean. A disc takes the mean weights of the corners of its face. Left out: learned joints
(the body's own are used) and the size of a face in a pose (a disc keeps its scales, as in iHuman).
"""

import numpy as np

import gaussians as g


def export(deformer, path, vertices):
    vertices = np.loadtxt(vertices) if isinstance(vertices, (str, bytes)) or hasattr(vertices, "open") else vertices
    centre = g.array(vertices, np.float64).mean(0)
    rest = deformer.J * 0
    means, opacities, scales, quats, sh, *_ = deformer.forward(rest[:, 1:], rest[:, 0], rest[:, 0])
    faces = g.array(deformer.faces, np.int64)[0][np.asarray(deformer.face2uv_idx)]
    per_vertex = g.array(deformer.weights)
    per_face = max(len(g.array(means)) // len(faces), 1)
    g.write(
        path,
        method="iHuman",
        strategy="ihuman-original",
        means=g.array(means),
        quats=g.array(quats),
        scales=g.array(scales),
        opacities=g.array(opacities).reshape(-1),
        sh=g.array(sh),
        weights=np.repeat(per_vertex[faces].mean(1), per_face, axis=0),
        canonical_transl=-centre,
    )
