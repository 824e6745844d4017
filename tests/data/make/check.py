"""Recomputes every fixture that can be made here and compares it with the committed file: a line a file.

python tests/data/make/check.py            # exit status 1 if a number is off by more than its tolerance
python tests/data/make/check.py --write    # writes the files anew
"""

import sys

import common
import goldens
import gs_math
import metrics
import power_iteration
import raster
import rotation
import sh


def main():
    statuses = [
        common.run(script.FILES, script.TOLERANCES, sys.argv[1:])
        for script in (rotation, power_iteration, sh, gs_math, goldens, metrics)
    ]
    if sys.argv[1:] != ["--write"]:
        statuses.append(raster.main(sys.argv[1:]))
    return max(statuses)


if __name__ == "__main__":
    raise SystemExit(main())
