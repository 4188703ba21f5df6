"""One NLopt solver on one problem, in a process of its own: reads a task, writes a result (JSON).

    echo TASK | python3 -m nlopt_reference.worker

TASK: design (path), solver, and optionally `mutation` (keywords of problem.Mutation). NLopt can
end its process when a function returns a not-a-number; `solve.py` starts this file with a timeout.
"""

import json
import os
import sys
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import nlopt
import numpy as np

from .problem import Mutation, Problem

SEED = 20260802
# Starts and most evaluations a start, for each regime and wire. ISRES starts once.
STARTS = {"LD_SLSQP": 8, "LN_COBYLA": 3, "GN_ISRES": 1}
MAX_EVALUATIONS = {"LD_SLSQP": 300, "LN_COBYLA": 1500, "GN_ISRES": 6000}
# Constraints are logarithms of ratios: relative tolerances.
CONSTRAINT_TOLERANCE = {"LD_SLSQP": 1e-12, "LN_COBYLA": 1e-10, "GN_ISRES": 1e-10}
X_TOLERANCE = {"LD_SLSQP": 1e-13, "LN_COBYLA": 1e-10, "GN_ISRES": 1e-10}
FEASIBLE = 1e-10


class Counted:
    """Functions of one regime with a memory of the last point, and the best feasible value."""

    def __init__(self, problem, regime, trace):
        self.problem, self.regime, self.trace = problem, regime, trace
        self.u = self.rows = self.slopes_u = self.slopes = None

    def values(self, u):
        if self.u is None or not np.array_equal(u, self.u):
            self.u = u.copy()
            self.rows = self.problem.functions(self.u, self.regime)
            self.trace.count(self.rows)
        return self.rows

    def derivatives(self, u):
        if self.slopes_u is None or not np.array_equal(u, self.slopes_u):
            self.slopes_u = u.copy()
            self.slopes = self.problem.derivatives(self.slopes_u, self.regime)
            self.trace.gradients += 1
        return self.slopes


class Trace:
    """Evaluations, and every improvement of the best feasible force with when it came."""

    def __init__(self):
        self.evaluations = self.gradients = 0
        self.best = 0.0
        self.start = time.process_time()
        self.steps = []

    def count(self, rows):
        self.evaluations += 1
        if all(row <= FEASIBLE for row in rows[1:]):
            force = float(np.exp(rows[0]))
            if force > self.best:
                self.best = force
                self.steps.append([self.evaluations, time.process_time() - self.start, force])


def starting_points(problem, count):
    rng = np.random.default_rng(SEED)
    lo, hi = problem.sampling()
    own_lo, own_hi = problem.bounds()
    first = np.clip(np.log(problem.start_m), own_lo, own_hi)
    return [first, *(lo + (hi - lo) * rng.random((count - 1, 3)))]


def configured(name, size, lo, hi):
    nlopt.srand(SEED)
    solver = nlopt.opt(getattr(nlopt, name), size)
    solver.set_lower_bounds(lo)
    solver.set_upper_bounds(hi)
    solver.set_maxeval(MAX_EVALUATIONS[name])
    solver.set_xtol_rel(0.0)
    solver.set_xtol_abs(X_TOLERANCE[name])
    return solver


def optimised(solver, start):
    """NLopt's end point and return code; its exceptions are codes too."""
    try:
        return solver.optimize(start), solver.last_optimize_result()
    except nlopt.RoundoffLimited:
        return None, nlopt.ROUNDOFF_LIMITED
    except (RuntimeError, ValueError, nlopt.runtime_error, nlopt.invalid_argument):
        return None, nlopt.FAILURE


def maximise(name, counted, start):
    """Force from one start: end point (or the last seen) and NLopt's code."""
    problem = counted.problem
    # The part of the bounds that the limits on sizes leave spares the evolution its first steps.
    box = problem.sampling() if name == "GN_ISRES" else problem.bounds()
    solver = configured(name, 3, *box)

    def objective(u, slopes):
        if slopes.size:
            slopes[:] = -counted.derivatives(u)[0]
        return -counted.values(u)[0]

    def constraints(result, u, slopes):
        if slopes.size:
            slopes[:] = counted.derivatives(u)[1:]
        result[:] = counted.values(u)[1:]

    solver.set_min_objective(objective)
    count = len(problem.names())
    if count:
        solver.add_inequality_mconstraint(constraints, np.full(count, CONSTRAINT_TOLERANCE[name]))
    end, code = optimised(solver, start)
    return (counted.u if end is None else end), code


def least_violation(counted, start):
    """min t, every constraint <= t, from one start, by SLSQP: the least logarithmic violation."""
    problem = counted.problem
    lo, hi = problem.bounds()
    solver = configured("LD_SLSQP", 4, [*lo, -50.0], [*hi, 50.0])

    def objective(v, slopes):
        if slopes.size:
            slopes[:] = [0.0, 0.0, 0.0, 1.0]
        return v[3]

    def constraints(result, v, slopes):
        if slopes.size:
            slopes[:, :3] = counted.derivatives(v[:3])[1:]
            slopes[:, 3] = -1.0
        result[:] = counted.values(v[:3])[1:] - v[3]

    solver.set_min_objective(objective)
    solver.add_inequality_mconstraint(constraints, np.full(len(problem.names()), 1e-12))
    worst = max(counted.values(np.array(start))[1:])
    end, code = optimised(solver, [*start, worst])
    u = counted.u if end is None else end[:3]
    return u, code, float(max(counted.values(np.array(u))[1:]))


def run(task):
    mutation = task.get("mutation") or {}
    base = Problem.read(task["design"]).mutated(Mutation(**mutation))
    name = task["solver"]
    trace = Trace()
    best = violation = None
    codes = []
    for problem in base.wires():
        for regime in problem.regimes():
            counted = Counted(problem, regime, trace)
            for start in starting_points(problem, STARTS[name]):
                if name == "GN_ISRES":
                    start = np.clip(start, *problem.sampling())
                u, code = maximise(name, counted, start)
                codes.append(code)
                rows = problem.functions(u, regime)
                if not (np.all(np.isfinite(rows)) and all(row <= FEASIBLE for row in rows[1:])):
                    continue
                if best is None or rows[0] > best["log_force"]:
                    best = describe(problem, regime, u, rows)
    if best is None and name == "LD_SLSQP":
        for problem in base.wires():
            for regime in problem.regimes():
                counted = Counted(problem, regime, trace)
                for start in starting_points(problem, 4):
                    _, _, worst = least_violation(counted, start)
                    violation = worst if violation is None else min(worst, violation)
    if best is not None:
        del best["log_force"]
    result = {
        "status": "found" if best else "none",
        "nlopt_codes": sorted(set(codes)),
        "starts": len(codes),
        "evaluations": trace.evaluations,
        "gradients": trace.gradients,
        "best": best,
    }
    if violation is not None:
        result["least_violation"] = float(np.expm1(violation))
    return {"result": result, "cpu_s": time.process_time() - trace.start, "steps": trace.steps}


def describe(problem, regime, u, rows):
    inner, build, length = map(float, np.exp(u))
    return {
        "log_force": float(rows[0]),
        "force_n": float(np.exp(rows[0])),
        "inner_diameter_m": inner,
        "outer_diameter_m": inner + 2 * build,
        "length_m": length,
        "wire_diameter_m": problem.wire_m,
        "regime": regime,
        "max_violation": float(max(np.expm1(rows[1:]), default=0.0)),
    }


if __name__ == "__main__":
    json.dump(run(json.load(sys.stdin)), sys.stdout)
