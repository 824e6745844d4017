#!/usr/bin/env python3
"""Times `reproduce score` against scikit-image, torchmetrics and the lpips package on the same folders, and compares what
they say.

    python3 -m venv venv
    venv/bin/pip install numpy scikit-image torch torchvision torchmetrics lpips    # some GB; a CPU build of torch will do
    cargo build --release
    venv/bin/python benches/compare_metrics.py [--frames 100] [--size 512] [--threads 2] [--repeat 3]

Frames are made up: a smooth pattern, and the same with noise, as 8-bit PNG. Everybody reads the files, and the time of
reading is part of everybody's. The lpips package downloads its backbone; here it is given the weights of
crates/lpips-alex/lpips_alex.safetensors instead. Times are minima over --repeat runs, in seconds per folder; imports are not counted
for Python, the start of the program is for `reproduce`.
"""

import argparse
import json
import os
import struct
import subprocess
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--program", type=Path, default=ROOT / "target/release/reproduce")
    return parser.parse_args()


def make_frames(folder, frames, size):
    y, x = np.mgrid[0:size, 0:size] / size
    random = np.random.default_rng(1)
    for i in range(frames):
        waves = [np.sin(9 * x + 0.1 * i) * np.cos(7 * y), np.cos(13 * y + 0.05 * i), np.sin(40 * x * y)]
        truth = 0.5 + 0.4 * np.stack(waves, axis=2)
        render = truth + random.normal(0, 0.03, truth.shape)
        for name, image in (("truths", truth), ("renders", render)):
            (folder / name).mkdir(exist_ok=True)
            levels = np.clip(image * 255 + 0.5, 0, 255).astype(np.uint8)
            imsave(folder / name / f"{i:04}.png", levels, check_contrast=False)


def pairs(folder):
    for path in sorted((folder / "truths").iterdir()):
        yield tuple(imread(folder / name / path.name) / 255.0 for name in ("renders", "truths"))


def reproduce(options, folder, *more):
    command = [options.program, "score", folder / "renders", folder / "truths", "--format", "json"]
    command += ["--threads", str(options.threads), *more]
    return json.loads(subprocess.run(command, check=True, capture_output=True).stdout)


def scikit_image(folder):
    values = []
    for render, truth in pairs(folder):
        psnr = peak_signal_noise_ratio(truth, render, data_range=1)
        valid = structural_similarity(
            truth, render, data_range=1, channel_axis=2, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
        )
        uniform = structural_similarity(truth, render, data_range=1, channel_axis=2)
        values.append((psnr, valid, uniform))
    return np.mean(values, axis=0)


def tensor(image):
    return torch.from_numpy(image.transpose(2, 0, 1)[None].astype(np.float32))


def torchmetrics_(folder):
    values = []
    for render, truth in pairs(folder):
        render, truth = tensor(render), tensor(truth)
        psnr = torchmetrics.functional.image.peak_signal_noise_ratio(render, truth, data_range=1.0)
        ssim = torchmetrics.functional.image.structural_similarity_index_measure(render, truth, data_range=1.0)
        values.append((psnr.item(), ssim.item()))
    return np.mean(values, axis=0)


def safetensors(path):
    content = path.read_bytes()
    length = struct.unpack("<Q", content[:8])[0]
    header = json.loads(content[8 : 8 + length])
    header.pop("__metadata__", None)
    for name, tensor in header.items():
        start, end = (8 + length + offset for offset in tensor["data_offsets"])
        yield name, torch.from_numpy(np.frombuffer(content[start:end], "<f4").reshape(tensor["shape"]).copy())


def lpips_model():
    model = lpips.LPIPS(net="alex", pnet_rand=True, verbose=False).eval()
    weights = dict(safetensors(ROOT / "crates/lpips-alex/lpips_alex.safetensors"))
    for name, values in model.net.named_parameters():
        values.data.copy_(weights["features." + name.split(".", 1)[1]])
    for k in range(5):
        assert torch.equal(getattr(model, f"lin{k}").model[-1].weight.data, weights[f"lin.{k}.weight"])
    return model


def lpips_package(folder, model):
    with torch.no_grad():
        images = ((tensor(render), tensor(truth)) for render, truth in pairs(folder))
        return np.mean([model(render, truth, normalize=True).item() for render, truth in images])


def timed(repeat, function):
    best = float("inf")
    for _ in range(repeat):
        start = time.perf_counter()
        value = function()
        best = min(best, time.perf_counter() - start)
    return best, value


def main(options):
    torch.set_num_threads(options.threads)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_frames(folder, options.frames, options.size)
        run = lambda function, *more: timed(options.repeat, lambda: function(*more))
        ours, scores = run(reproduce, options, folder)
        with_lpips, perceptual = run(reproduce, options, folder, "--lpips")
        skimage_time, skimage_values = run(scikit_image, folder)
        torch_time, torch_values = run(torchmetrics_, folder)
        lpips_time, lpips_value = run(lpips_package, folder, lpips_model())
    mean = scores["mean"]
    distance = perceptual["mean"]["lpips_alex_pm1"]
    print(f"{options.frames} frames, {options.size} x {options.size}, {options.threads} threads, minimum of {options.repeat}")
    print(f"reproduce score: 2 PSNR, 4 SSIM variants          {ours:8.2f} s")
    print(f"scikit-image: PSNR, 2 SSIM variants               {skimage_time:8.2f} s   x {skimage_time / ours:.1f}")
    print(f"torchmetrics: PSNR, 1 SSIM                        {torch_time:8.2f} s   x {torch_time / ours:.1f}")
    extra = with_lpips - ours
    print(f"reproduce score --lpips: LPIPS twice, on top      {extra:8.2f} s   {extra / options.frames / 2 * 1e3:.0f} ms each")
    print(f"lpips package, with reading the files             {lpips_time:8.2f} s   x {lpips_time / (extra / 2):.1f}")
    print("differences:")
    print(f"  scikit-image PSNR {mean['psnr'] - skimage_values[0]:.1e}, SSIM {mean['ssim_valid'] - skimage_values[1]:.1e}, "
          f"{mean['ssim_uniform7'] - skimage_values[2]:.1e}")
    print(f"  torchmetrics PSNR {mean['psnr'] - torch_values[0]:.1e}, SSIM {mean['ssim_reflect'] - torch_values[1]:.1e}")
    print(f"  lpips {distance - lpips_value:.1e}")


if __name__ == "__main__":
    options = arguments()
    os.environ.setdefault("OMP_NUM_THREADS", str(options.threads))
    import lpips
    import numpy as np
    import torch
    import torchmetrics
    from skimage.io import imread, imsave
    from skimage.metrics import peak_signal_noise_ratio, structural_similarity

    main(options)
