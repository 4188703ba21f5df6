//! `manifest.json` of a bundle and `map.json` beside a map.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::artefact::{FileEntry, Input, Options, sha256_hex};
use super::json::to_json;
use fluxform_base::accuracy::StageAccuracy;
use fluxform_base::force_constant::Criterion;
use fluxform_base::force_direction::{ForceDirection, NormalForce};
use fluxform_base::point_weights::Weights;
use fluxform_base::uncertainty::UncertaintyOverride;
use fluxform_numerics::axis::Axis;

/// The interpolation between nodes that every loader implements.
pub(crate) const INTERPOLATION: &str = "tricubic-lagrange";

/// The file that a runtime reads first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Manifest {
    /// Layout, `major.minor.patch`.
    pub schema_version: String,
    /// Program that wrote the bundle.
    pub fluxform_version: String,
    /// Name of the design.
    pub design: String,
    /// Name of the shape.
    pub shape: String,
    /// Inputs, paths as given on the command line.
    pub inputs: Vec<Input>,
    /// The options of the run, as far as no other file states them; absent from bundles of schema
    /// 1.2 and before. With the inputs they decide every byte of the bundle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub made_with: Option<MadeWith>,
    /// A sentence on units.
    pub units: String,
    /// Positions of the coils.
    pub array: ArrayGeometry,
    /// Limits of the currents.
    pub limits: CurrentLimits,
    /// Resistance of every coil, ohm: the weights of least power.
    pub resistance_ohm: Vec<f64>,
    /// The coils' circuit; absent from bundles of schema 1.1 and before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub circuit: Option<CircuitSummary>,
    /// The magnet.
    pub magnet: MagnetSummary,
    /// The force constant.
    pub lambda: LambdaSummary,
    /// The force vector that feedback gives; absent where the upward component alone is requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force: Option<ForceSummary>,
    /// The grid the constraint points lie on.
    pub points: PointsGrid,
    /// The map's grid, coils and interpolation.
    pub map: MapSummary,
    /// Parts left out because the object does not need them.
    pub left_out: Vec<LeftOut>,
    /// Each stage's estimated error.
    pub accuracy: BTreeMap<String, StageAccuracy>,
    /// Every other file of the bundle but `timing*`.
    pub files: Vec<FileEntry>,
}

/// The options of the run that made a bundle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MadeWith {
    /// `--criterion`; absent from bundles of schema 1.3 and before, as the next two.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub criterion: Option<Criterion>,
    /// `--jnd`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub jnd: Option<f64>,
    /// `--jnd by-force`.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub jnd_by_force: bool,
    /// `--at`, N/m; absent without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_n_per_m: Option<f64>,
    /// `--tolerance`; null for the default.
    pub tolerance: Option<f64>,
    /// `--force-direction`; absent without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_direction: Option<ForceDirection>,
    /// `--normal-force`; absent without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal_force: Option<NormalForce>,
    /// `--sensor-error`, `--tilt`, `--heat`, `--driver-error`, `--power-cap`; absent without any.
    #[serde(default, skip_serializing_if = "UncertaintyOverride::is_none")]
    pub uncertainty: UncertaintyOverride,
    /// `--error`, relative; absent without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
    /// `--refine`; absent without it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub refine: bool,
    /// The error that holds where none was requested: of a shape that leaves its points to the program it decides
    /// those, of another one whether it is warned of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub default_error: Option<f64>,
    /// `--weights`; absent without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weights: Option<Weights>,
    /// How far from the object's points the map reaches, m.
    pub reach_m: f64,
    /// Whether `report.html` and `plots/` were requested.
    pub report: bool,
    /// Whether `vtk/` was requested; absent without it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub vtk: bool,
    /// Platform and instructions: with others the last bits of the numbers differ.
    pub arithmetic: String,
    /// Unit, placement and grid of a surface that was given directly, without a shape file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<SurfaceOptions>,
    /// SHA-256 of these options in canonical JSON, this key empty: an option that changes nothing
    /// else in a bundle is not edited unnoticed either.
    pub sha256: String,
}

impl MadeWith {
    /// The digest of these options.
    #[must_use]
    pub fn digest(&self) -> String {
        let bare = Self {
            sha256: String::new(),
            ..self.clone()
        };
        to_json(&bare).map_or_else(|_| String::new(), |text| sha256_hex(&text))
    }
}

