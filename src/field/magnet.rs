//! The magnet as it is: force and torque of a uniformly magnetised cylinder in any field that is
//! harmonic where the magnet is.
//!
//! With charges M.n on the end faces (or Ampere's currents on the side: the same) the force is
//! F = integral over the volume of (M . grad) B and the torque about the centre
//! tau = integral of M x B + r x (M . grad) B. Neither form subtracts large numbers, however small
//! the magnet is. Both are what a set of point dipoles on the quadrature's nodes feels, so a rule
//! *is* such a set: [`MagnetRule`] says where field and gradient are needed, and sums them.
//!
//! Outside its sources every component of grad B, and of n x B + r x dB/dn too, is harmonic. The
//! cylinder's mean of a harmonic function depends on its values on the cylinder's axis alone, so
//! few nodes, all on the axis, do (`magnet::axial`); they need a ball around the magnet free of sources.
//! Closer than that the volume itself is integrated (`magnet::solid`).
//!
//! Nodes for the seed's magnet, and the force's error in the field of the seed's winding 8 mm off
//! its axis, from `cargo test --test field magnet -- --nocapture the_table` (upright; tilted by 23 and
//! -41 degrees needs as many on the axis, more in the volume):
//!
//! | height | bound 1e-3 | 1e-6 | 1e-9 | 1e-12 |
//! |---|---|---|---|---|
//! | 10 mm | 119 (5e-7) | 476 (6e-11) | 1114 (2e-14) | 2323 (3e-15) |
//! | 20 mm | 5 (2e-5) | 11 (2e-9) | 19 (1e-13) | 663 (1e-15) |
//! | 30 mm | 4 (1e-4) | 7 (5e-9) | 13 (3e-12) | 371 (2e-15) |
//! | 50 mm | 2 (6e-5) | 5 (3e-7) | 9 (5e-11) | 13 (1e-14) |
//!
//! The bound is met within a factor of two by a point charge at the nearest place.

mod axial;
mod ends;
mod solid;

use thiserror::Error;

use super::dipole;
use fluxform_numerics::vec3::{cross, dot, plus};

/// A cylinder's size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cylinder {
    /// Diameter, m; > 0.
    pub diameter_m: f64,
    /// Length along the axis, m; > 0.
    pub length_m: f64,
}

impl Cylinder {
    /// Radius of the ball around the cylinder, m.
    #[must_use]
    pub fn reach_m(&self) -> f64 {
        0.5 * self.diameter_m.hypot(self.length_m)
    }

    /// As [`Cylinder::depth_m`] for the axis along a moment.
    #[must_use]
    pub fn depth_along_m(&self, moment_a_m2: [f64; 3]) -> f64 {
        self.depth_m(direction(moment_a_m2))
    }

    /// The mean over the cylinder of what falls off from the plane or ball of `sources` like
    /// the distance to the minus fourth, as a coil's gradient does at most, relative to its value
    /// at the centre; `axis` is the cylinder's, a unit vector. Domain: sources that it does not reach.
    ///
    /// An error of the field that stays below a part of the gradient at every height acts on the
    /// magnet by no more than that part times this: outside its sources it is harmonic, so
    /// that its mean is at most its largest value, whatever rule takes the mean.
    #[must_use]
    pub fn growth(&self, sources: Sources, axis: [f64; 3]) -> f64 {
        let part = sources.extent_m(*self, axis) / sources.distance_m();
        // ((1 - t)^-3 - (1 + t)^-3) / (6 t)
        let square = part * part;
        (1.0 + square / 3.0) / (1.0 - square).powi(3)
    }

    /// As [`Cylinder::growth`] for the axis along a moment.
    #[must_use]
    pub fn growth_along(&self, sources: Sources, moment_a_m2: [f64; 3]) -> f64 {
        self.growth(sources, direction(moment_a_m2))
    }

    /// How far below its centre a cylinder with axis `axis` (a unit vector) extends, m.
    #[must_use]
    pub fn depth_m(&self, axis: [f64; 3]) -> f64 {
        0.5 * (self.length_m * axis[2].abs() + self.diameter_m * axis[0].hypot(axis[1]))
    }
}

