//! Windings among steel of any shape, solved.

use crate::steel::clearance::Clearance;
use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::axial_profile::AxialProfile;
pub use super::bodies::RESOLUTIONS;
use super::bodies::{Coils, Iron};
use super::clearance::is_within;
use super::face::{Node, Panel, Point, SAME_M};
use super::inductance::{Linkage, least_h};
use super::panel_columns::Targets;
use super::potential::Branch;
use super::surface::{Surface, mirrored};
use super::system::{System, TooMany};
use crate::components::Components;
use crate::frame::to_cartesian;
use crate::steel::equivalent_dipoles::ArraySources;
use crate::winding::{OnEdge, Winding};
use fluxform_numerics::vec3::{minus, norm};
use std::ops::Range;

/// Most entries of the matrices as they are held (1.6 GB).
pub(super) const MOST_ENTRIES: usize = 200_000_000;
/// Most entries that are computed.
const MOST_COMPUTED: usize = 3 * MOST_ENTRIES;
/// A mesh of more facets does not fit, whatever its shape: two in one plane are one piece, of four nodes at the second
/// resolution.
pub const MOST_FACETS: usize = MOST_COMPUTED.isqrt() / 2;
/// How near to the steel resolutions are compared, in outer radii of the windings.
const CLOSE: f64 = 0.1;
/// Share of the tolerance given to the linear solver.
const SOLVER_SHARE: f64 = 0.02;
/// Share of the tolerance given to the integration of inductances.
const FLUX_SHARE: f64 = 0.2;
/// Accuracy of the windings' potential, relative to one face's.
const POTENTIAL: f64 = 1e-9;

/// Why steel is not solved.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Unsolved {
    /// A node on a winding's edge.
    #[error(transparent)]
    OnEdge(#[from] OnEdge),
    /// Its matrices are too large at the second resolution already, by which errors are estimated.
    #[error(
        "its surface takes {unknowns} unknowns of {images} mirrored parts, {:.1} GB before far blocks are compressed, and \
         at most {:.1} are given to what is left",
        gigabytes(*.images * .unknowns.pow(2)), gigabytes(MOST_ENTRIES)
    )]
    TooLarge {
        /// Of one mirrored part.
        unknowns: usize,
        /// Number of the parts.
        images: usize,
    },
}

fn gigabytes(entries: usize) -> f64 {
    entries as f64 * size_of::<f64>() as f64 * 1e-9
}

/// The finest of the [`RESOLUTIONS`] that memory allows, the second at least.
fn finest(iron: &Iron) -> Result<usize, Unsolved> {
    let images = iron.images().len();
    let unknowns = |tier: usize| iron.surface(tier).size();
    let fits = |tier: &usize| images * unknowns(*tier).pow(2) <= MOST_COMPUTED;
    let finest = (1..RESOLUTIONS.len()).take_while(fits).last();
    finest.ok_or_else(|| Unsolved::TooLarge {
        unknowns: unknowns(1),
        images,
    })
}

/// The first of the [`RESOLUTIONS`] to try for a tolerance.
pub(super) fn coarsest(tolerance: f64) -> usize {
    (-tolerance.log10().round()).clamp(1.0, 5.0) as usize - 1
}

/// The solved steel, per ampere of every winding.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct IronArray {
    /// Axes of the windings, m.
    pub positions_m: Vec<[f64; 2]>,
    /// The winding of every coil.
    pub winding: Winding,
    pub(super) surface: Surface,
    /// Signs of the mirrored copies of the surface, and the planes.
    pub(super) images: Vec<[f64; 2]>,
    pub(super) planes_m: [f64; 2],
    /// [image][node][drive], A/A.
    layers: Vec<Vec<f64>>,
    top_m: f64,
    /// Steel's part of self and mutual inductances, [coil, drive], H.
    pub added_inductance_h: DMatrix<f64>,
    /// By how much rules of its integration differed, H.
    flux_error_h: f64,
    /// Estimated error of gradients and inductances, relative to the largest: the difference from the next
    /// coarser resolution, with what the linear solver leaves.
    pub relative_error: f64,
    /// Relative residual of the linear solver.
    pub relative_residual: f64,
    /// Applications of the matrices.
    pub iterations: usize,
    /// A tolerance below which finer panels are taken, as far as memory allows; `None` where they are not.
    pub(super) finer_below: Option<f64>,
    /// The next coarser solution, by which errors are estimated; `None` of a resolution asked for.
    pub(super) coarser: Option<Box<Self>>,
}

