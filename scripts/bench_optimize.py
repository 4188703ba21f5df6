#!/usr/bin/env python3
"""fluxform's `optimize` beside NLopt on all problems: CPU time, error, a plot, a table.

    cargo build --release --locked
    python3 scripts/nlopt_reference.py --all --bench    # NLopt's rows of results/bench/nlopt.csv
    python3 scripts/bench_optimize.py                   # fluxform's rows; table; nlopt.svg

NLopt's seconds are those of one solver with all its starts in a process that is already running;
fluxform's are those of the whole process, one thread, certificate left out (`fluxform`) or
included (`fluxform_proven`, air coils only). Both are CPU time. An error is what a solver's best feasible coil
lacks of the reference's force, which is the best of NLopt's own; with a core NLopt reads a table
made beforehand, while fluxform solves for the steel and finds valley and alternatives besides.
A solver fails where that is more than the objective's tolerance.
"""

import argparse
import csv
import json
import math
import pathlib
import resource
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
FOLDER = ROOT / "tests" / "oracles" / "nlopt"
TABLE = ROOT / "results" / "bench" / "nlopt.csv"
OURS = {"fluxform": ["--certificate-cells", "0"], "fluxform_proven": []}
FLOOR = 1e-12  # errors below are drawn here


def measured(command):
    """Standard output and CPU seconds of a process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=600)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    if run.returncode not in (0, 4):
        sys.exit(f"{' '.join(map(str, command))}: {run.stderr}")
    return json.loads(run.stdout), seconds


def our_rows(binary, problems, reference):
    rows = []
    for problem in problems:
        name = problem["name"]
        best = reference[name].get("best")
        for solver, options in OURS.items():
            if problem["cored"] and solver != "fluxform":
                continue  # no proof with steel
            command = [binary, "optimize", FOLDER / problem["design"], "--format", "json"]
            result, seconds = measured([*command, "--threads", "1", *options])
            if best is None:
                continue
            force = abs(result.get("objective", {}).get("force_n", 0.0))
            error = max(0.0, 1 - force / best["force_n"])
            rows.append([name, solver, result["evaluations"], round(seconds, 6), force, error])
    return rows


def ends(rows):
    """The last row of every problem and solver: {problem: {solver: (seconds, error)}}."""
    table = {}
    for row in rows:
        table.setdefault(row["problem"], {})[row["solver"]] = (float(row["cpu_s"]), float(row["relative_error"]))
    return table


def solved(table, reference, name, solver):
    seconds, error = table[name].get(solver, (math.inf, math.inf))
    return seconds if error <= reference[name]["objective_tolerance"] else math.inf


def profile(table, reference, solvers):
    """Dolan and More: {solver: sorted ratios to the fastest solver that solved the problem}."""
    ratios = {solver: [] for solver in solvers}
    for name in table:
        times = {solver: max(solved(table, reference, name, solver), 1e-4) for solver in solvers}
        least = min(times.values())
        for solver in solvers:
            ratios[solver].append(times[solver] / least if math.isfinite(times[solver]) else math.inf)
    return {solver: sorted(values) for solver, values in ratios.items()}


def markdown(table, reference, solvers):
    print("| problem | " + " | ".join(solvers) + " |")
    print("|---|" + "---|" * len(solvers))
    for name in table:
        cells = []
        for solver in solvers:
            if solver not in table[name]:
                cells.append("")
                continue
            seconds, error = table[name][solver]
            word = "" if math.isfinite(solved(table, reference, name, solver)) else ", failed"
            cells.append(f"{seconds:.3g} s, {error:.0e}{word}")
        print(f"| {name} | " + " | ".join(cells) + " |")
    tried = [[name for name in table if s in table[name]] for s in solvers]
    failures = [sum(math.isinf(solved(table, reference, n, s)) for n in names) for s, names in zip(solvers, tried)]
    totals = [sum(table[n].get(s, (0.0, 0.0))[0] for n in table) for s in solvers]
    print("| **failures** | " + " | ".join(f"{f} of {len(names)}" for f, names in zip(failures, tried)) + " |")
    print("| **CPU s in all** | " + " | ".join(f"{t:.3g}" for t in totals) + " |")


def draw(path, table, reference, solvers):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    matplotlib.rcParams["svg.hashsalt"] = "fluxform"
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    marks = dict(zip(solvers, "o^sDv"))
    for solver in solvers:
        known = [table[name][solver] for name in table if solver in table[name]]
        times, errors = zip(*known)
        left.loglog(times, [max(e, FLOOR) for e in errors], marks[solver], label=solver, alpha=0.75, ms=5)
    left.set(xlabel="CPU time, s", ylabel=f"force lacking, relative (below {FLOOR:g} drawn there)")
    left.set_title("Every problem: error against time")
    left.legend()
    everywhere = [solver for solver in solvers if all(solver in table[name] for name in table)]
    for solver, ratios in profile(table, reference, everywhere).items():
        done = [r for r in ratios if math.isfinite(r)]
        shares = [(k + 1) / len(ratios) for k in range(len(done))]
        right.step([1, *done, 1e6], [0, *shares, shares[-1] if shares else 0], where="post", label=solver)
    right.set(xscale="log", xlim=(0.9, 1e5), ylim=(0, 1.02))
    right.set(xlabel="time over the fastest solver's", ylabel="problems solved to the tolerance")
    right.set_title("Dolan-More profile")
    right.legend(loc="lower right")
    for axis in (left, right):
        axis.grid(alpha=0.3)
    figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--binary", type=pathlib.Path, default=ROOT / "target" / "release" / "fluxform")
    parser.add_argument("--table", type=pathlib.Path, default=TABLE)
    parser.add_argument("--plot", type=pathlib.Path, help="SVG or PNG; default beside the table")
    parser.add_argument("--no-run", action="store_true", help="draw and print what the table holds")
    arguments = parser.parse_args()
    problems = json.loads((FOLDER / "problems.json").read_text())["problems"]
    reference = json.loads((FOLDER / "reference.json").read_text())["problems"]
    with open(arguments.table, newline="") as file:
        reader = csv.DictReader(file)
        columns, rows = reader.fieldnames, list(reader)
    if not arguments.no_run:
        rows = [row for row in rows if row["solver"] not in OURS]
        ours = our_rows(arguments.binary, problems, reference)
        rows += [dict(zip(columns, map(str, row))) for row in ours]
        with open(arguments.table, "w", newline="") as file:
            writer = csv.DictWriter(file, columns, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    table = ends(rows)
    solvers = sorted({row["solver"] for row in rows})
    markdown(table, reference, solvers)
    draw(arguments.plot or arguments.table.with_suffix(".svg"), table, reference, solvers)


if __name__ == "__main__":
    main()
