#!/usr/bin/env python3
"""The seed's nine coils with cores on a plate of steel by 3-D finite elements; writes plate.json beside this file.

Total scalar potential by H = T - grad w, div(mu H) = 0 with continuous elements (NGSolve). T is the driven coil's
potential of current, along z: the density of its turns times (outer radius - r) in the winding, constant in the bore. As the core
fills the bore, w in steel is the total potential plus a function that is linear between two planes of the mesh, so
nothing cancels at any permeability, and no field of a coil in air is needed. A quarter of the space with three kinds of
symmetry (even-even, odd-even, odd-odd) makes up one driven coil. The air ends on a sphere with the decay of the lowest
multipole of the kind. Elements are cut towards all edges of steel, LEVELS times by EDGE_RATIO.

Gradients follow from the steel's magnetisation (dipoles at the elements' integration points) and the winding's loops,
inductances from the flux density times T: integrals over the solution, whose error is about the square of its own.
One such coil on a round plate of ROUND_M is solved by the axisymmetric elements of scripts/peers/core_ngsolve.py.
Force constants are lambda_jnd of 61 x 61 points of the shapes' formulas, by bounded least squares and bisection.

    pip install ngsolve==6.2.2608 numpy==2.4.6 scipy==1.17.1
    python3 tests/oracles/steel/plate.py                 # five meshes, force constants, plate.json: four CPU minutes
    python3 tests/oracles/steel/plate.py ORDER LEVELS    # one mesh: gradients, inductances, unknowns, CPU s as JSON
"""

import itertools
import json
import math
import os
import pathlib
import sys
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[2] / "scripts" / "peers"))

import core_ngsolve
import ngsolve
import numpy as np
from netgen.occ import Box, Cylinder, Glue, OCCGeometry, Pnt, Sphere, Z
from ngsolve import H1, BilinearForm, CoefficientFunction, GridFunction, LinearForm, Mesh
from ngsolve import Preconditioner, ds, dx, grad, sqrt, x, y, z
from ngsolve.comp import IntegrationRuleSpace
from ngsolve.krylovspace import CGSolver
from numpy.polynomial import chebyshev
from scipy.optimize import brentq, lsq_linear
from scipy.special import ellipe, ellipkm1

MU_0 = 4e-7 * math.pi
INNER_M, OUTER_M, LENGTH_M, TURNS = 0.012, 0.019, 0.1, 1429.0
BOTTOM_M, PITCH_M, MU_R = -0.11, 0.05, 1000.0
HALF_M, THICKNESS_M = 0.075, 0.005  # the plate's
ROUND_M = 0.03  # radius of the round plate below one coil
MIDDLE_M = -0.06  # z of the ball's middle
T_0 = TURNS / LENGTH_M  # in the bore, A/m per ampere
MOMENT_A_M2 = 1.1579e6 * math.pi * 0.005**2 * 0.01
CURRENT_MAX_A, JND = 2.0, 0.07
EDGE_RATIO = 0.2
# Coils of the quarter, in pitches.
COILS = {"centre": (0, 0), "side": (1, 0), "side_y": (0, 1), "corner": (1, 1)}
DRIVEN = ("centre", "side", "corner")
# Parities under x -> -x and y -> -y, and the coils that are driven with them.
KINDS = {(1, 1): DRIVEN, (-1, 1): ("side", "corner"), (-1, -1): ("corner",)}
# Order of the elements, levels, largest size near steel, radius of the ball. The first is the result, the second is what
# each of the others changes one thing of, and what the force constants are computed with.
BEST, PLAIN = (4, 2, 0.02, 0.8), (3, 2, 0.02, 0.8)
MESHES = {"best": BEST, "plain": PLAIN, "lower_order": (2, 2, 0.02, 0.8), "level": (3, 3, 0.02, 0.8), "ball": (3, 2, 0.02, 1.6)}


def singular(edge):
    """Whether an edge of the geometry is one of steel: a core's rim, its foot on the plate, an edge of the plate."""
    start, end, c = edge.start, edge.end, edge.center
    if abs(start.z - end.z) < 1e-9 and min(abs(start.z), abs(start.z - BOTTOM_M)) < 1e-9:
        for i, j in COILS.values():
            from_axis_m = [math.hypot(p.x - i * PITCH_M, p.y - j * PITCH_M) for p in (start, end, c)]
            closed = math.hypot(start.x - end.x, start.y - end.y) < 1e-9
            if max(abs(r - INNER_M) for r in from_axis_m[:2]) < 1e-9 and (closed or from_axis_m[2] > 1e-3):
                return True
    levels_m = (BOTTOM_M, BOTTOM_M - THICKNESS_M)
    if any(min(abs(p.z - at) for at in levels_m) > 1e-9 for p in (start, end)):
        return False
    return any(max(abs(a - HALF_M), abs(b - HALF_M)) < 1e-9 for a, b in ((start.x, end.x), (start.y, end.y)))


