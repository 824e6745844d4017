#!/usr/bin/env python3
"""Makes reports/protocols.md and the files beside this script: one avatar, posed in two ways, under every protocol.

    cargo build --release
    python3 reports/protocols/make.py [--lpips-weights lpips_vgg.safetensors]

Run it in the root of the repository; it needs nothing but Python and works in target/protocols.
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path

PROGRAM = Path("target/release/reproduce")
SUBJECT = Path("tests/data/blender/datasets/snapshot_ava")
BODY = "tests/data/blender/models/anny_smpl24.npz"
WORK, OUT = Path("target/protocols"), Path("reports/protocols")
STRATEGIES = ["quaternion-average", "hugs-original"]
BACKGROUNDS = {"white": "1,1,1", "black": "0,0,0"}


def reproduce(*words):
    command = [str(PROGRAM), "--quiet", *map(str, words)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def avatar():
    made = WORK / "run"
    reproduce("run", "table1", "--data", SUBJECT.parent, "--subject", SUBJECT.name, "--variant", "skinned", "--out", made)
    return next((made / "avatars").glob("*.ply"))


def render(ply):
    for motion in ("test_squat", "test_twist"):
        folder = SUBJECT / motion
        for frame, image in enumerate(sorted((folder / "images").iterdir())):
            name = f"{motion}_{image.name}"
            (WORK / "truth").mkdir(parents=True, exist_ok=True)
            shutil.copy(image, WORK / "truth" / name)
            for strategy in STRATEGIES:
                for colour, background in BACKGROUNDS.items():
                    out = WORK / f"{strategy}-{colour}"
                    out.mkdir(parents=True, exist_ok=True)
                    reproduce("render", ply, "--camera", folder / "cameras.npz", "--out", out / name, "--body", BODY,
                              "--poses", folder / "transforms.json", "--frame", frame, "--strategy", strategy,
                              "--background", background)


def scores(strategy, weights):
    """Per protocol the scores of the renders over its own background (white for a captured one)."""
    rows = {}
    for colour in ("black", "white"):
        table = json.loads(reproduce("score", WORK / f"{strategy}-{colour}", WORK / "truth", "--protocol", "all",
                                     "--format", "json", *weights))
        for row in table["protocols"]:
            if row["frames_over_another_background"] == 0:
                rows[row["protocol"]["id"]] = row
        order = [row["protocol"]["id"] for row in table["protocols"]]
    return [rows[protocol] for protocol in order]


def number(value, digits):
    return "n/c" if value is None else f"{value:.{digits}f}"


def signed(a, b, digits):
    return "n/c" if a is None or b is None else f"{a - b:+.{digits}f}"


METRICS = [("psnr", 3), ("ssim", 5), ("lpips", 5)]


def page(ours, stock):
    lines = []
    add = lines.append
    add("| protocol | PSNR | SSIM | LPIPS | background | region | SSIM variant | LPIPS variant | Δ PSNR | Δ SSIM | Δ LPIPS |")
    add("|---" * 11 + "|")
    for a, b in zip(ours, stock):
        protocol, a, b = a["protocol"], a["scores"]["values"], b["scores"]["values"]
        background = protocol["background"]
        background = background if isinstance(background, str) else ",".join(f"{v:g}" for v in background)
        cells = [f"{protocol['id']}@{protocol['version']}"]
        cells += [number(a.get(metric), digits) for metric, digits in METRICS]
        cells += [background, protocol["region"], protocol["ssim"], protocol["lpips"]]
        cells += [signed(a.get(metric), b.get(metric), digits) for metric, digits in METRICS]
        add("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def span(rows, metric):
    values = [row["scores"]["values"].get(metric) for row in rows]
    values = [value for value in values if value is not None]
    return min(values), max(values), max(values) - min(values)


TEXT = """# One pair of folders under every protocol

The same {frames} renders and truths, scored as each paper scores: what moves below is the protocol alone. The renders are
one avatar of the Blender subject `{subject}`, fitted to its training frames (quick profile) and posed by the paper's
quaternion average on the test frames of `test_squat` and `test_twist`, 512 x 512. The last three columns are the
gain over the same avatar posed as HUGS does (its unnormalised quaternion), under the same protocol. Renders are drawn over each protocol's own
background; `captured` ones see white.

{table}

n/c: not computed; the protocol's LPIPS needs VGG-16 (`--lpips-weights`, see crates/lpips-alex/README.md).

| over the protocols | PSNR | SSIM | LPIPS |
|---|---|---|---|
| whole image, from | {full_psnr[0]:.3f} | {full_ssim[0]:.5f} | {full_lpips[0]:.5f} |
| whole image, to | {full_psnr[1]:.3f} | {full_ssim[1]:.5f} | {full_lpips[1]:.5f} |
| **whole image, moved by the protocol alone** | **{full_psnr[2]:.3f}** | **{full_ssim[2]:.5f}** | **{full_lpips[2]:.5f}** |
| all regions, moved | {all_psnr[2]:.3f} | {all_ssim[2]:.5f} | {all_lpips[2]:.5f} |
| paper, mean gain of Table 1 | 0.26 | | |
| paper, mean gain of Table 5 | 0.04 | | 0 |

The paper's gains are read off its tables; they are smaller than what the choice of a protocol does to the same pictures.
The range of LPIPS mixes networks and input ranges. Rules that follow: compare numbers only under one protocol; do not
compare LPIPS of [0, 1] inputs (`raw01`) with LPIPS of [-1, 1] inputs (`pm1`), nor a crop to the subject (`hugs-human`)
with whole images; and say which PSNR is averaged (`haha` pools the squared errors of all frames).

Made by `python3 reports/protocols/make.py{options}`, which poses and renders with `reproduce run` and `reproduce render` and
scores with

    reproduce score RENDERS TRUTHS --protocol all{options}

`protocols/*.json` hold every digit, with all choices of every protocol.
"""


def main():
    weights = sys.argv[1:]
    shutil.rmtree(WORK, ignore_errors=True)
    render(avatar())
    ours, stock = (scores(strategy, weights) for strategy in STRATEGIES)
    for strategy, rows in zip(STRATEGIES, (ours, stock)):
        (OUT / f"{strategy}.json").write_text(json.dumps(rows, indent=1) + "\n")
    full = [row for row in ours if row["protocol"]["region"] == "full"]
    ranges = {f"full_{m}": span(full, m) for m, _ in METRICS} | {f"all_{m}": span(ours, m) for m, _ in METRICS}
    options = f" --lpips-weights {Path(weights[1]).name}" if weights else ""
    text = TEXT.format(frames=ours[0]["scores"]["frames"], subject=SUBJECT.name, table=page(ours, stock), options=options, **ranges)
    Path("reports/protocols.md").write_text(text)


if __name__ == "__main__":
    main()
