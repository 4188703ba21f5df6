"""What the steel core does to a coil: tensor Chebyshev interpolation of a finite-element table.

Works on complex numbers too, so that derivatives come from complex steps.
"""

import json
import pathlib

import numpy as np

TABLE = pathlib.Path(__file__).resolve().parents[2] / "tests" / "oracles" / "nlopt" / "core_table.json"
HEIGHT_M = 0.030
BELOW_M = 0.010
RELATIVE_PERMEABILITY = 1000.0


def chebyshev_axis(lo, hi, nodes):
    """Chebyshev points of the first kind in the logarithm, ascending."""
    x = -np.cos(np.pi * (np.arange(nodes) + 0.5) / nodes)
    return np.exp(0.5 * (np.log(lo * hi) + x * np.log(hi / lo)))


class CoreTable:
    """Ratios cored / air of gradient and inductance; arguments ID, radial build, length in m."""

    def __init__(self, table):
        self.box_m = np.array(table["box_m"])
        self.nodes = table["nodes"]
        self.gradient_error = table.get("gradient_error")
        self.inductance_error = table.get("inductance_error")
        values = np.stack([table["gradient_ratio"], table["inductance_ratio"]], axis=-1)
        values = np.log(values.reshape(*self.nodes, 2))
        # Values at the nodes to Chebyshev coefficients, axis by axis.
        for axis, n in enumerate(self.nodes):
            angle = np.pi * (np.arange(n) + 0.5) / n
            to_coefficients = 2 / n * np.cos(np.outer(np.arange(n), angle)) * (-1.0) ** np.arange(n)[:, None]
            to_coefficients[0] /= 2
            values = np.moveaxis(np.tensordot(to_coefficients, values, (1, axis)), 0, axis)
        self.coefficients = values

    @classmethod
    def load(cls):
        return cls(json.loads(TABLE.read_text()))

    def __call__(self, inner_m, build_m, length_m):
        """Gradient ratio and inductance ratio."""
        out = self.coefficients
        for value, (lo, hi), n in zip((inner_m, build_m, length_m), self.box_m, self.nodes):
            x = (2 * np.log(value) - np.log(lo * hi)) / np.log(hi / lo)
            t = [1.0 + 0 * x, x]
            while len(t) < n:
                t.append(2 * x * t[-1] - t[-2])
            out = np.tensordot(np.array(t), out, (0, 0))
        return np.exp(out)

    def holds(self, inner_m, build_m, length_m, slack=1e-9):
        """Whether a coil lies in the box, ends included."""
        point = np.array([inner_m, build_m, length_m])
        lo, hi = self.box_m.T
        return bool(np.all(point >= lo * (1 - slack)) and np.all(point <= hi * (1 + slack)))
