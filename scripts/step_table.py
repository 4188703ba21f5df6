#!/usr/bin/env python3
"""Count the STEP files of a folder that a fluxform reads right, reads wrong and refuses.

    pip install cadquery-ocp
    scripts/step_table.py FOLDER PROGRAM [PROGRAM...] [--points 21] [--jobs 1] [--seconds 120] [--rows]

A file is right when every height is that of the exact bodies: vertical lines through each point, and
through points around it at most twice as far away as the deviation that the program states, meet the
bodies at heights that enclose it, to that deviation. OpenCASCADE intersects the lines with the exact
faces; no mesh takes part. Where the file repeats bodies that its assembly places, unplaced ones do
not count: the product structure says where each is. Points are taken in a fixed random order until they are through or
`--seconds` of judging are spent; of a file that is called right at least 30 were judged, or all, else
it is `not judged`. Files of equal content count once, files without a solid not at all. The exporter is
what the file's header says. Prints a table for each program; `--rows` also a line for each file.
"""

import argparse
import collections
import concurrent.futures
import csv
import hashlib
import json
import math
import multiprocessing
import pathlib
import random
import re
import subprocess
import tempfile
import time

from OCP.BRep import BRep_Builder
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt
from OCP.IFSelect import IFSelect_RetDone
from OCP.IntCurvesFace import IntCurvesFace_ShapeIntersector
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.STEPControl import STEPControl_Reader
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS_Compound
from OCP.XCAFDoc import XCAFDoc_DocumentTool

SOLIDS = (b"MANIFOLD_SOLID_BREP", b"BREP_WITH_VOIDS", b"FACETED_BREP")
EXPORTERS = [
    ("SOLIDWORKS", "solidworks"),
    ("Autodesk", "autodesk"),
    ("CATIA", "catia"),
    ("Creo", "creo|pro/engineer"),
    ("NX, I-DEAS", r"siemens|unigraphics|\bnx\b|i-deas"),
    ("FreeCAD", "freecad"),
    ("OpenCASCADE", "open cascade"),
]


def exporter(data):
    """Who wrote the file, as its header says."""
    header = data[:8000].decode("latin1").lower()
    found = re.search(r"file_name\s*\((.*?)\)\s*;", header, re.S)
    text = found.group(1) if found else header
    return next((name for name, sign in EXPORTERS if re.search(sign, text)), "others")


def count_solids(shape):
    count, solids = 0, TopExp_Explorer(shape, TopAbs_SOLID)
    while solids.More():
        count += 1
        solids.Next()
    return count


def by_structure(path):
    """The shapes that the file's product structure places; None without one."""
    reader = STEPCAFControl_Reader()
    document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    if reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.Transfer(document):
        return None
    tool = static(XCAFDoc_DocumentTool, "ShapeTool")(document.Main())
    return tool.GetOneShape()


def static(owner, name):
    """A static method under its name of this or of another version of OCP."""
    return getattr(owner, name + "_s", None) or getattr(owner, name)


class Exact:
    """The solids of a file: heights of their faces over points, distances from them; mm."""

    def __init__(self, path):
        reader = STEPControl_Reader()
        if reader.ReadFile(str(path)) != IFSelect_RetDone:
            raise ValueError("OpenCASCADE cannot read it")
        reader.TransferRoots()
        whole, placed = reader.OneShape(), by_structure(path)
        if placed is not None and 0 < count_solids(placed) < count_solids(whole):
            whole = placed
        solids = TopExp_Explorer(whole, TopAbs_SOLID)
        bodies, builder = TopoDS_Compound(), BRep_Builder()
        builder.MakeCompound(bodies)
        while solids.More():
            builder.Add(bodies, solids.Current())
            solids.Next()
        self.faces, faces = [], TopExp_Explorer(bodies, TopAbs_FACE)
        while faces.More():
            self.faces.append(faces.Current())
            faces.Next()
        self.lines = IntCurvesFace_ShapeIntersector()
        self.lines.Load(bodies, 1e-7)

    def height(self, x, y):
        """The highest point over (x, y); None without any."""
        self.lines.Perform(gp_Lin(gp_Pnt(x, y, 0.0), gp_Dir(0.0, 0.0, 1.0)), -1e6, 1e6)
        heights = [self.lines.Pnt(k).Z() for k in range(1, self.lines.NbPnt() + 1)]
        return max(heights, default=None)

    def distance(self, x, y, z):
        """Of a point from the faces."""
        point = BRepBuilderAPI_MakeVertex(gp_Pnt(x, y, z)).Vertex()
        return min(BRepExtrema_DistShapeShape(point, face).Value() for face in self.faces)


