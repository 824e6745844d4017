#!/usr/bin/env bash
# Makes this report: bash reports/tuning/make.sh DIR [OUT]. DIR holds the Blender subjects, of which two have a sequence `val`, which no table
# scores. What is done already is not done again. REPRODUCE names a program that is built already.
set -euo pipefail
[ $# -ge 1 ] || { echo "usage: make.sh DIR [OUT]" >&2; exit 2; }
${REPRODUCE:-cargo run --release --locked --quiet --} run tuning --data "$1" --subject snapshot_gus --subject snapshot_hana --out "${2:-runs/tuning}"
