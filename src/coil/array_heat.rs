//! The most heat of an array within the limits of its drivers and its supply.

use fluxform_design::Supply;

/// The currents that the drivers and the supply of an array allow.
#[derive(Debug, Clone, PartialEq)]
pub struct Drivers {
    /// Least and largest current of each coil, A: least <= 0 <= largest.
    pub ends_a: Vec<[f64; 2]>,
    /// Limit of the sum of all currents, signs counted, A; >= 0.
    pub total_max_a: Option<f64>,
}

/// A number and its derivative by the resistance.
type Dual = [f64; 2];

fn sum(a: Dual, b: Dual) -> Dual {
    [a[0] + b[0], a[1] + b[1]]
}

fn difference(a: Dual, b: Dual) -> Dual {
    [a[0] - b[0], a[1] - b[1]]
}

fn product(a: Dual, b: Dual) -> Dual {
    [a[0] * b[0], a[1] * b[0] + a[0] * b[1]]
}

impl Drivers {
    /// Those of a design.
    #[must_use]
    pub fn of(supply: &Supply) -> Self {
        let ends = supply.current_min_a.iter().zip(&supply.current_max_a);
        Self {
            ends_a: ends.map(|(&least, &most)| [least, most]).collect(),
            total_max_a: supply.total_current_max_a,
        }
    }

    /// The most heat of all coils, W, of `resistance_ohm` each, and its derivative by that: the maximum of
    /// sum R I_i^2 over l_i <= I_i <= u_i, sum I_i <= I_t, where |l_i|, u_i <= V/R at a supply of `voltage_v`.
    ///
    /// Heat is convex, so all currents but one are at an end. A coil that is no hotter at u_i than at l_i stays at
    /// l_i, which leaves the others most of the sum. Which of the others go to u_i, and which one in between, is a
    /// knapsack problem, solved by branch and bound over kinds of coils with the same ends; beyond a number of nodes of
    /// its tree its linear relaxation is returned: an upper bound, by less than the heat of one coil at u_i.
    #[must_use]
    pub fn most_heat_w(&self, voltage_v: Option<f64>, resistance_ohm: f64) -> [f64; 2] {
        let resistance = [resistance_ohm, 1.0];
        let supplied_a = voltage_v.map_or(f64::INFINITY, |v| v / resistance_ohm);
        let supplied = |end_a: f64| {
            if end_a.abs() <= supplied_a {
                return [end_a, 0.0];
            }
            let end_a = supplied_a.copysign(end_a);
            [end_a, -end_a / resistance_ohm]
        };
        let heat = |current: Dual| product(product(resistance, current), current);
        let mut left = [self.total_max_a.unwrap_or(f64::INFINITY), 0.0];
        let mut most = [0.0; 2];
        let mut hotter: Vec<[Dual; 2]> = Vec::new();
        for ends_a in &self.ends_a {
            let [low, high] = ends_a.map(supplied);
            left = difference(left, low);
            most = sum(most, heat(low));
            if high[0] > -low[0] {
                hotter.push([low, high]);
            }
        }
        let search = Search::new(hotter, left[0]);
        for (kind, coils) in search.kinds.iter().zip(&search.best.raised) {
            let coils = [*coils as f64, 0.0];
            left = difference(left, product(coils, difference(kind.high, kind.low)));
            most = sum(
                most,
                product(coils, difference(heat(kind.high), heat(kind.low))),
            );
        }
        if let Some(kind) = search.best.between.map(|kind| &search.kinds[kind]) {
            let range = difference(kind.high, kind.low);
            let current = sum(kind.low, if range[0] <= left[0] { range } else { left });
            most = sum(most, difference(heat(current), heat(kind.low)));
        }
        if let Some(missed_a2) = search.missed_a2 {
            most[0] += resistance_ohm * missed_a2;
        }
        most
    }

    /// The least resistance of each coil, ohm, from `from_ohm` on, at which the most heat of all coils is not above
    /// `heat_w` at a supply of `voltage_v`: a lower bound of it, near enough where the heat falls with the resistance.
    ///
    /// More resistance leaves less current, so from R_1 to R_2 the heat is at least R_1 times the squares at R_2: as
    /// long as that is above `heat_w` no resistance between them is enough.
    #[must_use]
    pub fn least_resistance_ohm(&self, voltage_v: f64, heat_w: f64, from_ohm: f64) -> f64 {
        let mut least_ohm = from_ohm;
        let mut step = 1.0;
        for _ in 0..MOST_STEPS {
            if step <= ROUNDING {
                break;
            }
            let next_ohm = least_ohm * (1.0 + step);
            let [next_w, _] = self.most_heat_w(Some(voltage_v), next_ohm);
            if next_w / next_ohm * least_ohm > heat_w {
                least_ohm = next_ohm;
                step *= 2.0;
            } else {
                step *= 0.5;
            }
        }
        least_ohm
    }
}

