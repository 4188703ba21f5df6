#!/usr/bin/env python3
"""What steel cores add to coils, by a second formulation; writes steel/cores.json.

The surface charge sigma of the core (not the double layer that the program solves for):

    1/2 (mu_r + 1)/(mu_r - 1) sigma(x) - int sigma(y) n_x.(x - y)/(4 pi |x - y|^3) dS = n.H_coil(x)

with total charge zero, by a Nystrom method on panels halved towards the edges down to 2^-DEPTH;
near panels are cut dyadically towards the target. Rings of charge by K and E; the coil's field
on the core by Carlson's integrals. Outside, rings are summed by the midpoint rule over the
azimuth. The added inductance is -mu_0 oint sigma phi dS. Each case is solved twice, with a
coarser grading and a lower order; the largest relative difference stands in the file as "error".

    pip install numpy==2.4.6 scipy==1.17.1 && python3 tests/oracles/steel.py
"""

import json
import pathlib

import numpy as np
from scipy.special import ellipe, ellipkm1, elliprf, elliprj

MU0 = 4e-7 * np.pi

# inner, outer radius, length, turns; core radius, bottom, top; mu_r. Metres.
CASES = [
    (0.0123, 0.0191, 0.097, 1317.0, 0.0117, -0.113, 0.0041, 731.0),
    (0.0123, 0.0191, 0.097, 1317.0, 0.0123, -0.083, -0.0071, 1.7),
    (0.0057, 0.0233, 0.013, 217.0, 0.0049, -0.0177, 0.0019, 5300.0),
    (0.0311, 0.0347, 0.021, 311.0, 0.0271, -0.0037, -0.0003, 130.0),
    (0.0041, 0.0093, 0.171, 2900.0, 0.0036, -0.143, 0.0273, 13.0),
    (0.0111, 0.0177, 0.031, 471.0, 0.0107, 0.0123, 0.0291, 2100.0),
    (0.0123, 0.0191, 0.097, 1317.0, 0.0111, -0.131, -0.0013, 0.31),
]
# Field points (r, height above the higher of winding and core) in core radii.
POINTS = [(0.0, 0.47), (0.7, 0.53), (1.3, 0.31), (0.0, 2.3), (2.1, 1.9), (4.3, 3.7)]


