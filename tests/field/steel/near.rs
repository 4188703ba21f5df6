//! Close to the steel: claims hold at every place that is accepted.

use fluxform_field::steel::CLOSEST;
use fluxform_field::steel::cored_coil::CoredCoil;
use fluxform_field::winding::AxialField;

use super::support::{Design, designs};
use fluxform_testing::Random;

/// A place outside winding and steel, its distance from the steel uniform in the logarithm.
fn place(design: &Design, random: &mut Random) -> (f64, f64) {
    let (core, winding) = (design.core, design.winding);
    loop {
        let d = random.decades(1.001 * CLOSEST, 3.0) * core.radius_m;
        let (r, z) = match random.between(0.0, 3.0) as usize {
            0 => (random.between(0.0, core.radius_m), core.top_m + d),
            1 => {
                let angle = random.between(0.0, 0.5 * std::f64::consts::PI);
                (
                    core.radius_m + d * angle.cos(),
                    core.top_m + d * angle.sin(),
                )
            }
            _ => (core.radius_m + d, random.between(core.bottom_m, core.top_m)),
        };
        // Off the winding by as much as off the steel: its own edges are not what is tested.
        let across = (winding.inner_radius_m - r).max(r - winding.outer_radius_m);
        let along = z.max(-winding.length_m - z);
        if across.max(along) > CLOSEST * core.radius_m
            && core.distance_m(r, z) >= CLOSEST * core.radius_m
        {
            return (r, z);
        }
    }
}

fn difference(a: &AxialField, b: &AxialField) -> f64 {
    [
        a.dbz_dz - b.dbz_dz,
        a.dbr_dz - b.dbr_dz,
        a.br_over_r - b.br_over_r,
        a.dbr_dr - b.dbr_dr,
    ]
    .into_iter()
    .fold(0.0_f64, |m, d| m.max(d.abs()))
}

/// The largest |grad B| at a height that places there can show: beside the point itself those on
/// the axis and hardly off the steel.
fn largest(design: &Design, coil: &CoredCoil, (r, z): (f64, f64)) -> f64 {
    let core = design.core;
    [
        r,
        0.0,
        0.8 * core.radius_m,
        core.radius_m,
        (1.0 + CLOSEST) * core.radius_m,
    ]
    .into_iter()
    .filter(|r| core.distance_m(*r, z) >= 0.99 * CLOSEST * core.radius_m)
    .filter(|r| *r > core.radius_m || z > core.top_m || z < core.bottom_m)
    .filter_map(|r| coil.field(r, z).ok())
    .fold(0.0_f64, |m, field| m.max(field.gradient_norm()))
}

/// Designs of the study: a few in a test; `FLUXFORM_NEAR_DESIGNS=40` prints the whole table.
fn studied() -> usize {
    std::env::var("FLUXFORM_NEAR_DESIGNS").map_or(2, |count| count.parse().expect("a number"))
}

/// Solutions close to the steel against tight ones. Claims are relative to the largest |grad B| at the height.
#[test]
fn claims_cover_the_solution_wherever_places_are_accepted() {
    let count = studied();
    println!("tolerance | reached | error over claim, worst | nodes");
    for tolerance in [1e-2, 1e-4, 1e-6, 1e-9]
        .into_iter()
        .take(if count > 2 { 4 } else { 3 })
    {
        let (mut reached, mut worst, mut nodes) = (0, 0.0_f64, 0);
        for design in designs(count) {
            let Design {
                winding,
                core,
                mu_r,
            } = design;
            let solve = |tolerance| {
                CoredCoil::everywhere(&winding, core, mu_r, tolerance).expect("off the edges")
            };
            let (coil, tight) = (solve(tolerance), solve(0.01 * tolerance.max(1e-8)));
            nodes += coil.core.outline().nodes.len();
            reached += usize::from(coil.relative_error <= tolerance);
            let claim = coil.relative_error + tight.relative_error;
            let mut random = Random::new(7);
            for _ in 0..60 {
                let (r, z) = place(&design, &mut random);
                let error = difference(&coil.core.field(r, z), &tight.core.field(r, z));
                let part = error / largest(&design, &tight, (r, z)) / claim;
                assert!(part < 1.0, "{design:?} at {r} {z}, {tolerance:e}: {part}");
                worst = worst.max(part);
            }
        }
        println!(
            "{tolerance:e} | {reached}/{count} | {worst:.2} | {}",
            nodes / count
        );
        assert!(
            tolerance < 1e-6 || reached == count,
            "{tolerance:e}: {reached}"
        );
    }
}
