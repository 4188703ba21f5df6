#!/usr/bin/env python3
"""Load a fluxform bundle: numpy only, Python 3.9 or newer.

    from load_bundle import Bundle
    bundle = Bundle("results/seed/flat")
    force = bundle.force_per_ampere([[0.01, 0.0, 0.05]])   # N/A, one row a point, one column a coil
    total = force @ bundle.currents_a                      # N
    total += bundle.passive_force([[0.01, 0.0, 0.05]])     # N, the unpowered steel's pull; 0 without
    currents, force, answer = bundle.currents([[0.01, 0.0, 0.05]])   # with position feedback (eq. 8)
    force = bundle.force_vectors_per_ampere([[0.01, 0.0, 0.05]])     # N/A along x, y, z, where it has them

vector_dual.py must lie beside it for forces with a direction, expected_error.py for robust currents.
Or on the command line: lambda, and the force of the static currents at points given as x,y,z in m:

    python3 load_bundle.py results/seed/flat 0.01,0,0.05 0.02,-0.01,0.05
"""

import csv
import hashlib
import importlib
import io
import json
import math
import os
import re
import struct
import stat
import sys
import zlib

import numpy as np

SCHEMA_MAJOR = 1
INTERPOLATION = "tricubic-lagrange"
REQUIRED = ("map.npz", "points.csv", "currents.csv", "lambda.json")
CHUNK_POINTS = 4096
# Of map.npz only these arrays are read.
ARRAYS = (
    "schema_version", "x_m", "y_m", "z_m", "coil", "gz_t_per_m_per_a", "moment_a_m2", "current_min_a",
    "current_max_a", "resistance_ohm",
)
OPTIONAL_ARRAYS = (
    "gx_t_per_m_per_a", "gy_t_per_m_per_a", "requested_direction", "sideways_weight",
    "robust_setting",
    "gradient_t_per_m_per_a", "field_t_per_a", "passive_force_n",
    "working_point_gz_t_per_m", "total_current_max_a", "lambda_n_per_m", "height_x_m",
    "height_y_m", "height_m", "has_height", "static_current_a", "inductance_h", "voltage_v",
)
# Headers as numpy writes them, spaces left out, and no others: no parser of Python's sees them.
HEADER = re.compile(
    rb"\{'descr':'(<f8|<i8)','fortran_order':False,'shape':\(((?:\d{1,18},)*(?:\d{1,18})?)\),?\}"
)
# A space may be anywhere but in a number.
PARTED = re.compile(rb"\d +\d")
MANIFEST_MAX_BYTES = 64 << 20
# Larger files are none of a bundle's; of one beyond HOLES_FROM bytes at least one byte in HOLES_SHARE
# lies on the disk: a file of holes takes far more memory than it took to make.
FILE_MAX_BYTES = 1 << 32
HOLES_FROM = 16 << 20
HOLES_SHARE = 64
BLOCK_BYTES = 1 << 16
MAX_ENTRIES = 64
# Larger numbers are none that a coil or magnet gives; nodes lie within FARTHEST_M and are no closer
# to each other than CLOSEST_M: then what interpolation and eq. 8 make of them is finite.
LARGEST = 1e30
FARTHEST_M = 1e6
CLOSEST_M = 1e-15
# What broken content makes Python raise.
CONTENT_ERRORS = (
    KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError, RecursionError,
    csv.Error,
)


class BundleError(Exception):
    """The bundle cannot be used; the message says why."""


def _beside(module):
    """A file beside this one, which bundles of the upward force alone do without."""
    try:
        return importlib.import_module(f".{module}" if __package__ else module, __package__)
    except ImportError:
        raise BundleError(f"this bundle needs {module}.py beside {os.path.basename(__file__)}") from None


