//! Bodies of steel in a uniform field: closed forms exist for some, and a shield is judged by it.

use nalgebra::DMatrix;

use super::bodies::Iron;
use super::face::{Face, Point};
use super::surface::Surface;
use super::system::System;
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::vec3::dot;

/// Relative residual to which the layer is solved.
const RESIDUAL: f64 = 1e-9;

/// Bodies that a uniform field magnetises, per A/m of it.
#[derive(Debug, Clone)]
pub struct InUniformField {
    surface: Surface,
    /// The layer at every node, m.
    layer: Vec<f64>,
    direction: Point,
}

impl InUniformField {
    /// Solves `bodies`, each with its relative permeability less one, in a field along the unit vector
    /// `direction`, at one of the [resolutions](super::bodies::RESOLUTIONS).
    #[must_use]
    pub fn new(bodies: &[(Vec<Face>, f64)], direction: Point, tier: usize) -> Self {
        let mut iron = Iron::none();
        for (faces, chi) in bodies {
            iron = iron.with(faces.clone(), *chi);
        }
        Self::of(iron, direction, tier)
    }

    /// The same of `iron`, which is not mirrored.
    #[must_use]
    pub fn of(iron: Iron, direction: Point, tier: usize) -> Self {
        let surface = iron.surface(tier);
        let system = System::new(&iron, &surface, &[[1.0, 1.0]], 0.0, usize::MAX);
        let system = system.expect("there is no limit");
        let potential = surface
            .nodes
            .iter()
            .map(|node| -dot(node.place_m, direction));
        let potential = DMatrix::from_iterator(surface.size(), 1, potential);
        let solved = system.solve(&[potential], RESIDUAL);
        Self {
            layer: solved.layers[0].as_slice().to_vec(),
            surface,
            direction,
        }
    }

    /// Number of unknowns.
    #[must_use]
    pub fn size(&self) -> usize {
        self.surface.size()
    }

    /// The moment of all bodies, -int v n dS, m^3.
    #[must_use]
    pub fn moment_m3(&self) -> Point {
        let mut sum = [0.0; 3];
        for (node, layer) in self.surface.nodes.iter().zip(&self.layer) {
            for (sum, area) in sum.iter_mut().zip(node.area_m2) {
                *sum -= layer * area;
            }
        }
        sum
    }

    /// B at a place off the surfaces, T m/A.
    #[must_use]
    pub fn field_t_m_per_a(&self, place_m: Point) -> Point {
        let own = self.surface.field_t(place_m, &self.layer);
        std::array::from_fn(|i| own[i] + MU_0_T_M_PER_A * self.direction[i])
    }
}