impl IronArray {
    /// Solves to an estimated error below `tolerance` between the heights `heights_m`, or as far as memory allows:
    /// [`IronArray::relative_error`] says what was reached.
    ///
    /// # Errors
    /// [`Unsolved`].
    pub fn new(
        coils: Coils<'_>,
        iron: &Iron,
        tolerance: f64,
        heights_m: [f64; 2],
    ) -> Result<Self, Unsolved> {
        let requested = coarsest(tolerance);
        let last = finest(iron)?;
        // The error is the difference of two.
        let mut first = requested.min(last - 1);
        let mut fine = Self::at_resolution(coils, iron, tolerance, first + 1);
        while first > 0 && matches!(fine, Err(Unsolved::TooLarge { .. })) {
            first -= 1;
            fine = Self::at_resolution(coils, iron, tolerance, first + 1);
        }
        let mut first_fine = Some(fine?);
        let mut coarse = Self::at_resolution(coils, iron, tolerance, first)?;
        let mut is_finest = false;
        for tier in first + 1..=last {
            let next = first_fine
                .take()
                .map_or_else(|| Self::at_resolution(coils, iron, tolerance, tier), Ok);
            let mut fine = match next {
                Err(Unsolved::TooLarge { .. }) => {
                    is_finest = true;
                    break;
                }
                other => other?,
            };
            fine.relative_error = fine.difference(&coarse, heights_m, tolerance)?;
            coarse.coarser = None;
            fine.coarser = Some(Box::new(coarse));
            coarse = fine;
            is_finest = tier == last;
            if coarse.relative_error <= tolerance {
                break;
            }
        }
        // The solver's share shrinks with the tolerance on the same panels.
        let of_panels = coarse.relative_error - coarse.solver_error(tolerance);
        coarse.finer_below = (!is_finest).then_some(of_panels);
        Ok(coarse)
    }

    /// Solves at one of the [`RESOLUTIONS`].
    ///
    /// # Errors
    /// [`Unsolved`].
    pub fn at_resolution(
        coils: Coils<'_>,
        iron: &Iron,
        tolerance: f64,
        tier: usize,
    ) -> Result<Self, Unsolved> {
        let positions_m = coils.positions_m;
        let surface = iron.surface(tier);
        let images = iron.images();
        let planes_m = iron.planes_m;
        let system = System::new(iron, &surface, &images, tolerance, MOST_ENTRIES);
        let system = system.map_err(|_: TooMany| Unsolved::TooLarge {
            unknowns: surface.size(),
            images: images.len(),
        })?;
        let drives: Vec<Drive> = drives(positions_m, &images, planes_m);
        let firsts: Vec<usize> = (0..drives.len())
            .filter(|d| {
                drives[*d]
                    == Drive {
                        first: *d,
                        image: 0,
                    }
            })
            .collect();
        let potentials: Vec<DMatrix<f64>> = (images.iter())
            .map(|signs| potentials(&surface, coils, &firsts, *signs, planes_m))
            .collect();
        let solved = system.solve(&potentials, SOLVER_SHARE * tolerance);
        // Every drive from the first of its like.
        let count = drives.len();
        let layers: Vec<Vec<f64>> = (0..images.len())
            .map(|image| {
                let mut out = vec![0.0; surface.size() * count];
                for (number, drive) in drives.iter().enumerate() {
                    let column = firsts.iter().position(|f| *f == drive.first);
                    let column = column.expect("a drive has a first of its like");
                    let values = solved.layers[image ^ drive.image].column(column);
                    for (row, value) in out.chunks_exact_mut(count).zip(values.iter()) {
                        row[number] = *value;
                    }
                }
                out
            })
            .collect();
        let mut array = Self {
            positions_m: positions_m.to_vec(),
            winding: coils.winding,
            surface,
            images,
            planes_m,
            layers,
            top_m: iron.top_m(),
            added_inductance_h: DMatrix::zeros(count, count),
            flux_error_h: 0.0,
            relative_error: f64::NAN,
            relative_residual: solved.residual,
            iterations: solved.iterations,
            finer_below: None,
            coarser: None,
        };
        array.add_inductances(&firsts, tolerance)?;
        Ok(array)
    }