def run(program, path, points, folder):
    """The points and figures that a program makes of a file; or why it refuses."""
    table = pathlib.Path(folder) / "points.csv"
    command = [program, "discretize", path, "--grid", f"{points}x{points}", "--translate", "0,0,1000000",
               "--certify", "no", "--out", table, "--format", "json", "--quiet", "--force"]
    try:
        made = subprocess.run([str(part) for part in command], capture_output=True, timeout=900)
    except subprocess.TimeoutExpired:
        return None, "no end after 900 s"
    if made.returncode != 0:
        text = (made.stderr + made.stdout).decode(errors="replace").strip()
        return None, text.splitlines()[-1][:160] if text else f"exit code {made.returncode}"
    with open(table, newline="") as file:
        rows = [[float(row[k]) * 1e3 for k in ("x_m", "y_m", "height_m")] for row in csv.DictReader(file)]
    return rows, json.loads(made.stdout)


def worst(exact, rows, figures, seconds):
    """The most by which a height leaves what the exact bodies allow, the deviation stated, both in mm,
    and how many points were judged."""
    stated = 1e3 * figures["accuracy"].get("tessellation", {}).get("estimate", 0.0)
    most, judged, end = 0.0, 0, time.monotonic() + seconds
    random.Random(1).shuffle(rows)
    for x, y, lifted in rows:
        if time.monotonic() > end:
            break
        judged += 1
        height, met, off, outline = lifted - 1e6, [], float("inf"), False
        for radius in (0.0, 0.05, 0.2, 0.5, 1.0, 1.5, 2.0):
            # The nearest are enough nearly everywhere but at edges.
            for k in range(8 if radius else 1):
                angle, reach = k * math.pi / 4.0, radius * stated + (1e-4 if radius else 0.0)
                at = exact.height(x + reach * math.cos(angle), y + reach * math.sin(angle))
                met += [] if at is None else [at]
                outline = outline or at is None
            if met:
                off = max(0.0, min(met) - height, height - max(met))
            if off <= stated + 1e-3:
                break
        if off > stated and met and outline and height < max(met):
            # Over the outline a line meets some place of a wall: it must be one of the wall's.
            off = min(off, exact.distance(x, y, height))
        most = max(most, off)
    return most, stated, judged


def judge(path, programs, points, seconds):
    """For each program: right, wrong, refused or not judged, the seconds it took, and the figures."""
    exact, found = None, []
    for program in programs:
        with tempfile.TemporaryDirectory() as folder:
            began = time.monotonic()
            rows, figures = run(program, path, points, folder)
            took = time.monotonic() - began
        if rows is None:
            found.append(("refused", took, figures))
            continue
        exact = exact or Exact(path)
        off, stated, judged = worst(exact, rows, figures, seconds)
        enough = judged >= min(30, len(rows))
        verdict = "wrong" if off > stated + 1e-3 else "right" if enough else "not judged"
        detail = f"off by {off:.4f} mm, {stated:.4f} mm stated, {judged} of {len(rows)} points judged"
        found.append((verdict, took, detail))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("programs", nargs="+")
    parser.add_argument("--points", type=int, default=21, help="points along a side")
    parser.add_argument("--jobs", type=int, default=1, help="files at the same time")
    parser.add_argument("--seconds", type=float, default=120.0, help="judging of one file")
    parser.add_argument("--rows", action="store_true", help="a line for each file")
    arguments = parser.parse_args()
    files, seen = [], set()
    for path in sorted(arguments.folder.rglob("*")):
        if path.suffix.lower() in (".step", ".stp") and path.is_file():
            data = path.read_bytes()
            digest = hashlib.sha256(data).digest()
            if any(word in data for word in SOLIDS) and digest not in seen:
                seen.add(digest)
                files.append((path, exporter(data)))
    tables = {program: collections.defaultdict(collections.Counter) for program in arguments.programs}
    # A process for each file: a crash of the judge is that file's alone.
    pools = concurrent.futures.ThreadPoolExecutor(arguments.jobs)

    def one(path):
        spawn = multiprocessing.get_context("spawn")
        with concurrent.futures.ProcessPoolExecutor(1, mp_context=spawn) as pool:
            task = pool.submit(judge, path, arguments.programs, arguments.points, arguments.seconds)
            try:
                return task.result()
            except (concurrent.futures.process.BrokenProcessPool, ValueError) as error:
                return [("not judged", 0.0, f"the judge failed: {error}")] * len(arguments.programs)

    results = pools.map(one, [path for path, _ in files])
    for (path, source), verdicts in zip(files, results):
        for program, (verdict, seconds, detail) in zip(arguments.programs, verdicts):
            tables[program][source][verdict] += 1
            if arguments.rows:
                print(f"{verdict}\t{source}\t{path.name}\t{seconds:.1f} s\t{program}\t{detail}", flush=True)
    kinds = ("right", "wrong", "refused", "not judged")
    for program, table in tables.items():
        print(f"\n{program}\n\n| exporter | files | " + " | ".join(kinds) + " |\n" + "|---" * 6 + "|")
        table["all"] = sum(table.values(), collections.Counter())
        for source, counts in sorted(table.items(), key=lambda item: (item[0] == "all", -item[1].total())):
            cells = [counts[kind] for kind in kinds]
            print(f"| {source} | {counts.total()} | " + " | ".join(map(str, cells)) + " |")


if __name__ == "__main__":
    main()
