//! The array as a search problem: what is computed of a design, its objective, its limits.

use std::sync::{PoisonError, RwLock};

use serde::{Deserialize, Serialize};

use fluxform_base::progress::Interrupted;
use fluxform_base::units::STEEL_DENSITY_KG_PER_M3;
use fluxform_design::{Design, Limits};
use fluxform_numerics::mixed_search::descent::Judged;
use fluxform_numerics::mixed_search::{MET, Problem, Sample, Search, Variable};

use super::positions::closest;
use super::space::{Axis, Space};
use crate::circuit::Circuit;
use crate::limits::{Direction, Evaluated, LIMITS, LimitName, UsedPower, bobbin_bore_m};

/// How accurately a design is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// Coarse forces at few points: while searching.
    Search,
    /// As every other command computes: for what is accepted.
    Full,
}

/// The computed properties of a design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Physical {
    /// The merit of every shape, above 0: its force constant, N/m, or the inverse of an error.
    pub merits: Vec<f64>,
    /// Self inductance of a coil alone, H.
    pub inductance_h: f64,
    /// That of the array's slowest pattern of currents, H.
    pub array_inductance_h: f64,
    /// Heat that the shapes take, as far as a limit of the design names it.
    pub used: UsedPower,
    /// Flux density in the core at the rated current, T.
    pub core_field_t: Option<f64>,
}

/// Computes designs.
pub trait Physics: Sync {
    /// Of a design whose shapes are raised; `None` where it cannot be computed or renders nothing.
    ///
    /// # Errors
    /// Interruption.
    fn compute(
        &self,
        design: &Design,
        raised_m: f64,
        level: Level,
    ) -> Result<Option<Physical>, Interrupted>;

    /// Reports evaluations so far, and the best objective within the limits.
    fn report(&self, _evaluations: usize, _best: Option<f64>) {}
}

impl Physical {
    fn outputs(&self) -> Vec<f64> {
        let merits = self.merits.iter().copied();
        let others = [self.inductance_h, self.array_inductance_h];
        merits
            .chain(others)
            .chain(self.used.static_w)
            .chain(self.used.feedback_w)
            .chain(self.core_field_t)
            .map(f64::ln)
            .collect()
    }

    /// From the logarithms of `shapes` merits, two inductances, the heat that `limits` name and a flux density.
    #[must_use]
    pub fn of_outputs(outputs: &[f64], shapes: usize, limits: &Limits) -> Option<Self> {
        let (merits, others) = outputs.split_at_checked(shapes)?;
        let mut others = others.iter().map(|ln| ln.exp());
        Some(Self {
            merits: merits.iter().map(|ln| ln.exp()).collect(),
            inductance_h: others.next()?,
            array_inductance_h: others.next()?,
            used: UsedPower {
                static_w: limits.static_power_max_w.and_then(|_| others.next()),
                feedback_w: limits.feedback_power_max_w.and_then(|_| others.next()),
            },
            core_field_t: others.next(),
        })
    }
}

/// The objective, made of the shapes' merits relative to the given design's.
#[derive(Debug, Clone, PartialEq)]
pub enum Objective {
    /// The smallest.
    Smallest,
    /// The geometric mean with these weights, one per shape.
    Mean(Vec<f64>),
}

/// A limit beside the value it bounds, in the unit of its key.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounded {
    /// Its key in results.
    pub key: &'static str,
    /// Its row of the table of limits, where it has one.
    pub name: Option<LimitName>,
    /// The design's value.
    pub value: f64,
    /// The limit.
    pub limit: f64,
    /// Whether the value is to be above.
    pub at_least: bool,
    /// Scale of the difference; `None`: it is relative.
    scale: Option<f64>,
    /// Excess that is none: what rounding to made lengths adds to whole lengths of wire.
    slack: f64,
    /// By how much a search must stay below the limit, or above it.
    margin: f64,
    /// Whether a search gave it up, since no design meets it.
    given_up: bool,
}

impl Bounded {
    /// A value that may not exceed its limit.
    fn at_most(key: &'static str, value: f64, limit: f64) -> Self {
        Self {
            key,
            name: None,
            value,
            limit,
            at_least: false,
            scale: None,
            slack: 0.0,
            margin: MARGIN,
            given_up: false,
        }
    }

