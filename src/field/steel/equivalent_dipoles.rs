//! The steel's field above a solved array, as that of few point dipoles.
//!
//! Seen from some distance a core's layer is its moments on rings that are no finer than the
//! distance asks for, whatever the layer does at the edges. The dipoles of all cores are shared
//! by all drives, which differ in their moments alone: one pass over them serves every drive.

use crate::components::Components;
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use super::CoreShape;
use super::generatrix::Generatrix;
use super::response::{RingPanel, Rings, ring_panels};
use super::symmetry::{Images, Motion, centre_m, motions};
use crate::winding::Winding;
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::dispatch::{self, Kernel, LANES, Lanes};

/// Points of one piece of work; fixed, so that results do not depend on threads.
const CHUNK: usize = 64;
/// Length of a ring panel relative to its distance from the points.
const PANEL: f64 = 1.5;
/// Points closer to the steel than this multiple of its radius are treated as this far.
const CLOSEST: f64 = 0.02;
/// Most angles of a ring.
const MOST_ANGLES: usize = 2000;
/// Angles of a ring beyond its layer's modes, at least.
const LEAST_ANGLES: usize = 3;
/// Tolerance of a panel, at most.
const MOST_TOLERANCE: f64 = 0.3;
/// Drives for which fewer dipoles are compared with those that are sure to do.
const COMPARED_DRIVES: usize = 3;
/// Cores about which they are compared.
const COMPARED_CORES: usize = 3;
/// Powers of ten by which fewer dipoles may aim beside the tolerance.
const MOST_LOOSENED: i32 = 6;
/// The part of the tolerance that they may miss by at the places compared.
const COMPARED_SHARE: f64 = 0.1;

/// Most digits by which the layer's parts may cancel in the field that is left.
const MOST_CANCELLATION: f64 = 1e12;

/// How close points come, and how exact their values are to be.
pub(super) struct Near<'a> {
    pub(super) lowest_m: f64,
    pub(super) distance_m: f64,
    pub(super) tolerance: f64,
    /// Whether places are so many that it pays to find the fewest dipoles for them.
    pub(super) many: bool,
    /// The winding, whose gradient is what errors are relative to.
    pub(super) winding: &'a Winding,
}

impl Near<'_> {
    /// The least distance from a core that counts, m.
    fn floor_m(&self, shape: CoreShape) -> f64 {
        self.distance_m.max(CLOSEST * shape.radius_m)
    }

    /// Distance of the places from what lies at the height `z_m`, at least, m.
    fn clearance_m(&self, shape: CoreShape, z_m: f64) -> f64 {
        self.floor_m(shape).max(self.lowest_m - z_m)
    }

    /// The gradient that errors at a height are relative to, T/m/A.
    fn size_at(&self, z_m: f64) -> f64 {
        let field = self.winding.field(self.winding.outer_radius_m, z_m);
        field.map_or(f64::INFINITY, |field| field.gradient_norm())
    }
}

/// Largest gradients that the rings of a layer would have alone, added up on each of `panels`, T/m:
/// how far above the layer's field their sum is, so many digits cancel.
fn parts_of_layer(
    outline: &Generatrix,
    panels: &[RingPanel],
    largest: &[f64],
    distance: impl Fn(f64) -> f64,
) -> Vec<f64> {
    let areas_m2: Vec<f64> = outline.areas_m2().collect();
    let mut parts = vec![0.0; panels.len()];
    for (index, node) in outline.nodes.iter().enumerate() {
        let own = &outline.panels[index / outline.order];
        let at_m = own.coordinate_of(node);
        let holds =
            |(face, from, to): &RingPanel| *face == own.face && (*from..=*to).contains(&at_m);
        let d = distance(node.z_m);
        // A ring's part near a point is as long as its distance, at most the whole ring.
        let share = (d / (PI * node.r_m)).min(1.0);
        let dipole = 6.0 * MU_0_T_M_PER_A / (4.0 * PI * d.powi(4));
        if let Some(panel) = panels.iter().position(holds) {
            parts[panel] += areas_m2[index] * largest[index] * share * dipole;
        }
    }
    parts
}