/// Steps towards a least resistance at most.
const MOST_STEPS: usize = 500;
/// Nodes of the search's tree at most.
const MOST_NODES: usize = 200_000;
/// A bound above what is known by no more than this share promises nothing.
const ROUNDING: f64 = 1e-13;

/// Coils with the same ends, hotter at the upper one.
struct Kind {
    low: Dual,
    high: Dual,
    coils: usize,
}

impl Kind {
    fn range_a(&self) -> f64 {
        self.high[0] - self.low[0]
    }

    /// What a current raised from the lower end adds to its square, A^2.
    fn gain_a2(&self, raised_a: f64) -> f64 {
        raised_a * (2.0 * self.low[0] + raised_a)
    }
}

/// How many coils of each kind are at their upper end, and of which kind one is in between.
#[derive(Clone)]
struct Choice {
    raised: Vec<usize>,
    between: Option<usize>,
    gain_a2: f64,
}

struct Search {
    /// The hottest for each ampere of the sum first.
    kinds: Vec<Kind>,
    best: Choice,
    nodes: usize,
    /// What the relaxation has more than the best, A^2, where the search was given up.
    missed_a2: Option<f64>,
}

impl Search {
    fn new(mut hotter: Vec<[Dual; 2]>, left_a: f64) -> Self {
        let order = |[low, high]: &[Dual; 2]| (low[0] + high[0], low[0]);
        hotter.sort_by(|a, b| {
            let (a, b) = (order(a), order(b));
            b.0.total_cmp(&a.0).then(b.1.total_cmp(&a.1))
        });
        let alike = hotter.chunk_by(|a, b| a == b);
        let kinds: Vec<Kind> = alike
            .map(|coils| Kind {
                low: coils[0][0],
                high: coils[0][1],
                coils: coils.len(),
            })
            .collect();
        let none = Choice {
            raised: vec![0; kinds.len()],
            between: None,
            gain_a2: 0.0,
        };
        let mut search = Self {
            best: none.clone(),
            kinds,
            nodes: 0,
            missed_a2: None,
        };
        for between in std::iter::once(None).chain((0..search.kinds.len()).map(Some)) {
            let mut choice = Choice {
                between,
                ..none.clone()
            };
            search.go_on(0, left_a, &mut choice);
        }
        if search.nodes > MOST_NODES {
            let relaxed_a2 = search.bound_a2(0, left_a, &none);
            search.missed_a2 = Some((relaxed_a2 - search.best.gain_a2).max(0.0));
        }
        search
    }

    /// Coils of a kind that may be at their upper end.
    fn free(&self, kind: usize, choice: &Choice) -> usize {
        self.kinds[kind].coils - usize::from(choice.between == Some(kind))
    }

    /// No choice that goes on from `kind` gains more, A^2: the relaxation, in which any part of a coil may be raised at
    /// the coil's own rate.
    fn bound_a2(&self, kind: usize, mut left_a: f64, choice: &Choice) -> f64 {
        let mut bound_a2 = choice.gain_a2;
        let mut fill = |kind: &Kind, coils: usize| {
            let raised_a = (coils as f64 * kind.range_a()).min(left_a);
            bound_a2 += raised_a * (kind.low[0] + kind.high[0]);
            left_a -= raised_a;
        };
        if let Some(between) = choice.between.filter(|between| *between < kind) {
            fill(&self.kinds[between], 1);
        }
        for kind in &self.kinds[kind..] {
            fill(kind, kind.coils);
        }
        bound_a2
    }

    /// Tries all numbers of coils of `kind` and the following ones at their upper ends.
    fn go_on(&mut self, kind: usize, left_a: f64, choice: &mut Choice) {
        self.nodes += 1;
        let known_a2 = self.best.gain_a2 * (1.0 + ROUNDING);
        if self.nodes > MOST_NODES || self.bound_a2(kind, left_a, choice) <= known_a2 {
            return;
        }
        let gain_a2 = choice.gain_a2;
        if kind == self.kinds.len() {
            if let Some(between) = choice.between.map(|between| &self.kinds[between]) {
                choice.gain_a2 += between.gain_a2(left_a.min(between.range_a()));
            }
            if choice.gain_a2 > self.best.gain_a2 {
                self.best = choice.clone();
            }
        } else {
            let range_a = self.kinds[kind].range_a();
            let fit = (left_a / range_a) as usize;
            for raised in (0..=fit.min(self.free(kind, choice))).rev() {
                choice.raised[kind] = raised;
                choice.gain_a2 = gain_a2 + raised as f64 * self.kinds[kind].gain_a2(range_a);
                self.go_on(kind + 1, left_a - raised as f64 * range_a, choice);
            }
            choice.raised[kind] = 0;
        }
        choice.gain_a2 = gain_a2;
    }
}
