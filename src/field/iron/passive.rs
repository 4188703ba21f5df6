//! The pull of unpowered steel of any shape on the magnet.
//!
//! The equations are factorised once; then every place of the magnet is one more right-hand side, the
//! potential of its dipoles or charges. The layer that they induce acts back on them: F = sum_k (m_k . grad) B + q_k B,
//! and of dipoles the energy W = -(1/2) sum_k m_k . B, whose slope F is too.

use nalgebra::DMatrix;
use rayon::prelude::*;
use std::f64::consts::PI;

use super::array::{MOST_ENTRIES, RESOLUTIONS, coarsest};
use super::bodies::Iron;
use super::face::Point;
use super::near_sources::MagnetRoom;
use super::surface::{Surface, mirrored};
use super::system::{FactoredSystem, System};
use crate::steel::passive::isolated::placed;
use crate::steel::passive::magnet::{PassiveMagnet, dipoles};
use crate::steel::passive::reaction::{Induced, PointSource};
use fluxform_numerics::vec3::{dot, minus, norm, plus};

/// Least part of the difference from the coarsest solution that counts as error: neighbours among the
/// [`RESOLUTIONS`] cut the faces alike away from edges, and may agree better than they are.
const LEAST_SHARE: f64 = 0.1;
/// Differences are known to be as much too small, between cores where their pulls nearly cancel.
const SAFETY: f64 = 2.0;
/// The least distance from a magnet that counts for panels, relative to its least height above the steel, and how
/// often that fits into where the magnet may be: panels are no more than memory is there for.
const LEAST_GAP: f64 = 0.2;
const MOST_ACROSS: f64 = 40.0;
/// Places whose layers are solved together.
const TOGETHER: usize = 32;

/// Steel that answers to dipoles, at one resolution.
#[derive(Debug, Clone)]
struct Answer {
    surface: Surface,
    images: Vec<[f64; 2]>,
    planes_m: [f64; 2],
    system: FactoredSystem,
}

impl Answer {
    /// `None` where the equations have no solution.
    fn new(iron: &Iron, tier: usize, room: Option<&MagnetRoom>) -> Option<Self> {
        let surface = iron.surface_for_magnets(tier, room);
        let images = iron.images();
        let system = System::new(iron, &surface, &images, 0.0, usize::MAX)
            .ok()?
            .factored()?;
        Some(Self {
            surface,
            images,
            planes_m: iron.planes_m,
            system,
        })
    }

    /// The field that the steel sends back to every source of `magnets`, each set acting alone.
    fn induced(&self, magnets: &[Vec<PointSource>]) -> Vec<Vec<Induced>> {
        let size = self.surface.size();
        let potentials: Vec<DMatrix<f64>> = (self.images.iter())
            .map(|signs| {
                let mut potentials = DMatrix::zeros(size, magnets.len());
                let columns = potentials.as_mut_slice().par_chunks_exact_mut(size);
                columns.zip(magnets).for_each(|(column, magnet)| {
                    for (value, node) in column.iter_mut().zip(&self.surface.nodes) {
                        fluxform_base::progress::poll();
                        let place_m = mirrored(node, *signs, self.planes_m).place_m;
                        let sum: f64 = magnet.iter().map(|source| source.potential(place_m)).sum();
                        *value = sum / (4.0 * PI);
                    }
                });
                potentials
            })
            .collect();
        let layers = self.system.solve(&potentials);
        let of_magnet = |(number, magnet): (usize, &Vec<PointSource>)| {
            let of_source = |source: &PointSource| self.field(source.at_m, &layers, number);
            magnet.iter().map(of_source).collect()
        };
        magnets.par_iter().enumerate().map(of_magnet).collect()
    }

    /// The field at a place of one column of the layers, [image]: [node, column].
    fn field(&self, at_m: Point, layers: &[DMatrix<f64>], column: usize) -> Induced {
        fluxform_base::progress::poll();
        let mut sum = Induced::default();
        let [cx, cy] = self.planes_m;
        for ([sx, sy], layer) in self.images.iter().zip(layers) {
            let own = [cx + sx * (at_m[0] - cx), cy + sy * (at_m[1] - cy), at_m[2]];
            let part = self.surface.induced(own, layer.column(column).as_slice());
            let signs = [*sx, *sy, 1.0];
            for i in 0..3 {
                sum.field_t[i] += signs[i] * part.field_t[i];
                for j in 0..3 {
                    sum.gradient_t_per_m[i][j] += signs[i] * signs[j] * part.gradient_t_per_m[i][j];
                }
            }
        }
        sum
    }
}