/// Dipoles around a ring whose points are `ratio` radii away.
fn angles_of(ratio: f64, modes: usize, tolerance: f64) -> usize {
    // Slowest where r^2 = ring^2 + distance^2.
    let decay = ratio.asinh();
    // The gradient of a dipole's field has azimuthal modes n^2.5 exp(-n decay).
    let digits = (1.0 / tolerance).ln();
    let growth = 2.5 * (digits / decay).max(1.0).ln();
    let needed = ((digits + growth) / decay).ceil() as usize;
    // A mode m passes for the kernel's mode n - m.
    (modes + needed.max(LEAST_ANGLES)).min(MOST_ANGLES)
}

/// Position (m) and outer normal of every dipole of every core.
fn dipole_places(rings: &Rings, angles: &[usize], positions_m: &[[f64; 2]]) -> Vec<[f64; 6]> {
    let mut places = Vec::new();
    for position in positions_m {
        for (ring, angles) in rings.rings.iter().zip(angles) {
            places.extend((0..*angles).map(|k| {
                let (s, c) = (TAU * (k as f64 + 0.5) / *angles as f64).sin_cos();
                [
                    position[0] + ring.r_m * c,
                    position[1] + ring.r_m * s,
                    ring.z_m,
                    ring.normal[0] * c,
                    ring.normal[0] * s,
                    ring.normal[1],
                ]
            }));
        }
    }
    places
}

/// The moments of a core's dipoles from those of its rings' azimuthal modes, in the order of
/// [`dipole_places`].
fn dipole_moments(
    by_mode: &DMatrix<f64>,
    waves: &Waves,
    angles: &[usize],
    mut put: impl FnMut(usize, f64),
) {
    let mut place = 0;
    for (ring, angles) in angles.iter().enumerate() {
        let turn = TAU / *angles as f64;
        let of_ring = by_mode.row(ring);
        let of_ring_waves = waves.at(*angles);
        for wave in of_ring_waves.chunks_exact(of_ring_waves.len() / angles) {
            let moment: f64 = wave.iter().zip(of_ring.iter()).map(|(w, m)| w * m).sum();
            put(place, turn * moment);
            place += 1;
        }
    }
}

/// The azimuthal waves of a layer at every angle of a ring, for rings of every number of angles: 1, then
/// cosine and sine of every mode.
struct Waves(BTreeMap<usize, Vec<f64>>);

impl Waves {
    fn new(modes: usize, angles: &[usize]) -> Self {
        let of_ring = |angles: usize| {
            let turn = TAU / angles as f64;
            let at = move |k: usize| {
                let theta = turn * (k as f64 + 0.5);
                let waves = (1..modes).flat_map(move |mode| {
                    let (s, c) = (mode as f64 * theta).sin_cos();
                    [c, s]
                });
                std::iter::once(1.0).chain(waves)
            };
            (0..angles).flat_map(at).collect()
        };
        Self(
            angles
                .iter()
                .map(|count| (*count, of_ring(*count)))
                .collect(),
        )
    }

    /// [angle, wave] of a ring of that many angles.
    fn at(&self, angles: usize) -> &[f64] {
        self.0.get(&angles).map_or(&[], |waves| waves)
    }
}

/// What dipoles are to stand for.
struct DipoleTask<'a> {
    outline: &'a Generatrix,
    positions_m: &'a [[f64; 2]],
    /// Azimuthal modes of a core's layer.
    modes: usize,
    near: &'a Near<'a>,
    panels: Vec<RingPanel>,
    /// By how much each panel's tolerance may be above the mean.
    slack: Vec<f64>,
}

