"""fixtures/gs_math: single Gaussians, a small image and the paper's Eq. 6-9 end to end, in double precision.

Data: the Gaussians, cameras, bones and weights, and the pixels at which alpha is given. Semantics are those of the
original 3DGS rasterizer: blur of 0.3 pixels, the Jacobian clamped at 1.3 times the field of view, tiles of 16 x 16.
"""

import sys

import numpy as np
import roma
import torch

from common import run
from formulas import (
    UPPER,
    covariance,
    gram_schmidt,
    heaviest_side_sum,
    product,
    raw_quaternion,
    rgb,
    rotation,
    sh_basis,
    turned_sh,
    unit,
)

# A needle's determinant is a difference of nearly equal products: its digits, and those of what is divided by it, are
# fewer. The small image is written with 14 decimals.
TOLERANCES = {
    "default": 1e-14,
    "power": 1e-12,
    "alpha": (0.0, 1e-13),
    "det": 1e-12,
    "conic": 1e-12,
    "lambda2": 1e-11,
    "antialias_opacity_scale": 1e-11,
    "posed_sh_eq9_16x3": 1e-13,
    "rgb_skinned": 1e-13,
    "variants": 1e-13,
    "image_hwc_tilecull": (0.0, 2e-14),
    "final_T_tilecull": (0.0, 2e-14),
    "max_abs_diff_without_tile_cull": 1e-12,
}
NEAR, FAR = 0.01, 100.0
NEAR_CULL = 0.2
BLUR = 0.3
TILE = 16


def projection(tan_x, tan_y):
    depth = FAR / (FAR - NEAR)
    return np.array([[1 / tan_x, 0, 0, 0], [0, 1 / tan_y, 0, 0], [0, 0, depth, -depth * NEAR], [0, 0, 1, 0]])


def projected_covariance(case, cam, world_to_camera, sigma):
    """(2 x 2 covariance on the screen without blur, whether the Jacobian's point was clamped)."""
    slopes = cam[:2] / cam[2]
    limits = 1.3 * np.array([case["tan_fovx"], case["tan_fovy"]])
    x, y = np.clip(slopes, -limits, limits)
    fx, fy = case["fx"] / cam[2], case["fy"] / cam[2]
    to_screen = np.array([[fx, 0, -fx * x], [0, fy, -fy * y]]) @ world_to_camera
    return to_screen @ sigma @ to_screen.T, bool((np.abs(slopes) > limits).any())


def extent(cov):
    """(conic, determinant, eigenvalues as the kernels bound them, radius of three standard deviations)."""
    det = cov[0, 0] * cov[1, 1] - cov[0, 1] ** 2
    mid = (cov[0, 0] + cov[1, 1]) / 2
    spread = np.sqrt(max(0.1, mid * mid - det))
    conic = np.array([cov[1, 1], -cov[0, 1], cov[0, 0]]) / det
    return conic, det, (mid + spread, mid - spread), int(np.ceil(3 * np.sqrt(mid + spread)))


def screen_position(case, cam, w_added):
    clip = projection(case["tan_fovx"], case["tan_fovy"]) @ [*cam, 1.0]
    return ((clip[:2] / (clip[3] + w_added) + 1) * [case["width"], case["height"]] - 1) / 2


def falloff(conic, offset):
    a, b, c = conic
    return -0.5 * (a * offset[..., 0] ** 2 + c * offset[..., 1] ** 2) - b * offset[..., 0] * offset[..., 1]


def colours(sh, direction):
    basis = sh_basis(direction)
    found = {}
    for degree in range(4):
        count = (degree + 1) ** 2
        value = basis[:count] @ sh[:count] + 0.5
        clamped = np.maximum(value, 0)
        found[str(degree)] = {
            "unclamped": value.tolist(),
            "rgb": clamped.tolist(),
            "clamped": (value < 0).tolist(),
        }
    return found


def alphas(case, mean2d, conic):
    found = []
    for pixel in case["alpha"]:
        power = float(falloff(conic, mean2d - np.array(pixel["pixel"])))
        alpha = float(min(0.99, case["opacity"] * np.exp(power)))
        found.append({"power": power, "alpha": alpha, "skipped": bool(power > 0 or alpha < 1 / 255)})
    return found


