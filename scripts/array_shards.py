#!/usr/bin/env python3
"""Solves the coupled cores of one array on one machine, and in shards, and compares the bundles' bytes.

    python3 scripts/array_shards.py FLUXFORM [--coils 15] [--shards 4] [--tolerance 1e-3] [--drives-only]

Prints the processor seconds and the peak memory of each run, all on one thread: of all drives on one machine
(`calibrate --shard 1/1`), of every `calibrate --shard I/N`, and of `calibrate` after both. Nothing but Python 3 is
needed.
"""

import argparse
import filecmp
import os
import subprocess
import tempfile
from pathlib import Path

PITCH_MM = 10
DESIGN = """name = "display"

[coil]
inner_diameter_mm = 5.0
outer_diameter_mm = 9.0
length_mm = 40.0
turns = 800

[wire]
diameter_mm = 0.25

[core]
below_mm = 5.0

[array]
rows = {coils}
columns = {coils}
pitch_mm = {pitch}

[supply]
current_max_a = 1.0

[target]
height_mm = 20.0

[workspace]
x_mm = [-{half}, {half}, 25]
y_mm = [-{half}, {half}, 25]
z_mm = [10.0, 30.0, 5]
"""
# An object whose forces and map take little time beside the steel.
SHAPE = """name = "flat"
primitive = "flat"
side_mm = {side}
height_mm = 20.0

[points]
x_mm = [-{half}, {half}, 25]
y_mm = [-{half}, {half}, 25]
"""


def run(command, folder):
    child = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    if status != 0:
        raise SystemExit(f"{' '.join(command)} ended with {os.waitstatus_to_exitcode(status)}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def bundle_files(folder):
    files = [path for path in folder.rglob("*") if path.is_file() and ".fluxform-cache" not in path.parts]
    return {path.relative_to(folder) for path in files if not path.name.startswith("timing")}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fluxform", type=Path)
    parser.add_argument("--coils", type=int, default=15, help="along each side")
    parser.add_argument("--shards", type=int, default=4)
    parser.add_argument("--tolerance", default="1e-3")
    parser.add_argument("--drives-only", action="store_true", help="calibrate nothing after them")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        half = 0.5 * (given.coils - 1) * PITCH_MM
        (folder / "display.toml").write_text(DESIGN.format(coils=given.coils, pitch=PITCH_MM, half=half))
        (folder / "flat.toml").write_text(SHAPE.format(side=2 * half, half=half))
        command = [str(given.fluxform.resolve()), "calibrate", "display.toml", "flat.toml"]
        command += ["--tolerance", given.tolerance, "--threads", "1", "--no-report", "--out"]
        print(f"{given.coils} x {given.coils} coupled cored coils {PITCH_MM} mm apart, to {given.tolerance}")
        rows = [("one machine", command + ["one", "--shard", "1/1"])]
        for shard in range(1, given.shards + 1):
            part = f"{shard}/{given.shards}"
            rows.append((f"shard {part}", command + ["shards", "--shard", part]))
        if not given.drives_only:
            rows += [("one, calibrate", command + ["one"]), ("shards, calibrate", command + ["shards"])]
        for label, row in rows:
            seconds, peak_mb = run(row, folder)
            print(f"  {label:18}{seconds:8.1f} CPU s{peak_mb:8.0f} MB", flush=True)
        if given.drives_only:
            return
        one, shards = folder / "one", folder / "shards"
        files = bundle_files(one)
        same = files == bundle_files(shards) and all(
            filecmp.cmp(one / file, shards / file, shallow=False) for file in files
        )
        print(f"  {'the same bytes' if same else 'DIFFERENT BYTES'} in {len(files)} files")
        raise SystemExit(0 if same else 1)


if __name__ == "__main__":
    main()
