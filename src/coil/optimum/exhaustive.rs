//! The best cored coil that can be wound: every number of layers and turns a layer, one by one.
//!
//! Little is known for certain about coils with cores. The flux function of coaxial loops obeys a
//! maximum principle, so mutual inductances are positive, and the inductance of windings around
//! one core grows with every turn added and with every bit of steel; nothing alike is known of
//! the force, nor that it has one maximum over the bore. So each coil's bore is scanned and its
//! best refined, on the coarse model; what is within reach of the best is decided on the sharp
//! one. Lengths whose best continuous coil falls short are dropped whole. The certificate says
//! `exhaustive`: no pair was left out, but neither bores between the scan's samples nor a second
//! continuous optimum of such a length are bounded.

use rayon::prelude::*;

use super::domain::Domain;
use super::listing::{
    Leaf, SHARE, WoundCoil, WoundOutcome, around_optimum, describe, rounded_status, worth_a_look,
};
use super::model::{CoilModel, Window};
use super::outcome::{Certificate, CertificateKind, Status};
use super::problem::{Fixed, LimitName, Problem, Regime, Task};
use super::scalar;
use super::search::{self, DRAFT_DOUBT, Settings, Solved};
use super::sequential::{self, FEASIBLE};
use super::sharpen;
use fluxform_base::progress::{Interrupted, Progress};

/// Bores at which each coil is tried.
const SCAN: usize = 9;
/// Bores narrower than this share of the winding's depth are not looked at, unless the
/// continuous optimum is as narrow: next to no steel.
const NARROW: f64 = 0.05;
/// Slack, in turns, of a dimension that must be a whole number of them.
const WHOLE: f64 = 1e-9;
/// Coils whose coarse forces differ by less than this multiple of the coarse error are compared
/// on the sharp model.
const DOUBT: f64 = 5.0;
/// How far, relatively, the sharp model's best bore may be from the coarse one's.
const NEAR: f64 = 0.02;
/// Most pairs of layers and turns that are examined.
const PAIRS: u64 = 400_000;

/// Maximises |force| over the coils that can be wound within `task`, on any model.
///
/// # Errors
/// Interruption.
pub(super) fn optimise(
    model: &dyn CoilModel,
    task: &Task,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<WoundOutcome, Interrupted> {
    let coarse = match search::solve_all(model, task, settings, progress)? {
        Ok(problems) => problems,
        Err((status, problems)) => return Ok(WoundOutcome::none(status, &problems)),
    };
    let sharp_model = sharpen::sharpened(model, task, &coarse, progress)?;
    let restated = sharp_model
        .as_deref()
        .map(|sharp| sharpen::restated(sharp, task, &coarse));
    let sharp = restated.as_ref().unwrap_or(&coarse);
    // What the search did not know, of neighbours say, is screened for too.
    let blunt_model = sharp_model.as_deref().and_then(CoilModel::blunted);
    let screened = blunt_model
        .as_deref()
        .map(|blunt| sharpen::restated(blunt, task, sharp));
    let screen = screened.as_ref().unwrap_or(&coarse);
    let draft_model = blunt_model.as_deref().unwrap_or(model).draft();
    let open: Vec<usize> = (0..screen.len())
        .filter(|&index| screen[index].contradiction.is_none())
        .collect();
    let doubt = DOUBT * model.relative_error();
    let mut examined = 0;
    let mut complete = true;
    let mut list = Vec::new();
    let mut lost = 0.0;
    for more in MORE_LOST {
        progress.begin("wind", open.len() as u64);
        let screening = Screening {
            screen,
            open: &open,
            draft: draft_model.as_deref(),
            doubt: doubt + lost,
        };
        let portion = screening.leaves(progress)?;
        progress.end();
        examined = portion.examined;
        complete = portion.complete;
        list = decided(&portion.found, sharp, doubt, progress)?;
        let best_ln = list.first().map(|coil: &WoundCoil| coil.force_n.ln());
        // Where the best is weaker than the coarse model promised, what the promise hid.
        match best_ln.map(|best_ln| portion.best_ln - best_ln) {
            Some(short) if short <= lost + doubt => break,
            Some(short) => lost = short,
            None => lost = more,
        }
    }
    let Some(best) = list.first().cloned() else {
        let open: Vec<&Solved<'_>> = open.iter().map(|&index| &screen[index]).collect();
        return Ok(WoundOutcome::none(rounded_status(&open), sharp));
    };
    let enough_n = best.force_n * (1.0 - SHARE);
    let within: Vec<WoundCoil> = list.into_iter().filter(|c| c.force_n >= enough_n).collect();
    Ok(WoundOutcome {
        status: Status::Optimal,
        alternatives: worth_a_look(&best, &within),
        best: Some(best),
        certificate: Certificate {
            kind: if complete {
                CertificateKind::Exhaustive
            } else {
                CertificateKind::of_searches(search::starts_of(sharp))
            },
            upper_bound_n: None,
            gap: None,
            cells: examined,
        },
        ..WoundOutcome::none(Status::Optimal, sharp)
    })
}

/// How much weaker than the best of the coarse model's coils, in ln F, are looked at in turn
/// where none of the stronger ones keeps the limits on the sharp model.
const MORE_LOST: [f64; 4] = [0.05, 0.4, f64::INFINITY, f64::INFINITY];

/// What goes through all layers and turns on the coarse model.
struct Screening<'a> {
    screen: &'a [Solved<'a>],
    /// The problems that have coils.
    open: &'a [usize],
    draft: Option<&'a dyn CoilModel>,
    /// How far below the best, in ln F and beyond [`SHARE`], a coil is still looked at.
    doubt: f64,
}