/// Where the field's sources (conductors, steel) may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sources {
    /// Anywhere below a horizontal plane that lies `height_m` under the magnet's centre.
    Below {
        /// Height of the magnet's centre above the highest source, m.
        height_m: f64,
    },
    /// Anywhere outside a ball around the magnet's centre.
    Beyond {
        /// Distance from the magnet's centre to the nearest source, m.
        distance_m: f64,
    },
}

impl Sources {
    /// Distance from the magnet's centre to the nearest source, m.
    #[must_use]
    pub fn distance_m(self) -> f64 {
        match self {
            Self::Below { height_m } => height_m,
            Self::Beyond { distance_m } => distance_m,
        }
    }

    /// Least distance from a cylinder's surface to a source, m; not positive where it may touch one.
    fn gap_m(self, size: Cylinder, axis: [f64; 3]) -> f64 {
        self.distance_m() - self.extent_m(size, axis)
    }

    /// How far a cylinder reaches from its centre towards the sources at most, m.
    fn extent_m(self, size: Cylinder, axis: [f64; 3]) -> f64 {
        match self {
            Self::Below { .. } => size.depth_m(axis),
            Self::Beyond { .. } => size.reach_m(),
        }
    }
}

/// Why there is no rule.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum NoRule {
    /// A size, distance or tolerance that is not a positive number, or a moment that is not finite.
    #[error("the magnet's size, its distance and the tolerance must be positive numbers")]
    NotANumber,
    /// The magnet touches a source or overlaps it.
    #[error("the magnet is {} mm from a field source (below 0: overlaps it), where there is no rule", 1e3 * gap_m)]
    Touches {
        /// Gap between magnet and source, m; not positive.
        gap_m: f64,
    },
    /// The gap to the nearest source is too small for the tolerance.
    #[error(
        "the gap of {:.6} mm between magnet and field source needs more than {MOST_NODES} points \
         for a relative tolerance of {tolerance:e}", gap_m * 1e3
    )]
    TooClose {
        /// Gap between magnet and source, m.
        gap_m: f64,
        /// The request.
        tolerance: f64,
    },
}

/// Most nodes of a rule.
pub const MOST_NODES: usize = 8192;

/// A point at which the caller evaluates the field, and the moment that stands for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    /// Offset from the magnet's centre, m.
    pub offset_m: [f64; 3],
    /// The node's share of the moment, A m^2; shares may be negative.
    pub moment_a_m2: [f64; 3],
}

/// A point of a magnet's ends, and the charge that stands for the magnetisation there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Charge {
    /// Offset from the magnet's centre, m.
    pub offset_m: [f64; 3],
    /// Charge: its potential at distance d is charge / (4 pi d), the force on it charge B, A m.
    pub charge_a_m: f64,
}

impl Cylinder {
    /// Charges that act as the cylinder does, and feel its force, with the bound of [`MagnetRule::cylinder`]. Close by they
    /// are far fewer than its nodes.
    ///
    /// # Errors
    /// As there.
    pub fn charges(
        self,
        moment_a_m2: [f64; 3],
        sources: Sources,
        tolerance: f64,
    ) -> Result<Vec<Charge>, NoRule> {
        let (cylinder, gap_m) = Placed::new(self, moment_a_m2, sources, tolerance)?;
        ends::charges(&cylinder, sources, tolerance).ok_or(NoRule::TooClose { gap_m, tolerance })
    }
}

/// Where a magnet needs the field, and what to do with it there.
#[derive(Debug, Clone, PartialEq)]
pub struct MagnetRule {
    nodes: Vec<Node>,
    /// The nodes' factors in a rule of the next lower degree, relative to the moment.
    lower: Option<Vec<f64>>,
    moment_a_m2: [f64; 3],
    bound: f64,
    amplification: f64,
}