impl DipoleTask<'_> {
    /// As many dipoles as `tolerance` asks for a priori, for some of the drives.
    fn sources(
        &self,
        tolerance: f64,
        drives: &[usize],
        layers: &(impl Fn(usize, usize) -> DMatrix<f64> + Sync),
    ) -> ArraySources {
        let shape = self.outline.shape;
        let distance = |z_m: f64| self.near.clearance_m(shape, z_m);
        let of_panel: Vec<f64> = (self.slack.iter())
            .map(|slack| (slack * tolerance).min(MOST_TOLERANCE))
            .collect();
        let orders: Vec<usize> = (of_panel.iter())
            .map(|tolerance| (4.0 - 1.3 * tolerance.log10()).ceil() as usize)
            .collect();
        let rings = Rings::on_panels(self.outline, &self.panels, &orders);
        let of_ring = of_panel
            .iter()
            .zip(&orders)
            .flat_map(|(tolerance, order)| std::iter::repeat_n(*tolerance, *order));
        let angles: Vec<usize> = (rings.rings.iter().zip(of_ring))
            .map(|(ring, aim)| angles_of(distance(ring.z_m) / ring.r_m, self.modes, aim))
            .collect();
        let places = dipole_places(&rings, &angles, self.positions_m);
        let a_core = places.len() / self.positions_m.len().max(1);
        let columns = drives.len();
        let mut moments = vec![0.0; places.len() * columns];
        let waves = Waves::new(self.modes, &angles);
        moments
            .par_chunks_mut((a_core * columns).max(1))
            .enumerate()
            .for_each(|(core, out)| {
                for (column, drive) in drives.iter().enumerate() {
                    fluxform_base::progress::poll();
                    let by_mode = rings.moments(&layers(*drive, core));
                    dipole_moments(&by_mode, &waves, &angles, |place, moment| {
                        out[place * columns + column] = moment;
                    });
                }
            });
        ArraySources {
            drives: columns,
            top_m: shape.top_m,
            places,
            moments,
            symmetry: Default::default(),
        }
    }

    /// By how much the tolerance may be loosened so that the dipoles that are left still give what
    /// those of `tolerance` give, within a part of what is requested.
    fn fewest(
        &self,
        tolerance: f64,
        height_m: f64,
        drives: &[usize],
        layers: &(impl Fn(usize, usize) -> DMatrix<f64> + Sync),
    ) -> f64 {
        let shape = self.outline.shape;
        let places = self.compared_places();
        // Computed once: every comparison needs them.
        let cores = self.positions_m.len();
        let known: Vec<DMatrix<f64>> = (0..drives.len() * cores)
            .into_par_iter()
            .map(|i| layers(drives[i / cores], i % cores))
            .collect();
        let known = |drive: usize, core: usize| known[drive * cores + core].clone();
        let columns: Vec<usize> = (0..drives.len()).collect();
        let sizes: Vec<f64> = places
            .iter()
            .map(|[_, _, z]| self.near.size_at(z.max(shape.top_m.max(0.0)).max(height_m)))
            .collect();
        let values = |tolerance: f64| {
            let sources = self.sources(tolerance, &columns, &known);
            let mut out = vec![0.0; columns.len() * Components::Gradient.count() * places.len()];
            sources.sample(&places, Components::Gradient, &mut out);
            out
        };
        let sure = values(tolerance);
        let loosened = |power: i32| 10_f64.powi(power);
        let holds = |power: i32| {
            let fewer = values(tolerance * loosened(power));
            let rows = fewer
                .chunks_exact(places.len())
                .zip(sure.chunks_exact(places.len()));
            rows.flat_map(|(fewer, sure)| fewer.iter().zip(sure).zip(&sizes))
                .all(|((a, b), size)| (a - b).abs() <= COMPARED_SHARE * self.near.tolerance * size)
        };
        // The power that holds and the one that does not close in on each other.
        let (mut good, mut bad) = (0, MOST_LOOSENED + 1);
        while bad - good > 1 {
            let middle = (good + bad).div_euclid(2);
            if holds(middle) {
                good = middle;
            } else {
                bad = middle;
            }
        }
        loosened(good)
    }

    /// Places as close to some of the cores as any may be, and some farther ones.
    fn compared_places(&self) -> Vec<[f64; 3]> {
        let (shape, lowest_m) = (self.outline.shape, self.near.lowest_m);
        let floor_m = self.near.floor_m(shape);
        let edge = |part: f64, angle: f64| {
            let (s, c) = angle.sin_cos();
            [
                part * shape.radius_m + floor_m * s,
                shape.top_m + floor_m * c,
            ]
        };
        // Above the top, about its edge, beside it.
        let close = [
            edge(0.0, 0.0),
            edge(0.4, 0.0),
            edge(0.8, 0.0),
            edge(1.0, 0.0),
            edge(1.0, 0.4),
            edge(1.0, 0.8),
            edge(1.0, 0.5 * PI),
        ];
        let beside = [0.1, 0.4, 1.0].map(|part| {
            let z_m = shape.top_m - part * shape.length_m();
            [shape.radius_m + floor_m, z_m]
        });
        let farther = [[0.0, 1.0], [1.0, 1.0], [2.0, 2.0]].map(|[r, z]| {
            [
                r * shape.radius_m,
                shape.top_m + floor_m + z * shape.radius_m,
            ]
        });
        let about = close.iter().chain(&beside).chain(&farther);
        let mut places = Vec::new();
        for core in spread_over(self.positions_m.len(), COMPARED_CORES) {
            let [x, y] = self.positions_m[core];
            for [r_m, z_m] in about.clone() {
                // No two at one angle.
                let (s, c) = (2.399_963 * places.len() as f64).sin_cos();
                places.push([x + r_m * c, y + r_m * s, z_m.max(lowest_m)]);
            }
        }
        let clear = |place: &[f64; 3]| {
            self.positions_m.iter().all(|[x, y]| {
                let r_m = (place[0] - x).hypot(place[1] - y);
                shape.distance_m(r_m, place[2]) >= 0.999 * floor_m
            })
        };
        places.retain(clear);
        places
    }
}

