"""Equation 11 as numbers: a design file to objective, constraints and their derivatives.

The variables are the logarithms u = (ln ID, ln build, ln length), build = (OD - ID)/2: volumes,
resistance, mass and force are nearly linear in them, at any size. Objective and constraints are
logarithms too: maximise ln |m g I|, subject to ln(value / limit) <= 0.

The rated current min(I_max, V/R) has a kink. It is cut out: the problem is solved on R <= V/I_max
(`regime` "current") and on R >= V/I_max ("voltage"), each smooth, and the better one counts.
"""

import dataclasses
import tomllib

import numpy as np

from . import air, core

COPPER_ALPHA_PER_K = 3.93e-3
COPPER_KG_PER_M3 = 8890.0
STEEL_KG_PER_M3 = 7870.0
STEP = 1e-40

# Limit key in a design, what divides it into SI, name in artefacts.
LIMITS = {
    "resistance_max_ohm": (1.0, "resistance_ohm"),
    "settling_max_ms": (1000.0, "settling_s"),
    "outer_diameter_max_mm": (1000.0, "outer_diameter_m"),
    "inner_diameter_min_mm": (1000.0, "inner_diameter_m"),
    "length_max_mm": (1000.0, "length_m"),
    "power_max_w": (1.0, "power_w"),
    "mass_max_kg": (1.0, "mass_kg"),
    "wire_length_max_m": (1.0, "wire_length_m"),
}


@dataclasses.dataclass(frozen=True)
class Mutation:
    """Deliberate faults of the model, for the self-test of the gate."""

    mu_0: float = 1.0
    moment: float = 1.0
    resistance: float = 1.0
    turns: float = 1.0
    inductance: float = 1.0
    target_m: float = 0.0
    core_mass: float = 1.0
    core_below_m: float = 0.0
    limits: tuple = ()  # (name, value in SI or None for no limit)
    rated: bool = True  # False: the supply's voltage is forgotten


