"""The independent model against numbers known from elsewhere, and its derivatives."""

import json

import numpy as np

from . import air, solve
from .problem import Problem

ORACLES = solve.ROOT / "tests" / "oracles"
# The seed's coil with its core, by two finite-element formulations and a boundary-integral one.
CORED_GRADIENT, CORED_INDUCTANCE = 0.428229, 0.184092


def relative(got, wanted):
    return abs(float(got) / float(wanted) - 1)


def checks():
    """(what, error, bound)."""
    data = json.loads((ORACLES / "air_coil.json").read_text())
    for entry in data["inductances"]:
        coil = data["windings"][entry["winding"]]
        a1, a2, length, turns = (float(coil[k]) for k in ("inner_radius_m", "outer_radius_m", "length_m", "turns"))
        got = turns**2 * air.inductance(a1, a2, length)
        # Without a bore the integrand is less smooth.
        bound = 2e-8 if a1 == 0 else 1e-12
        yield f"inductance, {entry['winding']}", relative(got, entry["inductance_h"]), bound
        more = turns**2 * air.inductance(a1, a2, length, air.NODES + 8)
        yield f"inductance, {entry['winding']}, more nodes", relative(got, more), bound
    for point in data["points"]:
        if point["r_m"] == "0" and float(point["z_m"]) > 0:
            coil = data["windings"][point["winding"]]
            a1, a2, length, turns = (float(coil[k]) for k in ("inner_radius_m", "outer_radius_m", "length_m", "turns"))
            got = turns * air.gradient(a1, a2, length, float(point["z_m"]))
            yield f"gradient, {point['winding']}", relative(got, point["dbz_dz"]), 1e-14
            closed = turns * air.gradient_closed(a1, a2, length, float(point["z_m"]))
            yield f"gradient, {point['winding']}, closed form", relative(closed, got), 1e-11
    seed = Problem.read(ORACLES / "nlopt" / "designs" / "seed_cored.toml")
    scale = 1429 / (10 * 1000 / 7)
    value = seed.values(0.024, 0.007, 0.1)
    yield "seed's turns", relative(value["turns"] * scale, 1429), 1e-14
    yield "seed's resistance", relative(value["resistance_ohm"] * scale, 6.0753), 1e-5
    gradient = -value["gradient_t_per_m_per_a"] * scale
    yield "seed's gradient with its core", relative(gradient, CORED_GRADIENT), 2e-6
    inductance = value["inductance_h"] * scale**2
    yield "seed's inductance with its core", relative(inductance, CORED_INDUCTANCE), 4e-6
    yield from derivative_checks()


def derivative_checks():
    """Complex steps against central differences of fourth order."""
    for name in ("air_all_limits", "seed_cored", "air_voltage"):
        problem = Problem.read(ORACLES / "nlopt" / "designs" / f"{name}.toml")
        u = np.log([0.0213, 0.0047, 0.0731])
        for regime in problem.regimes():
            slopes = problem.derivatives(u, regime)
            step = 1e-3
            for k, axis in enumerate(np.eye(3)):
                at = {j: problem.functions(u + j * step * axis, regime) for j in (-2, -1, 1, 2)}
                central = (8 * (at[1] - at[-1]) - (at[2] - at[-2])) / (12 * step)
                error = float(np.max(np.abs(central - slopes[:, k])))
                yield f"derivatives, {name}, {regime}, {k}", error, 1e-9


def run():
    faults = []
    for what, error, bound in checks():
        print(f"{what:44} {error:.1e}")
        if not error <= bound:
            faults.append(f"{what}: error {error:.2e} > {bound:.0e}")
    return faults
