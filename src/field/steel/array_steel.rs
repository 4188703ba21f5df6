//! The steel of an array as a source of field: what it adds to that of its windings, whichever core
//! answers to which winding.

use crate::components::Components;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::array::CoupledArray;
use super::axial_table::AxialTable;
use super::clearance::Clearance;
use super::equivalent_dipoles::ArraySources;
use super::magnetized::MagnetizedCore;
use crate::iron::array::IronArray;
use crate::source::AxialSource;
use crate::winding::{AxialField, OnEdge, Winding};

/// The solved steel of an array, per ampere of every winding.
///
/// A new kind of steel is one more of these: forces, maps, probes and checks know this trait alone.
pub trait ArraySteel {
    /// Whether there is any.
    fn is_present(&self) -> bool {
        true
    }

    /// Flux through winding `i` for one ampere in winding `j`, less that in air, H.
    fn added_inductance_h(&self, i: usize, j: usize) -> f64;

    /// `winding` with what answers to it as one source about its own axis, to `tolerance` relative
    /// to the largest |grad B| at a height; `None` where a coil's field has no such symmetry.
    fn axial_source(&self, _winding: Winding, _tolerance: f64) -> Option<Box<dyn AxialSource>> {
        None
    }

    /// The field of the same at one place without a table, and how it is computed; `None` where
    /// [`ArraySteel::axial_source`] is.
    fn direct(&self, _winding: &Winding) -> Option<(DirectField<'_>, &'static str)> {
        None
    }

    /// The field that the steel adds at places with `clearance`, to `tolerance`; `None` without steel.
    fn field(&self, clearance: Clearance, tolerance: f64) -> Option<SteelField>;

    /// How the error of the solution is known; `None` without steel.
    fn method(&self) -> Option<&'static str>;

    /// Cores that magnetise each other, which only together have |B| inside.
    fn coupled(&self) -> Option<&CoupledArray> {
        None
    }

    /// A core that answers to its own winding alone.
    fn alone(&self) -> Option<&AloneCore> {
        None
    }

    /// Whether steel answers to other windings than its own.
    fn couples(&self) -> bool {
        self.coupled().is_some() || self.iron().is_some()
    }

    /// Steel of any shape.
    fn iron(&self) -> Option<&IronArray> {
        None
    }
}

/// Field and gradient per ampere at a radius and a height, m.
pub type DirectField<'a> = Box<dyn Fn(f64, f64) -> Result<AxialField, OnEdge> + 'a>;

/// Windings in air.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoSteel;

impl ArraySteel for NoSteel {
    fn is_present(&self) -> bool {
        false
    }

    fn added_inductance_h(&self, _: usize, _: usize) -> f64 {
        0.0
    }

    fn axial_source(&self, winding: Winding, _: f64) -> Option<Box<dyn AxialSource>> {
        Some(Box::new(winding))
    }

    fn direct(&self, winding: &Winding) -> Option<(DirectField<'_>, &'static str)> {
        let winding = *winding;
        let field = Box::new(move |r_m, z_m| winding.field(r_m, z_m));
        Some((field, "elliptic integrals"))
    }

    fn field(&self, _: Clearance, _: f64) -> Option<SteelField> {
        None
    }

    fn method(&self) -> Option<&'static str> {
        None
    }
}

/// Cores each of which answers to its own winding alone; all are alike.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct AloneCore {
    /// Its layer per ampere.
    pub layer: MagnetizedCore,
    /// Its part of the winding's inductance, H.
    pub added_inductance_h: f64,
    /// Whether it follows its B-H curve.
    pub along_curve: bool,
}

/// How the error of one core's solution is known.
pub const TWO_OF_ONE_CORE: &str = "twice the difference of two resolutions of the core's surface";
/// The same of cores that magnetise each other.
pub const TWO_OF_COUPLED_CORES: &str = "the difference of two resolutions of the coupled cores";
/// The same of steel of any shape.
pub const TWO_OF_IRON_SURFACES: &str = "the difference of two resolutions of the steel's surface";
/// The same of one core along a B-H curve.
pub const ALONG_CURVE: &str = "the larger difference among three resolutions of the core's \
                               surface and inside, times a safety factor";

impl ArraySteel for AloneCore {
    fn added_inductance_h(&self, i: usize, j: usize) -> f64 {
        if i == j { self.added_inductance_h } else { 0.0 }
    }

