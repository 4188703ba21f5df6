//! The design's numbers that may be at fault where a scan and the design differ.

use crate::design::{Coil, Core, Design, Steel};

/// Steps of differences of the design's numbers: in air, and with steel, whose solution is rougher.
const STEP: f64 = 1e-3;
const STEP_STEEL: f64 = 1e-2;
/// Lengths may be this many times as large or as small, and permeabilities this many times as large.
const LENGTHS: f64 = 3.0;
const PERMEABILITIES: f64 = 1e3;

/// A number of the design: its change is a logarithm of a factor, or a length in mm.
pub(super) struct Key<'a> {
    pub name: &'static str,
    /// Its value in the key's unit after a change.
    pub value: Box<dyn Fn(f64) -> f64 + 'a>,
    /// The design after a change.
    pub changed: Box<dyn Fn(f64) -> Design + 'a>,
    /// Least and largest change.
    pub range: [f64; 2],
    /// The longest change in one step.
    pub longest: f64,
    /// The change that differences are taken over.
    pub step: f64,
}

/// A number that is multiplied.
fn factor<'a>(
    name: &'static str,
    value: f64,
    [least, most]: [f64; 2],
    step: f64,
    changed: impl Fn(f64) -> Design + 'a,
) -> Key<'a> {
    Key {
        name,
        value: Box::new(move |by: f64| value * by.exp()),
        changed: Box::new(move |by: f64| changed(by.exp())),
        range: [least.ln(), most.ln()],
        longest: 1.0,
        step,
    }
}

/// A length that is added to, mm.
fn offset<'a>(
    name: &'static str,
    value_mm: f64,
    reach_mm: f64,
    changed: impl Fn(f64) -> Design + 'a,
) -> Key<'a> {
    Key {
        name,
        value: Box::new(move |by: f64| value_mm + by),
        changed: Box::new(move |by: f64| changed(by * 1e-3)),
        range: [-reach_mm, reach_mm],
        longest: 0.2 * reach_mm,
        step: STEP_STEEL * reach_mm,
    }
}

/// Every number that is tried.
pub(super) fn keys(design: &Design, turns: f64) -> Vec<Key<'_>> {
    let Some(coil) = design.coil else {
        return Vec::new();
    };
    let step = if design.core.is_some() {
        STEP_STEEL
    } else {
        STEP
    };
    let lengths = [LENGTHS.recip(), LENGTHS];
    // More space does not mean more turns here.
    let with_coil = move |change: &dyn Fn(&mut Coil)| {
        let mut changed = design.clone();
        if let Some(coil) = &mut changed.coil {
            coil.turns = Some(turns);
            change(coil);
        }
        changed
    };
    let mut list = vec![
        factor(
            "coil.inner_diameter_mm",
            coil.inner_diameter_m * 1e3,
            lengths,
            step,
            move |by| with_coil(&|coil| coil.inner_diameter_m *= by),
        ),
        factor(
            "coil.outer_diameter_mm",
            coil.outer_diameter_m * 1e3,
            lengths,
            step,
            move |by| with_coil(&|coil| coil.outer_diameter_m *= by),
        ),
        factor(
            "coil.length_mm",
            coil.length_m * 1e3,
            lengths,
            step,
            move |by| with_coil(&|coil| coil.length_m *= by),
        ),
    ];
    if let Some(core) = &design.core {
        list.extend(core_keys(design, core, 250.0 * coil.length_m, step));
    }
    let grid = design.array.grid;
    if let Some(grid) = grid.filter(|grid| grid.rows * grid.columns > 1) {
        let changed = move |by: f64| {
            let mut changed = design.clone();
            let positions = changed.array.positions_m.iter_mut().flatten();
            positions.for_each(|x| *x *= by);
            changed
        };
        let pitch_mm = grid.pitch_m * 1e3;
        list.push(factor("array.pitch_mm", pitch_mm, lengths, step, changed));
    }
    list
}

/// The numbers of a core.
fn core_keys<'a>(design: &'a Design, core: &'a Core, reach_mm: f64, step: f64) -> Vec<Key<'a>> {
    let with_core = move |change: &dyn Fn(&mut Core)| {
        let mut changed = design.clone();
        if let Some(core) = &mut changed.core {
            change(core);
        }
        changed
    };
    let mut list = Vec::new();
    match core.steel {
        Steel::Linear(mu_r) => list.push(factor(
            "core.relative_permeability",
            mu_r,
            [mu_r.recip(), PERMEABILITIES],
            step,
            move |by| with_core(&|core| core.steel = Steel::Linear(mu_r * by)),
        )),
        Steel::Curve(_) => {}
    }
    list.push(offset(
        "core.above_mm",
        core.above_m * 1e3,
        reach_mm,
        move |by_m| with_core(&|core| core.above_m += by_m),
    ));
    list.push(offset(
        "core.below_mm",
        core.below_m * 1e3,
        reach_mm,
        move |by_m| with_core(&|core| core.below_m += by_m),
    ));
    list
}
