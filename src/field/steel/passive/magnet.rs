//! The magnet that the steel pulls: a dipole or a cylinder, as point sources at a given height.

use super::NoPull;
use super::reaction::{Dipole, PointSource};
use crate::magnet::{Charge, Cylinder, MagnetRule, Node, Sources};

/// Height, in radii of the ball around the magnet, from which dipoles on its axis do.
const FAR_REACHES: f64 = 2.0;
/// Rules of up to so many nodes are used at every height: a change of rule is a small jump.
const ONE_RULE: usize = 32;
/// The pull's error over the bound of a rule's. The magnet's dipoles magnetise the steel and feel it: far from small steel,
/// where the pull falls with the seventh power of the distance, both together are off by so many times what one is in
/// the field of a charge, of which the bound is.
const BOTH: f64 = 8.0 / 3.0;
/// Part of the tolerance allowed to rules that change with the height.
const JUMPS: f64 = 0.3;

/// Moment and, where it is not a point, size of the magnet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassiveMagnet {
    moment_a_m2: [f64; 3],
    size: Option<Cylinder>,
    top_m: f64,
    lowest_m: f64,
    tolerance: f64,
    /// The height from which the magnet has one rule.
    fixed_m: f64,
}

impl PassiveMagnet {
    /// A magnet whose centre stays at `lowest_m` or higher, over steel that ends at `top_m`.
    ///
    /// # Errors
    /// A magnet that may touch the steel, or numbers that are not.
    pub fn new(
        moment_a_m2: [f64; 3],
        size: Option<Cylinder>,
        top_m: f64,
        lowest_m: f64,
        tolerance: f64,
    ) -> Result<Self, NoPull> {
        if !moment_a_m2.iter().all(|m| m.is_finite()) {
            return Err(NoPull::NotANumber);
        }
        let mut magnet = Self {
            moment_a_m2,
            size,
            top_m,
            lowest_m,
            tolerance: tolerance / BOTH,
            fixed_m: lowest_m,
        };
        if size.is_none() && lowest_m <= top_m {
            return Err(NoPull::TouchesSteel {
                gap_m: lowest_m - top_m,
            });
        }
        if magnet.try_rule(lowest_m)?.nodes().len() > ONE_RULE {
            magnet.fixed_m = f64::INFINITY;
            magnet.tolerance *= JUMPS;
            magnet.try_rule(lowest_m)?;
        }
        Ok(magnet)
    }

    /// The moment, A m^2.
    #[must_use]
    pub fn moment_a_m2(&self) -> [f64; 3] {
        self.moment_a_m2
    }

    /// Whether it is a point.
    #[must_use]
    pub(crate) fn is_dipole(&self) -> bool {
        self.size.is_none()
    }

    /// Whether the moment is vertical.
    #[must_use]
    pub fn is_upright(&self) -> bool {
        self.moment_a_m2[0] == 0.0 && self.moment_a_m2[1] == 0.0
    }

    /// The rule with its centre at height `z_m`; lower than promised is taken as promised.
    #[must_use]
    pub fn magnet_rule(&self, z_m: f64) -> MagnetRule {
        // Rounding of a table's lowest node must not fail where the promised height did not.
        self.try_rule(z_m.clamp(self.lowest_m, self.fixed_m))
            .unwrap_or_else(|_| MagnetRule::dipole(self.moment_a_m2))
    }

    /// Bound of what that rule adds to the error of the pull, relative.
    #[must_use]
    pub fn rule_error(&self, z_m: f64) -> f64 {
        BOTH * self.magnet_rule(z_m).bound()
    }

    /// The sources that stand for it with its centre at height `z_m`, about the centre: dipoles, or charges on its ends
    /// where those are fewer.
    #[must_use]
    pub fn sources(&self, z_m: f64) -> Vec<PointSource> {
        let rule = self.magnet_rule(z_m);
        let charges = self.size.and_then(|size| {
            let sources = self.steel_below(z_m.clamp(self.lowest_m, self.fixed_m));
            let charges = size.charges(self.moment_a_m2, sources, self.tolerance);
            charges
                .ok()
                .filter(|charges| charges.len() < rule.nodes().len())
        });
        let Some(charges) = charges else {
            return dipoles(&rule);
        };
        let of_charge = |charge: &Charge| PointSource {
            at_m: charge.offset_m,
            charge_a_m: charge.charge_a_m,
            ..PointSource::default()
        };
        charges.iter().map(of_charge).collect()
    }

    /// Few dipoles on the magnet's axis that stand for it to `tolerance` from a height that
    /// allows them; closer they are a guess for what matters little there.
    #[must_use]
    pub fn few_dipoles(&self, tolerance: f64) -> Vec<Dipole> {
        let few = self.size.and_then(|size| {
            let height_m = (self.lowest_m - self.top_m).max(FAR_REACHES * size.reach_m());
            let sources = Sources::Below { height_m };
            MagnetRule::cylinder(size, self.moment_a_m2, sources, tolerance).ok()
        });
        let rule = few.unwrap_or_else(|| self.magnet_rule(self.lowest_m));
        let of_node = |node: &Node| Dipole {
            at_m: node.offset_m,
            moment_a_m2: node.moment_a_m2,
        };
        rule.nodes().iter().map(of_node).collect()
    }

    /// How far the lowest of its sources is above the steel.
    #[must_use]
    pub fn gap_m(&self) -> f64 {
        self.gap_of_m(self.sources(self.lowest_m).iter().map(|source| source.at_m))
    }

    /// The same of given places about the centre.
    #[must_use]
    pub fn gap_of_m(&self, places_m: impl Iterator<Item = [f64; 3]>) -> f64 {
        let lowest = places_m.fold(0.0_f64, |lowest, at| lowest.min(at[2]));
        self.lowest_m + lowest - self.top_m
    }

    fn try_rule(&self, z_m: f64) -> Result<MagnetRule, NoPull> {
        let Some(size) = self.size else {
            return Ok(MagnetRule::dipole(self.moment_a_m2));
        };
        let sources = self.steel_below(z_m);
        Ok(MagnetRule::cylinder(
            size,
            self.moment_a_m2,
            sources,
            self.tolerance,
        )?)
    }

    fn steel_below(&self, z_m: f64) -> Sources {
        Sources::Below {
            height_m: z_m - self.top_m,
        }
    }
}

/// A rule's nodes as dipoles about the centre.
#[must_use]
pub fn dipoles(rule: &MagnetRule) -> Vec<PointSource> {
    rule.nodes()
        .iter()
        .map(|node| PointSource {
            at_m: node.offset_m,
            moment_a_m2: node.moment_a_m2,
            charge_a_m: 0.0,
        })
        .collect()
}
