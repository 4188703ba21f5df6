#!/usr/bin/env python3
"""Time and peak memory of the main commands of the default release build, or of another program.

    python3 scripts/measure.py [FLUXFORM]

Needs Python 3 and a Unix system. Each row is a whole command, process start and writing
included: the median of the repeats; CPU is user and system time of all threads. A run is cold; one
called warm finds what another cached. The share of number formatting is the difference between
`map --csv` and `map`, the efficiency the wall time of one thread over twice that of two. Prints a Markdown table.
"""

import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DESIGN = "designs/seed_air.toml"
CORED = "designs/seed.toml"
SHAPES = ["flat", "half_sphere", "half_cylinder", "wedge"]
REPEATS = 9


def measure(command):
    """Wall seconds, CPU seconds and peak resident MiB of one run."""
    start = time.perf_counter()
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"{' '.join(command)} ended with {process.returncode}")
    unit = 1 << 20 if sys.platform == "darwin" else 1 << 10
    return seconds, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / unit


def main():
    if len(sys.argv) > 1:
        fluxform = str(Path(sys.argv[1]).resolve())
    else:
        subprocess.run(["cargo", "build", "--release", "--locked", "--quiet"], cwd=ROOT, check=True)
        fluxform = str(ROOT / "target" / "release" / "fluxform")
    shapes = [f"shapes/{name}.toml" for name in SHAPES]
    rows = {
        "map": ["map", DESIGN],
        "map --threads 1": ["--threads", "1", "map", DESIGN],
        "map --csv": ["map", DESIGN, "--csv"],
        "map --components gradient": ["map", DESIGN, "--components", "gradient"],
        "calibrate, four shapes": ["calibrate", DESIGN, *shapes],
        "calibrate, four shapes, --threads 1": ["--threads", "1", "calibrate", DESIGN, *shapes],
    }
    for state in ["cold", "warm"]:
        for threads in ["1", "2"]:
            name = f"{state}: calibrate {CORED}, four shapes, --threads {threads}"
            rows[name] = ["--threads", threads, "calibrate", CORED, *shapes]
    print(f"`{DESIGN}`, {platform.machine()}, {os.cpu_count()} cores, median of {REPEATS} runs\n")
    print("| command | wall s | CPU s | peak memory MiB | written MiB |")
    print("|---|---|---|---|---|")
    cpu, walls = {}, {}
    for name, arguments in rows.items():
        runs = []
        for _ in range(REPEATS):
            with tempfile.TemporaryDirectory() as folder:
                command = [fluxform, "--quiet", *arguments, "--out", folder + "/out"]
                if name.startswith("warm"):
                    measure(command)
                    command.append("--force")
                runs.append(measure(command))
                written = sum(f.stat().st_size for f in Path(folder).rglob("*") if f.is_file())
        walls[name], cpu[name], memory = (statistics.median(column) for column in zip(*runs))
        print(f"| {name} | {walls[name]:.3f} | {cpu[name]:.3f} | {memory:.0f} | {written / 2**20:.1f} |")
    text = cpu["map --csv"] - cpu["map"]
    print(f"\nThe text of `--csv`: {text:.3f} CPU s, {text / cpu['map --csv']:.0%} of `map --csv`.")
    one, two = (wall for name, wall in walls.items() if name.startswith("cold"))
    print(f"Efficiency of two threads on `{CORED}`: {one / (2 * two):.2f}.")


if __name__ == "__main__":
    main()
