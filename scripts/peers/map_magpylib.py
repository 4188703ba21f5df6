#!/usr/bin/env python3
"""Map an air-cored design with magpylib, time it, and compare maps with a reference.

    python3 scripts/peers/map_magpylib.py DESIGN REFERENCE.npz OURS.npz
    python3 scripts/peers/map_magpylib.py --rows PROBLEM.json       # see rows.py

A winding is six cylindrical current sheets at the Gauss-Legendre nodes of its radius. magpylib
has no such sheet, but an axially magnetised cylinder gives the same field outside itself, and
the same dB_z/dz on its axis: `Cylinder`, magnetisation = turns per metre. dB_z/dz is the central
difference of B_z over 2 STEP_M. One thread. REFERENCE.npz must hold the whole gradient: errors
are relative to the largest |grad B| of all coils at each height. Prints one JSON object.

With --rows the number of sheets is swept, and the error is that at the problem's nodes.

compare_map.py calls this; scripts/peers/requirements.txt lists what it needs.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import json
import platform
import sys
import time
import tomllib

import rows

LACKS = rows.lacks("magpylib", "magpylib", "numpy")
if not LACKS:
    import magpylib
    import numpy as np

SHELLS = 6
SWEPT_SHELLS = (1, 2, 4, 6, 8)
STEP_M = 1e-6  # the difference's own error and B's rounding balance here
HEIGHTS_AT_ONCE = 4  # keeps the arrays in cache: the fastest of 1, 4, 8


def coil(design):
    """One coil as nested cylinders, its top face at z = 0, 1 A."""
    section = design["coil"]
    inner_m = section["inner_diameter_mm"] / 2000
    outer_m = section["outer_diameter_mm"] / 2000
    return cylinders(inner_m, outer_m, section["length_mm"] / 1000, section["turns"], SHELLS)


def cylinders(inner_m, outer_m, length_m, turns, shells):
    nodes, weights = np.polynomial.legendre.leggauss(shells)
    radii_m = (inner_m + outer_m) / 2 + (outer_m - inner_m) / 2 * nodes
    return [
        magpylib.magnet.Cylinder(
            magnetization=(0, 0, turns / length_m * weight / 2),
            dimension=(2 * radius_m, length_m),
            position=(0, 0, -length_m / 2),
        )
        for radius_m, weight in zip(radii_m, weights)
    ]


def array(design):
    layout = design["array"]
    pitch_m = layout["pitch_mm"] / 1000
    rows, columns = layout["rows"], layout["columns"]
    return [
        magpylib.Collection(*coil(design)).move(
            ((column - (columns - 1) / 2) * pitch_m, (row - (rows - 1) / 2) * pitch_m, 0)
        )
        for row in range(rows)
        for column in range(columns)
    ]


def gradient_map(coils, x_m, y_m, z_m):
    """dB_z/dz per ampere, [coil, z, y, x]."""
    plane = np.stack(np.meshgrid(x_m, y_m), axis=-1).reshape(-1, 2)
    maps = np.empty((len(coils), len(z_m), len(y_m), len(x_m)))
    for first in range(0, len(z_m), HEIGHTS_AT_ONCE):
        heights_m = z_m[first : first + HEIGHTS_AT_ONCE]
        points = np.concatenate(
            [
                np.column_stack([plane, np.full(len(plane), height_m + side * STEP_M)])
                for side in (-1, 1)
                for height_m in heights_m
            ]
        )
        field = magpylib.getB(coils, points)[..., 2]
        below, above = field.reshape(len(coils), 2, len(heights_m), len(y_m), len(x_m)).swapaxes(0, 1)
        maps[:, first : first + len(heights_m)] = (above - below) / (2 * STEP_M)
    return maps


def largest_error(maps, reference):
    """Largest difference of dB_z/dz relative to the largest |grad B| at its height."""
    gradient = reference["gradient_t_per_m_per_a"]
    norm = np.sqrt((gradient**2).sum(axis=(-2, -1))).max(axis=(0, 2, 3))
    error = np.abs(maps - reference["gz_t_per_m_per_a"]).max(axis=(0, 2, 3))
    return float((error / norm).max())


def swept(asked):
    """Rows over the number of sheets."""
    winding = asked["winding"]
    section = [winding[key] for key in ("inner_radius_m", "outer_radius_m", "length_m", "turns")]
    x_m, y_m, z_m = (np.array(asked[axis]) for axis in ("x_m", "y_m", "z_m"))
    at = tuple(np.array(asked["coil_z_y_x"]).T)
    exact, size = np.array(asked["gz_t_per_m_per_a"]), np.array(asked["size_t_per_m_per_a"])
    reported = []
    for shells in SWEPT_SHELLS[: 3 if asked["quick"] else None]:
        coils = [
            magpylib.Collection(*cylinders(*section, shells)).move((x, y, 0))
            for x, y in asked["positions_m"]
        ]
        maps, spread = rows.timed(lambda coils=coils: gradient_map(coils, x_m, y_m, z_m))
        reported.append(rows.row(shells, maps.size, (abs(maps[at] - exact) / size).max(), spread))
    return reported


def main():
    asked = rows.problem()
    if asked and LACKS:
        rows.answer([], [LACKS])
        return
    if asked:
        knob = "cylindrical sheets a winding"
        rows.answer([rows.curve(asked, "magpylib", magpylib.__version__, knob, swept(asked))])
        return
    design_path, reference_path, ours_path = sys.argv[1:]
    with open(design_path, "rb") as file:
        design = tomllib.load(file)
    reference = np.load(reference_path)
    coils = array(design)
    x_m, y_m, z_m = (reference[axis] for axis in ("x_m", "y_m", "z_m"))
    start = time.process_time()
    maps = gradient_map(coils, x_m, y_m, z_m)
    seconds = time.process_time() - start
    result = {
        "cpu_s": seconds,
        "point_coils": maps.size,
        "error": largest_error(maps, reference),
        "error_ours": largest_error(np.load(ours_path)["gz_t_per_m_per_a"], reference),
        "magpylib": magpylib.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