class Bundle:
    """A bundle in memory, its checksums checked.

    Attributes: manifest and lambda_ (dicts), map (dict of arrays), points (columns x_m, y_m,
    height_m, normal_x, normal_y, normal_z by name), currents_a, lambda_n_per_m (None if none).
    """

    def __init__(self, folder):
        self.folder = os.fspath(folder)
        try:
            self._load()
        except CONTENT_ERRORS as error:
            raise BundleError(f"{self.folder}: a key is missing or of the wrong kind: {error!r}") from None
        except (OSError, MemoryError) as error:
            raise BundleError(f"{self.folder}: cannot be read: {error!r}") from None

    def _load(self):
        self.manifest = self._read_manifest()
        files = self._read_files()
        self.lambda_ = _json(files["lambda.json"])
        self.points = _table(files["points.csv"], "points.csv")
        self.currents_a = _table(files["currents.csv"], "currents.csv")["current_a"]
        self.map = _arrays(files["map.npz"])
        self.lambda_n_per_m = self.manifest["lambda"]["lambda_n_per_m"]
        chosen = self.map.get("lambda_n_per_m")
        if self.lambda_n_per_m != (None if chosen is None else float(chosen)):
            raise BundleError("map.npz and manifest.json must agree on lambda_n_per_m")
        reported = self.manifest["map"]
        passive = reported.get("passive_force")
        for reported in [reported] if passive is None else [reported, passive]:
            name = reported["interpolation"]["name"]
            if name != INTERPOLATION:
                raise BundleError(f"interpolation {name!r}, this loader implements {INTERPOLATION!r}")
        if (passive is not None) != ("passive_force_n" in self.map):
            raise BundleError("map.npz must have passive_force_n where the manifest tells of it")
        grid = tuple(len(self.map[key]) for key in ("coil", "z_m", "y_m", "x_m"))
        coils = (self.coil_count,)
        for key, shape in (
            ("gz_t_per_m_per_a", grid),
            ("gx_t_per_m_per_a", grid),
            ("gy_t_per_m_per_a", grid),
            ("requested_direction", self._surface() + (3,)),
            ("sideways_weight", ()),
            ("robust_setting", (5,)),
            ("gradient_t_per_m_per_a", grid + (3, 3)),
            ("field_t_per_a", grid + (3,)),
            ("passive_force_n", grid[1:]),
            ("moment_a_m2", (3,)),
            ("current_min_a", coils),
            ("resistance_ohm", coils),
            ("working_point_gz_t_per_m", grid[1:]),
            ("total_current_max_a", ()),
            ("lambda_n_per_m", ()),
            ("voltage_v", ()),
            ("static_current_a", coils),
            ("inductance_h", coils + coils),
            ("height_m", self._surface()),
            ("has_height", self._surface()),
        ):
            if key in self.map and self.map[key].shape != shape:
                raise BundleError(f"map.npz: {key} must have shape {shape}, has {self.map[key].shape}")
        for key in ("x_m", "y_m", "z_m", *(("height_x_m", "height_y_m") if "height_m" in self.map else ())):
            nodes = self.map[key]
            if not len(nodes) or not np.all(np.diff(nodes) > 0):
                raise BundleError(f"map.npz: {key} must increase from node to node")
            if np.any(np.abs(nodes) > FARTHEST_M) or np.any(np.diff(nodes) < CLOSEST_M):
                raise BundleError(f"map.npz: {key} must have nodes within 1e6 m and 1e-15 m apart")
        coil = self.map["coil"]
        if np.any(coil < 0) or np.any(coil >= self.coil_count) or np.any(np.diff(coil) <= 0):
            raise BundleError("map.npz: coil must hold increasing indices of coils")
        if self.currents_a.shape != coils:
            raise BundleError("currents.csv must have one row a coil")
        moment = self.map["moment_a_m2"]
        if np.any(moment[:2] != 0) and "gradient_t_per_m_per_a" not in self.map:
            raise BundleError("map.npz: a tilted magnet needs gradient_t_per_m_per_a")
        if ("gx_t_per_m_per_a" in self.map) != ("gy_t_per_m_per_a" in self.map):
            raise BundleError("map.npz: gx_t_per_m_per_a and gy_t_per_m_per_a belong together")
        if "height_x_m" in self.map:
            self._check_rendering()

    def _check_rendering(self):
        for key in ("height_y_m", "height_m", "has_height", "static_current_a", "inductance_h"):
            if key not in self.map:
                raise BundleError(f"map.npz: array {key} is missing")
        if not np.all(np.isin(self.map["has_height"], (0.0, 1.0))):
            raise BundleError("map.npz: has_height must hold 0 or 1")
        if not np.all(self.map["resistance_ohm"] >= 1 / LARGEST):
            raise BundleError("map.npz: resistance_ohm must be above 0")
        low, high = self.map["current_min_a"], self.map["current_max_a"]
        if np.any(low > 0) or np.any(high < 0) or self.map.get("total_current_max_a", 0.0) < 0:
            raise BundleError("map.npz: current_max_a: limits must enclose 0")
        if "requested_direction" in self.map:
            if "gx_t_per_m_per_a" not in self.map:
                raise BundleError("map.npz: array gx_t_per_m_per_a is missing")
            if not 1e-6 <= float(self.map["sideways_weight"]) <= 1:
                raise BundleError("map.npz: sideways_weight must lie between 1e-6 and 1")
        setting = self.map.get("robust_setting", np.ones(5))
        if np.any(setting < 0) or setting[0] == 0:
            raise BundleError("map.npz: robust_setting must hold a price above 0 and nothing below 0")

    def _surface(self):
        return tuple(len(self.map.get(key, ())) for key in ("height_y_m", "height_x_m"))

    @property
    def coil_count(self):
        """Number of coils of the array, those left out of the map included."""
        return len(self.map["current_max_a"])

    def inside(self, points_m):
        """True for each point (x, y, z in m) within the map's grid."""
        points_m = _rows(points_m)
        ends = [_ends(self.map[key]) for key in ("x_m", "y_m", "z_m")]
        low, high = np.transpose(ends)
        return np.all((low <= points_m) & (points_m <= high), axis=1)

    def gz_per_ampere(self, points_m):
        """dB_z/dz [T/m/A]: one row a point, one column a coil; zero outside the map."""
        return self._interpolate(self.map["gz_t_per_m_per_a"], points_m)

    def force_per_ampere(self, points_m):
        """Upward force on the magnet [N/A]: one row a point, one column a coil; zero outside."""
        m_x, m_y, m_z = self.map["moment_a_m2"]
        if m_x == 0 and m_y == 0:
            return m_z * self.gz_per_ampere(points_m)
        if "gradient_t_per_m_per_a" not in self.map:
            raise BundleError("a tilted magnet needs gradient_t_per_m_per_a in map.npz")
        gradient = self.map["gradient_t_per_m_per_a"]
        return sum(
            moment * self._interpolate(gradient[..., row, 2], points_m)
            for row, moment in enumerate((m_x, m_y, m_z))
        )

    def force_vectors_per_ampere(self, points_m):
        """Force on the magnet [N/A]: point, coil, then x, y, z; zero outside. An error for bundles that
        hold the upward force alone."""
        if "gx_t_per_m_per_a" not in self.map:
            raise BundleError("map.npz holds the upward force alone: calibrate with force = \"vertical-only\"")
        m_x, m_y, m_z = self.map["moment_a_m2"]
        parts = []
        for axis, name in enumerate(("gx", "gy", "gz")):
            if m_x == 0 and m_y == 0:
                parts.append(m_z * self._interpolate(self.map[f"{name}_t_per_m_per_a"], points_m))
                continue
            # F = grad (m . B): of a tilted magnet all of the gradient counts.
            gradient = self.map["gradient_t_per_m_per_a"]
            parts.append(sum(
                moment * self._interpolate(gradient[..., row, axis], points_m)
                for row, moment in enumerate((m_x, m_y, m_z))
            ))
        return np.stack(parts, axis=2)

    def requested_force(self, points_m):
        """The force vector requested [N] at x, y: lambda times the height, upward unless the bundle requests
        another direction; zero where there is no surface."""
        points_m = _rows(points_m, further=True)
        height, direction = self._on_surface(points_m)
        size = self._force_constant() * np.nan_to_num(height)
        return size[:, None] * np.nan_to_num(direction)

    def passive_force(self, points_m):
        """What the unpowered steel adds to the force [N], up positive; zero outside or without it."""
        points_m = _rows(points_m)
        result = np.zeros((len(points_m), 1))
        if "passive_force_n" in self.map:
            self._fill(self.map["passive_force_n"][None], points_m, result, [0])
        return result[:, 0]

    def height(self, points_m):
        """Height of the surface [m] at x, y (further columns are passed over); NaN where none is."""
        points_m = _rows(points_m, further=True)
        if "height_m" not in self.map:
            raise BundleError("map.npz holds no heights: it is of a schema before 1.2; calibrate again")
        return self._on_surface(points_m)[0]

    def _on_surface(self, points_m):
        """Heights [m] and directions of the requested force, bilinear between the nodes; NaN where none is."""
        nodes = self.map["height_x_m"], self.map["height_y_m"]
        (column, s, in_x), (row, t, in_y) = (_between(n, points_m[:, k]) for k, n in enumerate(nodes))
        has = self.map["has_height"]
        right, above = column + (s > 0), row + (t > 0)
        # A node of no weight has a neighbour of its own as its twin, so all four may be asked.
        there = has[row, column] * has[row, right] * has[above, column] * has[above, right]
        where = in_x & in_y & (there > 0)

        def between(values):
            result = np.full(len(points_m), np.nan)
            low = (1 - s) * values[row, column] + s * values[row, right]
            high = (1 - s) * values[above, column] + s * values[above, right]
            result[where] = ((1 - t) * low + t * high)[where]
            return result

        height = between(self.map["height_m"])
        if "requested_direction" not in self.map:
            return height, np.where(where[:, None], [0.0, 0.0, 1.0], np.nan)
        direction = self.map["requested_direction"]
        return height, np.stack([between(direction[..., k]) for k in range(3)], axis=1)

    def _force_constant(self):
        if self.lambda_n_per_m is None:
            raise BundleError("the bundle has no force constant: nothing can be rendered")
        return self.lambda_n_per_m

    def currents(self, points_m, robust=False):
        """Currents [A] of least power whose force is lambda times the height (eq. 8), or the nearest; where
        `robust`, those of the least expected error under the uncertainties that the bundle was made with.

        Returns one row a point of currents, one column a coil, the force they give [N], and the
        answers: "ok", "saturated" or "outside" (of the map: no currents). Of bundles that request a
        force vector the force has three columns.
        """
        lambda_n_per_m = self._force_constant()
        if robust:
            return self._robust_currents(points_m)
        points_m = _rows(points_m)
        inside = self.inside(points_m)
        if "requested_direction" in self.map:
            return self._vector_currents(points_m, inside)
        per_ampere = self.force_per_ampere(points_m)
        passive = self.passive_force(points_m)
        wanted = lambda_n_per_m * np.nan_to_num(self.height(points_m))
        currents = np.zeros((len(points_m), self.coil_count))
        answers = np.full(len(points_m), "outside", dtype=object)
        for k in np.flatnonzero(inside):
            currents[k], reached = self.allocate(per_ampere[k], wanted[k] - passive[k])
            answers[k] = "ok" if reached else "saturated"
        force = np.where(inside, np.sum(per_ampere * currents, axis=1) + passive, 0.0)
        return currents, force, answers

    def _vector_currents(self, points_m, inside):
        per_ampere = self.force_vectors_per_ampere(points_m)
        pull = np.zeros((len(points_m), 3))
        pull[:, 2] = self.passive_force(points_m)
        wanted = self.requested_force(points_m) - pull
        currents = np.zeros((len(points_m), self.coil_count))
        answers = np.full(len(points_m), "outside", dtype=object)
        for k in np.flatnonzero(inside):
            currents[k], reached = self.allocate_vector(per_ampere[k], wanted[k])
            answers[k] = "ok" if reached else "saturated"
        force = np.einsum("pck,pc->pk", per_ampere, currents) + pull
        force[~inside] = 0.0
        return currents, force, answers

    def _robust_currents(self, points_m):
        """As `currents`, of the least expected error; the answers are those of exact positions."""
        if "robust_setting" not in self.map:
            raise BundleError("map.npz holds no robust_setting: the bundle was made without uncertainties")
        beside = _beside("expected_error")
        points_m = _rows(points_m)
        currents, force, answers = self.currents(points_m)
        vector = "requested_direction" in self.map
        per_ampere = self.force_vectors_per_ampere if vector else self.force_per_ampere
        wanted = self.requested_force(points_m)
        setting = self.map["robust_setting"]
        nodes = [self.map[key] for key in ("x_m", "y_m", "z_m")]
        ends = np.array([[axis[0] for axis in nodes], [axis[-1] for axis in nodes]])
        total = float(self.map.get("total_current_max_a", np.inf))
        # The pull goes with the square of the strength, which is even between its least and 1: mean of the cube
        # over the mean.
        warm = 0.5 * (1 + (2 * setting[3] - 1) ** 2)
        for k in np.flatnonzero(self.inside(points_m)):
            near, weights = beside.places(points_m[k], setting[1], ends)
            rows = np.moveaxis(per_ampere(near).reshape(len(near), self.coil_count, -1), 1, 2)
            left = np.repeat(wanted[k : k + 1, 0 if vector else 2 :], len(near), axis=0)
            left[:, -1] -= warm * self.passive_force(near)
            of_coils = [self.map[key] for key in ("resistance_ohm", "current_min_a", "current_max_a")]
            form = beside.ExpectedError(rows, left, weights, setting, *of_coils)
            currents[k] = form.least(total, currents[k])
            given = currents[k] @ per_ampere(points_m[k])[0]
            force[k] = given + self.passive_force(points_m[k])[0] * np.array([0, 0, 1] if vector else 1)
        return currents, force, answers

    def allocate_vector(self, force_per_ampere, wanted_n):
        """Currents [A] of least power that give the vector wanted_n for the forces per ampere [coil, axis],
        or the nearest force, sideways errors times the bundle's sideways_weight; and whether they do."""
        return _allocate_vector(
            np.asarray(force_per_ampere, dtype=float), np.asarray(wanted_n, dtype=float),
            self.map["resistance_ohm"], self.map["current_min_a"], self.map["current_max_a"],
            float(self.map.get("total_current_max_a", np.inf)), float(self.map["sideways_weight"]),
        )

    def allocate(self, force_per_ampere, wanted_n):
        """Currents [A] of least power that give wanted_n, or the nearest force, and whether they do."""
        total = float(self.map.get("total_current_max_a", np.inf))
        # Forces at the ends of what doubles hold overflow on the way, not at the end.
        with np.errstate(over="ignore"):
            return _allocate(
                np.asarray(force_per_ampere, dtype=float), float(wanted_n),
                self.map["resistance_ohm"], self.map["current_min_a"], self.map["current_max_a"],
                total,
            )

    def _interpolate(self, values, points_m):
        points_m = _rows(points_m)
        result = np.zeros((len(points_m), self.coil_count))
        self._fill(values, points_m, result, self.map["coil"])
        return result

    def _fill(self, values, points_m, result, columns):
        where = np.flatnonzero(self.inside(points_m))
        for start in range(0, len(where), CHUNK_POINTS):
            rows = where[start : start + CHUNK_POINTS]
            (ix, wx), (iy, wy), (iz, wz) = (
                _stencil(self.map[key], points_m[rows, axis])
                for axis, key in enumerate(("x_m", "y_m", "z_m"))
            )
            near = values[:, iz[:, :, None, None], iy[:, None, :, None], ix[:, None, None, :]]
            # Axes of near: coil, point, then the nodes along z, y, x.
            found = np.einsum("cpkji,pk,pj,pi->pc", near, wz, wy, wx, optimize=False)
            result[np.ix_(rows, columns)] = found

    def _read_manifest(self):
        path = os.path.join(self.folder, "manifest.json")
        if not os.path.exists(path):
            raise BundleError(f"{self.folder} is not a bundle: it has no manifest.json")
        # Asked before opening: opening a pipe would wait for its other end.
        if not os.path.isfile(path) or os.path.getsize(path) > MANIFEST_MAX_BYTES:
            raise BundleError(f"{path}: expected a plain file of at most {MANIFEST_MAX_BYTES} bytes")
        with open(path, "rb") as file:
            content = file.read(MANIFEST_MAX_BYTES)
        try:
            manifest = _json(content)
        except (ValueError, RecursionError) as error:
            raise BundleError(f"{path}: {error}") from None
        version = str(manifest.get("schema_version"))
        if version.split(".")[0] != str(SCHEMA_MAJOR):
            raise BundleError(f"{path}: schema_version {version!r}, this loader reads {SCHEMA_MAJOR}.x")
        return manifest

    def _read_files(self):
        root = os.path.realpath(self.folder)
        files, paths = {}, {}
        for entry in self.manifest["files"]:
            name = entry["path"]
            parts = name.split("/")
            if os.path.isabs(name) or "\\" in name or any(part in ("", ".", "..") for part in parts):
                raise BundleError(f"manifest.json lists {name!r}, which leads out of the bundle")
            if name in paths:
                raise BundleError(f"manifest.json lists {name!r} twice")
            path = os.path.join(root, *parts)
            if os.path.realpath(path) != path:
                raise BundleError(f"manifest.json lists {name!r}, which is a link")
            _check_size(path, entry["bytes"])
            paths[name] = path
        # All sizes before any content.
        for entry in self.manifest["files"]:
            name = entry["path"]
            content, digest = _read(paths[name], entry["bytes"], name in REQUIRED)
            if digest != entry["sha256"]:
                raise BundleError(f"{paths[name]} was changed or damaged: its SHA-256 differs")
            if name in REQUIRED:
                files[name] = content
        for name in REQUIRED:
            if name not in files:
                raise BundleError(f"manifest.json does not list {name}")
        return files


