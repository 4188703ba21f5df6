"""What every script here shares when `fluxform-bench --peers` runs it.

    python3 SCRIPT --rows PROBLEM.json

reads a problem (numbers, places, reference values: tests/suite/stages/problem.rs) and prints one
JSON object: `curves`, each with `curve` (the name of fluxform's on the same problem), `peer`,
`version`, `knob` and `rows` (`knob`, `items`, `error`, `seconds`, `seconds_low`, `seconds_high`,
`repeats`); and `missing`, a sentence for every peer whose packages are not installed. An error is
null where a peer failed. Seconds are processor time of this process: a warm-up, then the median
and the quartiles of the repeats.
"""

import importlib.metadata
import importlib.util
import json
import math
import os
import sys
import time

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

# Repeats end after so many, or once they took so long together; longer work counts by its first run.
MOST_REPEATS = 7
ENOUGH_S = 1.0


def problem():
    """What was requested with --rows, None without."""
    if "--rows" not in sys.argv:
        return None
    with open(sys.argv[sys.argv.index("--rows") + 1], encoding="utf-8") as file:
        return json.load(file)


def version(package):
    return importlib.metadata.version(package)


def lacks(peer, *modules):
    """A sentence on what is not installed for a peer, None if all is."""
    absent = [module for module in modules if importlib.util.find_spec(module) is None]
    return f"{peer} is not installed ({', '.join(absent)})" if absent else None


def quartiles(values):
    values = sorted(values)

    def at(part):
        place = part * (len(values) - 1)
        below = int(place)
        above = min(below + 1, len(values) - 1)
        return values[below] + (place - below) * (values[above] - values[below])

    return [at(part) for part in (0.25, 0.5, 0.75)]


def timed(work):
    """The result of `work()` and the seconds' part of a row."""
    start = time.process_time()
    result = work()
    first = time.process_time() - start
    seconds, calls = [], max(1, math.ceil(1e-3 / max(first, 1e-9)))
    if first > ENOUGH_S:
        seconds.append(first)
    while not seconds or (len(seconds) < MOST_REPEATS and sum(seconds) * calls < ENOUGH_S and first <= ENOUGH_S):
        start = time.process_time()
        for _ in range(calls):
            result = work()
        seconds.append((time.process_time() - start) / calls)
    low, median, high = quartiles(seconds)
    spread = {"seconds": median, "seconds_low": low, "seconds_high": high, "repeats": len(seconds)}
    return result, spread


def row(knob, items, error, spread):
    error = float(error) if error is not None and math.isfinite(error) else None
    return {"knob": float(knob), "items": int(items), "error": error, **spread}


def curve(asked, peer, package_version, knob, rows):
    return {"curve": asked["curve"], "peer": peer, "version": package_version, "knob": knob, "rows": rows}


def answer(curves, missing=()):
    json.dump({"curves": list(curves), "missing": [m for m in missing if m]}, sys.stdout)
    print()
