#!/usr/bin/env bash
# Makes this report: bash reports/tuning/make.sh DIR [OUT]. DIR holds the Blender subjects; their sequences `val`, which no table scores, stand as test
# sequences in a folder of links. What is done already is not done again.
set -euo pipefail
[ $# -ge 1 ] || { echo "usage: make.sh DIR [OUT]" >&2; exit 2; }
data=$(cd "$1" && pwd)
out=${2:-runs/tuning}
links=$out/data
mkdir -p "$links/datasets"
ln -sfn "$data/models" "$links/models"
for subject in snapshot_gus snapshot_hana; do
  mkdir -p "$links/datasets/$subject"
  for file in train_casual gt_normal_offset.npy; do
    ln -sfn "$data/datasets/$subject/$file" "$links/datasets/$subject/$file"
  done
  ln -sfn "$data/datasets/$subject/val" "$links/datasets/$subject/test_val"
done
cargo run --release --locked --quiet -- run tuning --data "$links" --out "$out"