def _check_size(path, size):
    """Looks at a file without opening it: opening a pipe would wait for its other end."""
    if not os.path.isfile(path):
        raise BundleError(f"{path} is missing or not a plain file")
    if os.path.getsize(path) != size or size > FILE_MAX_BYTES:
        raise BundleError(f"{path} was changed or damaged: its size differs, or is more than 4 GiB")


def _read(path, size, keep):
    """A plain file's content, if it is to be kept, and digest; read block by block."""
    digest, blocks = hashlib.sha256(), []
    with open(path, "rb") as file:
        found = os.fstat(file.fileno())
        if not stat.S_ISREG(found.st_mode) or found.st_size != size:
            raise BundleError(f"{path} was changed or damaged: its size differs")
        if size > HOLES_FROM and size // HOLES_SHARE > 512 * getattr(found, "st_blocks", size):
            # Some file systems count blocks late; they know of no hole then.
            if os.lseek(file.fileno(), 0, getattr(os, "SEEK_HOLE", os.SEEK_END)) < size:
                raise BundleError(f"{path} claims {size} bytes, but is almost all holes")
            os.lseek(file.fileno(), 0, os.SEEK_SET)
        while size > 0:
            block = file.read(min(BLOCK_BYTES, size))
            if not block:
                raise BundleError(f"{path} was changed or damaged: its size differs")
            size -= len(block)
            digest.update(block)
            if keep:
                blocks.append(block)
    return b"".join(blocks), digest.hexdigest()


