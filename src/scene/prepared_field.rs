//! A solved steel's field, prepared once for all places that are about as close to the cores.

use std::sync::{Arc, Mutex, PoisonError};

use crate::field::steel::array_steel::{ArraySteel, SteelField};
use crate::field::steel::clearance::Clearance;

/// Clearances are rounded down to powers of two to one over this: places of one object, lifted, beside
/// each other or fewer of them share what is prepared, whose cost grows with the clearance's inverse square.
const STEPS_OF_TWO: f64 = 16.0;
/// Preparations held at a time: that of points, and that of the map about them.
const HELD: usize = 2;
/// Most numbers of a preparation that is held.
const MOST_NUMBERS: usize = 40_000_000;

/// Clearances and tolerance that a field is prepared for, to the bit.
type Key = [u64; 4];

/// A field by what it was prepared for.
type Prepared = (Key, Arc<SteelField>);

/// The field of one solution as it was last prepared; copies of the solution share it.
#[derive(Debug, Clone, Default)]
pub(super) struct PreparedField(Arc<Mutex<Vec<Prepared>>>);

impl PreparedField {
    /// The field of `steel`, whose cores end at `top_m`, at places with `clearance`, to `tolerance`; `None`
    /// without steel. It depends on these alone, not on what was prepared before.
    pub(super) fn of(
        &self,
        steel: &dyn ArraySteel,
        top_m: f64,
        clearance: Clearance,
        tolerance: f64,
    ) -> Option<Arc<SteelField>> {
        let clearance = rounded(clearance, top_m);
        let Clearance {
            lowest_m,
            highest_m,
            distance_m,
        } = clearance;
        let key = [lowest_m, highest_m, distance_m, tolerance].map(f64::to_bits);
        let held = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        {
            let mut held = held();
            if let Some(place) = held.iter().position(|(of, _)| *of == key) {
                // The last one requested comes first: the map's outlives the points of one object after another.
                held[..=place].rotate_right(1);
                return Some(Arc::clone(&held[0].1));
            }
        }
        let field = Arc::new(steel.field(clearance, tolerance)?);
        if field
            .coupled()
            .is_none_or(|sources| sources.size() <= MOST_NUMBERS)
        {
            let mut held = held();
            held.truncate(HELD - 1);
            held.insert(0, (key, Arc::clone(&field)));
        }
        Some(field)
    }
}

/// Bounds of the same places or more, over steel that ends at `top_m`.
fn rounded(clearance: Clearance, top_m: f64) -> Clearance {
    let above_m = clearance.lowest_m - top_m;
    let distance_m = rounded_down(clearance.distance_m);
    if above_m > 0.0 {
        Clearance::above(top_m + rounded_down(above_m), distance_m)
    } else if clearance.highest_m >= top_m {
        Clearance::above(clearance.lowest_m, distance_m)
    } else {
        Clearance {
            distance_m,
            ..clearance
        }
    }
}

/// `distance_m` on its step, or the same where it has none.
pub(super) fn rounded_down(distance_m: f64) -> f64 {
    let step = (STEPS_OF_TWO * distance_m.log2()).floor();
    if step.is_finite() {
        (step / STEPS_OF_TWO).exp2()
    } else {
        distance_m
    }
}
