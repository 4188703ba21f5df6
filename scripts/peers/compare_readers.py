#!/usr/bin/env python3
"""Which surface files fluxform and other readers read right: a table for each format.

    pip install -r scripts/peers/requirements_readers.txt
    python3 scripts/peers/compare_readers.py FOLDER [--fluxform BINARY] [--python PYTHON] [--rows]

Every surface file below FOLDER (files of equal content once) goes through `discretize --inspect` and
through the peers of its format that PYTHON has; OpenSCAD reads AMF where it is installed. What two
readers at least agree on, in area and box to 1e-4 of their size, is the truth, of several the one that
most agree on. A reader is right where it agrees, wrong where it does not, and refuses where it
finds no triangle. Where no two agree a file counts under `no truth`, with how many of these fluxform
reads; where nobody finds a triangle (points, empty or broken files) under `no surface`. Peers are
given the file's own units. Prints a Markdown table, then fluxform's refusals by reason with an
example of each (* where the truth is known), then the files that it reads wrong.
"""

import argparse
import collections
import hashlib
import json
import re
import select
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

PEER = r"""
import json, os, sys, warnings
warnings.filterwarnings("ignore")
out = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
name = sys.argv[1]
import numpy as np
if name == "trimesh":
    import trimesh
    def read(path):
        mesh = trimesh.load(path, force="mesh", process=False)
        return np.asarray(mesh.vertices), np.asarray(mesh.faces)
elif name == "meshio":
    import meshio
    def read(path):
        mesh = meshio.read(path)
        faces = []
        for cells in mesh.cells:
            if cells.type in ("triangle", "quad"):
                faces.append(cells.data[:, :3])
                if cells.type == "quad":
                    faces.append(cells.data[:, [0, 2, 3]])
        return np.asarray(mesh.points, float), np.concatenate(faces)
elif name == "open3d":
    import open3d
    open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
    def read(path):
        mesh = open3d.io.read_triangle_mesh(path)
        return np.asarray(mesh.vertices), np.asarray(mesh.triangles)
elif name == "lib3mf":
    import lib3mf
    wrapper = lib3mf.get_wrapper()
    def read(path):
        model = wrapper.CreateModel()
        model.QueryReader("3mf").ReadFromFile(path)
        points, faces, count = [], [], 0
        def place(item, known):
            f = item.GetTransform().Fields if hasattr(item, "GetTransform") else item.GetObjectTransform().Fields
            rows = np.array([[f[i][k] for k in range(3)] for i in range(4)])
            return [rows] + known
        def add(obj, moves):
            nonlocal count
            if obj.IsComponentsObject():
                for k in range(obj.GetComponentCount()):
                    component = obj.GetComponent(k)
                    add(component.GetObjectResource(), place(component, moves))
                return
            own = np.array([v.Coordinates[:] for v in obj.GetVertices()], float).reshape(-1, 3)
            for rows in moves:
                own = own @ rows[:3] + rows[3]
            points.append(own)
            faces.append(np.array([t.Indices[:] for t in obj.GetTriangleIndices()], int).reshape(-1, 3) + count)
            count += len(own)
        items = model.GetBuildItems()
        while items.MoveNext():
            item = items.GetCurrent()
            add(item.GetObjectResource(), place(item, []))
        return np.concatenate(points), np.concatenate(faces)
else:
    import pymeshlab
    def read(path):
        meshes = pymeshlab.MeshSet()
        meshes.load_new_mesh(path)
        points, faces, count = [], [], 0
        for k in range(meshes.mesh_number()):
            mesh = meshes.mesh(k)
            points.append(mesh.vertex_matrix())
            faces.append(mesh.face_matrix() + count)
            count += len(points[-1])
        return np.concatenate(points), np.concatenate(faces)
print("ready", file=out, flush=True)
for line in sys.stdin:
    try:
        points, faces = read(json.loads(line))
        corners = points[faces]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        used = points[np.unique(faces)]
        found = {"area": float(0.5 * np.linalg.norm(cross, axis=1).sum()),
                 "size": (used.max(0) - used.min(0)).tolist(), "triangles": len(faces)}
    except Exception as error:
        found = {"triangles": 0, "area": 0.0, "why": str(error)[:200]}
    print(json.dumps(found), file=out, flush=True)
"""
PEERS = {
    "trimesh": "stl obj ply off glb 3mf 3dxml",
    "meshio": "stl obj ply off",
    "open3d": "stl obj ply off glb",
    "pymeshlab": "stl obj ply off glb 3mf",
    "lib3mf": "3mf",
}
ENDINGS = "stl obj ply off glb 3mf amf 3dxml".split()
PATIENCE_S = 60
SAME = 1e-4


class Peer:
    """A reader in a process of its own, which is started again after a crash or a hang."""

    def __init__(self, python, name):
        self.command, self.process = [python, "-c", PEER, name], None

    def line(self):
        ready, _, _ = select.select([self.process.stdout], [], [], PATIENCE_S)
        return self.process.stdout.readline() if ready else ""

    def read(self, path):
        if self.process is None:
            self.process = subprocess.Popen(self.command, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                            stderr=subprocess.DEVNULL, text=True)
            if self.line().strip() != "ready":
                sys.exit(f"{self.command[-1]} cannot be started")
        try:
            self.process.stdin.write(json.dumps(path) + "\n")
            self.process.stdin.flush()
            line = self.line()
        except OSError:
            line = ""
        if not line:
            self.process.kill()
            self.process.wait()
            self.process = None
            return None
        found = json.loads(line)
        return found if found["triangles"] > 0 and found["area"] > 0.0 else None


