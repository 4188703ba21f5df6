//! The flux that the layers of steel send through windings.

use super::face::{Node, Panel};
use super::near_windings::from_section_m;
use super::parts::Rule;
use super::surface::{FAR, Surface, mirrored};
use crate::frame::to_cartesian;
use crate::winding::{OnEdge, Winding};
use fluxform_base::units::MU_0_T_M_PER_A;
use rayon::prelude::*;

/// Nodes along a side of a rule beyond those of the one that it is compared with; the first has the layer's.
const MORE_NODES: usize = 3;
/// Finer rules that are tried before a part is halved.
const MOST_RULES: usize = 2;
/// Most halvings of a panel: those about a winding's edge on the surface itself end here.
const MOST_HALVINGS: usize = 40;

/// A winding, and a mirrored copy of a surface with layers for a number of drives.
pub(super) struct Linkage<'a> {
    pub(super) surface: &'a Surface,
    pub(super) winding: &'a Winding,
    pub(super) axis_m: [f64; 2],
    /// Of the copy, and the mirrors' planes.
    pub(super) signs: [f64; 2],
    pub(super) planes_m: [f64; 2],
    /// [node][drive], A/A.
    pub(super) layers: &'a [f64],
    pub(super) drives: usize,
    /// What two rules on a part of a panel may differ by, H.
    pub(super) allowed_h: f64,
}

impl Linkage<'_> {
    /// Flux through the winding of every drive, -mu_0 int v n.H dS with the H of the winding's own current, in henry, and
    /// by how much the rules differed. Panels are halved until two rules agree: under a winding's end H changes over the
    /// gap.
    ///
    /// # Errors
    /// A node on the winding's edge.
    pub(super) fn fluxes_h(&self) -> Result<(Vec<f64>, f64), OnEdge> {
        let panels = (0..self.surface.panels().len()).into_par_iter();
        let of_panels = panels
            .map(|number| self.of_panel(number))
            .collect::<Result<Vec<_>, OnEdge>>()?;
        let mut sum = (vec![0.0; self.drives], 0.0);
        for (fluxes, error) in of_panels {
            for (sum, flux) in sum.0.iter_mut().zip(fluxes) {
                *sum += flux;
            }
            sum.1 += error;
        }
        Ok(sum)
    }

    fn of_panel(&self, number: usize) -> Result<(Vec<f64>, f64), OnEdge> {
        let panel = self.surface.panels()[number];
        let nodes = self.surface.nodes_of(number);
        let layers = &self.layers[nodes.start * self.drives..nodes.end * self.drives];
        if from_section_m(&panel, self.winding, self.signed_axis_m())
            > FAR * 0.5 * panel.sides_m[0].max(panel.sides_m[1])
        {
            let fluxes = self.of_part(number, &panel, &panel, panel.order, layers)?;
            return Ok((fluxes, 0.0));
        }
        let mut sum = (vec![0.0; self.drives], 0.0);
        let mut parts = vec![(panel, 0)];
        while let Some((part, halvings)) = parts.pop() {
            fluxform_base::progress::poll();
            let of_order = |order| self.of_part(number, &panel, &part, order, layers);
            let mut order = panel.order;
            let mut fluxes = of_order(order)?;
            let mut apart = f64::INFINITY;
            for _ in 0..MOST_RULES {
                order += MORE_NODES;
                let finer = of_order(order)?;
                let pairs = fluxes.iter().zip(&finer);
                apart = pairs.fold(0.0, |most, (a, b)| f64::max(most, (a - b).abs()));
                fluxes = finer;
                if apart <= self.allowed_h {
                    break;
                }
            }
            if apart > self.allowed_h && halvings < MOST_HALVINGS {
                let face = &self.surface.faces[panel.face];
                parts.extend(part.halves(face).map(|half| (half, halvings + 1)));
                continue;
            }
            for (sum, flux) in sum.0.iter_mut().zip(fluxes) {
                *sum += flux;
            }
            sum.1 += apart;
        }
        Ok(sum)
    }

    /// The axis as the uncopied surface sees it.
    fn signed_axis_m(&self) -> [f64; 2] {
        let from = |k: usize| self.axis_m[k] - self.planes_m[k];
        [0, 1].map(|k| self.planes_m[k] + self.signs[k] * from(k))
    }

    /// What a part of a panel gives every drive, by a rule of `order` nodes along each side.
    fn of_part(
        &self,
        number: usize,
        panel: &Panel,
        part: &Panel,
        order: usize,
        layers: &[f64],
    ) -> Result<Vec<f64>, OnEdge> {
        let count = panel.order;
        let basis = self.surface.basis_of(number);
        let rule = Rule::new(&self.surface.faces[panel.face], basis, panel, part, order);
        let mut weights = vec![0.0; count * count];
        for (k, node) in rule.nodes.iter().enumerate() {
            let flux = self.flux(node)?;
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
    fn flux(&self, node: &Node) -> Result<f64, OnEdge> {
        let node = mirrored(node, self.signs, self.planes_m);
        let [x, y, z] = node.place_m;
        let (dx, dy) = (x - self.axis_m[0], y - self.axis_m[1]);
        let field = self.winding.field(dx.hypot(dy), z)?;
        let field_t = to_cartesian(&field, dx, dy).field_t_per_a;
        Ok(fluxform_numerics::vec3::dot(field_t, node.area_m2))
    }
}

/// An inductance of the order of the winding's own, from below, H.
pub(super) fn least_h(winding: &Winding) -> f64 {
    0.1 * MU_0_T_M_PER_A * winding.turns.powi(2) * winding.inner_radius_m
}
