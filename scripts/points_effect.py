#!/usr/bin/env python3
"""What the constraint points do to the force constant: the seed's grid against a resolved surface.

    python3 scripts/points_effect.py [PROGRAM]

For the seed's four shapes prints lambda (criterion jnd) of the 61 x 61 grid, of points graded to a
deviation and weighted by area, the stated errors of the latter, and the change. PROGRAM is the
fluxform binary; without it the release build is made and used. Standard library only.
"""

import json
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
DESIGN = "designs/seed.toml"
SHAPES = ["flat", "half_sphere", "half_cylinder", "wedge"]
FINE = ["--max-deviation", "0.1mm", "--max-width", "1mm"]


def program():
    """The binary named on the command line, or the release build."""
    if len(sys.argv) > 1:
        return sys.argv[1]
    subprocess.run(["cargo", "build", "--release", "--locked"], cwd=ROOT, check=True)
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return str(target / "release" / "fluxform")


def solved(binary, shape):
    """The JSON of `lambda` for graded points; it also states the grid's constant."""
    command = [binary, "lambda", DESIGN, f"shapes/{shape}.toml", *FINE, "--format", "json"]
    ran = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    if ran.returncode != 0:
        sys.exit(f"{' '.join(command)}: {ran.stderr}")
    return json.loads(ran.stdout)


def main():
    binary = program()
    print("| shape | points | lambda, grid | points | lambda, resolved | stated: between points | "
          "stated: heights | grid against resolved |")
    print("|---|---|---|---|---|---|---|---|")
    for shape in SHAPES:
        reported = solved(binary, shape)
        sampling, accuracy = reported["sampling"], reported["accuracy"]

        def percent(stage, accuracy=accuracy):
            return f"{100 * accuracy[stage]['estimate']:.3f} %" if stage in accuracy else "-"

        change = 1 / (1 + sampling["relative_change"]) - 1
        print(f"| {shape.replace('_', '-')} | {sampling['grid_points']} | "
              f"{sampling['grid_lambda_n_per_m']:.4f} | {reported['points']} | "
              f"{reported['lambda_n_per_m']:.4f} | {percent('quadrature')} | "
              f"{percent('lambda_of_heights')} | {100 * change:+.2f} % |")


if __name__ == "__main__":
    main()
