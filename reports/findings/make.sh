#!/usr/bin/env bash
# Makes what reports/findings.md reports: bash reports/findings/make.sh DIR [OUT]. DIR holds the Blender subjects
# (snapshot_ava without its longer `train`); what is done already is not done again, so that a call that was stopped goes on. Needs hours on two
# cores. REPRODUCE names a program that is built already.
set -euo pipefail
[ $# -ge 1 ] || { echo "usage: make.sh DIR [OUT]" >&2; exit 2; }
data=$1
out=${2:-runs/findings}
reproduce() { ${REPRODUCE:-cargo run --release --locked --quiet --} run "$@"; }
captures=(--subject snapshot_ava --subject snapshot_gus --subject snapshot_hana --subject multiview_hana)

reproduce attribution-hugs attribution-animatable attribution-splattingavatar attribution-ihuman budget \
  --data "$data" "${captures[@]}" --out "$out/attribution"
reproduce bend --data "$data" "${captures[@]}" --out "$out/bend"
reproduce lights --out "$out/lights"
reproduce noise --data "$data" --subject xhands_gus --out "$out/noise"