/// What it found.
struct Portion {
    /// Problems and their coils, the strongest first.
    found: Vec<(usize, Leaf)>,
    best_ln: f64,
    examined: usize,
    complete: bool,
}

impl Screening<'_> {
    fn leaves(&self, progress: &dyn Progress) -> Result<Portion, Interrupted> {
        let mut portion = Portion {
            found: Vec::new(),
            best_ln: f64::NEG_INFINITY,
            examined: 0,
            complete: true,
        };
        let within = |best_ln: f64| best_ln + (-SHARE).ln_1p() - self.doubt;
        for &index in self.open {
            let solved = &self.screen[index];
            let mut finite = Domain::of(&solved.problem);
            if !(finite.outer_m[1].is_finite() && finite.length_m[1].is_finite()) {
                portion.complete = false;
                match around_optimum(solved) {
                    Some(around) => finite = around,
                    None => continue,
                }
            }
            let pairs = Pairs::of(solved, finite).with_draft(self.draft);
            if pairs.count() > PAIRS {
                portion.complete = false;
            }
            let enough_ln = within(portion.best_ln);
            let (leaves, examined) = pairs.leaves(enough_ln, self.doubt, solved, progress)?;
            portion.examined += examined;
            for leaf in leaves {
                portion.best_ln = portion.best_ln.max(leaf.ln_force);
                portion.found.push((index, leaf));
            }
            progress.advance(1);
        }
        let enough_ln = within(portion.best_ln);
        portion.found.retain(|(_, leaf)| leaf.ln_force >= enough_ln);
        portion
            .found
            .sort_by(|a, b| b.1.ln_force.total_cmp(&a.1.ln_force));
        Ok(portion)
    }
}

/// Most coils that are decided on the sharp model.
const DECIDED: usize = 2000;

/// Coils that are decided at a time; fixed, so that results do not depend on the threads.
const AT_A_TIME: usize = 16;

