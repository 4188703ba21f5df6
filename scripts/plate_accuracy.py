#!/usr/bin/env python3
"""Prints how the answers for the seed on a plate of 150 x 150 x 5 mm move with --tolerance, and what each takes.

usage: python3 scripts/plate_accuracy.py [PROGRAM] [TOLERANCE ...]

Inductances of the middle, a side and a corner coil; the force constants of four shapes relative to no plate; CPU time
(all threads, user and system) and peak memory of the slowest command. The last row is that of three-dimensional finite
elements, tests/oracles/steel/plate.json, with the largest change by a lower order, another level or a larger ball.
"""
import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

PROGRAM = sys.argv[1] if len(sys.argv) > 1 else "fluxform"
TOLERANCES = sys.argv[2:] or ["1e-2", "3e-3", "1e-3"]
ROOT = Path(__file__).resolve().parent.parent
SHAPES = ["flat", "half_sphere", "half_cylinder", "wedge"]
PLATE = "\n[plate]\nthickness_mm = 5\nx_mm = 150\ny_mm = 150\n"


def cpu_s():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def result(*arguments):
    """The JSON of a command and its CPU seconds."""
    before = cpu_s()
    run = subprocess.run([PROGRAM, *arguments, "--format", "json"], capture_output=True, check=True)
    return json.loads(run.stdout), cpu_s() - before


def main():
    print("| tolerance | inductances, H | flat | half-sphere | half-cylinder | wedge | CPU s | MB | stated error |")
    print("|---|---|---|---|---|---|---|---|---|")
    seed = (ROOT / "designs" / "seed.toml").read_text()
    with tempfile.TemporaryDirectory() as folder:
        plain, plate = Path(folder) / "plain.toml", Path(folder) / "plate.toml"
        plain.write_text(seed)
        plate.write_text(seed + PLATE)
        for tolerance in TOLERANCES:
            evaluated, slowest_s = result("evaluate", str(plate), "--tolerance", tolerance)
            coils = evaluated["array"]["coils"]
            cells = [tolerance, " / ".join(f"{coils[k]['inductance_h']:.4f}" for k in (4, 3, 0))]
            for shape in SHAPES:
                path = str(ROOT / "shapes" / f"{shape}.toml")
                without, _ = result("lambda", str(plain), path, "--tolerance", tolerance)
                joined, took_s = result("lambda", str(plate), path, "--tolerance", tolerance)
                slowest_s = max(slowest_s, took_s)
                cells.append(f"{joined['lambda_n_per_m'] / without['lambda_n_per_m']:.4f}")
            memory_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024e-6
            error = evaluated["accuracy"]["mutual_inductance"]["estimate"]
            cells += [f"{slowest_s:.0f}", f"{memory_mb:.0f}", f"{error:.0e}"]
            print("| " + " | ".join(cells) + " |", flush=True)
    print(elements())


def elements():
    """The row of the committed finite elements."""
    oracle = json.loads((ROOT / "tests" / "oracles" / "steel" / "plate.json").read_text())
    best = oracle["meshes"]["best"]
    inductances = " / ".join(f"{best['inductance_h'][name]:.4f}" for name in ("centre", "side", "corner"))
    ratios = " | ".join(f"{oracle['lambda_jnd'][shape]['ratio']:.4f}" for shape in SHAPES)
    change = max(max(changes.values()) for changes in oracle["changes"].values())
    return f"| finite elements | {inductances} | {ratios} | {best['cpu_s']:.0f} | | {change:.0e} |"


main()
