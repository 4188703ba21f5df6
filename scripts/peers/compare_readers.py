#!/usr/bin/env python3
"""Which surface files fluxform reads, and whether as other readers do: a table for each format.

    python3 scripts/peers/compare_readers.py FOLDER [--fluxform BINARY] [--python PYTHON]

Every surface file below FOLDER (files of equal content once) goes through `discretize --inspect`
and, where PYTHON has them, trimesh, meshio and pymeshlab. A file is right where its area and box
agree with those of a peer to 1e-4 of their size, wrong where every peer that read triangles of it
disagrees, else nobody else read it. Peers keep a file's own units and repeat nothing else.
Prints a Markdown table, then the reasons of refusals with a count and an example of each, then
the files that are wrong.
"""

import argparse
import collections
import hashlib
import json
import re
import subprocess
import sys
from pathlib import Path

PEER = r"""
import json, sys, warnings
warnings.filterwarnings("ignore")
name, path = sys.argv[1:]
import numpy as np
if name == "trimesh":
    import trimesh
    mesh = trimesh.load(path, force="mesh", process=False)
    points, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
elif name == "meshio":
    import meshio
    mesh = meshio.read(path)
    points, faces = mesh.points, []
    for cells in mesh.cells:
        if cells.type in ("triangle", "quad"):
            data = cells.data
            faces.append(data[:, :3])
            if cells.type == "quad":
                faces.append(data[:, [0, 2, 3]])
    faces = np.concatenate(faces)
else:
    import pymeshlab
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(path)
    mesh = meshes.current_mesh()
    points, faces = mesh.vertex_matrix(), mesh.face_matrix()
corners = points[faces]
cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
used = points[np.unique(faces)]
print(json.dumps({"area": float(0.5 * np.linalg.norm(cross, axis=1).sum()),
                  "size": (used.max(0) - used.min(0)).tolist(), "triangles": len(faces)}))
"""
PEERS = ["trimesh", "meshio", "pymeshlab"]
ENDINGS = "stl obj ply off glb 3mf amf 3dxml sldprt sldasm step stp png".split()
PATIENCE_S = 60
SAME = 1e-4


def run(command):
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    except subprocess.TimeoutExpired:
        return None, f"longer than {PATIENCE_S} s"
    if done.returncode != 0:
        lines = (done.stderr or done.stdout).strip().splitlines()
        return None, " ".join(lines)[:400] or f"exit code {done.returncode}"
    try:
        return json.loads(done.stdout), ""
    except json.JSONDecodeError:
        return None, "no JSON"


def ours(binary, path):
    found, why = run([binary, "discretize", path, "--inspect", "--format", "json"])
    if found is None:
        return None, why
    surface = found["surface"]
    size = [b - a for a, b in zip(surface["bounds_min"], surface["bounds_max"])]
    return {"area": surface["area"], "size": size, "triangles": surface["triangles"]}, ""


def agree(mine, other):
    """Boxes in any order of axes: glTF has y upwards."""
    pairs = zip(sorted(mine["size"]), sorted(other["size"]))
    largest = max(max(mine["size"]), 1e-300)
    return (abs(mine["area"] - other["area"]) <= SAME * max(mine["area"], 1e-300)
            and all(abs(a - b) <= SAME * largest for a, b in pairs))


def reason(text):
    """A refusal without names and numbers of its file."""
    text = re.sub(r"^.*?\.\w{2,6}: ", "", text.replace("\n", " "))
    return re.sub(r"`[^`]*`|\d[\d.e+-]*", "_", text)[:90]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--fluxform", default="target/release/fluxform")
    parser.add_argument("--python", default=sys.executable)
    arguments = parser.parse_args()
    seen, files = set(), collections.defaultdict(list)
    for path in sorted(p for p in arguments.folder.rglob("*") if p.is_file()):
        ending = path.suffix[1:].lower()
        if ending in ENDINGS:
            digest = hashlib.sha256(path.read_bytes()).digest()
            if digest not in seen:
                seen.add(digest)
                files[ending].append(str(path))
    there = [peer for peer in PEERS
             if subprocess.run([arguments.python, "-c", f"import {peer}"],
                               capture_output=True).returncode == 0]
    print("| format | files | read | right | wrong | nobody else | refused | "
          + " | ".join(f"{peer} reads" for peer in there) + " |")
    print("|---" * (7 + len(there)) + "|", flush=True)
    reasons, wrong = collections.defaultdict(list), []
    for ending in ENDINGS:
        count = collections.Counter()
        for path in files[ending]:
            mine, why = ours(arguments.fluxform, path)
            others = {}
            for peer in there:
                if not ending.startswith(("sld", "st")) or ending == "stl":
                    found, _ = run([arguments.python, "-c", PEER, peer, path])
                    if found is not None and found["triangles"] > 0 and found["area"] > 0:
                        others[peer] = found
                        count[peer] += 1
            if mine is None:
                count["refused"] += 1
                reasons[ending, reason(why)].append(path + (" *" if others else ""))
            elif not others:
                count["alone"] += 1
            elif any(agree(mine, other) for other in others.values()):
                count["right"] += 1
            else:
                count["wrong"] += 1
                wrong.append((path, mine, others))
        if files[ending]:
            total = len(files[ending])
            row = [total, total - count["refused"], count["right"], count["wrong"],
                   count["alone"], count["refused"]] + [count[peer] for peer in there]
            print(f"| {ending} | " + " | ".join(map(str, row)) + " |", flush=True)
    print("\nRefused (* where a peer read triangles):\n")
    for (ending, why), paths in sorted(reasons.items()):
        stars = sum(path.endswith("*") for path in paths)
        print(f"- {ending}, {len(paths)} ({stars} *): {why} ({Path(paths[0]).name})")
    print("\nWrong:\n")
    for path, mine, others in wrong:
        print(f"- {Path(path).name}: {mine} against {others}")


if __name__ == "__main__":
    main()
