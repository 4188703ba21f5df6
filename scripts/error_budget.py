#!/usr/bin/env python3
"""What `--error` claims against what is true, and what it costs.

    python3 scripts/error_budget.py [PROGRAM] [--design DESIGN] [--shapes SHAPE...] [--errors ERROR...]

For each shape, the seed's four unless others are named, and each requested error, from 10 % to 0.1 %,
prints a row: the true error of lambda (against 641 x 641 points by area in a field ten times finer), the
stated one, their ratio; the true error of the force, at random places of the surface that are neither
points nor nodes (the currents by the bundle's map and heights against `probe` and the surface itself,
relative to the requested force; places where the surface jumps left out, as the budget does), the stated
one, their ratio; processor time of `calibrate` and the points chosen; then the points and the processor
time of the uniform grid of equal points, nodes of the map chosen for that error too, from which on lambda
is as near, and its force's true error. PROGRAM is the fluxform binary; without it the release build is made and
used. Needs numpy.
"""

import argparse
import csv
import io
import json
import os
import pathlib
import re
import resource
import subprocess
import sys
import tempfile

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.append(str(ROOT / "src/python/fluxform"))
from load_bundle import Bundle  # noqa: E402

SHAPES = ["flat", "half_sphere", "half_cylinder", "wedge"]
ERRORS = [0.1, 0.03, 0.01, 0.003, 0.001]
FINEST = 641
UNIFORM = [9, 17, 31, 61, 121, 241, 481]
HEADER = """\
| shape | --error | lambda: true | stated | ratio | force: true | stated | ratio | CPU s | points | uniform grid | CPU s \
| force: true |
|---|---|---|---|---|---|---|---|---|---|---|---|---|"""


def program(named):
    """The binary named on the command line, or the release build."""
    if named:
        return os.path.abspath(named)
    subprocess.run(["cargo", "build", "--release", "--locked"], cwd=ROOT, check=True)
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return str(target / "release" / "fluxform")


def ran(command, folder):
    """Standard output and processor time of a command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr}")
    return done.stdout, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


class Scene:
    """A design and a shape, with what is known of them by other routes."""

    def __init__(self, binary, design, shape, folder, finest=FINEST):
        self.binary, self.design, self.shape, self.folder = binary, str(design), pathlib.Path(shape), folder
        cored = "[core]" in pathlib.Path(design).read_text()
        self.finer = ["--tolerance", "1e-5" if cored else "1e-9"]
        self.limit = self.lambda_of(self.with_grid(finest), "--weights", "area")
        self.places = self.random_places()
        self.forces = self.probed()

    def lambda_of(self, shape, *options):
        """Lambda in a field ten times finer."""
        command = [self.binary, "lambda", self.design, shape, *self.finer, "--format", "json", *options]
        return json.loads(ran(command, self.folder)[0])["lambda_n_per_m"]

    def with_grid(self, samples):
        """A shape file with so many points along each axis."""
        text = re.sub(r"(\b[xy]_mm = \[[^\]]*, )\d+\]", rf"\g<1>{samples}]", self.shape.read_text())
        text = text.replace('surface = "', f'surface = "{self.shape.parent.resolve()}/')
        path = self.folder / f"{self.shape.stem}_{samples}.toml"
        path.write_text(text)
        return str(path)

    def random_places(self):
        """Places of the surface that are on no grid, m."""
        command = [self.binary, "discretize", str(self.shape), "--poisson", "4.3mm", "--seed", "7", "--out", "-"]
        rows = csv.DictReader(io.StringIO(ran(command, self.folder)[0]))
        places = np.array([[float(r[k]) for k in ("x_m", "y_m", "height_m")] for r in rows])
        return places[places[:, 2] > 0.05 * places[:, 2].max()]

    def probed(self):
        """The upward force of each coil at those places, N/A."""
        (self.folder / "places.csv").write_text(
            "x_m,y_m,z_m\n" + "".join(",".join(map(repr, p.tolist())) + "\n" for p in self.places))
        command = [self.binary, "probe", self.design, "places.csv", "--magnet-force", "--components", "gz", *self.finer]
        rows = csv.DictReader(io.StringIO(ran(command, self.folder)[0]))
        return np.array([float(r["force_z_n_per_a"]) for r in rows]).reshape(len(self.places), -1)

    def calibrated(self, shape, *options):
        """A bundle's JSON result and its processor time."""
        command = [self.binary, "calibrate", self.design, str(shape), *options, "--no-report", "--out", "bundles", "--force",
                   "--no-cache", "--format", "json"]
        printed, seconds = ran(command, self.folder)
        return json.loads(printed)["bundles"][0], seconds

    def force_error(self, bundle_json):
        """The largest relative error of the rendered force at the random places, jumps left out."""
        bundle = Bundle(self.folder / bundle_json["folder"])
        height = self.places[:, 2]
        interpolated = bundle.height(self.places)
        spacing = bundle.map["height_x_m"][1] - bundle.map["height_x_m"][0]
        with np.errstate(invalid="ignore"):
            smooth = np.abs(interpolated - height) < 0.25 * spacing
        smooth &= bundle.inside(self.places)
        by_map = bundle.force_per_ampere(self.places) @ bundle.currents_a
        off = np.abs(by_map - self.forces @ bundle.currents_a) / (bundle_json["lambda_n_per_m"] * height)
        off += np.abs(interpolated - height) / height
        return float(np.max(off[smooth])) if smooth.any() else 0.0

    def at_error(self, error):
        """What a run at a requested error claims, what is true, and what it costs."""
        one, seconds = self.calibrated(self.shape, "--error", str(error), "--refine")
        headline, found = one["headline"], one["lambda_n_per_m"]
        return {
            "lambda_true": abs(found / self.limit - 1),
            "lambda_stated": headline["lambda_error_n_per_m"] / found,
            "force_true": self.force_error(one),
            "force_stated": headline["force_error"],
            "met": headline["requested"]["met"],
            "seconds": seconds,
            "points": one["points"],
        }


