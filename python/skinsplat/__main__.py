"""The program ``reproduce``, also as ``python -m skinsplat``."""

from __future__ import annotations

import signal
import sys

from . import _skinsplat


def main() -> int:
    """Runs the program with the arguments of the command line; its exit code."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # the program ends as any other does
    return _skinsplat.run_program(["reproduce", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