impl MagnetRule {
    /// A point dipole: one node, the centre; nothing is approximated.
    #[must_use]
    pub fn dipole(moment_a_m2: [f64; 3]) -> Self {
        Self {
            nodes: vec![Node {
                offset_m: [0.0; 3],
                moment_a_m2,
            }],
            lower: None,
            moment_a_m2,
            bound: 0.0,
            amplification: 1.0,
        }
    }

    /// How far the dipoles are from the magnet's centre at most, m.
    #[must_use]
    pub fn reach_m(&self) -> f64 {
        self.nodes.iter().fold(0.0_f64, |reach, node| {
            let [x, y, z] = node.offset_m;
            reach.max(x.hypot(y).hypot(z))
        })
    }

    /// The cylinder, with the fewest nodes whose a-priori bound is at most `tolerance`.
    ///
    /// The moment's direction is the cylinder's axis. `tolerance` is relative to the gradient (or
    /// to the field, for a torque) at the magnet that the sources would make if all of them stood
    /// at the nearest distance and added up. Domain: tolerance at least about 1e-13.
    ///
    /// # Errors
    /// [`NoRule`] when the magnet may touch a source, or nearly so.
    pub fn cylinder(
        size: Cylinder,
        moment_a_m2: [f64; 3],
        sources: Sources,
        tolerance: f64,
    ) -> Result<Self, NoRule> {
        let (cylinder, gap_m) = Placed::new(size, moment_a_m2, sources, tolerance)?;
        axial::rule(&cylinder, sources.distance_m(), tolerance)
            .or_else(|| solid::rule(&cylinder, sources, gap_m, tolerance))
            .ok_or(NoRule::TooClose { gap_m, tolerance })
    }

    /// As [`MagnetRule::cylinder`], with nodes all over the magnet: more of them than on its axis alone, and errors of
    /// the field hardly grow.
    ///
    /// # Errors
    /// As [`MagnetRule::cylinder`].
    pub fn throughout_cylinder(
        size: Cylinder,
        moment_a_m2: [f64; 3],
        sources: Sources,
        tolerance: f64,
    ) -> Result<Self, NoRule> {
        let (cylinder, gap_m) = Placed::new(size, moment_a_m2, sources, tolerance)?;
        solid::rule(&cylinder, sources, gap_m, tolerance)
            .ok_or(NoRule::TooClose { gap_m, tolerance })
    }

    /// The nodes.
    #[must_use]
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// A-priori bound of the error, relative as [`MagnetRule::cylinder`] says.
    #[must_use]
    pub fn bound(&self) -> f64 {
        self.bound
    }

    /// Sum of the shares' magnitudes over the moment: the factor by which errors of the
    /// gradients given to the rule can grow.
    #[must_use]
    pub fn amplification(&self) -> f64 {
        self.amplification
    }

    /// Whether the moment is vertical, so that dB_z/dz alone gives the vertical force.
    #[must_use]
    pub fn is_upright(&self) -> bool {
        self.moment_a_m2[0] == 0.0 && self.moment_a_m2[1] == 0.0
    }

    /// Force, N, from the gradients `[i][j]` = dB_i/dx_j at the nodes, in their order.
    ///
    /// # Panics
    /// Like all sums here: when the number of entries is not that of the nodes.
    #[must_use]
    pub fn force_n(&self, gradients_t_per_m: &[[[f64; 3]; 3]]) -> [f64; 3] {
        self.expect(gradients_t_per_m.len());
        self.nodes
            .iter()
            .zip(gradients_t_per_m)
            .fold([0.0; 3], |sum, (node, gradient)| {
                plus(sum, dipole::force_n(node.moment_a_m2, *gradient))
            })
    }

    /// Torque about the centre, N m, from fields and gradients at the nodes:
    /// sum of m_k x B_k + r_k x F_k.
    #[must_use]
    pub fn torque_n_m(
        &self,
        fields_t: &[[f64; 3]],
        gradients_t_per_m: &[[[f64; 3]; 3]],
    ) -> [f64; 3] {
        self.expect(fields_t.len());
        self.expect(gradients_t_per_m.len());
        self.nodes.iter().zip(fields_t).zip(gradients_t_per_m).fold(
            [0.0; 3],
            |sum, ((node, field), gradient)| {
                let lever = cross(node.offset_m, dipole::force_n(node.moment_a_m2, *gradient));
                plus(sum, plus(cross(node.moment_a_m2, *field), lever))
            },
        )
    }

