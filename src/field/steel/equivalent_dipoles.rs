//! The steel's field above a solved array, as that of few point dipoles.
//!
//! Seen from some distance a core's layer is its moments on rings that are no finer than the
//! distance asks for, whatever the layer does at the edges. The dipoles of all cores are shared
//! by all drives, which differ in their moments alone; from farther away fewer of them do.

use crate::components::Components;
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use super::CoreShape;
pub use super::array_sources::ArraySources;
use super::array_sources::{DipolePlace, Level};
use super::clearance::Clearance;
use super::core_layers::CoreLayers;
use super::generatrix::{Generatrix, Node};
use super::response::{RingPanel, Rings, ring_panels};
use crate::winding::Winding;
use fluxform_base::units::MU_0_T_M_PER_A;

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
/// Times that a place is compared, at as many angles.
const COMPARED_ANGLES: usize = 3;
/// Drives over which layers' largest values are looked for.
const LARGEST_DRIVES: usize = 8;
/// Growth of the distance from one level of dipoles to the next, at least, and most levels.
const GROWTH: f64 = 2.0;
const MOST_LEVELS: usize = 6;
/// The least growth where at most so many cores profit from a level, which costs what its comparisons do.
const GROWTH_OF_FEW: f64 = 6.0;
const FEW_CORES: usize = 16;
/// Powers of ten by which fewer dipoles may aim beside the tolerance.
const MOST_LOOSENED: i32 = 6;
/// The part of the tolerance that they may miss by at the places compared, and the part that those of one
/// of many cores may.
const COMPARED_SHARE: f64 = 0.1;
const LEAST_SHARE: f64 = 0.02;

/// Most digits by which the layer's parts may cancel in the field that is left.
const MOST_CANCELLATION: f64 = 1e12;

/// How close points come, and how exact their values are to be.
#[derive(Clone, Copy)]
pub(super) struct Near<'a> {
    pub(super) clearance: Clearance,
    pub(super) tolerance: f64,
    /// Whether places are so many that it pays to find the fewest dipoles for them.
    pub(super) many: bool,
    /// The winding, whose gradient is what errors are relative to.
    pub(super) winding: &'a Winding,
}

