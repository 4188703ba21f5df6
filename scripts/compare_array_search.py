#!/usr/bin/env python3
"""Compare `optimize --for` with general optimisers, each given as many arrays to compute.

    pip install numpy scipy nlopt cma
    cargo build --release && python3 scripts/compare_array_search.py target/release/fluxform
    python3 scripts/compare_array_search.py target/release/fluxform --short     # two minutes

The peers are Nelder-Mead of SciPy, CMA-ES (cma) and COBYLA of NLopt. They vary what DESIGN's [search]
names but moves of the coils: lengths within their ranges, wires by rounding to one of the list, layers and
turns by rounding down. They see the gain that `lambda` computes for the shapes and the limits that
`evaluate` checks (COBYLA as a constraint, the others as a penalty), start from the given design, again from
random places where they end early, and are charged only for arrays that are not known beforehand to
overlap. What each has found is computed once more at full accuracy. Prints Markdown tables over all seeds:
the best gain within the limits after a quarter, half and all of the arrays (median, lower and upper
quartile), processor time, and with how many times fewer arrays `optimize --for` is where a peer ends.
"""
import argparse
import json
import math
import multiprocessing
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import cma
import nlopt
import numpy
from scipy import optimize

PENALTY = 20.0
COARSE = ["--tolerance", "1e-2"]
SHAPES = ["shapes/flat.toml", "shapes/half_sphere.toml"]


def run(program, *arguments):
    done = subprocess.run([program, *arguments, "--format", "json"], capture_output=True, text=True)
    return json.loads(done.stdout) if done.stdout else {}


def toml(table):
    lines = [f"{k} = {json.dumps(v)}" for k, v in table.items() if not isinstance(v, dict)]
    for section, keys in table.items():
        if isinstance(keys, dict):
            lines.append(f"[{section}]")
            lines += [f"{k} = {json.dumps(v)}" for k, v in keys.items()]
    return "\n".join(lines) + "\n"


def read(path):
    """The design, and what of it is varied: section, key, values."""
    design = tomllib.loads(Path(path).read_text())
    search = design.pop("search")
    search.get("array", {}).pop("move_mm", None)
    limits = design["limits"]
    if "settling_max_ms" in limits:
        limits.setdefault("array_settling_max_ms", limits["settling_max_ms"])
    return design, [(s, k, v) for s, keys in search.items() for k, v in keys.items()]


class Spent(Exception):
    """All arrays that may be computed are."""


class Arrays:
    """Arrays by variables in 0 to 1: loss, excess over limits, and the best of those computed."""

    def __init__(self, program, design, shapes, folder, most):
        self.program, self.shapes, self.most = program, shapes, most
        self.design, self.keys = read(design)
        self.path = str(Path(folder) / "trial.toml")
        self.given = {accuracy: self.lambdas(design, accuracy) for accuracy in ((), tuple(COARSE))}
        self.known, self.best, self.trace, self.asked = {}, (0.0, None), [], 0

    def lambdas(self, path, accuracy):
        found = [run(self.program, "lambda", path, shape, *accuracy) for shape in self.shapes]
        return [one.get("lambda_n_per_m") for one in found]

    def gain(self, path, accuracy):
        now = self.lambdas(path, accuracy)
        if not all(now):
            return None
        ratios = [math.log(a / b) for a, b in zip(now, self.given[tuple(accuracy)])]
        return math.exp(statistics.mean(ratios))

    def start(self):
        def part(section, key, values):
            low, high = min(values), max(values)
            return (self.design.get(section, {}).get(key, low) - low) / (high - low)

        return numpy.clip([part(*key) for key in self.keys], 0.0, 1.0)

    def made(self, u):
        design = json.loads(json.dumps(self.design))
        for part, (section, key, values) in zip(numpy.clip(u, 0, 1), self.keys):
            low, high = min(values), max(values)
            value = float(low + part * (high - low))
            listed = len(values) != 2 or section == "wire"
            design[section][key] = min(values, key=lambda v: abs(v - value)) if listed else value
        coil, wire = design["coil"], design["wire"]["diameter_mm"]
        layers = max(1, math.floor((coil["outer_diameter_mm"] - coil["inner_diameter_mm"]) / 2 / wire + 1e-9))
        turns = max(1, math.floor(coil["length_mm"] / wire + 1e-9))
        coil["outer_diameter_mm"] = coil["inner_diameter_mm"] + 2 * layers * wire
        coil["length_mm"], coil["turns"] = turns * wire, layers * turns
        return design

    def overlap(self, design):
        """How far coils or steel are in each other's way, relative."""
        coil, core = design["coil"], design.get("core")
        over = [coil["outer_diameter_mm"] / design["array"]["pitch_mm"] - 1.0]
        if core:
            over.append(1.0 - coil["inner_diameter_mm"] + 2.0 * core["clearance_mm"])
            over.append(1.0 - coil["length_mm"] - core["above_mm"] - core["below_mm"])
        return max(over)

    def judged(self, u):
        """-ln gain, and the largest excess over a limit."""
        key = tuple(float(x) for x in u)
        if key not in self.known:
            self.known[key] = self.computed(u)
        return self.known[key]

    def computed(self, u):
        self.asked += 1
        if len(self.trace) >= self.most or self.asked > 30 * self.most:
            raise Spent
        design = self.made(u)
        if self.overlap(design) > 0.0:
            return 0.0, 1.0 + self.overlap(design)
        Path(self.path).write_text(toml(design))
        checks = run(self.program, "evaluate", self.path, *COARSE).get("limits")
        gain = self.gain(self.path, COARSE)
        self.trace.append(self.best[0])
        if not checks or gain is None:
            return 0.0, 1.0
        over = max(math.log(check["value"] / check["limit"]) for check in checks.values())
        if over <= 1e-6 and gain > self.best[0]:
            self.best = (gain, design)
            self.trace[-1] = gain
        return -math.log(gain), over

    def loss(self, u):
        loss, over = self.judged(u)
        return loss + PENALTY * max(over, 0.0)

    def corrected(self):
        """The best gain after every array, by what full accuracy adds to the last."""
        gain, design = self.best
        if design is None:
            return self.trace
        Path(self.path).write_text(toml(design))
        full = self.gain(self.path, ())
        return [value * full / gain for value in self.trace]