/// At most `most` of `count` indices, from the first to the last.
pub(super) fn spread_over(count: usize, most: usize) -> Vec<usize> {
    let chosen = count.min(most);
    (0..chosen)
        .map(|k| k * (count - 1) / (chosen - 1).max(1))
        .collect()
}

/// Dipoles that stand for all cores of an array, for every drive.
#[derive(Debug, Clone)]
pub struct ArraySources {
    drives: usize,
    top_m: f64,
    /// Position (m) and outer normal of every dipole.
    places: Vec<[f64; 6]>,
    /// Layer moments of every dipole, [dipole, drive], A m^2 per ampere.
    moments: Vec<f64>,
    /// The array's centre, m, and its motions, where the drives are its coils; none otherwise.
    symmetry: ([f64; 2], Vec<Motion>),
}

impl ArraySources {
    /// The same, whose drives are the coils at `positions_m`, in their order: their symmetry is used.
    pub(super) fn driven_by_coils(self, positions_m: &[[f64; 2]]) -> Self {
        Self {
            symmetry: (centre_m(positions_m), motions(positions_m)),
            ..self
        }
    }

    pub(super) fn new(
        outline: &Generatrix,
        positions_m: &[[f64; 2]],
        modes: usize,
        drives: usize,
        layers: impl Fn(usize, usize) -> DMatrix<f64> + Sync,
        near: Near<'_>,
    ) -> Self {
        let shape = outline.shape;
        let floor_m = near.floor_m(shape);
        let distance = |z_m: f64| near.clearance_m(shape, z_m);
        // A layer's parts cancel (a constant layer has no field at all), so that an error relative
        // to one ring's field is a larger one relative to the field that is left.
        let largest = largest_layer(outline, positions_m.len(), drives, &layers);
        let height_m = (shape.top_m.max(0.0) + floor_m).max(near.lowest_m);
        let size = near.size_at(height_m);
        let panels = ring_panels(shape, |z| PANEL * distance(z));
        let parts = parts_of_layer(outline, &panels, &largest, distance);
        let sum: f64 = parts.iter().sum();
        let tolerance = near.tolerance / (sum / size).clamp(1.0, MOST_CANCELLATION);
        // Every panel may err by as much, whatever part of the sum it has.
        let even = sum / parts.len() as f64;
        let task = DipoleTask {
            outline,
            positions_m,
            modes,
            near: &near,
            slack: parts.iter().map(|part| even / part).collect(),
            panels,
        };
        // A priori every part counts as if it stood alone and its layer were as rough as can be;
        // how much less does is seen by comparison.
        let fewer = if near.many {
            let compared = spread_over(drives, COMPARED_DRIVES);
            task.fewest(tolerance, height_m, &compared, &layers)
        } else {
            1.0
        };
        let every: Vec<usize> = (0..drives).collect();
        task.sources(tolerance * fewer, &every, &layers)
    }

