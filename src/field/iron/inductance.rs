//! The flux that the layers of steel send through windings.

use super::axial_profile::AxialProfile;
use super::face::{Node, Panel};
use super::near_sources::{Windings, add_halved, from_section_m};
use super::parts::Rule;
use super::surface::{FAR, Surface, mirrored};
use crate::frame::to_cartesian;
use crate::winding::{OnEdge, Winding};
use fluxform_base::units::MU_0_T_M_PER_A;
use rayon::prelude::*;

/// Nodes along a side of a rule beyond those of the layer's own, with which it is compared.
const MORE_NODES: usize = 3;
/// Part of what rules may differ by that the winding's own field may be off.
const FIELD_SHARE: f64 = 1e-2;
/// Most parts of panels: a winding whose edge lies on the surface itself is met by ever smaller ones.
const MOST_PARTS: usize = 20_000;

/// A winding, and a mirrored copy of a surface with layers for a number of drives.
pub(super) struct Linkage<'a> {
    pub(super) surface: &'a Surface,
    pub(super) winding: &'a Winding,
    /// Of the winding, in the planes of the surface close to its ends.
    pub(super) profiles: &'a [AxialProfile],
    pub(super) axis_m: [f64; 2],
    /// Of the copy, and the mirrors' planes.
    pub(super) signs: [f64; 2],
    pub(super) planes_m: [f64; 2],
    /// [node][drive], A/A.
    pub(super) layers: &'a [f64],
    pub(super) drives: usize,
    /// What two rules on all parts of panels may differ by, relative to the largest flux or [`least_h`].
    pub(super) allowed: f64,
}

/// A part of a panel, what it gives every drive, H, and by how much two rules differ, H.
struct Part {
    number: usize,
    panel: Panel,
    fluxes_h: Vec<f64>,
    error_h: f64,
}