    /// A value that may not fall below its limit.
    fn at_least(key: &'static str, value: f64, limit: f64) -> Self {
        Self {
            at_least: true,
            ..Self::at_most(key, value, limit)
        }
    }

    /// The same as a row of the table of limits.
    fn of(self, name: LimitName) -> Self {
        Self {
            name: Some(name),
            ..self
        }
    }

    /// The same limit, relaxed by this share of it, or of the scale of differences.
    #[must_use]
    pub fn relaxed(&self, share: f64) -> Self {
        let by = share * self.scale.unwrap_or(self.limit.abs());
        Self {
            limit: self.limit + if self.at_least { -by } else { by },
            ..*self
        }
    }

    /// Whether it is the same limit, on the same side.
    fn is_same_limit(&self, other: &Self) -> bool {
        self.key == other.key && self.at_least == other.at_least
    }

    /// By how much the limit is broken: above 0 where it is.
    #[must_use]
    pub fn excess(&self) -> f64 {
        let over = match self.scale {
            Some(scale) => (self.value - self.limit) / scale,
            None => (self.value.max(f64::MIN_POSITIVE) / self.limit).ln(),
        };
        (if self.at_least { -over } else { over }) - self.slack
    }

    /// Whether it is met, up to the rounding of places and lengths.
    #[must_use]
    pub fn is_met(&self) -> bool {
        self.excess() <= ROUNDING
    }

    /// The same, or that the search gave it up.
    pub(super) fn is_met_or_given_up(&self) -> bool {
        self.given_up || self.is_met()
    }

    /// What a search takes for the excess: above [`MET`] where the limit is broken, or may be once lengths are rounded.
    fn judged(&self) -> f64 {
        let excess = self.excess() + self.margin;
        match self.ends_range() {
            true => excess.max(FIRM * excess),
            false => excess,
        }
    }

    /// Whether it is the end of a range that the search may leave on its way.
    #[must_use]
    pub fn ends_range(&self) -> bool {
        RANGES.contains(&self.key)
    }

    /// Whether a search takes a design for one that breaks this limit.
    pub(super) fn is_broken(&self) -> bool {
        self.judged() > MET
    }
}

/// Relative rounding of places and lengths, several operations long.
const ROUNDING: f64 = 1e-12;
/// Distance that the search keeps from limits on what lengths decide that are rounded later.
const MARGIN: f64 = 3e-5;
/// The same where nothing is rounded: the search accepts what meets the limit.
const EXACT: f64 = MET - ROUNDING;
/// Largest change of the correction, as a logarithm, that one design teaches about all others: several times what the
/// coarsest search's forces, off by a tenth, explain. Beyond it, the search does not know that design.
const LARGEST_CORRECTION: f64 = 0.5;
/// Least difference of core and bore diameter that leaves a core, and least length of one, mm.
const LEAST_CORE_MM: f64 = 1.0;
/// Weight of the excess over limits that were given up: above what force they buy, below the cost of those that are kept.
const GIVEN_UP: f64 = 4.0;
/// Weight of the excess over the end of a range beside that over a limit: where no design meets every limit, the one
/// that breaks them least is to be within the ranges.
const FIRM: f64 = 1e3;
/// Ranges of what whole layers and turns give, by key.
const RANGES: [&str; 2] = ["search.coil.outer_diameter_mm", "search.coil.length_mm"];
/// Distance of the magnet's centre from the core's top, mm, beside which a millimetre counts.
const ROOM_MM: f64 = 10.0;

/// The room between the array and the shapes where they are given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Room {
    /// Height that no core may reach, m.
    pub ceiling_m: f64,
    /// How far the shapes may be moved down (<= 0) and up, m.
    pub height_m: [f64; 2],
}

/// The array as a problem of `numerics::mixed_search`.
pub struct ArrayProblem<'a> {
    /// The designs.
    pub space: Space,
    physics: &'a dyn Physics,
    objective: Objective,
    /// Logarithms of the merits that count as 1.
    reference_ln: Vec<f64>,
    room: Room,
    /// Limits that are no part of the search, by key: those that all designs of all choices meet or break alike.
    left_out: Vec<&'static str>,
    /// Those that no sample of a search met.
    given_up: RwLock<Vec<Bounded>>,
    /// The correction of the search's outputs to full accuracy.
    correction: RwLock<Vec<f64>>,
    /// Samples that were computed to full accuracy, by their variables; `None` where there is no such design.
    known: RwLock<Vec<(Vec<f64>, Option<Physical>)>>,
}

