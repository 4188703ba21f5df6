"""What the tests of the wheel run inside its environment: `checks.py NAME [ARGUMENT]`."""

import _thread
import json
import pathlib
import signal
import subprocess
import sys

import numpy as np

import fluxform
from fluxform import _result

AIR = """
name = "small"
coil = { inner_diameter_mm = 12.0, outer_diameter_mm = 30.0, length_mm = 40.0 }
wire = { diameter_mm = 0.7 }
array = { rows = 2, columns = 2, pitch_mm = 34.0 }
magnet = { diameter_mm = 10.0, length_mm = 10.0, magnetization_a_per_m = 1.1579e6, polarity = "repel" }
supply = { current_max_a = 2.0 }
workspace = { x_mm = [-30.0, 30.0, 13], y_mm = [-30.0, 30.0, 11], z_mm = [10.0, 40.0, 9] }
"""
DOME = """
name = "dome"
primitive = "half-sphere"
radius_mm = 20.0
base_mm = 15.0
points = { x_mm = [-20.0, 20.0, 17], y_mm = [-20.0, 20.0, 17] }
"""


def written():
    """Design and shape as files, read."""
    pathlib.Path("small.toml").write_text(AIR)
    pathlib.Path("dome.toml").write_text(DOME)
    return fluxform.Design.load("small.toml"), fluxform.Shape.load("dome.toml")


def program(*arguments):
    """Standard output of the program."""
    folder = pathlib.Path(sys.executable).parent
    ran = subprocess.run([folder / "fluxform", *arguments], capture_output=True, text=True, check=True)
    return ran.stdout


def numbers_of_the_command():
    """evaluate, probe, map, discretize, lambda and calibrate, to the last bit."""
    design, shape = written()
    for command, result in [
        (["evaluate", "small.toml"], design.evaluate()),
        (["lambda", "small.toml", "dome.toml"], fluxform.lambda_(design, shape)),
    ]:
        printed = program(*command, "--format", "json")
        assert dict.__repr__(_result.result_of(printed, "")) == dict.__repr__(result), command
    points = [[0.011, -0.004, 0.023], [0.0, 0.002, 0.03]]
    pathlib.Path("points.csv").write_text("x_m,y_m,z_m\n0.011,-0.004,0.023\n0,0.002,0.03\n")
    rows = np.array([line.split(",") for line in program("probe", "small.toml", "points.csv").split()[1:]])
    rows = rows.astype(float).reshape(2, 4, -1)
    fields = design.fields(points, force=True)
    assert np.array_equal(rows[:, :, 4:7], fields.field_t_per_a)
    assert np.array_equal(rows[:, :, 7:], fields.gradient_t_per_m_per_a.reshape(2, 4, 9))
    assert fields.force_n_per_a.shape == fields.torque_n_m_per_a.shape == (2, 4, 3)
    for components in ["gz", "force", "all"]:
        program("map", "small.toml", "--out", components, "--components", components)
        here = design.map(components)
        there = dict(np.load(f"{components}/map.npz"))
        shared = set(here) & set(there)
        assert len(shared) >= 5, shared
        for key in shared:
            assert np.array_equal(here[key], there[key]), (components, key)
        assert set(here) - set(there) == {"relative_error"}, set(here) - set(there)
    points = shape.points()
    table = program("discretize", "dome.toml", "--out", "-").split("\n")
    assert table[0].split(",")[:3] == ["x_m", "y_m", "height_m"]
    assert [float(row.split(",")[2]) for row in table[1:-1]] == list(points.height_m)
    path = fluxform.lambda_(design, shape)
    chosen = path.currents_at(path.lambda_n_per_m)
    assert np.allclose(chosen, path.currents_a, atol=1e-9), (chosen, path.currents_a)
    [bundle] = fluxform.calibrate(design, shape, out="here")
    program("calibrate", "small.toml", "dome.toml", "--out", "there", "--threads", "1")
    for name in ["map.npz", "points.csv", "currents.csv", "lambda.json", "manifest.json"]:
        here, there = (pathlib.Path(out, "small/dome", name).read_bytes() for out in ["here", "there"])
        assert here == there, name
    assert bundle.report.lambda_n_per_m == bundle.lambda_n_per_m
    assert all(check.passed for check in fluxform.verify(bundle).checks)
    assert np.array_equal(bundle.map["x_m"], np.load("here/small/dome/map.npz")["x_m"])
    assert "dome" in repr(bundle) and "<svg" in bundle._repr_html_()


