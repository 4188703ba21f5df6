//! The best coil: local searches from many starts, all wires, either side of the supply's kink.

use super::branch_and_bound::{self, GAP};
use super::diagnosis;
use super::domain::Domain;
use super::interval_bounds::{Bounding, Multipliers};
use super::local_searches::{Settings, Solved, best_of, keep_better, locals, promising, starts_of};
use super::model::{CoilModel, Window};
use super::near_optimal_bore;
use super::outcome::{
    BestCoil, Certificate, CertificateKind, LimitUse, OptimumStatus, Outcome, WireOutcome,
};
use super::problem::{LimitName, Problem, Task};
use super::sqp::{self, ACTIVE, FEASIBLE, Local};
use super::starts;
use super::surrogate;
use fluxform_base::progress::{Interrupted, Progress};

/// Maximises |force| over the coils that `task` admits.
///
/// # Errors
/// Interruption.
pub fn optimise(
    model: &dyn CoilModel,
    task: &Task,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Outcome, Interrupted> {
    let mut problems = match solve_all(model, task, settings, progress)? {
        Ok(problems) => problems,
        Err((status, problems)) => return Ok(without_coil(status, &problems)),
    };
    let sharp = surrogate::sharpened(model, task, &problems, progress)?;
    if let Some(sharp) = &sharp {
        let restated = surrogate::restated(&**sharp, task, &problems);
        if best_of(&restated).is_some() {
            problems = restated;
        }
    }
    progress.begin("certify", problems.len() as u64);
    let certificate = certify(&mut problems, settings, progress)?;
    progress.end();
    let winner = best_of(&problems);
    let Some(winner) = winner else {
        // best_n > 0 means one has been found.
        return Ok(without_coil(
            OptimumStatus::Unbounded { missing: vec![] },
            &problems,
        ));
    };
    let best = describe(winner);
    let valley = if settings.valley {
        near_optimal_bore::valley(winner, progress)?
    } else {
        None
    };
    Ok(Outcome {
        best,
        certificate,
        valley,
        ..without_coil(OptimumStatus::Optimal, &problems)
    })
}

/// Why there is no coil, and the problems that have none.
type NoCoil<'a> = (OptimumStatus, Vec<Solved<'a>>);

/// How many times more starts are tried where none found a coil.
const PATIENCE: usize = 3;

/// Every problem with its best local optimum, or the status that says why there is none.
pub(super) fn solve_all<'a>(
    model: &'a dyn CoilModel,
    task: &'a Task,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Result<Vec<Solved<'a>>, NoCoil<'a>>, Interrupted> {
    let mut problems: Vec<Solved<'_>> = task
        .strands
        .iter()
        .flat_map(|&strand| Problem::of_wire(model, task, strand))
        .map(|problem| Solved {
            contradiction: Domain::contradiction(&problem),
            missing: Domain::of(&problem).missing(&problem),
            problem,
            best: None,
            evaluations: 0,
            starts: 0,
        })
        .collect();
    let open = |solved: &Solved<'_>| solved.contradiction.is_none() && solved.missing.is_empty();
    let unbounded = problems
        .iter()
        .find(|s| s.contradiction.is_none() && !s.missing.is_empty())
        .map(|s| s.missing.clone());
    if let Some(missing) = unbounded {
        return Ok(Err((OptimumStatus::Unbounded { missing }, problems)));
    }
    let rounds = if task.limits.settling_max_s.is_some() {
        2
    } else {
        1
    };
    let total = problems.iter().filter(|s| open(s)).count() * settings.starts * rounds;
    let mut best_n = 0.0;
    // That no start finds a coil is no proof: more are tried before it is said.
    for patience in [1, PATIENCE] {
        let settings = Settings {
            starts: patience * settings.starts,
            ..*settings
        };
        progress.begin("optimise", (patience * total) as u64);
        for solved in problems.iter_mut().filter(|s| open(s)) {
            multistart(solved, &settings, progress)?;
            if let Some(force_n) = solved.force_n()
                && force_n > best_n
            {
                best_n = force_n;
                progress.improved(force_n, "N");
            }
        }
        progress.end();
        if best_n > 0.0 {
            break;
        }
    }
    if best_n <= 0.0 {
        let status = diagnosis::why_none(&problems, settings, progress)?;
        return Ok(Err((status, problems)));
    }
    Ok(Ok(problems))
}

