#!/usr/bin/env python3
"""What leaving out saves: processor time of `calibrate` on four scenes.

    python3 scripts/time_saved.py [PROGRAM]

For every scene: maps over the whole workspace, maps of what the objects need (the default), and the
same again with the design's field kept from the run before. The median of five runs, in seconds of
processor time on one thread; PROGRAM is the fluxform binary, the release build by default. Prints a
Markdown table. Standard library only.
"""

import os
import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
SHAPES = [f"shapes/{name}.toml" for name in ("flat", "half_sphere", "half_cylinder", "wedge")]
RUNS = 5
PATCH = """name = "patch"
primitive = "flat"
side_mm = 20.0
height_mm = 50.0
[points]
x_mm = [-10.0, 10.0, 13]
y_mm = [-10.0, 10.0, 13]
"""


def program():
    """The binary named on the command line, or the release build."""
    if len(sys.argv) > 1:
        return sys.argv[1]
    subprocess.run(["cargo", "build", "--release", "--locked"], cwd=ROOT, check=True)
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return str(target / "release" / "fluxform")


def processor_s(arguments):
    """Seconds of processor time of one command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(arguments, cwd=ROOT, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    binary = program()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        seed = (ROOT / "designs" / "seed.toml").read_text(encoding="utf-8")
        two = folder / "two.toml"
        two.write_text(seed.replace("rows = 3\ncolumns = 3", "rows = 1\ncolumns = 2"), encoding="utf-8")
        patch = folder / "patch.toml"
        patch.write_text(PATCH, encoding="utf-8")
        scenes = [
            ("nine cored coils, four shapes", "designs/seed.toml", SHAPES),
            ("nine cored coils, flat", "designs/seed.toml", SHAPES[:1]),
            ("two cored coils, a patch of 20 mm", str(two), [str(patch)]),
            ("nine air coils, four shapes", "designs/seed_air.toml", SHAPES),
        ]
        print("| scene | whole workspace | what is needed | field kept |")
        print("|---|---|---|---|")
        for number, (name, design, shapes) in enumerate(scenes):
            out = folder / str(number)
            command = [binary, "calibrate", design, *shapes, "--out", str(out), "--quiet",
                       "--threads", "1", "--force"]
            whole = ["--no-cache", "--reach", "1000"]
            columns = []
            for flags in (whole, ["--no-cache"], []):
                if not flags:
                    processor_s(command)
                columns.append(statistics.median(processor_s(command + flags) for _ in range(RUNS)))
            print(f"| {name} | " + " | ".join(f"{seconds:.3f}" for seconds in columns) + " |", flush=True)


if __name__ == "__main__":
    main()