def currents_of_the_loader():
    """Eq. 8 by Rust and by the file that needs numpy alone, upwards and as a vector."""
    from fluxform import load_bundle

    design, _ = written()
    normal = fluxform.Shape.from_toml(DOME + 'force = "normal"\n', "normal.toml")
    for shape in [fluxform.Shape.load("dome.toml"), normal]:
        [bundle] = fluxform.calibrate(design, shape, out="results", force=True)
        loader = load_bundle.Bundle(str(bundle.folder))
        random = np.random.default_rng(7)
        positions = random.uniform([-0.03, -0.03, 0.005], [0.03, 0.03, 0.04], (300, 3))
        found = bundle.currents(positions)
        currents, force, answer = loader.currents(positions)
        assert set(found.answer) == {"ok", "saturated", "outside"} and list(found.answer) == list(answer)
        assert np.allclose(found.currents_a, currents, atol=1e-9)
        assert np.allclose(found.force_n, force, atol=1e-9)
        assert np.allclose(bundle.force_per_ampere(positions), loader.force_per_ampere(positions), atol=1e-12)
        one = bundle.currents(positions[3])
        assert np.array_equal(one.currents_a, found.currents_a[3]) and one.answer == answer[3]
        heights = bundle.height(positions)
        assert np.allclose(heights, loader.height(positions), atol=1e-12, equal_nan=True)


def documents_in_memory():
    """Every command takes a design that is no file, and records the name that it was given."""
    design = fluxform.Design.from_toml(AIR, "memory.toml")
    shape = fluxform.Shape.from_toml(DOME, "dome.toml")
    [bundle] = fluxform.calibrate(design, [shape], out="results")
    assert [entry["path"] for entry in bundle.manifest["inputs"]] == ["memory.toml", "dome.toml"]
    assert not pathlib.Path("memory.toml").exists()
    limits = "limits = { power_max_w = 5.0 }\ntarget = { height_mm = 20.0 }\n"
    best = fluxform.optimize(fluxform.Design.from_toml(AIR + limits, "memory.toml"))
    assert best.design.evaluate().coil.power_w <= 5.0 + 1e-9
    assert len(fluxform.replay(bundle, synthesize="scan").data) > 100
    other = fluxform.Shape.from_toml(DOME.replace("dome", "other"), "other.toml")
    assert "pairs" in fluxform.compare(design, shape, other)
    assert fluxform.load_bundle.Bundle(str(bundle.folder))
    assert shape.points(out="points.csv").points > 0 and pathlib.Path("points.csv").exists()
    assert "fluxform" in repr(fluxform.run("man"))
    plan = fluxform.run("sweep plan", design, set={"wire.diameter_mm": [0.5, 0.7]}, out="plan.json")
    assert plan.points == 2 and pathlib.Path("plan.json").exists()


