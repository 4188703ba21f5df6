#!/usr/bin/env python3
"""Prints the table of plate thicknesses in designs/README.md: force constants and settling of the seed on a plate.

usage: python3 scripts/plate_thickness.py [PROGRAM]
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


def result(*arguments):
    run = subprocess.run([PROGRAM, *arguments, "--format", "json"], capture_output=True, check=True)
    return json.loads(run.stdout)


def main():
    seed = (ROOT / "designs" / "seed.toml").read_text()
    print("| thickness, mm | flat | half-sphere | half-cylinder | wedge, N/m | settling, ms | largest B in the plate, T |")
    print("|---|---|---|---|---|---|---|")
    for thickness in THICKNESSES_MM:
        plate = f"\n[plate]\nthickness_mm = {thickness}\nx_mm = 150\ny_mm = 150\n" if thickness else ""
        with tempfile.TemporaryDirectory() as folder:
            design = Path(folder) / "design.toml"
            design.write_text(seed + plate)
            constants = [
                result("lambda", str(design), str(ROOT / "shapes" / f"{shape}.toml"))["lambda_n_per_m"]
                for shape in SHAPES
            ]
            evaluated = result("evaluate", str(design))
        array, resistance = evaluated["array"], evaluated["coil"]["resistance_ohm"]
        iron = array.get("iron")
        most = 5e3 * max(coil["inductance_h"] for coil in array["coils"]) / resistance
        cells = [thickness or "none", *(f"{c:.2f}" for c in constants), f"{most:.0f}"]
        cells.append(f"{iron['peak_field_t']:.2f}" if iron else "")
        print("| " + " | ".join(map(str, cells)) + " |", flush=True)


main()
