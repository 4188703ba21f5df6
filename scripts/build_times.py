#!/usr/bin/env python3
"""What it costs to build a revision, and to build a room's tests after an edit.

    python3 scripts/build_times.py [REVISION...] [--runs 3]

Clones each revision (HEAD unless others are named) to a temporary folder and prints processor and wall
seconds: a release build and the tests of the whole workspace from nothing, once, with the crates compiled;
then the tests of a room after one function is added to one of its files, the median of the runs. Needs git
and what the revisions need; the crates are downloaded before the clock starts.
"""

import argparse
import pathlib
import resource
import statistics
import subprocess
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
EDITED = {"lambda": "src/lambda/cone.rs", "shape": "src/shape/mesh.rs", "cli": "src/cli/values.rs"}


def ran(folder, *arguments):
    """Processor and wall seconds of a cargo command, and the crates that it compiled."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(["cargo", *arguments, "--locked"], cwd=folder, capture_output=True, text=True)
    after, wall = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - begun
    if done.returncode != 0:
        raise SystemExit(f"cargo {' '.join(arguments)}: {done.stderr[-2000:]}")
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return spent, wall, done.stderr.count("Compiling ")


def tests_of(folder, room):
    """The command that builds a room's tests."""
    if (folder / "src" / room / "Cargo.toml").exists():
        return ["test", "-p", f"fluxform-{room}", "--no-run"]
    named = ["--test", room] if (folder / "tests" / f"{room}.rs").exists() or (
        folder / "tests" / room / "main.rs").exists() else []
    return ["test", "--lib", *named, "--no-run"]


def row(what, runs):
    spent, wall, crates = (statistics.median(column) for column in zip(*runs))
    print(f"| {what} | {spent:.1f} | {wall:.1f} | {crates:.0f} |", flush=True)


def measure(revision, runs):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name) / "fluxform"
        subprocess.run(["git", "clone", "--quiet", str(ROOT), str(folder)], check=True)
        subprocess.run(["git", "checkout", "--quiet", revision], cwd=folder, check=True)
        subprocess.run(["cargo", "fetch", "--locked", "--quiet"], cwd=folder, check=True)
        for what, command in [("release", ["build", "--release"]), ("tests", ["test", "--workspace", "--no-run"])]:
            row(f"{revision}: {what}", [ran(folder, *command)])
        for room, file in EDITED.items():
            command, path = tests_of(folder, room), folder / file
            ran(folder, *command)
            edits = []
            for run in range(runs):
                with path.open("a") as text:
                    text.write(f"\n/// Added.\n#[must_use]\npub fn added_{run}() -> usize {{\n    {run}\n}}\n")
                edits.append(ran(folder, *command))
            row(f"{revision}: a function in {file}", edits)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("revisions", nargs="*", default=["HEAD"])
    parser.add_argument("--runs", type=int, default=3)
    asked = parser.parse_args()
    print("| build | CPU s | wall s | crates |\n|---|---|---|---|")
    for revision in asked.revisions:
        measure(revision, asked.runs)


if __name__ == "__main__":
    main()