/// The last of the [`RESOLUTIONS`] for which there is memory; `None` where there is none for two.
fn last_tier(iron: &Iron, room: Option<&MagnetRoom>) -> Option<usize> {
    let images = iron.images().len();
    // Entries and their factors are held at once.
    let fits = |tier: &usize| {
        let size = iron.surface_for_magnets(*tier, room).size();
        2 * images * size.pow(2) <= MOST_ENTRIES
    };
    (1..RESOLUTIONS.len()).take_while(fits).last()
}

/// The first and the last of the [`RESOLUTIONS`] to try for a tolerance.
fn tiers(tolerance: f64, last: Option<usize>) -> [usize; 2] {
    let last = last.unwrap_or(1);
    [coarsest(tolerance).min(last - 1), last]
}

/// Where the sources of `magnet` may be with its centre among `places_m`, and their images; `None` where they are
/// not above the steel.
fn room(iron: &Iron, magnet: &PassiveMagnet, places_m: &[Point]) -> Option<MagnetRoom> {
    let lowest_m = places_m.iter().fold(f64::INFINITY, |z, at| z.min(at[2]));
    let sources = magnet.sources(lowest_m);
    let ends = |i: usize| {
        let of = |ends: [f64; 2], at: f64| [ends[0].min(at), ends[1].max(at)];
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        let centres = places_m.iter().map(|place| place[i]).fold(none, of);
        let about = sources.iter().map(|source| source.at_m[i]).fold(none, of);
        [centres[0] + about[0], centres[1] + about[1]]
    };
    let [x_m, y_m, z_m] = [0, 1, 2].map(ends);
    let gap_m = z_m[0] - iron.top_m();
    let image = |signs: [f64; 2]| {
        let [x_m, y_m] = [(x_m, 0), (y_m, 1)].map(|(ends, axis)| {
            let plane_m = iron.planes_m[axis];
            let [a, b] = ends.map(|at| plane_m + signs[axis] * (at - plane_m));
            [a.min(b), a.max(b)]
        });
        let sides = [x_m, y_m, z_m];
        [sides.map(|[low, _]| low), sides.map(|[_, high]| high)]
    };
    let width_m = (x_m[1] - x_m[0]).max(y_m[1] - y_m[0]);
    (gap_m > 0.0).then(|| MagnetRoom {
        boxes_m: iron.images().into_iter().map(image).collect(),
        least_m: (LEAST_GAP * gap_m).max(width_m / MOST_ACROSS),
    })
}

/// The pull on a magnet.
#[derive(Debug, Clone)]
pub struct IronPull {
    answer: Answer,
    magnet: PassiveMagnet,
    /// Estimated error of a force, relative to its length: twice the largest difference from the next coarser
    /// resolution at the places that it was made for, or a tenth of that from the coarsest, and the bound of the
    /// magnet's dipoles.
    pub relative_error: f64,
}

impl IronPull {
    /// The pull to an estimated error of `tolerance` at `places_m`, or as near to it as memory allows:
    /// [`IronPull::relative_error`] says what was reached. `None` where the steel's equations have no
    /// solution.
    #[must_use]
    pub fn new(
        iron: &Iron,
        magnet: PassiveMagnet,
        places_m: &[Point],
        tolerance: f64,
    ) -> Option<Self> {
        let mut best: Option<Self> = None;
        let room = room(iron, &magnet, places_m);
        // Panels of the whole steel's size do for most; what they do not do for takes finer ones near the magnet.
        for room in [None].into_iter().chain(room.as_ref().map(Some)) {
            let last = last_tier(iron, room);
            if last.is_none() && best.is_some() {
                break;
            }
            let made = Self::among(iron, magnet, places_m, tolerance, (room, last));
            best = [best, made].into_iter().flatten().reduce(|a, b| {
                if b.relative_error < a.relative_error {
                    b
                } else {
                    a
                }
            });
            if best.as_ref().is_none_or(|b| b.relative_error <= tolerance) {
                break;
            }
        }
        best
    }