impl<'a> ArrayProblem<'a> {
    /// A problem of `space`; `reference` are merits that count as 1.
    #[must_use]
    pub fn new(
        space: Space,
        physics: &'a dyn Physics,
        objective: Objective,
        reference: &[f64],
        room: Room,
    ) -> Self {
        Self {
            space,
            physics,
            objective,
            reference_ln: reference.iter().map(|merit| merit.ln()).collect(),
            room,
            left_out: Vec::new(),
            given_up: RwLock::default(),
            correction: RwLock::default(),
            known: RwLock::default(),
        }
    }

    /// Takes the limits of this key out of the search.
    pub(super) fn leave_out(&mut self, key: &'static str) {
        self.left_out.push(key);
    }

    /// Where limits are met by no sample of `search`, they are no limits from now on: of the designs that meet the others
    /// the one that breaks them least is the best. Whether there are such limits.
    pub(super) fn give_up_unmet(&self, search: &Search<'_>) -> bool {
        let mut unmet: Option<Vec<Bounded>> = None;
        for sample in search.samples() {
            let Some(physical) = self.properties(sample) else {
                continue;
            };
            let bounds = self.bounds(&sample.x, Some(&physical));
            if !in_ranges(&bounds) {
                continue;
            }
            let broken = |known: &Bounded| {
                let bound = bounds.iter().find(|bound| bound.is_same_limit(known));
                bound.is_some_and(|bound| bound.excess() > MET)
            };
            unmet
                .get_or_insert_with(|| bounds.clone())
                .retain(|known| !known.ends_range() && broken(known));
        }
        let unmet = unmet.unwrap_or_default();
        let found = !unmet.is_empty();
        *self
            .given_up
            .write()
            .unwrap_or_else(PoisonError::into_inner) = unmet;
        found
    }

    /// Takes them in again.
    pub(super) fn take_in(&mut self, key: &'static str) {
        self.left_out.retain(|known| *known != key);
    }

    /// The limits that all designs of the space meet or break alike.
    pub(super) fn unchanged_limits(&self) -> Vec<Bounded> {
        if self.space.is_wound() {
            return Vec::new();
        }
        let ends: [fn(&Variable) -> f64; 2] = [|variable| variable.low, |variable| variable.high];
        let [low, high] = ends.map(|end| {
            let x: Vec<f64> = self.space.variables().iter().map(end).collect();
            Self::of_table(&self.space.design(&x), None)
        });
        low.into_iter()
            .filter(|bound| high.contains(bound))
            .collect()
    }

    fn corrected(&self, outputs: &[f64]) -> Vec<f64> {
        let correction = self
            .correction
            .read()
            .unwrap_or_else(PoisonError::into_inner);
        let added = correction.iter().copied().chain(std::iter::repeat(0.0));
        outputs.iter().zip(added).map(|(a, b)| a + b).collect()
    }

    /// Begins with the correction of the given design, whose merits at full accuracy are the reference.
    pub fn begin_with(&self, searched: &Physical, full: &Physical) {
        *self
            .correction
            .write()
            .unwrap_or_else(PoisonError::into_inner) = difference(full, &searched.outputs());
    }

    /// Computes the design at `x` to full accuracy; by as much as its outputs differ from those of the
    /// search, all of these are corrected from now on, unless that would change one by a large part.
    ///
    /// # Errors
    /// Interruption.
    pub fn correct(&self, x: &[f64], searched: &[f64]) -> Result<Option<Physical>, Interrupted> {
        let full = self.compute_fully(x)?;
        if let Some(full) = &full {
            let new = difference(full, searched);
            let mut correction = self
                .correction
                .write()
                .unwrap_or_else(PoisonError::into_inner);
            let before = correction.iter().copied().chain(std::iter::repeat(0.0));
            let mut changes = new.iter().zip(before).map(|(new, old)| (new - old).abs());
            if changes.all(|change| change <= LARGEST_CORRECTION) {
                *correction = new;
            }
        }
        Ok(full)
    }