def geometry(size_m, ball_m):
    """Regions plate, foot_, bore_ and winding_ of each coil, air and far; boundaries x0, y0 and outer."""
    solids = []
    for name, (i, j) in COILS.items():
        at = (i * PITCH_M, j * PITCH_M)
        foot = Cylinder(Pnt(*at, BOTTOM_M), Z, r=INNER_M, h=-LENGTH_M - BOTTOM_M)
        bore = Cylinder(Pnt(*at, -LENGTH_M), Z, r=INNER_M, h=LENGTH_M)
        winding = Cylinder(Pnt(*at, -LENGTH_M), Z, r=OUTER_M, h=LENGTH_M) - bore
        for solid, what in ((foot, "foot"), (bore, "bore"), (winding, "winding")):
            solid.mat(f"{what}_{name}")
            solids.append(solid)
    plate = Box(Pnt(-HALF_M, -HALF_M, BOTTOM_M - THICKNESS_M), Pnt(HALF_M, HALF_M, BOTTOM_M))
    plate.mat("plate")
    solids.append(plate)
    air = box = Box(Pnt(-0.09, -0.09, -0.13), Pnt(0.09, 0.09, 0.03))
    far = Sphere(Pnt(0, 0, MIDDLE_M), ball_m) - box
    for solid in solids:
        air = air - solid
    air.mat("air")
    far.mat("far")
    for solid in (*solids, air):
        solid.solids.maxh = size_m
    quarter = Box(Pnt(0, 0, -3), Pnt(3, 3, 3))
    shape = Glue([solid * quarter for solid in (*solids, air, far)])
    # The sphere's pole has an edge without ends, which may not be asked for them.
    for edge in (edge for solid in shape.solids if solid.name != "far" for edge in solid.edges):
        if singular(edge):
            edge.hpref = 1
    for face in shape.faces:
        c = face.center
        outer = math.dist((c.x, c.y, c.z), (0, 0, MIDDLE_M)) > 0.4 * ball_m
        face.name = "x0" if abs(c.x) < 1e-9 else "y0" if abs(c.y) < 1e-9 else "outer" if outer else "inner"
    return OCCGeometry(shape)


