#!/usr/bin/env python3
"""fluxform's `optimize` beside NLopt on all problems: CPU time, error, a plot, a table.

    cargo build --release --locked
    python3 scripts/nlopt_reference.py --all --bench    # NLopt's rows of results/bench/nlopt.csv
    python3 scripts/bench_optimize.py                   # fluxform's rows; table; nlopt.svg

NLopt's seconds are those of one solver with all its starts in a process that is already running;
fluxform's are those of the whole process, one thread, certificate left out (`fluxform`) or
included (`fluxform_proven`, air coils only). Both are CPU time. An error is what a solver's best feasible coil
lacks of the reference's force, which is the best of NLopt's own; with a core NLopt reads a table
made beforehand, while fluxform solves for the steel and also finds the near-optimal bores and the alternatives.
A solver fails where that is more than the objective's tolerance.

    python3 scripts/bench_optimize.py --random 48 [--before OLD_BINARY]

runs `optimize` and `optimize --wound` on random designs in air and with cores, under any subset of the
limits, of a fixed seed; prints CPU times and forces, beside those of another build where one is named,
then the median, the 90th percentile and the worst of the times and the largest lack of force
against the other build.
"""

import argparse
import csv
import json
import math
import pathlib
import random
import resource
import statistics
import subprocess
import sys
import tempfile

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


def random_design(index):
    """A design in air or, every other one, with a core, under a random subset of the limits."""
    source = random.Random(f"any {index}")

    def log(lo, hi):
        return lo * (hi / lo) ** source.random()

    def number(x):
        return repr(float(f"{x:.6g}"))

    optional = {
        "outer_diameter_max_mm": (18.0, 50.0),
        "length_max_mm": (15.0, 90.0),
        "resistance_max_ohm": (1.0, 15.0),
        "settling_max_ms": (8.0, 120.0),
        "inner_diameter_min_mm": (2.0, 8.0),
        "power_max_w": (2.0, 40.0),
        "mass_max_kg": (0.05, 0.8),
        "wire_length_max_m": (15.0, 150.0),
    }
    cored = index % 2 == 1
    if cored:
        optional["core_field_max_t"] = (0.1, 1.6)
    limits = {key: log(*ends) for key, ends in optional.items() if source.random() < 0.5}
    supply = {"current_max_a": log(0.7, 4.0)}
    if source.random() < 0.3:
        supply["voltage_v"] = log(4.0, 40.0)
    core = {
        "clearance_mm": source.choice([0.0, source.uniform(0.1, 1.0)]),
        "above_mm": source.choice([0.0, 0.0, source.uniform(-4.0, 4.0)]),
        "below_mm": source.choice([0.0, 5.0, 10.0]),
        "relative_permeability": log(20.0, 4000.0),
    }
    magnet = {"diameter_mm": 8.0, "length_mm": 8.0, "magnetization_a_per_m": 1e6}
    sections = {"wire": {"diameter_mm": log(0.2, 1.1)}, "magnet": magnet, "supply": supply}
    sections |= {"core": core} if cored else {}
    sections |= {"target": {"height_mm": log(15.0, 45.0)}, "limits": limits}
    lines = [f'name = "random_{index}"']
    for section, keys in sections.items():
        lines += [f"[{section}]", *(f"{key} = {number(value)}" for key, value in keys.items())]
    return "\n".join(lines) + "\n"


def limited_run(binary, design, options, limit_s):
    """CPU seconds and result of `optimize`; a status `not finished` where the time did not suffice."""
    command = [binary, "optimize", design, *options, "--threads", "1", "--format", "json"]
    limited = ["sh", "-c", f'ulimit -t {limit_s}; exec "$@"', "sh", *map(str, command)]
    start = resource.getrusage(resource.RUSAGE_CHILDREN)
    out = subprocess.run(limited, capture_output=True, text=True).stdout
    end = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = end.ru_utime + end.ru_stime - start.ru_utime - start.ru_stime
    return spent, json.loads(out) if out.strip() else {"status": "not finished"}


def on_random_designs(binary, before, count, limit_s):
    """CPU times and forces of `count` random designs, a line each, and a table of all."""
    seconds, lacks = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        for index in range(count):
            design = pathlib.Path(folder) / f"random_{index}.toml"
            design.write_text(random_design(index))
            for options in ([], ["--wound"]):
                kind = f"{'cored' if index % 2 else 'air'}, {'wound' if options else 'continuous'}"
                row, forces = [design.stem, *options], []
                for program in filter(None, (binary, before)):
                    spent, result = limited_run(program, design, options, limit_s)
                    force = (result.get("objective") or {}).get("force_n")
                    forces.append(force)
                    row += [f"{spent:.2f} s", force or result["status"], (result.get("certificate") or {}).get("kind")]
                    if program is binary:
                        seconds.setdefault(kind, []).append(spent)
                if len(forces) == 2 and all(forces):
                    lacks.setdefault(kind, []).append(1 - forces[0] / forces[1])
                print(*row, sep="\t", flush=True)
    print("| designs | runs | median, CPU s | 90th percentile | worst | force lacking at most |")
    print("|---|---|---|---|---|---|")
    for kind, times in seconds.items():
        nine_tenths = sorted(times)[math.ceil(0.9 * len(times)) - 1]
        lack = f"{max(lacks[kind]):.1e}" if kind in lacks else ""
        print(f"| {kind} | {len(times)} | {statistics.median(times):.2f} | {nine_tenths:.2f} | {max(times):.2f} | {lack} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--binary", type=pathlib.Path, default=ROOT / "target" / "release" / "fluxform")
    parser.add_argument("--table", type=pathlib.Path, default=TABLE)
    parser.add_argument("--plot", type=pathlib.Path, help="SVG or PNG; default beside the table")
    parser.add_argument("--no-run", action="store_true", help="draw and print what the table holds")
    parser.add_argument("--random", type=int, help="this many random designs instead")
    parser.add_argument("--before", type=pathlib.Path, help="another build to compare with on random designs")
    parser.add_argument("--limit", type=int, default=120, help="CPU seconds allowed for one random design")
    arguments = parser.parse_args()
    if arguments.random:
        on_random_designs(arguments.binary, arguments.before, arguments.random, arguments.limit)
        return
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
