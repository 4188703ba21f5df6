//! Multipole sources of a scene: the fewest of a ladder of layouts that meet a tolerance.

use std::path::{Path, PathBuf};

use super::mag_manip::{MultipolesMade, MultipolesSummary, SAFETY, direct, largest, stages};
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::map::multipole_fit::{ALONE, COUPLED, Kind, Model, Samples, sources, terms};
use crate::numerics::axis::Axis;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::steel::Solved;

/// Default tolerance of the multipoles: of field and gradient, relative to the largest at each
/// height.
pub const MULTIPOLE_TOLERANCE: f64 = 1e-3;

/// Planes of samples rise by this factor of the distance from the top face.
const RISE: f64 = 1.22;
/// Most planes.
const PLANES: usize = 16;
/// Samples in a plane stand this part of its distance from the top face apart.
const SPACING: f64 = 0.5;
/// Fewest and most samples along an axis of a plane.
const ALONG: [usize; 2] = [7, 33];
/// Places at which the model is compared; half of them low.
const CHECKS: usize = 1500;
/// Part of the heights in which that half lies.
const LOW: f64 = 0.1;
/// How far they are spread beyond the workspace, whose faces take those that fall outside.
const STRETCH: f64 = 1.15;
/// A layout with more terms than this is tried only where it is the first.
const MOST_TERMS: usize = 2500;

/// Fits the sources; where no layout meets the tolerance, the best one is given.
///
/// # Errors
/// A workspace that reaches down to the coils; interruption.
pub(super) fn make(
    scene: &Scene,
    solved: &Solved,
    path: PathBuf,
    tolerance: f64,
    own_error: f64,
    progress: &dyn Progress,
) -> Result<MultipolesMade, RunError> {
    let workspace = &scene.design.workspace;
    let axes = [workspace.x_m, workspace.y_m, workspace.z_m];
    let top_m = scene.sources_top_m();
    if workspace.z_m.from <= top_m {
        return Err(RunError::Input(
            "--mpem needs a workspace above the top face of windings, cores and other steel, \
             where its sources lie: raise the lower end of [workspace] z_mm"
                .to_owned(),
        ));
    }
    let mut samples = direct(scene, solved, fitted_places(axes, top_m), progress)?;
    let heights = largest(&samples);
    let axes_m: Vec<[f64; 2]> = scene.coils.iter().map(|c| c.axis_m).collect();
    let compared = compared_places(axes, &axes_m, scene.winding.outer_radius_m);
    let mut checks = direct(scene, solved, compared, progress)?;
    for set in [&mut samples, &mut checks] {
        set.sizes = (set.points_m.iter())
            .map(|p| size_at(&heights, top_m, p[2]))
            .collect();
    }

    let coupled = solved.steel().couples();
    // Coils with common sources: all of them, or each for itself.
    let every: Vec<usize> = (0..axes_m.len()).collect();
    let groups: Vec<&[usize]> = if coupled {
        vec![&every]
    } else {
        every.chunks(1).collect()
    };
    let placing = Placing {
        axes_m: &axes_m,
        top_m,
        outer_radius_m: scene.winding.outer_radius_m,
    };
    let ladder: &[&[Kind]] = if coupled { &COUPLED } else { &ALONE };
    progress.begin("multipoles", (ladder.len() * groups.len()) as u64);
    let enough = |errors: &[f64; 2]| SAFETY * worst(errors) + own_error <= tolerance;
    let best = best_layout(
        ladder,
        &groups,
        &placing,
        [&samples, &checks],
        enough,
        progress,
    )?;
    progress.end();
    let (errors, models) = best.unwrap_or_default();
    let coils = if coupled {
        every.iter().map(|coil| (0, *coil)).collect()
    } else {
        every.iter().map(|coil| (*coil, 0)).collect()
    };
    let method = format!(
        "{SAFETY} times the largest difference from direct values at {} places that the fit did \
         not see, of every coil; and the direct values' own error",
        checks.points_m.len()
    );
    let counts = [samples.points_m.len(), checks.points_m.len()];
    let accuracy = stages(errors, own_error, &method);
    Ok(MultipolesMade {
        summary: summary(&path, &models, counts, tolerance, &accuracy),
        path,
        coils,
        models,
        workspace_m: axes.map(|axis| [axis.from, axis.to]),
        accuracy,
    })
}