def uniform_grids(scene):
    """Points and true error of lambda of uniform grids of equal points, with their shapes."""
    for samples in UNIFORM:
        grid = scene.with_grid(samples)
        command = [scene.binary, "lambda", scene.design, grid, *scene.finer, "--format", "json"]
        one = json.loads(ran(command, scene.folder)[0])
        yield one["points"], abs(one["lambda_n_per_m"] / scene.limit - 1), grid


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", nargs="?")
    parser.add_argument("--design", default=ROOT / "designs/seed.toml", type=pathlib.Path)
    parser.add_argument("--shapes", nargs="+", type=pathlib.Path, default=[ROOT / f"shapes/{s}.toml" for s in SHAPES])
    parser.add_argument("--errors", nargs="+", type=float, default=ERRORS)
    asked = parser.parse_args()
    binary = program(asked.program)
    print(HEADER)
    for shape in asked.shapes:
        with tempfile.TemporaryDirectory() as name:
            scene = Scene(binary, asked.design.resolve(), shape.resolve(), pathlib.Path(name))
            uniform, costs = list(uniform_grids(scene)), {}
            for error in asked.errors:
                of = scene.at_error(error)
                # The reference is not believed beyond this.
                near = max(of["lambda_true"], 1e-6)
                # A coarse grid may be near by luck: every finer one is to be as near too.
                finer = [grid for at, grid in enumerate(uniform) if all(one[1] <= near for one in uniform[at:])]
                reaching = finer[0] if finer else None
                points, _, grid = reaching or uniform[-1]
                # Nodes as the budget chooses them: the error of given points is said, and they are obeyed.
                if points not in costs:
                    one, seconds = scene.calibrated(grid, "--error", str(error))
                    costs[points] = seconds, scene.force_error(one)
                seconds, force = costs[points]
                print(f"| {shape.stem.replace('_', '-')} | {100 * error:g} % | {100 * of['lambda_true']:.3g} % | "
                      f"{100 * of['lambda_stated']:.2g} % | {of['lambda_stated'] / of['lambda_true']:.1f} | "
                      f"{100 * of['force_true']:.2g} % | {100 * of['force_stated']:.2g} %"
                      f"{'' if of['met'] else ' (missed)'} | {of['force_stated'] / of['force_true']:.1f} | "
                      f"{of['seconds']:.2f} | {of['points']} | {'' if reaching else 'over '}{points} | {seconds:.2f} | "
                      f"{100 * force:.2g} % |", flush=True)


if __name__ == "__main__":
    main()