    /// The design at `x` at full accuracy, which its sample has from now on.
    ///
    /// # Errors
    /// Interruption.
    pub fn compute_fully(&self, x: &[f64]) -> Result<Option<Physical>, Interrupted> {
        if let Some(full) = self.fully(x) {
            return Ok(full);
        }
        let full = self.physical(x, Level::Full)?;
        self.known
            .write()
            .unwrap_or_else(PoisonError::into_inner)
            .push((x.to_vec(), full.clone()));
        Ok(full)
    }

    fn fully(&self, x: &[f64]) -> Option<Option<Physical>> {
        let known = self.known.read().unwrap_or_else(PoisonError::into_inner);
        let at_x = known.iter().find(|(at, _)| at == x);
        at_x.map(|(_, full)| full.clone())
    }

    /// Whether the design at `x` was computed to full accuracy.
    #[must_use]
    pub fn is_known_fully(&self, x: &[f64]) -> bool {
        self.fully(x).is_some()
    }

    /// The properties of a sample: at full accuracy where that is known, else as its corrected outputs have them.
    #[must_use]
    pub fn properties(&self, sample: &Sample) -> Option<Physical> {
        match self.fully(&sample.x) {
            Some(full) => full,
            None => self.estimate(sample.outputs.as_ref()?),
        }
    }

    /// Objective and limits of a sample with these properties.
    #[must_use]
    pub fn judged_sample(&self, sample: &Sample) -> Option<Judged> {
        let physical = self.properties(sample)?;
        Some(self.judged(Some(&physical), &self.bounds(&sample.x, Some(&physical))))
    }

