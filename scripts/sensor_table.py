#!/usr/bin/env python3
"""What currents chosen for a sensor that is 4 mm wrong gain along a trajectory, on the seed's shapes.

    python3 scripts/sensor_table.py [PROGRAM]

For each shape, the upward force or the whole vector requested: the felt error that is promised and that random
displays realise, and the mean power, with the currents of least power and with those chosen for the uncertainty.
PROGRAM is the fluxform binary; without it the release build is made and used. Standard library only.
"""

import json
import pathlib
import subprocess
import tempfile

from feedback_table import DESIGN, ROOT, SHAPES, program

HEAD = ["shape", "requested", "least power: promised, realised", "W", "chosen: promised, realised", "W"]
DIRECTIONS = ["vertical", "vertical-only"]


def percent(share):
    """Three digits."""
    return f"{100 * share:#.3g}".rstrip(".") + " %"


def cells(felt):
    """Promised and realised error and the mean power of one choice of currents."""
    return [f"{percent(felt['promised'])}, {percent(felt['realised'])}", f"{felt['mean_power_w']:#.3g}".rstrip(".")]


def main():
    binary = program()
    run = {"cwd": ROOT, "capture_output": True, "text": True, "check": True}
    print("| " + " | ".join(HEAD) + " |")
    print("|---" * len(HEAD) + "|")
    with tempfile.TemporaryDirectory() as folder:
        for direction in DIRECTIONS:
            shapes = [f"shapes/{shape}.toml" for shape in SHAPES]
            made = ["calibrate", DESIGN, *shapes, "--sensor-error", "4mm", "--force-direction", direction]
            subprocess.run([binary, *made, "--no-report", "--out", f"{folder}/{direction}"], **run)
            for shape in SHAPES:
                name = shape.replace("_", "-")
                bundle = pathlib.Path(folder) / direction / DESIGN.stem / name
                moved = ["replay", bundle, "--synthesize", "explore", "--duration", "40", "--robust", "--out", bundle / "replay.csv"]
                ran = subprocess.run([binary, *moved, "--format", "json"], **run)
                felt = json.loads(ran.stdout)["force"]["felt"]
                print("| " + " | ".join([name, direction, *cells(felt["feedback"]), *cells(felt["robust"])]) + " |")


if __name__ == "__main__":
    main()