def _no_number(word):
    raise ValueError(f"{word} is not a number in JSON")


def _finite(word):
    value = float(word)
    if not math.isfinite(value):
        _no_number(word)
    return value


def _json(content):
    return json.loads(content.decode("utf-8"), parse_constant=_no_number, parse_float=_finite)


def _rows(points_m, further=False):
    """Positions x, y, z [m] as rows; where `further`, of x, y and any columns more."""
    points_m = np.asarray(points_m, dtype=float)
    found = points_m.shape[-1] if points_m.ndim in (1, 2) else 0
    if found < 2 or not (further or found == 3):
        what = "x, y" if further else "x, y, z"
        raise ValueError(f"expected {what} in m or rows of them, found an array of shape {points_m.shape}")
    return np.atleast_2d(points_m)


def _stencil(nodes, positions):
    """Indices and weights, (points, nodes taking part), of positions within the nodes' range."""
    count = min(len(nodes), 4)
    above = np.searchsorted(nodes, positions, side="right")
    start = np.clip(above - 2, 0, len(nodes) - count)
    index = start[:, None] + np.arange(count)
    near = nodes[index]
    weights = np.ones_like(near)
    for k in range(count):
        for j in range(count):
            if j != k:
                weights[:, k] *= (positions - near[:, j]) / (near[:, k] - near[:, j])
    return index, weights