    /// The best sample of a search with these properties: of those that meet the limits, or that breaks them least
    /// within the ranges of the search, as far as there is one.
    #[must_use]
    pub fn best<'s>(&self, search: &'s Search<'_>) -> Option<(&'s Sample, Judged)> {
        let ranked = search.samples().iter().filter_map(|sample| {
            let physical = self.properties(sample)?;
            let bounds = self.bounds(&sample.x, Some(&physical));
            let judged = self.judged(Some(&physical), &bounds);
            let keeps_others = bounds.iter().all(|b| b.given_up || !b.is_broken());
            let rank = (keeps_others, in_ranges(&bounds), judged.merit());
            rank.2.is_finite().then_some((rank, sample, judged))
        });
        let best = ranked.reduce(|a, b| if b.0 > a.0 { b } else { a });
        best.map(|(_, sample, judged)| (sample, judged))
    }

    /// The computed properties of the design as it is made.
    ///
    /// # Errors
    /// Interruption.
    pub fn physical(&self, x: &[f64], level: Level) -> Result<Option<Physical>, Interrupted> {
        let made = self.made(x);
        let design = self.space.design(&made);
        if !is_solid(&design) {
            return Ok(None);
        }
        self.physics
            .compute(&design, self.space.raised_m(&made), level)
    }

    /// The properties that the corrected outputs stand for.
    #[must_use]
    pub fn estimate(&self, outputs: &[f64]) -> Option<Physical> {
        let limits = &self.space.base().limits;
        Physical::of_outputs(&self.corrected(outputs), self.reference_ln.len(), limits)
    }

    /// The objective's parts: logarithms of the merits over those of the reference.
    #[must_use]
    pub fn objectives(&self, physical: Option<&Physical>) -> Vec<f64> {
        let Some(physical) = physical else {
            return vec![0.0];
        };
        let ratios = physical.merits.iter().zip(&self.reference_ln);
        let ratios: Vec<f64> = ratios
            .map(|(merit, reference)| merit.ln() - reference)
            .collect();
        match &self.objective {
            Objective::Smallest => ratios,
            Objective::Mean(weights) => {
                let sum: f64 = ratios.iter().zip(weights).map(|(r, w)| r * w).sum();
                vec![sum / weights.iter().sum::<f64>()]
            }
        }
    }

    /// The circuit of a coil alone, and its mass with its core, kg.
    #[must_use]
    pub fn coil(design: &Design, inductance_h: f64) -> Option<(Circuit, f64)> {
        let coil = design.coil.as_ref()?;
        let circuit = Circuit::of_inductance(coil, &design.wire, inductance_h);
        let core = design.core.as_ref().map_or(0.0, |core| {
            let radius_m = 0.5 * coil.inner_diameter_m - core.clearance_m;
            let length_m = coil.length_m + core.above_m + core.below_m;
            std::f64::consts::PI * radius_m * radius_m * length_m * STEEL_DENSITY_KG_PER_M3
        });
        Some((circuit, circuit.wire_mass_kg + core))
    }

    /// Every limit of the design at `x`, as far as `physical` lets it be known.
    #[must_use]
    pub fn bounds(&self, x: &[f64], physical: Option<&Physical>) -> Vec<Bounded> {
        let design = self.space.design(x);
        let mut all = Self::of_table(&design, physical);
        self.add_winding(&design, &mut all);
        self.add_core(x, &design, &mut all);
        add_plate(&design, &mut all);
        self.add_height(x, &mut all);
        all.retain(|bound| !self.left_out.contains(&bound.key));
        let given_up = self.given_up.read();
        let given_up = given_up.unwrap_or_else(PoisonError::into_inner);
        for bound in &mut all {
            bound.margin = self.margin(x, bound);
            bound.given_up = given_up.iter().any(|known| known.is_same_limit(bound));
        }
        all
    }

    /// What the table of limits makes of a design, as far as `physical` lets it be known; `None` without a coil.
    pub fn evaluated<T>(
        design: &Design,
        physical: Option<&Physical>,
        of: impl FnOnce(&Evaluated<'_>) -> T,
    ) -> Option<T> {
        let inductance_h = physical.map_or(f64::NAN, |p| p.inductance_h);
        let (circuit, mass_kg) = Self::coil(design, inductance_h)?;
        let rated_a = circuit.rated_current_a(&design.supply);
        Some(of(&Evaluated {
            design,
            circuit: &circuit,
            power_w: circuit.power_w(rated_a),
            mass_kg,
            core_field_t: physical.and_then(|p| p.core_field_t),
            array_inductance_h: physical.map(|p| p.array_inductance_h),
            used: physical.map(|p| p.used).unwrap_or_default(),
        }))
    }

    /// Those that the design's [limits] hold.
    fn of_table(design: &Design, physical: Option<&Physical>) -> Vec<Bounded> {
        let rows = LIMITS
            .iter()
            .filter(|row| row.name != LimitName::WindingFill);
        let of_design = |at: &Evaluated<'_>| {
            let bounds = rows.filter_map(|row| {
                let value = (row.value)(at)?;
                let of = match row.direction {
                    Direction::AtLeast => Bounded::at_least,
                    Direction::AtMost | Direction::Equal => Bounded::at_most,
                };
                Some(of(row.key, value, (row.of)(&design.limits)?).of(row.name))
            });
            bounds.filter(|bound| bound.value.is_finite()).collect()
        };
        Self::evaluated(design, physical, of_design).unwrap_or_default()
    }

    /// Bounds under which the winding can be made and the coils fit beside each other.
    fn add_winding(&self, design: &Design, all: &mut Vec<Bounded>) {
        let Some(coil) = &design.coil else { return };
        if design.array.positions_m.len() > 1 {
            let apart = closest(&design.array.positions_m);
            let pitch = Bounded::at_most("pitch_m", coil.outer_diameter_m, apart);
            all.push(pitch.of(LimitName::Pitch));
        }
        if !self.space.is_wound() {
            return;
        }
        let [outer, length] = [coil.outer_diameter_m, coil.length_m].map(|m| m * 1e3);
        let ranges = [
            (RANGES[0], outer, self.space.outer_mm),
            (RANGES[1], length, self.space.length_mm),
        ];
        let slack = MARGIN + ROUNDING;
        for (key, value, [low, high]) in ranges {
            let ends = [
                Bounded::at_most(key, value, high),
                Bounded::at_least(key, value, low),
            ];
            let ends = ends.into_iter().filter(|end| end.limit > 0.0);
            all.extend(ends.map(|end| Bounded { slack, ..end }));
        }
        if design.limits.inner_diameter_min_m.is_none() {
            let bobbin_m = bobbin_bore_m(design.wire.diameter_m);
            let bore = Bounded::at_least("inner_diameter_m", coil.inner_diameter_m, bobbin_m);
            all.push(bore.of(LimitName::InnerDiameter));
        }
    }

    /// Bounds under which a core remains, below the shapes.
    fn add_core(&self, x: &[f64], design: &Design, all: &mut Vec<Bounded>) {
        let (Some(coil), Some(core)) = (&design.coil, &design.core) else {
            return;
        };
        let (least_m, room_m) = (LEAST_CORE_MM * 1e-3, ROOM_MM * 1e-3);
        let diameter_m = coil.inner_diameter_m - 2.0 * core.clearance_m;
        let length_m = coil.length_m + core.above_m + core.below_m;
        let ceiling_m = self.room.ceiling_m + self.space.raised_m(x).min(0.0) - 0.05 * diameter_m;
        let bounds = [
            Bounded::at_least("core_diameter_m", diameter_m, least_m),
            Bounded::at_least("core_length_m", length_m, least_m),
            Bounded::at_most("core_top_m", core.above_m, ceiling_m),
        ];
        all.extend(bounds.map(|bound| Bounded {
            scale: Some(room_m),
            ..bound
        }));
    }

    /// The bound that leaves raised shapes in the workspace, where a runtime gives forces.
    fn add_height(&self, x: &[f64], all: &mut Vec<Bounded>) {
        let Some(height_mm) = self.space.value(x, Axis::Height) else {
            return;
        };
        let [low, high] = self.room.height_m.map(|end| end * 1e3);
        let bounds = [
            Bounded::at_least("shapes.height_mm", height_mm, low),
            Bounded::at_most("shapes.height_mm", height_mm, high),
        ];
        all.extend(bounds.map(|bound| Bounded {
            scale: Some(ROOM_MM),
            ..bound
        }));
    }

    /// By how much the search must stay below a limit of the design at `x`, or above it.
    fn margin(&self, x: &[f64], bound: &Bounded) -> f64 {
        let space = &self.space;
        let made_exactly = bound.scale.is_some() || bound.name == Some(LimitName::Pitch);
        // Ranges have their slack.
        if bound.ends_range() {
            return MARGIN;
        }
        // What is not rounded, or is rounded to the right side, may be at its limit.
        if !space.is_wound() && !space.varies_plate() && (made_exactly || !space.rounds()) {
            return MET;
        }
        let decides = |axis: Axis| match bound.name {
            Some(LimitName::Length) => axis == Axis::TurnsPerLayer,
            Some(LimitName::OuterDiameter) => matches!(axis, Axis::Bore | Axis::Layers),
            Some(LimitName::InnerDiameter) => axis == Axis::Bore,
            Some(LimitName::Pitch | LimitName::Footprint) => matches!(
                axis,
                Axis::Bore | Axis::Layers | Axis::Plate(_) | Axis::Pitch | Axis::Move(_)
            ),
            _ => true,
        };
        EXACT + space.rounding(x, decides) * (MARGIN - EXACT)
    }

    /// Objective and limits from bounds that are known.
    #[must_use]
    pub fn judged(&self, physical: Option<&Physical>, bounds: &[Bounded]) -> Judged {
        let (given_up, kept): (Vec<&Bounded>, Vec<&Bounded>) =
            bounds.iter().partition(|bound| bound.given_up);
        let excess: f64 = given_up.iter().map(|bound| bound.excess().max(0.0)).sum();
        let objectives = self.objectives(physical).into_iter();
        let limits = kept.into_iter().map(Bounded::judged);
        Judged {
            objectives: objectives.map(|of| of - GIVEN_UP * excess).collect(),
            // No such design meets all limits.
            limits: limits.chain((excess > MET).then_some(2.0 * MET)).collect(),
        }
    }

    /// Index of a variable.
    #[must_use]
    pub fn index(&self, axis: Axis) -> Option<usize> {
        self.space.axes().iter().position(|known| *known == axis)
    }
}