/// The strongest of coarse leaves, sorted by force, with their best bores on the sharp model;
/// strongest first. Ends where what is left cannot come within [`SHARE`] of the best.
fn decided(
    found: &[(usize, Leaf)],
    sharp: &[Solved<'_>],
    doubt: f64,
    progress: &dyn Progress,
) -> Result<Vec<WoundCoil>, Interrupted> {
    let chosen = &found[..found.len().min(DECIDED)];
    let mut list: Vec<WoundCoil> = Vec::new();
    let mut best_ln = f64::NEG_INFINITY;
    for some in chosen.chunks(AT_A_TIME) {
        if some[0].1.ln_force < best_ln + (-SHARE).ln_1p() - doubt {
            break;
        }
        let coils: Vec<Result<Option<WoundCoil>, Interrupted>> = some
            .par_iter()
            .map(|(index, leaf)| {
                progress.check()?;
                Ok(decide(&sharp[*index], leaf))
            })
            .collect();
        for coil in coils {
            list.extend(coil?);
        }
        best_ln = list
            .iter()
            .fold(best_ln, |most, coil| most.max(coil.force_n.ln()));
    }
    list.sort_by(|a: &WoundCoil, b| b.force_n.total_cmp(&a.force_n));
    Ok(list)
}

/// A coarse leaf with its best bore on the sharp model.
fn decide(solved: &Solved<'_>, leaf: &Leaf) -> Option<WoundCoil> {
    let problem = &solved.problem;
    let pairs = Pairs::of(solved, Domain::of(problem));
    let [lo, hi] = pairs.bores(leaf.layers, leaf.turns).unwrap_or([0.0, 0.0]);
    let outer_m = leaf.window.outer_radius_m();
    let at = leaf.window.inner_radius_m;
    let near = [lo.max(at - NEAR * outer_m), hi.min(at + NEAR * outer_m)];
    let sharp = pairs.best_bore(leaf.layers, leaf.turns, near, f64::NEG_INFINITY)?;
    describe(problem, &sharp)
}

/// The coils of one wire and regime by layers and turns a layer.
struct Pairs<'a> {
    problem: &'a Problem<'a>,
    /// The problem without limits that cost an inductance.
    screen: Option<Problem<'a>>,
    /// The same on a rough model that costs next to nothing, where there is one.
    draft: Option<Problem<'a>>,
    domain: Domain,
    /// Least bore's radius that is looked at over the depth.
    narrow: f64,
}

impl<'a> Pairs<'a> {
    fn of(solved: &'a Solved<'a>, domain: Domain) -> Self {
        let problem = &solved.problem;
        let narrow = solved.best.as_ref().map_or(NARROW, |local| {
            let window = Problem::window(local.x);
            NARROW.min(0.5 * window.inner_radius_m / window.depth_m)
        });
        Self {
            narrow,
            problem,
            screen: problem.without_settling(),
            draft: None,
            domain,
        }
    }

    /// Looks for what is worth more on `model` first.
    fn with_draft(self, model: Option<&'a dyn CoilModel>) -> Self {
        let problem = self.screen.as_ref().unwrap_or(self.problem);
        let draft = model.map(|model| problem.with_model(model));
        Self { draft, ..self }
    }

    /// Whether the draft is sure that no bore reaches `enough_ln` at `window`.
    fn is_hopeless(&self, window: Window, enough_ln: f64) -> bool {
        let rated = |draft: &Problem<'_>| draft.rate(window);
        let ln = |draft| rated(draft).map(|rated| rated.force_n.value.ln());
        let draft_ln = self.draft.as_ref().and_then(ln);
        draft_ln.is_some_and(|ln| ln < enough_ln - DRAFT_DOUBT)
    }

    fn most_layers(&self) -> u64 {
        let wire_m = self.problem.strand.diameter_m;
        let room_m = self.domain.outer_m[1] - self.domain.inner_m[0];
        whole(room_m / wire_m)
    }

    fn turns(&self) -> [u64; 2] {
        let wire_m = self.problem.strand.diameter_m;
        let [lo, hi] = self.domain.length_m;
        [
            (lo / wire_m - WHOLE).ceil().max(1.0) as u64,
            whole(hi / wire_m),
        ]
    }

