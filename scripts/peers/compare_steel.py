#!/usr/bin/env python3
"""The seed on a plate of 150 x 150 x 5 mm by fluxform, NGSolve and magpylib-material-response, in one run.

    python3 scripts/peers/compare_steel.py target/release/fluxform [--resume]

Needs Python 3.11 and a way to install scripts/peers/requirements_steel.txt, which go into a virtual environment under
target/. One thread each. The error is the largest of dB_z/dz 30 mm above the nine coils with the centre driven,
relative to the driven coil's own: of fluxform and magpylib against NGSolve's finest mesh of this run, of NGSolve
against fluxform's last tolerance. CPU seconds (user and system): of fluxform the whole `probe`, all nine coils driven; of
NGSolve (tests/oracles/steel/plate.py: mesh, six solutions, which by symmetry are all nine coils, evaluation) and of
magpylib-material-response (plate_magpylib.py: one coil driven) without start and imports.

Prints a Markdown table and writes results/bench/steel.json and steel.svg. A run that was stopped goes on with --resume.
"""

import json
import os
import platform
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

from compare_map import HERE, ROOT, run

TOLERANCES = ("1e-1", "1e-2", "1e-3")
ELEMENTS = ((2, 1), (2, 2), (3, 2), (4, 2))  # order, levels
CELLS_MM = (14, 10, 8)
PLATE = "\n[plate]\nthickness_mm = 5\nx_mm = 150\ny_mm = 150\n"
# Above the nine coils, along y first, as plate.py and plate_magpylib.py have them.
PLACES = [(x, y, 0.03) for x in (-0.05, 0.0, 0.05) for y in (-0.05, 0.0, 0.05)]
OWN = 4
OUT = ROOT / "results" / "bench" / "steel.json"
# An environment of the script's own, which has matplotlib.
INSIDE = "FLUXFORM_COMPARE_STEEL_INSIDE"


def peer_python():
    folder = ROOT / "target" / "peers-steel"
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if not python.exists():
        venv.create(folder, with_pip=True)
    run(python, "-m", "pip", "install", "-q", "-r", HERE / "requirements_steel.txt")
    return str(python)


def fluxform(program, tolerance):
    with tempfile.TemporaryDirectory() as folder:
        design, points = Path(folder, "plate.toml"), Path(folder, "points.csv")
        design.write_text((ROOT / "designs" / "seed.toml").read_text() + PLATE)
        points.write_text("x_m,y_m,z_m\n" + "".join(f"{x},{y},{z}\n" for x, y, z in PLACES))
        words = ("probe", design, points, "--components", "gz", "--tolerance", tolerance, "--threads", "1")
        # An accuracy that is not reached is an exit code, with the result given.
        command = [sys.executable, "-c", TIMED, program, "--quiet", *words]
        result = json.loads(run(*command)[0])
    rows = [line.split(",") for line in result["out"].splitlines()[1:]]
    gradients = [float(row[4]) for row in rows if int(row[3]) == OWN]
    version = run(program, "--version")[0].split()[1]
    return {"program": f"fluxform {version}", "knob": f"--tolerance {tolerance}", "unknowns": None,
            "dbz_dz_t_per_m_per_a": gradients, "cpu_s": result["cpu_s"]}


# Output and CPU seconds of the command in its arguments, whatever its exit code.
TIMED = """
import json, resource, subprocess, sys
out = subprocess.run(sys.argv[1:], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout
usage = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps({"out": out, "cpu_s": usage.ru_utime + usage.ru_stime}))
"""


def elements(python, order, levels):
    result = json.loads(run(python, ROOT / "tests" / "oracles" / "steel" / "plate.py", order, levels)[0])
    return {"program": f"NGSolve {result['ngsolve']}", "knob": f"order {order}, {levels} levels",
            "unknowns": result["unknowns"], "cpu_s": result["cpu_s"],
            "dbz_dz_t_per_m_per_a": result["dbz_dz_above_coils_t_per_m_per_a"]["centre"]}


def cells(python, edge_mm):
    result = json.loads(run(python, HERE / "plate_magpylib.py", edge_mm)[0])
    return {"program": f"magpylib-material-response {result['version']} (magpylib {result['magpylib']})",
            "knob": f"cells of {edge_mm} mm", "unknowns": 3 * result["cells"], "cpu_s": result["cpu_s"],
            "dbz_dz_t_per_m_per_a": result["dbz_dz_t_per_m_per_a"]}


def judged(rows):
    """The rows with their errors."""

    def last(program):
        return [row for row in rows if row["program"].startswith(program)][-1]["dbz_dz_t_per_m_per_a"]

    for row in rows:
        reference = last("fluxform" if row["program"].startswith("NGSolve") else "NGSolve")
        off = max(abs(a - b) for a, b in zip(row["dbz_dz_t_per_m_per_a"], reference, strict=True))
        row["error"] = off / abs(reference[OWN])
    return rows


def draw(rows, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    matplotlib.rcParams["svg.hashsalt"] = "fluxform"
    figure, axes = plt.subplots(figsize=(6.4, 4.8), layout="constrained")
    for program, marker in zip(dict.fromkeys(row["program"] for row in rows), "os^"):
        own = [row for row in rows if row["program"] == program]
        axes.loglog([row["cpu_s"] for row in own], [row["error"] for row in own], marker=marker, label=program)
    axes.set_xlabel("CPU time, s")
    axes.set_ylabel("largest error of dB_z/dz, of the driven coil's own")
    axes.set_title("Nine cores on a plate, 30 mm above the coils")
    axes.grid(True, which="both", alpha=0.3)
    figure.legend(loc="outside lower center", fontsize="small")
    figure.savefig(path, metadata={"Date": None})


def brief(error):
    mantissa, exponent = f"{error:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def main():
    program = str(Path(sys.argv[1]).resolve())
    python = peer_python()
    if INSIDE not in os.environ:
        sys.exit(subprocess.run([python, *sys.argv], env={**os.environ, INSIDE: "1"}).returncode)
    rows = json.loads(OUT.read_text()) if "--resume" in sys.argv and OUT.exists() else []
    work = [(fluxform, program, tolerance) for tolerance in TOLERANCES]
    work += [(elements, python, *mesh) for mesh in ELEMENTS]
    work += [(cells, python, edge) for edge in CELLS_MM]
    for compute, *arguments in work[len(rows) :]:
        rows.append(compute(*arguments))
        OUT.write_text(json.dumps(rows, indent=1) + "\n")
    OUT.write_text(json.dumps(judged(rows), indent=1) + "\n")
    draw(rows, OUT.with_suffix(".svg"))
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}\n")
    print("| program | | unknowns | CPU s | largest error |")
    print("|---|---|---|---|---|")
    for row in rows:
        unknowns = row["unknowns"] or ""
        print(f"| {row['program']} | {row['knob']} | {unknowns} | {row['cpu_s']:.1f} | {brief(row['error'])} |")


if __name__ == "__main__":
    main()