class OpenScad:
    """What OpenSCAD makes of an AMF file, through OFF."""

    def __init__(self, through):
        self.through = through

    def read(self, path):
        with tempfile.TemporaryDirectory() as folder:
            off = f"{folder}/a.off"
            command = ["openscad", "-q", "-o", off, "-D", f"path={json.dumps(path)}", "/dev/stdin"]
            try:
                subprocess.run(command, input="import(path);", text=True, capture_output=True, timeout=PATIENCE_S)
            except subprocess.TimeoutExpired:
                return None
            return self.through.read(off) if Path(off).exists() else None


def ours(binary, path):
    command = [binary, "discretize", path, "--inspect", "--format", "json"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    except subprocess.TimeoutExpired:
        return None, f"longer than {PATIENCE_S} s"
    if done.returncode != 0:
        return None, " ".join((done.stderr or done.stdout).split())[:600] or f"exit code {done.returncode}"
    surface = json.loads(done.stdout)["surface"]
    size = [b - a for a, b in zip(surface["bounds_min"], surface["bounds_max"])]
    return {"area": surface["area"], "size": size, "triangles": surface["triangles"]}, ""


def agree(mine, other):
    """Boxes in any order of axes: glTF has y upwards."""
    pairs = zip(sorted(mine["size"]), sorted(other["size"]))
    largest = max(max(mine["size"]), 1e-300)
    return (abs(mine["area"] - other["area"]) <= SAME * max(mine["area"], 1e-300)
            and all(abs(a - b) <= SAME * largest for a, b in pairs))


def truth(readings):
    """The reading that most agree on, if two do."""
    votes = [(sum(agree(one, other) for other in readings), k) for k, one in enumerate(readings)]
    most, k = max(votes, default=(0, 0), key=lambda vote: vote[0])
    return readings[k] if most >= 2 else None


def reason(text):
    """A refusal without names and numbers of its file."""
    text = re.sub(r'^.*?"message": ?"', "", text)
    text = re.sub(r"^.*?\.\w{2,6}: ", "", re.sub(r"^.*?\.\w{2,6}\W*: ", "", text))
    return re.sub(r"`[^`]*`|\d[\d.e+-]*", "_", text)[:90]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--fluxform", default="target/release/fluxform")
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("--rows", action="store_true", help="a line for each file")
    arguments = parser.parse_args()
    seen, files = set(), collections.defaultdict(list)
    for path in sorted(p for p in arguments.folder.rglob("*") if p.is_file()):
        ending = path.suffix[1:].lower()
        digest = hashlib.sha256(path.read_bytes()).digest() if ending in ENDINGS else None
        if digest is not None and digest not in seen:
            seen.add(digest)
            files[ending].append(str(path.resolve()))
    command = [arguments.python, "-c", "import importlib.metadata as m,sys;print(m.version(sys.argv[1]))"]
    versions = {name: subprocess.run([*command, name], capture_output=True, text=True).stdout.strip() for name in PEERS}
    peers = {name: (Peer(arguments.python, name), PEERS[name].split()) for name in PEERS if versions[name]}
    if shutil.which("openscad"):
        version = subprocess.run(["openscad", "--version"], capture_output=True, text=True)
        versions["openscad"] = (version.stdout + version.stderr).split()[-1]
        peers["openscad"] = (OpenScad(peers["trimesh"][0]), ["amf"])
    print("Right / wrong / refused: " + ", ".join(f"{name} {versions[name]}" for name in peers) + "\n")
    print("| format | files | fluxform | " + " | ".join(peers) + " | no truth (read) | no surface |")
    print("|---" * (5 + len(peers)) + "|", flush=True)
    reasons, wrong = collections.defaultdict(list), []
    for ending in filter(files.get, ENDINGS):
        count = collections.Counter()
        for path in files[ending]:
            mine, why = ours(arguments.fluxform, path)
            found = {name: peer.read(path) for name, (peer, takes) in peers.items() if ending in takes}
            found["fluxform"] = mine
            known = truth([reading for reading in found.values() if reading is not None])
            if mine is None:
                reasons[ending, reason(why)].append(path + (" *" if known else ""))
            if known is None:
                count["no truth" if any(found.values()) else "no surface"] += 1
                count["alone"] += mine is not None
                verdicts = {}
            else:
                verdicts = {name: "refused" if reading is None else "right" if agree(known, reading) else "wrong"
                            for name, reading in found.items()}
                count.update(verdicts.items())
            if verdicts.get("fluxform") == "wrong":
                wrong.append((path, found))
            if arguments.rows:
                print(path, verdicts, file=sys.stderr, flush=True)
        kinds = ("right", "wrong", "refused")
        takes = {name: ending in formats for name, (_, formats) in peers.items()} | {"fluxform": True}
        cells = [" / ".join(str(count[name, kind]) for kind in kinds) if takes[name] else ""
                 for name in ("fluxform", *peers)]
        cells += [f"{count['no truth']} ({count['alone']})", count["no surface"]]
        print(f"| {ending} | {len(files[ending])} | " + " | ".join(map(str, cells)) + " |", flush=True)
    print("\nRefused by fluxform (* where the truth is known):\n")
    for (ending, why), paths in sorted(reasons.items()):
        stars = sorted(path for path in paths if path.endswith("*"))
        print(f"- {ending}, {len(paths)} ({len(stars)} *): {why} ({Path((stars or paths)[0]).name})")
    print("\nWrong:\n")
    for path, found in wrong:
        print(f"- {Path(path).name}: {found}")


if __name__ == "__main__":
    main()