def world_covariance(case):
    return covariance(rotation(unit(case["quat_wxyz"])) * case["scale"])


def recompute_gaussian(case):
    view = np.array(case["view_row_major"]).reshape(4, 4)
    turn, shift = view[:3, :3], view[:3, 3]
    mean = np.array(case["mean"])
    cam = turn @ mean + shift
    position = -np.linalg.solve(turn, shift)
    sigma = world_covariance(case)
    unnormalised = covariance(rotation(case["quat_wxyz"]) * case["scale"])
    flat, clamped = projected_covariance(case, cam, turn, sigma)
    cov = flat + BLUR * np.eye(2)
    conic, det, (first, second), radius = extent(cov)
    mean2d = screen_position(case, cam, 0.0)
    direction = unit(mean - position)
    return {
        "fx": case["width"] / (2 * case["tan_fovx"]),
        "fy": case["height"] / (2 * case["tan_fovy"]),
        "cam_pos": position.tolist(),
        "proj_row_major": projection(case["tan_fovx"], case["tan_fovy"]).ravel().tolist(),
        "cov3d_upper6": sigma[UPPER].tolist(),
        "cov3d_kernel_unnormalised_q_upper6": unnormalised[UPPER].tolist(),
        "mean_cam": cam.tolist(),
        "cov2d_no_blur": flat[np.triu_indices(2)].tolist(),
        "cov2d": cov[np.triu_indices(2)].tolist(),
        "jacobian_clamped": clamped,
        "conic": conic.tolist(),
        "det": float(det),
        "lambda1": float(first),
        "lambda2": float(second),
        "radius": radius,
        "culled_near_0p2": bool(cam[2] <= NEAR_CULL),
        "antialias_opacity_scale": float(np.sqrt(max(2.5e-5, np.linalg.det(flat) / det))),
        "mean2d": mean2d.tolist(),
        "mean2d_kernel_w_eps1e7": screen_position(case, cam, 1e-7).tolist(),
        "view_dir": direction.tolist(),
        "sh_rgb": colours(np.array(case["sh_16x3"]).reshape(16, 3), direction),
        "alpha": alphas(case, mean2d, conic),
    }


def splats(scene):
    """(depth, position, conic, tiles or None, opacity, colour) of what is in front of the camera, by depth."""
    view = np.array(scene["view_row_major"]).reshape(4, 4)
    found = []
    for case in scene["gaussians"]:
        mean = np.array(case["mean"])
        cam = view[:3, :3] @ mean + view[:3, 3]
        if cam[2] <= NEAR_CULL:
            continue
        flat, _ = projected_covariance(scene, cam, view[:3, :3], world_covariance(case))
        conic, _, _, radius = extent(flat + BLUR * np.eye(2))
        position = screen_position(scene, cam, 0.0)
        eye = -np.linalg.solve(view[:3, :3], view[:3, 3])
        colour = np.maximum(rgb(np.array(case["sh_16x3"]).reshape(16, 3), unit(mean - eye)), 0)
        found.append((cam[2], position, conic, radius, case["opacity"], colour))
    return sorted(found, key=lambda splat: splat[0])


def tiles(position, radius, pixels):
    """Which pixels lie in a tile that the square of the radius touches."""
    first = np.trunc((position - radius) / TILE)
    last = np.trunc((position + radius + TILE - 1) / TILE)
    tile = pixels // TILE
    return ((tile >= first) & (tile < last)).all(axis=-1)


def image(scene, cull):
    """Front to back; a pixel ends before the splat that would leave less than 1e-4 of the light."""
    pixels = np.stack(np.meshgrid(np.arange(scene["width"]), np.arange(scene["height"])), axis=-1)
    colour, light = np.zeros((*pixels.shape[:2], 3)), np.ones(pixels.shape[:2])
    done = np.zeros(pixels.shape[:2], bool)
    for _, position, conic, radius, opacity, paint in splats(scene):
        power = falloff(conic, position - pixels)
        alpha = np.minimum(0.99, opacity * np.exp(power))
        drawn = (power <= 0) & (alpha >= 1 / 255) & ~done
        if cull:
            drawn &= tiles(position, radius, pixels)
        left = light * (1 - alpha)
        done |= drawn & (left < 1e-4)
        drawn &= ~done
        colour[drawn] += (alpha * light)[drawn, None] * paint
        light[drawn] = left[drawn]
    return colour + light[..., None] * scene["background"], light