/// Options on the command line of a surface that is given directly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SurfaceOptions {
    /// Metres per unit of the file's coordinates; null where its format says it.
    pub unit_m: Option<f64>,
    /// Factors along the file's axes.
    pub scale: [f64; 3],
    /// Translation, m.
    pub translate_m: [f64; 3],
    /// Rotation about x, then y, then z, degrees.
    pub rotate_deg: [f64; 3],
    /// Samples of the grid along x and y.
    pub samples: [usize; 2],
    /// Whether a flag gave them; absent where not.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub samples_are_given: bool,
    /// Ends of the grid along x, m; null for the surface's own extent.
    pub x_m: Option<[f64; 2]>,
    /// Ends of the grid along y, m; null for the surface's own extent.
    pub y_m: Option<[f64; 2]>,
    /// The file's direction that points up; absent for z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub up: Option<String>,
    /// Whether the middle of the box comes to x = y = 0.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub center: bool,
    /// The height of the lowest point, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest_on_m: Option<f64>,
    /// The box that the surface is moved into, from and to along x, y and z, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit_m: Option<[[f64; 2]; 3]>,
    /// Whether it is scaled to that box.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub scale_to_fit: bool,
    /// The farthest that a facet of a STEP file's body may lie from its face, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chord_m: Option<f64>,
    /// The body that was chosen of a STEP file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
}

/// Contents of the `map.npz` beside it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MapSidecar {
    /// Layout, `major.minor.patch`.
    pub schema_version: String,
    /// Program that wrote the map.
    pub fluxform_version: String,
    /// Name of the design.
    pub design: String,
    /// Inputs, paths as given on the command line.
    pub inputs: Vec<Input>,
    /// The options of the run; absent from maps of schema 1.3 and before.
    #[serde(default, skip_serializing_if = "Options::is_empty")]
    pub made_with: Options,
    /// A sentence on units.
    pub units: String,
    /// Positions of the coils.
    pub array: ArrayGeometry,
    /// The magnet.
    pub magnet: MagnetSummary,
    /// The map's grid, coils and interpolation.
    pub map: MapSummary,
    /// Each stage's estimated error.
    pub accuracy: BTreeMap<String, StageAccuracy>,
    /// The map's files.
    pub files: Vec<FileEntry>,
}

/// Positions of the coils; index = row * columns + column for a rectangular array.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ArrayGeometry {
    /// The axes' x and y, m, in coil order.
    pub positions_m: Vec<[f64; 2]>,
    /// `full` or `none`.
    pub coupling: String,
    /// Measured scale of each coil's map; already in the maps.
    pub gain: Vec<f64>,
}

impl CurrentLimits {
    /// Whether a `coil` carries all that it may, in either direction: at rest it does not.
    #[must_use]
    pub fn is_reached(&self, coil: usize, current_a: f64) -> bool {
        let (min_a, max_a) = (self.current_min_a[coil], self.current_max_a[coil]);
        current_a != 0.0 && (current_a >= max_a || current_a <= min_a)
    }
}

/// Limits of the currents, one entry a coil.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CurrentLimits {
    /// A.
    pub current_min_a: Vec<f64>,
    /// A.
    pub current_max_a: Vec<f64>,
    /// A; null without such a limit.
    pub total_current_max_a: Option<f64>,
}

/// How the coils' currents follow their voltages.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CircuitSummary {
    /// `[i][j]`: flux through coil i for one ampere in coil j, H.
    pub inductance_h: Vec<Vec<f64>>,
    /// The supply's voltage, V; null where the design names none.
    pub voltage_v: Option<f64>,
}

/// The magnet.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MagnetSummary {
    /// Its moment, A m^2.
    pub moment_a_m2: [f64; 3],
    /// `dipole` or `cylinder`.
    pub model: String,
    /// `repel` or `attract`.
    pub polarity: String,
    /// m.
    pub diameter_m: f64,
    /// m.
    pub length_m: f64,
}

/// The force constant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LambdaSummary {
    /// N/m; null when there is none.
    pub lambda_n_per_m: Option<f64>,
    /// How it was chosen.
    pub criterion: Criterion,
}