    /// Dipoles given as such: places (m) with unit normals, and layer moments [dipole, drive].
    pub(crate) fn of_dipoles(
        drives: usize,
        top_m: f64,
        places: Vec<[f64; 6]>,
        moments: Vec<f64>,
    ) -> Self {
        Self {
            drives,
            top_m,
            places,
            moments,
            symmetry: Default::default(),
        }
    }

    /// The same at these currents of the drives, together one drive of one ampere.
    ///
    /// # Panics
    /// When there are not as many currents as drives.
    #[must_use]
    pub fn at_currents(&self, currents_a: &[f64]) -> Self {
        assert_eq!(currents_a.len(), self.drives);
        let of_all = |moments: &[f64]| moments.iter().zip(currents_a).map(|(m, i)| m * i).sum();
        let moments = self.moments.chunks_exact(self.drives);
        let moments = moments.map(of_all).collect();
        Self::of_dipoles(1, self.top_m, self.places.clone(), moments)
    }

    /// Number of drives.
    #[must_use]
    pub fn drives(&self) -> usize {
        self.drives
    }

    /// Height of the cores' top, m.
    #[must_use]
    pub fn top_m(&self) -> f64 {
        self.top_m
    }

    /// Number of dipoles.
    #[must_use]
    pub fn count(&self) -> usize {
        self.places.len()
    }

    /// The steel's field per ampere of every drive at `points_m`, [drive, component, point].
    ///
    /// # Panics
    /// When `out` has another length than drives x components x points.
    pub fn sample(&self, points_m: &[[f64; 3]], parts: Components, out: &mut [f64]) {
        let columns = self.drives * parts.count();
        assert_eq!(out.len(), columns * points_m.len());
        let (centre_m, motions) = &self.symmetry;
        if motions.len() > 1 {
            let images = Images::new(motions, *centre_m, points_m);
            let mut sector = vec![0.0; columns * images.sector_m.len()];
            self.sample_all(&images.sector_m, parts, &mut sector);
            images.spread(parts, &sector, out);
        } else {
            self.sample_all(points_m, parts, out);
        }
    }

    /// The same without the array's symmetry.
    pub(super) fn sample_all(&self, points_m: &[[f64; 3]], parts: Components, out: &mut [f64]) {
        let columns = self.drives * parts.count();
        let chunks: Vec<Vec<f64>> = points_m
            .par_chunks(CHUNK)
            .map(|points| {
                dispatch::run(Pass {
                    sources: self,
                    points,
                    parts,
                })
            })
            .collect();
        for (chunk, values) in chunks.iter().enumerate() {
            let count = values.len() / columns;
            for column in 0..columns {
                let at = column * points_m.len() + chunk * CHUNK;
                out[at..at + count].copy_from_slice(&values[column * count..(column + 1) * count]);
            }
        }
    }
}

/// The largest layer on every node over all drives and cores, A per ampere.
fn largest_layer(
    outline: &Generatrix,
    cores: usize,
    drives: usize,
    layers: &(impl Fn(usize, usize) -> DMatrix<f64> + Sync),
) -> Vec<f64> {
    let of_core = |core: usize| {
        let mut largest = vec![0.0_f64; outline.nodes.len()];
        for drive in 0..drives {
            for (largest, row) in largest.iter_mut().zip(layers(drive, core).row_iter()) {
                *largest = largest.max(row.iter().map(|v| v.abs()).sum());
            }
        }
        largest
    };
    let all: Vec<Vec<f64>> = (0..cores).into_par_iter().map(of_core).collect();
    (0..outline.nodes.len())
        .map(|node| all.iter().fold(0.0_f64, |m, core| m.max(core[node])))
        .collect()
}

/// One chunk of points, [drive, component, point].
struct Pass<'a> {
    sources: &'a ArraySources,
    points: &'a [[f64; 3]],
    parts: Components,
}

