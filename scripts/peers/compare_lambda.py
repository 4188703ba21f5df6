#!/usr/bin/env python3
"""fluxform's force constant against general solvers: error and time on the same problems, one run.

    python3 scripts/peers/compare_lambda.py [--python PYTHON] [--problems FILE.json] [--patience S]

Needs Python 3.11 and a way to install scripts/peers/requirements_lambda.txt, which go into a
virtual environment under target/ (or name a PYTHON that has them). The problems, their least errors
and fluxform's own figures come from `cargo bench --locked --bench lambda_error_time -- --json` (or
from FILE.json, what that printed). Solvers get

  mean   min mean (lambda h - G I)^2 over 0 <= I <= u, sum I <= I_t: as a quadratic program
         (Clarabel) or as a smooth function with its exact gradient (SLSQP, COBYLA without it);
  worst  min max |lambda h - G I|, as a linear program (Clarabel, HiGHS) or as the smooth program
         with a bound t on all errors that MATLAB's fminimax solves (SLSQP, COBYLA);

both as stated, in amperes with G'G, and scaled by hand: x = I/u, and for the mean form the points
replaced by the triangular factor of a QR decomposition. The objective is always divided by its
value at I = 0. One lambda begins at I = 0, the curve of 41 at the solution before. Tolerances are
1e-12. What a solver returns is clipped to the limits; its error is the excess over the least one,
relative to that, in extended precision. fluxform's own error along the curve is its duality gap or
proof, a bound. `failed`: an exception, no claim of success, or no answer within the patience, which
the whole curve has too; `false`: success claimed with an error above 1e-4.
Prints Markdown tables. One thread.
"""

import argparse
import json
import multiprocessing
import os
import platform
import subprocess
import sys
import time
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
# An environment of the script's own.
INSIDE = "FLUXFORM_COMPARE_LAMBDA_INSIDE"
REPEATS = 3
TOLERANCE = 1e-12
MOST_STEPS = 100_000
FALSE = 1e-4
BENCH = ["cargo", "bench", "--locked", "--bench", "lambda_error_time", "--", "--json"]


def peer_python():
    """The interpreter of a virtual environment with the peers."""
    folder = ROOT / "target" / "peers-lambda"
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if not python.exists():
        venv.create(folder, with_pip=True)
    pip = [python, "-m", "pip", "install", "-q", "-r", HERE / "requirements_lambda.txt"]
    subprocess.run(pip, check=True)
    return str(python)


class Problem:
    """One problem in one of its two statements; x are the solvers' variables."""

    def __init__(self, reported, scaled):
        import numpy as np

        self.reported = reported
        self.coils = reported["coils"]
        self.g = np.array(reported["forces_n_per_a"]).reshape(-1, self.coils)
        self.h = np.array(reported["height_m"])
        self.u = np.array(reported["upper_a"])
        self.total = reported["total_max_a"]
        self.unit = self.u.copy() if scaled else np.ones(self.coils)
        self.a = self.g * self.unit
        self.upper = self.u / self.unit
        self.b, self.c = self.a, self.h
        if scaled:
            both = np.linalg.qr(np.column_stack([self.a, self.h]), mode="r")
            self.b, self.c = both[:, :-1], both[:, -1]
        self.height = np.abs(self.h).max()
        self.square = float(self.c @ self.c)

    def currents(self, x):
        """Within the limits, A."""
        import numpy as np

        i = np.clip(np.nan_to_num(np.asarray(x, float)) * self.unit, 0, self.u)
        if self.total is not None and i.sum() > self.total:
            i *= self.total / i.sum()
        return i

    def error(self, form, k, x):
        """Relative excess over the least error at the k-th lambda."""
        import numpy as np

        long = np.longdouble
        i = self.currents(x).astype(long)
        rest = long(self.reported["lambda_n_per_m"][k]) * self.h.astype(long) - self.g.astype(long) @ i
        if form == "mean":
            least = self.reported["least_mean_square_n2"][k]
            return float((rest @ rest / len(rest) - least) / least)
        least = self.reported["least_worst_n"][k]
        return float((np.abs(rest).max() - least) / least)

    def sum_row(self):
        """Coefficients of the sum and its limit, over the limit."""
        return None if self.total is None else self.unit / self.total


