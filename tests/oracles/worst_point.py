"""Oracle of the worst-point form: linear programs solved by HiGHS.

    python3 tests/oracles/worst_point.py > tests/oracles/worst_point.json

200 arrays of 25 to 225 coils, made by the same generator of numbers as in
tests/lambda/scale.rs: the least largest error at one force constant, and the largest force
constant with no point too weak (null where there is none). Needs scipy; takes a minute.
"""

import json
import math

import numpy
from scipy.optimize import linprog

COILS = [(100, 5), (150, 6), (175, 7), (188, 8), (196, 10), (199, 12), (200, 15)]


class Numbers:
    """The linear congruential generator of Knuth's MMIX."""

    def __init__(self, seed):
        self.state = seed

    def between(self, low, high):
        self.state = (self.state * 6364136223846793005 + 1442695040888963407) % 2**64
        return low + (high - low) * ((self.state >> 11) / 2**53)


def problem(k):
    """Forces, heights, offsets, limits, limit on the sum and the force constant."""
    numbers = Numbers(k)
    side = next(side for end, side in COILS if k < end)
    pitch = numbers.between(0.03, 0.06)
    jitter = 0.0 if k % 2 == 0 else 0.2 * pitch
    coils = []
    for i in range(side * side):
        x = (i % side - 0.5 * (side - 1)) * pitch + numbers.between(-jitter, jitter)
        y = (i // side - 0.5 * (side - 1)) * pitch + numbers.between(-jitter, jitter)
        coils.append((x, y))
    half = 0.5 * (side - 1) * pitch
    level = numbers.between(0.03, 0.06)
    rough = 0.0 if k % 4 == 0 else 0.3 * level
    forces, heights, offsets = [], [], []
    for _ in range(2 * side * side + 50):
        x, y = numbers.between(-half, half), numbers.between(-half, half)
        h = level + numbers.between(-rough, rough)
        z = h + 0.03
        for cx, cy in coils:
            flat = (x - cx) * (x - cx) + (y - cy) * (y - cy)
            r2 = flat + z * z
            forces.append(1.0e-6 * z * (2.0 * z * z - 3.0 * flat) / (r2 * r2 * r2 * math.sqrt(r2)))
        heights.append(h)
        offsets.append(numbers.between(-2e-3, 0.0) if k % 7 == 0 else 0.0)
    upper = [numbers.between(0.5, 2.0) for _ in coils]
    lower = [-0.5 * u if k % 3 == 0 else 0.0 for u in upper]
    total = 0.4 * math.fsum(upper) if k % 5 == 0 else None
    at = numbers.between(0.05, 0.6)
    shape = (len(heights), len(coils))
    return numpy.array(forces).reshape(shape), heights, offsets, lower, upper, total, at


def solve(cost, rows, right, lower, upper, total, last):
    """The last variable of the optimum; None where there is none."""
    if total is not None:
        rows = numpy.vstack([rows, [1.0] * len(upper) + [0.0]])
        right = numpy.append(right, total)
    bounds = [*zip(lower, upper), last]
    options = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    found = linprog(cost, rows, right, bounds=bounds, method="highs", options=options)
    return found.x[-1] if found.status == 0 else None


def main():
    results = []
    for k in range(200):
        forces, heights, offsets, lower, upper, total, at = problem(k)
        points, coils = forces.shape
        h, o = numpy.array(heights), numpy.array(offsets)
        cost = numpy.zeros(coils + 1)
        ones = numpy.ones((points, 1))
        wanted = 1e3 * (at * h - o)
        cost[-1] = 1.0
        rows = numpy.vstack([numpy.hstack([-1e3 * forces, -ones]), numpy.hstack([1e3 * forces, -ones])])
        right = numpy.concatenate([-wanted, wanted])
        least = solve(cost, rows, right, lower, upper, total, (0.0, None))
        cost[-1] = -1.0
        rows = numpy.hstack([-1e3 * forces, 1e3 * h.reshape(-1, 1)])
        most = solve(cost, rows, 1e3 * o, lower, upper, total, (0.0, None))
        results.append({"worst_error_n": least * 1e-3, "lambda_maxmin_n_per_m": most})
    print(json.dumps({"cases": results}, indent=1))


if __name__ == "__main__":
    main()
