#!/usr/bin/env python3
"""One coil with its linear steel core, on a round plate if there is one, by axisymmetric finite elements of high order
(NGSolve).

    python3 scripts/peers/core_ngsolve.py DESIGN
    python3 scripts/peers/core_ngsolve.py --rows PROBLEM.json       # see rows.py

Solves for w = A_phi / r (smooth on the axis, where B_z = 2 w) in a half-disc of radius BALL_M
whose rim carries the dipole's condition dw/dn = -3 w / BALL_M; the mesh is refined in proportion
towards the steel's edges. One thread. Prints one JSON object: the gradient at the target, the
inductance, the unknowns, and the CPU seconds of meshing, solving and evaluating together.

With --rows the elements' order is swept; the error is the largest of the gradients' on the axis
and of the inductance's.

compare_core.py calls this; scripts/peers/requirements.txt lists what it needs.
"""

import json
import math
import os
import sys
import time
import tomllib

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import rows

LACKS = rows.lacks("NGSolve", "ngsolve", "netgen")
if not LACKS:
    import ngsolve
    from netgen.occ import Circle, Glue, MoveTo, OCCGeometry
    from ngsolve import H1, BilinearForm, CoefficientFunction, GridFunction, InnerProduct
    from ngsolve import LinearForm, Mesh, ds, dx, grad, x

ORDER = 8
SWEPT_ORDERS = (2, 3, 4, 5, 6, 7, 8)
EDGE_LEVELS = 16  # refinements towards the steel's edges, each by EDGE_RATIO
EDGE_RATIO = 0.15
BALL_M = 3.0
NEAR_M = 0.12  # within this distance of the core's middle elements are at most NEAR_SIZE_M wide
NEAR_SIZE_M = 0.015
MU_0 = 4e-7 * math.pi


def rectangle(r0, r1, z0, z1, name):
    face = MoveTo(r0, z0).Rectangle(r1 - r0, z1 - z0).Face()
    face.faces.name = name
    return face


def half_disc(radius_m, z_m):
    disc = Circle((0, z_m), radius_m).Face()
    face = disc * MoveTo(0, z_m - 2 * radius_m).Rectangle(2 * radius_m, 4 * radius_m).Face()
    face.faces.name = "air"
    return face


def mesh_of(coil, core, order, plate=None):
    """Regions core, plate, coil and air; the rim is called `outer`."""
    core_r, bottom, top = core
    middle = (bottom + top) / 2
    steel = [rectangle(0, core_r, bottom, top, "core")]
    edges = [(core_r, bottom), (core_r, top)]
    if plate:
        plate_r, plate_bottom, plate_top = plate
        steel.append(rectangle(0, plate_r, plate_bottom, plate_top, "plate"))
        edges += [(plate_r, plate_bottom), (plate_r, plate_top)]
    winding = rectangle(*coil, "coil")
    near = half_disc(NEAR_M, middle)
    near.faces.maxh = NEAR_SIZE_M
    far = half_disc(BALL_M, middle) - near
    air = near - winding
    for body in steel:
        air = air - body
    shape = Glue([*steel, winding, air, far])
    for vertex in shape.vertices:
        r, z = vertex.p.x, vertex.p.y
        if min(math.hypot(r - edge_r, z - edge_z) for edge_r, edge_z in edges) < 1e-9:
            vertex.hpref = 1
    for edge in shape.edges:
        r, z = edge.center.x, edge.center.y
        edge.name = "outer" if r > 1e-9 and math.hypot(r, z - middle) > 0.5 * BALL_M else "inner"
    mesh = Mesh(OCCGeometry(shape, dim=2).GenerateMesh(maxh=BALL_M / 3, grading=0.4))
    mesh.Curve(order)
    mesh.RefineHP(EDGE_LEVELS, EDGE_RATIO)
    return mesh