def nelder_mead(arrays, start, seed):
    bounds = [(0, 1)] * len(start)
    optimize.minimize(arrays.loss, start, method="Nelder-Mead", bounds=bounds, options={"xatol": 1e-3, "fatol": 1e-4})


def cma_es(arrays, start, seed):
    cma.fmin2(arrays.loss, start, 0.2, {"bounds": [0, 1], "seed": seed, "verbose": -9, "tolfun": 1e-4})


def cobyla(arrays, start, seed):
    solver = nlopt.opt(nlopt.LN_COBYLA, len(start))
    solver.set_min_objective(lambda u, _: arrays.judged(u)[0])
    solver.add_inequality_constraint(lambda u, _: arrays.judged(u)[1], 1e-6)
    solver.set_lower_bounds(0.0)
    solver.set_upper_bounds(1.0)
    solver.set_initial_step(0.2)
    solver.set_xtol_abs(1e-3)
    solver.optimize(start)


PEERS = {"Nelder-Mead (SciPy)": nelder_mead, "CMA-ES (cma)": cma_es, "COBYLA (NLopt)": cobyla}
OURS = "optimize --for"


def one(job):
    """The best gain after every array, and processor time, of an optimiser from a seed."""
    name, seed, options = job
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        if name == OURS:
            trace = ours(seed, options, folder)
        else:
            arrays = Arrays(options.program, options.design, options.shapes, folder, options.evaluations)
            random = numpy.random.default_rng(seed)
            start = numpy.clip(arrays.start() + 0.05 * random.standard_normal(len(arrays.keys)), 0, 1)
            try:
                while True:
                    PEERS[name](arrays, start, seed)
                    start = random.random(len(arrays.keys))
            except (Spent, nlopt.ForcedStop):
                trace = arrays.corrected()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{name}, seed {seed}: {trace[-1]:.4f}", file=sys.stderr)
    return name, trace, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def ours(seed, options, folder):
    design, keys = read(options.design)
    search = "".join(f"{section}.{key} = {json.dumps(values)}\n" for section, key, values in keys)
    path = Path(folder) / "searched.toml"
    path.write_text(f"{toml(design)}[search]\n{search}")
    found = run(options.program, "optimize", str(path), "--for", *options.shapes,
                "--evaluations", str(options.evaluations), "--seed", str(seed))
    best, trace = dict((h["evaluations"], h["gain"]) for h in found["history"]), [0.0]
    for count in range(1, options.evaluations + 1):
        trace.append(max(trace[-1], best.get(count, 0.0)))
    return trace[1:]


def quartiles(values):
    low, middle, high = numpy.quantile(values, [0.25, 0.5, 0.75])
    return f"{middle:.4f} ({low:.4f}, {high:.4f})"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--design", default="designs/seed_search.toml")
    parser.add_argument("--shapes", nargs="+", default=SHAPES)
    parser.add_argument("--evaluations", type=int, default=100, help="arrays that each may compute")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--only", nargs="+", choices=[OURS, *PEERS], default=[OURS, *PEERS], help="these rows")
    parser.add_argument("--short", action="store_true", help="two seeds, 40 arrays")
    options = parser.parse_args()
    if options.short:
        options.seeds, options.evaluations = 2, 40
    os.environ["RAYON_NUM_THREADS"] = "1"
    options.program = str(Path(options.program).resolve())
    jobs = [(name, seed, options) for name in options.only for seed in range(1, options.seeds + 1)]
    traces, times = {name: [] for name in options.only}, {name: [] for name in options.only}
    with multiprocessing.Pool(options.processes) as pool:
        for name, trace, seconds in pool.imap(one, jobs):
            traces[name].append(trace + [trace[-1]] * (options.evaluations - len(trace)))
            times[name].append(seconds)
    counts = [options.evaluations // 4, options.evaluations // 2, options.evaluations]
    print(f"| optimiser, {options.seeds} seeds | " + " | ".join(f"gain after {k} arrays" for k in counts) + " | CPU s |")
    print("|---|" + "---|" * (len(counts) + 1))
    for name, all_traces in traces.items():
        cells = [quartiles([trace[k - 1] for trace in all_traces]) for k in counts]
        print(f"| {name} | " + " | ".join(cells) + f" | {statistics.median(times[name]):.0f} |")
    if OURS not in options.only:
        return
    medians = numpy.median(numpy.array(traces[OURS]), axis=0)
    print(f"\n| peer | where its median ends, {OURS} is after |\n|---|---|")
    for name in [name for name in PEERS if name in options.only]:
        end = statistics.median(trace[-1] for trace in traces[name])
        there = [k + 1 for k, value in enumerate(medians) if value >= end]
        fewer = f"{there[0]} arrays, {options.evaluations / there[0]:.1f} times fewer" if there else "not there"
        print(f"| {name} | {fewer} |")


if __name__ == "__main__":
    main()