    /// Sets the inductances that the layers add, and their error by quadrature, which is a share of `tolerance`.
    fn add_inductances(&mut self, firsts: &[usize], tolerance: f64) -> Result<(), OnEdge> {
        let count = self.positions_m.len();
        let allowed = FLUX_SHARE * tolerance / self.images.len() as f64;
        let profiles = AxialProfile::of(self.surface.panels(), &self.winding)?;
        for coil in firsts {
            let mut row = vec![0.0; count];
            let mut error_h = 0.0;
            for (signs, layers) in self.images.iter().zip(&self.layers) {
                let linkage = Linkage {
                    surface: &self.surface,
                    winding: &self.winding,
                    profiles: &profiles,
                    axis_m: self.positions_m[*coil],
                    signs: *signs,
                    planes_m: self.planes_m,
                    layers,
                    drives: count,
                    allowed,
                };
                let (fluxes, error) = linkage.fluxes_h()?;
                for (sum, flux) in row.iter_mut().zip(fluxes) {
                    *sum += flux;
                }
                error_h += error;
            }
            self.flux_error_h = self.flux_error_h.max(error_h);
            for (drive, value) in row.into_iter().enumerate() {
                for signs in &self.images {
                    let of = |drive| moved(&self.positions_m, drive, *signs, self.planes_m);
                    self.added_inductance_h[(of(*coil), of(drive))] = value;
                }
            }
        }
        Ok(())
    }

    /// Places beside the coils' axes, up to three radii above the lowest of `heights_m` or the steel, a height each.
    /// Where all of those heights are below the steel's top, they are between its parts.
    fn compared(&self, [lowest_m, highest_m]: [f64; 2]) -> Vec<(Clearance, Vec<Point>)> {
        let reach = self.winding.outer_radius_m;
        let close_m = CLOSE * reach;
        let top_m = self.top_m.max(0.0);
        let is_below = highest_m < top_m + close_m;
        let from_m = lowest_m.max(if is_below { 0.0 } else { top_m } + close_m);
        let faces = self.surface.whole_faces();
        let at_height = |height: f64| {
            let z_m = from_m + height * reach;
            let near = [[0.0, 0.0], [0.7, 0.2], [-0.4, 1.1], [1.5, -1.2]];
            let all = (self.positions_m.iter())
                .flat_map(|[x, y]| near.map(|[dx, dy]| [x + reach * dx, y + reach * dy, z_m]));
            let is_clear = |at: &Point| !is_below || !self.is_within(&faces, *at, close_m);
            let clearance = if is_below {
                Clearance {
                    lowest_m: z_m,
                    highest_m: z_m,
                    distance_m: close_m,
                }
            } else {
                Clearance::above(z_m, z_m - top_m)
            };
            (clearance, all.filter(is_clear).collect())
        };
        let mut places: Vec<(Clearance, Vec<Point>)> = [0.0, 1.0, 3.0].map(at_height).into();
        places.retain(|(clearance, points)| {
            !points.is_empty() && (clearance.lowest_m <= highest_m || !is_below)
        });
        match is_below && places.is_empty() {
            true => self.compared([lowest_m, f64::INFINITY]),
            false => places,
        }
    }

    /// Whether the surface, whose [`Surface::whole_faces`] are `faces`, is closer to a place than `least_m`.
    pub(super) fn is_within(
        &self,
        faces: &[(Panel, Range<usize>)],
        [x, y, z]: Point,
        least_m: f64,
    ) -> bool {
        let [cx, cy] = self.planes_m;
        self.images.iter().any(|[sx, sy]| {
            let own = [cx + sx * (x - cx), cy + sy * (y - cy), z];
            is_within(&self.surface, faces, own, least_m)
        })
    }

    fn difference(&self, other: &Self, heights_m: [f64; 2], tolerance: f64) -> Result<f64, OnEdge> {
        let parts = Components::Gradient;
        let mut worst = 0.0_f64;
        for (clearance, points) in self.compared(heights_m) {
            let values = |array: &Self| {
                let sources = array.sources(clearance, 0.02 * tolerance);
                let mut out = vec![0.0; self.positions_m.len() * parts.count() * points.len()];
                sources.sample(&points, parts, &mut out);
                out
            };
            let (fine, coarse) = (values(self), values(other));
            let air = (self.winding.field(0.0, clearance.lowest_m)?).gradient_norm();
            let size = fine.iter().fold(0.0_f64, |m, v| m.max(v.abs())) + air;
            let pairs = fine.iter().zip(&coarse);
            let most = pairs.fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            worst = worst.max(most / size);
        }
        let added = &self.added_inductance_h;
        let size = added.amax().max(least_h(&self.winding));
        let apart_h = (added - &other.added_inductance_h).amax() + self.flux_error_h;
        Ok(worst.max(apart_h / size) + self.solver_error(tolerance))
    }

