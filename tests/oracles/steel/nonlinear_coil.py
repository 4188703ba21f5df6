#!/usr/bin/env python3
"""A cored coil along a B-H curve by axisymmetric finite elements; writes nonlinear_coil.json.

    pip install ngsolve==6.2.2608 scipy==1.17.1 && python3 tests/oracles/steel/nonlinear_coil.py

Unknown w = A_phi / r (B_r = -r dw/dz, B_z = 2 w + r dw/dr) in a half-disc whose rim carries the
dipole's condition dw/dn = -3 w / BALL_M; the mesh is refined in proportion towards the core's
edges. H(B) is scipy's PCHIP of designs/steel_1010.csv, evaluated at the integration points;
Newton's steps are halved until the residual falls. Solved with three discretisations: the values
are the finest one's, the errors the larger difference from the other two.
"""

import csv
import json
import math
import os
import pathlib

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import ngsolve
import numpy as np
from netgen.occ import Circle, Glue, MoveTo, OCCGeometry
from ngsolve import H1, BilinearForm, CoefficientFunction, GridFunction, InnerProduct, Integrate
from ngsolve import LinearForm, Mesh, ds, dx, grad, sqrt, x
from ngsolve.comp import IntegrationRuleSpace
from scipy.interpolate import PchipInterpolator

HERE = pathlib.Path(__file__).parent
MU_0 = 4e-7 * math.pi
INNER_M, OUTER_M, LENGTH_M, TURNS = 0.012, 0.019, 0.1, 1429
CORE_R_M, BOTTOM_M, TOP_M = 0.012, -0.11, 0.0
CURRENTS_A = (2.0, 4.0, 8.0)
HEIGHTS_MM = (10, 20, 30, 50, 80)
SKIN_M = 1e-3
BALL_M = 3.0
NEAR_M = 0.16
# The air in which the field is looked at.
VIEW_R_M, VIEW_TOP_M = 0.012, 0.09
EDGE_RATIO = 0.15
# Degree that the rule in the core integrates; rules of degree 16 and more crash ngsolve 6.2.2608.
RULE = 14
# Order, levels towards the edges, largest element in the core, m.
FINEST = (6, 12, 0.002)
COARSER = ((5, 12, 0.002), (6, 9, 0.003))
SETTLED = 1e-11


def material():
    rows = list(csv.DictReader(open(HERE.parents[2] / "designs" / "steel_1010.csv")))
    b = np.array([float(row["b_t"]) for row in rows])
    h = np.array([float(row["h_a_per_m"]) for row in rows])
    curve = PchipInterpolator(b, h)
    slope = curve.derivative()

    def response(b_t):
        """H and dH/dB; slope 1/mu_0 beyond the last point."""
        inside = np.minimum(b_t, b[-1])
        beyond = b_t > b[-1]
        field = curve(inside) + (b_t - inside) / MU_0
        return field, np.where(beyond, 1 / MU_0, slope(inside))

    return response


def rectangle(r0, r1, z0, z1, name):
    face = MoveTo(r0, z0).Rectangle(r1 - r0, z1 - z0).Face()
    face.faces.name = name
    return face


def half_disc(radius_m, z_m):
    disc = Circle((0, z_m), radius_m).Face()
    face = disc * MoveTo(0, z_m - 2 * radius_m).Rectangle(2 * radius_m, 4 * radius_m).Face()
    face.faces.name = "air"
    return face


def mesh_of(order, levels, core_size_m):
    middle = (BOTTOM_M + TOP_M) / 2
    steel = rectangle(0, CORE_R_M, BOTTOM_M, TOP_M, "core")
    steel.faces.maxh = core_size_m
    winding = rectangle(INNER_M, OUTER_M, -LENGTH_M, 0, "coil")
    near = half_disc(NEAR_M, middle)
    near.faces.maxh = 4 * core_size_m
    view = rectangle(0, VIEW_R_M, TOP_M, VIEW_TOP_M, "air")
    view.faces.maxh = core_size_m
    far = half_disc(BALL_M, middle) - near
    shape = Glue([steel, winding, view, near - steel - winding - view, far])
    for vertex in shape.vertices:
        r, z = vertex.p.x, vertex.p.y
        if abs(r - CORE_R_M) < 1e-9 and min(abs(z - BOTTOM_M), abs(z - TOP_M)) < 1e-9:
            vertex.hpref = 1
    for edge in shape.edges:
        r, z = edge.center.x, edge.center.y
        edge.name = "outer" if r > 1e-9 and math.hypot(r, z - middle) > 0.5 * BALL_M else "inner"
    mesh = Mesh(OCCGeometry(shape, dim=2).GenerateMesh(maxh=BALL_M / 3, grading=0.4))
    mesh.Curve(order)
    mesh.RefineHP(levels, EDGE_RATIO)
    return mesh


