#!/usr/bin/env python3
"""Prints the plate that `optimize --for` chooses for designs/plate_search.toml, where drivers set voltages and where they
close current loops.

usage: python3 scripts/plate_search.py [PROGRAM] [EVALUATIONS]

The gain is the geometric mean of the four shapes' force constants over those of the given plate of 5 mm.
"""
import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

PROGRAM = sys.argv[1] if len(sys.argv) > 1 else "fluxform"
EVALUATIONS = sys.argv[2] if len(sys.argv) > 2 else "16"
ROOT = Path(__file__).resolve().parent.parent
SHAPES = ["flat", "half_sphere", "half_cylinder", "wedge"]


def cpu_s():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def searched(driver):
    """The result of the search, and its CPU seconds."""
    given = 'driver = "current"'
    text = (ROOT / "designs" / "plate_search.toml").read_text()
    assert given in text
    with tempfile.TemporaryDirectory() as folder:
        design = Path(folder) / "design.toml"
        design.write_text(text.replace(given, f'driver = "{driver}"'))
        shapes = [str(ROOT / "shapes" / f"{shape}.toml") for shape in SHAPES]
        command = [PROGRAM, "optimize", str(design), "--for", *shapes, "--evaluations", EVALUATIONS, "--format", "json"]
        before = cpu_s()
        run = subprocess.run(command, capture_output=True)
        # 4: no array that was computed meets the limits.
        if run.returncode not in (0, 4):
            sys.exit(run.stderr.decode())
    return json.loads(run.stdout), cpu_s() - before


def main():
    print("| drivers | plate, mm | gain | settling, ms | mass, kg | limits | error of the search's level | arrays | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|")
    for driver in ("voltage", "current"):
        found, took_s = searched(driver)
        limits = found["limits"]
        thickness = found["values"].get("plate.thickness_mm")
        level = next((level for level in found["levels"] if level["level"] == "search"), None)
        cells = [
            driver,
            "none" if thickness is None else f"{thickness:.2f}",
            f"{found['gain']:.3f}",
            f"{1e3 * limits['array_settling_s']['value']:.0f}",
            f"{limits['array_mass_kg']['value']:.2f}",
            "met" if found["limits_met"] else "not met",
            f"{level['gain_error']:.1e}" if level else "",
            found["evaluations"],
            f"{took_s:.0f}",
        ]
        print("| " + " | ".join(map(str, cells)) + " |", flush=True)


main()
