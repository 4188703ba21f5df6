#!/usr/bin/env python3
"""Makes a scan-like face of about 500,000 triangles and calibrates it over coupled cored coils.

    python3 scripts/face.py FLUXFORM FOLDER [--coils 15] [--nodes 501] [--inputs-only] [--picture]

Writes face.stl, face.toml and display.toml to FOLDER, calibrates there, and prints the triangles, the
processor and wall seconds, the memory, the size of the page and the time of a step of the C loader (best
of 5; needs `cc`); --picture draws face.png, the picture of the README, there. The scan has noise of 0.05 mm,
holes, and an undercut below the nose. The same surface every time; nothing but Python 3 is needed.
"""

import argparse
import math
import random
import resource
import struct
import subprocess
import time
from pathlib import Path

PITCH_MM = 10.0
NOISE_MM = 0.05
HOLES = 12
POINTS = 61
LOWEST_MM, HIGHEST_MM = 15.0, 45.0
STEPS_REPEATED = 5
SCRIPTS = Path(__file__).resolve().parent

# Middle, half-widths and height of each feature, in parts of half the face's width and height.
FEATURES = [
    ((0.0, 0.05), (0.13, 0.28), 0.35),  # nose
    ((0.33, 0.33), (0.16, 0.1), -0.16),  # eyes
    ((-0.33, 0.33), (0.16, 0.1), -0.16),
    ((0.0, -0.42), (0.25, 0.05), 0.09),  # lips
    ((0.0, -0.5), (0.22, 0.05), 0.08),
    ((0.0, -0.78), (0.2, 0.15), 0.15),  # chin
]


def bump(u, v, middle, widths):
    return math.exp(-(((u - middle[0]) / widths[0]) ** 2) - ((v - middle[1]) / widths[1]) ** 2)


def vertex(u, v, half_mm, noise):
    """The place of a node, mm; the nose's tip hangs over the lip."""
    height = 1.0 - 0.55 * u * u - 0.3 * v * v
    height += sum(size * bump(u, v, middle, widths) for middle, widths, size in FEATURES)
    drop = 0.14 * bump(u, v, (0.0, -0.08), (0.13, 0.09))
    z = height * 0.6 * (HIGHEST_MM - LOWEST_MM)
    return u * half_mm, (v - drop) * half_mm, z + noise.gauss(0.0, NOISE_MM)


def facets(nodes, half_mm):
    noise = random.Random(15)
    at = [2.0 * i / (nodes - 1) - 1.0 for i in range(nodes)]
    grid = [[vertex(u, v, half_mm, noise) for u in at] for v in at]
    holes = [(noise.uniform(-0.9, 0.9), noise.uniform(-0.9, 0.9), noise.uniform(0.01, 0.03)) for _ in range(HOLES)]
    for j in range(nodes - 1):
        for i in range(nodes - 1):
            if any(math.hypot(at[i] - u, at[j] - v) < radius for u, v, radius in holes):
                continue
            a, b, c, d = grid[j][i], grid[j][i + 1], grid[j + 1][i + 1], grid[j + 1][i]
            yield a, b, c
            yield a, c, d


def write_inputs(folder, coils, nodes):
    half_mm = 0.5 * (coils - 1) * PITCH_MM
    triangles = [struct.pack("<12fH", 0, 0, 0, *a, *b, *c, 0) for a, b, c in facets(nodes, half_mm)]
    (folder / "face.stl").write_bytes(bytes(80) + struct.pack("<I", len(triangles)) + b"".join(triangles))
    samples = f"[{-half_mm}, {half_mm}, {POINTS}]"
    (folder / "face.toml").write_text(f"""name = "face"
surface = "face.stl"
unit = "mm"
rest_on_mm = {LOWEST_MM}

[points]
x_mm = {samples}
y_mm = {samples}
outside = "skip"
""")
    (folder / "display.toml").write_text(f"""name = "display"

[coil]
inner_diameter_mm = 5.0
outer_diameter_mm = 9.0
length_mm = 40.0
turns = 800

[wire]
diameter_mm = 0.25

[core]
clearance_mm = 0.0
above_mm = 0.0
below_mm = 5.0
relative_permeability = 1000.0

[array]
rows = {coils}
columns = {coils}
pitch_mm = {PITCH_MM}
coupling = "full"

[magnet]
diameter_mm = 10.0
length_mm = 10.0
magnetization_a_per_m = 1.1579e6
polarity = "repel"
model = "dipole"

[supply]
current_max_a = 1.0
total_current_max_a = {coils * coils}.0
voltage_v = 36.0

[target]
height_mm = 20.0

[workspace]
x_mm = {samples}
y_mm = {samples}
z_mm = [10.0, 60.0, 26]
""")
    return len(triangles)


def calibrate(fluxform, folder):
    start = time.monotonic()
    subprocess.run([fluxform, "calibrate", "display.toml", "face.toml", "--no-cache"], cwd=folder, check=True)
    wall_s = time.monotonic() - start
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{used.ru_utime + used.ru_stime:.1f} CPU s, {wall_s:.1f} s of wall time, {used.ru_maxrss / 1024:.0f} MB")


def measure_step(folder, bundle, coils):
    """Nanoseconds that the C loader takes for the currents at one place."""
    program = folder / "replay"
    sources = [SCRIPTS / f"fluxform_{part}.c" for part in ("replay", "bundle", "currents")]
    subprocess.run(["cc", "-std=c99", "-O2", *sources, "-o", program, "-lm"], check=True)
    reach_m = 0.4 * (coils - 1) * PITCH_MM / 1e3
    places = random.Random(3)
    lines = "".join(
        f"{places.uniform(-reach_m, reach_m)} {places.uniform(-reach_m, reach_m)} {places.uniform(0.03, 0.05)}\n"
        for _ in range(1000)
    )
    command = [program, bundle / "map.npz", str(STEPS_REPEATED)]
    done = subprocess.run(command, input=lines, text=True, capture_output=True, check=True)
    return float(done.stdout.split()[0])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("fluxform", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--coils", type=int, default=15, help="along a side of the array")
    parser.add_argument("--nodes", type=int, default=501, help="of the scan along a side")
    parser.add_argument("--inputs-only", action="store_true", help="calibrate nothing")
    parser.add_argument("--picture", action="store_true", help="draw lambda, its currents and errors")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    triangles = write_inputs(given.folder, given.coils, given.nodes)
    print(f"{triangles} triangles")
    if given.inputs_only:
        return
    calibrate(given.fluxform.resolve(), given.folder)
    bundle = given.folder / "results" / "display" / "face"
    page = bundle / "report.html"
    print(f"page {page.stat().st_size / 1e6:.1f} MB")
    if given.picture:
        drawing = ["lambda", "display.toml", "face.toml", "--plot", "face.png"]
        subprocess.run([given.fluxform.resolve(), *drawing], cwd=given.folder, check=True)
    print(f"step {measure_step(given.folder, bundle, given.coils) / 1e3:.2f} us")


main()