def failures():
    """Exceptions of the exit code's kind."""
    try:
        fluxform.Design.from_toml(AIR.replace("length_mm = 40.0", "lenght_mm = 40.0", 1), "wrong.toml")
        raise AssertionError("accepted")
    except fluxform.InputError as error:
        assert error.code == "E301" and error.exit_code == 3, error
        named = [fault for fault in error.faults if fault.key == "coil.lenght_mm"]
        assert named[0].file == "wrong.toml" and named[0].line == 3, named
        assert "length_mm" in named[0].advice and any("length_mm" in advice for advice in error.advice)
        assert "Causes:" in str(error.explain())
    # A file that is no text, and one that is not there: what the program says of them, not UnicodeDecodeError.
    pathlib.Path("binary.toml").write_bytes(b"\x7fELF\x02\xff")
    for load in [fluxform.Design.load, fluxform.Shape.load]:
        for path, said in [("binary.toml", "not UTF-8"), (pathlib.Path("none.toml"), "cannot read")]:
            try:
                load(path)
                raise AssertionError("read")
            except fluxform.InputError as error:
                assert error.code == "E301" and said in error.message, error
                assert error.faults[0].file == str(path), error.faults
    # A mark at the beginning is no fault.
    pathlib.Path("marked.toml").write_bytes(b"\xef\xbb\xbf" + AIR.replace("\n", "\r\n").encode())
    assert fluxform.Design.load("marked.toml").evaluate().design == "small"
    design, shape = written()
    for bad in [float("nan"), float("inf")]:
        try:
            design.fields([[0.007, 0.0, 0.03], [bad, 0.0, 0.03]])
            raise AssertionError("computed")
        except fluxform.InputError as error:
            assert "point 2" in error.message and "finite" in error.message, error
    try:
        design.evaluate(tolernce=1e-6)
        raise AssertionError("accepted")
    except fluxform.UsageError as error:
        assert "--tolerance" in error.message
    limits = fluxform.Design.from_toml(AIR + "limits = { power_max_w = 0.1 }\n", "limits.toml")
    try:
        limits.evaluate(strict=True)
        raise AssertionError("met")
    except fluxform.UnmetError as error:
        assert error.result.limits.power_w.met is False
    [bundle] = fluxform.calibrate(design, shape)
    table = bundle.folder / "points.csv"
    table.write_bytes(table.read_bytes().replace(b"0.0", b"0.1", 1))
    try:
        fluxform.Bundle.open(bundle.folder)
        raise AssertionError("opened")
    except fluxform.VerificationError as error:
        assert error.code == "E502"


def interruption():
    """KeyboardInterrupt leaves nothing behind that would stop the next computation."""
    fine = fluxform.Design.from_toml(AIR.replace("13]", "901]").replace("11]", "901]"), "fine.toml")
    design, shape = written()
    # A shell's background jobs ignore Ctrl-C, and Python then leaves it ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # As the signal would, while the computation runs.
    try:
        fine.map("all", progress=lambda *_: _thread.interrupt_main())
        raise AssertionError("not stopped")
    except KeyboardInterrupt:
        pass
    assert fluxform.lambda_(design, shape).lambda_n_per_m > 0.0


def progress():
    """A function hears stages; one that raises stops the computation."""
    fine = fluxform.Design.from_toml(AIR.replace("13]", "401]").replace("11]", "401]"), "fine.toml")
    heard = []
    fine.map("all", progress=lambda *stage: heard.append(stage))
    assert heard and all(done <= max(total, done) and name for name, done, total in heard), heard

    def stop(*_):
        raise RuntimeError("enough")

    try:
        fluxform.run("map", fine, out="map", components="all", progress=stop)
        raise AssertionError("not stopped")
    except RuntimeError as error:
        assert str(error) == "enough"


def docstrings():
    """The examples in the modules."""
    import doctest

    from fluxform import _bundle, _commands, _errors, _result

    for module in [fluxform, _bundle, _commands, _errors, _result]:
        assert doctest.testmod(module).failed == 0, module


def notebook(path):
    """Runs the cells in order, as Jupyter does, and prints how many lines of code they hold."""
    cells = json.loads(pathlib.Path(path).read_text())["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    names = {}
    for cell in code:
        exec(compile(cell, path, "exec"), names)
    assert abs(names["felt_n"] / names["wanted_n"] - 1.0) < 1e-3
    print(sum(bool(line.strip()) for cell in code for line in cell.splitlines()))


if __name__ == "__main__":
    globals()[sys.argv[1]](*sys.argv[2:])
