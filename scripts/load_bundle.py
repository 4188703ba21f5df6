#!/usr/bin/env python3
"""Load a fluxform bundle: numpy only, Python 3.9 or newer.

    from load_bundle import Bundle
    bundle = Bundle("results/seed/flat")
    force = bundle.force_per_ampere([[0.01, 0.0, 0.05]])   # N/A, one row a point, one column a coil
    total = force @ bundle.currents_a                      # N
    total += bundle.passive_force([[0.01, 0.0, 0.05]])     # N, the unpowered steel's pull; 0 without

or on the command line: lambda, and the force of the static currents at points given as x,y,z in m:

    python3 load_bundle.py results/seed/flat 0.01,0,0.05 0.02,-0.01,0.05
"""

import csv
import hashlib
import io
import json
import os
import sys
import zipfile

import numpy as np

SCHEMA_MAJOR = 1
INTERPOLATION = "tricubic-lagrange"
REQUIRED = ("map.npz", "points.csv", "currents.csv", "lambda.json")
CHUNK_POINTS = 4096


class BundleError(Exception):
    """The bundle cannot be used; the message says why."""


class Bundle:
    """A bundle in memory, its checksums checked.

    Attributes: manifest and lambda_ (dicts), map (dict of arrays), points (columns x_m, y_m,
    height_m, normal_x, normal_y, normal_z by name), currents_a, lambda_n_per_m (None if none).
    """

    def __init__(self, folder):
        self.folder = os.fspath(folder)
        try:
            self._load()
        except (KeyError, TypeError, ValueError) as error:
            raise BundleError(f"{self.folder}: a key is missing or of the wrong kind: {error!r}") from None

    def _load(self):
        self.manifest = self._read_manifest()
        files = self._read_files()
        self.lambda_ = json.loads(files["lambda.json"])
        self.points = _table(files["points.csv"], "points.csv")
        self.currents_a = _table(files["currents.csv"], "currents.csv")["current_a"]
        self.map = _arrays(files["map.npz"])
        self.lambda_n_per_m = self.manifest["lambda"]["lambda_n_per_m"]
        told = self.manifest["map"]
        passive = told.get("passive_force")
        for told in [told] if passive is None else [told, passive]:
            name = told["interpolation"]["name"]
            if name != INTERPOLATION:
                raise BundleError(f"interpolation {name!r}, this loader implements {INTERPOLATION!r}")
        if (passive is not None) != ("passive_force_n" in self.map):
            raise BundleError("map.npz must have passive_force_n where the manifest tells of it")
        grid = tuple(len(self.map[key]) for key in ("coil", "z_m", "y_m", "x_m"))
        coils = (self.coil_count,)
        for key, shape in (
            ("gz_t_per_m_per_a", grid),
            ("gradient_t_per_m_per_a", grid + (3, 3)),
            ("field_t_per_a", grid + (3,)),
            ("passive_force_n", grid[1:]),
            ("moment_a_m2", (3,)),
            ("current_min_a", coils),
            ("resistance_ohm", coils),
        ):
            if key in self.map and self.map[key].shape != shape:
                raise BundleError(f"map.npz: {key} must have shape {shape}, has {self.map[key].shape}")
        for key in ("x_m", "y_m", "z_m"):
            if not len(self.map[key]) or not np.all(np.diff(self.map[key]) > 0):
                raise BundleError(f"map.npz: {key} must increase from node to node")
        coil = self.map["coil"]
        if np.any(coil < 0) or np.any(coil >= self.coil_count) or np.any(np.diff(coil) <= 0):
            raise BundleError("map.npz: coil must hold increasing indices of coils")
        if self.currents_a.shape != coils:
            raise BundleError("currents.csv must have one row a coil")

    @property
    def coil_count(self):
        """Number of coils of the array, those left out of the map included."""
        return len(self.map["current_max_a"])

    def inside(self, points_m):
        """True for each point (x, y, z in m) within the map's grid."""
        points_m = np.atleast_2d(np.asarray(points_m, dtype=float))
        axes = [self.map[key] for key in ("x_m", "y_m", "z_m")]
        low = np.array([axis[0] for axis in axes])
        high = np.array([axis[-1] for axis in axes])
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

    def passive_force(self, points_m):
        """What the unpowered steel adds to the force [N], up positive; zero outside or without it."""
        points_m = np.atleast_2d(np.asarray(points_m, dtype=float))
        result = np.zeros((len(points_m), 1))
        if "passive_force_n" in self.map:
            self._fill(self.map["passive_force_n"][None], points_m, result, [0])
        return result[:, 0]

    def _interpolate(self, values, points_m):
        points_m = np.atleast_2d(np.asarray(points_m, dtype=float))
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
        try:
            with open(path, encoding="utf-8") as file:
                manifest = json.load(file)
        except FileNotFoundError:
            raise BundleError(f"{self.folder} is not a bundle: it has no manifest.json") from None
        except ValueError as error:
            raise BundleError(f"{path}: {error}") from None
        version = str(manifest.get("schema_version"))
        if version.split(".")[0] != str(SCHEMA_MAJOR):
            raise BundleError(f"{path}: schema_version {version}, this loader reads {SCHEMA_MAJOR}.x")
        return manifest

    def _read_files(self):
        root = os.path.realpath(self.folder)
        files = {}
        for entry in self.manifest["files"]:
            name = entry["path"]
            path = os.path.realpath(os.path.join(root, name))
            if os.path.isabs(name) or os.path.commonpath([root, path]) != root:
                raise BundleError(f"manifest.json lists {name!r}, which leads out of the bundle")
            if not os.path.isfile(path):
                raise BundleError(f"{path} is missing or not a plain file")
            if os.path.getsize(path) != entry["bytes"]:
                raise BundleError(f"{path} was changed or damaged: its size differs")
            with open(path, "rb") as file:
                content = file.read()
            if hashlib.sha256(content).hexdigest() != entry["sha256"]:
                raise BundleError(f"{path} was changed or damaged: its SHA-256 differs")
            if name in REQUIRED:
                files[name] = content
        for name in REQUIRED:
            if name not in files:
                raise BundleError(f"manifest.json does not list {name}")
        return files


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


