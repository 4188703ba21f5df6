#!/usr/bin/env python3
"""Whether objects that differ more, by `fluxform compare`, were confused less by people.

    python3 scripts/confusion.py [PROGRAM]

The people: Table II of the paper that designs/seed.toml follows (ten participants, four objects,
160 trials with position feedback and 160 with static currents), kept in
scripts/confusion_table2.csv: rows the objects they named, columns those they touched. A pair's
confusions are those in either direction. Prints, for each way of rendering, the six pairs and
Spearman's rank correlation between confusions and difference, with the share of all 720 orders of
the pairs whose correlation is at least as strong (exact, two-sided; ties get their mean rank).
PROGRAM is the fluxform binary; without it the release build is made and used. Standard library only.
"""

import csv
import itertools
import json
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
DESIGN = "designs/seed.toml"
SHAPES = ["flat", "half_sphere", "half_cylinder", "wedge"]
TABLE = ROOT / "scripts" / "confusion_table2.csv"
TRIALS_AN_OBJECT = 40
# Keys of `compare` and what they are: of the upward force, then of the force vector.
MEASURES = {
    "": "largest", "rms_": "rms", "vector_": "largest of the vector", "vector_rms_": "rms of the vector",
}


def program():
    """The binary named on the command line, or the release build."""
    if len(sys.argv) > 1:
        return sys.argv[1]
    subprocess.run(["cargo", "build", "--release", "--locked"], cwd=ROOT, check=True)
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return str(target / "release" / "fluxform")


def compared(binary):
    """What `compare` says of the seed's four objects."""
    shapes = [f"shapes/{shape}.toml" for shape in SHAPES]
    ran = subprocess.run(
        [binary, "compare", DESIGN, *shapes, "--format", "json"],
        capture_output=True, text=True, cwd=ROOT,
    )
    if ran.returncode != 0:
        sys.exit(f"compare: {ran.stderr}")
    return json.loads(ran.stdout)


def confusions(feedback):
    """How often each two objects were taken for each other."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["feedback"] == feedback]
    counts = {row.pop("predicted"): row for row in rows}
    for name in counts:
        touched = sum(int(counts[other][name]) for other in counts)
        assert touched == TRIALS_AN_OBJECT, f"{TABLE}: {name} has {touched} trials"
    return {
        frozenset((a, b)): int(counts[a][b]) + int(counts[b][a])
        for a, b in itertools.combinations(counts, 2)
    }


def ranks(values):
    """Ranks from 1; equal values share their mean rank."""
    order = sorted(values)
    return [order.index(value) + (order.count(value) + 1) / 2 for value in values]


def correlation(a, b):
    """Pearson's coefficient of two lists of ranks."""
    mean = (len(a) + 1) / 2
    product = sum((x - mean) * (y - mean) for x, y in zip(a, b))
    squares = sum((x - mean) ** 2 for x in a) * sum((y - mean) ** 2 for y in b)
    return product / squares**0.5


def spearman(a, b):
    """The rank correlation, and the share of all orders in which it is as strong."""
    a, b = ranks(a), ranks(b)
    rho = correlation(a, b)
    orders = list(itertools.permutations(b))
    strong = sum(abs(correlation(a, order)) >= abs(rho) - 1e-12 for order in orders)
    return rho, strong, len(orders)


def check():
    """The statistics on cases known by hand."""
    assert ranks([10, 30, 10, 20]) == [1.5, 4, 1.5, 3]
    rho, strong, orders = spearman([1, 2, 3, 4, 5, 6], [6, 5, 4, 3, 2, 1])
    assert (rho, strong, orders) == (-1.0, 2, 720)


def main():
    check()
    pairs = compared(program())["pairs"]
    kinds = [("no", "static"), ("yes", "feedback")]
    print("| pair | " + " | ".join(
        f"{kind}: largest | rms | vector: largest | rms | confused" for _, kind in kinds) + " |")
    print("|---|" + "---|" * 10)
    counted = {kind: confusions(feedback) for feedback, kind in kinds}
    reported = {(kind, what): [] for _, kind in kinds for what in MEASURES}
    for pair in pairs:
        cells = []
        for _, kind in kinds:
            for what in MEASURES:
                value = pair[f"{kind}_{what}jnd"]
                reported[kind, what].append(value)
                cells.append(f"{value:.2f}")
            cells.append(str(counted[kind][frozenset((pair["a"], pair["b"]))]))
        print(f"| {pair['a']}, {pair['b']} | " + " | ".join(cells) + " |")
    print()
    for (kind, what), values in reported.items():
        confused = [counted[kind][frozenset((pair["a"], pair["b"]))] for pair in pairs]
        # The largest with feedback is the same for three pairs but for rounding.
        rho, strong, orders = spearman([round(value, 6) for value in values], confused)
        print(f"{kind}, {MEASURES[what]}: rho = {rho:+.2f}, "
              f"p = {strong / orders:.2f} ({strong} of {orders} orders), n = {len(values)} pairs")


if __name__ == "__main__":
    main()
