#!/usr/bin/env python3
"""The force constants of the seed's four shapes, with and without coupling between the cores.

    python3 scripts/seed_table.py [PROGRAM]

Prints the table that README.md shows, and what the array needs for 6 N/m on the flat surface.
PROGRAM is the fluxform binary; without it the release build is made and used. Standard library only.
"""

import json
import os
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
DESIGN = ROOT / "designs" / "seed.toml"
SHAPES = ["flat", "half_sphere", "half_cylinder", "wedge"]
CONSTANTS = ["linear", "jnd", "saturation"]
WANTED_N_PER_M = 6.0


def program():
    """The binary named on the command line, or the release build."""
    if len(sys.argv) > 1:
        return sys.argv[1]
    subprocess.run(["cargo", "build", "--release", "--locked"], cwd=ROOT, check=True)
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return str(target / "release" / "fluxform")


def run(binary, command, design, *shape):
    """The JSON that a command prints for a design given as text."""
    ran = subprocess.run(
        [binary, command, "-", *shape, "--format", "json"],
        input=design, capture_output=True, text=True, cwd=ROOT,
    )
    if ran.returncode != 0:
        sys.exit(f"{command}: {ran.stderr}")
    return json.loads(ran.stdout)


def with_current(design, current_a):
    """The design with one limit a coil and no other limit of the currents."""
    design = re.sub(r"current_max_a = .*", f"current_max_a = {current_a!r}", design, count=1)
    design = re.sub(r"total_current_max_a = .*\n", "", design)
    return re.sub(r"voltage_v = .*\n", "", design)


def main():
    binary = program()
    full = DESIGN.read_text(encoding="utf-8")
    none = full.replace("pitch_mm = 50.0", 'pitch_mm = 50.0\ncoupling = "none"')
    head = [f"{name}, {coupling}" for coupling in ("none", "full") for name in CONSTANTS]
    print("| shape | " + " | ".join(head) + " |")
    print("|---|" + "---|" * len(head))
    flat = None
    for shape in SHAPES:
        path = f"shapes/{shape}.toml"
        results = [run(binary, "lambda", design, path) for design in (none, full)]
        flat = flat or results[1]
        cells = [result[f"lambda_{name}_n_per_m"] for result in results for name in CONSTANTS]
        name = results[0]["shape"]
        print(f"| {name} | " + " | ".join(f"{value:.4f}" for value in cells) + " |")
    # Every force is proportional to the currents: one step finds the limit, a second run shows it.
    current_a = 2.0 * WANTED_N_PER_M / flat["lambda_jnd_n_per_m"]
    design = with_current(full, round(current_a, 4))
    reached = run(binary, "lambda", design, "shapes/flat.toml")["lambda_jnd_n_per_m"]
    coil = run(binary, "evaluate", design)
    peak_t = max(core["peak_field_t"] for core in coil["array"]["coils"])
    knee_t = coil["core"]["knee_t"]
    print()
    print(
        f"With coupling, lambda_jnd = {reached:.3f} N/m on the flat surface needs "
        f"{current_a:.3f} A a coil\n({coil['coil']['power_w']:.1f} W each); the cores reach "
        f"{peak_t:.3f} T, {'below' if peak_t < knee_t else 'ABOVE'} the knee at {knee_t} T."
    )


if __name__ == "__main__":
    main()
