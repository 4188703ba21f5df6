#!/usr/bin/env python3
"""Copies the tables of results/bench into tests/README.md and src/DESIGN.md.

    cargo run --release -p fluxform-bench -- --peers --out results/bench
    FLUXFORM_COVERAGE=results/bench/coverage.md cargo test --locked -p fluxform-bench --test stages a_hundred
    cargo run --release -p fluxform-bench -- --stage inductance --scaling --out results/bench/scaling
    python3 scripts/bench_pages.py

Between the lines `<!-- bench: NAME -->` and `<!-- bench: end -->` of a page stands what the summary
says: `curves` (a line a curve of fluxform's own), `peers` (the ratios of times), `scaling`, `defaults`,
and `coverage` (what the stages claim of their errors against the truth).
"""

import pathlib
import re

ROOT = pathlib.Path(__file__).resolve().parent.parent
SUMMARY = ROOT / "results" / "bench" / "summary.md"
SCALING = ROOT / "results" / "bench" / "scaling" / "summary.md"
COVERAGE = ROOT / "results" / "bench" / "coverage.md"
PAGES = [ROOT / "tests" / "README.md", ROOT / "src" / "DESIGN.md"]


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
    told = parts(SUMMARY.read_text(encoding="utf-8"))
    told["scaling"] = section(SCALING.read_text(encoding="utf-8"), "Time and memory against size")
    told["coverage"] = COVERAGE.read_text(encoding="utf-8").strip()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for name, content in told.items():
            pattern = rf"(<!-- bench: {name} -->\n).*?(<!-- bench: end -->)"
            text = re.sub(pattern, lambda m, c=content: f"{m[1]}\n{c}\n\n{m[2]}", text, flags=re.DOTALL)
        page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