/// The force vector that position feedback gives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ForceSummary {
    /// Where it points.
    pub direction: ForceDirection,
    /// How large a force along the normal is; absent for other directions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal_force: Option<NormalForce>,
    /// Out of reach a sideways error counts as this share of an upward one.
    pub sideways_weight: f64,
    /// Points at creases, where the direction is the mean of both faces' normals.
    pub crease_points: usize,
    /// Points at rims and walls, where it is the normal of the face that is seen from above.
    pub rim_points: usize,
    /// The force that the static currents render.
    pub static_currents: String,
}

/// Equally spaced nodes: node i is ((n - 1 - i) from + i to) / (n - 1), n the samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AxisSummary {
    /// First node, m.
    pub from_m: f64,
    /// Last node, m.
    pub to_m: f64,
    /// Number of nodes.
    pub samples: usize,
}

impl From<Axis> for AxisSummary {
    fn from(axis: Axis) -> Self {
        Self {
            from_m: axis.from,
            to_m: axis.to,
            samples: axis.samples,
        }
    }
}

impl AxisSummary {
    /// The axis in memory.
    #[must_use]
    pub fn axis(&self) -> Axis {
        Axis {
            from: self.from_m,
            to: self.to_m,
            samples: self.samples,
        }
    }

    /// An axis of given nodes; their ends and number.
    #[must_use]
    pub fn of_nodes(nodes: &[f64]) -> Self {
        Self {
            from_m: nodes.first().copied().unwrap_or(0.0),
            to_m: nodes.last().copied().unwrap_or(0.0),
            samples: nodes.len(),
        }
    }
}

/// The grid on which `points.csv` lies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PointsGrid {
    /// Along x.
    pub x_m: AxisSummary,
    /// Along y.
    pub y_m: AxisSummary,
    /// How many points there are.
    pub count: usize,
    /// One string a grid row, y ascending; one character a node, x ascending: `1` where there is a
    /// surface. The first rows of `points.csv` are the ones in reading order.
    pub present: Vec<String>,
    /// Rows of `points.csv` after those: points within cells in which the surface ends or breaks, so that their
    /// corners describe it badly.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub graded: usize,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "as serde calls it")]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl PointsGrid {
    /// The grid, from one flag a node, x fastest.
    ///
    /// # Panics
    /// When the flags are not as many as the nodes.
    #[must_use]
    pub fn new(x_m: Axis, y_m: Axis, present: &[bool]) -> Self {
        assert_eq!(
            present.len(),
            x_m.samples * y_m.samples,
            "one flag a grid node"
        );
        let row = |flags: &[bool]| {
            flags
                .iter()
                .map(|&flag| if flag { '1' } else { '0' })
                .collect()
        };
        Self {
            count: present.iter().filter(|&&flag| flag).count(),
            present: present.chunks(x_m.samples.max(1)).map(row).collect(),
            x_m: x_m.into(),
            y_m: y_m.into(),
            graded: 0,
        }
    }

    /// One flag a node, x fastest; `None` when the strings do not fit the axes or the count.
    #[must_use]
    pub fn flags(&self) -> Option<Vec<bool>> {
        // An axis without nodes would leave the other one unbounded.
        if self.x_m.samples == 0 || self.y_m.samples == 0 {
            return None;
        }
        let mut flags = Vec::new();
        for row in &self.present {
            if row.len() != self.x_m.samples {
                return None;
            }
            for c in row.bytes() {
                flags.push(match c {
                    b'1' => true,
                    b'0' => false,
                    _ => return None,
                });
            }
        }
        let count = flags.iter().filter(|&&flag| flag).count();
        (self.present.len() == self.y_m.samples && count == self.count).then_some(flags)
    }
}

/// The map's grid, coils and interpolation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MapSummary {
    /// Along x; `map.npz` holds the nodes themselves.
    pub x_m: AxisSummary,
    /// Along y.
    pub y_m: AxisSummary,
    /// Along z.
    pub z_m: AxisSummary,
    /// Indices of the coils whose maps were kept.
    pub coil: Vec<i64>,
    /// `gz`, `force`, `gradient` or `all`.
    pub components: String,
    /// Between the nodes.
    pub interpolation: Interpolation,
    /// The maps of the sideways force, where `map.npz` holds them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sides: Option<SidesOfMap>,
    /// The unpowered steel's pull, where `map.npz` holds it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub passive_force: Option<PassiveForce>,
    /// The whole field at given currents, where `map.npz` holds it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub working_point: Option<WorkingPointMap>,
}