    /// The same among the resolutions up to `last`, cut more finely near `room` where that is named.
    fn among(
        iron: &Iron,
        magnet: PassiveMagnet,
        places_m: &[Point],
        tolerance: f64,
        (room, last): (Option<&MagnetRoom>, Option<usize>),
    ) -> Option<Self> {
        let lowest_m = places_m.iter().fold(f64::INFINITY, |z, at| z.min(at[2]));
        let bound = magnet.rule_error(lowest_m);
        let [first, last] = tiers(tolerance, last);
        let mut pull = Self::at_tier(iron, magnet, first, room)?;
        let coarsest = pull.forces_n(places_m);
        let mut forces = coarsest.clone();
        for tier in first + 1..=last {
            pull = Self::at_tier(iron, magnet, tier, room)?;
            let finer = pull.forces_n(places_m);
            let difference = |coarse: &[Point]| {
                let apart = |(a, b): (&Point, &Point)| norm(minus(*a, *b)) / norm(*b);
                coarse.iter().zip(&finer).map(apart).fold(0.0, f64::max)
            };
            let error = difference(&forces).max(LEAST_SHARE * difference(&coarsest));
            pull.relative_error = SAFETY * error + bound;
            if pull.relative_error <= tolerance {
                break;
            }
            forces = finer;
        }
        Some(pull)
    }

    /// Unknowns of one mirrored part, and number of the parts, of the coarsest solution that [`IronPull::new`] ends with.
    #[must_use]
    pub fn least_size(iron: &Iron, tolerance: f64) -> [usize; 2] {
        let [first, _] = tiers(tolerance, last_tier(iron, None));
        let surface = iron.surface_for_magnets(first + 1, None);
        [surface.size(), iron.images().len()]
    }

    /// At one of the [`RESOLUTIONS`]; `None` where the steel's equations have no solution.
    #[must_use]
    pub fn at_resolution(iron: &Iron, magnet: PassiveMagnet, tier: usize) -> Option<Self> {
        Self::at_tier(iron, magnet, tier, None)
    }

    fn at_tier(
        iron: &Iron,
        magnet: PassiveMagnet,
        tier: usize,
        room: Option<&MagnetRoom>,
    ) -> Option<Self> {
        Some(Self {
            answer: Answer::new(iron, tier, room)?,
            magnet,
            relative_error: f64::NAN,
        })
    }

    /// Number of unknowns of one mirrored part.
    #[must_use]
    pub fn size(&self) -> usize {
        self.answer.surface.size()
    }

    /// The force on the magnet with its centre at each of `places_m`, N.
    #[must_use]
    pub fn forces_n(&self, places_m: &[Point]) -> Vec<Point> {
        let sources = |at: &Point| self.magnet.sources(at[2]);
        self.at_places(places_m, sources, |sources, back| {
            let forces = sources
                .iter()
                .zip(back)
                .map(|(source, field)| source.force_n(field));
            forces.fold([0.0; 3], plus)
        })
    }

    /// The energy of the magnet, by dipoles throughout it, with its centre at each of `places_m`, J.
    #[must_use]
    pub fn energies_j(&self, places_m: &[Point]) -> Vec<f64> {
        let throughout = |at: &Point| dipoles(&self.magnet.magnet_rule(at[2]));
        self.at_places(places_m, throughout, |dipoles, back| {
            let fields = dipoles.iter().zip(back);
            let along = fields.map(|(dipole, field)| dot(dipole.moment_a_m2, field.field_t));
            -0.5 * along.sum::<f64>()
        })
    }

    /// `of` every place the sources that stand for the magnet there and what the steel sends back to them.
    fn at_places<T: Send>(
        &self,
        places_m: &[Point],
        sources: impl Fn(&Point) -> Vec<PointSource> + Sync,
        of: impl Fn(&[PointSource], &[Induced]) -> T + Sync,
    ) -> Vec<T> {
        let portions: Vec<Vec<T>> = places_m
            .par_chunks(TOGETHER)
            .map(|places_m| {
                let magnet = |at: &Point| placed(&sources(at), *at);
                let magnets: Vec<Vec<PointSource>> = places_m.iter().map(magnet).collect();
                let back = self.answer.induced(&magnets);
                let pairs = magnets.iter().zip(&back);
                pairs.map(|(sources, back)| of(sources, back)).collect()
            })
            .collect();
        portions.into_iter().flatten().collect()
    }
}
