#!/usr/bin/env python3
"""The seed's nine cores on a plate by magpylib-material-response: cells of constant polarisation.

    python3 scripts/peers/plate_magpylib.py EDGE_MM [LAYERS]     # of the cells, about; of the plate, 1

The centre coil is driven. Cores are cut by the package's `mesh_Cylinder` into near-cubic cells, the plate into cuboids,
and solved by `apply_demag` as it comes (each cell's field at the others' centres); the winding is LOOPS current loops.
The steel's part of the inductance is the integral of M.B_coil. One thread. Prints one JSON object: dB_z/dz 30 mm above
the nine coils, the inductance, cells, and CPU seconds without start and imports.

compare_steel.py calls this; scripts/peers/requirements_steel.txt lists what it needs.
"""

import json
import math
import os
import sys
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import magpylib
import numpy as np
from magpylib_material_response import __version__
from magpylib_material_response.demag import apply_demag
from magpylib_material_response.meshing import mesh_Cuboid, mesh_Cylinder

MU_0 = 4e-7 * math.pi
INNER_M, OUTER_M, LENGTH_M, TURNS, AIR_H = 0.012, 0.019, 0.1, 1429.0, 0.0145019
BOTTOM_M, PITCH_M, CHI = -0.11, 0.05, 999.0
SIDE_M, THICKNESS_M = 0.15, 0.005
LOOPS = (8, 100)  # over the radius (Gauss) and along the axis
STEP_M = 2e-4


def winding():
    node, weight = np.polynomial.legendre.leggauss(LOOPS[0])
    radii = 0.5 * (INNER_M + OUTER_M) + 0.5 * (OUTER_M - INNER_M) * node
    heights = -LENGTH_M * (np.arange(LOOPS[1]) + 0.5) / LOOPS[1]
    return [
        magpylib.current.Circle(current=TURNS * part / 2 / LOOPS[1], diameter=2 * radius, position=(0, 0, height))
        for radius, part in zip(radii, weight) for height in heights
    ]


def steel(edge_m, layers):
    """Cells of nine cores, about as long as wide, and layers of a plate."""
    bodies = []
    count = round(math.pi * INNER_M**2 * -BOTTOM_M / edge_m**3)
    for i in (-1, 0, 1):
        for j in (-1, 0, 1):
            core = magpylib.magnet.Cylinder(
                polarization=(0, 0, 1e-9), dimension=(2 * INNER_M, -BOTTOM_M),
                position=(i * PITCH_M, j * PITCH_M, BOTTOM_M / 2),
            )
            bodies.append(mesh_Cylinder(core, count))
    plate = magpylib.magnet.Cuboid(
        polarization=(0, 0, 1e-9), dimension=(SIDE_M, SIDE_M, THICKNESS_M),
        position=(0, 0, BOTTOM_M - THICKNESS_M / 2),
    )
    across = round(SIDE_M / edge_m)
    bodies.append(mesh_Cuboid(plate, (across, across, layers)))
    return bodies


def main():
    start = time.process_time()
    coil, bodies = winding(), steel(1e-3 * float(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1)
    solved = apply_demag(magpylib.Collection(*bodies, *coil), susceptibility=CHI)
    places = np.array([(i * PITCH_M, j * PITCH_M, 0.03) for i in (-1, 0, 1) for j in (-1, 0, 1)])
    up = places + (0, 0, STEP_M)
    down = places - (0, 0, STEP_M)
    field = solved.getB(np.concatenate([up, down]))[:, 2]
    gradients = (field[:9] - field[9:]) / (2 * STEP_M)
    cells = [source for source in solved.sources_all if not isinstance(source, magpylib.current.Circle)]
    centres = np.array([cell.centroid for cell in cells])
    moments = np.array([cell.orientation.apply(cell.polarization) * cell.volume / MU_0 for cell in cells])
    own = magpylib.Collection(*winding()).getB(centres)
    print(json.dumps({
        "dbz_dz_t_per_m_per_a": gradients.tolist(),
        "inductance_h": AIR_H + float(np.sum(moments * own)),
        "cells": len(cells),
        "cpu_s": time.process_time() - start,
        "version": __version__,
        "magpylib": magpylib.__version__,
    }))


if __name__ == "__main__":
    main()