fn wires(problems: &[Solved<'_>]) -> Vec<WireOutcome> {
    let mut wires: Vec<WireOutcome> = Vec::new();
    for solved in problems {
        let force_n = solved.force_n();
        let wire_diameter_m = solved.problem.strand.diameter_m;
        match wires
            .iter_mut()
            .find(|w| w.wire_diameter_m == wire_diameter_m)
        {
            Some(wire) => {
                wire.force_n = match (wire.force_n, force_n) {
                    (Some(a), Some(b)) => Some(a.max(b)),
                    (a, b) => a.or(b),
                }
            }
            None => wires.push(WireOutcome {
                wire_diameter_m,
                force_n,
            }),
        }
    }
    wires
}

/// Why there is no coil, and how far `problems` were searched.
pub(super) fn without_coil(status: OptimumStatus, problems: &[Solved<'_>]) -> Outcome {
    Outcome {
        status,
        best: None,
        continuous: None,
        continuous_force_n: None,
        alternatives: Vec::new(),
        certificate: Certificate::of_searches(starts_of(problems), 0),
        wires: wires(problems),
        evaluations: problems.iter().map(|s| s.evaluations).sum(),
        starts: starts_of(problems),
        valley: None,
    }
}

/// Local searches from every start; the best coil within the limits is kept.
fn multistart(
    solved: &mut Solved<'_>,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<(), Interrupted> {
    // The inductance costs most. Without the settling time the force can only be higher: a coil
    // that is best without it and meets it is best with it.
    if let Some(relaxed) = solved.problem.without(&[LimitName::Settling]) {
        let (best, evaluations) = search(&relaxed, settings, progress)?;
        solved.evaluations += evaluations;
        solved.starts += settings.starts;
        if let Some(local) = best
            && let Some(best) = solved.problem.adopted(&relaxed, &local)
            && best.violation(&solved.problem) <= FEASIBLE
        {
            solved.best = Some(best);
            progress.advance(settings.starts as u64);
            return Ok(());
        }
    }
    let (best, evaluations) = search(&solved.problem, settings, progress)?;
    solved.evaluations += evaluations;
    solved.starts += settings.starts;
    solved.best = best;
    Ok(())
}

fn search(
    problem: &Problem<'_>,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<(Option<Local>, usize), Interrupted> {
    let domain = Domain::of(problem);
    let scale_m = problem.model.length_scale_m();
    let mut points: Vec<[f64; 3]> = (0..settings.starts)
        .map(|index| starts::start(&domain, scale_m, settings.seed, index))
        .collect();
    points.extend(settings.initial.as_ref().map(Problem::coordinates));
    let mut evaluations = 0;
    let ends = match problem.model.draft() {
        Some(draft) => {
            let draft = problem.with_model(&*draft);
            let found = locals(&draft, points, 1, progress)?;
            evaluations += found.iter().map(|local| local.evaluations).sum::<usize>();
            let doubt = |x| draft.model.doubts(&Problem::window(x)).force_ln;
            let starts = promising(&draft, doubt, found);
            let best = starts.first().map(|best| Problem::window(*best));
            let own = best.and_then(|best| problem.model.focus(&best));
            let on_own = own.as_ref().map(|model| problem.with_model(&**model));
            let problem = on_own.as_ref().unwrap_or(problem);
            let mut ends = Vec::new();
            // Smaller ones where the limits turn out to be tighter than on the draft.
            for less in SMALLER {
                let starts = starts.iter().map(|x| x.map(|x| x - less)).collect();
                ends.extend(locals(problem, starts, 0, progress)?);
                if ends
                    .iter()
                    .any(|local| local.violation(problem) <= FEASIBLE)
                {
                    break;
                }
            }
            // The given coil counts as it is where no search leads to one that meets the limits.
            let is_met = |local: &Local| local.violation(problem) <= FEASIBLE;
            if !ends.iter().any(is_met) {
                let initial = settings.initial.as_ref().map(Problem::coordinates);
                ends.extend(locals(problem, initial.into_iter().collect(), 0, progress)?);
                ends.extend(initial.and_then(|x| Local::at(problem, x)));
            }
            ends
        }
        None => locals(problem, points, 1, progress)?,
    };
    let mut best: Option<Local> = None;
    for local in ends {
        evaluations += local.evaluations;
        keep_better(problem, &mut best, local);
    }
    if let Some(local) = &best
        && problem.task.fixed.inner_diameter_m.is_none()
    {
        let bored = bored(&Problem::window(local.x)).map(|window| Problem::coordinates(&window));
        if let Some(local) = bored.and_then(|x| sqp::solve(problem, x)) {
            evaluations += local.evaluations;
            keep_better(problem, &mut best, local);
        }
    }
    Ok((best, evaluations))
}

/// How much smaller, relatively, coils are tried in turn where a draft's do not lead to one that
/// meets the limits.
const SMALLER: [f64; 3] = [0.0, 0.04, 0.15];

/// The same winding with a bore; `None` where it has one. On the axis the force's slope vanishes:
/// a bore may be better and not be seen from there.
fn bored(window: &Window) -> Option<Window> {
    (window.inner_radius_m < 1e-3 * window.depth_m).then_some(Window {
        inner_radius_m: 0.05 * window.depth_m,
        depth_m: 0.95 * window.depth_m,
        ..*window
    })
}

/// Bounds every problem against the best force; searches again where a box shows a better coil.
fn certify(
    problems: &mut [Solved<'_>],
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Certificate, Interrupted> {
    const ROUNDS: usize = 4;
    let mut cells = 0;
    let mut upper_ln = f64::NEG_INFINITY;
    let mut best_ln = best_of(problems).map_or(f64::NEG_INFINITY, best_ln_of);
    let starts = starts_of(problems);
    let unproven = |cells| Certificate::of_searches(starts, cells);
    if settings.cells == 0 {
        return Ok(unproven(0));
    }
    for _ in 0..ROUNDS {
        upper_ln = best_ln;
        let mut improved = false;
        for solved in problems.iter_mut() {
            if solved.contradiction.is_some() {
                continue;
            }
            let Some(domain) = branch_and_bound::finite_domain(&solved.problem, best_ln.exp())
            else {
                return Ok(unproven(cells));
            };
            let (bound, better) = bound(solved, domain, best_ln, settings, &mut cells, progress)?;
            upper_ln = upper_ln.max(bound);
            if let Some(window) = better {
                let local = sqp::solve(&solved.problem, Problem::coordinates(&window));
                if let Some(local) = local {
                    solved.evaluations += local.evaluations;
                    keep_better(&solved.problem, &mut solved.best, local);
                }
                let now = solved.best.as_ref().map_or(best_ln, |l| -l.point.objective);
                improved |= now > best_ln;
                best_ln = best_ln.max(now);
                if !improved {
                    return Ok(unproven(cells));
                }
            }
            progress.advance(1);
        }
        if !improved {
            break;
        }
    }
    let Some(gap) = Some((upper_ln - best_ln).exp_m1()).filter(|gap| gap.is_finite()) else {
        return Ok(unproven(cells));
    };
    let kind = if gap <= GAP {
        CertificateKind::Global
    } else {
        CertificateKind::of_searches(starts)
    };
    Ok(Certificate {
        kind,
        upper_bound_n: Some(upper_ln.exp()),
        gap: Some(gap),
        cells,
    })
}

fn best_ln_of(solved: &Solved<'_>) -> f64 {
    solved.force_n().map_or(f64::NEG_INFINITY, f64::ln)
}

/// One problem's bound on ln F, without the settling time first where that holds nothing back.
fn bound(
    solved: &Solved<'_>,
    domain: Domain,
    best_ln: f64,
    settings: &Settings,
    cells: &mut usize,
    progress: &dyn Progress,
) -> Result<(f64, Option<Window>), Interrupted> {
    let multipliers = solved
        .best
        .as_ref()
        .map_or_else(Multipliers::default, |local| {
            Multipliers::of(&solved.problem, local)
        });
    let limited = domain.settling_max_s.is_finite();
    let problem = &solved.problem;
    let held_by_a_loop = problem.closes_a_loop()
        && problem.limit_of(LimitName::Settling).is_some()
        && (multipliers.settling > 0.0 || solved.best.is_none());
    let rounds: &[bool] = match (limited, multipliers.settling > 0.0) {
        (false, _) => &[false],
        (true, false) => &[false, true],
        (true, true) => &[true],
    };
    let mut bound_ln = f64::INFINITY;
    for &with_settling in rounds {
        let Some(bounding) = Bounding::new(&solved.problem, domain, multipliers, with_settling)
        else {
            break;
        };
        // A relaxation that does not close is soon given up.
        // and the inductance costs as much as many cells.
        let budget = match (limited, with_settling) {
            // Of a current loop's time there is no bound: where it holds the coil back the relaxation need not close.
            (false, _) if held_by_a_loop => settings.cells / 128,
            (false, _) => settings.cells,
            (true, false) => settings.cells / 16,
            (true, true) => settings.cells / 32,
        };
        let cell = branch_and_bound::whole(&domain);
        let proof =
            branch_and_bound::prove(&bounding, &solved.problem, cell, best_ln, budget, progress)?;
        *cells += proof.cells;
        if proof.better.is_some() {
            return Ok((f64::INFINITY, proof.better));
        }
        bound_ln = bound_ln.min(proof.upper_ln);
        if bound_ln <= best_ln + GAP {
            break;
        }
    }
    Ok((bound_ln, None))
}

/// The winner in SI units, with what its limits cost.
pub(super) fn describe(solved: &Solved<'_>) -> Option<BestCoil> {
    let local = solved.best.as_ref()?;
    let problem = &solved.problem;
    let window = diagnosis::snapped(problem, local);
    let rated = problem.rate(window)?;
    // Also of limits that hold the coil back together, of which one alone would do.
    let is_active = |row: usize| {
        local.point.rows[row].abs() <= ACTIVE || problem.bounds[row].name.is_equality()
    };
    let active: Vec<usize> = (0..problem.bounds.len())
        .filter(|row| is_active(*row))
        .collect();
    let limits = problem
        .bounds
        .iter()
        .enumerate()
        .filter(|(_, bound)| bound.name != LimitName::Axis)
        .map(|(row, bound)| {
            let alone = local.point.least_multiplier(row, &active, problem);
            let multiplier = if bound.name.is_equality() {
                local.multipliers[row]
            } else {
                alone.unwrap_or(local.multipliers[row])
            };
            LimitUse::new(
                bound.name,
                rated.values[row].value,
                bound.limit,
                is_active(row),
                problem.sensitivity_n_per_unit(row, multiplier, &rated),
            )
        })
        .collect();
    Some(BestCoil {
        window,
        strand: problem.strand,
        turns: problem.strand.turns(&window),
        whole: None,
        regime: problem.regime,
        current_a: rated.current_a,
        force_n: rated.force_n.value,
        mass_kg: rated.mass_kg,
        limits,
    })
}

#[cfg(test)]
mod tests {
    use super::surrogate::{STANDS, best_x, restated, sharpened};
    use super::*;
    use crate::optimum::air::AirCoil;
    use crate::optimum::model::{NoResponse, Response};
    use crate::optimum::tests::{HEIGHT_M, air, quick, seed_limits, task};
    use fluxform_base::progress::Silent;
    use fluxform_design::Limits;

    #[test]
    fn next_to_no_bore_is_none_at_any_size() {
        for size_m in [1e-6, 0.007, 1e3] {
            let window = |bore: f64| Window {
                inner_radius_m: bore * size_m,
                depth_m: size_m,
                length_m: 3.0 * size_m,
            };
            for bore in [0.0, 9e-4] {
                let wider = bored(&window(bore)).expect("none as yet");
                assert!((wider.inner_radius_m / size_m - 0.05).abs() < 1e-15);
                assert!((wider.outer_radius_m() / size_m - 1.0).abs() < 1e-15);
            }
            for bore in [1.1e-3, 0.7] {
                assert_eq!(bored(&window(bore)), None);
            }
        }
    }

    /// The defect of an air coil's ln F, as a function of the length, is not known to the coarse
    /// model; to the sharp one as a straight line about one length; to the exact one throughout.
    enum Known {
        Nothing,
        About(f64),
        All,
    }

    struct Bent(AirCoil, Known);

    const BEND: f64 = 0.02;
    const MIDDLE_M: f64 = 0.02;

    impl CoilModel for Bent {
        fn response(
            &self,
            window: &Window,
            turns_per_m2: f64,
            current_a: f64,
            with_inductance: bool,
        ) -> Result<Response, NoResponse> {
            let mut response = self
                .0
                .response(window, turns_per_m2, current_a, with_inductance)?;
            let t = (window.length_m / MIDDLE_M).ln();
            let (ln, slope) = match self.1 {
                Known::Nothing => (0.0, 0.0),
                Known::About(p) => (-BEND * (2.0 * p * t - p * p), -2.0 * BEND * p),
                Known::All => (-BEND * t * t, -2.0 * BEND * t),
            };
            let mut force = response.force_n.times(ln.exp());
            force.slope[2] += force.value * slope / window.length_m;
            response.force_n = force;
            Ok(response)
        }

        fn relative_error(&self) -> f64 {
            self.0.relative_error()
        }

        fn length_scale_m(&self) -> f64 {
            self.0.length_scale_m()
        }

        fn sharpened(&self, window: &Window) -> Option<Box<dyn CoilModel>> {
            let about = Known::About((window.length_m / MIDDLE_M).ln());
            Some(Box::new(Self(self.0.clone(), about)))
        }
    }

    #[test]
    fn refinement_continues_until_the_optimum_is_stable() {
        let limits = Limits {
            settling_max_s: None,
            length_max_m: None,
            ..seed_limits()
        };
        let task = task(limits, None);
        let settings = Settings {
            starts: 4,
            ..quick()
        };
        let [coarse, exact] = [Known::Nothing, Known::All].map(|known| Bent(air(HEIGHT_M), known));
        let Ok(requested) = solve_all(&exact, &task, &settings, &Silent).expect("runs") else {
            panic!("bounded");
        };
        let Ok(found) = solve_all(&coarse, &task, &settings, &Silent).expect("runs") else {
            panic!("bounded");
        };
        let requested = best_x(&requested).expect("an optimum");
        let away = |x: [f64; 3]| (0..3).fold(0.0_f64, |s, i| s.max((x[i] - requested[i]).abs()));
        let before = away(best_x(&found).expect("an optimum"));
        assert!(before > 0.01, "{before:e}");
        let sharp = sharpened(&coarse, &task, &found, &Silent).expect("runs");
        let sharp = sharp.expect("can be sharpened");
        let at = best_x(&restated(&*sharp, &task, &found)).expect("an optimum");
        // A single sharpening ends 3e-5 away.
        assert!(away(at) < STANDS, "{:e}", away(at));
    }
}