# Share of a cell's width from a node within which a position is at the node: computed otherwise the same
# coordinate has other last bits.
AT_NODE = 1e-9


def _ends(nodes):
    """The ends of an axis, beyond which a position is outside."""
    first, last = (nodes[1] - nodes[0], nodes[-1] - nodes[-2]) if len(nodes) > 1 else (0, 0)
    return nodes[0] - AT_NODE * first, nodes[-1] + AT_NODE * last


def _between(nodes, positions):
    """Cells that hold positions, the positions' shares of their widths, and whether there is one."""
    if len(nodes) == 1:
        return np.zeros(len(positions), int), np.zeros(len(positions)), positions == nodes[0]
    cell = np.clip(np.searchsorted(nodes, positions, side="right") - 1, 0, len(nodes) - 2)
    share = (positions - nodes[cell]) / (nodes[cell + 1] - nodes[cell])
    at_node, at_next = abs(share) <= AT_NODE, abs(share - 1) <= AT_NODE
    inside = at_node | at_next | ((0 < share) & (share < 1))
    return cell + at_next, np.where(inside & ~at_node & ~at_next, share, 0), inside


# Currents of least power: I_i = clip((mu (g_i - center) + nu) / R_i). The algorithm is reported in
# src/lambda/allocation.rs; here it is written for clearness, not for speed.
ROUNDING = 1e-14
TIED = 1e-13
FAR = 1e3