    fn count(&self) -> u64 {
        let [lo, hi] = self.turns();
        self.most_layers()
            .saturating_mul((hi + 1).saturating_sub(lo))
    }

    fn window(&self, layers: u64, turns: u64, inner_radius_m: f64) -> Window {
        let wire_m = self.problem.strand.diameter_m;
        Window {
            inner_radius_m,
            depth_m: layers as f64 * wire_m,
            length_m: turns as f64 * wire_m,
        }
    }

    /// Inner radii that limits on sizes and wire allow a coil, m.
    fn bores(&self, layers: u64, turns: u64) -> Option<[f64; 2]> {
        let Window {
            depth_m, length_m, ..
        } = self.window(layers, turns, 0.0);
        let domain = &self.domain;
        // (2 a + w) w L is the amount of wire.
        let inner = |volume_m3: f64| 0.5 * (volume_m3 / (depth_m * length_m) - depth_m);
        let lo = domain.inner_m[0]
            .max(domain.outer_m[0] - depth_m)
            .max(inner(domain.volume_m3[0]))
            .max(self.narrow * depth_m);
        let hi = (domain.outer_m[1] - depth_m)
            .min(inner(domain.volume_m3[1]))
            .min(domain.inner_m[1]);
        let slack = 1e-12 * (hi.abs() + depth_m);
        (hi.is_finite() && lo <= hi + slack).then_some([lo.min(hi), hi])
    }

    /// Every coil's best bore, where its force's logarithm is at least `enough_ln` or within
    /// [`SHARE`] and `doubt` of the best of its portion; and how many pairs were looked at.
    fn leaves(
        &self,
        enough_ln: f64,
        doubt: f64,
        solved: &Solved<'_>,
        progress: &dyn Progress,
    ) -> Result<(Vec<Leaf>, usize), Interrupted> {
        let [mut first, mut last] = self.turns();
        let mut layers = [1, self.most_layers()];
        if self.count() > PAIRS
            && let Some(local) = &solved.best
        {
            // Too many: those about the continuous optimum.
            let window = Problem::window(local.x);
            let wire_m = self.problem.strand.diameter_m;
            let side = (PAIRS as f64).sqrt();
            let about = |size_m: f64| {
                let middle = size_m / wire_m;
                [middle - 0.5 * side, middle + 0.5 * side].map(|v| v.max(1.0) as u64)
            };
            let ([n0, n1], [m0, m1]) = (about(window.depth_m), about(window.length_m));
            layers = [layers[0].max(n0), layers[1].min(n1)];
            [first, last] = [first.max(m0), last.min(m1)];
        }
        // A coil next to the continuous optimum shows what is enough.
        let mut enough_ln = enough_ln;
        if let Some(local) = &solved.best {
            let window = Problem::window(local.x);
            let wire_m = self.problem.strand.diameter_m;
            let (n, m) = (
                whole(window.depth_m / wire_m),
                whole(window.length_m / wire_m),
            );
            let (n, m) = (
                n.clamp(layers[0], layers[1].max(layers[0])),
                m.clamp(first, last.max(first)),
            );
            if let Some(bores) = self.bores(n, m)
                && let Some(leaf) = self.best_bore(n, m, bores, f64::NEG_INFINITY)
            {
                enough_ln = enough_ln.max(leaf.ln_force + (-SHARE).ln_1p() - doubt);
            }
        }
        let rows: Vec<Result<Vec<Leaf>, Interrupted>> = (first..=last)
            .into_par_iter()
            .map(|turns| {
                progress.check()?;
                if !self.row_reaches(turns, solved, enough_ln) {
                    return Ok(Vec::new());
                }
                let leaf = |n| {
                    let bores = self.bores(n, turns)?;
                    self.best_bore(n, turns, bores, enough_ln)
                };
                Ok((layers[0]..=layers[1]).filter_map(leaf).collect())
            })
            .collect();
        let mut leaves = Vec::new();
        for row in rows {
            leaves.extend(row?);
        }
        let rows = (last + 1).saturating_sub(first);
        let columns = (layers[1] + 1).saturating_sub(layers[0]);
        Ok((leaves, (rows * columns) as usize))
    }