def clarabel_mean(p, at, x0):
    """min 1/2 x'Px + q'x, as stated; scaled by the residuals' own variables."""
    import clarabel
    import numpy as np
    from scipy import sparse

    n, scale = p.coils, at * at * p.square
    if p.b is p.a:
        square = sparse.triu(sparse.csc_matrix(2 * p.b.T @ p.b / scale), format="csc")
        linear = -2 * at * p.b.T @ p.c / scale
        more = 0
        rows, right, cones = [], [], []
    else:
        more = len(p.c)
        size = at * p.square**0.5
        square = sparse.diags([0.0] * n + [2.0] * more, format="csc")
        linear = np.zeros(n + more)
        rows = [sparse.hstack([sparse.csc_matrix(p.b / size), sparse.identity(more)])]
        right, cones = [at * p.c / size], [clarabel.ZeroConeT(more)]
    none = sparse.csc_matrix((n, more))
    rows += [sparse.hstack([m, none]) for m in (sparse.identity(n), -sparse.identity(n))]
    right += [p.upper, np.zeros(n)]
    if p.total is not None:
        rows.append(sparse.csc_matrix(np.append(p.sum_row(), np.zeros(more))[None, :]))
        right.append([1.0])
    right = np.concatenate(right)
    cones.append(clarabel.NonnegativeConeT(len(right) - more))
    return clarabel_run(square, linear, sparse.vstack(rows, format="csc"), right, cones, n)


def clarabel_run(square, linear, rows, right, cones, n):
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    for name in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
        setattr(settings, name, TOLERANCE)
    found = clarabel.DefaultSolver(square, linear, rows, right, cones, settings).solve()
    return found.x[:n], str(found.status) == "Solved"


def epigraph(p, at):
    """Rows of A [x, t] <= b: every error over lambda max h between -t and t, and the sum."""
    import numpy as np

    a = p.a / (at * p.height)
    wanted = p.h / p.height
    ones = np.ones((len(wanted), 1))
    rows = [np.hstack([a, -ones]), np.hstack([-a, -ones])]
    right = [wanted, -wanted]
    if p.total is not None:
        rows.append(np.append(p.sum_row(), 0.0)[None, :])
        right.append([1.0])
    return np.vstack(rows), np.concatenate(right)


def clarabel_worst(p, at, x0):
    import clarabel
    import numpy as np
    from scipy import sparse

    rows, right = epigraph(p, at)
    n = p.coils
    one = np.hstack([np.identity(n), np.zeros((n, 1))])
    rows = sparse.csc_matrix(np.vstack([rows, one, -one]))
    right = np.concatenate([right, p.upper, np.zeros(n)])
    linear = np.append(np.zeros(n), 1.0)
    square = sparse.csc_matrix((n + 1, n + 1))
    cones = [clarabel.NonnegativeConeT(len(right))]
    return clarabel_run(square, linear, rows, right, cones, n)


def highs_worst(p, at, x0):
    import numpy as np
    from scipy.optimize import linprog

    rows, right = epigraph(p, at)
    bounds = [(0, upper) for upper in p.upper] + [(0, None)]
    options = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    found = linprog(np.append(np.zeros(p.coils), 1.0), A_ub=rows, b_ub=right, bounds=bounds,
                    method="highs", options=options)
    x = np.zeros(p.coils) if found.x is None else found.x[:-1]
    return x, found.status == 0


def smooth(p, at):
    """The mean form's value and gradient."""
    def value(x):
        rest = at * p.c - p.b @ x
        scale = at * at * p.square
        return float(rest @ rest) / scale, -2 * (p.b.T @ rest) / scale
    return value


def scipy_mean(p, at, x0):
    import numpy as np
    from scipy.optimize import LinearConstraint, minimize

    limits = [] if p.total is None else [LinearConstraint(p.sum_row()[None, :], -np.inf, 1.0)]
    found = minimize(smooth(p, at), x0, jac=True, method="SLSQP", constraints=limits,
                     bounds=[(0, upper) for upper in p.upper],
                     options={"ftol": TOLERANCE, "maxiter": MOST_STEPS})
    return found.x, bool(found.success)


def start(p, at, x0):
    """x0 and the worst error there."""
    import numpy as np

    return np.append(x0, np.abs(p.h / p.height - p.a @ x0 / (at * p.height)).max())


