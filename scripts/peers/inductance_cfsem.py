#!/usr/bin/env python3
"""Self inductances of thick windings by cfsem, for `fluxform-bench --peers`.

    python3 scripts/peers/inductance_cfsem.py --rows PROBLEM.json

A winding is cut into rectangular filaments, as near to squares as their number allows, that see
each other as circles and themselves by Lyle's series. The knob is the root of their number; the
error is the largest of all windings of the problem. See rows.py.
"""

import math

import rows

LACKS = rows.lacks("cfsem", "cfsem", "numpy")
SWEPT = (1, 2, 4, 8, 16)


def filaments(winding, root):
    """Radius, height and turns of every filament, and one filament's section."""
    import numpy as np

    # A hair of a bore: cfsem has no filament that reaches the axis.
    inner_m, outer_m = winding["inner_radius_m"], winding["outer_radius_m"]
    inner_m = max(inner_m, 1e-9 * outer_m)
    depth_m, length_m = outer_m - inner_m, winding["length_m"]
    side_m = math.sqrt(depth_m * length_m) / root
    across = math.ceil(depth_m / side_m)
    # Lyle's series wants filaments no longer than three times their radius.
    most_m = min(side_m, 3 * (inner_m + 0.5 * depth_m / across))
    along = math.ceil(length_m / most_m)
    section = (depth_m / across, length_m / along)
    radii = inner_m + section[0] * (np.arange(across) + 0.5)
    heights = section[1] * (np.arange(along) + 0.5)
    r, z = (grid.ravel() for grid in np.meshgrid(radii, heights))
    turns = np.full(len(r), winding["turns"] / len(r))
    return np.array([r, z, turns]), section


def main():
    asked = rows.problem()
    if LACKS:
        rows.answer([], [LACKS])
        return
    import cfsem

    reported = []
    for root in SWEPT[: 3 if asked["quick"] else None]:
        def work(root=root):
            found = []
            for case in asked["cases"]:
                cut, section = filaments(case["winding"], root)
                found.append(cfsem.self_inductance_axisymmetric_coil(cut, "rectangular", section, par=False))
            return found

        found, spread = rows.timed(work)
        errors = [abs(value / case["inductance_h"] - 1) for value, case in zip(found, asked["cases"])]
        reported.append(rows.row(root, len(errors), max(errors), spread))
    knob = "root of the number of filaments"
    rows.answer([rows.curve(asked, "cfsem", rows.version("cfsem"), knob, reported)])


if __name__ == "__main__":
    main()
