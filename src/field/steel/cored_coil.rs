//! One winding with its linear core.
//!
//! In the core H = -grad u, u = phi_c + phi_M: the winding's scalar potential (its field is
//! curl-free there) and the steel's. With chi = mu_r - 1 and v = chi u the steel is a double
//! layer of density v on its outline, and
//!
//! ```text
//! (1/mu_r) v + (1 - 1/mu_r) W v = (1 - 1/mu_r) phi_c     on the outline,
//! ```
//!
//! up to a constant in u, which is no field: fixed by a zero mean. Unlike the surface charge,
//! v is bounded at the edges (rho^(2/3) instead of rho^(-1/3)), tends to a limit as mu_r grows,
//! and vanishes like chi as mu_r tends to one.

use nalgebra::{DMatrix, DVector};

use super::bore::{bore_field, nested_bore_fields};
use super::double_layer::operators;
use super::generatrix::{Face, Generatrix, Node, Resolution};
use super::magnetized::MagnetizedCore;
use super::response::{mean, system};
use super::{CLOSEST, CoreShape};
use crate::winding::{AxialField, OnEdge, Winding};
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::gauss;
use fluxform_numerics::lagrange_basis::Basis;

/// The winding's scalar potential and normal flux density on a core's outline, per ampere.
#[derive(Debug, Clone)]
pub struct Excitation {
    /// phi_c with H = -grad phi_c, A/A, zero at the first node's panel start.
    pub potential: DVector<f64>,
    /// n . B, T/A.
    pub normal_field_t_per_a: Vec<f64>,
}

impl Excitation {
    /// Samples the winding's field along the outline, to `tolerance` of one end's, and integrates
    /// its tangential part.
    ///
    /// # Errors
    /// A node on the winding's edge.
    pub fn new(winding: &Winding, outline: &Generatrix, tolerance: f64) -> Result<Self, OnEdge> {
        let field = |node: &Node| bore_field(winding, node.r_m, node.z_m, tolerance);
        let fields: Vec<_> = outline.nodes.iter().map(field).collect::<Result<_, _>>()?;
        Ok(Self::of_fields(outline, |node| fields[node]))
    }

    /// The same for windings that share inner radius and length, outer radii ascending.
    ///
    /// # Errors
    /// A node on a winding's edge.
    pub fn nested(
        windings: &[Winding],
        outline: &Generatrix,
        tolerance: f64,
    ) -> Result<Vec<Self>, OnEdge> {
        let fields = |node: &Node| nested_bore_fields(windings, node.r_m, node.z_m, tolerance);
        let fields: Vec<_> = outline.nodes.iter().map(fields).collect::<Result<_, _>>()?;
        let of = |index: usize| Self::of_fields(outline, |node| fields[node][index]);
        Ok((0..windings.len()).map(of).collect())
    }

    /// From (B_r, B_z) at the outline's nodes.
    fn of_fields(outline: &Generatrix, field: impl Fn(usize) -> (f64, f64)) -> Self {
        let order = outline.order;
        let basis = Basis::new(gauss::rule(order));
        let integral = basis.integral();
        let mut potential = Vec::with_capacity(outline.nodes.len());
        let mut normal_field_t_per_a = Vec::with_capacity(outline.nodes.len());
        let mut start = 0.0;
        for (index, panel) in outline.panels.iter().enumerate() {
            let mut tangential = Vec::with_capacity(order);
            for place in index * order..(index + 1) * order {
                let node = &outline.nodes[place];
                let (b_r, b_z) = field(place);
                normal_field_t_per_a.push(node.normal[0] * b_r + node.normal[1] * b_z);
                tangential.push(match panel.face {
                    Face::Bottom => b_r,
                    Face::Side => b_z,
                    Face::Top => -b_r,
                });
            }
            let scale = 0.5 * panel.length_m() / MU_0_T_M_PER_A;
            let rise =
                |row: &[f64]| scale * row.iter().zip(&tangential).map(|(a, b)| a * b).sum::<f64>();
            potential.extend(integral[..order].iter().map(|row| start - rise(row)));
            start -= rise(&integral[order]);
        }
        Self {
            potential: DVector::from_vec(potential),
            normal_field_t_per_a,
        }
    }
}

