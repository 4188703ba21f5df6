//! A design made ready for computing: sources, coils, magnet, currents, tolerances.

mod array_fields;
pub mod at_current;
pub mod cached_field;
pub mod core_material;
pub mod cost;
pub mod drawing;
pub mod evaluation_sample;
pub mod field_slice;
pub mod iron;
pub(crate) mod knee;
pub mod maps;
pub mod named_files;
pub mod neighbours;
pub mod passive;
pub mod passive_iron;
pub mod passive_map;
mod passive_table;
mod prepared_field;
pub mod rated;
pub mod shard;
pub mod single;
pub mod sources;
pub mod steel;
pub mod tolerances;
pub mod working_point;

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::RunError;
use crate::bundle::manifest::{ArrayGeometry, CurrentLimits, MagnetSummary};
use crate::coil::circuit::{self, Circuit};
use crate::coil::heat::warm_coil;
use crate::design::{Coil, Coupling, Design, MagnetModel, Polarity};
use crate::field::batch::Gradients;
use crate::field::components::Components;
use crate::field::dipole;
use crate::field::magnet::{Cylinder, MagnetRule, NoRule, Sources};
use crate::field::source::AxialSource;
use crate::field::steel::array_steel::SteelField;
use crate::field::winding::Winding;
use crate::heating::{Heating, WarmCoil};
use crate::lambda::two_fingers::FingerMagnet;
use crate::lambda::uncertainty::Turned;
use crate::map::tabulate::PlacedCoil;
use crate::numerics::vec3::{cross, dot};
use crate::plot::array::ArrayPlot;
use crate::progress::Progress;
use crate::scene::core_material::SceneCore;
use crate::scene::iron::SceneIron;
use crate::scene::named_files::NamedContent;
use crate::scene::passive_iron::HeldPulls;
use crate::scene::steel::{EVALUATION_SHARE, Solved};
use crate::scene::tolerances::{MAGNET_FINEST, Tolerances};

/// Points handed to one thread at a time; fixed, so that bytes do not depend on threads.
const PORTION: usize = 4096;
/// Share of the tolerance given to the magnet's dipoles.
pub(crate) const MAGNET_SHARE: f64 = 0.3;
/// Share of the tolerance given to the windings' field where the magnet takes its own.
pub(crate) const AIR_SHARE: f64 = 0.6;

/// The magnet, as two fingers wear it.
pub fn finger_magnet(design: &Design) -> FingerMagnet {
    FingerMagnet {
        moment_a_m2: moment_a_m2(design),
        diameter_m: design.magnet.diameter_m,
        length_m: design.magnet.length_m,
    }
}

/// The magnet's moment, A m^2.
pub fn moment_a_m2(design: &Design) -> [f64; 3] {
    let magnet = &design.magnet;
    let moment = dipole::cylinder_moment_a_m2(
        magnet.diameter_m,
        magnet.length_m,
        magnet.magnetization_a_per_m,
    );
    let along_z = match magnet.polarity {
        Polarity::Repel => -moment,
        Polarity::Attract => moment,
    };
    dipole::tilted_moment_a_m2(along_z, magnet.tilt_deg)
}

/// The magnet's size where it counts; `None` for a dipole.
pub(crate) fn cylinder_of(design: &Design) -> Option<Cylinder> {
    let magnet = &design.magnet;
    match magnet.model {
        MagnetModel::Dipole => None,
        MagnetModel::Cylinder => Some(Cylinder {
            diameter_m: magnet.diameter_m,
            length_m: magnet.length_m,
        }),
    }
}

/// The dipoles that stand for the magnet where what attracts it is among `sources`.
///
/// # Errors
/// A magnet that touches what it is attracted by.
pub(crate) fn magnet_rule(
    design: &Design,
    sources: Sources,
    tolerance: f64,
) -> Result<MagnetRule, RunError> {
    let moment_a_m2 = moment_a_m2(design);
    let Some(size) = cylinder_of(design) else {
        return Ok(MagnetRule::dipole(moment_a_m2));
    };
    MagnetRule::cylinder(size, moment_a_m2, sources, tolerance).map_err(|fault| {
        let or = match fault {
            NoRule::TooClose { .. } => ", give a larger --tolerance,",
            NoRule::NotANumber | NoRule::Touches { .. } => "",
        };
        let (place, advice) = match sources {
            Sources::Below { .. } => ("above the highest winding or steel", "raise the magnet"),
            Sources::Beyond { .. } => ("from the nearest winding or steel", "move it away"),
        };
        RunError::Input(format!(
            "[magnet] model = \"cylinder\" with its centre {:.3} mm {place}: {fault}; {advice}{or} or use \
             model = \"dipole\"",
            sources.distance_m() * 1e3
        ))
    })
}

