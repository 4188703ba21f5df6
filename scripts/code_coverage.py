#!/usr/bin/env python3
"""Which share of the program's lines and regions the tests run, room by room.

    cargo install --locked cargo-llvm-cov@0.9.1
    rustup component add llvm-tools
    python3 scripts/code_coverage.py

cargo-llvm-cov builds the program with counters and runs all tests, and so does this: the library's,
those of tests/ and what the program does when those call it. Test modules are left out of the
count. A generic function's region counts as run when one of its instances runs it. Without rustup,
set LLVM_COV and LLVM_PROFDATA to tools of the compiler's own LLVM (`rustc --version --verbose`).

Writes results/bench/code_coverage.csv.
"""

import collections
import csv
import json
import os
import pathlib
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
TABLE = ROOT / "results" / "bench" / "code_coverage.csv"


def counted():
    """The report of cargo-llvm-cov, as it writes it."""
    environment = dict(os.environ, CARGO_TERM_COLOR="never")
    # One file for several processes: the tests start the program some thousand times.
    environment["LLVM_PROFILE_FILE_NAME"] = "fluxform-%8m.profraw"
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "report.json"
        # A test that holds a time may fail in a build that counts; what it ran counts all the same.
        subprocess.run(
            ["cargo", "llvm-cov", "--locked", "--ignore-run-fail", "--json", "--output-path", path],
            cwd=ROOT, env=environment, check=True,
        )
        return json.loads(path.read_text())["data"][0]


def first_test_line(path):
    """The line where a file's test module starts, 0 for a file of nothing else."""
    if path.stem == "tests" or path.stem.endswith("_tests"):
        return 0
    rows = path.read_text().splitlines()
    for line, row in enumerate(rows[:-1], 1):
        if row == "#[cfg(test)]" and rows[line].startswith("mod ") and rows[line].endswith("{"):
            return line
    return len(rows) + 1


def runs(report):
    """(room, "lines" or "regions") -> place -> how often it ran."""
    source = ROOT / "src"
    before = {str(path): first_test_line(path) for path in source.rglob("*.rs")}
    found = collections.defaultdict(lambda: collections.defaultdict(int))
    for function in report["functions"]:
        for start, column, end, last, count, file, _, kind in function["regions"]:
            path = function["filenames"][file]
            if kind != 0 or start >= before.get(path, 0):
                continue
            parts = pathlib.Path(path).relative_to(source).parts
            room = parts[0] if len(parts) > 1 else "main, lib"
            place = (path, start, column, end, last)
            found[room, "regions"][place] = max(found[room, "regions"][place], count)
    for file in report["files"]:
        path = file["filename"]
        if path not in before:
            continue
        parts = pathlib.Path(path).relative_to(source).parts
        room = parts[0] if len(parts) > 1 else "main, lib"
        for line, count in line_counts(file["segments"]).items():
            if line < before[path]:
                found[room, "lines"][path, line] = count
    return found


def line_counts(segments):
    """A line's count: the largest of the segments that begin in it, or of the one it lies in."""
    counts, open_count = {}, None
    for index, (line, _, count, has_count, is_entry, is_gap) in enumerate(segments):
        if has_count and is_entry and not is_gap:
            counts[line] = max(counts.get(line, 0), count)
        open_count = count if has_count and not is_gap else None
        if index + 1 < len(segments) and open_count is not None:
            for inner in range(line + 1, segments[index + 1][0] + 1):
                counts.setdefault(inner, open_count)
    return counts


def main():
    found = runs(counted())
    rooms = sorted({room for room, _ in found})
    with TABLE.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["room", "lines", "lines_run", "regions", "regions_run"])
        total = [0, 0, 0, 0]
        for room in rooms:
            row = []
            for what in ("lines", "regions"):
                counts = found[room, what].values()
                row += [len(counts), sum(count > 0 for count in counts)]
            total = [a + b for a, b in zip(total, row)]
            writer.writerow([room, *row])
        writer.writerow(["all", *total])
    print(TABLE.read_text(), end="")


if __name__ == "__main__":
    main()
