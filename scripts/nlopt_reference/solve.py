"""Every solver on every problem, each run in a process of its own, to one reference."""

import concurrent.futures
import json
import math
import os
import pathlib
import subprocess
import sys

import numpy as np
import scipy
import scipy.optimize

from . import core
from .problem import Problem

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDER = ROOT / "tests" / "oracles" / "nlopt"
SOLVERS = ("LD_SLSQP", "LN_COBYLA", "GN_ISRES")
TIMEOUT_S = 300
# glibc gives large arrays back to the system after each use: half of the time otherwise.
KEEP_MEMORY = {"MALLOC_MMAP_THRESHOLD_": "268435456", "MALLOC_TRIM_THRESHOLD_": "268435456"}
ACTIVE = 1e-6
INFEASIBLE = 1e-6
# Of the objective; cored problems add their table's error, doubled as only sampled.
OBJECTIVE_TOLERANCE = 1e-6
TABLE_SAFETY = 2.0


def problem_list(subset=None):
    problems = json.loads((FOLDER / "problems.json").read_text())["problems"]
    return [entry for entry in problems if subset is None or entry.get(subset, False)]


def read(entry):
    return Problem.read(FOLDER / entry["design"])


def run_worker(entry, solver, mutation=None):
    """A worker's answer; a crash or a timeout is an answer too."""
    task = {"design": str(FOLDER / entry["design"]), "solver": solver, "mutation": mutation}
    try:
        done = subprocess.run(
            [sys.executable, "-m", "nlopt_reference.worker"],
            input=json.dumps(task), capture_output=True, text=True,
            timeout=TIMEOUT_S, cwd=ROOT / "scripts", env=os.environ | KEEP_MEMORY,
        )
    except subprocess.TimeoutExpired:
        return {"result": {"status": "timeout", "best": None}, "cpu_s": TIMEOUT_S, "steps": []}
    if done.returncode != 0:
        print(f"{entry['name']}, {solver}: {done.stderr.strip()}", file=sys.stderr)
        return {"result": {"status": "crashed", "best": None}, "cpu_s": 0.0, "steps": []}
    return json.loads(done.stdout)


def run_all(entries, jobs, solvers=SOLVERS):
    """{problem: {solver: answer}}; in the problems' order whatever ends first."""
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        futures = [
            (entry["name"], solver, pool.submit(run_worker, entry, solver))
            for entry in entries
            for solver in solvers
        ]
        answers = {entry["name"]: {} for entry in entries}
        for name, solver, future in futures:
            answers[name][solver] = future.result()
            best = answers[name][solver]["result"]["best"]
            print(f"{name:24} {solver:10} {answers[name][solver]['result']['status']:10}",
                  f"{best['force_n']:.12g} N" if best else "", flush=True)
    return answers


def multipliers(problem, best):
    """What limits are worth at an optimum: {name: (limit, N per unit)}, and the residual.

    Least squares with multipliers >= 0 on the logarithmic gradients of the active constraints.
    """
    inner = best["inner_diameter_m"]
    build = (best["outer_diameter_m"] - inner) / 2
    u = np.log([inner, build, best["length_m"]])
    rows = problem.functions(u, best["regime"])
    slopes = problem.derivatives(u, best["regime"])
    names = problem.names()
    normals = [(name, slopes[1 + k]) for k, name in enumerate(names) if rows[1 + k] > -ACTIVE]
    lo, hi = problem.bounds()
    for k, axis in enumerate(np.eye(3)):
        kind = ("inner_diameter", "layers", "turns_per_layer")[k]
        if u[k] < lo[k] + ACTIVE:
            thin = problem.core is None and k > 0
            normals.append((kind if thin else f"{kind}_lowest", -axis))
        if u[k] > hi[k] - ACTIVE:
            normals.append((f"{kind}_largest", axis))
    if not normals:
        return {}, float(np.linalg.norm(slopes[0]))
    matrix = np.array([normal for _, normal in normals]).T
    weight, residual = scipy.optimize.nnls(matrix, slopes[0])
    found = {}
    for (name, _), multiplier in zip(normals, weight):
        limit = problem.limits.get(name)
        entry = {"log_multiplier": float(multiplier)}
        if limit is not None:
            sign = -1.0 if name == "inner_diameter_m" else 1.0
            entry["limit"] = limit
            entry["sensitivity_n_per_unit"] = sign * float(multiplier) * best["force_n"] / limit
        found[name] = entry
    return found, float(residual)


