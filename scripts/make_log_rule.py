"""Prints the table of src/numerics/log_rule.rs: nodes and weights on [0, 1] that are exact for
t^k and t^k ln t, k < 12, by Newton's method in 60 digits. Needs mpmath and numpy."""

from mpmath import log, lu_solve, matrix, mp, mpf
from numpy.polynomial.legendre import leggauss

mp.dps = 60
ORDER = 12


def newton(nodes, weights):
    n = len(nodes)
    for _ in range(60):
        fault, slope = matrix(2 * n, 1), matrix(2 * n, 2 * n)
        for k in range(n):
            for i, t in enumerate(nodes):
                power, before = t**k, (k * t ** (k - 1) if k else mpf(0))
                fault[k] += weights[i] * power
                fault[n + k] += weights[i] * power * log(t)
                slope[k, i] = weights[i] * before
                slope[k, n + i] = power
                slope[n + k, i] = weights[i] * (before * log(t) + t ** (k - 1))
                slope[n + k, n + i] = power * log(t)
            fault[k] -= mpf(1) / (k + 1)
            fault[n + k] += mpf(1) / (k + 1) ** 2
        step = lu_solve(slope, fault)
        nodes = [t - step[i] for i, t in enumerate(nodes)]
        weights = [w - step[n + i] for i, w in enumerate(weights)]
        if max(abs(s) for s in step) < mpf(10) ** -45:
            return nodes, weights
    raise SystemExit("no convergence")


# Start: Gauss-Legendre with the nodes drawn towards zero.
x, w = leggauss(ORDER)
start = [mpf((v + 1) / 2) for v in x]
draw = mpf(1.8)
nodes, weights = newton(
    [t**draw for t in start],
    [mpf(a) / 2 * draw * t ** (draw - 1) for a, t in zip(w, start)],
)
for t, a in sorted(zip(nodes, weights)):
    print(f"    [{float(t)!r}, {float(a)!r}],")
