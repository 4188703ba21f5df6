#!/usr/bin/env python3
"""Copies the tables of results/bench into tests/README.md.

    cargo run --release -p fluxform-bench -- --peers --out results/bench
    FLUXFORM_COVERAGE=results/bench/coverage.md cargo test --locked -p fluxform-bench --test stages a_hundred
    cargo run --release -p fluxform-bench -- --stage inductance --scaling --out results/bench/scaling
    python3 scripts/bench_pages.py

Between the lines `<!-- bench: NAME -->` and `<!-- bench: end -->` of that page is the summary's
part of that name: `curves` (a line a curve of fluxform's own), `peers` (the ratios of times), `scaling`, `defaults`,
and `coverage` (the stages' stated errors against the truth).
"""

import pathlib
import re

ROOT = pathlib.Path(__file__).resolve().parent.parent
SUMMARY = ROOT / "results" / "bench" / "summary.md"
SCALING = ROOT / "results" / "bench" / "scaling" / "summary.md"
COVERAGE = ROOT / "results" / "bench" / "coverage.md"
PAGE = ROOT / "tests" / "README.md"


def section(text, title):
    """The part under a heading, without it."""
    match = re.search(rf"^## {re.escape(title)}\n(.*?)(?=^## |\Z)", text, re.DOTALL | re.MULTILINE)
    return match.group(1).strip() if match else "(not measured)"


def parts(text):
    lines = text.splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("| stage |"))
    curves = []
    for line in lines[first:]:
        if not line.startswith("|"):
            break
        if "**" not in line:
            curves.append(line)
    ratios = [f"- {line}" for line in lines if "Ratio of times" in line]
    return {
        "curves": "\n".join(curves),
        "peers": "\n".join(ratios) or "(not measured)",
        "defaults": section(text, "The defaults on these curves"),
    }


def main():
    tables = parts(SUMMARY.read_text(encoding="utf-8"))
    tables["scaling"] = section(SCALING.read_text(encoding="utf-8"), "Time and memory against size")
    tables["coverage"] = COVERAGE.read_text(encoding="utf-8").strip()
    text = PAGE.read_text(encoding="utf-8")
    for name, content in tables.items():
        pattern = rf"(<!-- bench: {name} -->\n).*?(<!-- bench: end -->)"
        text = re.sub(pattern, lambda m, c=content: f"{m[1]}\n{c}\n\n{m[2]}", text, flags=re.DOTALL)
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
