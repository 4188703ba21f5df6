//! The predicted scan: the field of the driven coils where the sensor was.

use std::f64::consts::FRAC_PI_2;

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
/// Steps of the gradient's differences, m.
const STEP_M: f64 = 1e-4;

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

    /// Derivative of the matrix by an angle, in whose sine and cosine it is linear.
    fn slope_of_matrix(self, angle: usize) -> Matrix {
        let quarter = |sense: f64| {
            let mut pose = self;
            pose.angles_rad[angle] += sense * FRAC_PI_2;
            pose.matrix()
        };
        let mut slope = Matrix::default();
        add(&mut slope, 0.5, &quarter(1.0));
        add(&mut slope, -0.5, &quarter(-1.0));
        slope
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

    fn offset_m(&self, p: &[f64; 3]) -> [f64; 3] {
        std::array::from_fn(|axis| p[axis] - self.middle_m[axis])
    }

    /// How far the scan reaches from its middle, m.
    fn extent_m(&self) -> f64 {
        let distance = |p: &[f64; 3]| {
            let [x, y, z] = self.offset_m(p);
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
            let from_m = self.offset_m(p);
            std::array::from_fn(|axis| {
                self.middle_m[axis] + dot(turn[axis], from_m) + pose.shift_m[axis]
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
        let fields = self.driven_fields(places, &self.positions_m(pose), progress)?;
        let turn = pose.matrix();
        let mut values = Vec::with_capacity(fields.len() * self.scan.quantities.len());
        for ((_, current_a), field) in self.currents_a().zip(&fields) {
            values.extend(self.measured(current_a, &turned(field, &turn)));
        }
        Ok(values)
    }

    /// Derivatives of [`Self::contributions`] by the three shifts, by m, and then by the three angles, by rad.
    ///
    /// Those of the field are exact, by its gradient: a turn that changes nothing is told from one that changes little.
    /// Those of the gradient are fourth-order differences.
    ///
    /// # Errors
    /// As of [`Self::contributions`].
    pub(super) fn slopes(
        &self,
        places: &FieldAt,
        pose: Pose,
        progress: &dyn Progress,
    ) -> Result<[Vec<f64>; 6], RunError> {
        let positions_m = self.positions_m(pose);
        let fields = self.driven_fields(places, &positions_m, progress)?;
        let gradient_slopes = self.gradient_slopes(places, &positions_m, progress)?;
        let turn = pose.matrix();
        let turns = [0, 1, 2].map(|angle| pose.slope_of_matrix(angle));
        let mut slopes: [Vec<f64>; 6] = std::array::from_fn(|_| Vec::new());
        for (pair, ((row, current_a), field)) in self.currents_a().zip(&fields).enumerate() {
            let from_m = self.offset_m(&self.scan.positions_m[row]);
            for (k, slope) in slopes.iter_mut().enumerate() {
                let motion = match k {
                    0..3 => Motion {
                        step: std::array::from_fn(|axis| f64::from(u8::from(axis == k))),
                        turn: Matrix::default(),
                    },
                    _ => Motion {
                        step: turns[k - 3].map(|row| dot(row, from_m)),
                        turn: turns[k - 3],
                    },
                };
                let change = motion.changes(field, gradient_slopes.get(pair), &turn);
                slope.extend(self.measured(current_a, &change));
            }
        }
        Ok(slopes)
    }

    /// Row and current, A, of every contribution.
    fn currents_a(&self) -> impl Iterator<Item = (usize, f64)> {
        let rows = self.scan.currents_a.iter().enumerate();
        rows.flat_map(|(row, currents)| {
            currents.iter().map(move |(_, current_a)| (row, *current_a))
        })
    }

    /// What a sensor that sees `seen` at 1 A measures, T or T/m.
    fn measured(&self, current_a: f64, seen: &CartesianField) -> impl Iterator<Item = f64> {
        let of = |quantity: &Measured| match *quantity {
            Measured::Field(i) => seen.field_t_per_a[i],
            Measured::Gradient(i, j) => seen.gradient_t_per_m_per_a[i][j],
        };
        self.scan.quantities.iter().map(move |q| current_a * of(q))
    }

    /// The field of the coil of every contribution.
    fn driven_fields(
        &self,
        places: &FieldAt,
        positions_m: &[[f64; 3]],
        progress: &dyn Progress,
    ) -> Result<Vec<CartesianField>, RunError> {
        let coils = self.scene.coils.len();
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
                let rows = currents.iter().enumerate();
                let of_row = |(row, currents): (usize, &'a Vec<(usize, f64)>)| {
                    let fields = &fields;
                    currents
                        .iter()
                        .map(move |(coil, _)| fields[row * coils + coil])
                };
                Ok(rows.flat_map(of_row).collect())
            })
            .collect::<Result<Vec<Vec<_>>, RunError>>()?;
        Ok(portions.concat())
    }

    /// Derivatives of every contribution's gradient along x, y and z, T/m^2/A; none where no gradient is measured.
    fn gradient_slopes(
        &self,
        places: &FieldAt,
        positions_m: &[[f64; 3]],
        progress: &dyn Progress,
    ) -> Result<Vec<[Matrix; 3]>, RunError> {
        let gradient = |measured: &Measured| matches!(measured, Measured::Gradient(..));
        if !self.scan.quantities.iter().any(gradient) {
            return Ok(Vec::new());
        }
        let mut slopes = vec![[Matrix::default(); 3]; self.pairs.len()];
        for axis in 0..3 {
            for (steps, weight) in [(1.0, 8.0), (-1.0, -8.0), (2.0, -1.0), (-2.0, 1.0)] {
                let mut moved_m = positions_m.to_vec();
                moved_m.iter_mut().for_each(|p| p[axis] += steps * STEP_M);
                let fields = self.driven_fields(places, &moved_m, progress)?;
                for (slope, field) in slopes.iter_mut().zip(&fields) {
                    let share = weight / (12.0 * STEP_M);
                    add(&mut slope[axis], share, &field.gradient_t_per_m_per_a);
                }
            }
        }
        Ok(slopes)
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

/// A change of the sensor's place, by m or rad, and of its axes.
struct Motion {
    step: [f64; 3],
    turn: Matrix,
}

impl Motion {
    /// How what a sensor turned by `turn` sees changes:
    /// d(R' B) = dR' B + R' G dp and d(R' G R) = dR' G R + R' G dR + R' (sum_k dG/dx_k dp_k) R.
    fn changes(
        &self,
        field: &CartesianField,
        gradient_slopes: Option<&[Matrix; 3]>,
        turn: &Matrix,
    ) -> CartesianField {
        let gradient = &field.gradient_t_per_m_per_a;
        let mut moved = CartesianField {
            field_t_per_a: gradient.map(|row| dot(row, self.step)),
            ..CartesianField::default()
        };
        for (slope, step) in gradient_slopes.into_iter().flatten().zip(self.step) {
            add(&mut moved.gradient_t_per_m_per_a, step, slope);
        }
        let mut change = turned(&moved, turn);
        for (i, by_place) in change.field_t_per_a.iter_mut().enumerate() {
            *by_place += dot(column(&self.turn, i), field.field_t_per_a);
        }
        for (left, right) in [(&self.turn, turn), (turn, &self.turn)] {
            let by_axes = between(left, gradient, right);
            add(&mut change.gradient_t_per_m_per_a, 1.0, &by_axes);
        }
        change
    }
}

/// As a sensor turned by `turn` sees it: R' B, R' G R.
fn turned(field: &CartesianField, turn: &Matrix) -> CartesianField {
    CartesianField {
        field_t_per_a: std::array::from_fn(|i| dot(column(turn, i), field.field_t_per_a)),
        gradient_t_per_m_per_a: between(turn, &field.gradient_t_per_m_per_a, turn),
    }
}

fn column(matrix: &Matrix, j: usize) -> [f64; 3] {
    [matrix[0][j], matrix[1][j], matrix[2][j]]
}

/// The transpose of `left`, times `matrix`, times `right`.
fn between(left: &Matrix, matrix: &Matrix, right: &Matrix) -> Matrix {
    let by_right: Matrix =
        std::array::from_fn(|i| std::array::from_fn(|j| dot(matrix[i], column(right, j))));
    std::array::from_fn(|i| std::array::from_fn(|j| dot(column(left, i), column(&by_right, j))))
}

fn add(sum: &mut Matrix, share: f64, term: &Matrix) {
    let terms = sum.iter_mut().flatten().zip(term.iter().flatten());
    terms.for_each(|(sum, term)| *sum += share * term);
}