def _sorted_row(row, target, r, lower, upper):
    """The multiplier at which sum(row * clip(mu row / r)) is target > 0; None where it cannot be."""
    use = np.flatnonzero(row)
    bound = np.where(row > 0, upper, lower)[use]
    leaves = bound * r[use] / row[use]
    order = np.argsort(leaves, kind="stable")
    use, bound, leaves = use[order], bound[order], leaves[order]
    tail = np.cumsum((row[use] ** 2 / r[use])[::-1])[::-1]
    held = np.concatenate([[0.0], np.cumsum(row[use] * bound)])
    for k in range(len(use)):
        if held[k] + leaves[k] * tail[k] >= target:
            return (target - held[k]) / tail[k]
    return leaves[-1] if len(use) and held[-1] >= target else None


def _largest(row, r, lower, upper, total):
    """The currents of the largest force, those of least power among them."""
    currents = lower.astype(float)
    order = np.argsort(-row, kind="stable")
    start = 0
    while start < len(row) and row[order[start]] >= -TIED:
        gain = row[order[start]]
        group = order[start:][row[order[start:]] >= gain - TIED]
        # What the sum allows this group. Its own lower limits are left out of account: one of 1e30 A
        # would take every digit of a limit of 1 A.
        share = math.fsum([total, *-upper[order[:start]], *-lower[order[start + len(group):]]]) \
            if np.isfinite(total) else np.inf
        if math.fsum(upper[group]) <= share and gain > TIED:
            currents[group] = upper[group]
            start += len(group)
            continue
        if gain <= TIED:
            share = min(share, 0.0)
        ones = np.zeros(len(row))
        ones[group] = -1.0 if share < 0 else 1.0
        mu = 0.0
        if share != 0:
            mu = _sorted_row(ones, abs(share), r, lower, upper)
            mu = 1e300 if mu is None else mu
        currents[group] = np.clip(mu * ones[group] / r[group], lower[group], upper[group])
        break
    return currents