    fn axial_source(&self, winding: Winding, tolerance: f64) -> Option<Box<dyn AxialSource>> {
        let table = AxialTable::new(Some(winding), self.layer.clone(), tolerance);
        Some(Box::new(table))
    }

    fn direct(&self, winding: &Winding) -> Option<(DirectField<'_>, &'static str)> {
        let winding = *winding;
        let field = move |r_m, z_m| Ok(winding.field(r_m, z_m)? + self.layer.field(r_m, z_m));
        let method = "elliptic integrals over the core's layer";
        Some((Box::new(field), method))
    }

    fn field(&self, _: Clearance, tolerance: f64) -> Option<SteelField> {
        Some(SteelField::of_core(self.layer.clone(), tolerance))
    }

    fn method(&self) -> Option<&'static str> {
        Some(if self.along_curve {
            ALONG_CURVE
        } else {
            TWO_OF_ONE_CORE
        })
    }

    fn alone(&self) -> Option<&AloneCore> {
        Some(self)
    }
}

impl ArraySteel for CoupledArray {
    fn added_inductance_h(&self, i: usize, j: usize) -> f64 {
        self.added_inductance_h[(i, j)]
    }

    fn field(&self, clearance: Clearance, tolerance: f64) -> Option<SteelField> {
        let sources = ArraySources::for_many_points(self, clearance, tolerance);
        Some(SteelField::Coupled(sources))
    }

    fn method(&self) -> Option<&'static str> {
        Some(TWO_OF_COUPLED_CORES)
    }

    fn coupled(&self) -> Option<&Self> {
        Some(self)
    }
}

impl ArraySteel for IronArray {
    fn added_inductance_h(&self, i: usize, j: usize) -> f64 {
        self.added_inductance_h[(i, j)]
    }

    fn field(&self, clearance: Clearance, tolerance: f64) -> Option<SteelField> {
        Some(SteelField::Coupled(self.sources(clearance, tolerance)))
    }

    fn method(&self) -> Option<&'static str> {
        Some(TWO_OF_IRON_SURFACES)
    }

    fn iron(&self) -> Option<&Self> {
        Some(self)
    }
}

/// The field that steel adds, ready to be evaluated.
#[derive(Debug, Clone)]
pub enum SteelField {
    /// Of one core at the origin that answers to its own winding alone, per ampere.
    Alone(Arc<AxialTable>),
    /// Of all cores, per ampere of every winding.
    Coupled(ArraySources),
}

impl SteelField {
    /// The field of one core at the origin, to `tolerance` relative to the largest |grad B| at a
    /// height.
    #[must_use]
    pub fn of_core(layer: MagnetizedCore, tolerance: f64) -> Self {
        Self::Alone(Arc::new(AxialTable::new(None, layer, tolerance)))
    }

    /// The field at `points_m`, [drive, component, point]; of one core a single drive.
    ///
    /// # Panics
    /// When `out` has another length than drives x components x points.
    pub fn sample(&self, points_m: &[[f64; 3]], parts: Components, out: &mut [f64]) {
        match self {
            Self::Alone(table) => table
                .sample_parts(points_m, parts, out)
                .expect("a table without a winding has no winding's edge"),
            Self::Coupled(sources) => sources.sample(points_m, parts, out),
        }
    }

    /// The field per ampere of every winding, their axes at `axes_m`, [winding, component, point].
    #[must_use]
    pub fn of_windings(
        &self,
        axes_m: impl ExactSizeIterator<Item = [f64; 2]>,
        points_m: &[[f64; 3]],
        parts: Components,
    ) -> Vec<f64> {
        let block = parts.count() * points_m.len();
        let mut out = vec![0.0; axes_m.len() * block];
        match self {
            Self::Coupled(_) => self.sample(points_m, parts, &mut out),
            Self::Alone(_) => {
                for ([x, y], out) in axes_m.zip(out.chunks_exact_mut(block.max(1))) {
                    let own: Vec<[f64; 3]> = points_m
                        .iter()
                        .map(|p| [p[0] - x, p[1] - y, p[2]])
                        .collect();
                    self.sample(&own, parts, out);
                }
            }
        }
        out
    }

    /// The sources of all cores together; `None` of cores that answer to their own winding alone.
    #[must_use]
    pub fn coupled(&self) -> Option<&ArraySources> {
        match self {
            Self::Alone(_) => None,
            Self::Coupled(sources) => Some(sources),
        }
    }
}
