"""Self-test of the gate: optima of deliberately wrong models must be turned away.

Each mutant's optimum is found by SLSQP in the mutated model and claimed with the mutated force.
"""

import concurrent.futures

from . import judge, solve

# What is wrong, the keywords of problem.Mutation, the problems that must notice.
MUTANTS = [
    ("resistance limit 6.1 instead of 6", {"limits": [["resistance_ohm", 6.1]]}, ["seed_air", "cored_no_settling"]),
    ("resistance limit 5.99 instead of 6", {"limits": [["resistance_ohm", 5.99]]}, ["seed_air", "cored_no_settling"]),
    ("no settling limit", {"limits": [["settling_s", None]]}, ["air_settling", "seed_cored"]),
    ("settling of 4 time constants", {"limits": [["settling_s", 0.0047 * 5 / 4]]}, ["air_settling"]),
    ("mu_0 wrong by 1e-6", {"mu_0": 1 + 1e-6}, ["seed_air", "air_settling"]),
    ("mu_0 wrong by 1e-3, cored", {"mu_0": 1.001}, ["seed_cored", "cored_mass"]),
    ("moment of a magnet 1 % longer", {"moment": 1.01}, ["seed_air", "seed_cored"]),
    ("one turn in a hundred not counted", {"turns": 0.99}, ["seed_air", "cored_no_settling"]),
    ("inductance 1 % low", {"inductance": 0.99}, ["air_settling", "seed_cored"]),
    ("resistance without the wire's warmth", {"resistance": 0.8}, ["air_hot_insulated"]),
    ("target 1 um too near", {"target_m": -1e-6}, ["seed_air", "air_power"]),
    ("supply's voltage forgotten", {"rated": False}, ["air_voltage"]),
    ("steel without mass", {"core_mass": 0.0}, ["cored_mass"]),
    ("core ends with the winding", {"core_below_m": -0.01}, ["cored_mass"]),
    ("no diameter limit", {"limits": [["outer_diameter_m", None]]}, ["infeasible_diameters"]),
]


def claim_of(answer):
    result = answer["result"]
    if result["best"] is None:
        return {"status": "infeasible"}
    return dict(result["best"], status="optimal")


def run(reference, jobs):
    """Messages about mutants that pass, or an unmutated model that does not."""
    entries = {entry["name"]: entry for entry in solve.problem_list()}
    tasks = [(what, mutation, name) for what, mutation, names in MUTANTS for name in names]
    controls = sorted({name for _, _, name in tasks})
    tasks += [(None, None, name) for name in controls]
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        answers = list(
            pool.map(lambda task: solve.run_worker(entries[task[2]], "LD_SLSQP", task[1]), tasks)
        )
    failures = []
    for (what, _, name), answer in zip(tasks, answers):
        failures += verdict(what, name, entries, reference, claim_of(answer))
    # Wrong statuses, without any solver.
    for name, claim in (("seed_air", {"status": "infeasible"}), ("infeasible_diameters", claim_of(answers[0]))):
        failures += verdict("wrong status", name, entries, reference, claim)
    return failures


def verdict(what, name, entries, reference, claim):
    problems = {name: solve.read(entries[name])}
    faults, _ = judge.judge(problems, reference, {name: claim})
    first = faults.get(name, ["passes"])[0]
    print(f"{what or 'unmutated':38} {name:22} {first}", flush=True)
    if what is None:
        return [f"unmutated model fails on {name}: {first}"] if faults else []
    return [] if faults else [f"mutant not noticed on {name}: {what}"]
