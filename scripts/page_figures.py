#!/usr/bin/env python3
"""Prints every page's size and its time to first paint in headless Chromium.

    python3 scripts/page_figures.py results/seed/*/report.html

The median of five loads of each page in one browser, after one that does not count. Needs Chromium
and Python's standard library.
"""

import pathlib
import statistics
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "report"))

from browser import Browser  # noqa: E402

LOADS = 5
# The entry may come after the page is complete; without paint none comes within two seconds.
PAINT = (
    "new Promise((done) => { let left = 200; const look = () => {"
    " const e = performance.getEntriesByName('first-contentful-paint')[0];"
    " if (e || !left--) done(e ? e.startTime : null); else setTimeout(look, 10); }; look(); })"
)


def main(pages):
    browser = Browser()
    print("| page | kB | first paint, ms |\n|---|---|---|")
    missing = False
    for page in pages:
        seen = []
        for _ in range(1 + LOADS):
            browser.open(page)
            seen.append(browser.value(PAINT))
        seen = [ms for ms in seen[1:] if ms is not None]
        missing |= not seen
        reported = f"{statistics.median(seen):.0f}" if seen else "none"
        print(f"| {page} | {pathlib.Path(page).stat().st_size / 1e3:.0f} | {reported} |")
    faults = browser.faults()
    browser.close()
    if faults or missing:
        sys.exit(f"faults: {faults}" if faults else "a page was not painted")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1:])
