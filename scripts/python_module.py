#!/usr/bin/env python3
"""What the Python package costs: seconds from `pip install` to a first bundle, what a call adds to the
library's own time, and the first map beside magpylib's, in lines of code and seconds.

    maturin build --release --locked -m src/python/Cargo.toml --out wheels
    python3 scripts/python_module.py wheels/*.whl

Installs the wheel, with what it needs, into an empty virtual environment, where no compiler and no Rust is
to be found; then magpylib, pinned in scripts/peers/requirements.txt, beside it. Numbers called from Python
are held against those that the program of the same wheel writes. Prints a Markdown table. Wall time.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DESIGN, SHAPE = ROOT / "designs/seed_air.toml", ROOT / "shapes/wedge.toml"
REPEATS = 9

FLUXFORM = """\
import fluxform
maps = fluxform.Design.load(design).map()
"""

# The windings of that design, each as six cylindrical current sheets: magpylib has no thick coil, but an
# axially magnetised cylinder has the field of a sheet on its axis and above it.
MAGPYLIB = """\
import magpylib
import numpy as np
inner_m, outer_m, length_m, turns, pitch_m, step_m = 0.024, 0.038, 0.1, 1429, 0.05, 1e-6
nodes, weights = np.polynomial.legendre.leggauss(6)
def coil(x_m, y_m):
    return magpylib.Collection(*[
        magpylib.magnet.Cylinder(
            magnetization=(0, 0, turns / length_m * weight / 2),
            dimension=((inner_m + outer_m + (outer_m - inner_m) * node) / 2, length_m),
            position=(x_m, y_m, -length_m / 2),
        )
        for node, weight in zip(nodes, weights)
    ])