/// A design made ready for computing.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Scene<'a> {
    /// The design.
    pub design: &'a Design,
    /// The files that it names.
    pub files: Vec<NamedContent>,
    /// Its coil section.
    pub coil: Coil,
    /// The winding.
    pub winding: Winding,
    /// The steel of every core; `None` for air coils.
    pub core: Option<SceneCore>,
    /// The plate and other bodies of steel; `None` where cores are all there is.
    pub iron: Option<SceneIron>,
    /// Resistance, inductance without steel, wire.
    pub circuit: Circuit,
    /// The coils of the array.
    pub coils: Vec<PlacedCoil>,
    /// The magnet's moment, A m^2.
    pub moment_a_m2: [f64; 3],
    /// Lower current limit of each coil, A: the driver's or minus the supply's V/R.
    pub lower_a: Vec<f64>,
    /// Upper current limit of each coil, A: the lower of the driver's and the supply's V/R.
    pub upper_a: Vec<f64>,
    /// To what accuracy each stage is computed.
    pub tolerances: Tolerances,
    /// Pulls of a plate and other bodies on the magnet, as they were last solved.
    pulls: HeldPulls,
}

impl<'a> Scene<'a> {
    /// Makes a design ready, to the default accuracy of its physics.
    ///
    /// # Errors
    /// A design without a coil; a B-H table or a mesh that cannot be used.
    pub fn new(design: &'a Design) -> Result<Self, RunError> {
        Self::with_tolerance(design, None)
    }

    /// As [`Scene::new`], every stage to the accuracy that was `requested`, if any was.
    ///
    /// # Errors
    /// As [`Scene::new`].
    pub fn with_tolerance(design: &'a Design, requested: Option<f64>) -> Result<Self, RunError> {
        let coil = design.coil.ok_or_else(|| {
            RunError::Input("the design has no [coil] section, which this command needs".to_owned())
        })?;
        let circuit = Circuit::of_air_coil(&coil, &design.wire);
        let winding = circuit::winding(&coil, &design.wire);
        let files = named_files::read(design)?;
        let core = design
            .core
            .as_ref()
            .map(|core| SceneCore::new(core, &winding, &files))
            .transpose()?;
        let iron = SceneIron::new(design, &winding, core.as_ref(), &files)?;
        let coils = design
            .array
            .positions_m
            .iter()
            .zip(&design.array.gain)
            .enumerate()
            .map(|(number, (axis_m, gain))| PlacedCoil {
                number,
                axis_m: *axis_m,
                gain: *gain,
            })
            .collect();
        let voltage_v = design.supply.voltage_v;
        let reached_a = |limits_a: &[f64]| -> Vec<f64> {
            let limits_a = limits_a.iter();
            limits_a
                .map(|limit| circuit.reached_a(*limit, voltage_v))
                .collect()
        };
        let has_current = circuit.rated_current_a(&design.supply) != 0.0;
        let tolerances = Tolerances::new(design, core.as_ref(), has_current, requested);
        Ok(Self {
            design,
            coil,
            files,
            winding,
            core,
            iron,
            coils,
            moment_a_m2: moment_a_m2(design),
            upper_a: reached_a(&design.supply.current_max_a),
            lower_a: reached_a(&design.supply.current_min_a),
            circuit,
            tolerances,
            pulls: HeldPulls::default(),
        })
    }

    /// The same scene, every stage to the accuracy that was `requested`, if any was.
    #[must_use]
    pub fn to_tolerance(&self, requested: Option<f64>) -> Self {
        let has_current = self.rated_current_a() != 0.0;
        Self {
            tolerances: Tolerances::new(self.design, self.core.as_ref(), has_current, requested),
            ..self.clone()
        }
    }