impl Linkage<'_> {
    /// Flux through the winding of every drive, -mu_0 int v n.H dS with the H of the winding's own current, in henry, and
    /// by how much the rules differed. The panels where they differ most are halved until they differ by no more than
    /// is allowed: under a winding's end H changes over the gap.
    ///
    /// # Errors
    /// A node on the winding's edge.
    pub(super) fn fluxes_h(&self) -> Result<(Vec<f64>, f64), OnEdge> {
        // No part is too large for the rules to see what is below the winding.
        let winding = Windings::new(*self.winding, &[self.signed_axis_m()]);
        let panels = self.surface.panels().par_iter().enumerate();
        let first = panels.flat_map_iter(|(number, panel)| {
            let mut halved = Vec::new();
            let face = &self.surface.faces[panel.face];
            let longest_m = |panel: &Panel, _: &_| winding.longest_m(panel);
            add_halved(*panel, face, &longest_m, &mut halved);
            halved.into_iter().map(move |part| self.part(number, part))
        });
        let mut parts = first.collect::<Result<Vec<Part>, OnEdge>>()?;
        loop {
            let error_h: f64 = parts.iter().map(|part| part.error_h).sum();
            let mut sum_h = vec![0.0; self.drives];
            for part in &parts {
                for (sum, flux) in sum_h.iter_mut().zip(&part.fluxes_h) {
                    *sum += flux;
                }
            }
            let largest_h = sum_h
                .iter()
                .fold(least_h(self.winding), |most, flux| most.max(flux.abs()));
            if error_h <= self.allowed * largest_h || parts.len() > MOST_PARTS {
                return Ok((sum_h, error_h));
            }
            parts.sort_by(|a, b| b.error_h.total_cmp(&a.error_h));
            let mut left_h = error_h;
            let halved = parts.iter().take_while(|part| {
                let more = left_h > 0.5 * error_h;
                left_h -= part.error_h;
                more
            });
            let halved = halved.count();
            let halves = parts[..halved]
                .par_iter()
                .flat_map_iter(|part| {
                    let face = &self.surface.faces[part.panel.face];
                    let halves = part.panel.halves(face).into_iter();
                    halves.map(|half| self.part(part.number, half))
                })
                .collect::<Result<Vec<Part>, OnEdge>>()?;
            parts.splice(..halved, halves);
        }
    }

    /// A part of a panel; far from the winding the layer's own nodes are enough.
    fn part(&self, number: usize, part: Panel) -> Result<Part, OnEdge> {
        fluxform_base::progress::poll();
        let order = part.order;
        let mut fluxes_h = self.of_part(number, &part, order)?;
        let mut error_h = 0.0;
        let away_m = from_section_m(&part, self.winding, self.signed_axis_m());
        if away_m <= FAR * 0.5 * part.sides_m[0].max(part.sides_m[1]) {
            let finer_h = self.of_part(number, &part, order + MORE_NODES)?;
            let pairs = fluxes_h.iter().zip(&finer_h);
            error_h = pairs.fold(0.0, |most, (a, b)| f64::max(most, (a - b).abs()));
            fluxes_h = finer_h;
        }
        Ok(Part {
            number,
            panel: part,
            fluxes_h,
            error_h,
        })
    }

    /// The axis as the uncopied surface sees it.
    fn signed_axis_m(&self) -> [f64; 2] {
        let from = |k: usize| self.axis_m[k] - self.planes_m[k];
        [0, 1].map(|k| self.planes_m[k] + self.signs[k] * from(k))
    }

    /// What a part of a panel gives every drive, by a rule of `order` nodes along each side.
    fn of_part(&self, number: usize, part: &Panel, order: usize) -> Result<Vec<f64>, OnEdge> {
        let panel = &self.surface.panels()[number];
        let nodes = self.surface.nodes_of(number);
        let layers = &self.layers[nodes.start * self.drives..nodes.end * self.drives];
        let count = panel.order;
        let basis = self.surface.basis_of(number);
        let rule = Rule::new(&self.surface.faces[panel.face], basis, panel, part, order);
        let profile = self.profiles.iter().find(|profile| profile.is_of(part));
        let mut weights = vec![0.0; count * count];
        for (k, node) in rule.nodes.iter().enumerate() {
            let flux = self.flux(node, profile)?;
            let [first, second] = [k / order, k % order].map(|at| at * count);
            let along = rule.bases[0][first..first + count].iter();
            for (a, row) in along.zip(weights.chunks_exact_mut(count)) {
                let across = &rule.bases[1][second..second + count];
                for (weight, b) in row.iter_mut().zip(across) {
                    *weight -= flux * a * b;
                }
            }
        }
        let mut fluxes = vec![0.0; self.drives];
        for (weight, layers) in weights.iter().zip(layers.chunks_exact(self.drives)) {
            for (flux, layer) in fluxes.iter_mut().zip(layers) {
                *flux += weight * layer;
            }
        }
        Ok(fluxes)
    }

    /// The winding's own flux through a node's area, T m^2/A.
    fn flux(&self, node: &Node, profile: Option<&AxialProfile>) -> Result<f64, OnEdge> {
        let node = mirrored(node, self.signs, self.planes_m);
        let [x, y, z] = node.place_m;
        let (dx, dy) = (x - self.axis_m[0], y - self.axis_m[1]);
        let r_m = dx.hypot(dy);
        if let Some(b_z) = profile.and_then(|profile| profile.b_z(r_m)) {
            return Ok(b_z * node.area_m2[2]);
        }
        let tolerance = FIELD_SHARE * self.allowed;
        let field = self.winding.field_to(r_m, z, tolerance)?;
        let field_t = to_cartesian(&field, dx, dy).field_t_per_a;
        Ok(fluxform_numerics::vec3::dot(field_t, node.area_m2))
    }
}

/// An inductance of the order of the winding's own, from below, H.
pub(super) fn least_h(winding: &Winding) -> f64 {
    0.1 * MU_0_T_M_PER_A * winding.turns.powi(2) * winding.inner_radius_m
}