def solve(coil, core, turns, permeability, heights_m, order=ORDER, plate=None):
    """dB_z/dz per ampere on the axis at the heights, inductance, number of unknowns."""
    mesh = mesh_of(coil, core, order, plate)
    space = H1(mesh, order=order)
    w, v = space.TnT()

    def flux(u):
        """B turned by a right angle, over sqrt(r): grad(r^2 u) / r."""
        return CoefficientFunction((x * grad(u)[0] + 2 * u, x * grad(u)[1]))

    steel = dict.fromkeys(("core", "plate"), 1 / permeability)
    reluctivity = mesh.MaterialCF(steel, default=1.0) / MU_0
    form = BilinearForm(space, symmetric=True)
    form += reluctivity * x * flux(w) * flux(v) * dx(bonus_intorder=4)
    form += x**3 * w * v / (MU_0 * BALL_M) * ds("outer")
    form.Assemble()
    inner_m, outer_m, bottom_m, top_m = coil
    density = turns / ((outer_m - inner_m) * (top_m - bottom_m))
    source = LinearForm(density * x**2 * v * dx("coil")).Assemble()
    solution = GridFunction(space)
    inverse = form.mat.Inverse(space.FreeDofs(), "sparsecholesky")
    solution.vec.data = inverse * source.vec
    inductance_h = 2 * math.pi * InnerProduct(source.vec, solution.vec)
    slope = grad(solution)[1]
    return [2 * slope(mesh(0, height_m)) for height_m in heights_m], inductance_h, space.ndof


def swept(asked):
    """Rows over the elements' order."""
    winding, steel = asked["winding"], asked["core"]
    coil = (winding["inner_radius_m"], winding["outer_radius_m"], -winding["length_m"], 0)
    core = (steel["radius_m"], steel["bottom_m"], steel["top_m"])
    heights_m = [place["z_m"] for place in asked["on_axis"]]
    reported = []
    for order in SWEPT_ORDERS[: 4 if asked["quick"] else None]:
        def work(order=order):
            return solve(coil, core, winding["turns"], steel["relative_permeability"], heights_m, order)

        (gradients, inductance_h, _), spread = rows.timed(work)
        errors = [abs(inductance_h / asked["inductance_h"] - 1)]
        for found, place in zip(gradients, asked["on_axis"]):
            off = abs(found - place["dbz_dz_t_per_m_per_a"])
            errors.append(off / place["gradient_norm_t_per_m_per_a"])
        reported.append(rows.row(order, 1, max(errors), spread))
    return reported


def main():
    asked = rows.problem()
    if asked and LACKS:
        rows.answer([], [LACKS])
        return
    if asked:
        ngsolve.SetNumThreads(1)
        ngsolve.ngsglobals.msg_level = 0
        knob = "order of the elements"
        rows.answer([rows.curve(asked, "NGSolve", ngsolve.__version__, knob, swept(asked))])
        return
    with open(sys.argv[1], "rb") as file:
        design = tomllib.load(file)
    coil, core = design["coil"], design["core"]
    inner_m, outer_m = coil["inner_diameter_mm"] / 2000, coil["outer_diameter_mm"] / 2000
    length_m = coil["length_mm"] / 1000
    core_m = (
        inner_m - core["clearance_mm"] / 1000,
        -length_m - core["below_mm"] / 1000,
        core["above_mm"] / 1000,
    )
    plate_m = None
    if "plate" in design:
        plate = design["plate"]
        top_m = core_m[1] - plate.get("gap_mm", 0.0) / 1000
        plate_m = (plate["diameter_mm"] / 2000, top_m - plate["thickness_mm"] / 1000, top_m)
    ngsolve.SetNumThreads(1)
    ngsolve.ngsglobals.msg_level = 0
    start = time.process_time()
    [gradient], inductance_h, unknowns = solve(
        (inner_m, outer_m, -length_m, 0),
        core_m,
        coil["turns"],
        core["relative_permeability"],
        [design.get("target", {}).get("height_mm", 30.0) / 1000],
        plate=plate_m,
    )
    result = {
        "gradient_t_per_m_per_a": gradient,
        "inductance_h": inductance_h,
        "cpu_s": time.process_time() - start,
        "unknowns": unknowns,
        "ngsolve": ngsolve.__version__,
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
