#!/usr/bin/env python3
"""Whether `--error` covers what is true in random scenes.

    python3 scripts/random_scenes.py [PROGRAM] [--scenes 120] [--seed 1] [--verbose]

Each scene is a random array (2 to 4 coils a side; in air, with cores that answer to each other or each to
its own winding; a dipole or a cylinder for a magnet) under a random surface of triangles: smooth, terrain,
kinked (planes), jumping (a step or a block on a base), ending at a rim (a cap). `calibrate --error` is run
at 10, 3 or 1 %, and its claims are held against lambda of a uniform grid by area in a finer field and
against `probe` at random places, as `scripts/error_budget.py` does. Prints by kind of surface how many
claims cover the truth, and the median of claimed over true. Needs numpy.
"""

import argparse
import collections
import math
import os
import pathlib
import random
import tempfile

import numpy as np

from error_budget import Scene, program

KINDS = ["smooth", "terrain", "kinked", "jumping", "rim"]
ERRORS = [0.1, 0.03, 0.01]
# Odd and on no division of a grid that the program chooses.
FINEST = 371
# Of the surface's own mesh along each axis.
NODES = 161


def design_of(n):
    """A random design's text, half its plan and the least height of the magnet over it, mm."""
    side = n.choice([2, 3, 3, 4])
    outer = n.uniform(18, 45)
    inner = outer * n.uniform(0.3, 0.65)
    length = n.uniform(15, 90)
    pitch = outer * n.uniform(1.05, 1.5)
    wire = n.uniform(0.4, 0.9)
    turns = int(0.7 * (outer - inner) / 2 * length / wire**2)
    steel = n.choice(["air", "none", "full"])
    core = ""
    if steel != "air":
        core = f"[core]\nclearance_mm = {n.uniform(0, 0.5):.3f}\nabove_mm = 0.0\nbelow_mm = {n.uniform(0, 10):.3f}\n" \
               f"relative_permeability = {10 ** n.uniform(1, 3.5):.1f}\n"
    coupling = f'coupling = "{steel}"\n' if core else ""
    size = n.uniform(4, 12)
    half = pitch * (side - 1) / 2 + 0.3 * outer
    model = n.choice(["dipole", "dipole", "cylinder"])
    # Of a body the lower face must stay clear of the steel.
    lowest = n.uniform(0.35, 0.7) * pitch + size
    return (
        f'name = "random"\n[coil]\ninner_diameter_mm = {inner:.3f}\nouter_diameter_mm = {outer:.3f}\n'
        f"length_mm = {length:.3f}\nturns = {turns}\n[wire]\ndiameter_mm = {wire:.3f}\n{core}"
        f"[array]\nrows = {side}\ncolumns = {side}\npitch_mm = {pitch:.3f}\n{coupling}"
        f"[magnet]\ndiameter_mm = {size:.3f}\nlength_mm = {size:.3f}\nmagnetization_a_per_m = 1.1e6\n"
        f'polarity = "repel"\nmodel = "{model}"\n'
        f"[supply]\ncurrent_max_a = {n.uniform(0.5, 4):.3f}\nvoltage_v = 36.0\n"
        f"[workspace]\nx_mm = [{-half:.3f}, {half:.3f}, 31]\ny_mm = [{-half:.3f}, {half:.3f}, 31]\n"
        f"z_mm = [{0.8 * lowest:.3f}, {lowest + 60:.3f}, 15]\n",
        half,
        lowest,
        steel,
    )


def heights_of(kind, n, half, lowest):
    """A function of the plan that gives the height over `lowest`, mm; nan beside the surface."""
    waves = [(n.uniform(0.5, 3) / half, n.uniform(0, math.tau), n.uniform(0, math.tau)) for _ in range(4)]
    slope = [n.uniform(-0.15, 0.15) for _ in range(2)]
    angle, at, step = n.uniform(0, math.tau), n.uniform(-0.5, 0.5) * half, n.uniform(2, 12)
    planes = [(n.uniform(-0.5, 0.5), n.uniform(-0.5, 0.5), n.uniform(0, 8)) for _ in range(4)]
    middle = [n.uniform(-0.2, 0.2) * half for _ in range(2)]
    radius = n.uniform(0.5, 0.75) * half
    octaves = [(2.0**k / half, n.uniform(0, math.tau), n.uniform(0, math.tau), n.uniform(0, math.tau)) for k in range(5)]
    cut = n.random() < 0.5

    def smooth(x, y):
        bumps = sum(math.sin(k * x + p) * math.cos(k * y + q) for k, p, q in waves)
        return 8 + slope[0] * x + slope[1] * y + bumps

    def height(x, y):
        beyond = x * math.cos(angle) + y * math.sin(angle) - at
        if kind == "smooth":
            return smooth(x, y)
        if kind == "terrain":
            rough = sum(0.6**i * math.sin(k * (x * math.cos(a) + y * math.sin(a)) + p) * math.cos(k * y + q)
                        for i, (k, a, p, q) in enumerate(octaves))
            return 8 + slope[0] * x + 2.5 * rough
        if kind == "kinked":
            return 12 + min(a * x + b * y + c for a, b, c in planes)
        if kind == "jumping":
            return smooth(x, y) + (step if beyond > 0 else 0)
        x, y = x - middle[0], y - middle[1]
        if cut:
            return smooth(x, y) if beyond < 0 else math.nan
        inside = radius**2 - x * x - y * y
        return math.sqrt(inside) if inside > 0 else math.nan

    return lambda x, y: lowest + max(height(x, y), 0.0) if not math.isnan(height(x, y)) else math.nan