/// Whether what whole layers and turns give is within the ranges of the search.
pub(super) fn in_ranges(bounds: &[Bounded]) -> bool {
    let mut ends = bounds.iter().filter(|bound| bound.ends_range());
    ends.all(Bounded::is_met)
}

/// By how much the logarithms of outputs at full accuracy are above those of the search.
fn difference(full: &Physical, searched: &[f64]) -> Vec<f64> {
    let pairs = full.outputs().into_iter().zip(searched);
    pairs.map(|(full, searched)| full - searched).collect()
}

/// Bounds that keep all feet on the plate.
fn add_plate(design: &Design, all: &mut Vec<Bounded>) {
    const KEYS: [&str; 3] = ["plate_x_m", "plate_y_m", "plate_diameter_m"];
    if let Some(plate) = &design.plate {
        let sides = plate.sides_m().into_iter().zip(least_sides_m(design));
        let of = |(key, (side_m, least_m)): (&'static str, (Option<f64>, f64))| {
            Some(Bounded::at_least(key, side_m?, least_m * (1.0 + MARGIN)))
        };
        all.extend(KEYS.into_iter().zip(sides).filter_map(of));
    }
}

/// The sides along x and y that hold every foot (without cores, every winding), and the diameter, m.
fn least_sides_m(design: &Design) -> [f64; 3] {
    let Some(coil) = &design.coil else {
        return [0.0; 3];
    };
    let foot_m = match &design.core {
        Some(core) => coil.inner_diameter_m - 2.0 * core.clearance_m,
        None => coil.outer_diameter_m,
    };
    let places = &design.array.positions_m;
    let ends = [0, 1].map(|axis| {
        let of = places.iter().map(|place| place[axis]);
        of.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
            [low.min(x), high.max(x)]
        })
    });
    let [x, y] = ends.map(|[low, high]| 0.5 * (low + high));
    let far = |place: &[f64; 2]| (place[0] - x).hypot(place[1] - y);
    let [along_x, along_y] = ends.map(|[low, high]| high - low + foot_m);
    let across = 2.0 * places.iter().map(far).fold(0.0, f64::max) + foot_m;
    [along_x, along_y, across]
}

