"""Currents of least power for a force vector: a part of load_bundle.py, which imports it. numpy only."""

import numpy as np


class Dual:
    """The dual of the least power for a force vector: the algorithm of src/lambda/vector_allocation.rs."""

    EPS_FIRST, EPS_LEAST, EPS_FACTOR, EPS_SUM = 1e-7, 1e-14, 1e-3, 1e-6
    STEPS, SLOPE_LEFT, REFINEMENTS = 60, 0.1, 3
    MET, PULL, PIVOT, ROUNDING, SPANNED = 1e-11, 1e-9, 1e-13, 1e-14, 1e-6

    def __init__(self, rows, target, conductance, lower, upper):
        self.rows, self.target, self.conductance = rows, target, conductance
        self.lower, self.upper = lower, upper
        self.at = np.zeros(len(lower), dtype=int)
        self.currents = np.zeros(len(lower))

    def place(self, y, n, all_free):
        """Currents, slope and curvature at y, and whether another coil is at a limit than before."""
        alone = self.conductance * (self.rows[:, :n] @ y[:n])
        at = np.where(alone <= self.lower, -1, np.where(alone >= self.upper, 1, 0))
        if all_free:
            at[:] = 0
        self.currents = np.where(at < 0, self.lower, np.where(at > 0, self.upper, alone))
        changed = all_free or bool(np.any(at != self.at))
        self.at = at
        free = self.rows[at == 0, :n]
        slope = self.target[:n] - self.eps[:n] * y[:n] - self.rows[:, :n].T @ self.currents
        curvature = np.diag(self.eps[:n]) + (free.T * self.conductance[at == 0]) @ free
        return slope, curvature, changed

    def top_along(self, y, step, n):
        """Where the dual is highest along a step: its slope falls piecewise linearly."""
        alone = self.conductance * (self.rows[:, :n] @ y[:n])
        per_step = self.rows[:, :n] @ step
        speed = self.conductance * per_step
        slope = float(step @ (self.target[:n] - self.eps[:n] * y[:n]))
        slope -= float(per_step @ np.clip(alone, self.lower, self.upper))
        fall = float(self.eps[:n] @ step**2)
        kinks = []
        for i in np.flatnonzero(speed):
            near, far = (self.lower[i], self.upper[i]) if speed[i] > 0 else (self.upper[i], self.lower[i])
            leaves, meets = (near - alone[i]) / speed[i], (far - alone[i]) / speed[i]
            if meets <= 0:
                continue
            bend = speed[i] * per_step[i]
            if leaves <= 0:
                fall += bend
            else:
                kinks.append((leaves, bend))
            kinks.append((meets, -bend))
        since = 0.0
        for to, bend in sorted(kinks):
            if slope <= fall * (to - since):
                break
            slope -= fall * (to - since)
            fall += bend
            since = to
        return since + slope / fall if fall > 0 else since

    def climb(self, y, n):
        """Newton's steps to the top of the dual."""
        slope, curvature, _ = self.place(y, n, not np.any(y[:n]))
        for _ in range(self.STEPS):
            step = _cholesky(curvature, slope, 0.0)
            if step is None:
                break
            uphill = float(step @ slope)
            if not 0 < uphill < np.inf:
                break
            there = y.copy()
            there[:n] += step
            found = self.place(there, n, False)
            if abs(float(step @ found[0])) <= self.SLOPE_LEFT * uphill:
                y[:] = there
                slope, curvature, changed = found
                if not changed:
                    break
                continue
            y[:n] += self.top_along(y, step, n) * step
            slope, curvature, _ = self.place(y, n, False)

    def left(self):
        """What is missing of force and sum, and the size of the force's terms."""
        sizes = np.linalg.norm(self.rows[:, :3], axis=1) * np.abs(self.currents)
        return self.target - self.rows.T @ self.currents, np.linalg.norm(self.target[:3]) + np.sum(sizes)

    def reached(self):
        left, size = self.left()
        return bool(np.linalg.norm(left[:3]) <= self.MET * size)

    def finish_exactly(self, climbed, n):
        """Solves the free currents without eps; whether that is optimal."""
        free = self.at == 0
        system = (self.rows[free, :n].T * self.conductance[free]) @ self.rows[free, :n]
        right = self.target[:n] - self.rows[~free, :n].T @ self.currents[~free]
        y = climbed.copy()
        for _ in range(self.REFINEMENTS):
            step = _cholesky(system + np.diag(self.eps[:n]), right - system @ y[:n], 0.0)
            if step is None:
                return False
            y[:n] += step
        size = np.sum(np.abs(y))
        if n == 4 and y[3] > self.MET * size:
            return False
        alone = self.conductance * (self.rows[:, :n] @ y[:n])
        slack = self.MET * np.maximum(self.conductance * size, self.upper - self.lower)
        low, high = alone >= self.lower - slack, alone <= self.upper + slack
        optimal = np.where(free, low & high, np.where(
            self.at < 0, alone <= self.lower + slack, alone >= self.upper - slack))
        if not np.all(optimal):
            return False
        self.currents = np.where(free, np.clip(alone, self.lower, self.upper), self.currents)
        terms = np.sum(np.abs(self.currents))
        return self.reached() and bool(np.sum(self.currents) <= self.target[3] + self.MET * terms)

    def finish_nearest(self, n):
        """Solves the free currents for the nearest force, of several by the least power; whether it is. Where the
        sum binds they share what the others leave of it, and a coil counts by how much it differs from their mean."""
        free = np.flatnonzero(self.at == 0)
        self.currents[free] = 0.0
        left, _ = self.left()
        right, conductance, more = left[:3], self.conductance[free], self.rows[free, :3]
        least = self.SPANNED * np.max(np.sqrt(conductance) * np.linalg.norm(more, axis=1), initial=0.0)
        shared = np.zeros(len(free))
        if n == 4 and len(free):
            mean = conductance @ more / np.sum(conductance)
            more = more - mean
            shared = left[3] * conductance / np.sum(conductance)
            right = right - mean * left[3]
        axes = _spanned(more * np.sqrt(conductance)[:, None], least)
        y = np.zeros(3)
        if axes.shape[1]:
            along = more @ axes
            solved = _cholesky((along.T * conductance) @ along, axes.T @ right, self.PIVOT)
            if solved is None:
                return False
            y = axes @ solved
        lower, upper, found = self.lower[free], self.upper[free], shared + conductance * (more @ y)
        slack = self.MET * (upper - lower)
        if not np.all((found >= lower - slack) & (found <= upper + slack)):
            return False
        self.currents[free] = np.clip(found, lower, upper)
        return self.nearest(n)

    def nearest(self, n):
        """Whether what is missing pulls every coil against the limit it is at, the sum's included."""
        left, size = self.left()
        missing = np.linalg.norm(left[:3])
        if missing <= self.MET * size:
            return False
        slack = self.PULL * missing + self.ROUNDING * size
        pull = self.rows[:, :3] @ left[:3]
        threshold = 0.0
        if n == 4:
            threshold = np.max(pull[self.at == 0], initial=-np.inf)
            if threshold < -slack:
                return False
        elif np.sum(self.currents) > self.target[3] * (1 + self.MET):
            return False
        pull = pull - threshold
        against = np.where(self.at == 0, np.abs(pull) <= slack, self.at * pull >= -slack)
        return bool(np.all(against))

    def lower_to_sum(self):
        """Brings all currents nearer to their lower limits until their sum is within its limit."""
        above = self.currents - self.lower
        if np.sum(self.currents) > self.target[3]:
            self.currents = self.lower + above * (self.target[3] - np.sum(self.lower)) / np.sum(above)

    def solve(self):
        """Whether the currents, which it leaves, give the force."""
        reached, proven = self.attempt()
        if proven or not self.even_out():
            return reached
        kept = self.currents
        if self.attempt() == (True, True):
            return True
        self.currents = kept
        return reached

    def even_out(self):
        """Changes rows and target to coordinates in which the coils without limits give alike in every direction;
        whether they give something in each."""
        product = (self.rows[:, :3].T * self.conductance) @ self.rows[:, :3]
        np.fill_diagonal(product, np.where(np.diag(product) == 0, 1.0, np.diag(product)))
        factored = _factored(product, self.PIVOT)
        if factored is None:
            return False
        self.rows[:, :3] = _forward(factored, self.rows[:, :3].T).T
        self.target[:3] = _forward(factored, self.target[:3])
        return True

    def attempt(self):
        """Whether the currents, which it leaves, give the force, and whether that is proven."""
        size = np.sum(self.conductance * np.sum(self.rows[:, :3] ** 2, axis=1))
        most = np.sum(np.linalg.norm(self.rows[:, :3], axis=1) * np.maximum(self.upper, -self.lower))
        # The multipliers grow with the force beyond reach; the sum's limit holds all the same.
        within_reach = min(most / np.linalg.norm(self.target[:3]), 1.0)
        of_sum = self.EPS_SUM * within_reach * np.sum(self.conductance)
        y, share = np.zeros(4), self.EPS_FIRST
        while True:
            self.eps = share * np.array([size, size, size, of_sum])
            n, y[3] = 3, 0.0
            self.climb(y, n)
            if np.sum(self.currents) > self.target[3]:
                n = 4
                self.climb(y, n)
            if self.finish_exactly(y, n):
                return True, True
            if self.finish_nearest(n):
                return self.reached(), True
            if share * self.EPS_FACTOR < self.EPS_LEAST:
                alone = self.conductance * (self.rows[:, :n] @ y[:n])
                self.currents = np.clip(alone, self.lower, self.upper)
                self.lower_to_sum()
                return self.reached(), False
            share *= self.EPS_FACTOR


