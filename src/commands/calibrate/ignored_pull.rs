//! The unpowered steel's pull where the design has cores and does not count it: how large it is.

use crate::RunError;
use crate::bundle::headline::SIDEWAYS_PULL;
use crate::bundle::lambda_file::LambdaFile;
use crate::bundle::manifest::LeftOut;
use crate::commands::lambda::{ForcePoints, LambdaReport};
use crate::scene::Scene;
use crate::scene::cached_field::ShapeField;
use crate::scene::coupled;
use crate::scene::passive::couples_left_out;
use crate::units::DETECTION_THRESHOLD_N;

/// Shares that differ by no more than this factor are one.
const SAME: f64 = 1.0 + 1e-9;

/// The pull at an object's points.
pub(crate) enum IgnoredPull {
    /// Computed.
    Measured(Measured),
    /// Why it cannot be.
    Unknown(String),
}

/// Its size.
pub(crate) struct Measured {
    /// The largest of its vertical force at a point, N.
    largest_n: f64,
    /// The largest requested force, N; 0 where there is no force constant.
    wanted_n: f64,
    /// Whether coupled cores were taken one by one, being many.
    one_by_one: bool,
    /// Where its share of the requested force is largest; `None` where no force is requested.
    weakest: Option<Share>,
}

/// The pull against the requested force.
#[derive(Clone, Copy)]
struct Share {
    share: f64,
    point: usize,
    pull_n: f64,
}

impl IgnoredPull {
    /// `None` without steel, or where the pull is counted.
    ///
    /// # Errors
    /// Interruption.
    pub(crate) fn new(
        scene: &Scene,
        lambda: &LambdaReport,
        points: &ForcePoints,
        field: ShapeField,
    ) -> Result<Option<Self>, RunError> {
        if scene.design.magnet.passive_force || scene.steel_extent_m().is_none() {
            return Ok(None);
        }
        let forces_n = match field.pull_left_out_n(scene, &points.positions_m) {
            Ok(forces_n) => forces_n,
            Err(RunError::Interrupted(stop)) => return Err(stop.into()),
            Err(fault) => return Ok(Some(Self::Unknown(fault.to_string()))),
        };
        let constant = lambda.file.lambda_n_per_m.unwrap_or(0.0);
        let mut measured = Measured::new(&forces_n, constant, &points.height_m);
        measured.one_by_one = coupled(scene.design) && !couples_left_out(scene);
        Ok(Some(Self::Measured(measured)))
    }

    /// The manifest's entry.
    pub(crate) fn left_out(&self) -> LeftOut {
        const OFF: &str = "magnet.passive_force = false";
        let (why, error_cost) = match self {
            Self::Measured(pull) => (format!("{OFF}; {}", pull.size()), Some(pull.cost())),
            Self::Unknown(why) => (format!("{OFF}; its size is not known: {why}"), None),
        };
        LeftOut {
            what: "pull of the unpowered steel".to_owned(),
            why,
            error_cost,
        }
    }

    /// A sentence where a finger may notice the pull.
    pub(crate) fn warning(&self, jnd: f64) -> Option<String> {
        match self {
            Self::Measured(pull) => pull.warning(jnd),
            Self::Unknown(why) => Some(format!(
                "the pull of the unpowered steel is left out (magnet.passive_force = false), and its size is not \
                 known: {why}"
            )),
        }
    }
}

/// The sideways pull where the upward one is counted; `None` where it is not, or without currents.
pub(crate) fn sideways_left_out(file: &LambdaFile) -> Option<LeftOut> {
    let error_cost = Some(file.sideways?.pull_share?);
    Some(LeftOut {
        what: SIDEWAYS_PULL.to_owned(),
        why: "requests and currents count the upward one alone; the cost is relative to the requested force, \
              root mean square, from a hundred points"
            .to_owned(),
        error_cost,
    })
}

impl Measured {
    fn new(forces_n: &[f64], lambda_n_per_m: f64, height_m: &[f64]) -> Self {
        let shares = forces_n.iter().zip(height_m).enumerate();
        let shares = shares.filter_map(|(point, (force, height))| {
            let (wanted_n, pull_n) = (lambda_n_per_m * height, force.abs());
            (wanted_n > 0.0).then(|| Share {
                share: pull_n / wanted_n,
                point,
                pull_n,
            })
        });
        Self {
            largest_n: forces_n.iter().fold(0.0, |most, f| most.max(f.abs())),
            wanted_n: lambda_n_per_m * height_m.iter().copied().fold(0.0, f64::max),
            one_by_one: false,
            // Of shares that differ by a rounding, as those of symmetric places do, the first.
            weakest: shares.reduce(|a, b| if b.share > SAME * a.share { b } else { a }),
        }
    }

    fn size(&self) -> String {
        let share = self.weakest.map_or_else(String::new, |at| {
            format!(
                ", up to {} of the requested force ({} at point {}); the cost is relative to \
                 the largest requested force",
                percent(at.share),
                millinewtons(at.pull_n),
                at.point
            )
        });
        format!(
            "up to {} at the points{share}",
            millinewtons(self.largest_n)
        )
    }

    /// Relative to the largest requested force.
    fn cost(&self) -> f64 {
        if self.wanted_n > 0.0 {
            self.largest_n / self.wanted_n
        } else {
            0.0
        }
    }

    fn warning(&self, jnd: f64) -> Option<String> {
        let at = self.weakest?;
        (at.share > jnd && at.pull_n > DETECTION_THRESHOLD_N).then(|| {
            format!(
                "the unpowered steel pulls the magnet with {} at point {}, {} of the force \
                 requested there, and that is left out (magnet.passive_force = false): more than the \
                 just-noticeable {}; set it to true to count it",
                millinewtons(at.pull_n),
                at.point,
                percent(at.share),
                percent(jnd)
            )
        })
    }
}

/// As many digits as are known.
fn millinewtons(force_n: f64) -> String {
    let force_mn = force_n * 1e3;
    let decimals = if force_mn >= 10.0 { 1 } else { 2 };
    format!("{force_mn:.decimals$} mN")
}

fn percent(share: f64) -> String {
    format!("{:.1} %", share * 100.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bundle once said nothing of a pull of half the requested force.
    #[test]
    fn a_pull_that_is_left_out_is_named_with_its_size() {
        let pull = IgnoredPull::Measured(Measured::new(&[-0.013, -0.0275], 0.9, &[0.07, 0.031]));
        let entry = pull.left_out();
        assert_eq!(entry.what, "pull of the unpowered steel");
        for part in ["27.5 mN", "98.6 %", "point 1"] {
            assert!(entry.why.contains(part), "{}", entry.why);
        }
        assert!((entry.error_cost.unwrap() - 0.0275 / 0.063).abs() < 1e-12);
        assert!(pull.warning(0.07).is_some_and(|w| w.contains("98.6 %")));
        assert!(pull.warning(1.0).is_none());
        // Not known is not nothing: it was 0, without a word on the screen.
        let unknown = IgnoredPull::Unknown("a wall beside the array is higher".to_owned());
        assert_eq!(unknown.left_out().error_cost, None);
        assert!(unknown.warning(0.07).is_some_and(|w| w.contains("a wall")));
        // Below what a finger feels there is nothing to warn of.
        assert!(
            IgnoredPull::Measured(Measured::new(&[7e-4], 0.1, &[0.03]))
                .warning(0.07)
                .is_none()
        );
    }
}
