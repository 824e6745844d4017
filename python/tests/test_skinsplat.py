"""The package against its definitions and against the program: one value, however it is asked for."""

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import skinsplat

DATA = Path(__file__).resolve().parents[2] / "tests" / "data" / "blender"
SEQUENCE = DATA / "datasets" / "snapshot_ava" / "test_squat"
MODEL = DATA / "models" / "anny_smpl24.npz"


def reproduce(*arguments):
    command = [sys.executable, "-m", "skinsplat", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True)


def rotation(q):
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def random_quats(seed, *shape):
    q = np.random.default_rng(seed).normal(size=(*shape, 4))
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def test_average_is_the_leading_eigenvector():
    quats, weights = random_quats(0, 5, 7, 4), np.random.default_rng(1).uniform(0.1, 1, size=(5, 7, 4))
    averages = skinsplat.average(quats, weights)
    assert averages.shape == (5, 7, 4) and averages.dtype == np.float64
    for index in np.ndindex(5, 7):
        outer = np.einsum("k,ki,kj->ij", weights[index], quats[index], quats[index])
        values, vectors = np.linalg.eigh(outer)
        if values[-1] - values[-2] > 0.05:
            assert abs(vectors[:, -1] @ averages[index]) > 1 - 1e-12


def test_other_solvers_have_names():
    quats, weights = random_quats(2, 3, 2), np.full((3, 2), 0.5)
    assert np.allclose(skinsplat.average(quats, weights, "eigen"), skinsplat.average(quats, weights), atol=1e-9)
    with pytest.raises(ValueError, match="nearest"):
        skinsplat.average(quats, weights, "nearest")


def test_what_no_average_exists_of_is_named():
    quats = random_quats(3, 2, 2)
    with pytest.raises(ValueError, match=r"quats\[1\]"):
        skinsplat.average(quats, [[0.5, 0.5], [0, 0]])
    with pytest.raises(ValueError, match="shapes"):
        skinsplat.average(quats, [0.5, 0.5])
    with pytest.raises(ValueError):
        skinsplat.average([["a"]], [[1]])


def test_turned_sh_are_seen_from_turned_directions():
    rng = np.random.default_rng(4)
    sh, quats = rng.normal(size=(6, 4, 3)), random_quats(5, 6)
    turned = skinsplat.rotate_sh(sh, quats)
    c1 = 0.4886025119029199
    band = lambda s, d: c1 * (-d[1] * s[1] + d[2] * s[2] - d[0] * s[3])
    for own, new, quat in zip(sh, turned, quats):
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        assert np.allclose(band(own, direction), band(new, rotation(quat) @ direction))
        assert np.allclose(own[0], new[0])
    with pytest.raises(ValueError, match="expected"):
        skinsplat.rotate_sh(sh[:, :3], quats)


@pytest.fixture(scope="module")
def avatar():
    rng = np.random.default_rng(6)
    body = skinsplat.read_body(MODEL)
    means = body.vertices[::50].astype(np.float32)
    n = len(means)
    arrays = dict(
        means=means,
        rotations=random_quats(7, n),
        scales=np.exp(rng.uniform(-5, -3, size=(n, 3))),
        opacities=rng.uniform(0.2, 0.9, size=n),
        sh=rng.normal(size=(n, 4, 3)) * 0.3,
    )
    return arrays, skinsplat.make_avatar(**arrays)


def test_arrays_come_back(avatar):
    arrays, made = avatar
    assert len(made) == len(arrays["means"]) and made.sh_degree == 1
    for name in ("means", "sh"):
        assert np.array_equal(getattr(made, name), arrays[name].astype(np.float32))
    for name in ("rotations", "scales", "opacities"):
        assert np.allclose(getattr(made, name), arrays[name], rtol=1e-5)


def test_files_come_back(avatar, tmp_path):
    skinsplat.write_avatar(tmp_path / "a.ply", avatar[1])
    back = skinsplat.read_avatar(tmp_path / "a.ply")
    for name in ("means", "rotations", "scales", "opacities", "sh"):
        assert np.array_equal(getattr(back, name), getattr(avatar[1], name))
    with pytest.raises(ValueError, match="b.ply"):
        skinsplat.read_avatar(tmp_path / "b.ply")


