"""Currents of the least expected error: a part of load_bundle.py, which imports it. numpy only.

The algorithm is that of src/lambda/uncertainty/error_form.rs.
"""

import numpy as np

# The rule of degree 5 of Hammer and Stroud over a box: places on the axes and on the diagonals, and weights.
AXES = np.array([[(1 - 2 * (k % 2)) * (k // 2 == axis) for axis in range(3)] for k in range(6)], dtype=float)
DIAGONALS = np.array([[1.0 - 2 * (k >> axis & 1) for axis in range(3)] for k in range(8)])
PLACES = np.vstack([0.7958224257542215 * AXES, 0.7587869106393281 * DIAGONALS])
WEIGHTS = np.array(6 * [40 / 361] + 8 * [121 / 2888])
SUM_ROUNDS, SUM_MET, ROUNDING = 80, 1e-12, 1e-13


def places(position_m, sensor_m, ends_m):
    """Places around a position at which forces are needed, within the map's ends, and their weights."""
    if sensor_m == 0:
        return position_m[None, :], np.ones(1)
    return np.clip(position_m + sensor_m * PLACES, ends_m[0], ends_m[1]), WEIGHTS


class ExpectedError:
    """The mean square error of currents and their priced power, as a quadratic."""

    def __init__(self, rows, wanted, weights, setting, r, lower, upper):
        """`rows` [place, component, coil], `wanted` [place, component]."""
        price, _, square, mean, driver_square = setting
        weighed = rows * weights[:, None, None]
        self.matrix = square * np.einsum("pki,pkj->ij", weighed, rows)
        self.matrix += np.diag(square * driver_square * np.einsum("pki,pki->i", weighed, rows) + price * r)
        self.linear = mean * np.einsum("pki,pk->i", weighed, wanted)
        self.lower, self.upper = lower, upper

    def within_box(self, price, currents):
        """The least value of I'AI - 2 (b - price)'I over the box, from currents within it."""
        coils = len(currents)
        free = list(np.flatnonzero((currents > self.lower) & (currents < self.upper)))
        for _ in range(20 * coils + 20):
            others = currents.copy()
            others[free] = 0.0
            aim = np.linalg.solve(
                self.matrix[np.ix_(free, free)], (self.linear - price - self.matrix @ others)[free]
            )
            own, low, high = currents[free], self.lower[free], self.upper[free]
            beyond = np.flatnonzero((aim > high) | (aim < low))
            limits = np.where(aim > own, high, low)
            parts = (limits[beyond] - own[beyond]) / (aim[beyond] - own[beyond])
            share = np.min(parts, initial=1.0)
            currents[free] = np.clip(own + share * (aim - own), low, high)
            if share < 1.0:
                meets = beyond[np.argmin(parts)]
                currents[free.pop(meets)] = limits[meets]
                continue
            slope = self.matrix @ currents - self.linear + price
            size = np.abs(self.matrix) @ np.abs(currents) + np.abs(self.linear) + price
            moves = np.where(slope < 0, currents < self.upper, currents > self.lower)
            pull = np.where(moves & (np.abs(slope) > ROUNDING * size), np.abs(slope), 0.0)
            pull[free] = 0.0
            if not np.any(pull):
                break
            free.append(int(np.argmax(pull)))
        return currents

    def least(self, total, currents):
        """The currents of the least value within the limits, from some within them."""
        currents = self.within_box(0.0, currents.copy())
        if np.sum(currents) <= total * (1 + SUM_MET):
            return currents
        # Where coils push against each other the multiplier may have to outweigh more than their pulls.
        low, high = 0.0, np.max(np.abs(self.linear), initial=np.finfo(float).tiny)
        within = self.within_box(high, np.zeros(len(currents)))
        while np.sum(within) > total:
            low, high = high, 2 * high
            within = self.within_box(high, within)
        for _ in range(SUM_ROUNDS):
            middle = 0.5 * (low + high)
            currents = self.within_box(middle, currents)
            if np.sum(currents) > total:
                low = middle
                continue
            high, within = middle, currents.copy()
            if np.sum(currents) >= total * (1 - SUM_MET):
                break
        return within
