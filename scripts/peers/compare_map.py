#!/usr/bin/env python3
"""fluxform's `map` against magpylib on the same nine coils and grid, in one run.

    python3 scripts/peers/compare_map.py [DESIGN]     # default: designs/seed_air.toml

Needs Python 3.11 and a way to install scripts/peers/requirements.txt, which go into a virtual
environment under target/. fluxform is the default release build; what is timed is the whole
command, process start and writing of map.npz included, user and system time of all threads, the
median of REPEATS. magpylib's time is its computation alone. Prints a Markdown table.
"""

import json
import os
import platform
import resource
import statistics
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
REPEATS = 15
PEER_REPEATS = 3


def run(*command):
    """Output of a command, and the CPU seconds it took."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    output = subprocess.run(
        [str(word) for word in command], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return output, after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def peer_python():
    """Python of a virtual environment that holds the pinned requirements."""
    folder = ROOT / "target" / "peers"
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if not python.exists():
        venv.create(folder, with_pip=True)
    run(python, "-m", "pip", "install", "-q", "-r", HERE / "requirements.txt")
    return python


def main():
    design = sys.argv[1] if len(sys.argv) > 1 else "designs/seed_air.toml"
    python = peer_python()
    run("cargo", "build", "--release", "--locked", "--quiet")
    fluxform = ROOT / "target" / "release" / "fluxform"
    version = run(fluxform, "--version")[0].split()[1]
    with tempfile.TemporaryDirectory() as folder:
        reference, ours = Path(folder, "reference"), Path(folder, "ours")
        run(
            fluxform, "--quiet", "map", design, "--out", reference,
            "--components", "gradient", "--tolerance", "1e-12",
        )
        seconds = []
        for repeat in range(REPEATS):
            out = ours / str(repeat)
            seconds.append(run(fluxform, "--quiet", "map", design, "--out", out)[1])
        peers = [
            json.loads(
                run(python, HERE / "map_magpylib.py", design, reference / "map.npz", out / "map.npz")[0]
            )
            for _ in range(PEER_REPEATS)
        ]
    peer = sorted(peers, key=lambda result: result["cpu_s"])[len(peers) // 2]
    whole = statistics.median(seconds)
    count = peer["point_coils"]
    print(f"`map {design}`, {count} point-coils, CPU seconds (median of {REPEATS} and {PEER_REPEATS} runs),")
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {peer['python']}, numpy {peer['numpy']}\n")
    print("| program | timed | CPU s | ns a point-coil | largest error |")
    print("|---|---|---|---|---|")
    print(
        f"| fluxform {version} | whole command, map.npz written | {whole:.4f} "
        f"| {whole / count * 1e9:.1f} | {peer['error_ours']:.1e} |"
    )
    print(
        f"| magpylib {peer['magpylib']} | computation alone, one thread | {peer['cpu_s']:.2f} "
        f"| {peer['cpu_s'] / count * 1e9:.0f} | {peer['error']:.1e} |"
    )
    print(f"\nRatio of CPU times: {peer['cpu_s'] / whole:.0f}.")
    print("Errors: of dB_z/dz, relative to the largest |grad B| at each height, against fluxform")
    print("at --tolerance 1e-12 (tests/air_coil.rs holds its kernel against 40-digit values).")


if __name__ == "__main__":
    main()
