#!/usr/bin/env python3
"""fluxform's reading and sampling of STL files against trimesh, Open3D and VTK, in one run.

    python3 scripts/peers/compare_surface.py [--python PYTHON] [--fluxform BINARY] [--bench BINARY]

Needs Python 3.11 and a way to install scripts/peers/requirements_surface.txt, which go into a
virtual environment under target/ (or name a PYTHON that has them). fluxform is the release build:
its reading and sampling are timed by `cargo bench --bench surface_speed`, the whole command by
`discretize`. The files: a closed wavy body of about 1e6 triangles with vertical walls, made here
(seeded), and shapes/half_cylinder.stl. Heights are wanted at 1001 x 1001 points that reach to the
border; of slow peers' rays only a part is sent and their time scaled up. A height is wrong if it
is off by more than 1e-6 m from the plane of its facet, computed here from the file's vertices.
CPU seconds are those of all threads, the least of REPEATS runs. Prints Markdown tables.
"""

import argparse
import json
import os
import platform
import re
import struct
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
REPEATS = 3
# A peer that takes longer is given up, s.
PATIENCE = 60
SAMPLES = 1001
HALF_MM = 50.0
WRONG_MM = 1e-3
CELLS = 705
# Which part of the rays each peer gets.
STRIDES = {"trimesh": 1, "open3d": 1, "vtk-static": 7, "vtk-obb": 997}
# An environment of the script's own, which has numpy.
INSIDE = "FLUXFORM_COMPARE_SURFACE_INSIDE"


def peer_python():
    folder = ROOT / "target" / "peers-surface"
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if not python.exists():
        venv.create(folder, with_pip=True)
    pip = [python, "-m", "pip", "install", "-q", "-r", HERE / "requirements_surface.txt"]
    if subprocess.run(pip).returncode != 0:
        print("Not every peer could be installed here; see its row.\n", flush=True)
        subprocess.run([python, "-m", "pip", "install", "-q", "numpy"], check=True)
    return str(python)


def lattice():
    """Lines of the wavy body's cells and the heights of its nodes, mm, as STL keeps them."""
    import numpy as np

    random = np.random.default_rng(7)
    line = np.linspace(-HALF_MM, HALF_MM, CELLS + 1).astype(np.float32)
    height = np.full((CELLS + 1, CELLS + 1), 40.0)
    for _ in range(6):
        kx, ky = random.uniform(-0.2, 0.2, 2)
        phase, size = random.uniform(0, 2 * np.pi), random.uniform(0.5, 3.0)
        height += size * np.sin(kx * line[None, :] + ky * line[:, None] + phase)
    return line, height.astype(np.float32)


def wavy(path):
    """Writes the closed body; rows of cells on top, walls of two triangles a cell, a fan below."""
    import numpy as np

    line, z = lattice()
    x, y = np.meshgrid(line, line)
    top = np.stack([x, y, z], axis=-1)
    a, b, c, d = top[:-1, :-1], top[:-1, 1:], top[1:, :-1], top[1:, 1:]
    parts = [np.stack([a, b, d], axis=2), np.stack([a, d, c], axis=2)]
    triangles = [np.stack(parts, axis=2).reshape(-1, 3, 3)]
    for edge in (top[0], top[:, -1], top[-1, ::-1], top[::-1, 0]):
        start, end = edge[:-1], edge[1:]
        ground = [np.column_stack([p[:, :2], np.zeros(len(p), np.float32)]) for p in (start, end)]
        centre = np.zeros_like(start)
        for corners in ([ground[0], ground[1], end], [ground[0], end, start],
                        [ground[1], ground[0], centre]):
            triangles.append(np.stack(corners, axis=1))
    triangles = np.concatenate(triangles)
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    records = np.zeros(len(triangles), record)
    records["corners"] = triangles
    path.write_bytes(b"wavy".ljust(80) + struct.pack("<I", len(records)) + records.tobytes())
    return len(records)


def wavy_heights():
    """Exact heights of the wavy body over the grid, mm, y slowest."""
    import numpy as np

    line, z = (values.astype(float) for values in lattice())
    nodes = np.linspace(-HALF_MM, HALF_MM, SAMPLES)
    cell = np.clip(np.searchsorted(line, nodes, side="right") - 1, 0, CELLS - 1)
    part = (nodes - line[cell]) / (line[cell + 1] - line[cell])
    (j, i), (v, u) = np.meshgrid(cell, cell, indexing="ij"), np.meshgrid(part, part, indexing="ij")
    a, b, c, d = z[j, i], z[j, i + 1], z[j + 1, i], z[j + 1, i + 1]
    below = a + u * (b - a) + v * (d - b)
    above = a + v * (c - a) + u * (d - c)
    return np.where(u >= v, below, above).ravel()


