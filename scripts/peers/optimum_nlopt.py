#!/usr/bin/env python3
"""NLopt on equation 11, from more and more starts, for `fluxform-bench --peers`.

    python3 scripts/peers/optimum_nlopt.py --rows PROBLEM.json

Model and settings are those of scripts/nlopt_reference; see rows.py.
"""

import sys
import tempfile
from pathlib import Path

import rows

STARTS = (1, 2, 4, 8, 24)
SOLVERS = {"NLopt SLSQP": "LD_SLSQP", "NLopt COBYLA": "LN_COBYLA"}
# COBYLA takes a minute for all.
MOST = {"LD_SLSQP": 24, "LN_COBYLA": 4}


def main():
    asked = rows.problem()
    lacks = [rows.lacks(peer, "nlopt", "scipy", "numpy") for peer in SOLVERS]
    if any(lacks):
        rows.answer([], lacks)
        return
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    from nlopt_reference import worker

    curves = []
    with tempfile.TemporaryDirectory() as folder:
        design = Path(folder, "design.toml")
        design.write_text(asked["design"], encoding="utf-8")
        for peer, name in SOLVERS.items():
            reported = []
            for starts in STARTS:
                if starts > MOST[name]:
                    break
                worker.STARTS[name] = starts

                def work():
                    return worker.run({"design": str(design), "solver": name})["result"]

                result, spread = rows.timed(work)
                best = result["best"]
                error = abs(best["force_n"] / asked["force_n"] - 1) if best else None
                reported.append(rows.row(starts, 1, error, spread))
            curves.append(rows.curve(asked, peer, rows.version("nlopt"), "starts", reported))
    rows.answer(curves)


if __name__ == "__main__":
    main()