@dataclasses.dataclass
class Problem:
    name: str
    wire_m: float
    conductor_m: float
    resistivity_ohm_m: float
    moment_a_m2: float
    current_a: float
    voltage_v: float | None
    height_m: float
    limits: dict
    choices_m: list
    start_m: tuple  # ID, build, length of the design's coil
    core: core.CoreTable | None
    mutation: Mutation = Mutation()

    @classmethod
    def read(cls, path, table=None):
        with open(path, "rb") as file:
            design = tomllib.load(file)
        coil, wire = design["coil"], design["wire"]
        magnet, supply = design.get("magnet", {}), design.get("supply", {})
        limits = {}
        for key, value in design.get("limits", {}).items():
            divisor, name = LIMITS[key]
            limits[name] = value / divisor
        warm = 1 + COPPER_ALPHA_PER_K * (wire.get("temperature_c", 20.0) - 20.0)
        diameter, length = magnet.get("diameter_mm", 10.0), magnet.get("length_mm", 10.0)
        volume = np.pi / 4 * diameter**2 * length * 1e-9
        height_m = design.get("target", {}).get("height_mm", 30.0) / 1000
        steel = design.get("core")
        if steel is not None:
            asked = (
                height_m,
                steel.get("below_mm", 10.0) / 1000,
                steel.get("relative_permeability", 1000.0),
                steel.get("clearance_mm", 0.0),
                steel.get("above_mm", 0.0),
            )
            if asked != (core.HEIGHT_M, core.BELOW_M, core.RELATIVE_PERMEABILITY, 0.0, 0.0):
                raise ValueError(f"{path}: the core's table does not hold this core")
        inner, outer = coil["inner_diameter_mm"] / 1000, coil["outer_diameter_mm"] / 1000
        return cls(
            name=design["name"],
            wire_m=wire["diameter_mm"] / 1000,
            conductor_m=wire.get("conductor_diameter_mm", wire["diameter_mm"]) / 1000,
            resistivity_ohm_m=wire.get("resistivity_ohm_m", 1.68e-8) * warm,
            moment_a_m2=magnet.get("magnetization_a_per_m", 1.1579e6) * volume,
            current_a=supply.get("current_max_a", 2.0),
            voltage_v=supply.get("voltage_v"),
            height_m=height_m,
            limits=limits,
            choices_m=[value / 1000 for value in wire.get("choices_mm", [])],
            start_m=(inner, (outer - inner) / 2, coil["length_mm"] / 1000),
            core=None if steel is None else (table or core.CoreTable.load()),
        )

    def with_wire(self, wire_m):
        """The same problem for one of the choices: the insulation keeps its share."""
        conductor_m = wire_m * (self.conductor_m / self.wire_m)
        return dataclasses.replace(self, wire_m=wire_m, conductor_m=conductor_m, choices_m=[])

    def wires(self):
        return [self.with_wire(wire_m) for wire_m in self.choices_m] or [self]

    def mutated(self, mutation):
        limits = dict(self.limits)
        for name, value in mutation.limits:
            if name in limits:
                limits[name] = value
        limits = {name: value for name, value in limits.items() if value is not None}
        voltage_v = self.voltage_v if mutation.rated else None
        return dataclasses.replace(self, limits=limits, voltage_v=voltage_v, mutation=mutation)

    def regimes(self):
        return ["current"] if self.voltage_v is None else ["current", "voltage"]

    def values(self, inner, build, length, current=None, inductance=True):
        """Everything that limits speak of, and the force; `current`: a regime, None for the rated."""
        change = self.mutation
        a1 = inner / 2
        a2 = a1 + build
        turns = change.turns * (build / self.wire_m) * (length / self.wire_m)
        wire_length = turns * np.pi * (a1 + a2)
        section = np.pi / 4 * self.conductor_m**2
        resistance = change.resistance * self.resistivity_ohm_m * wire_length / section
        mass = wire_length * section * COPPER_KG_PER_M3
        gradient = turns * air.gradient(a1, a2, length, self.height_m + change.target_m)
        if inductance:
            inductance = turns**2 * air.inductance(a1, a2, length) * change.inductance
        if self.core is not None:
            steel = np.pi * a1 * a1 * (length + core.BELOW_M + change.core_below_m)
            mass = mass + change.core_mass * steel * STEEL_KG_PER_M3
            field_ratio, flux_ratio = self.core(inner, build, length)
            gradient, inductance = gradient * field_ratio, inductance * flux_ratio
        gradient, inductance = gradient * change.mu_0, inductance * change.mu_0
        amperes = self.current_a
        if self.voltage_v is not None:
            at_voltage = self.voltage_v / resistance
            if current == "voltage" or (current is None and at_voltage.real < amperes):
                amperes = at_voltage
        return {
            "turns": turns,
            "resistance_ohm": resistance,
            "inductance_h": inductance,
            "settling_s": 5 * inductance / resistance,
            "outer_diameter_m": 2 * a2,
            "inner_diameter_m": inner,
            "length_m": length,
            "power_w": amperes**2 * resistance,
            "mass_kg": mass,
            "wire_length_m": wire_length,
            "current_a": amperes,
            "gradient_t_per_m_per_a": gradient,
            "force_n": change.moment * self.moment_a_m2 * -gradient * amperes,
        }

    def names(self):
        """The constraints, in the order of `functions`."""
        return [*self.limits, *(["supply"] if self.voltage_v is not None else [])]

    def functions(self, u, regime):
        """ln force and the constraints ln(value / limit) <= 0."""
        value = self.values(*np.exp(u), current=regime, inductance="settling_s" in self.limits)
        rows = [np.log(value["force_n"])]
        for name, limit in self.limits.items():
            ratio = value[name] / limit
            rows.append(np.log(1 / ratio if name == "inner_diameter_m" else ratio))
        if self.voltage_v is not None:
            ratio = value["resistance_ohm"] * self.current_a / self.voltage_v
            rows.append(np.log(1 / ratio if regime == "voltage" else ratio))
        return np.array(rows)

    def derivatives(self, u, regime):
        """Rows: functions; columns: variables. Complex steps, exact to rounding."""
        columns = []
        for k in range(3):
            moved = np.array(u, dtype=complex)
            moved[k] += 1j * STEP
            columns.append(self.functions(moved, regime).imag / STEP)
        return np.array(columns).T

    def violation(self, inner, build, length):
        """Largest relative violation of the limits at the rated current, and its name.

        One layer and one turn at least: a build or length under the wire's diameter counts.
        """
        value = self.values(inner, build, length)
        worst = {"layers": self.wire_m / build - 1, "turns_per_layer": self.wire_m / length - 1}
        for name, limit in self.limits.items():
            worst[name] = (limit / value[name] if name == "inner_diameter_m" else value[name] / limit) - 1
        name = max(worst, key=worst.get)
        return float(worst[name]), name

    def bounds(self):
        """Lower and upper ends of u: far outside the limits, never binding where limits do.

        A cored coil stays in the box of its table.
        """
        inner, build, length = self.start_m
        lo = [inner / 100, self.wire_m, self.wire_m]
        hi = [30 * inner, max(30 * build, 2 * self.wire_m), max(30 * length, 2 * self.wire_m)]
        if self.core is not None:
            box_lo, box_hi = self.core.box_m.T
            lo, hi = np.maximum(lo, box_lo), np.minimum(hi, box_hi)
        return np.log(lo), np.log(hi)

    def sampling(self):
        """The part of the bounds in which starting points are drawn."""
        lo, hi = self.bounds()
        limits = self.limits
        outer = limits.get("outer_diameter_m", np.inf)
        lowest = limits.get("inner_diameter_m", 0.0)
        wide = [outer, (outer - lowest) / 2, limits.get("length_m", np.inf)]
        low = [lowest, 0.0, 0.0]
        narrow_lo = [max(a, np.log(b)) if b > 0 else a for a, b in zip(lo, low)]
        narrow_hi = [min(a, np.log(b)) if b > 0 else a for a, b in zip(hi, wide)]
        ok = all(a < b for a, b in zip(narrow_lo, narrow_hi))
        return (np.array(narrow_lo), np.array(narrow_hi)) if ok else (lo, hi)