def half_cylinder_heights(path):
    """Exact heights of the seed's half-cylinder: its profile is the same for every y."""
    import numpy as np

    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    corners = np.frombuffer(path.read_bytes()[84:], record)["corners"].reshape(-1, 3).astype(float)
    x = np.unique(corners[:, 0])
    z = np.array([corners[corners[:, 0] == value, 2].max() for value in x])
    nodes = np.linspace(-HALF_MM, HALF_MM, SAMPLES)
    return np.tile(np.interp(nodes, x, z), SAMPLES)


def judged(heights, wanted, stride):
    """Missing and wrong points, and the worst difference in mm."""
    import numpy as np

    wanted = wanted[::stride]
    known = np.isfinite(heights)
    off = np.abs(heights[known] - wanted[known])
    worst = float(off.max()) if len(off) else float("nan")
    return int((~known).sum()), int((off > WRONG_MM).sum()), worst


def last_line(error):
    plain = re.sub(r"\x1b\[[0-9;]*m", "", error)
    lines = [line for line in plain.splitlines() if line.strip()]
    return lines[-1].strip()[:160] if lines else "no message"


def peer(python, name, path, folder, samples=SAMPLES):
    """The peer's figures, or why there are none."""
    out = folder / "heights.npy"
    stride = STRIDES[name]
    words = [name, str(path), str(out), str(samples), str(HALF_MM), str(stride)]
    best = None
    for _ in range(REPEATS if samples else 1):
        try:
            result = subprocess.run(
                [python, HERE / "surface_peer.py", *words],
                capture_output=True, text=True, timeout=PATIENCE,
            )
        except subprocess.TimeoutExpired:
            return None, f"given up after {PATIENCE} s"
        if result.returncode != 0:
            return None, last_line(result.stderr)
        figures = json.loads(result.stdout.strip().splitlines()[-1])
        figures["said"] = last_line(result.stderr) if result.stderr.strip() else ""
        if best is None:
            best = figures
        for key in ("read_s", "sample_s"):
            if key in figures:
                best[key] = min(best[key], figures[key])
    return best, out


def ours(bench, path, folder):
    """Seconds of reading and sampling and the peak, by the bench; and the heights."""
    import numpy as np

    out = folder / "heights.f64"
    text = subprocess.run(
        [bench, str(path), "0", str(out)], check=True, capture_output=True, text=True
    ).stdout
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines()]
    rows = [row for row in rows if len(row) == 4 and re.match(r"[0-9.]+$", row[1])]
    (_, read_s, _, _), (_, sample_s, _, peak) = rows
    return float(read_s), float(sample_s), float(peak), np.fromfile(out) * 1000.0


def command(fluxform, path, folder):
    """CPU seconds and peak MiB of the whole command, its table included."""
    code = (
        "import resource, subprocess, sys\n"
        "subprocess.run(sys.argv[1:], check=True)\n"
        "u = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(u.ru_utime + u.ru_stime, u.ru_maxrss / 1024)\n"
    )
    words = [fluxform, "--quiet", "discretize", path, "--unit", "mm", "--grid", f"{SAMPLES}x{SAMPLES}",
             "--certify", "no", "--force", "--out", folder / "points.csv"]
    runs = []
    for _ in range(REPEATS):
        output = subprocess.run(
            [sys.executable, "-c", code, *map(str, words)], check=True, capture_output=True, text=True
        ).stdout
        runs.append([float(word) for word in output.split()[-2:]])
    return min(runs)


def ratio(theirs, ours):
    """Times below a tenth of a millisecond are not worth a ratio."""
    return f"{theirs / ours:.1f}" if ours >= 1e-4 else "-"


