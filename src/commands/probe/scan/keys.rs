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
    pub value: Box<dyn Fn(f64) -> f64 + Sync + 'a>,
    /// The design after a change.
    pub changed: Box<dyn Fn(f64) -> Design + Sync + 'a>,
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
    changed: impl Fn(f64) -> Design + Sync + 'a,
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
    [least_mm, reach_mm]: [f64; 2],
    changed: impl Fn(f64) -> Design + Sync + 'a,
) -> Key<'a> {
    Key {
        name,
        value: Box::new(move |by: f64| value_mm + by),
        changed: Box::new(move |by: f64| changed(by * 1e-3)),
        range: [least_mm, reach_mm],
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
    // A winding is at least one wire thick.
    let thin_m = (2.0 * design.wire.diameter_m).min(coil.outer_diameter_m - coil.inner_diameter_m);
    let widest = (coil.outer_diameter_m - thin_m) / coil.inner_diameter_m;
    let narrowest = (coil.inner_diameter_m + thin_m) / coil.outer_diameter_m;
    let mut list = vec![
        factor(
            "coil.inner_diameter_mm",
            coil.inner_diameter_m * 1e3,
            [lengths[0], widest.min(LENGTHS)],
            step,
            move |by| with_coil(&|coil| coil.inner_diameter_m *= by),
        ),
        factor(
            "coil.outer_diameter_mm",
            coil.outer_diameter_m * 1e3,
            [narrowest.max(lengths[0]), LENGTHS],
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
        list.extend(core_keys(design, core, coil, step));
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

/// The numbers of a core in `coil`.
fn core_keys<'a>(design: &'a Design, core: &'a Core, coil: Coil, step: f64) -> Vec<Key<'a>> {
    let reach_mm = [-250.0, 250.0].map(|of_length| of_length * coil.length_m);
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
        "core.clearance_mm",
        core.clearance_m * 1e3,
        [-core.clearance_m * 1e3, 250.0 * coil.inner_diameter_m],
        move |by_m| with_core(&|core| core.clearance_m += by_m),
    ));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::Need;

    /// A winding with an outer diameter below its inner one was computed for seconds, and reported.
    #[test]
    fn no_key_makes_a_winding_thinner_than_its_wire() {
        let text = "name = \"thin\"\n[coil]\ninner_diameter_mm = 24.0\nouter_diameter_mm = 38.0\n\
                    length_mm = 100.0\n[wire]\ndiameter_mm = 0.7\n[core]\n[array]\nrows = 1\n\
                    columns = 1\npitch_mm = 50.0\n";
        let path = std::path::Path::new("thin.toml");
        let (design, _) = Design::from_toml(text, path, Need::CALIBRATE).unwrap();
        let keys = keys(&design, 1429.0);
        assert_eq!(keys.len(), 7);
        let clearance = keys.iter().find(|key| key.name == "core.clearance_mm");
        assert_eq!(clearance.unwrap().range[0], 0.0);
        for key in &keys {
            for by in key.range {
                let coil = (key.changed)(by).coil.unwrap();
                let thick_m = coil.outer_diameter_m - coil.inner_diameter_m;
                assert!(
                    thick_m >= 0.99 * 1.4e-3,
                    "{} by {by}: {thick_m} m",
                    key.name
                );
            }
        }
    }
}
