#!/usr/bin/env python3
"""Compare `optimize --for` with general optimisers of SciPy, each given the same number of arrays.

    pip install numpy scipy
    cargo build --release && python3 scripts/compare_array_search.py target/release/fluxform

where better.toml is that of designs/better_display.md; --design names another.

Every optimiser varies the lengths of DESIGN's [search] that are ranges (coil, core, pitch), sees the gain
that `lambda` computes for the shapes and the limits that `evaluate` checks, as a penalty, and may compute
as many arrays as `optimize --for` did. Turns are whole for all. Prints median and quartiles of the best
gain within the limits over the seeds, as a table.
"""
import argparse
import json
import math
import statistics
import subprocess
import tempfile
import tomllib
from pathlib import Path

import numpy
from scipy import optimize

PENALTY = 20.0


def run(program, *arguments):
    done = subprocess.run([program, *arguments, "--format", "json"], capture_output=True, text=True)
    return json.loads(done.stdout) if done.stdout else None


class Arrays:
    """Arrays by their variables: gain, excess over limits, and how many were computed."""

    def __init__(self, program, design, shapes, folder):
        self.program, self.shapes, self.folder = program, shapes, folder
        self.design = tomllib.loads(Path(design).read_text())
        search = self.design.pop("search")
        self.keys = [(s, k, v) for s, keys in search.items() for k, v in keys.items() if len(v) == 2]
        self.given = [self.lam(design, shape) for shape in shapes]
        self.restart()

    def restart(self):
        self.count, self.best = 0, 0.0

    def lam(self, design, shape):
        found = run(self.program, "lambda", str(design), shape, "--tolerance", "1e-2")
        return found and found["lambda_n_per_m"]

    def written(self, x):
        design = json.loads(json.dumps(self.design))
        for (section, key, _), value in zip(self.keys, x):
            design[section][key] = float(value)
        coil, wire = design["coil"], design["wire"]["diameter_mm"]
        layers = max(1, math.floor((coil["outer_diameter_mm"] - coil["inner_diameter_mm"]) / 2 / wire + 1e-9))
        turns = max(1, math.floor(coil["length_mm"] / wire + 1e-9))
        coil["outer_diameter_mm"] = coil["inner_diameter_mm"] + 2 * layers * wire
        coil["length_mm"], coil["turns"] = turns * wire, layers * turns
        path = Path(self.folder) / "trial.toml"
        path.write_text(toml(design))
        return path

    def loss(self, u):
        u = numpy.clip(u, 0, 1)
        x = [low + part * (high - low) for part, (_, _, (low, high)) in zip(u, self.keys)]
        self.count += 1
        path = self.written(x)
        checked = run(self.program, "evaluate", str(path), "--tolerance", "1e-2")
        if not checked or "limits" not in checked:
            return PENALTY
        over = max([math.log(c["value"] / c["limit"]) for c in checked["limits"].values()] + [0.0])
        lambdas = [self.lam(path, shape) for shape in self.shapes]
        if any(not value for value in lambdas):
            return PENALTY
        gain = math.exp(statistics.mean(math.log(a / b) for a, b in zip(lambdas, self.given)))
        if over <= 1e-9:
            self.best = max(self.best, gain)
        return -math.log(gain) + PENALTY * over


def toml(table):
    lines = [f"{k} = {json.dumps(v)}" for k, v in table.items() if not isinstance(v, dict)]
    for section, keys in table.items():
        if isinstance(keys, dict):
            lines.append(f"[{section}]")
            lines += [f"{k} = {json.dumps(v)}" for k, v in keys.items()]
    return "\n".join(lines) + "\n"


class Spent(Exception):
    """All arrays that may be computed are."""


def general(arrays, method, seed, most):
    arrays.restart()

    def loss(u):
        if arrays.count >= most:
            raise Spent
        return arrays.loss(u)

    size = len(arrays.keys)
    start = numpy.random.default_rng(seed).random(size)
    try:
        if method == "differential evolution":
            optimize.differential_evolution(loss, [(0, 1)] * size, seed=seed, popsize=5, maxiter=10**6, tol=0)
        else:
            while True:
                optimize.minimize(loss, start, method=method, bounds=[(0, 1)] * size)
                start = numpy.random.default_rng(seed + arrays.count).random(size)
    except Spent:
        pass
    return arrays.best


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--design", default="better.toml")
    parser.add_argument("--shapes", nargs="+", default=["shapes/flat.toml", "shapes/half_sphere.toml"])
    parser.add_argument("--evaluations", type=int, default=80)
    parser.add_argument("--seeds", type=int, default=10)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        arrays = Arrays(options.program, options.design, options.shapes, folder)
        gains, computed = [], []
        for seed in range(1, options.seeds + 1):
            found = run(options.program, "optimize", options.design, "--for", *options.shapes,
                        "--evaluations", str(options.evaluations), "--seed", str(seed))
            gains.append(found["gain"])
            computed.append(found["evaluations"])
        rows = [("optimize --for", gains)]
        most = max(computed)
        for method in ["differential evolution", "Nelder-Mead", "Powell"]:
            rows.append((method, [general(arrays, method, seed, most) for seed in range(1, options.seeds + 1)]))
    print("| optimiser | arrays | lower quartile | median | upper quartile |")
    print("|---|---|---|---|---|")
    for name, values in rows:
        quartiles = numpy.quantile(values, [0.25, 0.5, 0.75])
        print(f"| {name} | {most} | " + " | ".join(f"{q:.4f}" for q in quartiles) + " |")


main()