/// The maps of dB_x/dz and dB_y/dz, what the sideways force needs beside that of dB_z/dz.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SidesOfMap {
    /// The arrays of `map.npz`, `[coil, z, y, x]`, T/m/A.
    pub arrays: [String; 2],
    /// Between the nodes, relative to the largest value of the component at the height, or on the nodes around it
    /// where that is smaller.
    pub largest_error: [f64; 2],
}

/// The map of all coils together at given currents, their steel along its B-H curve: there the
/// coils' maps do not add up.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WorkingPointMap {
    /// The array of `map.npz`, `[z, y, x]`, T/m.
    pub array: String,
    /// Current in every coil of the array, A.
    pub currents_a: Vec<f64>,
    /// Largest difference from the sum of the coils' maps times their currents, relative to the
    /// largest value at the node's height.
    pub deviation_from_linear: f64,
    /// Largest |B| in every core, T.
    pub peak_field_t: Vec<f64>,
    /// Mean |B| in every core, T.
    pub mean_field_t: Vec<f64>,
}

/// The unpowered steel's pull on the magnet. The force is the sum over the coils of current times
/// force per ampere, plus this.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PassiveForce {
    /// The array of `map.npz`, `[z, y, x]`, N, positive upwards.
    pub array: String,
    /// Largest pull at the nodes of the lowest plane, N.
    pub largest_n: f64,
    /// Between the nodes.
    pub interpolation: Interpolation,
}

/// How values between nodes are found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Interpolation {
    /// `tricubic-lagrange`.
    pub name: String,
    /// Degree along each axis that has nodes enough.
    pub order: u32,
    /// Behaviour at and beyond the borders.
    pub borders: String,
    /// Its largest error.
    pub largest_error: f64,
    /// Reference of the largest error and how it was found.
    pub largest_error_definition: String,
}

impl Interpolation {
    /// The interpolation of this version, with its error on a given map.
    #[must_use]
    pub fn tricubic(largest_error: f64, definition: impl Into<String>) -> Self {
        Self {
            name: INTERPOLATION.to_owned(),
            order: 3,
            borders: "the four nearest nodes of each axis, moved inward at the borders; axes of \
                      three or two nodes: quadratic, linear; an axis of one node: that node alone; \
                      outside the grid the force is zero"
                .to_owned(),
            largest_error,
            largest_error_definition: definition.into(),
        }
    }
}

/// Something the object does not need.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LeftOut {
    /// What: coils, workspace, components.
    pub what: String,
    /// Why it is not needed.
    pub why: String,
    /// The error this costs, relative to the largest force per ampere at the points unless `why`
    /// says otherwise; 0 where it costs none, null where it is not known.
    pub error_cost: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::{CurrentLimits, PointsGrid};
    use fluxform_numerics::axis::Axis;

    /// A driver that only reverses, and one without any current, were at their limit at rest.
    #[test]
    fn a_coil_at_rest_has_reached_no_limit() {
        let limits = CurrentLimits {
            current_min_a: vec![-2.0, 0.0, 0.0],
            current_max_a: vec![0.0, 1.3, 0.0],
            total_current_max_a: None,
        };
        assert!([0, 1, 2].iter().all(|coil| !limits.is_reached(*coil, 0.0)));
        assert!(limits.is_reached(0, -2.0) && limits.is_reached(1, 1.3));
        assert!(!limits.is_reached(0, -1.9) && !limits.is_reached(1, 1.2));
    }

    #[test]
    fn grid_rows_read_back() {
        let x = Axis {
            from: -0.05,
            to: 0.05,
            samples: 3,
        };
        let y = Axis {
            from: 0.01,
            to: 0.07,
            samples: 2,
        };
        let flags = [true, false, true, false, false, true];
        let mut grid = PointsGrid::new(x, y, &flags);
        assert_eq!(grid.present, ["101", "001"]);
        assert_eq!((grid.count, grid.x_m.axis()), (3, x));
        assert_eq!(grid.flags().as_deref(), Some(&flags[..]));
        grid.count = 4;
        assert_eq!(grid.flags(), None);
        grid.count = 3;
        grid.present[1] = "00é".into();
        assert_eq!(grid.flags(), None);
    }
}