    /// The array, drawn.
    #[must_use]
    pub fn drawing(&self) -> Option<ArrayPlot> {
        drawing::drawing(self.design, self.iron.iter().flat_map(SceneIron::irons))
    }

    /// The rated current of each coil, A: [`Circuit::rated_currents_a`].
    #[must_use]
    pub fn rated_currents_a(&self) -> Vec<f64> {
        self.circuit.rated_currents_a(&self.design.supply)
    }

    /// The rated current of one coil, A: [`Circuit::rated_current_a`].
    #[must_use]
    pub fn rated_current_a(&self) -> f64 {
        self.circuit.rated_current_a(&self.design.supply)
    }

    /// How warm a coil alone in still air becomes under a current that stays, as far as the supply's voltage drives it.
    #[must_use]
    pub fn heated(&self, current_a: f64) -> Heating {
        let cooling = &self.design.cooling;
        let core_kg = self.core.as_ref().map_or(0.0, SceneCore::mass_kg);
        let wire_c = self.design.wire.temperature_c;
        let coil = WarmCoil {
            voltage_v: self.design.supply.voltage_v,
            ..warm_coil(&self.winding, &self.circuit, wire_c, core_kg, cooling)
        };
        coil.heated(current_a, cooling)
    }

    /// How far below its centre the magnet extends, m; 0 for a dipole.
    #[must_use]
    pub fn magnet_depth_m(&self) -> f64 {
        cylinder_of(self.design).map_or(0.0, |size| size.depth_along_m(self.moment_a_m2))
    }

    /// Whether the moment is tilted, so that the force needs the whole gradient.
    #[must_use]
    pub fn tilted(&self) -> bool {
        self.moment_a_m2[0] != 0.0 || self.moment_a_m2[1] != 0.0
    }

    /// Resistance of every coil, ohm.
    #[must_use]
    pub fn resistances_ohm(&self) -> Vec<f64> {
        vec![self.circuit.resistance_ohm; self.coils.len()]
    }

    /// The dipoles that stand for the magnet at heights from `lowest_m` up.
    ///
    /// # Errors
    /// A magnet that touches what it is attracted by.
    pub fn magnet_rule(&self, lowest_m: f64, tolerance: f64) -> Result<MagnetRule, RunError> {
        magnet_rule(self.design, self.below(lowest_m), tolerance)
    }

    /// Windings and steel as they are seen from heights from `lowest_m` up.
    #[must_use]
    pub fn below(&self, lowest_m: f64) -> Sources {
        Sources::Below {
            height_m: lowest_m - self.sources_top_m(),
        }
    }

    /// How much larger the gradient's mean over the magnet may be than the gradient at its centre,
    /// with what attracts it among `sources`; 1 for a dipole.
    #[must_use]
    pub fn magnet_growth(&self, sources: Sources) -> f64 {
        cylinder_of(self.design).map_or(1.0, |size| size.growth_along(sources, self.moment_a_m2))
    }

    /// Distance of a place from the nearest winding, m.
    #[must_use]
    pub fn windings_distance_m(&self, [x, y, z]: [f64; 3]) -> f64 {
        let away = |coil: &PlacedCoil| {
            let r_m = (x - coil.axis_m[0]).hypot(y - coil.axis_m[1]);
            self.winding.distance_m(r_m, z)
        };
        self.coils.iter().map(away).fold(f64::INFINITY, f64::min)
    }

    /// Height of the highest winding or steel, m.
    #[must_use]
    pub fn sources_top_m(&self) -> f64 {
        self.steel_extent_m()
            .map_or(0.0, |(top_m, _)| top_m.max(0.0))
    }

    /// Height of the highest steel, and the length from which on it is far away, m; `None` without any.
    #[must_use]
    pub fn steel_extent_m(&self) -> Option<(f64, f64)> {
        let cores = self
            .core
            .as_ref()
            .map(|core| (core.shape.top_m, core.shape.length_m()));
        let iron = self
            .iron
            .as_ref()
            .map(|iron| (iron.top_m, self.winding.length_m));
        match (cores, iron) {
            (Some(cores), Some(iron)) => Some((cores.0.max(iron.0), cores.1.max(iron.1))),
            (cores, iron) => cores.or(iron),
        }
    }