/// Whether the core has a size and is clear of the neighbours' windings: steel that turns inside out or
/// crosses other steel has no field.
fn is_solid(design: &Design) -> bool {
    if let Some(plate) = &design.plate {
        let mut sides = plate.sides_m().into_iter().zip(least_sides_m(design));
        if sides.any(|(side_m, least_m)| side_m.is_some_and(|side_m| side_m <= least_m)) {
            return false;
        }
    }
    let (Some(coil), Some(core)) = (&design.coil, &design.core) else {
        return true;
    };
    let least_m = 0.5 * LEAST_CORE_MM * 1e-3;
    let diameter_m = coil.inner_diameter_m - 2.0 * core.clearance_m;
    let apart_m = closest(&design.array.positions_m);
    diameter_m > least_m
        && coil.length_m + core.above_m + core.below_m > least_m
        && 0.5 * (coil.outer_diameter_m + diameter_m) < apart_m
}

impl Problem for ArrayProblem<'_> {
    fn variables(&self) -> &[Variable] {
        self.space.variables()
    }

    /// Lengths are rounded, to the other side where the nearer one breaks a limit that `x` meets, as far as limits are
    /// known without physics.
    fn made(&self, x: &[f64]) -> Vec<f64> {
        let broken = |x: &[f64]| self.bounds(x, None).iter().filter(|b| !b.is_met()).count();
        let mut made = self.space.made(x);
        let (least, mut now) = (broken(x), broken(&made));
        for (index, beyond) in self.space.made_beyond(x, &made) {
            if now <= least {
                break;
            }
            let near = std::mem::replace(&mut made[index], beyond);
            match broken(&made) {
                fewer if fewer < now => now = fewer,
                _ => made[index] = near,
            }
        }
        made
    }

    fn outputs(&self, x: &[f64]) -> Result<Option<Vec<f64>>, Interrupted> {
        Ok(self
            .physical(x, Level::Search)?
            .map(|physical| physical.outputs()))
    }

    fn judge(&self, x: &[f64], outputs: &[f64]) -> Judged {
        let physical = self.estimate(outputs);
        self.judged(physical.as_ref(), &self.bounds(x, physical.as_ref()))
    }

    fn report(&self, evaluations: usize, best: Option<f64>) {
        self.physics.report(evaluations, best.map(f64::exp));
    }
}