coils = [coil(x_m, y_m) for y_m in (-pitch_m, 0, pitch_m) for x_m in (-pitch_m, 0, pitch_m)]
z, y, x = np.meshgrid(z_m, y_m, x_m, indexing="ij")
points = np.stack([x, y, z], axis=-1)
up = np.array([0, 0, step_m])
above, below = (magpylib.getB(coils, points + side * up)[..., 2] for side in (1, -1))
maps = (above - below) / (2 * step_m)
"""


def median_s(call, repeats=REPEATS):
    """Median wall time of a call, s, and its last result."""
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        result = call()
        seconds.append(time.perf_counter() - start)
    return sorted(seconds)[len(seconds) // 2], result


def lines(code):
    """Lines of code that are not empty."""
    return sum(1 for line in code.splitlines() if line.strip())


def row(what, value):
    print(f"| {what} | {value} |", flush=True)


def inside(folder):
    """In the virtual environment: calls against the program, and the peer."""
    import importlib.metadata

    import fluxform
    import numpy as np

    program = Path(sys.executable).parent / "fluxform"
    folder = Path(folder)
    design, shape = fluxform.Design.load(DESIGN), fluxform.Shape.load(SHAPE)

    def command(*words):
        subprocess.run([program, "--quiet", *map(str, words)], check=True, stdout=subprocess.DEVNULL)

    map_s, maps = median_s(design.map)
    command_s, _ = median_s(lambda: command("map", DESIGN, "--out", folder / "map", "--force"))
    with np.load(folder / "map/map.npz") as written:
        same = all(np.array_equal(written[name], maps[name]) for name in ("x_m", "gz_t_per_m_per_a"))
    row("map, nine coils in air: call, command (ms)", f"{map_s * 1e3:.2f}, {command_s * 1e3:.2f}")
    row("the same numbers to the last bit", "yes" if same else "NO")

    lambda_s, found = median_s(lambda: fluxform.lambda_(design, shape))
    command_s, _ = median_s(lambda: command("lambda", DESIGN, SHAPE))
    row("lambda of the wedge: call, command (ms)", f"{lambda_s * 1e3:.1f}, {command_s * 1e3:.1f}")
    printed = subprocess.run(
        [program, "--quiet", "lambda", DESIGN, SHAPE, "--format", "json"], check=True, stdout=subprocess.PIPE
    )
    same = json.loads(printed.stdout)["lambda_n_per_m"] == found.lambda_n_per_m
    row("the same lambda to the last bit", "yes" if same else "NO")

    least = fluxform.Design.from_toml(
        'name = "least"\n[coil]\ninner_diameter_mm = 24.0\nouter_diameter_mm = 38.0\nlength_mm = 100.0\n'
        "[wire]\ndiameter_mm = 0.7\n",
        "least.toml",
    )
    point = np.array([[0.0, 0.0, 0.03]])
    points = np.tile(point, (1000, 1))
    one_s, _ = median_s(lambda: least.fields(point), 101)
    many_s, _ = median_s(lambda: least.fields(points), 101)
    seconds = f"{one_s * 1e6:.0f}, {many_s * 1e3:.1f}"
    row("`Design.fields`, one coil with its error: one point, each of 1000 (us)", seconds)
    [bundle] = fluxform.calibrate(design, shape, out=folder / "bundles", no_report=True)
    place = np.array([0.01, 0.0, 0.05])
    many = np.tile(place, (1000, 1))
    one_s, _ = median_s(lambda: bundle.currents(place), 1001)
    many_s, _ = median_s(lambda: bundle.currents(many), 101)
    row("`Bundle.currents`: one position, each of 1000 (us)", f"{one_s * 1e6:.1f}, {many_s * 1e3:.2f}")
    row("of one position, what the call adds (us)", f"{(one_s - many_s / 1000) * 1e6:.1f}")

    names = {"design": str(DESIGN)}
    ours_s, _ = median_s(lambda: exec(FLUXFORM, names))
    peer = {name: maps[name] for name in ("x_m", "y_m", "z_m")}
    start = time.perf_counter()
    exec(MAGPYLIB, peer)
    peer_s = time.perf_counter() - start
    ours, theirs = maps["gz_t_per_m_per_a"], peer["maps"]
    apart = abs(ours - theirs).max() / abs(ours).max()
    row("first map: lines, ours and magpylib's", f"{lines(FLUXFORM)}, {lines(MAGPYLIB)}")
    row("first map, design read: seconds, ours and magpylib's", f"{ours_s:.3g}, {peer_s:.3g}")
    row("ratio of the seconds", f"{peer_s / ours_s:.0f}")
    row("largest difference of the two maps, of the largest dB_z/dz", f"{apart:.1e}")
    row("magpylib, numpy", ", ".join(importlib.metadata.version(name) for name in ("magpylib", "numpy")))


def main():
    wheel = Path(sys.argv[1]).resolve()
    pins = (ROOT / "scripts/peers/requirements.txt").read_text().splitlines()
    with tempfile.TemporaryDirectory() as folder:
        environment = Path(folder, "environment")
        venv.create(environment, with_pip=True)
        programs = environment / "bin"
        bare = {**os.environ, "PATH": str(programs), "HOME": folder}

        def run(*words):
            subprocess.run([str(word) for word in words], check=True, env=bare, cwd=folder, stdout=subprocess.DEVNULL)

        print("| what | value |\n|---|---|")
        row("wheel (MB)", f"{wheel.stat().st_size / 1e6:.2f}")
        start = time.perf_counter()
        run(programs / "pip", "install", "--quiet", "--no-cache-dir", wheel)
        installed = time.perf_counter() - start
        row("`pip install`, numpy loaded with it (s)", f"{installed:.1f}")
        run(programs / "fluxform", "--quiet", "init", "seed")
        shape = next(Path(folder).glob("seed_*.toml"))
        run(programs / "fluxform", "--quiet", "calibrate", "seed.toml", shape)
        row("from `pip install` to the first bundle (s)", f"{time.perf_counter() - start:.1f}")
        run(programs / "pip", "install", "--quiet", *(pin for pin in pins if pin.startswith("magpylib")))
        subprocess.run(
            [programs / "python", __file__, "--inside", folder], check=True, env={**bare, "RAYON_NUM_THREADS": "2"}
        )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--inside"]:
        inside(sys.argv[2])
    elif len(sys.argv) == 2:
        main()
    else:
        sys.exit(__doc__)