def artificial(active):
    """Active bounds that the design does not know: the problem or its box is at fault."""
    return [name for name in active if name.endswith(("_largest", "_lowest"))]


def objective_tolerance(problem, active):
    if problem.core is None:
        return OBJECTIVE_TOLERANCE
    settling = active.get("settling_s", {}).get("log_multiplier", 0.0)
    table = problem.core.gradient_error + settling * problem.core.inductance_error
    return OBJECTIVE_TOLERANCE + TABLE_SAFETY * table


def reference(entry, answers):
    """One problem's entry of the reference file."""
    problem = read(entry)
    results = {solver: answer["result"] for solver, answer in answers.items()}
    feasible = [(r["best"]["force_n"], s) for s, r in results.items() if r["best"]]
    out = {"status": "optimal" if feasible else "infeasible"}
    if feasible:
        solver = max(feasible)[1]
        best = dict(results[solver]["best"], solver=solver)
        wound = problem.with_wire(best["wire_diameter_m"])
        active, residual = multipliers(wound, best)
        out["best"] = best
        out["active"] = active
        out["kkt_residual"] = residual
        out["objective_tolerance"] = objective_tolerance(problem, active)
        inner = best["inner_diameter_m"]
        build = (best["outer_diameter_m"] - inner) / 2
        values = wound.values(inner, build, best["length_m"])
        out["values"] = {key: float(np.real(value)) for key, value in values.items()}
        if artificial(active):
            raise ValueError(f"{entry['name']}: bounded by {artificial(active)}, not by its limits")
    else:
        out["least_violation"] = results["LD_SLSQP"].get("least_violation")
        if not (out["least_violation"] or 0.0) > INFEASIBLE:
            raise ValueError(f"{entry['name']}: no coil found, yet not shown infeasible: {results}")
    out["solvers"] = results
    return out


def assemble(entries, answers):
    """The whole reference file and the timing file."""
    import nlopt

    from . import worker

    table = core.CoreTable.load()
    data = {
        "about": "NLopt on eq. 11, see scripts/nlopt_reference.py; seconds stand in timing.json",
        "versions": {"nlopt": nlopt.__version__, "numpy": np.__version__, "scipy": scipy.__version__},
        "seed": worker.SEED,
        "table_error": {"gradient": table.gradient_error, "inductance": table.inductance_error},
        "problems": {entry["name"]: reference(entry, answers[entry["name"]]) for entry in entries},
    }
    timing = {
        name: {solver: round(answer["cpu_s"], 3) for solver, answer in per_solver.items()}
        for name, per_solver in answers.items()
    }
    return data, {"about": "CPU seconds of each solver's process, imports left out", "cpu_s": timing}


def differences(fresh, committed):
    """What a fresh reference says otherwise than the committed one, beyond tolerance."""
    faults = []
    for name, new in fresh["problems"].items():
        old = committed["problems"].get(name)
        if old is None:
            faults.append(f"{name}: not in the committed reference")
            continue
        if new["status"] != old["status"]:
            faults.append(f"{name}: {new['status']}, committed {old['status']}")
            continue
        if new["status"] == "infeasible":
            a, b = new["least_violation"], old["least_violation"]
            if not math.isclose(a, b, rel_tol=1e-6):
                faults.append(f"{name}: least violation {a!r}, committed {b!r}")
            continue
        a, b = new["best"]["force_n"], old["best"]["force_n"]
        if not math.isclose(a, b, rel_tol=1e-8):
            faults.append(f"{name}: {a!r} N, committed {b!r} N")
        for solver, result in new["solvers"].items():
            was = old["solvers"][solver]["status"]
            if result["status"] != was:
                faults.append(f"{name}: {solver} ends {result['status']}, committed {was}")
    return faults
