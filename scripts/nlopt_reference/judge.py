"""The gate: fluxform's numbers and optima against the independent model and the reference."""

import math

from . import core, problem as problem_module

FEASIBLE = 1e-9
FORCE = 1e-9
SENSITIVITY = {"air": 1e-4, "cored": 1e-3}
COIL = ("inner_diameter_m", "outer_diameter_m", "length_m", "wire_diameter_m", "force_n")
MODELS = {"force_n": 1e-10, "resistance_ohm": 1e-10, "inductance_h": 1e-10}


def design_of(entry, table):
    """A `Problem` that holds one line of a --models file: only its model is used."""
    return problem_module.Problem(
        name=entry.get("name", "design"),
        wire_m=entry["wire_diameter_m"],
        conductor_m=entry.get("conductor_diameter_m", entry["wire_diameter_m"]),
        resistivity_ohm_m=entry.get("resistivity_ohm_m", 1.68e-8),
        moment_a_m2=entry.get("moment_a_m2", 1.1579e6 * math.pi / 4 * 1e-6),
        current_a=entry["current_a"],
        voltage_v=None,
        height_m=entry.get("target_height_m", 0.03),
        limits={},
        choices_m=[],
        start_m=(1.0, 1.0, 1.0),
        core=table if entry.get("core", False) else None,
    )


def compare_models(data):
    """Messages about values beyond tolerance; and the largest error of each kind."""
    table = core.CoreTable.load()
    faults, largest = [], {}
    for k, entry in enumerate(data["designs"]):
        design = design_of(entry, table)
        inner = entry["inner_diameter_m"]
        build = (entry["outer_diameter_m"] - inner) / 2
        label = entry.get("name", f"designs[{k}]")
        if design.core is not None and not table.holds(inner, build, entry["length_m"]):
            faults.append(f"{label}: outside the core table's box")
            continue
        value = design.values(inner, build, entry["length_m"])
        for key, tolerance in MODELS.items():
            if design.core is not None and key != "resistance_ohm":
                table_error = table.gradient_error if key == "force_n" else table.inductance_error
                tolerance += 2 * table_error
            error = abs(abs(entry[key]) / float(value[key]) - 1)
            kind = ("cored " if design.core is not None else "air ") + key
            largest[kind] = max(largest.get(kind, 0.0), error)
            if not error <= tolerance:
                faults.append(
                    f"{label}: {key} {entry[key]!r}, reference {float(value[key])!r}, "
                    f"relative error {error:.1e} > {tolerance:.1e}"
                )
    return faults, largest


def judge_one(problem, wanted, claim):
    """Faults of one claimed optimum."""
    status = claim.get("status")
    if wanted["status"] == "infeasible":
        return [] if status == "infeasible" else [f"status {status!r}, but no coil meets the limits"]
    if status == "infeasible":
        return [f"status 'infeasible', but a coil gives {wanted['best']['force_n']:.9g} N"]
    missing = [key for key in COIL if not math.isfinite(claim.get(key, math.nan))]
    if missing:
        return [f"status {status!r} without a finite {', '.join(missing)}"]
    faults = []
    wire_m = claim["wire_diameter_m"]
    if not any(math.isclose(wire_m, wire.wire_m, rel_tol=1e-12) for wire in problem.wires()):
        return [f"wire of {wire_m!r} m is not the design's"]
    wound = problem.with_wire(wire_m)
    inner, length = claim["inner_diameter_m"], claim["length_m"]
    build = (claim["outer_diameter_m"] - inner) / 2
    if not (inner > 0 and build > 0 and length > 0):
        return [f"no coil: {inner!r}, {claim['outer_diameter_m']!r}, {length!r}"]
    table = wound.core
    if table is not None and not table.holds(inner, build, length):
        return ["the coil lies outside the core table's box"]
    allowed = {} if table is None else {"settling_s": 2 * table.inductance_error}
    value = wound.values(inner, build, length)
    excess = {"layers": wire_m / build - 1, "turns_per_layer": wire_m / length - 1}
    for name, limit in wound.limits.items():
        ratio = limit / value[name] if name == "inner_diameter_m" else value[name] / limit
        excess[name] = ratio - 1
    for name, by in excess.items():
        if not by <= FEASIBLE + allowed.get(name, 0.0):
            faults.append(f"{name} exceeds its limit by {by:.2e} of it")
    force, claimed = float(value["force_n"]), abs(claim["force_n"])
    tolerance = FORCE + (0.0 if table is None else 2 * table.gradient_error)
    if not abs(claimed / force - 1) <= tolerance:
        faults.append(f"force {claimed!r} N, reference model {force!r} N, tolerance {tolerance:.1e}")
    best, tolerance = wanted["best"]["force_n"], wanted["objective_tolerance"]
    for what, got in (("force", force), ("claimed force", claimed)):
        if not got >= best * (1 - tolerance):
            faults.append(f"{what} {got!r} N is below the reference's {best!r} N by {1 - got / best:.2e}")
    bound = claim.get("upper_bound_n")
    if bound is not None and not bound >= best * (1 - tolerance):
        faults.append(f"upper bound {bound!r} N lies below {best!r} N, which a coil gives")
    return faults + sensitivity_faults(problem, wanted, claim.get("sensitivity_n_per_unit", {}))


def sensitivity_faults(problem, wanted, claimed):
    """Claimed dF/dlimit against the multipliers, in units of F/limit.

    Where the supply's kink is active they differ from side to side and are not judged.
    """
    if "supply" in wanted["active"]:
        return []
    faults = []
    for name, got in claimed.items():
        if name not in problem.limits:
            faults.append(f"sensitivity to {name}, which is no limit of the design")
            continue
        unit = wanted["best"]["force_n"] / problem.limits[name]
        known = wanted["active"].get(name, {}).get("sensitivity_n_per_unit", 0.0)
        if not abs(got - known) <= SENSITIVITY["air" if problem.core is None else "cored"] * unit:
            faults.append(f"sensitivity to {name} {got!r} N per unit, reference {known!r}")
    return faults


def judge(problems, reference, claims, partial=False):
    """Faults of every problem: {name: [message]}, names with none left out; and remarks."""
    faults, remarks = {}, []
    for name, problem in problems.items():
        wanted = reference["problems"][name]
        if name not in claims:
            if not partial:
                faults[name] = ["no optimum given"]
            continue
        found = judge_one(problem, wanted, claims[name])
        if found:
            faults[name] = found
        elif wanted["status"] == "optimal":
            gain = abs(claims[name]["force_n"]) / wanted["best"]["force_n"] - 1
            if gain > wanted["objective_tolerance"]:
                remarks.append(f"{name}: better than the reference by {gain:.2e}")
    return faults, remarks
