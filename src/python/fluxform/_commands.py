"""The commands of the program as functions, and what they work on."""

import os
import sys
from typing import Any, Callable, Iterable, List, Optional, Union

import numpy as np

from . import _native
from ._bundle import Bundle, points_of
from ._result import Result, result_of

Progress = Union[None, bool, Callable[[str, int, int], None]]


def _shown(stage, done, total):
    counted = f" {done} of {total}" if total > 1 else ""
    sys.stderr.write(f"\r\x1b[2K{stage}{counted}")
    sys.stderr.flush()


def _reporter(progress: Progress):
    return _shown if progress is True else progress or None


def _text(value):
    if isinstance(value, (list, tuple, np.ndarray)):
        return ",".join(_text(entry) for entry in value)
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    # numpy's numbers are shown with their type.
    return repr(float(value)) if isinstance(value, (float, np.floating)) else str(value)


def _flags(options):
    for name, value in options.items():
        flag = "--" + name.rstrip("_").replace("_", "-")
        if value is True:
            yield flag
        elif isinstance(value, dict):  # --set KEY=VALUES, once a key
            yield from (f"{flag}={key}={_text(entry)}" for key, entry in value.items())
        elif value is not None and value is not False:
            yield f"{flag}={_text(value)}"


def run(command: str = "", *inputs, progress: Progress = None, kind=Result, **options) -> Any:
    """Run any command of the program: `run("sweep plan", design, set={"coil.turns": "900:1200:100"})`.

    `inputs` are a Design, a Shape, a Bundle or paths; `options` are the command's own, with `_` for
    `-`: `True` sets a flag, a list is joined with commas. `progress` is True for a line on standard
    error, or a function of stage, items done and items in all. Ctrl-C stops the computation.
    A table that the command prints is the result's `data`.
    """
    given, words = [], []
    for one in inputs:
        if isinstance(one, _Document):
            given += [] if one.text is None else [(one.path, one.text)]
            words.append(one.path)
            options = {**one.options, **options}
        else:
            words.append(os.fspath(one.folder if isinstance(one, Bundle) else one))
    if sys.executable and "FLUXFORM_PYTHON" not in os.environ:
        options.setdefault("python", sys.executable)
    arguments = ["fluxform", *command.split(), *_flags(options), *(["--", *words] if words else [])]
    json, text, data = _native.run(arguments, given, _reporter(progress))
    if progress is True:
        sys.stderr.write("\r\x1b[2K")
    result = result_of(json or b"{}", text, kind)
    if data:
        result.data = data.decode()
        if not json:
            result.text = result.data
    return result


class _Document:
    """A file that describes something: read once, then as it was read."""

    def __init__(self, text: Optional[str], path, options=None):
        self.path, self.text = os.fspath(path), text
        self.options = options or {}

    @classmethod
    def from_toml(cls, text: str, name: str):
        """From a document's text; `name` stands in messages and results."""
        return cls(text, name)

    def __repr__(self):
        return f"{type(self).__name__}({self.path!r})"


class Design(_Document):
    """Coils, cores, magnet and drivers: `Design.load("designs/seed.toml")`."""

    def __init__(self, text: str, path="design.toml", options=None):
        super().__init__(text, path, options)
        #: The design's name.
        self.name: str = _native.check_design((self.path, text))

    @classmethod
    def load(cls, path) -> "Design":
        """Read a design; every fault in it, and a file that cannot be read, is raised as one `InputError`."""
        return cls(_native.text_of(path), path)

    def evaluate(self, **options) -> Result:
        """The coil as given: circuit, field and force at the target, limits. As `fluxform evaluate`."""
        return run("evaluate", self, **options)

    def fields(
        self, points, *, force=False, tolerance: Optional[float] = None, progress: Progress = None
    ) -> Result:
        """Field and gradient per ampere of every coil at points, an array of x, y, z in m.

        `field_t_per_a` [point, coil, 3], `gradient_t_per_m_per_a` [point, coil, 3, 3] (last axis: the
        derivative); with `force=True` also `force_n_per_a` and `torque_n_m_per_a` on the magnet.
        """
        document = (self.path, self.text)
        points, _ = points_of(points)
        return Result(_native.fields(document, points, force, tolerance, _reporter(progress)))

    def map(
        self, components="gz", *, tolerance: Optional[float] = None, progress: Progress = None
    ) -> Result:
        """The maps over the workspace: `x_m`, `y_m`, `z_m`, `coil` and `gz_t_per_m_per_a`
        [coil, z, y, x]; `components` is gz, force, gradient or all. Nothing is written
        (`run("map", design, out=...)` writes)."""
        document = (self.path, self.text)
        return Result(_native.tabulate(document, components, tolerance, _reporter(progress)))