def recompute_render(scene):
    colour, light = image(scene, cull=True)
    uncut, _ = image(scene, cull=False)
    return {
        "fx": scene["width"] / (2 * scene["tan_fovx"]),
        "fy": scene["height"] / (2 * scene["tan_fovy"]),
        "image_hwc_tilecull": [round(v, 14) for v in colour.ravel().tolist()],
        "final_T_tilecull": [round(v, 14) for v in light.ravel().tolist()],
        "max_abs_diff_without_tile_cull": float(np.abs(uncut - colour).max()),
    }


def blended(case):
    """Eq. 7: the top eigenvector of sum w q qᵀ, largest component positive, and its gap."""
    quats, weights = np.array(case["bone_quats_wxyz"]), np.array(case["weights"])
    values, vectors = np.linalg.eigh(np.einsum("i,ij,ik->jk", weights, quats, quats))
    q = vectors[:, 3]
    return q * np.sign(q[np.abs(q).argmax()]), values[3] - values[2]


def wrong_variants(case, m, sh, direction):
    """What other ways to blend or to colour give: covariances as upper triangles, colours clamped at 0."""
    own, scale = rotation(unit(case["quat_wxyz"])), np.array(case["scale"])
    polar = roma.special_procrustes(torch.from_numpy(m)).numpy()
    nlerp = rotation(heaviest_side_sum(case["bone_quats_wxyz"], case["weights"]))
    hugs, _ = raw_quaternion(m @ own)
    factors = {
        "polar_lbs": polar @ own,
        "raw_lbs": m @ own,
        "gram_schmidt_cols": gram_schmidt(m)[0] @ own,
        "gram_schmidt_rows": gram_schmidt(m.T)[0].T @ own,
        "hugs_normalised": rotation(unit(hugs)),
        "hugs_unnormalised_kernel": rotation(hugs),
        "nlerp": nlerp @ own,
    }
    colour = {
        "unrotated_sh": direction,
        "viewdir_canon_MT": unit(m.T @ direction),
        "viewdir_canon_Minv": unit(np.linalg.solve(m, direction)),
    }
    covariances = {f"cov_{name}": covariance(f * scale)[UPPER].tolist() for name, f in factors.items()}
    colours = {f"rgb_{name}": np.maximum(rgb(sh, d), 0).tolist() for name, d in colour.items()}
    return covariances | {"hugs_raw_quat_of_M_Rg": hugs.tolist()} | colours


def recompute_skinned(case):
    bones = np.array([rotation(q) for q in case["bone_quats_wxyz"]])
    weights, mean = np.array(case["weights"]), np.array(case["mean"])
    m = np.einsum("i,ijk->jk", weights, bones)
    position = m @ mean + weights @ np.array(case["bone_trans"])
    average, gap = blended(case)
    posed = product(average, unit(case["quat_wxyz"]))
    sh = np.array(case["sh_16x3"]).reshape(16, 3)
    turned = turned_sh(sh, rotation(average))
    direction = unit(position - case["cam_pos"])
    return {
        "bone_rotmats": bones.ravel().tolist(),
        "eig_gap": float(gap),
        "posed_mean_eq6": position.tolist(),
        "blended_quat_eq7": average.tolist(),
        "posed_quat_eq8": posed.tolist(),
        "posed_sh_eq9_16x3": turned.ravel().tolist(),
        "cov_markley": covariance(rotation(posed) * case["scale"])[UPPER].tolist(),
        "view_dir": direction.tolist(),
        "rgb_skinned": np.maximum(rgb(turned, direction), 0).tolist(),
        "variants": wrong_variants(case, m, sh, direction),
    }


FILES = {
    "gs_math/gaussians.json": lambda cases: [recompute_gaussian(case) for case in cases],
    "gs_math/tiny_render.json": recompute_render,
    "gs_math/skinned_end_to_end.json": lambda cases: [recompute_skinned(case) for case in cases],
}

if __name__ == "__main__":
    raise SystemExit(run(FILES, TOLERANCES, sys.argv[1:]))