class Outline:
    """Panels (anchor, from, to): r, z = anchor + offset along one direction.

    Offsets are kept from the nearest edge, so that distances within a corner keep their digits.
    """

    def __init__(self, case, order, depth, marks_depth):
        a1, a2, length, _, radius, bottom, top, _ = case
        x, w = np.polynomial.legendre.leggauss(order)
        self.order, self.x, self.w = order, x, w
        self.panels = []  # (anchor_r, anchor_z, direction_r, direction_z, from, to, n_r, n_z)
        def graded(anchor, direction, normal, reach, levels):
            ends = [0.0] + [reach * 0.5**k for k in range(levels, -1, -1)]
            for lo, hi in zip(ends[:-1], ends[1:]):
                self.panels.append((*anchor, *direction, lo, hi, *normal))
        for z, n_z in ((bottom, -1.0), (top, 1.0)):
            graded((radius, z), (-1.0, 0.0), (0.0, n_z), 0.5 * radius, depth)
            graded((0.0, z), (1.0, 0.0), (0.0, n_z), 0.5 * radius, 2)
        gap = max(a1 - radius, 2.0**-marks_depth * radius)
        inner = [z for z in (-length, 0.0) if bottom + 1e-9 < z < top - 1e-9]
        stops = [bottom, *inner, top]
        for lo, hi in zip(stops[:-1], stops[1:]):
            half = 0.5 * (hi - lo)
            for anchor, sign in ((lo, 1.0), (hi, -1.0)):
                steel = anchor in (bottom, top)
                levels = depth if steel else int(np.ceil(np.log2(half / gap))) + 2
                # The largest panels no longer than the radius.
                ends = [0.0] + [half * 0.5**k for k in range(max(levels, 2), -1, -1)]
                for a, b in zip(ends[:-1], ends[1:]):
                    pieces = max(1, int(np.ceil((b - a) / radius)))
                    for k in range(pieces):
                        f, t = a + (b - a) * k / pieces, a + (b - a) * (k + 1) / pieces
                        self.panels.append((radius, anchor, 0.0, sign, f, t, 1.0, 0.0))
        p = np.array(self.panels)
        self.p = p
        off = p[:, 4:5] + 0.5 * (p[:, 5:6] - p[:, 4:5]) * (1 + x)
        flat = lambda a: np.repeat(a, order)
        self.offset = off.ravel()
        self.anchor_r, self.anchor_z = flat(p[:, 0]), flat(p[:, 1])
        self.off_r, self.off_z = flat(p[:, 2]) * self.offset, flat(p[:, 3]) * self.offset
        self.r, self.z = self.anchor_r + self.off_r, self.anchor_z + self.off_z
        self.n_r, self.n_z = flat(p[:, 6]), flat(p[:, 7])
        self.weight = (0.5 * (p[:, 5:6] - p[:, 4:5]) * w).ravel()
        # Barycentric weights of the nodes.
        self.bary = np.array([1 / np.prod(x[i] - np.delete(x, i)) for i in range(order)])

    def lagrange(self, t):
        d = t[:, None] - self.x
        exact = d == 0
        d[exact] = 1.0
        q = self.bary / d
        out = q / q.sum(axis=1, keepdims=True)
        rows = exact.any(axis=1)
        out[rows] = exact[rows]
        return out


def ring_kernel(r, r1, dr, dz, n_r, n_z):
    """int over the source ring of n_x.(x - y)/(4 pi |x - y|^3), its radius included."""
    s2 = (r + r1) ** 2 + dz * dz
    d2 = dr * dr + dz * dz
    m1 = d2 / s2
    k, e = ellipkm1(m1), ellipe(1 - m1)
    s = np.sqrt(s2)
    e_z = dz * e / (d2 * s)
    # [K + (r^2 - r1^2 - dz^2) E / d^2] / (2 r s)
    e_r = (k - e + (2 * r * dr) * e / d2) / (2 * r * s)
    return r1 / np.pi * (n_r * e_r + n_z * e_z)