def speed(arguments, python, name, path, wanted, folder):
    count = struct.unpack("<I", path.read_bytes()[80:84])[0]
    print(f"## {name}: {count} triangles, {SAMPLES} x {SAMPLES} points\n")
    print("| program | read CPU s | ratio | sample CPU s | ratio | peak MiB | missing | wrong | worst mm |")
    print("|---|---|---|---|---|---|---|---|---|", flush=True)
    read_s, sample_s, peak, heights = ours(arguments.bench, path, folder)
    missing, wrong, worst = judged(heights, wanted, 1)
    print(
        f"| fluxform | {read_s:.4f} | 1 | {sample_s:.4f} | 1 | {peak:.0f} | {missing} | {wrong} "
        f"| {worst:.1e} |",
        flush=True,
    )
    import numpy as np

    for key, stride in STRIDES.items():
        figures, out = peer(python, key, path, folder)
        if figures is None:
            print(f"| {key} | did not run: {out} | | | | | | | |", flush=True)
            continue
        found = np.load(out)
        missing, wrong, worst = judged(found, wanted, stride)
        sampled = figures["sample_s"] * (SAMPLES**2 / len(found))
        scaled = "" if stride == 1 else f" (from {len(found)} rays)"
        of = "" if stride == 1 else f" of {len(found)}"
        print(
            f"| {figures['name']} | {figures['read_s']:.4f} | {ratio(figures['read_s'], read_s)} "
            f"| {sampled:.4f}{scaled} | {ratio(sampled, sample_s)} | {figures['peak_mib']:.0f}, "
            f"{figures['imported_mib']:.0f} of it imports | {missing}{of} | {wrong}{of} | {worst:.1e} |",
            flush=True,
        )
    seconds, peak = command(arguments.fluxform, path, folder)
    print(
        f"\n`fluxform discretize --certify no`, the whole command with marks, holes and its table "
        f"of points: {seconds:.2f} CPU s, {peak:.0f} MiB.\n",
        flush=True,
    )


def behaviour(arguments, python, folder):
    """What comes of half a file, and of a file without a unit."""
    whole = (ROOT / "shapes" / "half_cylinder.stl").read_bytes()
    cut = folder / "cut.stl"
    cut.write_bytes(whole[: 84 + (len(whole) - 84) // 2 + 17])
    count = struct.unpack("<I", whole[80:84])[0]
    print(f"## A file of {count} triangles cut in half, and a file without a unit\n")
    print("| program | cut file | no unit stated |\n|---|---|---|")

    def refusal(*words):
        result = subprocess.run(
            [arguments.fluxform, "discretize", *map(str, words), "--out", "-"],
            capture_output=True, text=True, env={**os.environ, "NO_COLOR": "1"},
        )
        said = " ".join(re.sub(r"[│×╭╰─|]", " ", result.stderr).split())
        return f"exit {result.returncode}: {said[:220]}"

    stated = refusal(ROOT / "shapes" / "half_cylinder.stl", "--grid", "3x3")
    print(f"| fluxform | {refusal(cut, '--unit', 'mm')} | {stated} |", flush=True)
    for key in ("trimesh", "open3d", "vtk-static"):
        figures, why = peer(python, key, cut, folder, 0)
        if figures is None:
            said = f"raises: {why}"
        else:
            said = f"{figures['triangles']} triangles"
            said += f"; says: {figures['said']}" if figures["said"] else "; says nothing"
        whole_figures, why = peer(python, key, ROOT / "shapes" / "half_cylinder.stl", folder, 0)
        unit = f"did not run: {why}" if whole_figures is None else "bare numbers, nothing asked"
        name = (whole_figures or {"name": key})["name"].split(",")[0]
        print(f"| {name} | {said} | {unit} |", flush=True)


def bench_binary():
    lines = subprocess.run(
        ["cargo", "bench", "--locked", "--bench", "surface_speed", "--no-run",
         "--message-format", "json"],
        cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True,
    ).stdout.splitlines()
    messages = [json.loads(line) for line in lines]
    return next(
        m["executable"] for m in messages
        if m.get("executable") and m["target"]["name"] == "surface_speed"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", help="a Python with the requirements")
    parser.add_argument("--fluxform", default=os.environ.get("FLUXFORM"))
    parser.add_argument("--bench", help="the built bench surface_speed")
    arguments = parser.parse_args()
    if INSIDE not in os.environ:
        # This script itself needs numpy: it goes on in the peers' environment.
        python = arguments.python or peer_python()
        sys.exit(subprocess.run([python, *sys.argv], env={**os.environ, INSIDE: "1"}).returncode)
    if not arguments.fluxform:
        subprocess.run(["cargo", "build", "--release", "--locked", "--quiet"], cwd=ROOT, check=True)
        arguments.fluxform = str(ROOT / "target" / "release" / "fluxform")
    arguments.bench = arguments.bench or bench_binary()
    version = subprocess.run([arguments.fluxform, "--version"], capture_output=True, text=True)
    print(f"{version.stdout.strip()}, {platform.machine()}, {os.cpu_count()} cores, ", end="")
    print(f"Python {platform.python_version()}; least of {REPEATS} runs (fluxform: of 5)\n")
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        body = folder / "wavy.stl"
        wavy(body)
        speed(arguments, sys.executable, "A wavy body with walls", body, wavy_heights(), folder)
        cylinder = ROOT / "shapes" / "half_cylinder.stl"
        wanted = half_cylinder_heights(cylinder)
        speed(arguments, sys.executable, "The seed's half-cylinder", cylinder, wanted, folder)
        behaviour(arguments, sys.executable, folder)


if __name__ == "__main__":
    main()
