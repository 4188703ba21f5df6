"""Oracle of the lambda path: exact rational arithmetic, by complementary pivoting.

The optimality conditions of

    min |lambda h - G I|^2 / n,   lower <= I <= upper,   sum I <= total

form a linear complementarity problem, solved here by Lemke's algorithm on Python
fractions: no rounding, no tolerance, nothing in common with following a path. Force
constants are roots of the quadratic that holds around them, to 50 digits.

    python3 tests/oracles/lambda.py > tests/oracles/lambda.json

Needs numpy (to make the matrices) and mpmath. Takes a few minutes.
"""

import json
from fractions import Fraction

import mpmath
import numpy

mpmath.mp.dps = 60


def lemke(matrix, q):
    """z >= 0 with w = matrix z + q >= 0 and w'z = 0; ties broken lexicographically."""
    size = len(q)
    if all(v >= 0 for v in q):
        return [Fraction(0)] * size
    # Rows: w - matrix z - 1 z0 = q; columns: w, z, z0, right-hand side.
    rows = []
    for i in range(size):
        row = [Fraction(int(i == j)) for j in range(size)]
        row += [-matrix[i][j] for j in range(size)] + [Fraction(-1), q[i]]
        rows.append(row)
    basis = list(range(size))
    z0 = 2 * size

    def order(row, pivot):
        return [row[-1] / pivot] + [row[j] / pivot for j in range(size)]

    def pivot_on(r, c):
        pivot = rows[r][c]
        rows[r] = [v / pivot for v in rows[r]]
        for i in range(size):
            if i != r and rows[i][c] != 0:
                factor = rows[i][c]
                rows[i] = [a - factor * b if b else a for a, b in zip(rows[i], rows[r])]
        left = basis[r]
        basis[r] = c
        return left

    start = max(range(size), key=lambda i: order(rows[i], Fraction(-1)))
    left = pivot_on(start, z0)
    while left != z0:
        enter = left + size if left < size else left - size
        candidates = [i for i in range(size) if rows[i][enter] > 0]
        assert candidates, "no solution: the problem is not what it claims"
        r = min(candidates, key=lambda i: (order(rows[i], rows[i][enter])))
        for i in candidates:
            if basis[i] == z0 and order(rows[i], rows[i][enter])[0] == order(rows[r], rows[r][enter])[0]:
                r = i
        left = pivot_on(r, enter)
    z = [Fraction(0)] * size
    for i, b in enumerate(basis):
        if size <= b < 2 * size:
            z[b - size] = rows[i][-1]
    return z


class Problem:
    def __init__(self, forces, heights, lower, upper, total):
        self.g = [[Fraction(float(v)) for v in row] for row in forces]
        self.h = [Fraction(float(v)) for v in heights]
        self.n, self.m = len(self.g), len(self.g[0])
        self.lower = [Fraction(float(v)) for v in lower]
        self.upper = [Fraction(float(v)) for v in upper]
        self.total = None if total is None else Fraction(float(total))
        columns = list(zip(*self.g))
        dot = lambda a, b: sum(x * y for x, y in zip(a, b))
        self.gram = [[dot(a, b) / self.n for b in columns] for a in columns]
        self.pull = [dot(a, self.h) / self.n for a in columns]
        self.mean_square = dot(self.h, self.h) / self.n

    def currents(self, lam, limited=True):
        """The exact minimiser at a rational lambda."""
        m = self.m
        # x = I - lower >= 0
        gl = [sum(a * b for a, b in zip(row, self.lower)) for row in self.gram]
        q = [gl[i] - lam * self.pull[i] for i in range(m)]
        extra = []
        if limited:
            for i in range(m):
                extra.append(([Fraction(int(i == j)) for j in range(m)], self.upper[i] - self.lower[i]))
            if self.total is not None:
                extra.append(([Fraction(1)] * m, self.total - sum(self.lower)))
        size = m + len(extra)
        matrix = [[Fraction(0)] * size for _ in range(size)]
        for i in range(m):
            for j in range(m):
                matrix[i][j] = self.gram[i][j]
            for k, (row, _) in enumerate(extra):
                matrix[i][m + k] = row[i]
                matrix[m + k][i] = -row[i]
        z = lemke(matrix, q + [bound for _, bound in extra])
        return [a + b for a, b in zip(z, self.lower)]

    def error(self, lam, currents):
        quadratic = sum(self.gram[i][j] * currents[i] * currents[j] for i in range(self.m) for j in range(self.m))
        linear = sum(p * i for p, i in zip(self.pull, currents))
        return lam * lam * self.mean_square - 2 * lam * linear + quadratic

    def least(self, lam, limited=True):
        return self.error(lam, self.currents(lam, limited))

    def excess(self, lam):
        return (self.least(lam) - self.least(lam, False)) / (lam * lam * self.mean_square)

    def linear(self):
        """Only for lower = 0: currents grow with lambda until a limit binds."""
        one = self.currents(Fraction(1), False)
        ratios = [self.upper[i] / one[i] for i in range(self.m) if one[i] > 0]
        if self.total is not None and sum(one) > 0:
            ratios.append(self.total / sum(one))
        return min(ratios)

    def jnd(self, weight):
        """Bisection to a piece, then the root of the quadratic through three of its points."""
        goal = Fraction(float(weight)) ** 2
        low = self.linear()
        high = 2 * low
        while self.excess(high) <= goal:
            low, high = high, 2 * high
        value = lambda lam: self.least(lam) - self.least(lam, False) - goal * lam * lam * self.mean_square
        for _ in range(100):
            middle = ((low + high) / 2).limit_denominator(10**12)
            if not low < middle < high:
                break
            third, fourth = low + (high - low) / 3, low + (high - low) * 3 / 4
            points = [low, third, high]
            f = [value(p) for p in points]
            # Newton's form; a fourth point tells whether one quadratic holds.
            d1 = (f[1] - f[0]) / (points[1] - points[0])
            d2 = (f[2] - f[1]) / (points[2] - points[1])
            curve = (d2 - d1) / (points[2] - points[0])
            guess = f[0] + d1 * (fourth - low) + curve * (fourth - low) * (fourth - third)
            if guess == value(fourth):
                # f0 + d1 s + curve s (s - (third - low)) with s = lambda - low.
                a, b, c = curve, d1 - curve * (third - low), f[0]
                number = lambda v: mpmath.mpf(v.numerator) / mpmath.mpf(v.denominator)
                a, b, c = number(a), number(b), number(c)
                roots = mpmath.polyroots([a, b, c], maxsteps=500, extraprec=500) if a != 0 else [-c / b]
                inside = [r for r in roots if mpmath.im(r) == 0 and 0 <= r <= number(high - low)]
                return number(low) + min(inside)
            if value(middle) <= 0:
                low = middle
            else:
                high = middle
        raise AssertionError("no piece found")