def matrix(o, mu_r):
    n = len(o.r)
    out = np.zeros((n, n))
    x16, w16 = np.polynomial.legendre.leggauss(16)
    panel_r = o.p[:, 0:1] + o.p[:, 2:3] * o.p[:, 4:6]
    panel_z = o.p[:, 1:2] + o.p[:, 3:4] * o.p[:, 4:6]
    centre_r, centre_z = panel_r.mean(axis=1), panel_z.mean(axis=1)
    half = 0.5 * (o.p[:, 5] - o.p[:, 4])
    for i in range(n):
        dr = (o.anchor_r[i] - o.anchor_r) + (o.off_r[i] - o.off_r)
        dz = (o.anchor_z[i] - o.anchor_z) + (o.off_z[i] - o.off_z)
        with np.errstate(all="ignore"):
            row = ring_kernel(o.r[i], o.r, dr, dz, o.n_r[i], o.n_z[i]) * o.weight
        # Where the target stands in each panel's own coordinate.
        rel_r = (o.anchor_r[i] - o.p[:, 0]) + o.off_r[i]
        rel_z = (o.anchor_z[i] - o.p[:, 1]) + o.off_z[i]
        along = rel_r * o.p[:, 2] + rel_z * o.p[:, 3]
        across = np.abs(rel_r * o.p[:, 3]) + np.abs(rel_z * o.p[:, 2])
        near = np.hypot(np.maximum(np.abs(along - 0.5 * (o.p[:, 4] + o.p[:, 5])) - half, 0), across)
        for k in np.nonzero(near < 4 * half)[0]:
            cols = slice(k * o.order, (k + 1) * o.order)
            a_r, a_z, d_r, d_z, lo, hi, m_r, m_z = o.p[k]
            if o.n_z[i] != 0 and m_z == o.n_z[i]:
                row[cols] = 0.0
                continue
            foot = min(max(along[k], lo), hi)
            ts, ws = [], []
            for end in (lo, hi):
                reach = end - foot
                if reach == 0:
                    continue
                ends = foot + reach * np.concatenate(([0.0], 0.5 ** np.arange(52, -1, -1.0)))
                # Offsets from the foot, exactly.
                d = reach * np.concatenate(([0.0], 0.5 ** np.arange(52, -1, -1.0)))
                mid, h = 0.5 * (d[:-1] + d[1:]), 0.5 * (d[1:] - d[:-1])
                ts.append((mid[:, None] + h[:, None] * x16).ravel())
                ws.append(np.abs(h[:, None] * w16).ravel())
            d, w = np.concatenate(ts), np.concatenate(ws)
            t = foot + d
            # x - y = relative position - t direction, with t = foot + d.
            e_r = (rel_r[k] - foot * d_r) - d * d_r
            e_z = (rel_z[k] - foot * d_z) - d * d_z
            ok = (e_r != 0) | (e_z != 0)
            e_r, e_z, d, w, t = e_r[ok], e_z[ok], d[ok], w[ok], t[ok]
            kern = ring_kernel(o.r[i], a_r + t * d_r, e_r, e_z, o.n_r[i], o.n_z[i])
            ref = 2 * (t - lo) / (hi - lo) - 1
            row[cols] = (kern * w) @ o.lagrange(ref)
        out[i] = -row
    out[np.diag_indices(n)] += 0.5 * (mu_r + 1) / (mu_r - 1)
    return out


def coil_on_core(case, r, z):
    """H_r, H_z and phi (H = -grad phi) per ampere at points in the bore."""
    a1, a2, length, turns, *_ = case
    density = turns / ((a2 - a1) * length)
    x, w = np.polynomial.legendre.leggauss(16)
    ends = a1 + (a2 - a1) * np.concatenate(([0.0], 0.5 ** np.arange(40, -1, -1.0)))
    a = np.concatenate([0.5 * (lo + hi) + 0.5 * (hi - lo) * x for lo, hi in zip(ends, ends[1:])])
    wa = np.concatenate([0.5 * (hi - lo) * w for lo, hi in zip(ends, ends[1:])])
    h_r, h_z, phi = (np.zeros(len(r)) for _ in range(3))
    for i in range(len(r)):
        for face, sign in ((0.0, -1.0), (-length, 1.0)):
            u = z[i] - face
            s2 = (a + r[i]) ** 2 + u * u
            d2 = (a - r[i]) ** 2 + u * u
            kc2 = d2 / s2
            m = 1 - kc2
            k = elliprf(0, kc2, 1)
            rd_part = k - ellipe(m)
            s = np.sqrt(s2)
            # Sheet of unit turn density: A_phi difference gives H_r.
            h_r[i] += sign * -1 * density / np.pi * np.dot(
                wa, s / (4 * r[i]) * (2 * rd_part - m * k))
            if u != 0:
                # f = a u /((a + r) s) cel(kc, g^2, 1, g), g = (a - r)/(a + r);
                # cel(kc, p, 1, b) = R_F + (b - p)/3 R_J(0, kc2, 1, p).
                g = (a - r[i]) / (a + r[i])
                p = g * g
                # p = 0 where a = r: the limit of the integrand is u/(2 s) K.
                cel = k + (g - p) / 3 * elliprj(0, kc2, 1, np.maximum(p, 1e-300))
                h_z[i] += sign * density / np.pi * np.dot(wa, a * u / ((a + r[i]) * s) * cel)
            # Discs of charge density (a2 - max(rho, a1)) density.
            stops = [0.0, r[i], a1, a2] if r[i] < a1 else [0.0, a1, a2]
            for lo, hi in zip(stops[:-1], stops[1:]):
                grade = 0.5 ** np.arange(46, 0, -1.0)
                cut = np.concatenate(([0.0], grade, 1 - grade[::-1][1:], [1.0]))
                cut = lo + (hi - lo) * np.unique(cut)
                mid, half = 0.5 * (cut[1:] + cut[:-1]), 0.5 * (cut[1:] - cut[:-1])
                rho = (mid[:, None] + half[:, None] * x).ravel()
                wr = (half[:, None] * w).ravel()
                s2 = (rho + r[i]) ** 2 + u * u
                kc2 = ((rho - r[i]) ** 2 + u * u) / s2
                charge = density * (a2 - np.maximum(rho, a1))
                phi[i] -= sign * np.dot(wr, charge * rho * ellipkm1(np.maximum(kc2, 1e-300)) / np.sqrt(s2)) / np.pi
    phi -= density * (a2 - a1) * np.clip(z, -length, 0.0)
    return h_r, h_z, phi


