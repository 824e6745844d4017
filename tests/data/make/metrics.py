"""fixtures/metrics and fixtures/lpips_example: image metrics by the libraries that papers use.

Data: the pictures, versions, note. PSNR and 3DGS's SSIM are written from their definitions; the rest are calls of
scikit-image, torchmetrics, piq and lpips. AlexNet's weights are those of crates/lpips-alex; VGG-16's are not in the
repository: REPRODUCE_LPIPS_WEIGHTS names the file (crates/lpips-alex/README.md), without it VGG's numbers are left
out.
"""

import functools
import math
import os
import sys
import warnings

import lpips
import numpy as np
import piq
import torch
import torchmetrics.functional.image as torchmetrics
from safetensors.torch import load_file
from skimage.io import imread
from skimage.metrics import structural_similarity

from common import FIXTURES, REPOSITORY, run

# Double precision differs in the order of additions, single precision in its roundings.
SINGLE = (0.0, 2e-6)
TOLERANCES = {
    "default": (1e-11, 1e-13),
    "inria_f32": (0.0, 1e-5),
    "f32": SINGLE,
    "spatial_mean_f32": SINGLE,
    **{f"{net}_{scale}_f32": SINGLE for net in ("alex", "vgg") for scale in ("pm1", "raw01")},
}
# So much of a message is kept where a library refuses a size.
MESSAGE = 110
# LPIPS is made for [-1, 1]; some trainers hand it [0, 1].
PM1, RAW01 = "pm1", "raw01"


def picture(path, dtype=torch.float64):
    """1 x 3 x H x W in [0, 1]."""
    return torch.from_numpy(imread(FIXTURES / path)).permute(2, 0, 1)[None].to(dtype) / 255


def refusal(error):
    return f"error: {type(error).__name__}: {str(error)[:MESSAGE]}"


def value_or_refusal(compute):
    try:
        value = float(compute())
    except (ValueError, RuntimeError) as error:
        return refusal(error)
    return value if math.isfinite(value) else str(value)


def psnr(mse):
    """None is infinite."""
    return None if mse == 0 else 10 * math.log10(1 / mse)


def gaussian_window(dtype):
    x = torch.arange(11, dtype=torch.float64) - 5
    weights = torch.exp(-(x**2) / (2 * 1.5**2)).to(dtype)
    return weights / weights.sum()


def zero_padded_ssim(a, b, window):
    """3DGS's: a Gaussian window of 11 pixels with zeros around the image, no correction of the variance."""
    kernel = torch.outer(window, window).to(a.dtype).expand(3, 1, 11, 11)

    def mean(x):
        return torch.nn.functional.conv2d(x, kernel, padding=5, groups=3)

    ma, mb = mean(a), mean(b)
    va, vb, covariance = mean(a * a) - ma * ma, mean(b * b) - mb * mb, mean(a * b) - ma * mb
    c1, c2 = 0.01**2, 0.03**2
    similarity = (2 * ma * mb + c1) * (2 * covariance + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2))
    return similarity.mean()


def ssims(a, b):
    planes = [x[0].permute(1, 2, 0).numpy() for x in (a, b)]
    skimage = functools.partial(structural_similarity, *planes, channel_axis=2)
    gaussian = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
    f32 = gaussian_window(torch.float32)
    theirs = torchmetrics.structural_similarity_index_measure
    variants = {
        "inria_f64": lambda: zero_padded_ssim(a, b, gaussian_window(torch.float64)),
        "inria_f32window_f64": lambda: zero_padded_ssim(a, b, f32),
        "inria_f32": lambda: zero_padded_ssim(a.float(), b.float(), f32),
        "skimage_gaussian": lambda: skimage(data_range=1.0, **gaussian),
        "skimage_default_7x7_uniform": lambda: skimage(data_range=1.0),
        "skimage_default_data_range_2": lambda: skimage(data_range=2.0),
        "torchmetrics": lambda: theirs(a, b, data_range=1.0),
        "torchmetrics_default_data_range": lambda: theirs(a, b),
        "piq": lambda: piq.ssim(a, b, data_range=1.0),
        "piq_no_downsample": lambda: piq.ssim(a, b, data_range=1.0, downsample=False),
    }
    if all(x.amax((2, 3)).equal(x.amin((2, 3))) for x in (a, b)):
        # The range is zero: rounding noise over rounding noise.
        del variants["torchmetrics_default_data_range"]
    return {name: value_or_refusal(compute) for name, compute in variants.items()}


def weights_files():
    """The networks that can be made, and their weights."""
    files = {"alex": REPOSITORY / "crates/lpips-alex/lpips_alex.safetensors"}
    if vgg := os.environ.get("REPRODUCE_LPIPS_WEIGHTS"):
        files["vgg"] = vgg
    return files


