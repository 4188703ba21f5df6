#!/usr/bin/env python3
"""Makes tests/oracles/nlopt/core_table.json: what a core does to a coil, by finite elements.

    python3 scripts/nlopt_reference/core_table.py [--cache FILE]      # about ten minutes

The cored coil of the problems: core as wide as the bore, flush on top, 10 mm below the winding,
mu_r = 1000, alone, target 30 mm above. NGSolve solves for w = A_phi / r (order ORDER, mesh graded
to the core's edges) at the nodes of a tensor Chebyshev grid in the logarithms of inner diameter,
radial build and length. The table holds the ratios cored / air of the gradient at the target and
of the inductance, which are smooth; `core.py` interpolates them. Its error is the largest
relative difference at HELD_OUT random points of the box solved with order FINE_ORDER on the same
rule's mesh with deeper grading, so that mesh and interpolation are both in it.

--cache keeps every solve in a file of JSON lines, so that an interrupted run can go on.
"""

import argparse
import itertools
import json
import math
import os
import pathlib
import sys

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE.parent / "peers")]

import core_ngsolve
import netgen.occ
import ngsolve
import numpy as np

from nlopt_reference import air, core

BOX_M = ((0.004, 0.040), (0.0014, 0.014), (0.020, 0.160))  # ID, (OD - ID)/2, length
NODES = (12, 11, 12)
HELD_OUT = 60
SEED = 20260801
ORDER, LEVELS = 8, 10
FINE_ORDER, FINE_LEVELS = 10, 14
SIZE, GRADING, NEAR_SIZE_M, NEAR_M = 0.7, 0.3, 0.015, 0.06


def graded_mesh(order, levels):
    """A mesh maker in place of core_ngsolve's, for cores far thinner than the seed's."""

    def mesh_of(coil, steel):
        core_r, bottom, top = steel
        middle = (bottom + top) / 2
        inside = core_ngsolve.rectangle(0, core_r, bottom, top, "core")
        winding = core_ngsolve.rectangle(*coil, "coil")
        near = core_ngsolve.half_disc((top - bottom) / 2 + NEAR_M, middle)
        inside.faces.maxh = SIZE * min(core_r, NEAR_SIZE_M)
        winding.faces.maxh = SIZE * min(3 * core_r, NEAR_SIZE_M)
        near.faces.maxh = SIZE * NEAR_SIZE_M
        far = core_ngsolve.half_disc(core_ngsolve.BALL_M, middle) - near
        shape = netgen.occ.Glue([inside, winding, near - inside - winding, far])
        for vertex in shape.vertices:
            r, z = vertex.p.x, vertex.p.y
            if abs(r - core_r) < 1e-9 and min(abs(z - bottom), abs(z - top)) < 1e-9:
                vertex.hpref = 1
        for edge in shape.edges:
            r, z = edge.center.x, edge.center.y
            rim = r > 1e-9 and math.hypot(r, z - middle) > 0.5 * core_ngsolve.BALL_M
            edge.name = "outer" if rim else "inner"
        geometry = netgen.occ.OCCGeometry(shape, dim=2)
        mesh = ngsolve.Mesh(geometry.GenerateMesh(maxh=core_ngsolve.BALL_M / 3, grading=GRADING))
        mesh.Curve(order)
        mesh.RefineHP(levels, core_ngsolve.EDGE_RATIO)
        return mesh

    return mesh_of


def solve(point_m, order, levels):
    """Gradient at the target and inductance for one turn; point: ID, build, length."""
    inner, build, length = point_m
    core_ngsolve.ORDER = order
    core_ngsolve.mesh_of = graded_mesh(order, levels)
    gradient, inductance, _ = core_ngsolve.solve(
        (inner / 2, inner / 2 + build, -length, 0.0),
        (inner / 2, -length - core.BELOW_M, 0.0),
        1.0,
        core.RELATIVE_PERMEABILITY,
        core.HEIGHT_M,
    )
    return gradient, inductance


def ratios(point_m, order, levels, cache):
    key = json.dumps([*point_m, order, levels])
    if key not in cache.known:
        cache.add(key, solve(point_m, order, levels))
    gradient, inductance = cache.known[key]
    inner, build, length = point_m
    air_gradient = air.gradient(inner / 2, inner / 2 + build, length, core.HEIGHT_M)
    air_inductance = air.inductance(inner / 2, inner / 2 + build, length)
    return gradient / air_gradient, inductance / air_inductance


class Cache:
    def __init__(self, path):
        self.path, self.known = path, {}
        if path and os.path.exists(path):
            self.known = dict(json.loads(line) for line in open(path))

    def add(self, key, value):
        self.known[key] = value
        if self.path:
            with open(self.path, "a") as file:
                file.write(json.dumps([key, value]) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cache")
    cache = Cache(parser.parse_args().cache)
    ngsolve.SetNumThreads(1)
    ngsolve.ngsglobals.msg_level = 0
    axes = [core.chebyshev_axis(*box, n) for box, n in zip(BOX_M, NODES)]
    values = np.empty((*NODES, 2))
    for index in itertools.product(*map(range, NODES)):
        point = [float(axis[i]) for axis, i in zip(axes, index)]
        values[index] = ratios(point, ORDER, LEVELS, cache)
        if index[1:] == (0, 0):
            print(index[0], "of", NODES[0], flush=True)
    table = {
        "about": "Cored over air coil, see scripts/nlopt_reference/core_table.py",
        "ngsolve": ngsolve.__version__,
        "box_m": BOX_M,
        "nodes": NODES,
        "height_m": core.HEIGHT_M,
        "below_m": core.BELOW_M,
        "relative_permeability": core.RELATIVE_PERMEABILITY,
        "order": [ORDER, FINE_ORDER],
        "held_out": HELD_OUT,
        "gradient_ratio": values[..., 0].ravel().tolist(),
        "inductance_ratio": values[..., 1].ravel().tolist(),
    }
    box = core.CoreTable(table)
    lo, hi = np.log(np.array(BOX_M)).T
    points = np.exp(lo + (hi - lo) * np.random.default_rng(SEED).random((HELD_OUT, 3)))
    errors = []
    for point in points.tolist():
        exact = ratios(point, FINE_ORDER, FINE_LEVELS, cache)
        errors.append([abs(box(*point)[k].real / exact[k] - 1) for k in (0, 1)])
    errors = np.array(errors)
    table["gradient_error"], table["inductance_error"] = np.max(errors, axis=0).tolist()
    print("largest error at held-out points:", *np.max(errors, axis=0), "median", *np.median(errors, axis=0))
    core.TABLE.write_text(json.dumps(table) + "\n")


if __name__ == "__main__":
    main()