def _table(content, name):
    rows = list(csv.reader(io.StringIO(content.decode("utf-8"))))
    try:
        columns = np.array([[float(cell) for cell in row] for row in rows[1:]])
        columns = columns.reshape(len(rows) - 1, len(rows[0]))
    except (ValueError, IndexError):
        raise BundleError(f"{name} is not a table of numbers") from None
    if not np.all(np.isfinite(columns)):
        raise BundleError(f"{name} holds a number that is not finite")
    return {key: columns[:, place] for place, key in enumerate(rows[0])}


def _arrays(content):
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            for info in archive.infolist():
                if info.compress_type != zipfile.ZIP_STORED or info.file_size > len(content):
                    raise BundleError(f"map.npz: {info.filename} is not stored as it is")
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except (ValueError, OSError, zipfile.BadZipFile) as error:
        raise BundleError(f"map.npz: {error}") from None
    for name in (
        "x_m", "y_m", "z_m", "coil", "gz_t_per_m_per_a",
        "moment_a_m2", "current_min_a", "current_max_a", "resistance_ohm",
    ):
        if name not in arrays:
            raise BundleError(f"map.npz: array {name} is missing")
    for name, values in arrays.items():
        kind = np.int64 if name in ("coil", "schema_version") else np.float64
        if values.dtype != kind:
            raise BundleError(f"map.npz: {name} is of type {values.dtype}, expected {kind.__name__}")
        if not np.all(np.isfinite(values)):
            raise BundleError(f"map.npz: {name} holds a number that is not finite")
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
