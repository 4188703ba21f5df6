#!/usr/bin/env python3
"""Static currents against position feedback on the seed's four shapes, cores coupled or not.

    python3 scripts/feedback_table.py [PROGRAM]

Prints the table that results/README.md shows. PROGRAM is the fluxform binary; without it the release build
is made and used. Standard library only.
"""

import json
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
DESIGN = ROOT / "designs" / "seed.toml"
SHAPES = ["flat", "half_sphere", "half_cylinder", "wedge"]
SHELL = "14mm"
HEAD = [
    "shape, coupling", "lambda_jnd N/m",
    "static: rms, worst mN", "largest A", "W",
    "feedback: rms, worst mN", "largest A", "mean W", "coils active",
    "lambda_feedback N/m", f"within {SHELL}",
]


def program():
    """The binary named on the command line, or the release build."""
    if len(sys.argv) > 1:
        return sys.argv[1]
    subprocess.run(["cargo", "build", "--release", "--locked"], cwd=ROOT, check=True)
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return str(target / "release" / "fluxform")


def solved(binary, design, shape):
    """The JSON of `lambda --feedback` for a design given as text."""
    ran = subprocess.run(
        [binary, "lambda", "-", f"shapes/{shape}.toml", "--feedback", "--shell", SHELL,
         "--format", "json"],
        input=design, capture_output=True, text=True, cwd=ROOT,
    )
    if ran.returncode != 0:
        sys.exit(f"{shape}: {ran.stderr}")
    return json.loads(ran.stdout)


def errors(rendering):
    """RMS and largest force error, mN."""
    return ", ".join(f"{1e3 * rendering[key]:.2f}" for key in ("rms_error_n", "worst_error_n"))


def row(name, result):
    """One line of the table."""
    feedback = result["feedback"]
    static, here = feedback["without"], feedback["at_chosen"]
    cells = [
        name, f"{static['lambda_n_per_m']:.3f}",
        errors(static), f"{static['largest_current_a']:.2f}", f"{static['power_w']:.1f}",
        errors(here), f"{here['largest_current_a']:.2f}", f"{here['mean_power_w']:.1f}",
        f"{here['active_mean']:.1f} ({here['active_min']} to {here['active_max']})",
    ]
    for found in (feedback, feedback["shell"]):
        largest = found["lambda_n_per_m"]
        cells.append("none" if largest is None else f"{largest:.3f}")
    return "| " + " | ".join(cells) + " |"


def main():
    binary = program()
    full = DESIGN.read_text(encoding="utf-8")
    none = full.replace("pitch_mm = 50.0", 'pitch_mm = 50.0\ncoupling = "none"')
    print("| " + " | ".join(HEAD) + " |")
    print("|---" * len(HEAD) + "|")
    for coupling, design in (("none", none), ("full", full)):
        for shape in SHAPES:
            result = solved(binary, design, shape)
            print(row(f"{result['shape']}, {coupling}", result), flush=True)


if __name__ == "__main__":
    main()
