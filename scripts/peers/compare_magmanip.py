#!/usr/bin/env python3
"""The files of `map --vfield` and `map --mpem` as mag_manip reads them, against `probe`.

    python3.11 -m venv target/magmanip
    target/magmanip/bin/pip install -r scripts/peers/requirements_magmanip.txt
    target/magmanip/bin/python scripts/peers/compare_magmanip.py [DESIGN] [--fluxform BINARY]

Other options go to `map`, like --vfield-nodes 21.

Prints the largest errors of field and gradient at random places of the workspace beside those that
`map` states, and what mag_manip's least-squares currents make of a wanted field and gradient. Ends
with 1 when an error is larger than stated.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from mag_manip import mag_manip

ROOT = Path(__file__).resolve().parents[2]
HEIGHTS, ACROSS = 20, 9
# mag_manip's order: B_x, B_y, B_z, dB_x/dx, dB_x/dy, dB_x/dz, dB_y/dy, dB_y/dz.
FIVE = [0, 1, 2, 4, 5]


def magnitudes(parts):
    """|B| and |grad B| of [..., 8]."""
    xx, xy, xz, yy, yz = np.moveaxis(parts[..., 3:], -1, 0)
    square = xx**2 + yy**2 + (xx + yy) ** 2 + 2.0 * (xy**2 + xz**2 + yz**2)
    return np.stack([np.linalg.norm(parts[..., :3], axis=-1), np.sqrt(square)])


class Fluxform:
    def __init__(self, binary, folder):
        self.binary, self.folder = binary, folder

    def run(self, *words):
        command = [str(word) for word in (self.binary, "--quiet", *words)]
        return subprocess.run(command, check=False, stdout=subprocess.PIPE, text=True)

    def probe(self, design, points_m):
        """[point, coil, 8]"""
        path = Path(self.folder, "points.csv")
        rows = [",".join(repr(float(x)) for x in point) for point in points_m]
        path.write_text("\n".join(["x_m,y_m,z_m", *rows, ""]))
        run = self.run("probe", design, path)
        table = np.loadtxt(run.stdout.splitlines(), delimiter=",", skiprows=1)
        table = table.reshape(len(points_m), -1, table.shape[-1])
        return np.concatenate([table[..., 4:7], table[..., 7:16][..., FIVE]], axis=-1)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("design", nargs="?", default=str(ROOT / "designs/seed_air.toml"))
    parser.add_argument("--fluxform", default=str(ROOT / "target/release/fluxform"))
    parser.add_argument("--points", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    arguments, for_map = parser.parse_known_args()
    rng = np.random.default_rng(arguments.seed)
    good = True
    with tempfile.TemporaryDirectory() as folder:
        fluxform = Fluxform(arguments.fluxform, folder)
        files = {"vfield": Path(folder, "nodes.yaml"), "mpem": Path(folder, "mpem.yaml")}
        start = time.perf_counter()
        run = fluxform.run(
            "--format", "json", "map", arguments.design, "--out", folder,
            "--vfield", files["vfield"], "--mpem", files["mpem"], *for_map,
        )
        reported = json.loads(run.stdout)
        print(f"{reported['design']}: map took {time.perf_counter() - start:.1f} s, code {run.returncode}")
        axes = [reported["map"][key] for key in ("x_m", "y_m", "z_m")]
        low = np.array([axis["from_m"] for axis in axes])
        high = np.array([axis["to_m"] for axis in axes])

        # Random places at a few heights, and at each height a grid that tells the largest values.
        z_m = low[2] + (high[2] - low[2]) * np.concatenate([[0.0], rng.random(HEIGHTS - 1)])
        each = arguments.points // HEIGHTS
        points_m = low + (high - low) * rng.random((HEIGHTS, each, 3))
        across = np.linspace(0.0, 1.0, ACROSS)
        grid = np.stack(np.meshgrid(across, across, [0.0], indexing="ij"), -1).reshape(1, -1, 3)
        places = np.concatenate(
            [points_m, np.broadcast_to(low + (high - low) * grid, (HEIGHTS, ACROSS**2, 3))], axis=1
        )
        places[:, :, 2] = z_m[:, None]
        exact = fluxform.probe(arguments.design, places.reshape(-1, 3))
        exact = exact.reshape(*places.shape[:2], *exact.shape[1:])
        sizes = magnitudes(exact).max(axis=(2, 3))
        points_m, exact = places[:, :each], exact[:, :each]

        for name, model, backward in (
            ("vfield", mag_manip.ForwardModelLinearVField, mag_manip.BackwardModelLinearVFieldL2),
            ("mpem", mag_manip.ForwardModelMPEM, mag_manip.BackwardModelMPEML2),
        ):
            start = time.perf_counter()
            model, backward = model(), backward()
            model.setCalibrationFile(str(files[name]))
            read_s = time.perf_counter() - start
            backward.setCalibrationFile(str(files[name]))
            size_mb = files[name].stat().st_size / 1e6
            print(f"{name}: {size_mb:.2f} MB, read in {read_s:.1f} s, {model.getNumCoils()} coils")
            if name == "vfield" and model.getInterpolationType() != 1:
                sys.exit("mag_manip's default interpolation is no longer the tricubic one")
            read = np.empty_like(exact)
            start = time.process_time()
            for index in np.ndindex(points_m.shape[:2]):
                read[index] = np.asarray(model.getActuationMatrix(points_m[index])).T
            seconds = (time.process_time() - start) / (HEIGHTS * each)
            forward = np.asarray(
                model.computeFieldGradient5FromCurrents(points_m[0, 0], np.arange(1.0, exact.shape[2] + 1.0))
            ).ravel()
            if not np.allclose(forward, np.arange(1.0, exact.shape[2] + 1.0) @ read[0, 0], rtol=1e-9, atol=1e-18):
                sys.exit("computeFieldGradient5FromCurrents is not the actuation matrix times currents")
            off = magnitudes(read - exact).max(axis=(2, 3)) / sizes
            for kind, key, worst in zip(("field", "gradient"), (name, f"{name}_gradient"), off.max(axis=1)):
                stated = reported["accuracy"][key]["estimate"]
                word = "" if worst <= stated else "  MORE THAN STATED"
                good &= worst <= stated
                print(f"  {kind:9} largest error {worst:.2e}, stated {stated:.2e}{word}")
            print(f"  {1e6 * seconds:.0f} us of CPU an actuation matrix")

            # Currents for a field and gradient that currents of up to 1 A make.
            different, missed = [], [0.0, 0.0]
            stated = [reported["accuracy"][key]["estimate"] for key in (name, f"{name}_gradient")]
            for index in np.ndindex(points_m.shape[:2]):
                matrix = exact[index].T
                wanted = matrix @ rng.uniform(-1.0, 1.0, matrix.shape[1])
                theirs = np.asarray(
                    backward.computeCurrentsFromFieldGradient5(points_m[index], wanted[:3], wanted[3:])
                ).ravel()
                ours = np.linalg.pinv(matrix) @ wanted
                different.append(np.linalg.norm(theirs - ours) / np.linalg.norm(ours))
                # Both models differ by what is stated for every ampere.
                miss = magnitudes(matrix @ theirs - wanted) / sizes[:, index[0]] / np.abs(theirs).sum()
                missed = np.maximum(missed, miss)
            print(
                f"  currents differ from ours by {np.median(different):.1e} (median), "
                f"{np.quantile(different, 0.95):.1e} (95 %), {np.max(different):.1e} (worst)"
            )
            word = "" if (missed <= stated).all() else "  MORE THAN STATED"
            good &= bool((missed <= stated).all())
            print(f"  they miss field and gradient by {missed[0]:.1e}, {missed[1]:.1e} an ampere{word}")
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
