"""Tests of the exporters on stand-ins of the same shapes: NumPy only. `python test_exporters.py [FOLDER]` keeps the files in FOLDER."""

import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace as Thing

import numpy as np

import animatable
import gauhuman
import gaussians
import gs3davatar
import hugs
import ihuman

draw = np.random.default_rng(3)
N, J = 12, 24


def matrices(q):
    w, x, y, z = gaussians.unit(q).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def weights(n=N, joints=J):
    raw = draw.uniform(size=(n, joints)) ** 8
    return raw / raw.sum(1, keepdims=True)


class Tensor(np.ndarray):
    """An array with the methods of a tensor that exporters call."""

    def detach(self):
        return self

    cpu = detach

    def numpy(self):
        return np.asarray(self)

    def permute(self, *axes):
        return self.transpose(axes)


def tensor(value):
    return np.asarray(value, np.float32).view(Tensor)


def test_quaternions():
    q = gaussians.unit(draw.normal(size=(500, 4)))
    q[:4] = np.eye(4)
    found = gaussians.quaternions(matrices(q))
    assert np.allclose(np.abs((found * q).sum(1)), 1)


def test_hugs(folder):
    out = {
        "xyz_offsets": tensor(np.full((N, 3), 0.5)),
        "scales": tensor(draw.uniform(0.01, 0.02, (N, 3))),
        "rot6d_canon": tensor(draw.normal(size=(N, 6))),
        "shs": tensor(draw.normal(size=(N, 16, 3))),
        "opacity": tensor(draw.uniform(size=(N, 1))),
        "lbs_weights": tensor(weights()),
        "posedirs": None,
    }
    xyz = tensor(draw.normal(size=(N, 3)))
    model = Thing(canon_forward=lambda: out, get_xyz=xyz, active_sh_degree=2, betas=tensor(np.ones(10)), isotropic=False)
    hugs.export(model, folder / "hugs.npz")
    made = np.load(folder / "hugs.npz")
    assert made["sh"].shape == (N, 9, 3) and made["canonical_pose"].shape == (J, 3)
    assert np.allclose(made["means"], xyz + 0.5) and made["canonical_pose"][1, 2] == 1 == -made["canonical_pose"][2, 2]
    assert np.allclose(matrices(made["quats"]), hugs.rotations(np.asarray(out["rot6d_canon"], "f8")), atol=1e-6)


def test_ihuman(folder):
    vertices = draw.normal(size=(20, 3)) + 1
    faces = draw.integers(0, 20, (1, N, 3))
    made = [draw.normal(size=(N, 3)), draw.uniform(size=(N, 1)), draw.uniform(0.001, 0.01, (N, 3))]
    made += [gaussians.unit(draw.normal(size=(N, 4))), draw.normal(size=(N, 9, 3)), None, None, None]
    deformer = Thing(
        J=tensor(np.ones((1, J, 3))), faces=faces, face2uv_idx=np.arange(N), weights=tensor(weights(20)), forward=None
    )

    def forward(body_pose, global_orient, transl):
        assert body_pose.shape == (1, J - 1, 3) and not body_pose.any() and transl.shape == (1, 3)
        return [tensor(value) if value is not None else None for value in made]

    deformer.forward = forward
    ihuman.export(deformer, folder / "ihuman.npz", vertices)
    file = np.load(folder / "ihuman.npz")
    assert np.allclose(file["canonical_transl"], -vertices.mean(0), atol=1e-6)
    assert np.allclose(file["weights"].sum(1), 1, atol=1e-5) and file["weights"].shape == (N, J)


def test_animatable(folder):
    made = [draw.normal(size=(2 * N, 3)), draw.uniform(size=(2 * N, 1)), draw.uniform(0.001, 0.01, (2 * N, 3))]
    made += [np.tile([1.0, 0, 0, 0], (2 * N, 1)), draw.normal(size=(2 * N, 4, 3)), None, None]
    deformer = Thing(J=tensor(np.ones((2, 27, 3))), num_players=2, bone_weights=tensor([weights(N, 27)] * 2))
    deformer.forward = lambda *arguments: [tensor(value) if value is not None else None for value in made]
    animatable.export(deformer, folder / "animatable.npz", player=1)
    file = np.load(folder / "animatable.npz")
    assert np.allclose(file["means"], made[0][N:], atol=1e-6) and file["weights"].shape == (N, 27)


