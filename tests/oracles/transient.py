#!/usr/bin/env python3
"""Settling times of a voltage step with eddy currents; writes transient.json beside this file.

The Laplace transforms of current and force are inverted numerically (mpmath, Talbot's contour, 30
digits) and their times to 95 % found by a secant: no poles, no residues.

    pip install mpmath==1.3.0 && python3 tests/oracles/transient.py
"""

import json
import pathlib

from mpmath import besseli, findroot, invertlaplace, log, mp, mpf, pi, sqrt

mp.dps = 30
SEED = dict(resistance_ohm=6.0753, air_inductance_h=0.0145019, inductance_h=0.184092,
            relative_permeability=1000.0, conductivity_s_per_m=5.8e6, core_radius_m=0.012,
            core_energy_share=0.6, air_share=0.128)
CASES = [
    {},
    dict(core_radius_m=0.031, resistance_ohm=21.0),
    dict(relative_permeability=130.0, inductance_h=0.07, core_energy_share=0.37, air_share=0.3),
    dict(relative_permeability=7.0, inductance_h=0.087, core_energy_share=0.9, conductivity_s_per_m=4.1e7),
    dict(conductivity_s_per_m=70.0),
    dict(conductivity_s_per_m=5.8e9, resistance_ohm=130.0),
    dict(relative_permeability=1.3, inductance_h=0.017, air_share=0.9, conductivity_s_per_m=5.8e7),
]


def times(case):
    v = {key: mpf(value) for key, value in case.items()}
    chi = v["relative_permeability"] - 1
    air, core = v["air_inductance_h"], v["inductance_h"] - v["air_inductance_h"]
    beta = min(max(chi * v["core_energy_share"] * air / core - 1, mpf(0)), chi)
    diffusion = 4 * pi * mpf("1e-7") * v["relative_permeability"] * v["conductivity_s_per_m"] * v["core_radius_m"] ** 2

    def follows(s):
        q = sqrt(s * diffusion)
        g = 2 * besseli(1, q) / (q * besseli(0, q))
        return (1 + beta) * g / (1 + beta * g)

    def current(s):
        return v["resistance_ohm"] / s / (v["resistance_ohm"] + s * (air + core * follows(s)))

    def force(s):
        return current(s) * (v["air_share"] + (1 - v["air_share"]) * follows(s))

    start = log(20) * v["inductance_h"] / v["resistance_ohm"]
    found = []
    for image in (current, force):
        rest = lambda t: invertlaplace(image, t, method="talbot", degree=40) - mpf("0.95")
        high = start
        while rest(high) < 0:
            high *= mpf("1.3")
        found.append(float(findroot(rest, (start / 30, high), solver="anderson", tol=1e-26)))
    return found


def main():
    out = []
    for change in CASES:
        case = {**SEED, **change}
        current, force = times(case)
        out.append({**case, "current_95_s": current, "force_95_s": force})
        print(out[-1])
    (pathlib.Path(__file__).parent / "transient.json").write_text(json.dumps(out, indent=1) + "\n")


main()