impl Excitation {
    /// Flux through the winding from a layer of one ampere on each node, Wb/A.
    #[must_use]
    pub(crate) fn flux_weights_wb_per_a(&self, outline: &Generatrix) -> DVector<f64> {
        let weights = outline
            .areas_m2()
            .zip(&self.normal_field_t_per_a)
            .map(|(area, b)| -area * b);
        DVector::from_iterator(outline.nodes.len(), weights)
    }
}

/// One winding with its core, per ampere.
#[derive(Debug, Clone)]
pub struct CoredCoil {
    /// The winding.
    pub winding: Winding,
    /// The magnetised core, per ampere.
    pub core: MagnetizedCore,
    /// The core's part of the winding's inductance, H.
    pub added_inductance_h: f64,
    /// Estimated error: of the gradient above, relative to the largest |grad B| at its height,
    /// and of the added inductance; the larger. Twice the difference from the next coarser
    /// resolution, whose error is three to eight times larger as a rule, and nearly as small by
    /// chance.
    pub relative_error: f64,
    /// The core by the next coarser resolution, of a coil whose error is estimated.
    pub(super) coarser: Option<Box<MagnetizedCore>>,
}

/// Refinements after which a tolerance that is not reached is given up, with its estimate.
const MAX_REFINEMENTS: usize = 5;
/// Refinements in a row that bring no smaller error, after which no further one is tried: two
/// solutions may differ more than coarser ones by chance.
const NO_BETTER: usize = 2;
/// Times the difference of two resolutions an error is stated, for those that lie close to each
/// other by chance.
const CHANCE: f64 = 2.0;
/// Distance above the core, in radii, below which [`CoredCoil::new`] estimates no error.
const CLOSEST_ABOVE: f64 = 0.1;
/// Distances from the steel, in units of [`CLOSEST`] times its radius, at which errors are compared.
const DISTANCES: [f64; 5] = [1.0, 3.0, 10.0, 50.0, 200.0];

/// Places (r, z) about a core at which two resolutions are compared, one list for each height.
fn planes_around(shape: CoreShape) -> Vec<Vec<[f64; 2]>> {
    let CoreShape {
        radius_m,
        bottom_m,
        top_m,
    } = shape;
    let mut planes = Vec::new();
    for distance_m in DISTANCES.map(|d| d * CLOSEST * radius_m) {
        // The ends: on the axis, above the face, above the edge and beyond it.
        for z_m in [top_m + distance_m, bottom_m - distance_m] {
            let across = [0.0, 0.8 * radius_m, radius_m, radius_m + distance_m];
            planes.push(across.map(|r_m| [r_m, z_m]).to_vec());
        }
        // The side: at the edges, half a radius below them, and at the middle.
        let inwards = (0.5 * radius_m).min(0.5 * shape.length_m());
        for z_m in [
            top_m,
            top_m - inwards,
            0.5 * (top_m + bottom_m),
            bottom_m + inwards,
            bottom_m,
        ] {
            let across = [radius_m + CLOSEST * radius_m, radius_m + distance_m];
            planes.push(across.map(|r_m| [r_m, z_m]).to_vec());
        }
    }
    planes
}

impl CoredCoil {
    /// The resolution that [`CoredCoil::new`] tries first for `tolerance`, and ends with as a rule.
    #[must_use]
    pub fn first_resolution(tolerance: f64) -> Resolution {
        Resolution::for_tolerance(tolerance / CHANCE)
    }