    /// Whether the best coil of a length, layers not whole, comes up to `enough_ln`: a local
    /// search from the continuous optimum. True where it finds nothing.
    fn row_reaches(&self, turns: u64, solved: &Solved<'_>, enough_ln: f64) -> bool {
        let (Some(local), None) = (&solved.best, self.problem.task.fixed.length_m) else {
            return true;
        };
        let length_m = turns as f64 * self.problem.strand.diameter_m;
        let task = Task {
            fixed: Fixed {
                length_m: Some(length_m),
                ..self.problem.task.fixed
            },
            ..self.problem.task.clone()
        };
        let reaches = |problem: &Problem<'_>, enough_ln: f64| {
            let row = problem.with_task(&task);
            // Without the settling time the force can only be higher.
            let row = row.without_settling().unwrap_or(row);
            let best = [1.0, 0.5].into_iter().filter_map(|thinner| {
                let window = Problem::window(local.x);
                let start = Problem::coordinates(&Window {
                    length_m,
                    depth_m: window.depth_m * thinner,
                    ..window
                });
                let local = sequential::solve(&row, start)?;
                (local.violation(&row) <= FEASIBLE).then_some(-local.point.objective)
            });
            best.reduce(f64::max).is_none_or(|best| best >= enough_ln)
        };
        let draft = self.draft.as_ref();
        draft.is_none_or(|draft| reaches(draft, enough_ln - DRAFT_DOUBT))
            && reaches(self.problem, enough_ln)
    }

    /// ln F at a bore, limits that need an inductance apart; -infinity where the model fails.
    fn ln_force(&self, window: Window) -> f64 {
        let problem = self.screen.as_ref().unwrap_or(self.problem);
        let rated = problem.rate(window);
        rated.map_or(f64::NEG_INFINITY, |rated| rated.force_n.value.ln())
    }

    /// The worst of all limits at a bore.
    fn over(&self, window: Window) -> f64 {
        self.worst(window, |_| true)
    }

    /// The worst of the limits that are `asked` for.
    fn worst(&self, window: Window, asked: impl Fn(LimitName) -> bool) -> f64 {
        let Some(rated) = self.problem.rate(window) else {
            return f64::INFINITY;
        };
        let point = self.problem.scaled(&rated);
        let rows = point.rows.iter().zip(&self.problem.bounds);
        rows.filter(|(_, bound)| asked(bound.name))
            .map(|(&row, bound)| {
                if bound.name.is_equality() {
                    row.abs()
                } else {
                    row
                }
            })
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// The best bore of one coil; `None` where no bore meets the limits or its force does not
    /// reach `enough_ln`.
    fn best_bore(&self, layers: u64, turns: u64, bores: [f64; 2], enough_ln: f64) -> Option<Leaf> {
        let window = |a: f64| self.window(layers, turns, a);
        let ln_force = |a: f64| self.ln_force(window(a));
        let [lo, hi] = bores;
        let (mut at, mut value) = match &self.draft {
            Some(draft) => {
                let rough = |a: f64| {
                    let rated = draft.rate(window(a));
                    rated.map_or(f64::NEG_INFINITY, |rated| rated.force_n.value.ln())
                };
                let (index, rough_ln) = highest(rough, lo, hi);
                if rough_ln < enough_ln - DRAFT_DOUBT {
                    return None;
                }
                climb(ln_force, lo, hi, index)
            }
            None => climb(ln_force, lo, hi, highest(ln_force, lo, hi).0),
        };
        if value < enough_ln {
            return None;
        }
        // The last rounding is taken off the bore.
        let depth_m = window(0.0).depth_m;
        let mut over = self.over(window(at));
        if over > 0.0 && over <= FEASIBLE && self.problem.regime == Regime::Driver {
            at = (at - 4.0 * over * (at + depth_m)).max(lo);
            over = self.over(window(at));
            value = ln_force(at);
        }
        if over > FEASIBLE {
            (at, value) = self.within(window, [lo, at, hi], enough_ln)?;
        }
        (value.is_finite() && value >= enough_ln).then(|| Leaf {
            layers,
            turns,
            window: window(at),
            ln_force: value,
        })
    }

    /// The best bore that meets every limit, beside a best one, the middle of `bores`, that does
    /// not.
    fn within(
        &self,
        window: impl Fn(f64) -> Window,
        bores: [f64; 3],
        enough_ln: f64,
    ) -> Option<(f64, f64)> {
        let [lo, at, hi] = bores;
        // The others are kept between `lo` and `hi`, and touched there or, with one layer or turn,
        // throughout: a root of theirs is not looked for.
        let of_the_model = |name| {
            let names = [LimitName::Settling, LimitName::CoreField, LimitName::Mass];
            names.contains(&name)
        };
        let over = |a: f64| self.worst(window(a), of_the_model);
        let ln_force = |a: f64| self.ln_force(window(a));
        let mut best: Option<(f64, f64)> = None;
        for end in [lo, hi] {
            // From the best bore outwards, to the first that meets the limits.
            let mut outside = at;
            for step in 1..=4 {
                let bore = at + (end - at) * f64::from(step * step) / 16.0;
                if bore == outside || self.is_hopeless(window(bore), enough_ln) {
                    break;
                }
                if over(bore) <= 0.0 {
                    let tolerance = 1e-13 * (at + window(at).depth_m);
                    let (low, high) = (bore.min(outside), bore.max(outside));
                    let root = scalar::root(over, low, high, tolerance).unwrap_or(bore);
                    // On the side that meets them.
                    let inwards = (bore - root) * 1e-10;
                    let edge = if over(root) <= 0.0 {
                        root
                    } else {
                        root + inwards
                    };
                    let met = self.over(window(edge)) <= FEASIBLE;
                    let edge = if met { edge } else { bore };
                    let value = ln_force(edge);
                    if best.is_none_or(|(_, old)| value > old) {
                        best = Some((edge, value));
                    }
                    break;
                }
                if ln_force(bore) < enough_ln {
                    break;
                }
                outside = bore;
            }
        }
        best
    }
}