    /// The relative error of gradients between the heights `heights_m`, and of inductances, of what was solved to
    /// `tolerance`: as [`IronArray::relative_error`] has it of those that it was solved for.
    ///
    /// # Errors
    /// A place on a winding's edge.
    pub fn error_between(&self, heights_m: [f64; 2], tolerance: f64) -> Result<f64, OnEdge> {
        self.coarser
            .as_ref()
            .map_or(Ok(self.relative_error), |coarser| {
                self.difference(coarser, heights_m, tolerance)
            })
    }

    /// What the linear solver leaves: two solved to this residual need not show it by their difference.
    pub fn solver_error(&self, tolerance: f64) -> f64 {
        self.relative_residual.max(SOLVER_SHARE * tolerance)
    }

    /// Number of unknowns of one mirrored part.
    #[must_use]
    pub fn size(&self) -> usize {
        self.surface.size()
    }

    /// Dipoles for places with `clearance`.
    #[must_use]
    pub fn sources(&self, clearance: Clearance, tolerance: f64) -> ArraySources {
        let drives = self.positions_m.len();
        let mut all = (Vec::new(), Vec::new());
        for (image, layers) in self.layers.iter().enumerate() {
            let (places, moments) = self.surface.dipoles(drives, layers, clearance, tolerance);
            let [sx, sy] = self.images[image];
            let [cx, cy] = self.planes_m;
            all.0
                .extend(places.into_iter().map(|[x, y, z, nx, ny, nz]| {
                    [
                        cx + sx * (x - cx),
                        cy + sy * (y - cy),
                        z,
                        sx * nx,
                        sy * ny,
                        nz,
                    ]
                }));
            all.1.extend(moments);
        }
        ArraySources::of_dipoles(drives, self.top_m, all.0, &all.1)
    }

    /// B at a place off the steel's surface, inside or out, with `currents_a` in the windings, T.
    ///
    /// # Errors
    /// A place on a winding's edge.
    pub fn field_t(&self, place_m: Point, currents_a: &[f64]) -> Result<Point, OnEdge> {
        let layers = self.layers_at(currents_a);
        Ok(self.fields_of(&[place_m], currents_a, &layers)?[0])
    }

    /// The largest error of B at `places_m`, off the surface, relative to |B| there, each of the coil that is nearest in
    /// plan: the difference from what the next coarser resolution has, and `alike`, a share of the steel's own field
    /// that both lack alike; `None` where there is no coarser one.
    ///
    /// # Errors
    /// A place on a winding's edge.
    pub fn error_at(&self, places_m: &[Point], alike: f64) -> Result<Option<f64>, OnEdge> {
        let Some(coarser) = &self.coarser else {
            return Ok(None);
        };
        let of_place = |place: &Point| {
            let away = |at: &[f64; 2]| apart_m(*at, [place[0], place[1]]);
            let nearest = self.positions_m.iter().map(away).enumerate();
            let nearest = nearest.min_by(|a, b| a.1.total_cmp(&b.1));
            let mut currents_a = vec![0.0; self.positions_m.len()];
            currents_a[nearest.expect("an array has coils").0] = 1.0;
            let fine = self.field_t(*place, &currents_a)?;
            let coarse = coarser.field_t(*place, &currents_a)?;
            let of_steel = apart(fine, self.of_windings_t(*place, &currents_a)?);
            Ok((apart(fine, coarse) + alike * of_steel) / norm(fine))
        };
        let all = places_m.par_iter().map(of_place);
        let all = all.collect::<Result<Vec<f64>, OnEdge>>()?;
        Ok(Some(all.into_iter().fold(0.0, f64::max)))
    }

    /// The layer of every image at these currents, A.
    pub(super) fn layers_at(&self, currents_a: &[f64]) -> Vec<Vec<f64>> {
        let sum = |row: &[f64]| row.iter().zip(currents_a).map(|(v, i)| v * i).sum();
        let of_image = |layers: &Vec<f64>| layers.chunks_exact(currents_a.len()).map(sum).collect();
        self.layers.iter().map(of_image).collect()
    }

