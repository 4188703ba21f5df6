#!/usr/bin/env python3
"""Eq. 8 with three rows against SciPy on random problems: within reach and beyond it.

    python3 scripts/vector_check.py [PROBLEMS]

Each problem has 3 to 12 coils that push only or push and pull, resistances that differ, and for a third of them
a limit of the currents' sum. Within reach SciPy minimises power subject to the force (SLSQP); beyond it the
weighted distance from the force (lsq_linear without a limit of the sum, SLSQP with one). What is compared is
what the Python loader computes, which is that of the program and of C to 1e-12. Prints how many were within
reach, the largest relative excess of power over SciPy's, the largest missing force where SciPy misses none, and the
largest excess of the distance; ends with 1 where one is above 1e-6. Needs numpy and scipy.
"""

import pathlib
import sys

import numpy as np
from scipy.optimize import linprog, lsq_linear, minimize

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "src/python/fluxform"))
from load_bundle import _allocate_vector  # noqa: E402

WEIGHT = 0.1
LARGEST_EXCESS = 1e-6


def problem(random):
    """Force per ampere [coil, axis], requested force, resistances, limits, sum."""
    coils = random.integers(3, 13)
    force = random.uniform(-0.1, 0.1, (coils, 3)) + [0.0, 0.0, 0.08]
    lower = -random.uniform(0.0, 2.0, coils) * (random.random() < 0.5)
    upper = random.uniform(0.2, 2.0, coils)
    total = random.uniform(0.3, 0.8) * upper.sum() if random.random() < 1 / 3 else np.inf
    wanted = force.T @ random.uniform(0.0, 0.5, coils) + random.uniform(-0.04, 0.04, 3)
    return force, wanted, random.uniform(3.0, 9.0, coils), lower, upper, total


def within_reach(force, wanted, lower, upper, total):
    """Whether any currents within the limits give the force: a linear programme."""
    coils = len(lower)
    rows = None if np.isinf(total) else np.ones((1, coils))
    found = linprog(np.zeros(coils), A_ub=rows, b_ub=None if rows is None else [total], A_eq=force.T, b_eq=wanted,
                    bounds=list(zip(lower, upper)))
    return found.status == 0


def slsqp(value, slope, start, lower, upper, constraints):
    """The best of three starts; SLSQP may end early."""
    ends = [
        minimize(value, at, jac=slope, bounds=list(zip(lower, upper)), constraints=constraints, method="SLSQP",
                 options={"maxiter": 500, "ftol": 1e-16})
        for at in (start, np.clip(0.0, lower, upper), 0.5 * (lower + upper))
    ]
    return [np.clip(end.x, lower, upper) for end in ends]


def of_sum(total):
    return [] if np.isinf(total) else [{"type": "ineq", "fun": lambda i: total - i.sum(), "jac": lambda i: -np.ones_like(i)}]


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    random = np.random.default_rng(18)
    reached = 0
    excess_power = missing = excess_distance = 0.0
    weights = np.array([WEIGHT, WEIGHT, 1.0])
    for _ in range(count):
        force, wanted, ohm, lower, upper, total = problem(random)
        currents, met = _allocate_vector(force, wanted, ohm, lower, upper, total, WEIGHT)
        assert np.all(currents >= lower - 1e-12) and np.all(currents <= upper + 1e-12)
        assert currents.sum() <= total * (1 + 1e-10)
        size = np.linalg.norm(wanted)

        def distance(i):
            return np.linalg.norm(weights * (force.T @ i - wanted))

        if within_reach(force, wanted, lower, upper, total):
            reached += 1
            missing = max(missing, distance(currents) / size)
            met_force = {"type": "eq", "fun": lambda i: 10 * (force.T @ i - wanted), "jac": lambda i: 10 * force.T}
            others = slsqp(lambda i: ohm @ (i * i), lambda i: 2 * ohm * i, currents * 0.9, lower, upper,
                           [met_force, *of_sum(total)])
            fair = [ohm @ (i * i) for i in others if distance(i) < 1e-9 * size and i.sum() <= total * (1 + 1e-12)]
            if fair:
                excess_power = max(excess_power, (ohm @ (currents * currents)) / min(fair) - 1)
            continue
        assert not met
        rows, target = force.T * weights[:, None], wanted * weights
        if np.isinf(total):
            others = [lsq_linear(rows, target, bounds=(lower, upper), tol=1e-14).x]
        else:
            others = slsqp(lambda i: 1e3 * np.sum((rows @ i - target) ** 2),
                           lambda i: 2e3 * rows.T @ (rows @ i - target), currents * 0.9, lower, upper, of_sum(total))
        least = min(distance(i) for i in others if i.sum() <= total * (1 + 1e-12))
        excess_distance = max(excess_distance, (distance(currents) - least) / size)
    print(f"{count} problems, {reached} within reach, {count - reached} beyond")
    print(f"missing force within reach {missing:.1e}, power above SciPy's by at most {excess_power:.1e}, "
          f"distance beyond reach above SciPy's by at most {excess_distance:.1e}, relative")
    return int(max(missing, excess_power, excess_distance) > LARGEST_EXCESS)


if __name__ == "__main__":
    sys.exit(main())
