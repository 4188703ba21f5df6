#!/usr/bin/env python3
"""Hold SOLIDWORKS parts and assemblies of a folder against files of the same name beside them.

    pip install cadquery-ocp
    scripts/solidworks_table.py FOLDER PROGRAM [--points 31]

A part with a STEP file of its name: how far points of the upper side of its display mesh lie from the
exact faces, by OpenCASCADE, against the deviation that the program states of that mesh. An
assembly with an STL or STEP file of its name: how far the heights of both lie apart on one grid, each
centred. Files whose boxes differ by more than one part in a hundred hold other states of a
drawing and are counted apart, as are files that the program refuses.
"""

import argparse
import csv
import json
import pathlib
import re
import statistics
import subprocess
import tempfile

from OCP.BRep import BRep_Builder
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.gp import gp_Pnt
from OCP.TopoDS import TopoDS_Compound

from step_table import Exact


def discretized(program, path, points, more):
    """Points in mm and the figures; or why there are none."""
    with tempfile.TemporaryDirectory() as folder:
        table = f"{folder}/points.csv"
        unit = ["--unit", "mm"] if path.suffix.lower() == ".stl" else []
        command = [program, "discretize", str(path), "--grid", f"{points}x{points}", "--certify", "no", "--out",
                   table, "--format", "json", "--quiet", *unit, *more]
        made = subprocess.run(command, capture_output=True, text=True, timeout=600)
        if made.returncode != 0:
            message = re.search(r'"message": ?"(.*?)(?<!\\)"', made.stdout + made.stderr)
            return None, (message.group(1) if message else "")[-90:]
        with open(table, newline="") as file:
            rows = [[1e3 * float(row[k]) for k in ("x_m", "y_m", "height_m")] for row in csv.DictReader(file)]
        return rows, json.loads(made.stdout)


def sides(figures):
    return [1e3 * (b - a) for a, b in zip(figures["bounds_min_m"], figures["bounds_max_m"])]


def alike(mine, other):
    largest = max(sides(mine))
    return all(abs(a - b) <= 0.01 * largest for a, b in zip(sides(mine), sides(other)))


def quantile(values, share):
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


def part(program, path, step, points):
    lift = ["--translate", "0,0,1000000"]
    rows, figures = discretized(program, path, points, lift)
    other, reference = discretized(program, step, 5, lift)
    if rows is None or other is None:
        return ["refused", path.name, figures if rows is None else reference]
    if not alike(figures, reference):
        return ["another state", path.name, ""]
    exact, builder, faces = Exact(step), BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(faces)
    for face in exact.faces:
        builder.Add(faces, face)
    apart = []
    for x, y, lifted in rows:
        point = BRepBuilderAPI_MakeVertex(gp_Pnt(x, y, lifted - 1e6)).Vertex()
        apart.append(BRepExtrema_DistShapeShape(point, faces).Value())
    stated = 1e3 * figures["accuracy"]["tessellation"]["estimate"]
    return ["compared", path.name, quantile(apart, 0.5), quantile(apart, 0.95), max(apart), stated]


def assembly(program, path, other, points):
    seat = ["--center", "--rest-on", "10"]
    mine, figures = discretized(program, path, points, seat)
    theirs, reference = discretized(program, other, points, seat)
    if mine is None or theirs is None:
        return ["refused", path.name, figures if mine is None else reference]
    if not alike(figures, reference):
        return ["another state", path.name, ""]
    x, y = ([figures[f"grid_{axis}_m"][end] for end in ("min_m", "max_m")] if "min_m" in figures["grid_x_m"]
            else [figures[f"grid_{axis}_m"][end] for end in ("from_m", "to_m")] for axis in "xy")
    grid = [f"--x={1e3 * x[0]:.9f},{1e3 * x[1]:.9f}", f"--y={1e3 * y[0]:.9f},{1e3 * y[1]:.9f}"]
    mine, _ = discretized(program, path, points, seat + grid)
    theirs, _ = discretized(program, other, points, seat + grid)
    there = {(round(x, 3), round(y, 3)): z for x, y, z in theirs}
    apart = [abs(z - there[round(x, 3), round(y, 3)]) for x, y, z in mine if (round(x, 3), round(y, 3)) in there]
    stated = 1e3 * figures["accuracy"].get("tessellation", {}).get("estimate", 0.0)
    return ["compared", path.name, quantile(apart, 0.5), quantile(apart, 0.95), max(apart), stated]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("program")
    parser.add_argument("--points", type=int, default=31, help="points along a side")
    arguments = parser.parse_args()
    files = {}
    for path in sorted(p for p in arguments.folder.rglob("*") if p.is_file()):
        files.setdefault(re.sub(r"[^a-z0-9]", "", path.stem.lower()), []).append(path)
    for ending, others, compare in ((".sldprt", (".step", ".stp"), part),
                                    (".sldasm", (".step", ".stp", ".stl"), assembly)):
        found = []
        print(f"\n| {ending} | median, mm | 95 %, mm | most, mm | stated, mm |\n|---|---|---|---|---|")
        for same in files.values():
            beside = [p for p in same if p.suffix.lower() in others]
            for path in (p for p in same if p.suffix.lower() == ending and beside):
                row = compare(arguments.program, path, beside[0], arguments.points)
                found.append(row)
                cells = [f"{c:.4f}" for c in row[2:]] if row[0] == "compared" else [f"{row[0]} {row[2]}", "", "", ""]
                print(f"| {row[1]} | " + " | ".join(cells) + " |", flush=True)
        compared = [row for row in found if row[0] == "compared"]
        if compared:
            middle = [statistics.median(row[k] for row in compared) for k in (2, 3, 4, 5)]
            print(f"| median of {len(compared)} | " + " | ".join(f"{c:.4f}" for c in middle) + " |")
            beyond = sum(row[3] > row[5] for row in compared)
            print(f"\n{len(compared)} of {len(found)} compared, the 95 % beyond what is stated in {beyond}")


if __name__ == "__main__":
    main()
