#!/usr/bin/env python3
"""High-precision values for air coils; writes air_coil.json beside this file.

Route: 40-digit radial quadrature (mpmath, panels graded to the near singularities) of the
loops' elliptic-integral fields at the two end faces. Every third point is checked against a
second route without elliptic integrals: azimuthal quadrature of the Biot-Savart law with the
axial integral in closed form. Inputs are the doubles nearest the decimals. The self inductances integrate Neumann's formula: axial part in
closed form, azimuth and radii by quadrature.

    pip install mpmath==1.3.0 gmpy2 && python3 tests/oracles/air_coil.py
"""

import json
import pathlib

from mpmath import mp, mpf

mp.dps = 40
MU0 = 4 * mp.pi * mpf("1e-7")

# inner radius, outer radius, length (m), turns; points (r, height above the top face).
SEED = ("0.012", "0.019", "0.1", "1429")
WINDINGS = {
    "seed": (SEED, [
        ("0", "0.03"), ("1e-9", "0.03"), ("0.012", "1e-6"), ("0.019", "1e-6"), ("0.0155", "1e-6"),
        ("0.0131", "0.013"), ("0.05", "0.03"), ("0.0707", "0.05"), ("0.2", "0.01"),
        ("0.004", "-0.037"), ("0.0143", "-0.021"), ("0.0189999", "-0.0999"), ("0.0190001", "-0.06"),
        ("0.03", "-0.05"), ("3.0", "9.5"), ("9.9", "0.3"), ("1e-7", "10"), ("0.0121", "-1e-9"),
        ("0.016", "1e-12"), ("0.007", "-0.103"),
    ]),
    "thin_disc": (("0.013", "0.047", "0.00011", "37"), [
        ("0", "0.02"), ("0.031", "0.0007"), ("0.047", "2e-6"), ("0.02", "-0.00004"), ("0.09", "-0.00003"),
        ("0.3", "0.7"), ("7.1", "7.3"), ("1e-9", "10"), ("0.0131", "0.0000003"),
    ]),
    "thinner_disc": (("0.013", "0.047", "1.7e-6", "3"), [
        ("0.031", "0.0007"), ("0.047", "2e-6"), ("0.09", "-0.0000013"), ("2.1", "1.3"),
    ]),
    "tube": (("0.0007", "0.0011", "1.1", "2600"), [
        ("0", "0.03"), ("0.0009", "0.0013"), ("0.0011", "1e-6"), ("0.0009", "-0.4"), ("0.0003", "-0.4"),
        ("0.0012", "-0.4"), ("0.05", "-0.7"), ("0.0008", "1.7"), ("4.0", "9.0"), ("0.6", "-0.5"),
    ]),
    "thin_sheet": (("0.05", "0.0500003", "0.03", "91"), [
        ("0.02", "0.01"), ("0.0500001", "0.0000007"), ("0.05000015", "-0.011"), ("0.049", "0.002"), ("0.3", "2.0"),
    ]),
    "solid": (("0", "0.021", "0.017", "700"), [
        ("0", "0.011"), ("0", "-0.006"), ("0.013", "-0.0021"), ("0.017", "0.0003"), ("1.3", "0.4"),
    ]),
}
INDUCTANCES = {
    "seed": SEED,
    "thin_disc": ("0.013", "0.047", "0.00011", "37"),
    "tube": ("0.0007", "0.0011", "1.1", "2600"),
    "thin_sheet": ("0.05", "0.0500003", "0.03", "91"),
    "solid": ("0", "0.021", "0.017", "700"),
    "square": ("0.7", "1.3", "0.6", "1"),
}


def loop(a, r, u):
    """b_z, b_r / r, A / r of a loop, per ampere over mu_0; r > 0."""
    s2, d2 = (a + r) ** 2 + u * u, (a - r) ** 2 + u * u
    s, m = mp.sqrt(s2), 4 * a * r / s2
    k, e = mp.ellipk(m), mp.ellipe(m)
    b_z = (k + (a * a - r * r - u * u) / d2 * e) / (2 * mp.pi * s)
    b_r = u / r * (-k + (a * a + r * r + u * u) / d2 * e) / (2 * mp.pi * s)
    a_phi = s / (2 * mp.pi * r) * ((1 - m / 2) * k - e)
    return b_z, b_r / r, a_phi / r