def text(value):
    if isinstance(value, Fraction):
        value = mpmath.mpf(value.numerator) / mpmath.mpf(value.denominator)
    return mpmath.nstr(value, 50)


def conditioned(random, n, m, condition):
    """A matrix whose equilibrated columns have about the given condition number."""
    u = numpy.linalg.qr(random.standard_normal((n, m)))[0]
    v = numpy.linalg.qr(random.standard_normal((m, m)))[0]
    s = condition ** (-numpy.arange(m) / max(m - 1, 1))
    return u @ numpy.diag(s) @ v.T


def main():
    random = numpy.random.default_rng(20240611)
    cases = []
    for exponent in range(10):
        for kind in ("spread", "twin"):
            n, m = 14, 9
            if kind == "spread":
                forces = conditioned(random, n, m, 10.0**exponent)
            else:
                # Two pairs of columns that differ by 10^-exponent.
                forces = random.uniform(0.05, 1.0, (n, m))
                for a, b in ((0, 5), (3, 7)):
                    forces[:, b] = forces[:, a] + 10.0**-exponent * random.standard_normal(n)
            heights = random.uniform(0.03, 0.08, n)
            upper = 2.0 * 10.0 ** random.uniform(-6.0 * (exponent % 3 == 2), 0.0, m)
            signed = exponent % 4 == 3
            lower = -upper * random.uniform(0.0, 1.0, m) * signed
            total = float(0.6 * upper.sum()) if exponent % 2 else None
            problem = Problem(forces, heights, lower, upper, total)
            case = {
                "name": f"{kind} 1e{exponent}",
                "forces_n_per_a": forces.ravel().tolist(),
                "height_m": heights.tolist(),
                "lower_a": lower.tolist(),
                "upper_a": upper.tolist(),
                "total_max_a": total,
            }
            scale = problem.linear() if not signed else Fraction(1)
            if not signed:
                case["lambda_linear_n_per_m"] = text(scale)
                case["lambda_jnd_n_per_m"] = text(problem.jnd(0.07))
            case["points"] = []
            for factor in (0.7, 1.3, 3.1, 17.0, 400.0):
                lam = float(Fraction(factor) * scale)
                currents = problem.currents(Fraction(lam))
                case["points"].append(
                    {
                        "lambda_n_per_m": lam,
                        "relative_error": text(problem.error(Fraction(lam), currents) / (Fraction(lam) ** 2 * problem.mean_square)),
                        "currents_a": [text(v) for v in currents],
                    }
                )
            cases.append(case)
    print(json.dumps({"made_by": "tests/oracles/lambda.py", "cases": cases}, indent=1))


main()