impl Near<'_> {
    /// The least distance from a core that counts, m.
    fn floor_m(&self, shape: CoreShape) -> f64 {
        self.clearance.distance_m.max(CLOSEST * shape.radius_m)
    }

    /// Distance of the places from what lies at the height `z_m`, at least, m.
    fn clearance_m(&self, shape: CoreShape, z_m: f64) -> f64 {
        self.floor_m(shape)
            .max(self.clearance.from_heights_m(z_m, z_m))
    }

    /// Length of a ring panel that begins at the height `z_m` and goes down, at most, m.
    fn panel_m(&self, shape: CoreShape, z_m: f64) -> f64 {
        // Above the places its lower end is the nearest to them.
        let above_m = (z_m - self.clearance.highest_m) / (1.0 + PANEL);
        let below_m = self.clearance.lowest_m - z_m;
        PANEL * self.floor_m(shape).max(below_m).max(above_m)
    }

    /// The gradient that errors at a height are relative to, T/m/A, and the field, T/A.
    fn sizes_at(&self, z_m: f64) -> [f64; 2] {
        let field = self.winding.field(self.winding.outer_radius_m, z_m);
        field.map_or([f64::INFINITY; 2], |field| {
            [field.gradient_norm(), field.b_r.hypot(field.b_z)]
        })
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
    for (index, own) in outline.panels.iter().enumerate() {
        let nodes = index * outline.order..(index + 1) * outline.order;
        // Each node's weight is the length around it: panels may be many between two nodes.
        let mut end_m = own.range_m().0;
        let mut ascending: Vec<usize> = nodes.collect();
        if own.to_m < own.from_m {
            ascending.reverse();
        }
        for node in ascending {
            let Node {
                r_m, z_m, weight_m, ..
            } = outline.nodes[node];
            let (low, high) = (end_m, end_m + weight_m);
            end_m = high;
            let d = distance(z_m);
            // A ring's part near a point is as long as its distance, at most the whole ring.
            let share = (d / (PI * r_m)).min(1.0);
            let dipole = 6.0 * MU_0_T_M_PER_A / (4.0 * PI * d.powi(4));
            let part = areas_m2[node] * largest[node] * share * dipole;
            for ((face, from, to), sum) in panels.iter().zip(&mut parts) {
                if *face == own.face {
                    *sum += part * (high.min(*to) - low.max(*from)).max(0.0) / weight_m;
                }
            }
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

/// The layers that the dipoles of a level represent.
struct DipoleTask<'a> {
    outline: &'a Generatrix,
    layers: &'a CoreLayers<'a>,
    near: Near<'a>,
    /// The gradient that errors at each height are relative to is no larger than here, m.
    height_m: f64,
    panels: Vec<RingPanel>,
    /// By how much each panel's tolerance may be above the mean.
    slack: Vec<f64>,
    /// The tolerance by which dipoles are sure to do.
    tolerance: f64,
}

/// Dipoles about a core at the origin.
struct Dipoles {
    places: Vec<DipolePlace>,
    /// Their moments of every pattern, [dipole, pattern].
    moments: DMatrix<f64>,
}

impl<'a> DipoleTask<'a> {
    fn new(
        outline: &'a Generatrix,
        layers: &'a CoreLayers<'a>,
        largest: &[f64],
        near: Near<'a>,
    ) -> Self {
        let shape = outline.shape;
        let floor_m = near.floor_m(shape);
        let distance = |z_m: f64| near.clearance_m(shape, z_m);
        let height_m = (shape.top_m.max(0.0) + floor_m).max(near.clearance.lowest_m);
        let panels = ring_panels(shape, |z_m| near.panel_m(shape, z_m));
        // A layer's parts cancel (a constant layer has no field at all), so that an error relative
        // to one ring's field is a larger one relative to the field that is left.
        let parts = parts_of_layer(outline, &panels, largest, distance);
        let sum: f64 = parts.iter().sum();
        let [size, _] = near.sizes_at(height_m);
        let cancellation = (sum / size).clamp(1.0, MOST_CANCELLATION);
        // Every panel may err by as much, whatever part of the sum it has.
        let even = sum / parts.len() as f64;
        Self {
            outline,
            layers,
            near,
            height_m,
            slack: parts.iter().map(|part| even / part).collect(),
            panels,
            tolerance: near.tolerance / cancellation,
        }
    }

    /// As many dipoles as `tolerance` asks for a priori, for `layers` of the task's or some of them.
    fn dipoles(&self, layers: &CoreLayers<'_>, tolerance: f64) -> Dipoles {
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
        let modes = layers.modes();
        let angles: Vec<usize> = (rings.rings.iter().zip(of_ring))
            .map(|(ring, aim)| angles_of(distance(ring.z_m) / ring.r_m, modes, aim))
            .collect();
        let waves = Waves::new(modes, &angles);
        let count = angles.iter().sum();
        let mut places = Vec::with_capacity(count);
        let mut moments = DMatrix::zeros(count, layers.patterns());
        let by_mode = rings.moments(layers.on_nodes());
        for (number, (ring, angles)) in rings.rings.iter().zip(&angles).enumerate() {
            let turn = TAU / *angles as f64;
            let at = waves.at(*angles);
            let of_ring: Vec<f64> = by_mode.row(number).iter().copied().collect();
            for (k, wave) in at.chunks_exact(at.len() / angles).enumerate() {
                let (s, c) = (turn * (k as f64 + 0.5)).sin_cos();
                let of_patterns = of_ring.chunks_exact(wave.len());
                for (pattern, amplitudes) in of_patterns.enumerate() {
                    let moment: f64 = wave.iter().zip(amplitudes).map(|(w, m)| w * m).sum();
                    moments[(places.len(), pattern)] = turn * moment;
                }
                let [n_r, n_z] = ring.normal;
                places.push([ring.r_m * c, ring.r_m * s, ring.z_m, n_r * c, n_r * s, n_z]);
            }
        }
        Dipoles { places, moments }
    }

    /// As few dipoles as still give what those of the a-priori tolerance give, within a part of what is
    /// requested.
    fn fewest(&self) -> Dipoles {
        let places_m = self.compared_places();
        let sizes = self.sizes(&places_m);
        let drives = spread_over(self.layers.drives(), COMPARED_DRIVES);
        // Where every layer is a pattern, only those of some drives are looked at.
        let some = self.layers.of_some(&drives);
        let layers = some.as_ref().unwrap_or(self.layers);
        let known = self.dipoles(layers, self.tolerance).fields(&places_m);
        let most = self.most();
        let loosened = |power: i32| self.tolerance * 10_f64.powi(power);
        let holds = |power: i32| {
            let fewer = self.dipoles(layers, loosened(power)).fields(&places_m);
            let off = layers.largest_sums(&(fewer - &known), &drives);
            let mut pairs = off.iter().zip(sizes.iter().cycle());
            pairs.all(|(off, size)| *off <= most * size)
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
        self.dipoles(self.layers, loosened(good))
    }

    /// By what one core's field may be off where it is compared, relative: the cores' errors add up.
    fn most(&self) -> f64 {
        let cores = self.layers.cores() as f64;
        (COMPARED_SHARE / cores.sqrt()).max(LEAST_SHARE) * self.near.tolerance
    }

    /// The scale of errors of every component at each of `places_m`.
    fn sizes(&self, places_m: &[[f64; 3]]) -> Vec<f64> {
        let top_m = self.outline.shape.top_m.max(0.0);
        let height = |z_m: f64| z_m.max(top_m).max(self.height_m);
        let both: Vec<[f64; 2]> = places_m
            .iter()
            .map(|[_, _, z]| self.near.sizes_at(height(*z)))
            .collect();
        let gradient = Components::Gradient.count();
        (0..Components::All.count())
            .flat_map(|part| {
                both.iter()
                    .map(move |both| both[usize::from(part >= gradient)])
            })
            .collect()
    }

    /// Places as close to a core at the origin as any may be, and some farther ones.
    fn compared_places(&self) -> Vec<[f64; 3]> {
        let shape = self.outline.shape;
        let Clearance {
            lowest_m,
            highest_m,
            ..
        } = self.near.clearance;
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
        // Slowly decaying fields matter far away.
        let farther = [[0.0, 1.0], [1.0, 1.0], [2.0, 2.0]];
        let farther = farther.map(|by| by.map(|by| by * shape.radius_m));
        let away = [[1.0, 1.0], [0.5, 3.0], [4.0, 4.0]];
        let away = away.map(|by| by.map(|by| by * floor_m));
        let farther: Vec<[f64; 2]> = (farther.iter().chain(&away))
            .map(|[r_m, z_m]| [*r_m, shape.top_m + floor_m + z_m])
            .collect();
        let about = close.iter().chain(&beside).chain(&farther);
        let about = about.map(|[r_m, z_m]| {
            if *z_m > highest_m {
                // Those that would be above are beside the core.
                [r_m.max(shape.radius_m + floor_m), highest_m]
            } else {
                [*r_m, z_m.max(lowest_m)]
            }
        });
        let about: Vec<[f64; 2]> = about.collect();
        (0..COMPARED_ANGLES * about.len())
            .map(|k| {
                let [r_m, z_m] = about[k % about.len()];
                // No two at one angle.
                let (s, c) = (2.399_963 * k as f64).sin_cos();
                [r_m * c, r_m * s, z_m]
            })
            .collect()
    }
}

impl Dipoles {
    /// The field of every pattern at `places_m`, [component and place, pattern].
    fn fields(&self, places_m: &[[f64; 3]]) -> DMatrix<f64> {
        let (parts, columns) = (Components::All, self.moments.ncols());
        let moments = self.moments.transpose();
        let alone = ArraySources::of_dipoles(columns, 0.0, self.places.clone(), moments.as_slice());
        let mut out = vec![0.0; parts.count() * places_m.len() * columns];
        alone.sample_all(places_m, parts, &mut out);
        DMatrix::from_vec(parts.count() * places_m.len(), columns, out)
    }
}

/// Combinations of a core's patterns that give the field, from `task`'s distance on, of all that the
/// patterns give within a part of the tolerance, and the patterns' amplitudes to theirs: [pattern,
/// combination] and [combination, pattern].
fn combinations(task: &DipoleTask<'_>, dipoles: &Dipoles) -> Option<[DMatrix<f64>; 2]> {
    let places_m = task.compared_places();
    let sizes = task.sizes(&places_m);
    let largest = task.layers.largest_amplitudes()?;
    let fields = dipoles.fields(&places_m);
    let mut scaled = fields.clone();
    for (mut column, largest) in scaled.column_iter_mut().zip(&largest) {
        for (value, size) in column.iter_mut().zip(sizes.iter().cycle()) {
            *value *= largest / size;
        }
    }
    if scaled.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let most = task.most();
    let all = spanning_rows(&scaled, most / (largest.len() as f64).sqrt());
    let of_first = |count: usize| {
        let rows = all.rows(0, count);
        let (mut patterns, mut amplitudes) = (rows.transpose(), rows.into_owned());
        for (pattern, largest) in largest.iter().enumerate() {
            patterns.row_mut(pattern).scale_mut(*largest);
            let scale = if *largest > 0.0 { largest.recip() } else { 0.0 };
            amplitudes.column_mut(pattern).scale_mut(scale);
        }
        [patterns, amplitudes]
    };
    let some = spread_over(task.layers.drives(), COMPARED_DRIVES);
    let holds = |count: usize| {
        let [patterns, amplitudes] = of_first(count);
        let left = &fields - (&fields * patterns) * amplitudes;
        let off = task.layers.largest_sums(&left, &some);
        let mut pairs = off.iter().zip(sizes.iter().cycle());
        pairs.all(|(off, size)| *off <= most * size)
    };
    let (mut bad, mut good) = (0, all.nrows());
    while good - bad > 1 {
        let middle = usize::midpoint(good, bad);
        if holds(middle) {
            good = middle;
        } else {
            bad = middle;
        }
    }
    Some(of_first(good))
}

/// Orthonormal rows, the most important first, whose combinations give every row of `matrix` but for a
/// remainder no longer than `most`.
///
/// Gram-Schmidt, what remains of the longest row next: Golub and Van Loan, Matrix Computations, 5.4.2.
/// Unlike singular vectors, which are hardly fewer, these need no iteration that may not converge.
fn spanning_rows(matrix: &DMatrix<f64>, most: f64) -> DMatrix<f64> {
    let mut rest = matrix.transpose();
    let mut found = DMatrix::zeros(rest.nrows(), rest.nrows().min(rest.ncols()));
    for count in 0..found.ncols() {
        fluxform_base::progress::poll();
        let norms = rest.column_iter().map(|row| row.norm()).enumerate();
        let longest = norms.max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((row, _)) = longest.filter(|(_, norm)| *norm > most) else {
            return found.columns(0, count).transpose();
        };
        let mut direction = rest.column(row).into_owned();
        // Again, as rounding leaves a share of those before.
        let before = found.columns(0, count);
        direction -= before * before.tr_mul(&direction);
        direction.normalize_mut();
        let shares = rest.tr_mul(&direction);
        rest.ger(-1.0, &direction, &shares, 1.0);
        found.set_column(count, &direction);
    }
    found.transpose()
}

/// At most `most` of `count` indices, from the first to the last.
pub(super) fn spread_over(count: usize, most: usize) -> Vec<usize> {
    let chosen = count.min(most);
    (0..chosen)
        .map(|k| k * (count - 1) / (chosen - 1).max(1))
        .collect()
}

impl ArraySources {
    /// Dipoles for the cores at `positions_m`, whose outline is `outline` and which have `layers`.
    pub(super) fn new(
        outline: &Generatrix,
        positions_m: &[[f64; 2]],
        layers: &CoreLayers<'_>,
        near: Near<'_>,
    ) -> Self {
        let shape = outline.shape;
        let largest = layers.largest_on_nodes(&spread_over(layers.drives(), LARGEST_DRIVES));
        let distances_m = distances_m(shape, positions_m, near);
        let of_level = |distance_m: &f64| {
            let mut near = near;
            near.clearance.distance_m = *distance_m;
            let task = DipoleTask::new(outline, layers, &largest, near);
            // A priori every part counts as if it stood alone and its layer were as rough as can be;
            // how much less does is seen by comparison.
            let dipoles = if near.many {
                task.fewest()
            } else {
                task.dipoles(layers, task.tolerance)
            };
            (task, dipoles)
        };
        let tasks: Vec<_> = distances_m.par_iter().map(of_level).collect();
        let few = (near.many && layers.drives() > 1)
            .then(|| combinations(&tasks[0].0, &tasks[0].1))
            .flatten()
            .filter(|[_, amplitudes]| amplitudes.nrows() < layers.drives());
        let levels = tasks.into_iter().map(|(task, dipoles)| {
            let Dipoles { places, moments } = dipoles;
            let from_m = task.near.clearance.distance_m;
            match &few {
                Some([patterns, _]) => {
                    Level::new(from_m, places, std::iter::once(moments * patterns))
                }
                None => {
                    let cores = layers.of_cores(&moments);
                    Level::new(from_m, places, cores.into_iter())
                }
            }
        });
        let levels = levels.collect();
        let amplitudes = few.and_then(|[_, amplitudes]| layers.amplitudes(&amplitudes));
        Self::of_levels(shape, positions_m, layers.drives(), levels, amplitudes)
    }
}

/// Distances from a core from which on each level of dipoles is to do, m.
fn distances_m(shape: CoreShape, positions_m: &[[f64; 2]], near: Near<'_>) -> Vec<f64> {
    let floor_m = near.floor_m(shape);
    let farthest = |[x, y]: &[f64; 2]| {
        let [x0, y0] = positions_m[0];
        (x - x0).hypot(y - y0)
    };
    let extent_m = positions_m.iter().map(farthest).fold(0.0, f64::max);
    let least = if positions_m.len() > FEW_CORES {
        GROWTH
    } else {
        GROWTH_OF_FEW
    };
    let growth = (extent_m / floor_m)
        .powf(1.0 / MOST_LEVELS as f64)
        .max(least);
    let mut distances_m = vec![near.clearance.distance_m];
    let mut next_m = growth * floor_m;
    while next_m < extent_m {
        distances_m.push(next_m);
        next_m *= growth;
    }
    distances_m
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::spanning_rows;

    #[test]
    fn spanning_rows_are_orthonormal_and_leave_what_they_may() {
        // Of falling importance, and many that are nothing.
        let entry = |i: usize, k: usize| {
            let size = if i % 3 == 2 {
                0.0
            } else {
                0.6_f64.powi(i as i32)
            };
            size * (1.3 + 0.7 * (i * k) as f64).sin()
        };
        let matrix = DMatrix::from_fn(60, 90, entry);
        for most in [1e-3, 1e-9] {
            let rows = spanning_rows(&matrix, most);
            let count = rows.nrows();
            assert!((5..40).contains(&count), "{count}");
            let products = &rows * rows.transpose() - DMatrix::identity(count, count);
            assert!(products.amax() < 1e-14, "{:e}", products.amax());
            let left = &matrix - &matrix * rows.transpose() * &rows;
            let longest = left.row_iter().map(|row| row.norm()).fold(0.0, f64::max);
            assert!(longest <= most + 1e-14, "{longest:e} {most:e}");
        }
        assert_eq!(spanning_rows(&matrix, 1e3).nrows(), 0);
    }
}