    /// Rows of points that share a rule for the magnet, with a height none of them is below: those
    /// whose gap to the array lies between the same two steps of the square root of two.
    fn by_gap(&self, points_m: &[[f64; 3]]) -> Vec<(f64, Vec<usize>)> {
        let lowest_m = points_m.iter().fold(f64::INFINITY, |z, p| z.min(p[2]));
        let depth_m = self.magnet_depth_m();
        if depth_m == 0.0 {
            return vec![(lowest_m, (0..points_m.len()).collect())];
        }
        let foot_m = self.sources_top_m() + depth_m;
        let mut groups: BTreeMap<i32, Vec<usize>> = BTreeMap::new();
        for (row, point) in points_m.iter().enumerate() {
            let step = (2.0 * ((point[2] - foot_m) / depth_m).log2()).floor();
            // Where the magnet touches, the least of all steps; the rule refuses.
            let step = if step.is_nan() { i32::MIN } else { step as i32 };
            groups.entry(step).or_default().push(row);
        }
        groups
            .into_iter()
            .map(|(step, rows)| {
                let edge_m = foot_m + depth_m * (0.5 * f64::from(step)).exp2();
                (edge_m.max(lowest_m), rows)
            })
            .collect()
    }

    /// Upward force per ampere of every coil at every point, N/A, [point, coil], to the tolerance
    /// of `solved` relative to the largest |grad B| at the point's height: directly at the points,
    /// not through a map.
    ///
    /// # Errors
    /// A point on a winding's edge or on the steel; interruption.
    pub fn forces_n_per_a(
        &self,
        solved: &Solved,
        points_m: &[[f64; 3]],
        progress: &dyn Progress,
    ) -> Result<Vec<f64>, RunError> {
        let forces = self.forces::<1>(solved, points_m, progress)?;
        Ok(forces.into_flattened())
    }

    /// As [`Scene::forces_n_per_a`], along x, y and z: F = (m . grad) B.
    ///
    /// # Errors
    /// As there.
    pub fn force_vectors_n_per_a(
        &self,
        solved: &Solved,
        points_m: &[[f64; 3]],
        progress: &dyn Progress,
    ) -> Result<Vec<[f64; 3]>, RunError> {
        self.forces::<3>(solved, points_m, progress)
    }

    /// As [`Scene::force_vectors_n_per_a`], for the moment along its own axis, then turned onto two axes
    /// across it; the magnet's body does not turn.
    ///
    /// # Errors
    /// As there.
    pub fn turned_forces_n_per_a(
        &self,
        solved: &Solved,
        points_m: &[[f64; 3]],
        progress: &dyn Progress,
    ) -> Result<Vec<Turned>, RunError> {
        self.forces::<9>(solved, points_m, progress)
    }

    /// The last `N` components of the force; of 9 those of three moments.
    fn forces<const N: usize>(
        &self,
        solved: &Solved,
        points_m: &[[f64; 3]],
        progress: &dyn Progress,
    ) -> Result<Vec<[f64; N]>, RunError> {
        let coils = self.coils.len();
        let finest = MAGNET_SHARE * solved.tolerance.max(MAGNET_FINEST);
        let groups = self
            .by_gap(points_m)
            .into_iter()
            .map(|(height_m, rows)| Ok((self.magnet_rule(height_m, finest)?, rows)))
            .collect::<Result<Vec<_>, RunError>>()?;
        let of_rules = |of: fn(&MagnetRule) -> f64| {
            let values = groups.iter().map(|(rule, _)| of(rule));
            values.fold(0.0, f64::max)
        };
        let (reach_m, amplification) = (
            of_rules(MagnetRule::reach_m),
            of_rules(MagnetRule::amplification),
        );
        cost::check_forces(points_m.len(), coils, N)?;
        let mut forces = vec![[0.0; N]; points_m.len() * coils];
        let stage = if N > 1 { "sideways" } else { "forces" };
        progress.begin(stage, points_m.len() as u64);
        // As fine as the nearest of all points needs, whatever the portion.
        let sources = solved.sources(self, points_m, reach_m, amplification)?;
        // Many dipoles take a winding and its own core from one table.
        let table = if reach_m > 0.0 && solved.has_steel() {
            let tolerance = EVALUATION_SHARE * solved.tolerance / amplification;
            solved.steel().axial_source(self.winding, tolerance)
        } else {
            None
        };
        let (own, sources): (&dyn AxialSource, _) = match &table {
            Some(table) => (&**table, None),
            None => (&self.winding, sources.as_deref()),
        };
        for (rule, rows) in &groups {
            let portions = rows
                .par_chunks(PORTION)
                .map(|rows| {
                    progress.check()?;
                    let points: Vec<[f64; 3]> = rows.iter().map(|row| points_m[*row]).collect();
                    let mut out = vec![[0.0; N]; rows.len() * coils];
                    self.add_forces(solved, (own, sources), rule, &points, &mut out)?;
                    progress.advance(rows.len() as u64);
                    Ok((rows, out))
                })
                .collect::<Result<Vec<_>, RunError>>()?;
            for (rows, values) in portions {
                for (row, values) in rows.iter().zip(values.chunks_exact(coils)) {
                    forces[row * coils..(row + 1) * coils].copy_from_slice(values);
                }
            }
        }
        progress.end();
        Ok(forces)
    }

