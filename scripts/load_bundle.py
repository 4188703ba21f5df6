#!/usr/bin/env python3
"""Load a fluxform bundle: numpy only, Python 3.9 or newer.

    from load_bundle import Bundle
    bundle = Bundle("results/seed/flat")
    force = bundle.force_per_ampere([[0.01, 0.0, 0.05]])   # N/A, one row a point, one column a coil
    total = force @ bundle.currents_a                      # N
    total += bundle.passive_force([[0.01, 0.0, 0.05]])     # N, the unpowered steel's pull; 0 without
    currents, force, answer = bundle.currents([[0.01, 0.0, 0.05]])   # with position feedback (eq. 8)

or on the command line: lambda, and the force of the static currents at points given as x,y,z in m:

    python3 load_bundle.py results/seed/flat 0.01,0,0.05 0.02,-0.01,0.05
"""

import csv
import hashlib
import io
import json
import math
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
            ("static_current_a", coils),
            ("inductance_h", coils + coils),
            ("height_m", self._surface()),
            ("has_height", self._surface()),
        ):
            if key in self.map and self.map[key].shape != shape:
                raise BundleError(f"map.npz: {key} must have shape {shape}, has {self.map[key].shape}")
        for key in ("x_m", "y_m", "z_m", *(("height_x_m", "height_y_m") if "height_m" in self.map else ())):
            if not len(self.map[key]) or not np.all(np.diff(self.map[key]) > 0):
                raise BundleError(f"map.npz: {key} must increase from node to node")
        coil = self.map["coil"]
        if np.any(coil < 0) or np.any(coil >= self.coil_count) or np.any(np.diff(coil) <= 0):
            raise BundleError("map.npz: coil must hold increasing indices of coils")
        if self.currents_a.shape != coils:
            raise BundleError("currents.csv must have one row a coil")

    def _surface(self):
        return tuple(len(self.map.get(key, ())) for key in ("height_y_m", "height_x_m"))

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

    def height(self, points_m):
        """Height of the surface [m] at x, y (further columns are passed over); NaN where none is."""
        points_m = np.atleast_2d(np.asarray(points_m, dtype=float))
        if "height_m" not in self.map:
            raise BundleError("map.npz holds no heights: it is of a schema before 1.2; calibrate again")
        nodes = self.map["height_x_m"], self.map["height_y_m"]
        (column, s, in_x), (row, t, in_y) = (_between(n, points_m[:, k]) for k, n in enumerate(nodes))
        result = np.full(len(points_m), np.nan)
        height, has = self.map["height_m"], self.map["has_height"]
        right, above = column + (s > 0), row + (t > 0)
        low = (1 - s) * height[row, column] + s * height[row, right]
        high = (1 - s) * height[above, column] + s * height[above, right]
        # A node of no weight has a neighbour of its own as its twin, so all four may be asked.
        there = has[row, column] * has[row, right] * has[above, column] * has[above, right]
        where = in_x & in_y & (there > 0)
        result[where] = ((1 - t) * low + t * high)[where]
        return result

    def currents(self, points_m):
        """Currents [A] of least power whose force is lambda times the height (eq. 8), or the nearest.

        Returns one row a point of currents, one column a coil, the force they give [N], and the
        answers: "ok", "saturated" or "outside" (of the map: no currents).
        """
        if self.lambda_n_per_m is None:
            raise BundleError("the bundle has no force constant: nothing can be rendered")
        points_m = np.atleast_2d(np.asarray(points_m, dtype=float))
        inside = self.inside(points_m)
        per_ampere = self.force_per_ampere(points_m)
        passive = self.passive_force(points_m)
        wanted = self.lambda_n_per_m * np.nan_to_num(self.height(points_m))
        currents = np.zeros((len(points_m), self.coil_count))
        answers = np.full(len(points_m), "outside", dtype=object)
        for k in np.flatnonzero(inside):
            currents[k], reached = self.allocate(per_ampere[k], wanted[k] - passive[k])
            answers[k] = "ok" if reached else "saturated"
        force = np.where(inside, np.sum(per_ampere * currents, axis=1) + passive, 0.0)
        return currents, force, answers

    def allocate(self, force_per_ampere, wanted_n):
        """Currents [A] of least power that give wanted_n, or the nearest force, and whether they do."""
        total = float(self.map.get("total_current_max_a", np.inf))
        return _allocate(
            np.asarray(force_per_ampere, dtype=float), float(wanted_n), self.map["resistance_ohm"],
            self.map["current_min_a"], self.map["current_max_a"], total,
        )

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


def _between(nodes, positions):
    """Cells that hold positions, the positions' shares of their widths, and whether there is one."""
    inside = (nodes[0] <= positions) & (positions <= nodes[-1])
    positions = np.where(inside, positions, nodes[0])
    cell = np.clip(np.searchsorted(nodes, positions, side="right") - 1, 0, max(len(nodes) - 2, 0))
    if len(nodes) == 1:
        return cell, np.zeros(len(positions)), inside
    return cell, (positions - nodes[cell]) / (nodes[cell + 1] - nodes[cell]), inside


# Currents of least power: I_i = clip((mu (g_i - center) + nu) / R_i). The algorithm is told in
# src/lambda/allocate.rs; here it is written for clearness, not for speed.
ROUNDING = 1e-14
TIED = 1e-13


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
    left = math.fsum([total, *-lower]) if np.isfinite(total) else np.inf
    order = np.argsort(-row, kind="stable")
    start = 0
    while start < len(row) and row[order[start]] >= -TIED:
        gain = row[order[start]]
        group = order[start:][row[order[start:]] >= gain - TIED]
        room = math.fsum([*upper[group], *-lower[group]])
        if room <= left and gain > TIED:
            currents[group] = upper[group]
            start += len(group)
            spent = [*-lower[order[start:]], *-upper[order[:start]]]
            left = math.fsum([total, *spent]) if np.isfinite(total) else np.inf
            continue
        share = math.fsum([total, *-upper[order[:start]], *-lower[order[start + len(group):]]]) \
            if np.isfinite(total) else np.inf
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
        slack = 4 * np.finfo(float).eps * (sigma + np.max(np.abs(ends), axis=0))
        moves = (lower < upper) & (np.min(ends, axis=0) >= lower * r - slack)
        moves &= np.max(ends, axis=0) <= upper * r + slack
        slope = np.sum(row[moves] ** 2 / r[moves])
        mu = to
        if slope > 0:
            mu = min(max(to - (np.sum(row * fill(to, 0.0, -sigma)) - target) / slope, since), to)
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