/// The figures of the fit; `counts` are of the points of fit and comparison.
fn summary(
    path: &Path,
    models: &[Model],
    [points, checks]: [usize; 2],
    tolerance: f64,
    accuracy: &[StageAccuracy; 2],
) -> MultipolesSummary {
    let orders = models.iter().flat_map(|model| &model.coefficients);
    MultipolesSummary {
        file: path.display().to_string(),
        sources: models.iter().map(|m| m.sources.len()).max().unwrap_or(0),
        coefficients: orders.map(Vec::len).max().unwrap_or(0),
        condition: models.iter().fold(1.0, |most, m| most.max(m.condition)),
        points,
        checks,
        field_error: accuracy[0].estimate,
        gradient_error: accuracy[1].estimate,
        tolerance,
        tolerance_met: accuracy.iter().all(|stage| stage.estimate <= tolerance),
    }
}

/// Where sources can be placed.
struct Placing<'a> {
    axes_m: &'a [[f64; 2]],
    top_m: f64,
    outer_radius_m: f64,
}

/// The larger of two errors.
fn worst(errors: &[f64; 2]) -> f64 {
    errors[0].max(errors[1])
}

/// Errors of field and gradient, and one model for each group of coils.
type Layout = ([f64; 2], Vec<Model>);

/// The first layout of the ladder whose errors are `enough`, or the one with the least errors.
/// `groups` are coils with common sources; `samples` are for the fit and for the comparison.
fn best_layout(
    ladder: &[&[Kind]],
    groups: &[&[usize]],
    placing: &Placing,
    [samples, checks]: [&Samples; 2],
    enough: impl Fn(&[f64; 2]) -> bool,
    progress: &dyn Progress,
) -> Result<Option<Layout>, RunError> {
    let mut best: Option<Layout> = None;
    for kinds in ladder {
        let mut errors = [0.0_f64; 2];
        let mut models = Vec::new();
        for coils in groups {
            progress.check()?;
            let own: Vec<[f64; 2]> = coils.iter().map(|coil| placing.axes_m[*coil]).collect();
            let placed = sources(kinds, &own, placing.top_m, placing.outer_radius_m);
            if best.is_some() && terms(&placed) > MOST_TERMS {
                break;
            }
            let model = Model::fit(placed, samples, coils);
            let off = model.largest_errors(checks, coils);
            errors = std::array::from_fn(|k| errors[k].max(off[k]));
            models.push(model);
            progress.advance(1);
        }
        let better = (best.as_ref()).is_none_or(|(least, _)| worst(&errors) < worst(least));
        if models.len() == groups.len() && better {
            best = Some((errors, models));
        }
        if (best.as_ref()).is_some_and(|(errors, _)| enough(errors)) {
            break;
        }
    }
    Ok(best)
}

/// Planes of samples: close where the field varies most, at the bottom, and denser to the ends.
fn fitted_places([x, y, z]: [Axis; 3], top_m: f64) -> Vec<[f64; 3]> {
    let (low, high) = (z.from - top_m, z.to - top_m);
    let planes = ((high / low).ln() / RISE.ln()).ceil() as usize;
    let planes = planes.clamp(usize::from(high > low), PLANES);
    let mut out = Vec::new();
    for plane in 0..=planes {
        let above = match plane {
            0 => low,
            last if last == planes => high,
            between => low * (high / low).powf(between as f64 / planes as f64),
        };
        let along = |axis: Axis| {
            if axis.to <= axis.from {
                return vec![axis.from];
            }
            let count = ((axis.to - axis.from) / (SPACING * above)).ceil() as usize + 1;
            let count = count.clamp(ALONG[0], ALONG[1]);
            (0..count)
                .map(|k| {
                    let even = k as f64 / (count - 1) as f64;
                    let graded = 0.5 * (1.0 - (std::f64::consts::PI * even).cos());
                    axis.from + (axis.to - axis.from) * 0.5 * (even + graded)
                })
                .collect()
        };
        let (x, y) = (along(x), along(y));
        for y in y {
            out.extend(x.iter().map(|x| [*x, y, top_m + above]));
        }
    }
    out
}

