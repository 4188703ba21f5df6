//! The predicted scan: the field of the driven coils where the sensor was.

use rayon::prelude::*;

use super::units::reach_m;
use crate::RunError;
use crate::bundle::scan::{Measured, Scan};
use crate::commands::probe::FieldAt;
use crate::field::frame::CartesianField;
use crate::numerics::vec3::dot;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::steel::Solved;

/// Rows handed to one thread at a time; fixed, so that bytes do not depend on threads.
const PORTION: usize = 256;
/// Steps of differences along the sensor's shift, m.
pub(super) const STEP_M: f64 = 1e-4;

type Matrix = [[f64; 3]; 3];

/// Pose of the sensor's frame: turned about the scan's middle, then shifted.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Pose {
    /// m.
    pub(super) shift_m: [f64; 3],
    /// About x, then y, then z, rad.
    pub(super) angles_rad: [f64; 3],
}

impl Pose {
    /// Rz Ry Rx.
    fn matrix(self) -> Matrix {
        let [(sx, cx), (sy, cy), (sz, cz)] = self.angles_rad.map(f64::sin_cos);
        [
            [cy * cz, sx * sy * cz - cx * sz, cx * sy * cz + sx * sz],
            [cy * sz, sx * sy * sz + cx * cz, cx * sy * sz - sx * cz],
            [-sy, sx * cy, cx * cy],
        ]
    }
}

/// A scan over a solved scene.
pub(super) struct Model<'a> {
    scene: &'a Scene<'a>,
    solved: &'a Solved,
    scan: &'a Scan,
    middle_m: [f64; 3],
    /// Row and coil of every contribution, in the rows' order.
    pub(super) pairs: Vec<(usize, usize)>,
}

impl<'a> Model<'a> {
    pub(super) fn new(scene: &'a Scene<'a>, solved: &'a Solved, scan: &'a Scan) -> Self {
        let rows = scan.rows().max(1) as f64;
        let sum = |axis: usize| scan.positions_m.iter().map(|p| p[axis]).sum::<f64>();
        Self {
            scene,
            solved,
            scan,
            middle_m: std::array::from_fn(|axis| sum(axis) / rows),
            pairs: scan
                .currents_a
                .iter()
                .enumerate()
                .flat_map(|(row, currents)| currents.iter().map(move |(coil, _)| (row, *coil)))
                .collect(),
        }
    }

    /// How far the scan reaches from its middle, m.
    pub(super) fn extent_m(&self) -> f64 {
        let distance = |p: &[f64; 3]| {
            let [x, y, z]: [f64; 3] = std::array::from_fn(|axis| p[axis] - self.middle_m[axis]);
            x.hypot(y).hypot(z)
        };
        self.scan
            .positions_m
            .iter()
            .map(distance)
            .fold(0.0, f64::max)
    }

    /// Largest shift that leaves the scan over the array, wherever its coordinates begin, m.
    pub(super) fn farthest_shift_m(&self) -> f64 {
        let [x, y, z] = self.middle_m;
        x.hypot(y).hypot(z) + self.extent_m() + reach_m(self.scene.design)
    }

    fn positions_m(&self, pose: Pose) -> Vec<[f64; 3]> {
        let turn = pose.matrix();
        let placed = |p: &[f64; 3]| {
            let from: [f64; 3] = std::array::from_fn(|axis| p[axis] - self.middle_m[axis]);
            std::array::from_fn(|axis| {
                self.middle_m[axis] + dot(turn[axis], from) + pose.shift_m[axis]
            })
        };
        // Unturned positions stay as they were given, to the last bit.
        if pose == Pose::default() {
            return self.scan.positions_m.clone();
        }
        self.scan.positions_m.iter().map(placed).collect()
    }

    /// Source of the field at and around `pose`.
    ///
    /// # Errors
    /// A point on the steel.
    pub(super) fn places(&self, pose: Pose) -> Result<FieldAt<'a>, RunError> {
        let positions_m = self.positions_m(pose);
        FieldAt::new(self.scene, self.solved, &positions_m, 3.0 * STEP_M)
    }

    /// Part of each driven coil in each measured number, [pair, quantity], T or T/m.
    ///
    /// # Errors
    /// A point on a winding's edge; interruption.
    pub(super) fn contributions(
        &self,
        places: &FieldAt,
        pose: Pose,
        progress: &dyn Progress,
    ) -> Result<Vec<f64>, RunError> {
        let positions_m = self.positions_m(pose);
        let turn = pose.matrix();
        let portions = positions_m
            .par_chunks(PORTION)
            .zip(self.scan.currents_a.par_chunks(PORTION))
            .enumerate()
            .map(|(portion, (points, currents))| {
                progress.check()?;
                let driven = |row: usize, coil: usize| {
                    currents[row].iter().any(|(driven, _)| *driven == coil)
                };
                let fields = places.driven_fields(points, portion * PORTION + 1, &driven)?;
                let coils = self.scene.coils.len();
                let mut values = Vec::new();
                for (row, currents) in currents.iter().enumerate() {
                    for (coil, current_a) in currents {
                        let seen = turned(&fields[row * coils + coil], &turn);
                        let of = |quantity: &Measured| match *quantity {
                            Measured::Field(i) => seen.field_t_per_a[i],
                            Measured::Gradient(i, j) => seen.gradient_t_per_m_per_a[i][j],
                        };
                        values.extend(self.scan.quantities.iter().map(|q| current_a * of(q)));
                    }
                }
                Ok(values)
            })
            .collect::<Result<Vec<_>, RunError>>()?;
        Ok(portions.concat())
    }

    /// The contributions summed with a scale for each coil, [row, quantity].
    pub(super) fn sum(&self, contributions: &[f64], scale: impl Fn(usize) -> f64) -> Vec<f64> {
        let count = self.scan.quantities.len();
        let mut sums = vec![0.0; self.scan.values.len()];
        for ((row, coil), values) in self.pairs.iter().zip(contributions.chunks(count)) {
            let scale = scale(*coil);
            for (sum, value) in sums[row * count..].iter_mut().zip(values) {
                *sum += scale * value;
            }
        }
        sums
    }
}

/// As a sensor turned by `turn` sees it: R' B, R' G R.
fn turned(field: &CartesianField, turn: &Matrix) -> CartesianField {
    let column = |j: usize| [turn[0][j], turn[1][j], turn[2][j]];
    let g = &field.gradient_t_per_m_per_a;
    let g_r: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| dot(g[i], column(j))));
    CartesianField {
        field_t_per_a: std::array::from_fn(|i| dot(column(i), field.field_t_per_a)),
        gradient_t_per_m_per_a: std::array::from_fn(|i| {
            std::array::from_fn(|j| dot(column(i), [g_r[0][j], g_r[1][j], g_r[2][j]]))
        }),
    }
}