class Solution:
    """One mesh, solved: moments of the steel's dipoles by kind and coil, flux through the quarter's coils."""

    def __init__(self, order, levels, size_m, ball_m, with_plate=True):
        ngsolve.SetNumThreads(1)
        ngsolve.ngsglobals.msg_level = 0
        mesh = Mesh(geometry(size_m, ball_m).GenerateMesh(maxh=ball_m / 3, grading=0.4))
        mesh.RefineHP(levels, EDGE_RATIO)
        mesh.Curve(order)
        names = [m for m in set(mesh.GetMaterials()) if m.startswith(("foot", "bore")) or (with_plate and m == "plate")]
        self.order, self.mesh = order, mesh
        self.mu = MU_0 * mesh.MaterialCF(dict.fromkeys(names, MU_R), default=1.0)
        self.steel = mesh.Materials("|".join(names))
        self.dipoles = IntegrationRuleSpace(mesh, order=2 * order - 2, definedon=self.steel)
        at = GridFunction(self.dipoles)
        self.places_m = []
        for axis in (x, y, z):
            at.Interpolate(axis, definedon=self.steel)
            self.places_m.append(at.vec.FV().NumPy().copy())
        self.moments, self.flux_wb = {}, {}
        for kind, driven in KINDS.items():
            self.solve(kind, driven, ball_m)

    def current_potential(self, name):
        """T of a coil that carries 1 A."""
        i, j = COILS[name]
        r = sqrt((x - i * PITCH_M) ** 2 + (y - j * PITCH_M) ** 2)
        falls = T_0 * (OUTER_M - r) / (OUTER_M - INNER_M)
        return self.mesh.MaterialCF({f"bore_{name}": T_0, f"winding_{name}": falls}, default=0)

    def solve(self, kind, driven, ball_m):
        odd = [side for side, parity in zip(("x0", "y0"), kind) if parity < 0]
        space = H1(self.mesh, order=self.order, dirichlet="|".join(odd))
        w, v = space.TnT()
        form = BilinearForm(space, symmetric=True, condense=True)
        form += self.mu * grad(w) * grad(v) * dx
        form += MU_0 * max(2, 1 + len(odd)) / ball_m * w * v * ds("outer")
        inverse = Preconditioner(form, "bddc")
        form.Assemble()
        self.unknowns = space.ndof
        solver = CGSolver(form.mat, inverse.mat, tol=1e-8, maxiter=400)
        for name in driven:
            own = self.current_potential(name)
            carries = dx(f"bore_{name}|winding_{name}", bonus_intorder=2)
            source = LinearForm(self.mu * own * grad(v)[2] * carries).Assemble().vec
            source.data += form.harmonic_extension_trans * source
            solution = GridFunction(space)
            solution.vec.data = solver * source
            solution.vec.data += form.harmonic_extension * solution.vec
            solution.vec.data += form.inner_solve * source
            self.measure(kind, name, CoefficientFunction((0, 0, own)) - grad(solution))

    def measure(self, kind, name, h):
        for other in COILS:
            region = self.mesh.Materials(f"bore_{other}|winding_{other}")
            linked = self.mu * self.current_potential(other) * h[2]
            order = 2 * self.order + 2
            self.flux_wb[kind, name, other] = ngsolve.Integrate(linked, self.mesh, definedon=region, order=order)
        v = self.dipoles.TestFunction()
        rules = dx(definedon=self.steel, intrules=self.dipoles.GetIntegrationRules())
        parts = [LinearForm((MU_R - 1) * h[k] * v * rules).Assemble() for k in range(3)]
        self.moments[kind, name] = [part.vec.FV().NumPy().copy() for part in parts]

    def inductances_h(self):
        """Of the three coils, and between the centre and the others."""
        f = self.flux_wb
        return {
            "centre": 4 * f[(1, 1), "centre", "centre"],
            "side": f[(1, 1), "side", "side"] + f[(-1, 1), "side", "side"],
            "corner": sum(
                count * f[kind, "corner", "corner"] for kind, count in (((1, 1), 1), ((-1, 1), 2), ((-1, -1), 1))
            )
            / 4,
            "centre_side": 2 * f[(1, 1), "centre", "side"],
            "centre_corner": f[(1, 1), "centre", "corner"],
        }

    def steel_gradients(self, points):
        """dB_z/dz of the steel at points of x, y >= 0, by kind and coil."""
        keys = list(self.moments)
        moments = [np.stack([self.moments[key][k] for key in keys], axis=1) for k in range(3)]
        out = np.zeros((len(points), len(keys)))
        chunk, block = 64, 4096
        for start in range(0, len(points), chunk):
            some = points[start : start + chunk]
            for signs in itertools.product((1, -1), repeat=2):
                parity = np.array([kind[0] ** (signs[0] < 0) * kind[1] ** (signs[1] < 0) for kind, _ in keys])
                for first in range(0, len(self.places_m[0]), block):
                    these = slice(first, first + block)
                    dx_m = signs[0] * some[:, :1] - self.places_m[0][these]
                    dy_m = signs[1] * some[:, 1:2] - self.places_m[1][these]
                    dz_m = some[:, 2:] - self.places_m[2][these]
                    inverse = 1 / (dx_m**2 + dy_m**2 + dz_m**2)
                    fifth = inverse**2 * np.sqrt(inverse)
                    common = (15 * dz_m**2 * inverse - 3) * fifth
                    part = (common * dx_m) @ moments[0][these] + (common * dy_m) @ moments[1][these]
                    part += (dz_m * (common - 6 * fifth)) @ moments[2][these]
                    out[start : start + chunk] += parity * part
        return {key: -MU_0 / (4 * math.pi) * out[:, k] for k, key in enumerate(keys)}

    def driven(self, by_kind):
        """dB_z/dz of the steel at any points for each of DRIVEN, from a function that gives a kind's in the quarter."""

        def of(kind, name, points):
            signs = np.where(points[:, 0] < 0, kind[0], 1) * np.where(points[:, 1] < 0, kind[1], 1)
            return signs * by_kind(np.abs(points) if points.size else points, kind, name)

        def gradients(points):
            swapped = points[:, [1, 0, 2]]
            corner = sum(of(kind, "corner", points) for kind in KINDS) + of((-1, 1), "corner", swapped)
            side = of((1, 1), "side", points) + of((-1, 1), "side", points)
            return {"centre": of((1, 1), "centre", points), "side": side / 2, "corner": corner / 4}

        return gradients

    def at(self, points):
        """dB_z/dz of steel and winding at points, for each of DRIVEN."""
        every = np.abs(np.concatenate([points, points[:, [1, 0, 2]]]))
        unique, where = np.unique(np.round(every, 12), axis=0, return_inverse=True)
        values = self.steel_gradients(unique)
        index = {tuple(np.round(point, 12)): k for point, k in zip(every, where.ravel())}

        def by_kind(at, kind, name):
            return values[kind, name][[index[tuple(np.round(point, 12))] for point in at]]

        steel = self.driven(by_kind)(points)
        return {name: steel[name] + winding_gradient(points, COILS[name]) for name in DRIVEN}

    def over_workspace(self):
        """The same as a function of points of |x|, |y| <= 50 mm, 30 to 80 mm high, interpolated at 24 x 24 x 8 nodes."""
        count, levels = 24, 8
        plan, height = chebyshev.chebpts1(count), chebyshev.chebpts1(levels)
        nodes = np.array([
            (0.05 * a, 0.05 * b, 0.055 + 0.025 * c)
            for a in plan[count // 2 :] for b in plan[count // 2 :] for c in height
        ])
        values = self.steel_gradients(nodes)

        def fit(at, count):
            return np.linalg.inv(chebyshev.chebvander(at, count - 1))

        to_plan, to_height = fit(plan, count), fit(height, levels)
        coefficients = {}
        for (kind, name), quarter in values.items():
            quarter = quarter.reshape(count // 2, count // 2, levels)
            whole = np.concatenate([kind[0] * quarter[::-1], quarter], axis=0)
            whole = np.concatenate([kind[1] * whole[:, ::-1], whole], axis=1)
            coefficients[kind, name] = np.einsum("ai,bj,ck,ijk->abc", to_plan, to_plan, to_height, whole)

        def by_kind(points, kind, name):
            scaled = points[:, 0] / 0.05, points[:, 1] / 0.05, (points[:, 2] - 0.055) / 0.025
            return chebyshev.chebval3d(*scaled, coefficients[kind, name])

        steel = self.driven(by_kind)
        return lambda points: {n: s + winding_gradient(points, COILS[n]) for n, s in steel(points).items()}


def winding_gradient(points, coil):
    """dB_z/dz of a winding per ampere: B_z of the loops of its lower end face less those of its upper one."""
    r = np.hypot(points[:, 0] - coil[0] * PITCH_M, points[:, 1] - coil[1] * PITCH_M)[:, None]
    node, weight = np.polynomial.legendre.leggauss(24)
    a = 0.5 * (INNER_M + OUTER_M) + 0.5 * (OUTER_M - INNER_M) * node

    def faces(u):
        s2, d2 = (a + r) ** 2 + u**2, (a - r) ** 2 + u**2
        k, e = ellipkm1(d2 / s2), ellipe(1 - d2 / s2)
        return (k + (a**2 - r**2 - u**2) / d2 * e) / np.sqrt(s2)

    height = points[:, 2][:, None]
    return MU_0 * TURNS / LENGTH_M / (4 * math.pi) * ((faces(height + LENGTH_M) - faces(height)) @ weight)


def shapes():
    """Constraint points of the four shapes."""
    plan = np.linspace(-0.05, 0.05, 61)
    px, py = (a.ravel() for a in np.meshgrid(plan, plan, indexing="ij"))
    r = np.round(np.hypot(px, py), 12)  # the rim's points count
    heights = {
        "flat": np.full_like(px, 0.05),
        "half_sphere": np.where(r <= 0.05, 0.03 + np.sqrt(np.maximum(0.05**2 - r**2, 0)), np.nan),
        "half_cylinder": 0.03 + np.sqrt(np.maximum(0.05**2 - px**2, 0)),
        "wedge": 0.03 + 0.5 * (px + 0.05),
    }
    for name, h in heights.items():
        on = ~np.isnan(h)
        yield name, np.stack([px[on], py[on], h[on]], axis=1)


def force_constant(gradients, points):
    """lambda_jnd of nine coils that push with 0 to CURRENT_MAX_A."""
    turned = points[:, [1, 0, 2]]
    columns = [gradients(points)["centre"]]
    columns += [gradients(p * (s, 1, 1))["side"] for p in (points, turned) for s in (1, -1)]
    columns += [gradients(points * (s, t, 1))["corner"] for s in (1, -1) for t in (1, -1)]
    height = points[:, 2]
    force = -MOMENT_A_M2 * np.stack(columns, axis=1)
    triangle = np.linalg.qr(np.column_stack([force, height]), mode="r")
    g, h = triangle[:, :-1], triangle[:, -1]

    def missed(constant, most):
        found = lsq_linear(g, constant * h, bounds=(0, most), method="bvls", tol=1e-14)
        return 2 * found.cost / (constant**2 * (h @ h))

    floor = missed(1.0, np.inf)
    return brentq(lambda c: missed(c, CURRENT_MAX_A) - floor - JND**2, 0.05, 50.0, xtol=1e-10)


def above_coils(height_m):
    return np.array([(i * PITCH_M, j * PITCH_M, height_m) for i in (-1, 0, 1) for j in (-1, 0, 1)])


def summary(mesh):
    start = time.process_time()
    solution = Solution(*mesh)
    gradients = solution.at(above_coils(0.03))
    return {
        "order": mesh[0], "levels": mesh[1], "size_m": mesh[2], "ball_m": mesh[3], "unknowns": solution.unknowns,
        "inductance_h": solution.inductances_h(),
        "dbz_dz_above_coils_t_per_m_per_a": {name: list(values) for name, values in gradients.items()},
        "cpu_s": round(time.process_time() - start, 1), "ngsolve": ngsolve.__version__,
    }


def difference(a, b):
    """The largest one of gradients, relative to the driven coil's own, and of self inductances."""
    key, own = "dbz_dz_above_coils_t_per_m_per_a", {"centre": 4, "side": 7, "corner": 8}
    gradient = max(
        abs(p - q) / abs(b[key][name][own[name]]) for name in DRIVEN for p, q in zip(a[key][name], b[key][name])
    )
    inductance = max(abs(a["inductance_h"][name] / b["inductance_h"][name] - 1) for name in DRIVEN)
    return gradient, inductance


def constants():
    """lambda_jnd of the shapes with and without the plate."""
    with_plate, without = (Solution(*PLAIN, plate).over_workspace() for plate in (True, False))
    out = {}
    for name, points in shapes():
        joined, bare = force_constant(with_plate, points), force_constant(without, points)
        out[name] = {"with_plate_n_per_m": joined, "without_n_per_m": bare, "ratio": joined / bare}
    return out


def round_plate():
    """One coil on a round plate: dB_z/dz on its axis at two heights, inductance; the error is the change from order 8."""
    coil, core = (INNER_M, OUTER_M, -LENGTH_M, 0.0), (INNER_M, BOTTOM_M, 0.0)
    plate, heights_m = (ROUND_M, BOTTOM_M - THICKNESS_M, BOTTOM_M), [0.03, 0.05]
    rough, fine = (core_ngsolve.solve(coil, core, TURNS, MU_R, heights_m, order, plate)[:2] for order in (8, 10))
    changes = [abs(a / b - 1) for a, b in zip([*rough[0], rough[1]], [*fine[0], fine[1]])]
    return {
        "radius_m": ROUND_M, "thickness_m": THICKNESS_M, "z_m": heights_m, "dbz_dz_t_per_m_per_a": fine[0],
        "inductance_h": fine[1], "error": float(f"{max(changes):.1e}"),
    }


def main():
    if len(sys.argv) > 1:
        order, levels = (int(word) for word in sys.argv[1:3])
        print(json.dumps(summary((order, levels, 0.02, 0.8))))
        return
    path = HERE / "plate.json"
    # What another run has written is continued.
    state = json.loads(path.read_text()) if path.exists() else {"script": "tests/oracles/steel/plate.py", "meshes": {}}
    work = {("meshes", name): lambda mesh=mesh: summary(mesh) for name, mesh in MESHES.items()}
    work |= {("round_plate",): round_plate, ("lambda_jnd",): constants}
    for keys, compute in work.items():
        at = state
        for key in keys[:-1]:
            at = at[key]
        if keys[-1] not in at:
            at[keys[-1]] = compute()
            path.write_text(json.dumps(state, indent=1) + "\n")
    pairs = {"order": ("plain", "best"), "levels": ("level", "plain"), "ball": ("ball", "plain")}
    state["changes"] = {
        what: dict(zip(("gradient_of_own", "inductance"), difference(*(state["meshes"][name] for name in names))))
        for what, names in pairs.items()
    }
    path.write_text(json.dumps(state, indent=1) + "\n")


if __name__ == "__main__":
    main()