class Shape(_Document):
    """The object to be felt: `Shape.load("shapes/flat.toml")` or a surface with the command's flags,
    `Shape.load("part.stl", unit="mm", translate=[0, 0, 30], grid="61x61")`."""

    @classmethod
    def load(cls, path, **options) -> "Shape":
        """A shape file, or a surface with `unit`, `translate`, `rotate`, `grid` and so on."""
        toml = os.fspath(path).lower().endswith(".toml")
        return cls(_native.text_of(path) if toml else None, path, options)

    def points(self, **options) -> Result:
        """The constraint points: `x_m`, `y_m`, `height_m`, `normal_x` ... as arrays, and the summary
        of `fluxform discretize`; with `out` the points are in that file alone."""
        result = run("discretize", self, **{"out": "-", **options})
        if not hasattr(result, "data"):
            return result
        head, _, rows = result.data.partition("\n")
        names = head.split(",")
        rows = rows.splitlines()
        columns = np.genfromtxt(rows, delimiter=",", ndmin=2).reshape(len(rows), len(names))
        result.update(zip(names, columns.T.copy()))
        return result


class Lambda(Result):
    """The force constant of an object, with the whole path of currents over lambda."""

    @property
    def path_lambda_n_per_m(self) -> np.ndarray:
        """Force constants at which a coil meets or leaves a limit, N/m."""
        return np.array([point["lambda_n_per_m"] for point in self["path"]])

    @property
    def path_currents_a(self) -> np.ndarray:
        """Currents there, A, [point of the path, coil]."""
        return np.array([point["currents_a"] for point in self["path"]])

    def currents_at(self, lambda_n_per_m) -> np.ndarray:
        """Currents of the least error at any force constant, A, [..., coil]: linear between the
        path's points, and constant beyond the last, where every coil that helps is at a limit."""
        nodes, currents = self.path_lambda_n_per_m, self.path_currents_a
        columns = [np.interp(lambda_n_per_m, nodes, column, left=np.nan) for column in currents.T]
        return np.stack(columns, axis=-1)


def lambda_(design: Design, shape: Shape, **options) -> Lambda:
    """The force constant of one object and the currents that give it. As `fluxform lambda`."""
    return run("lambda", design, shape, kind=Lambda, **options)


def calibrate(
    design: Design, shapes: Union[Shape, Iterable[Shape]], out="results", **options
) -> List[Bundle]:
    """Map, points and force constant of each shape, one bundle each under `out`. As `fluxform calibrate`."""
    shapes = [shapes] if isinstance(shapes, (Shape, str, os.PathLike)) else list(shapes)
    result = run("calibrate", design, *shapes, out=out, **options)
    return [Bundle(report["folder"], report) for report in result["bundles"]]


def optimize(design: Design, **options) -> Result:
    """The best coil within the design's limits; `.design` is the design with it. As `fluxform optimize`."""
    result = run("optimize", design, **{"out": "-", **options})
    if hasattr(result, "data"):
        result.design = Design(result.data, design.path)
    return result


def verify(bundle, **options) -> Result:
    """Checksums, and the numbers recomputed by an independent route. As `fluxform verify`."""
    return run("verify", bundle, **options)


def compare(design: Design, *shapes, **options) -> Result:
    """How differently two objects or more feel. As `fluxform compare`."""
    return run("compare", design, *shapes, **options)


def replay(bundle, trajectory=None, **options) -> Result:
    """The currents along a trajectory, a file or `synthesize="scan"`. As `fluxform replay`; `data` is its table."""
    inputs = [bundle] if trajectory is None else [bundle, trajectory]
    return run("replay", *inputs, **{"out": "-", **options})