fn whole(ratio: f64) -> u64 {
    (ratio + WHOLE).floor().clamp(1.0, 1e15) as u64
}

/// Sample `index` of [`SCAN`] between `lo` and `hi`.
fn sample(lo: f64, hi: f64, index: usize) -> f64 {
    match index {
        0 => lo,
        k if k == SCAN - 1 => hi,
        k => lo + (hi - lo) * k as f64 / (SCAN - 1) as f64,
    }
}

/// The sample at which `f` is largest, and its value there.
fn highest(f: impl Fn(f64) -> f64, lo: f64, hi: f64) -> (usize, f64) {
    let first = if is_one_bore(lo, hi) { SCAN - 1 } else { 0 };
    (first..SCAN)
        .map(|k| (k, f(sample(lo, hi, k))))
        .reduce(|best, next| if next.1 > best.1 { next } else { best })
        .unwrap_or((0, f64::NEG_INFINITY))
}

fn is_one_bore(lo: f64, hi: f64) -> bool {
    hi - lo <= f64::EPSILON * hi
}

/// The maximum of `f` next to a sample: between its neighbours, and farther on where it lies at
/// one of them.
fn climb(f: impl Fn(f64) -> f64, lo: f64, hi: f64, index: usize) -> (f64, f64) {
    if is_one_bore(lo, hi) {
        return (hi, f(hi));
    }
    let mut index = index;
    let mut best = (sample(lo, hi, index), f(sample(lo, hi, index)));
    for _ in 0..SCAN {
        let sides = [index.saturating_sub(1), (index + 1).min(SCAN - 1)];
        let [low, high] = sides.map(|k| sample(lo, hi, k));
        let refined = scalar::maximum(&f, low, high);
        if refined.1 > best.1 {
            best = refined;
        }
        let next = sides
            .into_iter()
            .find(|&k| k != 0 && k != SCAN - 1 && k != index && sample(lo, hi, k) == best.0);
        match next {
            Some(k) => index = k,
            None => break,
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimum::air::AirCoil;
    use crate::optimum::model::{NoResponse, Response};
    use crate::optimum::tests::{HEIGHT_M, air, quick, task};
    use crate::optimum::wound::optimise_wound;
    use fluxform_base::progress::Silent;
    use fluxform_design::Limits;

    /// An air coil that hides that it is one, so that nothing bounds its force.
    struct Opaque(AirCoil);

    impl CoilModel for Opaque {
        fn response(
            &self,
            window: &Window,
            turns_per_m2: f64,
            current_a: f64,
            with_inductance: bool,
        ) -> Result<Response, NoResponse> {
            self.0
                .response(window, turns_per_m2, current_a, with_inductance)
        }

        fn relative_error(&self) -> f64 {
            self.0.relative_error()
        }

        fn length_scale_m(&self) -> f64 {
            self.0.length_scale_m()
        }
    }

    fn small(settling_max_s: f64) -> Limits {
        Limits {
            resistance_max_ohm: Some(0.2),
            settling_max_s: Some(settling_max_s),
            outer_diameter_max_m: Some(0.02),
            length_max_m: Some(0.006),
            ..Limits::default()
        }
    }

    #[test]
    fn every_pair_tried_is_as_good_as_a_proof() {
        for settling_max_s in [0.001, 0.0006] {
            let task = task(small(settling_max_s), None);
            let run = |model: &dyn CoilModel| {
                optimise_wound(model, &task, &quick(), &Silent).expect("runs")
            };
            let (tried, proven) = (run(&Opaque(air(HEIGHT_M))), run(&air(HEIGHT_M)));
            assert_eq!(tried.certificate.kind, CertificateKind::Exhaustive);
            assert_eq!(tried.certificate.cells, 14 * 8);
            assert_eq!(proven.certificate.kind, CertificateKind::Global);
            let (a, b) = (tried.best.expect("a coil"), proven.best.expect("a coil"));
            assert_eq!((a.layers, a.turns_per_layer), (b.layers, b.turns_per_layer));
            assert!((a.force_n / b.force_n - 1.0).abs() < 1e-9, "{a:?} {b:?}");
        }
    }

    #[test]
    fn the_best_bore_is_what_a_fine_scan_finds() {
        let model = Opaque(air(HEIGHT_M));
        let mut limited = 0;
        for settling_max_s in [0.1, 0.0006] {
            let limits = Limits {
                inner_diameter_min_m: Some(0.002),
                ..small(settling_max_s)
            };
            let task = task(limits, None);
            let problem = Problem::of_wire(&model, &task, task.strands[0]).remove(0);
            let solved = Solved {
                problem,
                best: None,
                contradiction: None,
                missing: Vec::new(),
                evaluations: 0,
                starts: 0,
            };
            let problem = &solved.problem;
            let pairs = Pairs::of(&solved, Domain::of(problem));
            for (layers, turns) in [(1, 2), (1, 7), (3, 1), (4, 6), (8, 3), (12, 1), (13, 8)] {
                let window = |a: f64| pairs.window(layers, turns, a);
                let met = |a: f64| pairs.over(window(a)) <= 0.0;
                let depth_m = window(0.0).depth_m;
                let bore = |k: u32| 0.001 + (0.009 - depth_m) * f64::from(k) / 60.0;
                // Limits on sizes and wire alone say where a bore may be.
                let screen = problem.without_settling().expect("a settling time");
                let fits = |k: &u32| {
                    let rated = screen.rate(window(bore(*k))).expect("in the domain");
                    let point = screen.scaled(&rated);
                    bore(*k) >= NARROW * depth_m && point.rows.iter().all(|&row| row <= 0.0)
                };
                let fitting: Vec<f64> = (0..=60).filter(fits).map(bore).collect();
                let Some([lo, hi]) = pairs.bores(layers, turns) else {
                    assert!(fitting.is_empty(), "{layers} {turns}");
                    continue;
                };
                for a in &fitting {
                    assert!(
                        (lo..=hi * (1.0 + 1e-12)).contains(a),
                        "{layers} {turns}: {a}"
                    );
                }
                let strongest = fitting.iter().filter(|a| met(**a));
                let strongest = strongest.map(|a| pairs.ln_force(window(*a)));
                let strongest = strongest.fold(f64::NEG_INFINITY, f64::max);
                let leaf = pairs.best_bore(layers, turns, [lo, hi], f64::NEG_INFINITY);
                let value = leaf.map_or(f64::NEG_INFINITY, |leaf| leaf.ln_force);
                assert!(
                    value >= strongest - 1e-9,
                    "{layers} {turns}: {value} {strongest}"
                );
                let Some(leaf) = leaf else { continue };
                let a = leaf.window.inner_radius_m;
                assert!(pairs.over(leaf.window) <= FEASIBLE);
                assert!((lo..=hi).contains(&a) && leaf.window == window(a));
                let limit = scalar::maximum(|a| pairs.ln_force(window(a)), lo, hi);
                if value < limit.1 - 1e-6 {
                    // Held back by the settling time: beside it one that is as slow as may be.
                    limited += 1;
                    let over = pairs.over(leaf.window);
                    assert!(over.abs() < 1e-7, "{layers} {turns}: {over:e}");
                }
            }
        }
        assert!(limited >= 2, "{limited}");
    }

    fn summit(f: impl Fn(f64) -> f64, lo: f64, hi: f64) -> (f64, f64) {
        climb(&f, lo, hi, highest(&f, lo, hi).0)
    }

    /// A rough scan may point to a sample beside the right one.
    #[test]
    fn a_climb_goes_on_where_the_summit_lies_farther() {
        for index in 0..SCAN {
            let (x, _) = climb(|x| -(x - 0.71) * (x - 0.71), 0.3, 1.3, index);
            assert!((x - 0.71).abs() < 1e-7, "{index}: {x}");
        }
    }

    #[test]
    fn a_summit_is_found_between_the_scan_s_places_and_at_the_ends() {
        for peak in [0.3, 0.37, 0.71, 1.04, 1.29] {
            let (x, value) = summit(|x| -(x - peak) * (x - peak), 0.3, 1.3);
            assert!((x - peak).abs() < 1e-7 && value > -1e-14, "{x} {peak}");
        }
        let (x, _) = summit(|x| x, 0.3, 1.3);
        assert_eq!(x, 1.3);
        // Two maxima: the higher one's.
        let bell = |x: f64, peak: f64| (-30.0 * (x - peak) * (x - peak)).exp();
        let (x, _) = summit(|x| bell(x, 0.4) + 2.0 * bell(x, 1.1), 0.3, 1.3);
        assert!((x - 1.1).abs() < 1e-6, "{x}");
    }

    #[test]
    fn a_turn_within_rounding_is_a_turn() {
        for turns in [1.0_f64, 3.0, 70.0] {
            let slack = [turns * (1.0 - f64::EPSILON), turns, turns + 0.7];
            assert!(slack.iter().all(|&t| whole(t) == turns as u64));
        }
        assert_eq!((whole(0.3), whole(2.9)), (1, 2));
    }
}