def _spanned(forces, least):
    """Orthonormal axes, [component, axis], of the space that forces span, the longest first; none for what is no
    longer than `least`."""
    axes = np.zeros((3, 0))
    while axes.shape[1] < 3:
        rest = forces - (forces @ axes) @ axes.T
        lengths = np.linalg.norm(rest, axis=1)
        if not np.max(lengths, initial=0.0) > least:
            break
        longest = np.argmax(lengths)
        axes = np.column_stack([axes, rest[longest] / lengths[longest]])
    return axes


def _cholesky(matrix, right, least):
    """Solves a symmetric positive definite system; None where a pivot is at most `least` of its entry."""
    factored = _factored(matrix, least)
    if factored is None:
        return None
    scale, factor = factored
    x = _forward(factored, right)
    for a in reversed(range(len(x))):
        x[a] = (x[a] - factor[a + 1 :, a] @ x[a + 1 :]) / factor[a, a]
    return x / scale


def _factored(matrix, least):
    """S and L of a symmetric positive definite matrix S L L' S; None as _cholesky."""
    scale = np.sqrt(np.diag(matrix))
    if not np.all((scale > 0) & np.isfinite(scale)):
        return None
    scaled, factor = matrix / np.outer(scale, scale), np.zeros_like(matrix)
    for a in range(len(scale)):
        for b in range(a + 1):
            value = scaled[a, b] - factor[a, :b] @ factor[b, :b]
            if a != b:
                factor[a, b] = value / factor[b, b]
            elif not value > least:
                return None
            else:
                factor[a, a] = np.sqrt(value)
    return scale, factor


def _forward(factored, right):
    """(S L)^-1 times a column or columns."""
    scale, factor = factored
    x = (right.T / scale).T
    for a in range(len(x)):
        x[a] = (x[a] - factor[a, :a] @ x[:a]) / factor[a, a]
    return x
