"""A thick coil without a core, by formulas that share nothing with the program.

All functions take radii a1, a2 and the length in metres, real or complex (for derivatives by
complex steps), and give values for one turn (gradient) or one turn squared (inductance).

Gradient on the axis, at a height h over the top face, u = h and u' = h + L:

    dB_z/dz = -mu_0 / (2 w L) int_a1^a2 a^2 (s^-3 - s'^-3) da,   s^2 = a^2 + u^2, s'^2 = a^2 + u'^2

the difference written as a sum of positive terms, so that far targets keep their digits;
`gradient_closed` is the integral in closed form (asinh), for the self-test.

Inductance, from Neumann's formula with both axial integrals and one integration by parts in the
azimuth in closed form; D is the loops' distance in the plane, R^2 = D^2 + L^2:

    L = 4 mu_0 / w^2 int_0^w dt int_a1^(a2-t) db (a b)^2 int_0^pi sin^2 phi / (D^2 (D + R)) dphi

with a = b + t, D^2 = t^2 + 4 a b sin^2(phi/2): every term positive and no elliptic integral. The
corner t = phi = 0 is opened by splitting the rectangle about it along its diagonal.
"""

import functools

import numpy as np

MU_0 = 4e-7 * np.pi
RADIAL_NODES = 64
NODES = 12


@functools.cache
def unit_rule(nodes):
    x, w = np.polynomial.legendre.leggauss(nodes)
    return 0.5 * (1 + x), 0.5 * w


def panels(breaks, nodes=NODES):
    """Gauss-Legendre nodes and weights on consecutive panels."""
    x, w = unit_rule(nodes)
    breaks = np.asarray(breaks)
    size = np.diff(breaks)
    return (breaks[:-1, None] + size[:, None] * x).ravel(), (size[:, None] * w).ravel()


def gradient(a1, a2, length, height, nodes=RADIAL_NODES):
    """dB_z/dz on the axis for one turn, T/m/A; height above the top face, m."""
    x, w = unit_rule(nodes)
    a = a1 + (a2 - a1) * x
    top, bottom = height, height + length
    s, t = np.sqrt(a * a + top * top), np.sqrt(a * a + bottom * bottom)
    difference = (top + bottom) / (s + t) * (s * s + s * t + t * t) / (s * t) ** 3
    return -MU_0 / 2 * np.sum(w * a * a * difference)


def gradient_closed(a1, a2, length, height):
    """The same in closed form; loses digits where the coil is small against the distance."""

    def primitive(a, u):
        return np.arcsinh(a / u) - a / np.hypot(a, u)

    sum_ = sum(
        sign * (primitive(a2, u) - primitive(a1, u))
        for sign, u in ((1, height), (-1, height + length))
    )
    return -MU_0 / (2 * (a2 - a1) * length) * sum_


def doubling(first, last):
    """0, first, 2 first, 4 first ... last."""
    first = min(first, last)
    count = max(0, int(np.ceil(np.log2(last / first) - 1e-9)))
    inner = [first * 2.0**k for k in range(count)]
    return [0.0, *inner, last]


def inductance(a1, a2, length, nodes=NODES):
    """Self inductance for one turn, H."""
    w = a2 - a1
    mean, width, long = np.real(a1 + a2) / 2, np.real(w), np.real(length)
    # Where the corner's two directions weigh alike.
    corner = min(np.pi, width / mean)
    # R + D varies over D ~ length, the loops' radii over b ~ t.
    xi, w_xi = panels(doubling(min(1.0, long / width), 1.0), nodes)
    y, w_y = unit_rule(nodes)
    along = np.multiply.outer
    near_weight = along(w_xi * xi, w_y).ravel()
    tau = [along(xi, np.ones_like(y)).ravel(), along(xi, y).ravel()]
    phi = [corner * along(xi, y).ravel(), corner * along(xi, np.ones_like(y)).ravel()]
    weight = [corner * near_weight] * 2
    if corner < np.pi:
        scale = min(corner, max(long / mean, 1e-3 * corner))
        breaks = [corner]
        while breaks[-1] < np.pi:
            breaks.append(min(np.pi, 2 * breaks[-1]))
        f, w_f = panels(breaks, nodes)
        tau_far, w_far = panels(doubling(min(1.0, scale / corner), 1.0), nodes)
        tau.append(along(tau_far, np.ones_like(f)).ravel())
        phi.append(along(np.ones_like(tau_far), f).ravel())
        weight.append(along(w_far, w_f).ravel())
    tau, phi, weight = (np.concatenate(part)[:, None] for part in (tau, phi, weight))
    x, w_x = unit_rule(nodes)
    t = w * tau
    b = a1 + (w - t) * x
    product = b * (b + t)
    d2 = t * t + 4 * product * np.sin(phi / 2) ** 2
    d = np.sqrt(d2)
    r = np.sqrt(d2 + length * length)
    integrand = product**2 * np.sin(phi) ** 2 / (d2 * (d + r))
    # dt = w dtau, db = (w - t) dx; one w of 1/w^2 is gone.
    return 4 * MU_0 / w * np.sum(weight * (w - t) * w_x * integrand)
