#!/usr/bin/env python3
"""What more coils on the same footprint, a current loop and other force constants give.

    cargo build --release && python3 scripts/array_sizes.py target/release/fluxform
    python3 scripts/array_sizes.py target/release/fluxform --short      # 3 x 3 and one shape

Searches coil, wire, core and pitch of designs/seed_search.toml for the seed's four shapes with 3 x 3, 4 x 4
and 5 x 5 coils on the 138 mm that its nine coils take, driven by voltages and by a current loop, and with
nine coils the force constant by feedback, of the upward force and of the force vector. Prints a Markdown
table: gain over the seed's array (which breaks two limits), that of every shape, whether `evaluate
--strict` finds every limit met, the array's settling time under its driver, arrays computed, processor time.
Standard library only.
"""
import argparse
import json
import os
import resource
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SHAPES = ["flat", "half_sphere", "half_cylinder", "wedge"]
FOOTPRINT_MM = 138
VARY = {
    "coil.inner_diameter_mm": "6:30",
    "coil.outer_diameter_mm": "16:38",
    "coil.length_mm": "30:100",
    "wire.diameter_mm": "0.35,0.4,0.45,0.5,0.55,0.6,0.65,0.7",
    "array.pitch_mm": "18:60",
}
# Rows, driver, force constant.
ROWS = [(n, driver, "jnd") for driver in ("voltage", "current") for n in (3, 4, 5)]
ROWS += [(3, "voltage", "feedback"), (3, "voltage", "vector"), (3, "current", "vector")]


def run(program, *arguments):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([program, *arguments, "--format", "json"], capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if not done.stdout:
        raise SystemExit(done.stderr)
    return json.loads(done.stdout), done.returncode, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def searched(driver):
    lines = []
    for line in (ROOT / "designs/seed_search.toml").read_text().splitlines():
        if not line.startswith("array.move_mm"):
            lines.append(line)
        if line.startswith("[limits]"):
            lines.append(f"footprint_max_mm = {FOOTPRINT_MM}.0")
        if line.startswith("[supply]"):
            lines.append(f'driver = "{driver}"')
    return "\n".join(lines) + "\n"


def row(program, folder, options, case):
    count, driver, constant = case
    design, best = Path(folder) / f"{driver}.toml", Path(folder) / f"best_{driver}_{constant}_{count}.toml"
    design.write_text(searched(driver))
    vary = [part for key, values in VARY.items() for part in ("--vary", f"{key}={values}")]
    vary += ["--vary", f"array.rows={count}", "--vary", f"array.columns={count}"]
    shapes = [str(ROOT / f"shapes/{shape}.toml") for shape in options.shapes]
    found, _, seconds = run(program, "optimize", str(design), "--for", *shapes, *vary, "--constant", constant,
                            "--evaluations", str(options.evaluations), "--seed", str(options.seed), "--out", str(best))
    checked, code, _ = run(program, "evaluate", str(best), "--strict")
    settling = checked["limits"]["array_settling_s"]["value"]
    cells = [f"{count} x {count}", driver, constant, f"{found['gain']:.3f}"]
    cells += [f"{shape['gain']:.2f}" for shape in found["shapes"]]
    cells += ["met" if code == 0 else "NOT met", f"{1e3 * settling:.1f}", str(found["evaluations"]), f"{seconds:.0f}"]
    print("| " + " | ".join(cells) + " |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--evaluations", type=int, default=160)
    parser.add_argument("--seed", type=int, default=1, help="of the searches")
    parser.add_argument("--short", action="store_true")
    options = parser.parse_args()
    rows, options.shapes = ROWS, SHAPES
    if options.short:
        options.shapes, options.evaluations = SHAPES[:1], 60
        rows = [case for case in ROWS if case[0] == 3]
    os.environ.setdefault("RAYON_NUM_THREADS", "2")
    head = ["coils", "driver", "constant", "gain", *options.shapes, "limits", "settling, ms", "arrays", "CPU s"]
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    with tempfile.TemporaryDirectory() as folder:
        for case in rows:
            row(str(Path(options.program).resolve()), folder, options, case)


if __name__ == "__main__":
    main()