class Model:
    """What 3DGS-Avatar and GauHuman share with graphdeco's model."""

    def __init__(self, use_sh):
        self.use_sh = use_sh
        self.active_sh_degree = 1
        self.motion_offset_flag = True
        self.get_xyz = tensor(draw.normal(size=(N, 3)))
        self.get_features = tensor(draw.normal(size=(N, 16, 3)))
        self._rotation = tensor(draw.normal(size=(N, 4)))
        self._scaling = tensor(draw.uniform(-5, -4, (N, 3)))
        self._opacity = tensor(draw.normal(size=(N, 1)))
        self.get_rotation = tensor(gaussians.unit(self._rotation))
        self.get_scaling = tensor(np.exp(self._scaling))
        self.get_opacity = tensor(1 / (1 + np.exp(-self._opacity)))

    def lweight_offset_decoder(self, points):
        assert points.shape == (1, N, 3)
        return tensor(np.zeros((1, J, N)))

    def coarse_deform_c2source(self, points, params, t_params, t_vertices, lbs_weights=None):
        assert lbs_weights.shape == (1, N, J) and t_vertices.shape == (1, 30, 3)
        return points, points, tensor(weights()[None]), None, None


def test_gs3davatar(folder):
    rigid = Thing(query_weights=lambda xyz: tensor(weights()))
    # SkinningField has no query_weights, but a network and a softmax
    field = Thing(lbs_network=lambda xyz: tensor(draw.normal(size=(N, J))), aabb=Thing(normalize=lambda xyz, sym: xyz))
    field.softmax = lambda logits: tensor(np.exp(logits) / np.exp(logits).sum(1, keepdims=True))
    for use_sh, deform in ((True, rigid), (False, field)):
        model = Model(use_sh)

        class Rigid(Thing):
            def __call__(self, posed, iteration, camera):
                return posed

        converter = Thing(
            deformer=Thing(non_rigid=lambda points, *rest: (points, {}), rigid=Rigid(**vars(deform))),
            texture=lambda posed, camera: tensor(draw.uniform(size=(N, 3))),
        )
        gs3davatar.export(model, converter, Thing(), folder / "gs3davatar.npz")
        file = np.load(folder / "gs3davatar.npz")
        assert ("sh" in file) == use_sh and ("rgb" in file) != use_sh
        assert np.isclose(file["canonical_pose"][1, 2], np.pi / 4)


def test_gauhuman(folder):
    poses = np.zeros((1, 72))
    poses[0, [5, 8, 23, 26]] = np.pi / 4, -np.pi / 4, -np.pi / 6, np.pi / 6
    big = {"poses": tensor(poses), "Th": tensor(np.zeros((1, 3)))}
    camera = Thing(smpl_param={}, big_pose_smpl_param=big, big_pose_world_vertex=tensor(np.zeros((30, 3))))
    gauhuman.export(Model(True), camera, folder / "gauhuman.npz")
    file = np.load(folder / "gauhuman.npz")
    assert file["sh"].shape == (N, 4, 3) and np.isclose(file["canonical_pose"][7, 2], -np.pi / 6)


def test_what_does_not_fit_is_not_written(folder):
    good = {"means": np.zeros((2, 3)), "quats": np.ones((2, 4)), "scales": np.ones((2, 3)), "opacities": np.ones(2)}
    good["sh"] = np.zeros((2, 1, 3))
    bad = [("quats", np.ones((3, 4))), ("scales", np.ones((2, 2))), ("sh", np.zeros((2, 2, 3)))]
    bad.append(("means", np.full((2, 3), np.nan)))
    for name, value in bad:
        try:
            gaussians.write(folder / "bad.npz", method="m", strategy="s", **(good | {name: value}))
        except ValueError as error:
            assert str(error).startswith(name)
        else:
            raise AssertionError(name)
    assert not (folder / "bad.npz").exists()


def main(folder):
    folder.mkdir(exist_ok=True)
    test_quaternions()
    tests = [test_hugs, test_ihuman, test_animatable, test_gs3davatar, test_gauhuman]
    for test in [*tests, test_what_does_not_fit_is_not_written]:
        test(folder)
        print(f"{test.__name__}: ok")
    return 0


if __name__ == "__main__":
    if len(sys.argv) > 1:
        raise SystemExit(main(Path(sys.argv[1])))
    with tempfile.TemporaryDirectory() as scratch:
        raise SystemExit(main(Path(scratch)))