def solve(case, order, depth, marks_depth):
    _, _, length, _, radius, bottom, top, mu_r = case
    o = Outline(case, order, depth, marks_depth)
    h_r, h_z, phi = coil_on_core(case, o.r, o.z)
    area = 2 * np.pi * o.r * o.weight
    m = matrix(o, mu_r) + area[None, :] / area.sum()
    sigma = np.linalg.solve(m, o.n_r * h_r + o.n_z * h_z)
    q = sigma * area
    charge = abs(q.sum()) / np.abs(q).sum()
    added = -MU0 * np.dot(q, phi)
    fields = []
    psi = 2 * np.pi * (np.arange(2048) + 0.5) / 2048
    for pr, pz in POINTS:
        r, z = pr * radius, max(top, 0.0) + pz * radius
        dx = r - o.r[:, None] * np.cos(psi)
        dy = o.r[:, None] * np.sin(psi)
        dz = (z - o.z)[:, None]
        d2 = dx * dx + dy * dy + dz * dz
        scale = MU0 / (4 * np.pi) / len(psi)
        fields.append([
            scale * np.dot(q, (dx / d2**1.5).sum(axis=1)),
            scale * np.dot(q, (dz / d2**1.5).sum(axis=1)),
            scale * np.dot(q, (1 / d2**1.5 - 3 * dz * dz / d2**2.5).sum(axis=1)),
        ])
    return len(o.r), charge, added, np.array(fields)


def main():
    rows = []
    for case in CASES:
        _, _, coarse, coarse_fields = solve(case, 9, 30, 24)
        nodes, charge, added, fields = solve(case, 12, 44, 30)
        peak = np.abs(fields).max(axis=0)
        error = max(abs(added / coarse - 1), (np.abs(fields - coarse_fields).max(axis=0) / peak).max())
        print(case, nodes, f"charge {charge:.1e} error {error:.1e} added {added!r}", flush=True)
        a1, a2, length, turns, radius, bottom, top, mu_r = case
        rows.append({
            "inner_radius_m": a1, "outer_radius_m": a2, "length_m": length, "turns": turns,
            "core_radius_m": radius, "core_bottom_m": bottom, "core_top_m": top, "mu_r": mu_r,
            "error": float(f"{error:.1e}"),
            "added_inductance_h": added,
            "points": [
                {"r_m": pr * radius, "z_m": max(top, 0.0) + pz * radius,
                 "b_r": f[0], "b_z": f[1], "dbz_dz": f[2]}
                for (pr, pz), f in zip(POINTS, fields.tolist())
            ],
        })
    path = pathlib.Path(__file__).parent / "steel" / "cores.json"
    path.write_text(json.dumps({"script": "tests/oracles/steel.py", "cases": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