def loop_on_axis(a, u):
    q = a * a + u * u
    return a * a / (2 * q ** mpf("1.5")), 3 * a * a * u / (4 * q ** mpf("2.5")), a * a / (4 * q ** mpf("1.5"))


def sheet(a, r, u):
    """Half-infinite sheet's B_z over mu_0 K, up to a constant that cancels."""
    if r == 0:
        return u / (2 * mp.sqrt(a * a + u * u))
    s2, d2 = (a + r) ** 2 + u * u, (a - r) ** 2 + u * u
    m, n = 4 * a * r / s2, 4 * a * r / (a + r) ** 2
    value = mp.ellipk(m) + (a - r) / (a + r) * mp.ellippi(n, m)
    return u / (2 * mp.pi * mp.sqrt(s2)) * value


def graded(lo, hi, distance, nodes):
    """Gauss-Legendre nodes on panels halved towards an integrand's singularity at +- i distance."""
    if lo < 0 < hi:
        yield from graded(lo, mpf(0), distance, nodes)
        yield from graded(mpf(0), hi, distance, nodes)
        return
    half = (hi - lo) / 2
    near = min(abs(lo), abs(hi))
    if mp.sqrt(near ** 2 + distance ** 2) < half and half > mpf("1e-40"):
        yield from graded(lo, lo + half, distance, nodes)
        yield from graded(lo + half, hi, distance, nodes)
        return
    for x, weight in nodes:
        yield (lo + half * (1 + x) if x < 0 else hi - half * (1 - x)), half * weight


def winding(w, r, z):
    a1, a2, length, turns = (mpf(float(v)) for v in w)
    r, z = mpf(float(r)), mpf(float(z))
    j = turns / ((a2 - a1) * length)
    # Enough digits that the loops' cancellation near the axis and far away does no harm.
    mp.dps = 60
    total = [mpf(0)] * 4
    for u, sign in ((z, 1), (z + length, -1)):
        for offset, weight in graded(a1 - r, a2 - r, abs(u), GAUSS):
            a = r + offset
            values = loop_on_axis(a, u) if r == 0 else loop(a, r, u)
            for part, value in enumerate((*values, sheet(a, r, u))):
                total[part] += sign * weight * value
    inside = a1 < r < a2 and -length < z < 0
    scale = MU0 * j
    dbz_dz, dbr_dz = -scale * total[0], -scale * total[1] * r
    br_over_r, b_z = scale * total[2], -scale * total[3]
    out = {
        "b_r": br_over_r * r, "b_z": b_z, "dbr_dr": -br_over_r - dbz_dz, "dbr_dz": dbr_dz,
        "dbz_dr": dbr_dz - (scale if inside else 0), "dbz_dz": dbz_dz, "br_over_r": br_over_r,
    }
    mp.dps = 40
    return out


def by_azimuth(w, r, z):
    """B_z and dB_z/dz by azimuthal quadrature, axial integral in closed form (outside only)."""
    a1, a2, length, turns = (mpf(float(v)) for v in w)
    r, z = mpf(float(r)), mpf(float(z))
    j = turns / ((a2 - a1) * length)
    mp.dps = 30

    def parts(a):
        def at(phi):
            c = mp.cos(phi)
            rho2 = a * a + r * r - 2 * a * r * c
            top, bottom = z, z + length
            def axial(u):
                return u / (rho2 * mp.sqrt(rho2 + u * u))
            def cube(u):
                return (rho2 + u * u) ** mpf("-1.5")
            return a * (a - r * c) * mp.matrix([axial(bottom) - axial(top), cube(bottom) - cube(top)])
        nodes = graded(mpf(0), mp.pi, min(abs(a - r) + z, a) / a, GAUSS_SHORT)
        sums = mp.matrix([0, 0])
        for phi, weight in nodes:
            sums += weight * at(phi)
        return sums

    total = mp.matrix([0, 0])
    for offset, weight in graded(a1 - r, a2 - r, z, GAUSS):
        total += weight * parts(r + offset)
    out = [MU0 * j / mp.pi * value / 2 for value in total]
    mp.dps = 40
    return out


