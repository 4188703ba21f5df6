#!/usr/bin/env python3
"""Hold the trade-offs of `optimize --for` against random arrays of the same search.

    cargo build --release && python3 scripts/array_front.py target/release/fluxform
    python3 scripts/array_front.py target/release/fluxform --designs 100     # a tenth

Searches bore, outer diameter, length and pitch of the seed's coils without steel, in 2, 3 and 4 rows of three, for
the force constant and for the least error at a given one, over two shapes, and draws as many designs as requested
from the same ranges, whole layers and turns. All are computed alike: 31 by 31 points, forces to 1e-2. A random
design beats a point of a trade-off if it meets every limit but that of the quantity, costs no more of it, and gains
more. Prints a Markdown table: of every quantity the points, the random designs that cost no more than one of them,
and by how much the best of these gains more than the point at most (below zero: none beats any). Standard library
only.
"""
import argparse
import csv
import json
import math
import multiprocessing
import os
import random
import resource
import statistics
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SHAPES = ["flat", "half_sphere"]
COARSE = ["--tolerance", "1e-2"]
RANGES = {
    "coil.inner_diameter_mm": (4.0, 30.0),
    "coil.outer_diameter_mm": (16.0, 38.0),
    "coil.length_mm": (20.0, 100.0),
    "array.pitch_mm": (20.0, 60.0),
}
ROWS = [2, 3, 4]
WIRE_MM = 0.7
LAMBDA = 1.0
# Key of the table: the limit by that name.
QUANTITIES = {"array_mass_kg": "mass of all coils", "array_power_w": "heat of all coils",
              "array_settling_s": "settling in the array", "coils": "number of coils"}
AIMS = {"jnd": [], "error": ["--lambda", str(LAMBDA)]}


def run(program, *arguments):
    done = subprocess.run([program, *arguments, "--format", "json"], capture_output=True, text=True)
    if not done.stdout:
        raise SystemExit(done.stderr)
    return json.loads(done.stdout)


def base():
    """The seed's design without steel, with limits on all that is traded, so that `evaluate` states it."""
    text = (ROOT / "designs/seed_air.toml").read_text()
    more = "array_mass_max_kg = 1000.0\narray_power_max_w = 1e5\narray_settling_max_ms = 100.0"
    return text.replace("[limits]", "[limits]\n" + more + "\n#", 1)


def shapes(folder):
    paths = []
    for name in SHAPES:
        text = (ROOT / f"shapes/{name}.toml").read_text()
        text = text.replace(f'"{name}.stl"', f'"{ROOT}/shapes/{name}.stl"').replace(", 61]", ", 31]")
        path = Path(folder) / f"{name}.toml"
        path.write_text(text)
        paths.append(str(path))
    return paths


def front(program, folder, aim, evaluations):
    """The points of the trade-offs: quantity, value, gain."""
    path, table = Path(folder) / "searched.toml", Path(folder) / f"front_{aim}.csv"
    search = "".join(f"{key} = [{low}, {high}]\n" for key, (low, high) in RANGES.items())
    path.write_text(f"{base()}\n[search]\n{search}array.rows = {ROWS}\n")
    run(program, "optimize", str(path), "--for", *shapes(folder), "--evaluations", str(evaluations), "--constant", aim,
        *AIMS[aim], *COARSE, "--front", str(table))
    with table.open(newline="") as rows:
        return [(row["quantity"], float(row["value"]), float(row["gain"])) for row in csv.DictReader(rows)]


def drawn(seed):
    """A random design of the search: whole layers and turns within the ranges."""
    numbers = random.Random(seed)
    while True:
        bore, outer, length, pitch = (numbers.uniform(*ends) for ends in RANGES.values())
        layers, turns = math.floor((outer - bore) / 2 / WIRE_MM), math.floor(length / WIRE_MM)
        outer = bore + 2 * layers * WIRE_MM
        if layers >= 1 and outer >= RANGES["coil.outer_diameter_mm"][0] and outer <= pitch:
            break
    text = base()
    for given, value in {"inner_diameter_mm = 24.0": bore, "outer_diameter_mm = 38.0": outer,
                         "length_mm = 100.0": turns * WIRE_MM, "turns = 1429": layers * turns,
                         "pitch_mm = 50.0": pitch, "rows = 3": numbers.choice(ROWS)}.items():
        text = text.replace(f"\n{given}\n", f"\n{given.split()[0]} = {value}\n", 1)
    return text


def merits(program, path, paths):
    """Of every shape the force constant, and the inverse of the error at LAMBDA."""
    found = [run(program, "lambda", path, shape, "--at", str(LAMBDA), *COARSE) for shape in paths]
    return [(one["lambda_n_per_m"], one["lambda_n_per_m"] and 1 / one["at"]["rms_error_n"]) for one in found]


def one(job):
    """What a random design costs, its merits, and the limits it breaks."""
    program, seed, folder, paths = job
    path = Path(folder) / f"{seed}.toml"
    path.write_text(drawn(seed) if seed >= 0 else base())
    made = run(program, "evaluate", str(path), *COARSE)
    limits = made["limits"]
    costs = {key: limits[key]["value"] for key in QUANTITIES if key in limits}
    costs["coils"] = len(made["array"]["coils"])
    broken = {key for key, check in limits.items() if not check["met"]}
    return costs, merits(program, str(path), paths), broken


def undominated(points):
    """Without those that another point beats: a front states the best of every number of coils too."""
    return [(v, g) for v, g in points if not any(w <= v and h >= g and (w, h) != (v, g) for w, h in points)]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--designs", type=int, default=1000)
    parser.add_argument("--evaluations", type=int, default=120, help="arrays of each number of coils")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    os.environ["RAYON_NUM_THREADS"] = "1"
    program = str(Path(options.program).resolve())
    with tempfile.TemporaryDirectory() as folder, multiprocessing.Pool(options.processes) as pool:
        paths = shapes(folder)
        fronts, spent = {}, {}
        for aim in AIMS:
            before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            fronts[aim] = front(program, folder, aim, options.evaluations)
            spent[aim] = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        _, given, _ = one((program, -1, folder, paths))
        jobs = [(program, seed, folder, paths) for seed in range(options.designs)]
        designs = pool.map(one, jobs, chunksize=8)
    allowed = {key: sum(not broken - {key} for _, _, broken in designs) for key in QUANTITIES}
    print(f"| objective | traded against | points | random designs of {options.designs} within the other limits "
          "| best of those over the point | CPU s of the search |\n|---|---|---|---|---|---|")
    for index, aim in enumerate(AIMS):
        for key, name in QUANTITIES.items():
            points = undominated([(value, gain) for quantity, value, gain in fronts[aim] if quantity == key])
            over = -1.0
            for costs, merit, broken in designs:
                if broken - {key} or not all(m[index] for m in merit):
                    continue
                ratios = [math.log(m[index] / g[index]) for m, g in zip(merit, given)]
                gain = math.exp(statistics.mean(ratios))
                over = max([over] + [gain / g - 1 for value, g in points if costs[key] <= value * (1 + 1e-9)])
            print(f"| {aim} | {name} | {len(points)} | {allowed[key]} | {100 * over:+.2f} % | {spent[aim]:.0f} |")


if __name__ == "__main__":
    main()
