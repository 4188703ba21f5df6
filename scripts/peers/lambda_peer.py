#!/usr/bin/env python3
"""General solvers at one force constant, their tolerance swept, for `fluxform-bench --peers`.

    python3 scripts/peers/lambda_peer.py --rows PROBLEM.json

The solvers and the scaled statement of the problem are those of compare_lambda.py; the error is
the excess over the least error, for the mean form relative to lambda^2 mean(h^2). See rows.py.
"""

import rows

import compare_lambda

TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)
PACKAGES = {
    "Clarabel": ("clarabel", "scipy"),
    "HiGHS": ("scipy",),
    "SciPy SLSQP": ("scipy",),
    "NLopt SLSQP": ("nlopt",),
}
# HiGHS is SciPy's; its own version is SciPy's matter.
VERSION_OF = {"Clarabel": "clarabel", "HiGHS": "scipy", "SciPy SLSQP": "scipy", "NLopt SLSQP": "nlopt"}


def swept(asked, name):
    import numpy as np

    form = asked["form"]
    problem = compare_lambda.Problem(asked, scaled=True)
    solver = compare_lambda.SOLVERS[form][name]
    unit = 1.0
    if form == "mean":
        square = float(np.mean(problem.h**2))
        unit = asked["least_mean_square_n2"][0] / (asked["lambda_n_per_m"][0] ** 2 * square)
    reported = []
    for tolerance in TOLERANCES:
        compare_lambda.TOLERANCE = tolerance

        def work():
            return compare_lambda.answer(problem, form, solver, 0, np.zeros(problem.coils))

        (error, success, _), spread = rows.timed(work)
        reported.append(rows.row(tolerance, len(problem.h), max(error, 0.0) * unit if success else None, spread))
    return reported


def main():
    asked = rows.problem()
    curves, missing = [], []
    for name in compare_lambda.SOLVERS[asked["form"]]:
        if name not in PACKAGES:
            continue  # COBYLA takes minutes
        lacks = rows.lacks(name, "numpy", *PACKAGES[name])
        if lacks:
            missing.append(lacks)
            continue
        version = rows.version(VERSION_OF[name])
        peer = f"{name} (SciPy)" if name == "HiGHS" else name
        curves.append(rows.curve(asked, peer, version, "tolerance", swept(asked, name)))
    rows.answer(curves, missing)


if __name__ == "__main__":
    main()