def scipy_worst(p, at, x0):
    import numpy as np
    from scipy.optimize import minimize

    rows, right = epigraph(p, at)
    limits = {"type": "ineq", "fun": lambda z: right - rows @ z, "jac": lambda z: -rows}
    slope = np.append(np.zeros(p.coils), 1.0)
    found = minimize(lambda z: (z[-1], slope), start(p, at, x0), jac=True, method="SLSQP",
                     constraints=[limits], bounds=[(0, u) for u in p.upper] + [(0, None)],
                     options={"ftol": TOLERANCE, "maxiter": MOST_STEPS})
    return found.x[:-1], bool(found.success)


def nlopt_run(algorithm, upper, value, rows, right, x0):
    import nlopt
    import numpy as np

    solver = nlopt.opt(getattr(nlopt, algorithm), len(upper))
    solver.set_lower_bounds(np.zeros(len(upper)))
    solver.set_upper_bounds(upper)
    solver.set_ftol_rel(TOLERANCE)
    solver.set_xtol_rel(TOLERANCE)
    solver.set_maxeval(MOST_STEPS)

    def objective(x, slope):
        at, gradient = value(x)
        if slope.size:
            slope[:] = gradient
        return at

    def limits(result, x, slope):
        result[:] = rows @ x - right
        if slope.size:
            slope[:] = rows

    solver.set_min_objective(objective)
    if len(right):
        solver.add_inequality_mconstraint(limits, np.full(len(right), TOLERANCE))
    x = solver.optimize(np.minimum(x0, upper))
    success = solver.last_optimize_result() in (
        nlopt.SUCCESS, nlopt.FTOL_REACHED, nlopt.XTOL_REACHED, nlopt.STOPVAL_REACHED)
    return x, success


def nlopt_mean(algorithm):
    def solve(p, at, x0):
        import numpy as np

        rows = np.empty((0, p.coils)) if p.total is None else p.sum_row()[None, :]
        return nlopt_run(algorithm, p.upper, smooth(p, at), rows, np.ones(len(rows)), x0)
    return solve


def nlopt_worst(algorithm):
    def solve(p, at, x0):
        import numpy as np

        rows, right = epigraph(p, at)
        slope = np.append(np.zeros(p.coils), 1.0)
        x, success = nlopt_run(algorithm, np.append(p.upper, np.inf), lambda z: (z[-1], slope),
                               rows, right, start(p, at, x0))
        return x[:-1], success
    return solve


SOLVERS = {
    "mean": {"Clarabel": clarabel_mean, "SciPy SLSQP": scipy_mean,
             "NLopt SLSQP": nlopt_mean("LD_SLSQP"), "NLopt COBYLA": nlopt_mean("LN_COBYLA")},
    "worst": {"Clarabel": clarabel_worst, "HiGHS": highs_worst, "SciPy SLSQP": scipy_worst,
              "NLopt SLSQP": nlopt_worst("LD_SLSQP"), "NLopt COBYLA": nlopt_worst("LN_COBYLA")},
}


def answer(p, form, solver, k, x0):
    """Error, claim of success and where it ended; an exception is a failure at I = 0."""
    import numpy as np

    try:
        x, success = solver(p, p.reported["lambda_n_per_m"][k], x0)
        ended = p.currents(x) / np.where(p.unit > 0, p.unit, 1)
        return p.error(form, k, x), success, ended
    except Exception:  # noqa: BLE001 - whatever a peer raises is its failure
        return p.error(form, k, np.zeros(p.coils)), False, np.zeros(p.coils)