    /// Vertical force of an upright magnet, N, from dB_z/dz at the nodes.
    ///
    /// # Panics
    /// Also when the magnet is tilted ([`MagnetRule::is_upright`]): then more of the gradient
    /// matters.
    #[must_use]
    pub fn vertical_force_n(&self, dbz_dz_t_per_m: &[f64]) -> f64 {
        assert!(
            self.is_upright(),
            "a tilted magnet needs the gradient of B_z"
        );
        self.expect(dbz_dz_t_per_m.len());
        self.nodes
            .iter()
            .zip(dbz_dz_t_per_m)
            .map(|(node, g)| node.moment_a_m2[2] * g)
            .sum()
    }

    /// Vertical force of any magnet, N, from grad B_z at the nodes (equal to dB/dz, as curl B = 0).
    #[must_use]
    pub fn vertical_force_of_rows_n(&self, grad_bz_t_per_m: &[[f64; 3]]) -> f64 {
        self.expect(grad_bz_t_per_m.len());
        self.nodes
            .iter()
            .zip(grad_bz_t_per_m)
            .map(|(node, row)| dot(node.moment_a_m2, *row))
            .sum()
    }

    /// How much a rule of the next lower degree on the same nodes differs in `force_n`, as the
    /// length of the difference, N: an estimate of that rule's error, so more than this one's.
    /// `None` where no lower rule is at hand; then there is the bound alone.
    #[must_use]
    pub fn force_of_orders_differs_n(&self, gradients_t_per_m: &[[[f64; 3]; 3]]) -> Option<f64> {
        self.expect(gradients_t_per_m.len());
        let lower = self.lower.as_ref()?;
        let coarse =
            lower
                .iter()
                .zip(gradients_t_per_m)
                .fold([0.0; 3], |sum, (factor, gradient)| {
                    let share = self.moment_a_m2.map(|m| factor * m);
                    plus(sum, dipole::force_n(share, *gradient))
                });
        let fine = self.force_n(gradients_t_per_m);
        let difference: [f64; 3] = std::array::from_fn(|i| fine[i] - coarse[i]);
        Some(dot(difference, difference).sqrt())
    }

    fn expect(&self, given: usize) {
        assert_eq!(given, self.nodes.len(), "one entry a node");
    }
}

/// A cylinder with its axis and moment.
struct Placed {
    size: Cylinder,
    axis: [f64; 3],
    moment_a_m2: [f64; 3],
}

impl Placed {
    /// A cylinder clear of its sources, and its gap to them, m.
    fn new(
        size: Cylinder,
        moment_a_m2: [f64; 3],
        sources: Sources,
        tolerance: f64,
    ) -> Result<(Self, f64), NoRule> {
        let positive = [size.diameter_m, size.length_m, tolerance]
            .iter()
            .all(|v| v.is_finite() && *v > 0.0);
        let is_number = !sources.distance_m().is_nan() && moment_a_m2.iter().all(|v| v.is_finite());
        if !positive || !is_number {
            return Err(NoRule::NotANumber);
        }
        let axis = direction(moment_a_m2);
        let gap_m = sources.gap_m(size, axis);
        if gap_m <= 0.0 {
            return Err(NoRule::Touches { gap_m });
        }
        let placed = Self {
            size,
            axis,
            moment_a_m2,
        };
        Ok((placed, gap_m))
    }
}

/// Unit vector along a moment; upright for none.
fn direction(moment_a_m2: [f64; 3]) -> [f64; 3] {
    // Scaled first: squares of tiny moments would vanish.
    let largest = moment_a_m2.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    if largest == 0.0 {
        return [0.0, 0.0, 1.0];
    }
    let scaled = moment_a_m2.map(|v| v / largest);
    let norm = dot(scaled, scaled).sqrt();
    scaled.map(|v| v / norm)
}
