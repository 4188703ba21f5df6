"""A bundle as a runtime uses it."""

import html
import json
import os
import pathlib
from typing import Any, NamedTuple

import numpy as np

from . import _native

ANSWERS = np.array(["ok", "saturated", "outside"])


def points_of(points):
    """Positions as rows, and whether they were one position alone."""
    points = np.asarray(points, dtype=np.float64)
    if points.ndim not in (1, 2) or points.shape[-1] != 3:
        raise ValueError(f"expected x, y, z in m or rows of them, found an array of shape {points.shape}")
    return np.atleast_2d(points), points.ndim == 1


class Currents(NamedTuple):
    """Currents for positions, and what they give."""

    #: A, [point, coil].
    currents_a: Any
    #: The force on the magnet, upwards or along x, y, z where the bundle requests all three, N.
    force_n: Any
    #: `ok`, `saturated` (the nearest force within the limits) or `outside` the map.
    answer: Any


class Bundle:
    """A calibrated object: `Bundle.open("results/seed/flat")`."""

    def __init__(self, folder, report=None):
        self._native = _native.Bundle(os.fspath(folder))
        self.folder = pathlib.Path(folder)
        #: What `calibrate` reported of it; None for a bundle that was opened.
        self.report = report
        with open(self.folder / "manifest.json", encoding="utf-8") as file:
            #: The manifest, a dict.
            self.manifest = json.load(file)

    @classmethod
    def open(cls, folder) -> "Bundle":
        """Open a bundle and check it."""
        return cls(folder)

    @property
    def lambda_n_per_m(self) -> float:
        """The force constant."""
        return self.manifest["lambda"]["lambda_n_per_m"]

    @property
    def map(self):
        """The arrays of `map.npz`."""
        with np.load(self.folder / "map.npz") as arrays:
            return dict(arrays)

    def currents(self, positions) -> Currents:
        """Currents of least power that let a magnet at the positions feel the object (eq. 8): one
        position x, y, z in m, or rows of them."""
        points, single = points_of(positions)
        currents, force, answer = self._native.currents(points)
        answer = ANSWERS[answer]
        return Currents(currents[0], force[0], answer[0]) if single else Currents(currents, force, answer)

    def force_per_ampere(self, positions) -> np.ndarray:
        """Upward force of every coil, N/A, [point, coil]; zero outside the map."""
        points, single = points_of(positions)
        force = self._native.force_per_ampere(points)
        return force[0] if single else force

    def height(self, positions) -> np.ndarray:
        """Height of the object's surface at x and y of the positions, m; nan where there is none."""
        points, single = points_of(positions)
        height = self._native.height(points)
        return height[0] if single else height

    def __repr__(self):
        found = self.manifest
        constant = self.lambda_n_per_m
        shown = "none" if constant is None else f"{constant:.4g} N/m"
        return f"Bundle({str(self.folder)!r}): {found['shape']} on {found['design']}, lambda {shown}"

    def _repr_html_(self):
        # The field with the coils; none where the bundle was made without a report.
        drawn = "".join(path.read_text("utf-8") for path in self.folder.glob("plots/field.svg"))
        return f"<p>{html.escape(repr(self))}</p>{drawn}"