def _allocate(force_per_ampere, wanted, r, lower, upper, total):
    scale = np.max(np.abs(force_per_ampere), initial=0.0)
    if wanted == 0 or np.isnan(wanted) or scale == 0 or not np.isfinite(1 / scale):
        return np.zeros(len(r)), wanted == 0
    scale = -scale if wanted < 0 else scale
    row = force_per_ampere / scale
    row[np.abs(row) < 1e-60] = 0.0
    target = wanted / scale

    def fill(mu, center, nu):
        return np.clip((mu * (row - center) + nu) / r, lower, upper)

    mu = _sorted_row(row, target, r, lower, upper)
    if mu is not None:
        currents = fill(mu, 0.0, 0.0)
        if np.sum(currents) <= total:
            return currents, True
    most_currents = _largest(row, r, lower, upper, total)
    most = float(np.sum(row * most_currents))
    if target >= most * (1 - ROUNDING):
        return most_currents, bool(target <= most * (1 + ROUNDING))
    low, high, sigma, best = 0.0, np.inf, 0.0, (np.inf, most_currents)
    for step in range(120):
        # The piece of mu on which the force is met for this sigma.
        use = np.flatnonzero(row)
        breaks = np.sort(np.concatenate([(b[use] * r[use] + sigma) / row[use] for b in (lower, upper)]))
        forces = np.array([np.sum(row * fill(at, 0.0, -sigma)) for at in breaks])
        above = int(np.searchsorted(forces >= target, True))
        to = breaks[min(above, len(breaks) - 1)]
        since = breaks[above - 1] if above else to
        ends = np.array([since, to])[:, None] * row - sigma
        least, most_end = np.min(ends, axis=0), np.max(ends, axis=0)
        # Up to the rounding at an end, not at the other, which may lie at 1e30.
        slack = 4 * np.finfo(float).eps
        moves = (lower < upper) & (least >= lower * r - slack * (sigma + np.abs(least)))
        moves &= most_end <= upper * r + slack * (sigma + np.abs(most_end))
        slope = np.sum(row[moves] ** 2 / r[moves])
        mu = to
        if slope > 0:
            # A far end would take the digits: then from the piece's point nearest to nothing.
            near = min(max(0.0, since), to)
            at = near if abs(to) > FAR * max(sigma, abs(near)) else to
            mu = min(max(at + (target - np.sum(row * fill(at, 0.0, -sigma))) / slope, since), to)
        # Both rows met if those coils are the ones that move.
        center, nu, jump = 0.0, -sigma, mu
        if np.any(moves):
            rest = fill(0.5 * (since + to), 0.0, -sigma)[~moves]
            weight = np.sum(1 / r[moves])
            center = np.sum(row[moves] / r[moves]) / weight
            force, share = target - np.sum(row[~moves] * rest), total - np.sum(rest)
            offset = np.sum((row[moves] - center) / r[moves]) / weight
            spread = np.sum((row[moves] - center - offset) ** 2 / r[moves])
            jump = (force - (center + offset) * share) / spread if spread > TIED**2 * weight else 0.0
            nu = share / weight - jump * offset
        currents = fill(jump, center, nu)
        fault = abs(np.sum(row * currents) - target) / (np.sum(np.abs(row * currents)) + target)
        size = np.sum(np.abs(currents)) + total
        fault = max(fault, abs(np.sum(currents) - total) / size if size > 0 else 0.0)
        next_sigma = jump * center - nu
        if fault < best[0] and next_sigma >= 0:
            best = (fault, currents)
        if best[0] <= ROUNDING:
            break
        excess = np.sum(fill(mu, 0.0, -sigma)) - total
        low, high = (sigma, high) if excess > 0 else (low, sigma)
        if low < next_sigma < high and step % 3 != 2:
            sigma = next_sigma
        elif not np.isfinite(high):
            sigma = max(4 * low, excess / np.sum(1 / r))
        else:
            sigma = np.sqrt(low * high) if 0 < low and high > 4 * low else 0.5 * (low + high)
        if not low < sigma < high:
            break
    return (most_currents if best[0] > 1 - target / most else best[1]), True


def _allocate_vector(force_per_ampere, wanted, r, lower, upper, total, sideways_weight):
    largest = np.max(np.abs(force_per_ampere), initial=0.0)
    nothing = not np.any(wanted)
    if nothing or not np.all(np.isfinite(wanted)) or largest == 0 or not np.isfinite(1 / largest):
        return np.zeros(len(r)), nothing
    weights = np.array([sideways_weight, sideways_weight, 1.0])
    rows = np.column_stack([force_per_ampere * weights * (1 / largest), np.ones(len(r))])
    target = np.append(wanted * weights * (1 / largest), total)
    dual = _beside("vector_dual").Dual(rows, target, np.min(r) / r, lower, upper)
    with np.errstate(over="ignore", invalid="ignore"):
        reached = dual.solve()
    return dual.currents, reached


def _table(content, name):
    lines = csv.reader(io.StringIO(content.decode("utf-8"), newline=None))
    rows = [row for row in lines if row]
    try:
        columns = np.array([[float(cell) for cell in row] for row in rows[1:]])
        columns = columns.reshape(len(rows) - 1, len(rows[0]))
    except (ValueError, IndexError):
        raise BundleError(f"{name} is not a table of numbers") from None
    if not np.all(np.isfinite(columns)):
        raise BundleError(f"{name} holds a number that is not finite")
    return {key: columns[:, place] for place, key in enumerate(rows[0])}


