"""What the scripts share: reading and writing fixtures, and comparing answers with the committed ones.

A script gives, per file, a function from the committed content to the recomputed part of it: the same tree without the
data (draws, names). What it leaves out is data and stays as committed.
"""

import json
import math
import sys
from dataclasses import dataclass, field
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[3]
FIXTURES = REPOSITORY / "tests/data/fixtures"


def load(path):
    return json.loads((FIXTURES / path).read_text())


def save(path, content):
    """Writes in the layout of the committed file: one line, or one value a line."""
    lines = "\n" in (FIXTURES / path).read_text()
    layout = {"indent": 1} if lines else {"separators": (",", ":")}
    (FIXTURES / path).write_text(json.dumps(content, **layout, allow_nan=False))


def merge(old, new):
    """The committed tree with the recomputed parts in place."""
    if isinstance(new, dict):
        return old | {key: merge(old[key], value) for key, value in new.items()}
    if isinstance(new, list) and new and isinstance(new[0], dict):
        return [merge(*pair) for pair in zip(old, new, strict=True)]
    return new


def numbers(value):
    """The numbers of nested lists, flattened; None if there is anything else."""
    if isinstance(value, list):
        parts = [numbers(item) for item in value]
        return None if None in parts else [x for part in parts for x in part]
    return [value] if isinstance(value, (int, float)) and not isinstance(value, bool) else None


@dataclass
class Comparison:
    """Counts, the largest deviation in units of its tolerance, and the differences that are too large."""

    tolerances: dict
    count: int = 0
    equal: int = 0
    worst: tuple = (0.0, "")
    failures: list = field(default_factory=list)

    def tree(self, old, new, path=()):
        if isinstance(new, dict):
            for key, value in new.items():
                self.tree(old.get(key), value, (*path, key))
        elif isinstance(new, list) and new and isinstance(new[0], dict):
            for i, pair in enumerate(zip(old, new, strict=True)):
                self.tree(*pair, (*path, str(i)))
        elif numbers(new) is None or numbers(old) is None or len(numbers(old)) != len(numbers(new)):
            self.note(old == new, math.inf, path, f"{new} instead of {old}")
        else:
            self.array(numbers(old), numbers(new), path)

    def array(self, old, new, path):
        relative, absolute = self.tolerance(path)
        limit = relative * max((abs(x) for x in old), default=0.0) + absolute
        off = max((abs(a - b) for a, b in zip(old, new)), default=0.0)
        off = math.inf if any(map(math.isnan, new)) else off
        share = 0.0 if off == 0.0 else off / limit if limit else math.inf
        self.note(share <= 1.0, share, path, f"off by {off:.3g}, tolerance {limit:.3g}")
        self.count += len(new)
        self.equal += sum(a == b for a, b in zip(old, new))

    def tolerance(self, path):
        """(relative to the largest entry of the field, absolute), of the innermost field that has one."""
        key = next((key for key in reversed(path) if key in self.tolerances), "default")
        value = self.tolerances[key]
        return value if isinstance(value, tuple) else (value, 0.0)

    def note(self, fits, share, path, what):
        where = "/".join(path)
        if not fits:
            self.failures.append(f"{where}: {what}")
        elif share > self.worst[0] and share < math.inf:
            self.worst = (share, where)


def check(path, recomputed, tolerances):
    """Prints one line for the file, and one for each of the first differences. True if there is none."""
    found = Comparison(tolerances)
    found.tree(load(path), recomputed)
    share, where = found.worst
    worst = f", at most {share:.2g} of the tolerance ({where})" if where else ""
    state = f"{len(found.failures)} DIFFER" if found.failures else "ok"
    print(f"{path}: {state}: {found.count} numbers recomputed, {found.equal} bit-equal{worst}", flush=True)
    for failure in found.failures[:5]:
        print(f"    {failure}")
    return not found.failures


def run(files, tolerances, arguments):
    """`--check` (also without argument) compares, `--write` writes. Returns the exit status."""
    if arguments not in ([], ["--check"], ["--write"]):
        print("expected --check or --write", file=sys.stderr)
        return 2
    good = True
    for path, recompute in files.items():
        old = load(path)
        new = recompute(old)
        if arguments == ["--write"]:
            save(path, merge(old, new))
            print(f"{path}: written", flush=True)
        else:
            good &= check(path, new, tolerances)
    return 0 if good else 1