    /// B at `places_m` of the windings and of the `layers` of every image.
    pub(super) fn fields_of(
        &self,
        places_m: &[Point],
        currents_a: &[f64],
        layers: &[Vec<f64>],
    ) -> Result<Vec<Point>, OnEdge> {
        fluxform_base::progress::poll();
        let of_windings = places_m
            .iter()
            .map(|place_m| self.of_windings_t(*place_m, currents_a));
        let mut sums = of_windings.collect::<Result<Vec<Point>, OnEdge>>()?;
        let [cx, cy] = self.planes_m;
        for ([sx, sy], values) in self.images.iter().zip(layers) {
            let mut targets = Targets::default();
            for [x, y, z] in places_m {
                targets.push([cx + sx * (x - cx), cy + sy * (y - cy), *z], None);
            }
            let fields_t = self.surface.fields_t(&targets, values);
            for (sum, [bx, by, bz]) in sums.iter_mut().zip(fields_t) {
                *sum = [sum[0] + sx * bx, sum[1] + sy * by, sum[2] + bz];
            }
        }
        Ok(sums)
    }

    fn of_windings_t(&self, place_m: Point, currents_a: &[f64]) -> Result<Point, OnEdge> {
        let mut sum = [0.0; 3];
        for ([x, y], current) in self.positions_m.iter().zip(currents_a) {
            let (dx, dy) = (place_m[0] - x, place_m[1] - y);
            let field = self.winding.field(dx.hypot(dy), place_m[2])?;
            let own = to_cartesian(&field, dx, dy).field_t_per_a;
            for (sum, own) in sum.iter_mut().zip(own) {
                *sum += current * own;
            }
        }
        Ok(sum)
    }
}

/// The potential of the windings `firsts` at every node of one mirrored copy, [node, winding].
fn potentials(
    surface: &Surface,
    coils: Coils<'_>,
    firsts: &[usize],
    signs: [f64; 2],
    planes_m: [f64; 2],
) -> DMatrix<f64> {
    let positions_m = coils.positions_m;
    let of_winding = |drive: &usize| {
        let [x, y] = positions_m[*drive];
        let of_node = |(number, node): (usize, &Node)| {
            fluxform_base::progress::poll();
            let [px, py, pz] = mirrored(node, signs, planes_m).place_m;
            let face = surface.face_of(number);
            let is_driven = |own: &usize| moved(positions_m, *own, signs, planes_m) == *drive;
            let branch = if face.above.iter().any(is_driven) {
                Branch::Above
            } else if face.bore.as_ref().is_some_and(is_driven) {
                Branch::Bore
            } else {
                Branch::Outside
            };
            coils
                .winding
                .potential((px - x).hypot(py - y), pz, branch, POTENTIAL)
        };
        let nodes = surface.nodes.par_iter().enumerate();
        nodes.map(of_node).collect::<Vec<f64>>()
    };
    let columns: Vec<f64> = firsts.iter().flat_map(of_winding).collect();
    DMatrix::from_vec(surface.size(), firsts.len(), columns)
}

/// A drive as the mirror image of the first of its like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Drive {
    first: usize,
    image: usize,
}

fn drives(positions_m: &[[f64; 2]], images: &[[f64; 2]], planes_m: [f64; 2]) -> Vec<Drive> {
    let mut out: Vec<Drive> = Vec::new();
    for number in 0..positions_m.len() {
        let found = images.iter().enumerate().find_map(|(image, signs)| {
            let first = moved(positions_m, number, *signs, planes_m);
            (first < number).then_some(Drive { first, image })
        });
        out.push(found.unwrap_or(Drive {
            first: number,
            image: 0,
        }));
    }
    // The first of the first.
    for number in 0..out.len() {
        let before = out[out[number].first];
        out[number] = Drive {
            first: before.first,
            image: out[number].image ^ before.image,
        };
    }
    out
}

fn apart_m(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// The drive that a mirrored copy makes of `drive`.
pub(super) fn moved(
    positions_m: &[[f64; 2]],
    drive: usize,
    [sx, sy]: [f64; 2],
    [cx, cy]: [f64; 2],
) -> usize {
    let [x, y] = positions_m[drive];
    let at = [cx + sx * (x - cx), cy + sy * (y - cy)];
    let place = positions_m
        .iter()
        .position(|other| apart_m(*other, at) < SAME_M);
    place.expect("only what the windings share is a mirror")
}

pub(super) fn apart(a: Point, b: Point) -> f64 {
    norm(minus(a, b))
}
