//! The error of forces that are evaluated at the points directly.

use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::design::MagnetModel;
use crate::field::winding::KERNEL_ERROR;
use crate::scene::evaluation_sample::{Evaluation, Sample, compared, sharper, sharper_forces};
use crate::scene::steel::{EVALUATION_SHARE, Solved};
use crate::scene::tolerances::MAGNET_FINEST;
use crate::scene::{AIR_SHARE, MAGNET_SHARE, Scene};

/// The error of forces at some points: the proven bound, or a sharper estimate from samples.
///
/// # Errors
/// Interruption.
pub(super) fn forces_accuracy(
    scene: &Scene,
    solved: &Solved,
    points_m: &[[f64; 3]],
    forces_n_per_a: &[f64],
) -> Result<StageAccuracy, RunError> {
    let proven = evaluation(scene, solved);
    let [m_x, m_y, m_z] = scene.moment_a_m2;
    let coils = scene.coils.len();
    if scene.design.magnet.model == MagnetModel::Cylinder {
        let given = |point: usize, coil: usize| [forces_n_per_a[point * coils + coil]];
        let estimate = sharper_forces(scene, solved, points_m, given, proven)?;
        return Ok(accuracy_of(scene, solved, estimate));
    }
    if m_x != 0.0 || m_y != 0.0 || m_z == 0.0 {
        return Ok(accuracy_of(scene, solved, proven));
    }
    let r_m = |index: usize| {
        let ([x_m, y_m, _], coil) = (points_m[index / coils], &scene.coils[index % coils]);
        (x_m - coil.axis_m[0]).hypot(y_m - coil.axis_m[1])
    };
    let samples = compared(scene, solved, forces_n_per_a.len(), r_m)
        .into_iter()
        .filter_map(|index| {
            let gain = scene.coils[index % coils].gain;
            (gain != 0.0).then(|| Sample {
                r_m: r_m(index),
                z_m: points_m[index / coils][2],
                gz: forces_n_per_a[index] / (gain * m_z),
            })
        });
    let estimate = sharper(scene, solved, samples, proven);
    Ok(accuracy_of(scene, solved, estimate))
}

/// The proven error of the forces and the estimated one of the steel.
pub(crate) fn proven_accuracy(scene: &Scene, solved: &Solved) -> StageAccuracy {
    accuracy_of(scene, solved, evaluation(scene, solved))
}

/// The proven error of evaluating the forces, the steel's solution left out.
fn evaluation(scene: &Scene, solved: &Solved) -> Evaluation {
    let rules = solved.tolerance.max(KERNEL_ERROR);
    let cylinder = scene.design.magnet.model == MagnetModel::Cylinder;
    let field = if solved.has_steel() {
        // The winding's rule and the steel's.
        2.0 * EVALUATION_SHARE * rules
    } else if cylinder {
        (AIR_SHARE * rules).max(KERNEL_ERROR)
    } else {
        rules
    };
    let magnet = if cylinder {
        MAGNET_SHARE * rules.max(MAGNET_FINEST)
    } else {
        0.0
    };
    Evaluation {
        estimate: field + magnet,
        method: "a-priori quadrature bound, evaluated at the points directly".to_owned(),
    }
}

fn accuracy_of(scene: &Scene, solved: &Solved, evaluation: Evaluation) -> StageAccuracy {
    let Evaluation { estimate, method } = evaluation;
    StageAccuracy {
        estimate: estimate + solved.steel_error,
        relative_to: match (solved.has_steel(), scene.design.magnet.model) {
            (true, MagnetModel::Cylinder) => {
                "the largest |grad B| at each height of the magnet, averaged over it"
            }
            (false, _) | (_, MagnetModel::Dipole) => "the largest |grad B| at the point's height",
        }
        .to_owned(),
        method: match solved.steel_method() {
            None => method,
            Some(steel) => format!("{steel}; {method}"),
        },
    }
}