    /// Adds the forces by the field of each coil's own source and of what else there is.
    fn add_forces<const N: usize>(
        &self,
        solved: &Solved,
        (own, sources): (&dyn AxialSource, Option<&SteelField>),
        rule: &MagnetRule,
        points_m: &[[f64; 3]],
        rows: &mut [[f64; N]],
    ) -> Result<(), RunError> {
        let coils = self.coils.len();
        let components = N.min(3);
        let axes = axes_of(self.moment_a_m2);
        let whole = N > 1 || !rule.is_upright();
        // Moments across an upright one take the whole gradient too.
        let parts = match (whole, rule.is_upright() && N < 9) {
            (false, _) => Components::Gz,
            (true, true) => Components::Force,
            (true, false) => Components::Gradient,
        };
        let share = if rule.nodes().len() > 1 || sources.is_some() {
            solved.evaluation_share()
        } else {
            1.0
        };
        let tolerance = share * solved.tolerance / rule.amplification();
        for node in rule.nodes() {
            let m_z = node.moment_a_m2[2];
            let along = dot(node.moment_a_m2, axes[0]);
            let moments = match N {
                9 => axes.map(|axis| axis.map(|part| along * part)).to_vec(),
                _ => vec![node.moment_a_m2],
            };
            let places: Vec<[f64; 3]> = points_m
                .iter()
                .map(|p| std::array::from_fn(|i| p[i] + node.offset_m[i]))
                .collect();
            let steel = sources.map_or_else(Vec::new, |sources| {
                self.steel_fields(sources, &places, parts)
            });
            let count = places.len();
            let z_m: Vec<f64> = places.iter().map(|p| p[2]).collect();
            for (column, coil) in self.coils.iter().enumerate() {
                let offset = |p: &[f64; 3]| (p[0] - coil.axis_m[0], p[1] - coil.axis_m[1]);
                let r_m: Vec<f64> = places
                    .iter()
                    .map(|p| {
                        let (dx, dy) = offset(p);
                        dx.hypot(dy)
                    })
                    .collect();
                let air = own.gradients(&r_m, &z_m, tolerance, parts)?;
                let block = parts.count() * count;
                let steel = steel.get(column * block..(column + 1) * block);
                for (row, place) in places.iter().enumerate() {
                    let sums = rows[row * coils + column].chunks_exact_mut(components);
                    for (moment_a_m2, sums) in moments.iter().zip(sums) {
                        let mut force = [0.0, 0.0, m_z * air.dbz_dz[row]];
                        if whole {
                            let (dx, dy) = offset(place);
                            force = axial_force_n(*moment_a_m2, &air, row, [dx, dy]);
                        }
                        if let Some(steel) = steel {
                            let added = force_n(*moment_a_m2, parts, steel, row);
                            force = std::array::from_fn(|i| force[i] + added[i]);
                        }
                        for (sum, value) in sums.iter_mut().zip(&force[3 - components..]) {
                            *sum += coil.gain * value;
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// The steel's part of the field per ampere of every coil at `points_m`, [coil, component,
    /// point], gains not applied.
    #[must_use]
    pub fn steel_fields(
        &self,
        sources: &SteelField,
        points_m: &[[f64; 3]],
        parts: Components,
    ) -> Vec<f64> {
        let axes_m = self.coils.iter().map(|coil| coil.axis_m);
        sources.of_windings(axes_m, points_m, parts)
    }

    /// The array as artefacts state it.
    #[must_use]
    pub fn array_geometry(&self) -> ArrayGeometry {
        ArrayGeometry {
            positions_m: self.design.array.positions_m.clone(),
            coupling: self.design.array.coupling.name().to_owned(),
            gain: self.design.array.gain.clone(),
        }
    }

    /// The current limits as artefacts state them.
    #[must_use]
    pub fn current_limits(&self) -> CurrentLimits {
        CurrentLimits {
            current_min_a: self.lower_a.clone(),
            current_max_a: self.upper_a.clone(),
            total_current_max_a: self.design.supply.total_current_max_a,
        }
    }

    /// The magnet as artefacts state it.
    #[must_use]
    pub fn magnet_summary(&self) -> MagnetSummary {
        let magnet = &self.design.magnet;
        MagnetSummary {
            moment_a_m2: self.moment_a_m2,
            model: magnet.model.name().to_owned(),
            polarity: magnet.polarity.name().to_owned(),
            diameter_m: magnet.diameter_m,
            length_m: magnet.length_m,
        }
    }
}

/// Whether the design's cores are coupled, and the only steel.
#[must_use]
pub fn coupled(design: &Design) -> bool {
    design.core.is_some()
        && !design.has_iron()
        && design.array.coupling == Coupling::Full
        && design.array.positions_m.len() > 1
}

/// Unit vectors along a moment and across it.
fn axes_of(moment_a_m2: [f64; 3]) -> [[f64; 3]; 3] {
    let unit = |v: [f64; 3]| {
        let length = dot(v, v).sqrt();
        v.map(|part| part / length)
    };
    let along = unit(moment_a_m2);
    // The axis that the moment is farthest from being along.
    let other = if along[0].abs() < 0.8 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let third = unit(cross(along, other));
    [along, cross(third, along), third]
}

/// Force on a dipole in an axial field, N (per ampere if that is), `dx_dy_m` off its axis:
/// (m . grad) B with dB_x/dz = (dx / r) dB_r/dz and dB_r/dr = -dB_z/dz - B_r/r.
fn axial_force_n(
    [m_x, m_y, m_z]: [f64; 3],
    air: &Gradients,
    row: usize,
    [dx, dy]: [f64; 2],
) -> [f64; 3] {
    let (zz, radial, rotated) = (air.dbz_dz[row], air.dbr_dz_over_r[row], air.br_over_r[row]);
    let r2 = dx * dx + dy * dy;
    // On the axis dB_r/dr = B_r/r.
    let bent = if r2 > 0.0 {
        -(zz + 2.0 * rotated) / r2
    } else {
        0.0
    };
    let along = m_x * dx + m_y * dy;
    [
        m_x * rotated + bent * dx * along + m_z * radial * dx,
        m_y * rotated + bent * dy * along + m_z * radial * dy,
        m_z * zz + radial * along,
    ]
}

/// Force on a dipole at one of the points at which one drive's `parts` were sampled,
/// [component, point]: (m . grad) B, N (per ampere if they are); the upward one alone from
/// [`Components::Gz`].
fn force_n(moment_a_m2: [f64; 3], parts: Components, values: &[f64], row: usize) -> [f64; 3] {
    let count = values.len() / parts.count();
    let part = |component: usize| values[component * count + row];
    let [m_x, m_y, m_z] = moment_a_m2;
    match parts {
        Components::Gz => [0.0, 0.0, m_z * part(0)],
        // Of an upright magnet.
        Components::Force => [0, 1, 2].map(|axis| m_z * part(axis)),
        Components::Gradient | Components::All => {
            let [xx, xy, xz, yz, zz] = std::array::from_fn(part);
            [
                m_x * xx + m_y * xy + m_z * xz,
                m_x * xy - m_y * (xx + zz) + m_z * yz,
                m_x * xz + m_y * yz + m_z * zz,
            ]
        }
    }
}

/// Its upward part.
pub(crate) fn upward_n(
    moment_a_m2: [f64; 3],
    parts: Components,
    values: &[f64],
    row: usize,
) -> f64 {
    force_n(moment_a_m2, parts, values, row)[2]
}