class Problem:
    """One discretisation; solves for growing currents, each from the state of the one before."""

    def __init__(self, order, levels, core_size_m):
        self.response = material()
        mesh = self.mesh = mesh_of(order, levels, core_size_m)
        space = self.space = H1(mesh, order=order)
        w, v = space.TnT()
        self.state = GridFunction(space)
        self.flux = self.b_of(self.state, grad(self.state))
        b_w, b_v = self.b_of(w, grad(w)), self.b_of(v, grad(v))

        core = mesh.Materials("core")
        points = IntegrationRuleSpace(mesh, order=RULE, definedon=core)
        steel = dx(definedon=core, intrules=points.GetIntegrationRules())
        self.values = [GridFunction(points) for _ in range(4)]
        self.b_r, self.b_z, self.nu, self.excess = self.values
        along_w = self.b_r * b_w[0] + self.b_z * b_w[1]
        along_v = self.b_r * b_v[0] + self.b_z * b_v[1]

        air = BilinearForm(space, symmetric=True)
        air += x / MU_0 * b_w * b_v * dx(definedon=mesh.Materials("air|coil"), bonus_intorder=4)
        air += x**3 * w * v / (MU_0 * BALL_M) * ds("outer")
        self.air = air.Assemble()
        self.tangent = BilinearForm(space, symmetric=True)
        self.tangent += x / MU_0 * b_w * b_v * dx(definedon=mesh.Materials("air|coil"), bonus_intorder=4)
        self.tangent += x**3 * w * v / (MU_0 * BALL_M) * ds("outer")
        self.tangent += x * (self.nu * b_w * b_v + self.excess * along_w * along_v) * steel
        self.steel = LinearForm(space)
        self.steel += x * self.nu * along_v * steel
        density = TURNS / ((OUTER_M - INNER_M) * LENGTH_M)
        self.source = LinearForm(density * x**2 * v * dx("coil")).Assemble()

    @staticmethod
    def b_of(u, slope):
        return CoefficientFunction((-x * slope[1], 2 * u + x * slope[0]))

    def residual(self, current_a):
        """F(w), the material's state at w being set on the way."""
        for part, target in zip((self.flux[0], self.flux[1]), (self.b_r, self.b_z)):
            target.Interpolate(part)
        b = np.hypot(self.b_r.vec.FV().NumPy(), self.b_z.vec.FV().NumPy())
        b = np.maximum(b, 1e-12)
        field, slope = self.response(b)
        self.nu.vec.FV().NumPy()[:] = field / b
        # (dH/dB - nu) b b' of the unit vector b, B itself being at hand.
        self.excess.vec.FV().NumPy()[:] = (slope - field / b) / b**2
        self.steel.Assemble()
        out = self.steel.vec.CreateVector()
        out.data = self.air.mat * self.state.vec + self.steel.vec - current_a * self.source.vec
        return out

    def solve(self, current_a):
        residual = self.residual(current_a)
        for step in range(60):
            self.tangent.Assemble()
            inverse = self.tangent.mat.Inverse(self.space.FreeDofs(), "sparsecholesky")
            change = residual.CreateVector()
            change.data = -(inverse * residual)
            size = math.sqrt(abs(InnerProduct(self.tangent.mat * change, change)))
            whole = math.sqrt(abs(current_a * InnerProduct(self.source.vec, self.state.vec)) + 1e-300)
            start = self.state.vec.CreateVector()
            start.data = self.state.vec
            slope = InnerProduct(residual, change)
            length = 1.0
            while True:
                self.state.vec.data = start + length * change
                residual = self.residual(current_a)
                # The energy is convex: its slope along the change, not the residual's norm.
                if abs(InnerProduct(residual, change)) <= 0.7 * abs(slope) or length < 1e-3:
                    break
                length *= 0.5
            if size <= SETTLED * whole or (size <= 1e-8 * whole and length < 1.0):
                return
        raise RuntimeError("Newton's iteration did not settle")

    def results(self, current_a):
        mesh, b = self.mesh, self.flux
        slope = grad(self.state)
        axis = [mesh(0, 1e-3 * z) for z in HEIGHTS_MM]
        strength = sqrt(b * b)
        volume = math.pi * CORE_R_M**2 * (TOP_M - BOTTOM_M)
        core = mesh.Materials("core")
        total = Integrate(2 * math.pi * x * strength * dx(definedon=core, bonus_intorder=12), mesh)
        rs = np.linspace(0, CORE_R_M - SKIN_M, 12)
        zs = np.linspace(BOTTOM_M + SKIN_M, TOP_M - SKIN_M, 217)
        inside = [strength(mesh(r, z)) for r in rs for z in zs]
        return {
            "dbz_dz_t_per_m": [2 * slope[1](p) for p in axis],
            "b_z_t": [b[1](p) for p in axis],
            "flux_linkage_wb": 2 * math.pi * InnerProduct(self.source.vec, self.state.vec),
            "core_mean_b_t": total / volume,
            "core_peak_b_t": max(inside),
        }


def run(order, levels, core_size_m):
    problem = Problem(order, levels, core_size_m)
    print(f"order {order}, {levels} levels, {core_size_m} m: {problem.space.ndof} unknowns", flush=True)
    found = []
    for current_a in CURRENTS_A:
        problem.solve(current_a)
        found.append(problem.results(current_a))
        print(found[-1], flush=True)
    return found


def relative(a, b):
    a, b = np.atleast_1d(a), np.atleast_1d(b)
    return float(np.max(np.abs(a / b - 1)))


def main():
    ngsolve.SetNumThreads(1)
    ngsolve.ngsglobals.msg_level = 0
    finest = run(*FINEST)
    others = [run(*resolution) for resolution in COARSER]
    cases = []
    for index, (current_a, values) in enumerate(zip(CURRENTS_A, finest)):
        error = {
            key: max(relative(value, other[index][key]) for other in others)
            for key, value in values.items()
        }
        cases.append({"current_a": current_a, **values, "relative_error": error})
    about = (
        "Winding 24/38 mm x 100 mm, 1429 turns, top face at z = 0; core 24 mm x 110 mm, top at "
        "z = 0; designs/steel_1010.csv. Total field on the axis at heights_mm; flux linkage of "
        "winding and core together; |B| in the core, the mean over its volume and the largest at "
        "least 1 mm inside, on a grid 1 mm x 0.5 mm. By nonlinear_coil.py, NGSolve "
        + ngsolve.__version__
    )
    text = json.dumps({"about": about, "heights_mm": HEIGHTS_MM, "cases": cases}, indent=1)
    (HERE / "nonlinear_coil.json").write_text(text + "\n")


if __name__ == "__main__":
    main()
