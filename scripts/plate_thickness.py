#!/usr/bin/env python3
"""Prints a table of plate thicknesses for the seed, force constants and settling,
and the best thickness where drivers set voltages and where they set currents.

usage: python3 scripts/plate_thickness.py [PROGRAM]

The best thickness is that of the largest least constant, relative to no plate, among those whose array settles within
the seed's limit and whose plate stays below its knee.
"""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

PROGRAM = sys.argv[1] if len(sys.argv) > 1 else "fluxform"
ROOT = Path(__file__).resolve().parent.parent
SHAPES = ["flat", "half_sphere", "half_cylinder", "wedge"]
THICKNESSES_MM = [None, 1, 2, 3, 5, 8]
SETTLING_MAX_MS = 100


def result(*arguments):
    run = subprocess.run([PROGRAM, *arguments, "--format", "json"], capture_output=True, check=True)
    return json.loads(run.stdout)


def design_text(thickness_mm):
    """The seed with current loops and a limit of the array's settling, on a plate if there is one."""
    text = (ROOT / "designs" / "seed.toml").read_text()
    text = text.replace("[supply]", '[supply]\ndriver = "current"')
    text = text.replace("[limits]", f"[limits]\narray_settling_max_ms = {SETTLING_MAX_MS}")
    plate = f"\n[plate]\nthickness_mm = {thickness_mm}\nx_mm = 150\ny_mm = 150\n"
    return text + (plate if thickness_mm else "")


def measured(thickness_mm):
    """Constants, settling by voltages and by current loops (ms), and the plate's largest flux density and knee (T)."""
    with tempfile.TemporaryDirectory() as folder:
        design = Path(folder) / "design.toml"
        design.write_text(design_text(thickness_mm))
        shapes = [str(ROOT / "shapes" / f"{shape}.toml") for shape in SHAPES]
        constants = [result("lambda", str(design), shape)["lambda_n_per_m"] for shape in shapes]
        evaluated = result("evaluate", str(design))
    array = evaluated["array"]
    settling_ms = {
        "voltage": 1e3 * array["settling_s"],
        "current": 1e3 * evaluated["limits"]["array_settling_s"]["value"],
    }
    return constants, settling_ms, array.get("iron")


def main():
    print("| thickness, mm | flat | half-sphere | half-cylinder | wedge, N/m | settling: voltages, ms | current loops, ms | largest B in the plate, T |")
    print("|---|---|---|---|---|---|---|---|")
    rows = []
    for thickness in THICKNESSES_MM:
        constants, settling_ms, iron = measured(thickness)
        rows.append((thickness, constants, settling_ms, iron))
        cells = [thickness or "none", *(f"{c:.2f}" for c in constants)]
        cells += [f"{settling_ms[driver]:.0f}" for driver in ("voltage", "current")]
        cells.append(f"{iron['peak_field_t']:.2f}" if iron else "")
        print("| " + " | ".join(map(str, cells)) + " |", flush=True)
    without = rows[0][1]
    for driver in ("voltage", "current"):
        within = [
            (min(c / w for c, w in zip(constants, without)), thickness or "no plate")
            for thickness, constants, settling_ms, iron in rows
            if settling_ms[driver] <= SETTLING_MAX_MS and not (iron and iron["peak_field_t"] > iron["knee_t"])
        ]
        best = max(within, default=None, key=lambda pair: pair[0])
        if best:
            print(f"\n{driver}: best {best[1]} (mm), the least constant times {best[0]:.2f}")
        else:
            least = min(rows, key=lambda row: row[2][driver])
            print(f"\n{driver}: none settles within {SETTLING_MAX_MS} ms; the fastest, {least[0] or 'no plate'}, takes {least[2][driver]:.0f} ms")


main()
