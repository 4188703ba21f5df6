#!/usr/bin/env python3
"""Magnetisation curves by scipy; writes bh_curve.json beside this file.

H and dH/dB are scipy's PchipInterpolator of H(B). The energy is adaptive quadrature of H, interval
by interval, and B at a given H a bracketing root search, so neither uses the polynomials.

    pip install numpy scipy && python3 tests/oracles/bh_curve.py
"""

import csv
import json
import pathlib

import numpy as np
from scipy.integrate import quad
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

HERE = pathlib.Path(__file__).parent


def committed():
    rows = list(csv.DictReader(open(HERE.parent.parent / "designs" / "steel_1010.csv")))
    return [float(r["b_t"]) for r in rows], [float(r["h_a_per_m"]) for r in rows]


TABLES = {
    "steel_1010": committed(),
    # The fewest points; the end slopes come from the same two chords.
    "three_points": ([0.0, 0.7, 1.3], [0.0, 170.0, 1300.0]),
    # The three-point slope at the origin would be negative: it is 0.
    "level_origin": ([0.0, 0.9, 1.1, 1.9], [0.0, 130.0, 700.0, 90000.0]),
    # Wide and narrow steps side by side; the last one is the steepest but one.
    "uneven": (
        [0.0, 0.013, 0.31, 0.33, 1.07, 1.1, 1.71, 2.3],
        [0.0, 7.0, 61.0, 63.0, 470.0, 590.0, 33000.0, 370000.0],
    ),
}


def values(b, h):
    curve = PchipInterpolator(b, h)
    slope = curve.derivative()
    rng = np.random.default_rng(1010)
    inside = np.sort(rng.uniform(0.0, b[-1], 40))
    tiny = np.array([1e-9, 0.37 * b[1]])
    points = []
    for at in [float(x) for x in np.concatenate([tiny, inside])]:
        knots = [x for x in b if x < at] + [at]
        energy = sum(quad(curve, lo, hi, epsabs=0, epsrel=1e-13)[0] for lo, hi in zip(knots, knots[1:]))
        wanted = float(curve(at)) * 1.003
        inverse = brentq(lambda x: float(curve(x)) - wanted, 0.0, b[-1], xtol=1e-15, rtol=1e-15) if wanted < h[-1] and at > 1e-3 else None
        points.append({
            "b_t": at,
            "h_a_per_m": float(curve(at)),
            "dh_db_m_per_h": float(slope(at)),
            "energy_j_per_m3": energy,
            "wanted_h_a_per_m": wanted if inverse is not None else None,
            "found_b_t": inverse,
        })
    return {"b_t": b, "h_a_per_m": h, "points": points}


def main():
    out = {name: values(*table) for name, table in TABLES.items()}
    (HERE / "bh_curve.json").write_text(json.dumps(out, indent=1) + "\n")


main()