@functools.cache
def network(net, dtype, spatial=False):
    """lpips's own network with the weights of the file, whose channel weights are those of the lpips package."""
    with warnings.catch_warnings():
        # It names torchvision's argument for the weights as torchvision once did.
        warnings.simplefilter("ignore", UserWarning)
        model = lpips.LPIPS(net=net, pnet_rand=True, spatial=spatial, verbose=False)
    tensors = load_file(weights_files()[net])
    state = {name: tensors["features." + name.split(".", 1)[1]] for name in model.net.state_dict()}
    model.net.load_state_dict(state)
    for k, layer in enumerate(model.lins):
        assert torch.equal(layer.model[-1].weight, tensors[f"lin.{k}.weight"]), f"{net}: lin.{k}"
    model = model.to(dtype)
    for constant in (model.scaling_layer.shift, model.scaling_layer.scale):
        # They have three decimals, but went through single precision.
        constant.copy_(constant.round(decimals=3))
    return model


def scaled(x, scale):
    return 2 * x - 1 if scale == PM1 else x


def distance(net, a, b, spatial=False):
    """As the lpips package computes it."""
    with torch.no_grad():
        return network(net, a.dtype, spatial)(a, b).mean().item()


def torchmetrics_normalisation(f):
    """Where lpips divides by sqrt(sum f²) + 1e-10."""
    return f / (f.square().sum(1, keepdim=True) + 1e-8).sqrt()


def evaluate(net, a, b):
    """Distances by layer with lpips's and with torchmetrics's normalisation, of the same features."""
    model = network(net, a.dtype)
    with torch.no_grad():
        taps = [model.net(model.scaling_layer(x)) for x in (a, b)]
        return [
            [lin((norm(f) - norm(g)) ** 2).mean().item() for lin, f, g in zip(model.lins, *taps)]
            for norm in (lpips.normalize_tensor, torchmetrics_normalisation)
        ]


def lpips_values(a, b):
    found = {}
    for net in weights_files():
        for scale in (PM1, RAW01):
            key, (x, y) = f"{net}_{scale}", (scaled(a, scale), scaled(b, scale))
            try:
                layers, theirs = evaluate(net, x, y)
            except RuntimeError as error:
                found[key] = refusal(error)
                continue
            single = distance(net, x.float(), y.float())
            named = {"": sum(layers), "_layers": layers, "_f32": single, "_torchmetrics_eps": sum(theirs)}
            found |= {key + name: number for name, number in named.items()}
    return found


def recompute_pair(pair):
    a, b = (picture(f"metrics/{file}") for file in pair["files"])
    by_channel = ((a - b) ** 2).mean((0, 2, 3)).tolist()
    channels = [psnr(mse) for mse in by_channel]
    mse = float(((a - b) ** 2).mean())
    return {
        "height": a.shape[2],
        "width": a.shape[3],
        "mse": mse,
        "mae": float((a - b).abs().mean()),
        "psnr": psnr(mse),
        "psnr_mean_of_channels": None if None in channels else float(np.mean(channels)),
        "ssim": ssims(a, b),
        "lpips": lpips_values(a, b),
    }


def probes(values, committed):
    """The values at the committed places (channel, row, column)."""
    return [[*place, values[tuple(place)].item()] for place in (probe[:3] for probe in committed)]


def tap_statistics(tap, committed):
    return {
        "shape": list(tap.shape),
        "mean": tap.mean().item(),
        "std": tap.std(correction=0).item(),
        "max": tap.max().item(),
        "zero_fraction": (tap == 0).double().mean().item(),
        "l2": tap.norm().item(),
        "probes": probes(tap, committed["probes"]),
    }


def recompute_taps(file):
    image = scaled(picture("metrics/png/taps_astro64.png"), PM1)
    found = {}
    for net in weights_files():
        model = network(net, image.dtype)
        with torch.no_grad():
            given = model.scaling_layer(image)
            taps = model.net(given)
        committed = file[net]
        found[net] = {
            "scaled_input_probe": probes(given[0], committed["scaled_input_probe"]),
            "taps": [tap_statistics(tap[0], old) for tap, old in zip(taps, committed["taps"], strict=True)],
        }
    return found


def recompute_example(file):
    found = {}
    for key in file:
        net, name = key.split("/")
        if net not in weights_files():
            continue
        a, b = (scaled(picture(f"lpips_example/{x}.png"), PM1) for x in ("ex_ref", name))
        layers, _ = evaluate(net, a, b)
        found[key] = {
            "f64": sum(layers),
            "f32": distance(net, a.float(), b.float()),
            "per_layer": layers,
            "spatial_mean_f32": distance(net, a.float(), b.float(), spatial=True),
        }
    return found


FILES = {
    "metrics/expected.json": lambda file: {
        "pairs": {name: recompute_pair(pair) for name, pair in file["pairs"].items()}
    },
    "metrics/lpips_taps_astro64.json": recompute_taps,
    "lpips_example/expected.json": recompute_example,
}

if __name__ == "__main__":
    raise SystemExit(run(FILES, TOLERANCES, sys.argv[1:]))