def inductance(w):
    """Neumann's formula; the double axial integral in closed form."""
    a1, a2, length, turns = (mpf(float(v)) for v in w)
    mp.dps = 25
    width = a2 - a1

    def axial(dist):
        # int int dz dz' / sqrt(R^2 + (z - z')^2), written without cancellation
        x = length / dist
        return 2 * dist * (x * mp.asinh(x) - x * x / (mp.sqrt(1 + x * x) + 1))

    total = mpf(0)
    for t, weight_t in graded(width / 2 ** 34, width, mpf(0), GAUSS_SHORT):
        lo, hi = a1 + t / 2, a2 - t / 2
        # A solid winding's innermost pairs of sheets need their own panels.
        for s, weight_s in graded(lo, hi, t / 2, GAUSS_SHORT):
            a, b = s + t / 2, s - t / 2
            azimuth = mpf(0)
            for phi, weight_phi in graded(mpf(0), mp.pi, t / mp.sqrt(a * b), GAUSS_SHORT):
                half = mp.sin(phi / 2)
                dist = mp.sqrt(t * t + 4 * a * b * half * half)
                azimuth += weight_phi * (1 - 2 * half * half) * axial(dist)
            total += 2 * weight_t * weight_s * a * b * azimuth
    # The strip t < width / 2^34 left out: its share is 2^-34 of an integrand that is constant
    # there up to t ln t, so the value at its edge serves.
    t = width / 2 ** 34
    strip = mpf(0)
    for s, weight_s in graded(a1, a2, t / 2, GAUSS_SHORT):
        azimuth = mpf(0)
        for phi, weight_phi in graded(mpf(0), mp.pi, t / (s + t), GAUSS_SHORT):
            half = mp.sin(phi / 2)
            dist = mp.sqrt((t / 2) ** 2 + 4 * s * s * half * half)
            azimuth += weight_phi * (1 - 2 * half * half) * axial(dist)
        strip += weight_s * s * s * azimuth
    total += 2 * t * strip
    out = MU0 * turns ** 2 / (width * length) ** 2 * total
    mp.dps = 40
    return out


def gauss(n):
    """Nodes and weights by Newton's method."""
    nodes = []
    for k in range(n):
        x = mp.cos(mp.pi * (k + mpf("0.75")) / (n + mpf("0.5")))
        for _ in range(12):
            slope = n * (x * mp.legendre(n, x) - mp.legendre(n - 1, x)) / (x * x - 1)
            x -= mp.legendre(n, x) / slope
        nodes.append((x, 2 / ((1 - x * x) * slope ** 2)))
    return nodes


GAUSS = gauss(26)
GAUSS_SHORT = gauss(14)


def text(value):
    return mp.nstr(value, 25)


def main():
    cases = []
    for name, (w, points) in WINDINGS.items():
        for index, (r, z) in enumerate(points):
            values = winding(w, r, z)
            outside_top = mpf(z) > mpf("0.001")
            if index % 3 == 0 and outside_top and mpf(w[0]) > 0:
                b_z, dbz_dz = by_azimuth(w, r, z)
                size = abs(values["b_z"])
                assert abs(b_z - values["b_z"]) < mpf("1e-13") * size, (name, r, z, b_z, values["b_z"])
                assert abs(dbz_dz - values["dbz_dz"]) < mpf("1e-12") * abs(values["dbz_dz"]), (name, r, z)
            cases.append({"winding": name, "r_m": r, "z_m": z, **{k: text(v) for k, v in values.items()}})
            print(name, r, z, flush=True)
    inductances = []
    for name, w in INDUCTANCES.items():
        value = inductance(w)
        print(name, mp.nstr(value, 20), flush=True)
        inductances.append({"winding": name, "inductance_h": mp.nstr(value, 20)})
    keys = ("inner_radius_m", "outer_radius_m", "length_m", "turns")
    everything = {n: w for n, (w, _) in WINDINGS.items()} | INDUCTANCES
    out = {
        "about": "Air coils per ampere; see air_coil.py",
        "windings": {n: dict(zip(keys, w)) for n, w in everything.items()},
        "points": cases,
        "inductances": inductances,
    }
    path = pathlib.Path(__file__).with_suffix(".json")
    path.write_text(json.dumps(out, indent=1) + "\n")


if __name__ == "__main__":
    main()