def _array(name, data):
    if data[:8] != b"\x93NUMPY\x01\x00" or len(data) < 10:
        raise BundleError(f"map.npz: {name} is not an NPY 1.0 array")
    start = 10 + int.from_bytes(data[8:10], "little")
    text = data[10:start]
    text = text[:-1] if text.endswith(b"\n") else text
    header = None if PARTED.search(text) else HEADER.fullmatch(text.replace(b" ", b""))
    kind = "<i8" if name in ("coil", "schema_version") else "<f8"
    if start > len(data) or not header or header[1].decode() != kind:
        raise BundleError(f"map.npz: {name} must hold {kind!r} in C order")
    shape = tuple(int(size) for size in header[2].split(b",") if size)
    if len(shape) > 6 or 8 * math.prod(shape) != len(data) - start:
        raise BundleError(f"map.npz: {name} does not hold what its shape says")
    values = np.frombuffer(data, dtype=kind, offset=start).reshape(shape)
    if not np.all(np.isfinite(values)):
        raise BundleError(f"map.npz: {name} holds a number that is not finite")
    if kind == "<f8" and np.any(np.abs(values) > LARGEST):
        raise BundleError(f"map.npz: {name} holds a number beyond 1e30")
    return values


def _entries(content):
    """Names and bytes of an archive's entries, the one form that all loaders accept: the directory
    fills the file from the last entry to an end record without a comment, and every entry is stored
    as it is, undamaged, its name the same in both places and there once (of two, other programs may
    read the other one)."""
    end = len(content) - 22
    if end < 0 or content[end : end + 4] != b"PK\x05\x06" or content[-2:] != b"\0\0":
        raise BundleError("map.npz: not a zip archive, cut short, or with bytes behind its end")
    disks, here, count, size, directory = struct.unpack_from("<IHHII", content, end + 4)
    damaged = BundleError("map.npz: the archive's directory is damaged")
    if disks or here != count or directory + size != end:
        raise damaged
    if count > MAX_ENTRIES:
        raise BundleError(f"map.npz: the archive has more than {MAX_ENTRIES} entries")
    entries, at = {}, directory
    for _ in range(count):
        if end - at < 46 or content[at : at + 4] != b"PK\x01\x02":
            raise damaged
        flags, method = struct.unpack_from("<HH", content, at + 8)
        crc, packed, size, *lengths = struct.unpack_from("<IIIHHH", content, at + 16)
        (local,) = struct.unpack_from("<I", content, at + 42)
        name = content[at + 46 : at + 46 + lengths[0]]
        at += 46 + sum(lengths)
        if at > end:
            raise damaged
        if method != 0 or flags & 1 or packed != size:
            raise BundleError(f"map.npz: {name!r} is compressed, encrypted or larger than 4 GiB")
        if directory - local < 30 or content[local : local + 4] != b"PK\x03\x04":
            raise BundleError(f"map.npz: {name!r} lies outside the file")
        local_lengths = struct.unpack_from("<HH", content, local + 26)
        begin = local + 30 + sum(local_lengths)
        if begin + size > directory:
            raise BundleError(f"map.npz: {name!r} lies outside the file")
        if content[local + 30 : local + 30 + local_lengths[0]] != name:
            raise BundleError(f"map.npz: {name!r} has another name in the directory")
        data = content[begin : begin + size]
        if zlib.crc32(data) != crc:
            raise BundleError(f"map.npz: {name!r} is damaged (CRC)")
        if name in entries:
            raise BundleError(f"map.npz: {name!r} is there twice")
        entries[name] = data
    if at != end:
        raise damaged
    return entries


def _arrays(content):
    entries = _entries(content)
    arrays = {}
    for name in ARRAYS + OPTIONAL_ARRAYS:
        data = entries.get(f"{name}.npy".encode())
        if data is not None:
            arrays[name] = _array(name, data)
    for name in ARRAYS:
        if name not in arrays:
            raise BundleError(f"map.npz: array {name} is missing")
    version = arrays["schema_version"]
    if version.shape != (3,) or version[0] != SCHEMA_MAJOR:
        raise BundleError("map.npz: schema_version is not one that this loader reads")
    return arrays


def main(arguments):
    if not arguments or arguments[0] in ("-h", "--help"):
        print(__doc__)
        return 0 if arguments else 2
    try:
        points = np.array([[float(part) for part in word.split(",")] for word in arguments[1:]])
        points = points.reshape(-1, 3)
    except ValueError:
        print("points are given as x,y,z in metres", file=sys.stderr)
        return 2
    try:
        bundle = Bundle(arguments[0])
        print(f"lambda_n_per_m {bundle.lambda_n_per_m}")
        force_per_ampere = bundle.force_per_ampere(points)
        passive_force = bundle.passive_force(points)
    except (BundleError, OSError) as error:
        print(error, file=sys.stderr)
        return 3
    for point, per_ampere, passive in zip(points, force_per_ampere, passive_force):
        force = float(per_ampere @ bundle.currents_a + passive)
        print(",".join(repr(float(v)) for v in point), f"force_n {force!r}", "per_ampere", *map(float, per_ampere))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
