#!/usr/bin/env python3
"""NLopt and an independent model of the coil against fluxform's `optimize` (eq. 11).

    pip install -r scripts/nlopt_requirements.txt      # ngsolve only to remake the core's table
    python3 scripts/nlopt_reference.py --self-test     # the model against known numbers
    python3 scripts/nlopt_reference.py --all           # solve all problems, compare with the files
    python3 scripts/nlopt_reference.py --subset ci     # those marked `ci`, or `again`: fewer
    python3 scripts/nlopt_reference.py --all --write   # write the files again
    python3 scripts/nlopt_reference.py --models FILE   # compare fluxform's model, design by design
    python3 scripts/nlopt_reference.py --judge FILE    # judge fluxform's optima
    python3 scripts/nlopt_reference.py --mutants       # wrong models must fail --judge
    python3 scripts/nlopt_reference.py --all --bench [CSV]   # error against evaluations and time

Exit code 0 if all is well, 1 with a message for each fault otherwise.

The problems are tests/oracles/nlopt/problems.json and the designs beside it. A coil is feasible
if it has one layer and one turn at least, positive bore, and meets the design's limits at the
rated current min(I_max, V/R); turns are (OD - ID)/2/d x L/d, not rounded; with `choices_mm` the
wire is one of them. Maximised is |m_z dB_z/dz| I at the target. reference.json holds for every
problem the best coil of three NLopt solvers, limits active there with their sensitivities
(dF/dlimit per SI unit: negative for the least inner diameter), and each solver's end; where no
coil exists the least violation of the limits that is possible (with a core: within the table's
box). Seconds stand in timing.json.

--models FILE: {"designs": [{"inner_diameter_m", "outer_diameter_m", "length_m",
"wire_diameter_m", "current_a", "core": true|false, "force_n", "resistance_ohm", "inductance_h"}]};
optional "name", "conductor_diameter_m", "resistivity_ohm_m", "moment_a_m2", "target_height_m",
defaults the seed's. The sign of force_n is not looked at. The core is that of the table: clearance
0, above 0, below 10 mm, mu_r 1000, target 30 mm; inner diameter 4 to 40, (OD - ID)/2 1.4 to 14,
length 20 to 160 mm. Air: to 1e-10; cored: to twice the table's stated error.

--judge FILE: {"problems": {name: {"status", "inner_diameter_m", "outer_diameter_m", "length_m",
"wire_diameter_m", "force_n"}}}; status "infeasible" needs nothing else, any other word means that
a coil is given; optional "upper_bound_n" and "sensitivity_n_per_unit": {limit: dF/dlimit, zero
where it is not active; judged to 1e-4 of F/limit, cored 1e-3}. Judged are the status, feasibility to 1e-9 in this
model, the force against this model (1e-9; cored: the table's error) and the objective: at least
(1 - objective_tolerance) of the reference's. Where the optimum lies is not judged. Problems may
be left out with --partial or --subset ci.
"""

import argparse
import csv
import json
import os
import pathlib
import sys

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

from nlopt_reference import judge, mutants, selftest, solve

REFERENCE = solve.FOLDER / "reference.json"
TIMING = solve.FOLDER / "timing.json"
BENCH = solve.ROOT / "results" / "bench" / "nlopt.csv"


def text_of(data):
    return json.dumps(data, indent=1) + "\n"


def write_bench(path, answers, reference):
    """A row an improvement of the best feasible force; the last row of a solver is its end."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["problem", "solver", "evaluations", "cpu_s", "force_n", "relative_error"])
        for name, per_solver in answers.items():
            best = reference["problems"][name].get("best")
            if best is None:
                continue
            for solver, answer in per_solver.items():
                end = [answer["result"].get("evaluations"), answer["cpu_s"]]
                steps = answer["steps"]
                steps = steps + ([[*end, steps[-1][2]]] if steps else [])
                for evaluations, cpu_s, force_n in steps:
                    error = max(0.0, 1 - force_n / best["force_n"])
                    rows.writerow([name, solver, evaluations, round(cpu_s, 6), force_n, error])


def regenerate(arguments):
    entries = solve.problem_list(arguments.subset)
    answers = solve.run_all(entries, arguments.jobs)
    fresh, timing = solve.assemble(entries, answers)
    if arguments.bench:
        write_bench(arguments.bench, answers, fresh)
    if arguments.write:
        REFERENCE.write_text(text_of(fresh))
        TIMING.write_text(text_of(timing))
        return []
    committed = json.loads(REFERENCE.read_text())
    faults = solve.differences(fresh, committed)
    if arguments.subset is None:
        same = REFERENCE.read_text() == text_of(fresh)
        print("reference.json:", "the same bytes" if same else "other bytes, within tolerance" if not faults else "differs")
    return faults


def judged(arguments):
    reference = json.loads(REFERENCE.read_text())
    claims = json.loads(arguments.judge.read_text())["problems"]
    entries = solve.problem_list(arguments.subset)
    unknown = sorted(set(claims) - {entry["name"] for entry in solve.problem_list()})
    problems = {entry["name"]: solve.read(entry) for entry in entries}
    faults, remarks = judge.judge(problems, reference, claims, arguments.partial)
    for remark in remarks:
        print("note:", remark)
    print(f"{len(problems)} problems, {len(faults)} with faults")
    messages = [f"{name}: {message}" for name, found in faults.items() for message in found]
    return messages + [f"{name}: no such problem" for name in unknown]


def compared(arguments):
    faults, largest = judge.compare_models(json.loads(arguments.models.read_text()))
    for kind, error in sorted(largest.items()):
        print(f"{kind}: largest relative difference {error:.1e}")
    return faults


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--all", action="store_true", help="solve every problem")
    parser.add_argument("--subset", choices=["ci", "again"], help="solve or judge the marked problems only")
    parser.add_argument("--write", action="store_true", help="write reference.json and timing.json (with --all)")
    parser.add_argument("--bench", nargs="?", const=BENCH, type=pathlib.Path, metavar="CSV")
    parser.add_argument("--models", type=pathlib.Path, metavar="FILE")
    parser.add_argument("--judge", type=pathlib.Path, metavar="FILE")
    parser.add_argument("--partial", action="store_true", help="with --judge: problems may be missing")
    parser.add_argument("--mutants", action="store_true")
    parser.add_argument("--self-test", action="store_true")
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    if arguments.write and not arguments.all:
        parser.error("--write needs --all")
    faults = []
    if arguments.self_test:
        faults += selftest.run()
    if arguments.all or (arguments.subset and not arguments.judge):
        faults += regenerate(arguments)
    if arguments.models:
        faults += compared(arguments)
    if arguments.judge:
        faults += judged(arguments)
    if arguments.mutants:
        faults += mutants.run(json.loads(REFERENCE.read_text()), arguments.jobs)
    for fault in faults:
        print("FAULT", fault, file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
