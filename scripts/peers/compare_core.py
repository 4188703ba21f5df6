#!/usr/bin/env python3
"""fluxform's `evaluate` of a cored coil against NGSolve on the same coil, in one run.

    python3 scripts/peers/compare_core.py [DESIGN]     # default: designs/seed.toml

Needs Python 3.11 and a way to install scripts/peers/requirements.txt, which go into a virtual
environment under target/. fluxform is the default release build; what is timed is the whole
command, user and system time, the median of REPEATS. NGSolve's time is meshing, solving and
evaluating on one thread, its start and imports left out, the median of PEER_REPEATS. Prints a
Markdown table; where fluxform gives no numbers, its message and the peer's row.
"""

import json
import os
import platform
import statistics
import subprocess
import sys

from compare_map import HERE, ROOT, peer_python, run

REPEATS = 15
PEER_REPEATS = 5
TOLERANCE = "1e-6"


def evaluate(fluxform, design):
    """The command's JSON (None where it gives none) and message, and the median CPU seconds."""
    command = [fluxform, "evaluate", design, "--format", "json", "--tolerance", TOLERANCE]
    # An unmet limit is an exit code, not a failure; `run` would stop at it.
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    try:
        numbers = json.loads(result.stdout)
    except json.JSONDecodeError:
        return None, result.stderr.strip(), None
    shell = [sys.executable, "-c", TIMED, *map(str, command)]
    seconds = [float(run(*shell)[0]) for _ in range(REPEATS)]
    return numbers, result.stderr.strip(), statistics.median(seconds)


# CPU seconds of the command in its arguments, whatever its exit code.
TIMED = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
usage = resource.getrusage(resource.RUSAGE_CHILDREN)
print(usage.ru_utime + usage.ru_stime)
"""


def main():
    design = sys.argv[1] if len(sys.argv) > 1 else "designs/seed.toml"
    python = peer_python()
    run("cargo", "build", "--release", "--locked", "--quiet")
    fluxform = ROOT / "target" / "release" / "fluxform"
    numbers, message, seconds = evaluate(fluxform, design)
    peers = [
        json.loads(run(python, HERE / "core_ngsolve.py", design)[0]) for _ in range(PEER_REPEATS)
    ]
    peer = sorted(peers, key=lambda result: result["cpu_s"])[len(peers) // 2]
    print(f"`evaluate {design}`, tolerance {TOLERANCE}, CPU seconds (median of {REPEATS} and")
    print(f"{PEER_REPEATS} runs), {platform.machine()}, {os.cpu_count()} cores\n")
    print("| program | timed | CPU s | g at the target, T/m/A | inductance, H |")
    print("|---|---|---|---|---|")
    if numbers:
        gradient = numbers["target"]["gradient_t_per_m_per_a"]
        inductance = numbers["coil"]["inductance_h"]
        version = run(fluxform, "--version")[0].split()[1]
        print(f"| fluxform {version} | whole command | {seconds:.4f} | {gradient!r} | {inductance!r} |")
    print(
        f"| NGSolve {peer['ngsolve']}, {peer['unknowns']} unknowns | mesh, solution, evaluation "
        f"| {peer['cpu_s']:.4f} | {peer['gradient_t_per_m_per_a']!r} | {peer['inductance_h']!r} |"
    )
    if numbers:
        print(f"\nRatio of CPU times: {peer['cpu_s'] / seconds:.1f}. Relative differences:")
        print(f"gradient {peer['gradient_t_per_m_per_a'] / gradient - 1:.1e},", end=" ")
        print(f"inductance {peer['inductance_h'] / inductance - 1:.1e}.")
    if message:
        print(f"\nfluxform said: {message}")


if __name__ == "__main__":
    main()