    /// Solves to an estimated error below `tolerance` at heights from `lowest_m` up, or as far as
    /// doubles carry: [`CoredCoil::relative_error`] says what was reached.
    ///
    /// Domain: mu_r > 0; the core in the bore, touching allowed. The estimate is made no closer
    /// to the core's top than a tenth of its radius.
    ///
    /// # Errors
    /// A node on the winding's edge.
    pub fn new(
        winding: &Winding,
        shape: CoreShape,
        relative_permeability: f64,
        tolerance: f64,
        lowest_m: f64,
    ) -> Result<Self, OnEdge> {
        let closest_m = shape.top_m.max(0.0) + CLOSEST_ABOVE * shape.radius_m;
        let lowest_m = lowest_m.max(closest_m);
        let planes = [0.0, 1.0, 4.0].map(|height| {
            let z_m = lowest_m + height * shape.radius_m;
            [0.0, 0.8, 1.7]
                .map(|across| [across * shape.radius_m, z_m])
                .to_vec()
        });
        let pair = |aim| {
            let fine = Resolution::for_tolerance(aim);
            [fine, fine.coarser()]
        };
        Self::refined(
            winding,
            shape,
            relative_permeability,
            tolerance,
            &planes,
            pair,
        )
    }

    /// As [`CoredCoil::new`], with the estimate of the gradient's error valid everywhere outside
    /// winding and steel, as close to the steel as [`CLOSEST`] of its radius.
    ///
    /// # Errors
    /// A node on the winding's edge.
    pub fn everywhere(
        winding: &Winding,
        shape: CoreShape,
        relative_permeability: f64,
        tolerance: f64,
    ) -> Result<Self, OnEdge> {
        let planes = planes_around(shape);
        let pair = |aim| {
            let fine = Resolution::near_steel(aim);
            [fine, fine.coarser_near_steel()]
        };
        Self::refined(
            winding,
            shape,
            relative_permeability,
            tolerance,
            &planes,
            pair,
        )
    }

    /// Solves to an estimated error below `tolerance` at `planes`: places (r, z) of one height
    /// each, whose errors are relative to the largest |grad B| among them; `pair` gives the
    /// resolutions, fine and coarse, for an aim.
    fn refined(
        winding: &Winding,
        shape: CoreShape,
        relative_permeability: f64,
        tolerance: f64,
        planes: &[Vec<[f64; 2]>],
        pair: impl Fn(f64) -> [Resolution; 2],
    ) -> Result<Self, OnEdge> {
        let mut aim = tolerance / CHANCE;
        let (mut best, mut no_better) = (None::<Self>, 0);
        for _ in 0..=MAX_REFINEMENTS {
            let [fine, coarse] = pair(aim);
            let solve =
                |r: &Resolution| Self::at_resolution(winding, shape, relative_permeability, r);
            let coarse = solve(&coarse)?;
            let mut fine = solve(&fine)?;
            fine.relative_error = CHANCE * fine.difference(&coarse, planes);
            fine.coarser = Some(Box::new(coarse.core));
            let better = best
                .as_ref()
                .is_none_or(|b| fine.relative_error < b.relative_error);
            let error = fine.relative_error;
            let reached = error <= tolerance;
            if better {
                best = Some(fine);
                no_better = 0;
            } else {
                no_better += 1;
            }
            if reached || no_better == NO_BETTER {
                break;
            }
            aim *= (0.5 * tolerance / error).clamp(0.01, 0.5);
        }
        Ok(best.expect("at least one resolution was solved"))
    }