def child(pipe, reported, scaled, form, name):
    """Answers for one lambda, then for the curve, as far as there is time."""
    import numpy as np

    p, solver = Problem(reported, scaled), SOLVERS[form][name]
    answer(p, form, solver, reported["one"], np.zeros(p.coils))
    pipe.send(None)
    seconds = []
    for _ in range(REPEATS):
        begun = time.perf_counter()
        error, success, _ = answer(p, form, solver, reported["one"], np.zeros(p.coils))
        seconds.append(time.perf_counter() - begun)
    pipe.send([[(error, success)], sorted(seconds)[REPEATS // 2]])
    begun, found, x0 = time.perf_counter(), [], np.zeros(p.coils)
    for k in range(len(reported["lambda_n_per_m"])):
        error, success, x0 = answer(p, form, solver, k, x0)
        found.append((error, success))
    pipe.send([found, time.perf_counter() - begun])


def tried(reported, scaled, form, name, patience):
    """[one lambda, the curve]: their answers and seconds, None where there was no answer."""
    ours, theirs = multiprocessing.Pipe(duplex=False)
    process = multiprocessing.Process(target=child, args=(theirs, reported, scaled, form, name))
    process.start()
    theirs.close()
    results = []
    # The first word is that it began and answered once.
    for allowed in (patience + 20, REPEATS * patience, patience):
        try:
            results.append(ours.recv() if ours.poll(allowed) else None)
        except EOFError:
            results.append(None)
        if results[-1] is None and len(results) != 1:
            break
        if len(results) == 1 and not process.is_alive() and results[0] is None:
            break
    process.kill()
    process.join()
    results = results[1:] + [None, None]
    return results[:2]


def digits(value):
    return "none" if value is None else f"{value:.0e}" if value > 1e-16 else "0"


def milliseconds(value):
    return "none" if value is None else f"{value * 1e3:.3g}"


def median(values):
    values = sorted(v for v in values if v is not None)
    return values[len(values) // 2] if values else None


def summary(form, rows):
    """One line a solver: the worst over all problems, the middle of the times."""
    print(f"\n{form} form, all problems together\n")
    print("| solver | worst error, one lambda | failed | false | median ms "
          "| worst error, 41 lambdas | failed | false | median ms |")
    print("|---|" + "---|" * 8)
    for label, results in rows.items():
        cells = [label]
        for which in (0, 1):
            count = 1 if which == 0 else 41
            got = [r[which] for r in results]
            answers = [a for r in got if r for a in r[0]]
            failed = sum(not good for _, good in answers) + count * got.count(None)
            wrong = sum(good and error > FALSE for error, good in answers)
            worst = max((error for error, _ in answers), default=None)
            of = count * len(got)
            cells += [digits(worst), f"{failed}/{of}", f"{wrong}/{of}",
                      milliseconds(median([r[1] if r else None for r in got]))]
        print("| " + " | ".join(cells) + " |")


def by_problem(form, problems, rows):
    print(f"\n{form} form, one lambda: relative error (ms)\n")
    print("| solver | " + " | ".join(p["name"] for p in problems) + " |")
    print("|---|" + "---|" * len(problems))
    for label, results in rows.items():
        cells = []
        for one, _ in results:
            if one is None:
                cells.append("no answer")
                continue
            (error, good), seconds = one[0][0], one[1]
            mark = "" if good else ", failed"
            cells.append(f"{digits(error)} ({milliseconds(seconds)}{mark})")
        print(f"| {label} | " + " | ".join(cells) + " |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--python")
    parser.add_argument("--problems", type=Path)
    parser.add_argument("--patience", type=float, default=5.0)
    options = parser.parse_args()
    if INSIDE not in os.environ:
        python = options.python or peer_python()
        threads = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
        ran = subprocess.run([python, *sys.argv], env={**os.environ, **threads, INSIDE: "1"})
        sys.exit(ran.returncode)
    if options.problems:
        text = options.problems.read_text(encoding="utf-8")
    else:
        text = subprocess.run(BENCH, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    problems = json.loads(text)["problems"]
    import clarabel
    import nlopt
    import numpy
    import scipy

    versions = f"Clarabel {clarabel.__version__}, NLopt {nlopt.__version__}, SciPy {scipy.__version__}"
    print(f"{versions}, numpy {numpy.__version__}, Python {platform.python_version()}, "
          f"{platform.machine()}; patience {options.patience:g} s")
    for form, solvers in SOLVERS.items():
        ours = [p["ours"][form] for p in problems]
        count = len(problems[0]["lambda_n_per_m"])
        rows = {"fluxform": [
            [[[(o["one_error"], True)], o["one_s"]], [[(o["curve_error"], True)] * count, o["curve_s"]]]
            for o in ours]}
        for name in solvers:
            for scaled in (False, True):
                label = f"{name}, {'scaled' if scaled else 'as stated'}"
                rows[label] = [tried(p, scaled, form, name, options.patience) for p in problems]
                print(f"{form}: {label}", file=sys.stderr, flush=True)
        summary(form, rows)
        by_problem(form, problems, rows)


if __name__ == "__main__":
    main()
