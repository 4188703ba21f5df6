#!/usr/bin/env python3
"""What `--error` claims against what is true, and what it costs.

    python3 scripts/error_budget.py [PROGRAM] [DESIGN]

For the seed's four shapes and requested errors from 10 % to 0.1 % prints a table: the true error of
lambda (against 641 x 641 points by area in a field ten times finer), the stated one, their ratio; the
true error of the force, at random places of the surface that are neither points nor nodes (the currents
by the bundle's map and heights against `probe` and the surface itself, relative to the requested force;
places where the surface jumps left out, as the budget does), the stated one, their ratio; processor time
of `calibrate`; the points chosen, and those of the uniform grid of equal points that has the same error
of lambda. PROGRAM is the fluxform binary; without it the release build is made and used. Needs numpy.
"""

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


def program():
    """The binary named on the command line, or the release build."""
    if len(sys.argv) > 1:
        return os.path.abspath(sys.argv[1])
    subprocess.run(["cargo", "build", "--release", "--locked"], cwd=ROOT, check=True)
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return str(target / "release" / "fluxform")


def ran(command, folder):
    """Standard output and processor time of a command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}: {done.stderr}")
    return done.stdout, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def with_grid(text, samples, folder, name):
    """A shape file with so many points along each axis."""
    text = re.sub(r", 61\]", f", {samples}]", text)
    text = text.replace('surface = "', f'surface = "{ROOT}/shapes/')
    path = folder / f"{name}_{samples}.toml"
    path.write_text(text)
    return str(path)


def force_errors(bundle, places, direct, lambda_n_per_m):
    """The largest relative error of the rendered force at `places`, jumps left out."""
    height = places[:, 2]
    interpolated = bundle.height(places)
    spacing = bundle.map["height_x_m"][1] - bundle.map["height_x_m"][0]
    with np.errstate(invalid="ignore"):
        smooth = np.abs(interpolated - height) < 0.25 * spacing
    smooth &= bundle.inside(places)
    by_map = bundle.force_per_ampere(places) @ bundle.currents_a
    off = np.abs(by_map - direct @ bundle.currents_a) / (lambda_n_per_m * height)
    off += np.abs(interpolated - height) / height
    return float(np.max(off[smooth])), int(np.sum(~smooth))


def main():
    binary = program()
    design = os.path.abspath(sys.argv[2]) if len(sys.argv) > 2 else str(ROOT / "designs/seed.toml")
    fine = "1e-5" if "[core]" in pathlib.Path(design).read_text() else "1e-12"
    print("| shape | --error | lambda: true | stated | ratio | force: true | stated | ratio | CPU s | points "
          "| uniform grid |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for shape in SHAPES:
            text = (ROOT / f"shapes/{shape}.toml").read_text()
            finest = with_grid(text, FINEST, folder, shape)
            solve = [binary, "lambda", design, "--tolerance", fine, "--format", "json"]
            limit = json.loads(ran([*solve, finest, "--weights", "area"], folder)[0])["lambda_n_per_m"]
            uniform = {}
            for samples in UNIFORM:
                grid = with_grid(text, samples, folder, shape)
                one = json.loads(ran([*solve, grid], folder)[0])
                uniform[one["points"]] = abs(one["lambda_n_per_m"] / limit - 1)
            table = ran([binary, "discretize", str(ROOT / f"shapes/{shape}.toml"), "--poisson", "4.3mm", "--seed",
                         "7", "--out", "-"], folder)[0]
            rows = list(csv.DictReader(io.StringIO(table)))
            places = np.array([[float(r[k]) for k in ("x_m", "y_m", "height_m")] for r in rows])
            places = places[places[:, 2] > 0.05 * places[:, 2].max()]
            (folder / "places.csv").write_text(
                "x_m,y_m,z_m\n" + "".join(",".join(map(repr, p.tolist())) + "\n" for p in places))
            probed = ran([binary, "probe", design, "places.csv", "--magnet-force", "--components", "gz", "--tolerance",
                          fine], folder)[0]
            probed = [float(r["force_z_n_per_a"]) for r in csv.DictReader(io.StringIO(probed))]
            direct = np.array(probed).reshape(len(places), -1)
            for error in ERRORS:
                out = folder / f"{shape}_{error}"
                command = [binary, "calibrate", design, str(ROOT / f"shapes/{shape}.toml"), "--error", str(error),
                           "--refine", "--no-report", "--out", str(out), "--format", "json"]
                printed, seconds = ran(command, folder)
                one = json.loads(printed)["bundles"][0]
                headline, found = one["headline"], one["lambda_n_per_m"]
                true = abs(found / limit - 1)
                stated = headline["lambda_error_n_per_m"] / found
                force, jumps = force_errors(Bundle(one["folder"]), places, direct, found)
                reaching = [n for n, off in sorted(uniform.items()) if off <= max(true, 1e-6)]
                print(f"| {shape.replace('_', '-')} | {100 * error:g} % | {100 * true:.3g} % | {100 * stated:.2g} % | "
                      f"{stated / true:.1f} | {100 * force:.2g} % | {100 * headline['force_error']:.2g} %"
                      f"{'' if headline['requested']['met'] else ' (missed)'} | {headline['force_error'] / force:.1f} | "
                      f"{seconds:.2f} | {one['points']} | {reaching[0] if reaching else 'over ' + str(max(uniform))} |",
                      flush=True)


if __name__ == "__main__":
    main()