def write_surface(path, height, half):
    """A mesh of `height` over the plan, as OFF, mm; it ends with the cells whose corners all have heights."""
    at = np.linspace(-half, half, NODES)
    z = np.array([[height(x, y) for x in at] for y in at])
    places = [(x, y, value) for y, row in zip(at, z) for x, value in zip(at, row)]
    facets = []
    for j in range(NODES - 1):
        for i in range(NODES - 1):
            if not np.isnan(z[j:j + 2, i:i + 2]).any():
                corner = j * NODES + i
                facets += [(corner, corner + 1, corner + NODES + 1), (corner, corner + NODES + 1, corner + NODES)]
    vertices = "".join("{:.6f} {:.6f} {:.6f}\n".format(*(0.0 if math.isnan(c) else c for c in p)) for p in places)
    path.write_text(f"OFF\n{len(places)} {len(facets)} 0\n{vertices}" + "".join("3 {} {} {}\n".format(*f) for f in facets))


def scene(binary, number, seed, folder):
    """One random scene's kind, steel and result."""
    n = random.Random(f"{seed} {number}")
    kind = KINDS[number % len(KINDS)]
    text, half, lowest, steel = design_of(n)
    (folder / "design.toml").write_text(text)
    write_surface(folder / "surface.off", heights_of(kind, n, half, lowest), half)
    (folder / "shape.toml").write_text(
        f'name = "surface"\nsurface = "surface.off"\nunit = "mm"\n[points]\nx_mm = [{-half:.3f}, {half:.3f}, 61]\n'
        f'y_mm = [{-half:.3f}, {half:.3f}, 61]\noutside = "skip"\n')
    error = n.choice(ERRORS)
    return kind, steel, error, Scene(binary, folder / "design.toml", folder / "shape.toml", folder, FINEST).at_error(error)


def print_table(results):
    print("| surface | scenes | lambda: covered | median ratio | force: covered | median ratio | budget met | median CPU s |")
    print("|---|---|---|---|---|---|---|---|")
    groups = collections.defaultdict(list)
    for kind, _, _, of in results:
        groups[kind].append(of)
        groups["all"].append(of)
    for kind in [*KINDS, "all"]:
        group = groups[kind]
        cells = []
        for part in ["lambda", "force"]:
            ratios = [of[f"{part}_stated"] / max(of[f"{part}_true"], 1e-12) for of in group]
            cells.append(f"{sum(ratio >= 1 for ratio in ratios)} | {np.median(ratios):.1f}")
        print(f"| {kind} | {len(group)} | {cells[0]} | {cells[1]} | {sum(of['met'] for of in group)} | "
              f"{np.median([of['seconds'] for of in group]):.1f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", nargs="?")
    parser.add_argument("--scenes", type=int, default=120)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--verbose", action="store_true")
    asked = parser.parse_args()
    binary = program(asked.program)
    results, refused = [], []
    for number in range(asked.first, asked.first + asked.scenes):
        with tempfile.TemporaryDirectory() as name:
            try:
                results.append(scene(binary, number, asked.seed, pathlib.Path(name)))
            except RuntimeError as error:
                refused.append((number, str(error)))
                if asked.verbose:
                    print(number, "refused:", error, flush=True)
                continue
        if asked.verbose:
            kind, steel, error, of = results[-1]
            print(number, kind, steel, error, {k: float(f"{v:.3g}") for k, v in of.items()}, flush=True)
    print_table(results)
    if refused:
        print(f"\n{len(refused)} scenes were refused:", *{error.splitlines()[0][-200:] for _, error in refused}, sep="\n")


if __name__ == "__main__":
    main()