/// Scattered places: an additive sequence of irrational steps, without pattern and the same every
/// time. Half of them lie in the lowest tenth of the heights, and many on the workspace's faces,
/// where the error is largest; then those about the coils' axes, lowest.
fn compared_places([x, y, z]: [Axis; 3], axes_m: &[[f64; 2]], radius_m: f64) -> Vec<[f64; 3]> {
    /// Places about an axis, half the outer radius away.
    const ABOUT: usize = 6;
    /// Powers of the inverse of the root of t^4 = t + 1, and so spread evenly in three variables.
    const STEPS: [f64; 3] = [
        0.819_172_513_396_164_4,
        0.671_043_606_703_789_2,
        0.549_700_477_901_943_5,
    ];
    let between = |axis: Axis, part: f64| {
        let stretched = (0.5 + STRETCH * (part - 0.5)).clamp(0.0, 1.0);
        axis.from + (axis.to - axis.from) * stretched
    };
    let scattered = (1..=CHECKS).map(|k| {
        let [a, b, c] = STEPS.map(|step| (0.5 + step * k as f64).fract());
        let z = match k % 2 {
            0 => between(z, c),
            _ => between(
                Axis {
                    to: z.from + LOW * (z.to - z.from),
                    ..z
                },
                c,
            ),
        };
        [between(x, a), between(y, b), z]
    });
    let about = axes_m.iter().flat_map(|[cx, cy]| {
        (0..=ABOUT).map(move |k| {
            let r_m = if k == 0 { 0.0 } else { 0.5 * radius_m };
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / ABOUT as f64).sin_cos();
            [cx + r_m * cos, cy + r_m * sin, z.from]
        })
    });
    let within = |place: &[f64; 3]| {
        let ends = [(x, place[0]), (y, place[1])];
        ends.iter()
            .all(|(axis, at)| (axis.from..=axis.to).contains(at))
    };
    scattered.chain(about.filter(within)).collect()
}

/// The largest field and gradient at a height, between the planes at which they are known: both
/// fall about as powers of the distance from the top face.
fn size_at(heights: &[(f64, [f64; 2])], top_m: f64, z_m: f64) -> [f64; 2] {
    let after = heights.partition_point(|(z, _)| *z < z_m);
    let after = after.clamp(1.min(heights.len() - 1), heights.len() - 1);
    let ((z0, low), (z1, high)) = (heights[after.saturating_sub(1)], heights[after]);
    let part = if z1 > z0 {
        (((z_m - top_m) / (z0 - top_m)).ln() / ((z1 - top_m) / (z0 - top_m)).ln()).clamp(0.0, 1.0)
    } else {
        0.0
    };
    std::array::from_fn(|k| {
        let size = low[k] * (high[k] / low[k]).powf(part);
        if size > 0.0 { size } else { 1.0 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const AXES: [Axis; 3] = [
        Axis {
            from: -0.05,
            to: 0.07,
            samples: 3,
        },
        Axis {
            from: -0.03,
            to: 0.05,
            samples: 3,
        },
        Axis {
            from: 0.01,
            to: 0.08,
            samples: 3,
        },
    ];

    #[test]
    fn places_fill_the_workspace() {
        let fitted = fitted_places(AXES, 0.002);
        let compared = compared_places(AXES, &[], 0.0);
        for (axis, at) in AXES.iter().zip(0..3) {
            let ends = |places: &[[f64; 3]]| {
                places
                    .iter()
                    .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], p| {
                        [low.min(p[at]), high.max(p[at])]
                    })
            };
            let [low, high] = ends(&fitted);
            assert!((low - axis.from).abs() < 1e-15 && (high - axis.to).abs() < 1e-15);
            let [low, high] = ends(&compared);
            let length = axis.to - axis.from;
            assert!((low - axis.from).abs() < 1e-9 * length);
            assert!((high - axis.to).abs() < 1e-9 * length);
            let on = compared.iter().filter(|p| p[at] == low).count();
            assert!(on > CHECKS / 50 && on < CHECKS / 5, "{on}");
        }
    }

    #[test]
    fn one_height_is_one_plane() {
        let mut axes = AXES;
        axes[2].to = axes[2].from;
        let places = fitted_places(axes, 0.0);
        assert!(places.iter().all(|p| p[2] == 0.01));
        let size = size_at(&[(0.01, [2.0, 3.0])], 0.0, 0.01);
        assert_eq!(size, [2.0, 3.0]);
    }

    #[test]
    fn powers_of_the_distance_are_followed() {
        let law = |z: f64| [0.7 * (z - 0.002).powf(-2.3), 1.3 * (z - 0.002).powf(-3.1)];
        let heights: Vec<(f64, [f64; 2])> = [0.01, 0.02, 0.05].map(|z| (z, law(z))).to_vec();
        for z in [0.01, 0.013, 0.03, 0.05] {
            let (size, want) = (size_at(&heights, 0.002, z), law(z));
            for k in 0..2 {
                assert!((size[k] / want[k] - 1.0).abs() < 1e-12);
            }
        }
    }
}
