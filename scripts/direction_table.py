#!/usr/bin/env python3
"""Where the force points: static currents and feedback for each requested direction, on the seed's shapes.

    python3 scripts/direction_table.py [PROGRAM [--short]]

For every shape, cores coupled or not, coils that push only or push and pull: the error of the force
vector at lambda_jnd as a share of the requested force, its sideways part, the angle between the two, the
power, and the largest lambda at which every point gets its force. PROGRAM is the fluxform binary; without it
the release build is made and used. --short prints one line a scene, with static currents of `vertical` and
feedback of each kind. Standard library only.
"""

import json
import subprocess
import sys

from feedback_table import DESIGN, ROOT, SHAPES, program

SHORT = "--short" in sys.argv
SHORT_HEAD = [
    "shape, coupling, drivers", "vertical, static", "vertical, feedback", "vertical-only, feedback", "normal, feedback",
]
HEAD = [
    "shape, coupling, drivers", "requested", "currents", "error", "sideways", "degrees: median, 95 %",
    "points given", "W", "lambda N/m",
]


def solved(binary, design, shape, direction):
    """What `lambda --feedback` reports of the force vector for a design given as text."""
    ran = subprocess.run(
        [binary, "lambda", "-", f"shapes/{shape}.toml", "--feedback", "--force-direction", direction,
         "--format", "json"],
        input=design, capture_output=True, text=True, cwd=ROOT,
    )
    if ran.returncode != 0:
        sys.exit(f"{shape}: {ran.stderr}")
    return json.loads(ran.stdout)


def row(name, requested, currents, rendering, largest):
    """The cells of one line of the table."""
    given = "" if currents == "static" else f"{100 * rendering['reached']:.1f} %"
    cells = [
        name, requested, currents, f"{100 * rendering['error_share']:.1f} %",
        f"{100 * rendering['sideways_share']:.1f} %",
        f"{rendering['direction_median_deg']:.1f}, {rendering['direction_95_deg']:.1f}", given,
        f"{rendering['mean_power_w']:.1f}", "" if largest is None else f"{largest:.3f}",
    ]
    return cells


def short(rows_of_scene):
    """One line of the short table: sideways share, degrees, W and lambda of every kind."""
    kinds = [cells for cells in rows_of_scene if cells[2] == "feedback" or cells[1] == "vertical"]
    return [kinds[0][0], *("; ".join([*cells[4:6], cells[7], cells[8] or "none"]) for cells in kinds)]


def line(cells):
    """A line of a table."""
    return "| " + " | ".join(cells) + " |"


def static(vector):
    """What static currents chosen for all three components make of the vector, and their lambda_jnd."""
    of = vector["static_vector"]
    return of["at_chosen"]["rendering"], of["lambda_jnd_n_per_m"]


def rows(name, upright, normal):
    """The lines of one shape: eq. 8 of the upward force alone leaves the sideways force as it comes; static
    currents of `vertical` are chosen for the upward force, the others for all components."""
    constant = upright["lambda_n_per_m"]
    up, along = upright["feedback"]["vector"], normal["feedback"]["vector"]
    of_upward = upright["feedback"]["lambda_n_per_m"]
    return [
        row(name, "vertical", "static", up["static"], constant),
        row(name, "vertical", "feedback", up["upward"], of_upward),
        row(name, "vertical-only", "static", *static(up)),
        row(name, "vertical-only", "feedback", up["vector"], up["lambda_n_per_m"]),
        row(name, "normal", "static", *static(along)),
        row(name, "normal", "feedback", along["vector"], along["lambda_n_per_m"]),
    ]


def main():
    binary = program()
    full = DESIGN.read_text(encoding="utf-8")
    head = SHORT_HEAD if SHORT else HEAD
    print(line(head))
    print("|---" * len(head) + "|")
    for coupling in ("full", "none"):
        for drivers in ("push", "push and pull"):
            design = full
            if coupling == "none":
                design = design.replace("pitch_mm = 50.0", 'pitch_mm = 50.0\ncoupling = "none"')
            if drivers != "push":
                design = design.replace("current_max_a = 2.0", "current_max_a = 2.0\ncurrent_min_a = -2.0")
            for shape in SHAPES:
                upright, normal = (
                    solved(binary, design, shape, direction) for direction in ("vertical-only", "normal")
                )
                found = rows(f"{upright['shape']}, {coupling}, {drivers}", upright, normal)
                for cells in [short(found)] if SHORT else found:
                    print(line(cells), flush=True)


if __name__ == "__main__":
    main()