@pytest.mark.parametrize("strategy", ["quaternion-average", "lbs", "push-forward"])
def test_posing_and_drawing_are_the_programs(avatar, tmp_path, strategy):
    skinsplat.write_avatar(tmp_path / "a.ply", avatar[1])
    poses = SEQUENCE / "poses.npz"
    betas = np.load(poses)["betas"]
    body = skinsplat.read_body(MODEL, betas)
    camera = skinsplat.read_cameras(SEQUENCE / "cameras.npz")[0]
    pose = body.poses(poses)[1]
    posed = skinsplat.pose(skinsplat.read_avatar(tmp_path / "a.ply"), body, pose, strategy)
    image = skinsplat.render(posed, camera, background=(1, 1, 1))
    done = reproduce(
        "render", tmp_path / "a.ply", "--camera", SEQUENCE / "cameras.npz", "--body", MODEL, "--poses", poses,
        "--frame", 1, "--strategy", strategy, "--background", "1,1,1", "--out", tmp_path / "o.npy",
    )
    assert done.returncode == 0, done.stderr
    assert image.shape == (camera.height, camera.width, 3) and image.min() < 0.9
    assert np.array_equal(image, np.load(tmp_path / "o.npy"))
    factors, covariances = posed.factors, posed.covariances
    assert np.allclose(factors @ factors.transpose(0, 2, 1), covariances, atol=1e-9)
    baked, _ = posed.bake()
    assert np.array_equal(baked.means, posed.means)


def test_bad_scenes_are_value_errors(avatar):
    body = skinsplat.read_body(MODEL)
    with pytest.raises(ValueError, match="strategy"):
        skinsplat.pose(avatar[1], body, body.rest_pose(), "sideways")
    with pytest.raises(ValueError, match="24 joints"):
        body.pose(np.zeros((3, 3)))
    assert isinstance(body.pose([[0, 0, 0]] * 24, (0, 1, 0)), skinsplat.Pose)
    with pytest.raises(ValueError, match="width"):
        skinsplat.Camera(0, 10, 1.0, 1.0, 0.0, 0.0, np.eye(4))
    with pytest.raises(ValueError, match="background"):
        skinsplat.render(avatar[1], skinsplat.read_cameras(SEQUENCE / "cameras.npz")[0], background=(255, 255, 255))
    with pytest.raises(ValueError, match="one without the other"):
        skinsplat.make_avatar(**avatar[0], joints=np.zeros((len(avatar[1]), 1), int))


def images(seed=8, size=64):
    rng = np.random.default_rng(seed)
    truth = np.kron(rng.uniform(size=(size // 8, size // 8, 3)), np.ones((8, 8, 1))).astype(np.float32)
    return np.clip(truth + rng.normal(scale=0.05, size=truth.shape), 0, 1).astype(np.float32), truth


def test_psnr_is_its_formula():
    render, truth = images()
    exact = -10 * math.log10(np.mean((render.astype(float) - truth) ** 2))
    assert skinsplat.psnr(render, truth, "default+quantise=none") == pytest.approx(exact, abs=1e-9)
    assert skinsplat.psnr(truth, truth) == math.inf
    eight = (truth * 255).round().astype(np.uint8)
    assert skinsplat.psnr(eight, eight.astype(np.float32) / 255) == math.inf
    assert 0 < skinsplat.ssim(render, truth) < 1 and skinsplat.lpips(render, truth) > 0


def test_images_that_do_not_fit_are_named():
    render, truth = images()
    with pytest.raises(ValueError, match="truth"):
        skinsplat.psnr(render, truth[:32])
    with pytest.raises(ValueError, match="mask"):
        skinsplat.psnr(render, truth, "hugs-human")
    with pytest.raises(ValueError, match="int64"):
        skinsplat.psnr(render, truth.astype(np.int64))
    with pytest.raises(ValueError, match="unknown"):
        skinsplat.metrics(render, truth, ["beauty"])


def test_folders_are_scored_as_by_the_program(tmp_path):
    for name, index in (("renders", 0), ("truths", 1)):
        (tmp_path / name).mkdir()
        for seed in range(2):
            np.save(tmp_path / name / f"{seed}.npy", images(seed)[index])
    scores = skinsplat.score(tmp_path / "renders", tmp_path / "truths", "hugs-full")
    assert len(scores["frames"]) == 2
    first = next(iter(scores["frames"].values()))["protocol"]["values"]
    assert first == skinsplat.metrics(*images(0), first.keys(), "hugs-full")
    with pytest.raises(ValueError, match="nowhere"):
        skinsplat.score(tmp_path / "nowhere", tmp_path / "truths")


def test_the_program_comes_with_the_package():
    listed = reproduce("list", "strategies", "--format", "json")
    assert listed.returncode == 0 and "quaternion-average" in listed.stdout
    json.loads(listed.stdout)
    assert reproduce("--version").stdout.split()[1] == skinsplat.__version__
    assert reproduce("skin").returncode == 2


def test_tensors_are_taken():
    torch = pytest.importorskip("torch")
    quats = torch.tensor(random_quats(9, 3, 2), requires_grad=True)
    assert np.array_equal(skinsplat.average(quats, torch.full((3, 2), 0.5)), skinsplat.average(quats.detach().numpy(), np.full((3, 2), 0.5)))