impl Kernel for Pass<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> Vec<f64> {
        match self.parts {
            Components::Gz => self.run_parts::<FMA, 1>(),
            Components::Force => self.run_parts::<FMA, 3>(),
            Components::Gradient => self.run_parts::<FMA, 5>(),
            Components::All => self.run_parts::<FMA, 8>(),
        }
    }
}

impl Pass<'_> {
    #[inline(always)]
    fn run_parts<const FMA: bool, const PARTS: usize>(self) -> Vec<f64> {
        let drives = self.sources.drives;
        let count = self.points.len();
        let mut out = vec![0.0; drives * PARTS * count];
        for (group, points) in self.points.chunks(LANES).enumerate() {
            fluxform_base::progress::poll();
            let axis = |i: usize| {
                Lanes(std::array::from_fn(|lane| {
                    points[lane.min(points.len() - 1)][i]
                }))
            };
            let (x, y, z) = (axis(0), axis(1), axis(2));
            let mut sums = vec![[Lanes::splat(0.0); PARTS]; drives];
            for (place, moments) in self
                .sources
                .places
                .iter()
                .zip(self.sources.moments.chunks_exact(drives))
            {
                let kernel = dipole::<FMA, PARTS>([x, y, z], place);
                for (sum, moment) in sums.iter_mut().zip(moments) {
                    let moment = Lanes::splat(*moment);
                    for (sum, part) in sum.iter_mut().zip(&kernel) {
                        *sum = part.mul_add::<FMA>(moment, *sum);
                    }
                }
            }
            for (drive, sum) in sums.iter().enumerate() {
                for (part, value) in sum.iter().enumerate() {
                    let at = (drive * PARTS + part) * count + group * LANES;
                    let end = at + points.len();
                    value.store(&mut out[at..end]);
                }
            }
        }
        out
    }
}

/// Field of a layer element of unit moment: of a point dipole -n, A m^2.
#[inline(always)]
fn dipole<const FMA: bool, const PARTS: usize>(
    [x, y, z]: [Lanes; 3],
    place: &[f64; 6],
) -> [Lanes; PARTS] {
    let [px, py, pz, nx, ny, nz] = *place;
    let (dx, dy, dz) = (x - px, y - py, z - pz);
    let square = dx.mul_add::<FMA>(dx, dy.mul_add::<FMA>(dy, dz * dz));
    let inverse2 = Lanes::splat(1.0) / square;
    let inverse = inverse2.sqrt();
    let inverse3 = inverse * inverse2;
    let along = (dx * nx) + (dy * ny) + (dz * nz);
    let scale = inverse3 * inverse2 * (-3.0 * MU_0_T_M_PER_A / (4.0 * PI));
    // G_ij = scale (n_i d_j + n_j d_i + s (delta_ij - 5 d_i d_j / d^2)).
    let steep = along * inverse2 * -5.0;
    let zz = scale * (dz * (2.0 * nz) + along + steep * (dz * dz));
    let mut out = [Lanes::splat(0.0); PARTS];
    if PARTS == 1 {
        out[0] = zz;
        return out;
    }
    let mut parts = [Lanes::splat(0.0); 8];
    parts[0] = scale * (dx * (2.0 * nx) + along + steep * (dx * dx));
    parts[1] = scale * (dy * nx + dx * ny + steep * (dx * dy));
    parts[2] = scale * (dz * nx + dx * nz + steep * (dx * dz));
    parts[3] = scale * (dz * ny + dy * nz + steep * (dy * dz));
    parts[4] = zz;
    if PARTS == 8 {
        // B_i = scale s d_i + mu_0 n_i / (4 pi d^3).
        let even = inverse3 * (MU_0_T_M_PER_A / (4.0 * PI));
        let strength = scale * along;
        parts[5] = strength * dx + even * nx;
        parts[6] = strength * dy + even * ny;
        parts[7] = strength * dz + even * nz;
    }
    // Those along z alone: the last of the gradient's.
    let first = if PARTS == 3 { 2 } else { 0 };
    out.copy_from_slice(&parts[first..first + PARTS]);
    out
}