    /// Largest difference of the gradients at `planes`, relative to the largest |grad B| of each,
    /// and of the added inductances.
    fn difference(&self, other: &Self, planes: &[Vec<[f64; 2]>]) -> f64 {
        let mut worst = 0.0_f64;
        for plane in planes {
            let (mut size, mut difference) = (0.0_f64, 0.0_f64);
            for [r_m, z_m] in plane {
                let (a, b) = (self.core.field(*r_m, *z_m), other.core.field(*r_m, *z_m));
                // On the winding's own edge its gradient is unbounded; the steel's is what differs.
                let total = self.field(*r_m, *z_m).unwrap_or(a);
                size = size.max(total.gradient_norm());
                difference = difference
                    .max((a.dbz_dz - b.dbz_dz).abs())
                    .max((a.dbr_dz - b.dbr_dz).abs())
                    .max((a.br_over_r - b.br_over_r).abs());
            }
            worst = worst.max(difference / size);
        }
        let added = self.added_inductance_h;
        // Against a tenth of the least inductance the winding can have: N^2 mu_0 a / 10.
        let size = added
            .abs()
            .max(0.1 * MU_0_T_M_PER_A * self.winding.turns.powi(2) * self.winding.inner_radius_m);
        worst.max((added - other.added_inductance_h).abs() / size)
    }

    /// Solves at one resolution.
    ///
    /// # Errors
    /// A node on the winding's edge.
    pub fn at_resolution(
        winding: &Winding,
        shape: CoreShape,
        relative_permeability: f64,
        resolution: &Resolution,
    ) -> Result<Self, OnEdge> {
        let mut family = Self::family(&[*winding], shape, relative_permeability, resolution)?;
        Ok(family.remove(0))
    }

    /// Solves several windings around one core at one resolution: the outline's operator is set
    /// up and factorised once.
    ///
    /// Domain: windings that differ in outer radius and turns only, outer radii ascending; at least
    /// one.
    ///
    /// # Errors
    /// A node on a winding's edge.
    pub fn family(
        windings: &[Winding],
        shape: CoreShape,
        relative_permeability: f64,
        resolution: &Resolution,
    ) -> Result<Vec<Self>, OnEdge> {
        let Some(first) = windings.first() else {
            return Ok(Vec::new());
        };
        let outline = Generatrix::of_coil(first, shape, resolution);
        let excitations = match windings {
            [winding] => vec![Excitation::new(winding, &outline, resolution.quadrature)?],
            _ => Excitation::nested(windings, &outline, resolution.quadrature)?,
        };
        let w = operators(&outline, 1, resolution.quadrature).remove(0);
        let potentials: Vec<DVector<f64>> =
            excitations.iter().map(|e| e.potential.clone()).collect();
        let densities = densities(&outline, w, relative_permeability, &potentials);
        let coils = windings.iter().zip(&excitations).zip(densities);
        Ok(coils
            .map(|((winding, excitation), density)| {
                let added_inductance_h = -outline
                    .areas_m2()
                    .zip(density.iter())
                    .zip(&excitation.normal_field_t_per_a)
                    .map(|((area, v), b)| area * v * b)
                    .sum::<f64>();
                Self {
                    winding: *winding,
                    core: MagnetizedCore::new(outline.clone(), density.as_slice().to_vec()),
                    added_inductance_h,
                    relative_error: f64::NAN,
                    coarser: None,
                }
            })
            .collect())
    }

    /// Field and gradient per ampere.
    ///
    /// # Errors
    /// A point on the winding's edge.
    pub fn field(&self, r_m: f64, z_m: f64) -> Result<AxialField, OnEdge> {
        Ok(self.winding.field(r_m, z_m)? + self.core.field(r_m, z_m))
    }
}

/// v on the nodes for each potential, mean zero.
pub(super) fn densities(
    outline: &Generatrix,
    w: DMatrix<f64>,
    relative_permeability: f64,
    potentials: &[DVector<f64>],
) -> Vec<DVector<f64>> {
    let share = (relative_permeability - 1.0) / relative_permeability;
    let factors = system(outline, w, relative_permeability, 0).lu();
    potentials
        .iter()
        .map(|potential| {
            let centred = potential.add_scalar(-mean(outline, potential.iter()));
            let mut density = factors
                .solve(&(centred * share))
                .expect("eigenvalues of W lie in [0, 1], so those of the matrix are positive");
            let shift = mean(outline, density.iter());
            density.add_scalar_mut(-shift);
            density
        })
        .collect()
}
