//! The contents of a design file, validated, in SI units.

use super::iron::{Iron, IronShape, Plate};
use super::key::Assumed;
use super::limits::{Limits, Prices};
use super::named_file::{NamedFile, Role};
use super::search::SearchSpace;
use std::path::PathBuf;
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use fluxform_base::heating::Cooling;
use fluxform_base::uncertainty::Uncertainty;
use fluxform_numerics::axis::Axis;

/// A validated design.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// `[A-Za-z0-9._-]+`; names the output folder.
    pub name: String,
    /// The coil's winding; may be absent for `optimize` and `sweep` only.
    pub coil: Option<Coil>,
    /// The wire it is wound of.
    pub wire: Wire,
    /// The steel core; `None` for an air coil.
    pub core: Option<Core>,
    /// The plate below the coils, if there is one.
    pub plate: Option<Plate>,
    /// Other bodies of steel.
    pub iron: Vec<Iron>,
    /// Where the coils are.
    pub array: Array,
    /// The finger's magnet.
    pub magnet: Magnet,
    /// Current and voltage limits.
    pub supply: Supply,
    /// What coils are made of costs.
    pub prices: Prices,
    /// How the coils lose heat.
    pub cooling: Cooling,
    /// Uncertainties of the display in use.
    pub uncertainty: Uncertainty,
    /// Limits that `evaluate` and `optimize` check.
    pub limits: Limits,
    /// Height of the magnet's centre above the winding's top face at the target, m.
    pub target_height_m: f64,
    /// Grid on which maps are tabulated.
    pub workspace: Workspace,
    /// Variables of `optimize --for`.
    pub search: SearchSpace,
    /// The keys that decide numbers of the command that reads the design and have their defaults,
    /// because they were not written.
    pub assumed: Vec<Assumed>,
}

/// The winding: uniform current density over `[inner, outer] x [-length, 0]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coil {
    /// Inner diameter, m.
    pub inner_diameter_m: f64,
    /// Outer diameter, m.
    pub outer_diameter_m: f64,
    /// Length along z, m.
    pub length_m: f64,
    /// Number of turns; `None` means as many as fit, not rounded.
    pub turns: Option<f64>,
}

/// The wire.
#[derive(Debug, Clone, PartialEq)]
pub struct Wire {
    /// Diameter over the insulation, m: decides how many turns fit.
    pub diameter_m: f64,
    /// Diameter of the metal, m: decides the resistance.
    pub conductor_diameter_m: f64,
    /// Resistivity at 20 C, ohm m.
    pub resistivity_ohm_m: f64,
    /// Temperature, C.
    pub temperature_c: f64,
    /// Insulated diameters that `optimize` may choose among, m; each with its conductor in the
    /// proportion of the two diameters above.
    pub choices_m: Vec<f64>,
}

impl Design {
    /// Whether there is steel beyond the cores.
    #[must_use]
    pub fn has_iron(&self) -> bool {
        self.plate.is_some() || !self.iron.is_empty()
    }

    /// Whether there is any steel.
    #[must_use]
    pub fn has_steel(&self) -> bool {
        self.core.is_some() || self.has_iron()
    }

    /// The same with its cores as the only steel.
    #[must_use]
    pub fn without_iron(&self) -> Self {
        Self {
            plate: None,
            iron: Vec::new(),
            ..self.clone()
        }
    }

    /// The files that it names, in the order in which inputs and bundles list them.
    #[must_use]
    pub fn named_files(&self) -> Vec<NamedFile> {
        let mut own = self.clone();
        let files = own.named_files_mut().into_iter();
        files
            .map(|(role, path)| NamedFile {
                role,
                path: std::mem::take(path),
            })
            .collect()
    }

    /// The role of each of them, and its path, which may be replaced.
    pub fn named_files_mut(&mut self) -> Vec<(Role, &mut PathBuf)> {
        let mut files = Vec::new();
        if let Some(Core {
            steel: Steel::Curve(path),
            ..
        }) = &mut self.core
        {
            files.push((Role::Curve, path));
        }
        for (number, iron) in self.iron.iter_mut().enumerate() {
            if let IronShape::Mesh { surface, .. } = &mut iron.shape {
                files.push((Role::Mesh(number), surface));
            }
        }
        files
    }
}

/// How the core's steel is described.
#[derive(Debug, Clone, PartialEq)]
pub enum Steel {
    /// Linear, homogeneous: mu_r.
    Linear(f64),
    /// A B-H table, path resolved against the design file's folder.
    Curve(PathBuf),
}

/// The steel core: a cylinder on the coil's axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Core {
    /// Gap between core and winding, m: core radius = inner diameter / 2 - clearance.
    pub clearance_m: f64,
    /// The core's top is at z = +above, m.
    pub above_m: f64,
    /// The core's bottom is at z = -(length + below), m.
    pub below_m: f64,
    /// Material.
    pub steel: Steel,
    /// Flux density above which a warning is due, T; `None`, with a curve only, for the knee
    /// that the curve itself shows.
    pub knee_t: Option<f64>,
    /// Conductivity, S/m, for the transient estimate.
    pub conductivity_s_per_m: f64,
    /// Thickness of its sheets, m; `None` for a solid core.
    pub lamination_m: Option<f64>,
}

/// How the neighbours' cores are treated.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, EnumMessage, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "lowercase")]
pub enum Coupling {
    /// All cores respond to each driven coil.
    Full,
    /// Superposition of single coils.
    None,
}

fluxform_base::choices!(Coupling, Polarity, MagnetModel);

/// The array of identical coils, axes parallel to z, top faces at z = 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Axes' positions, m, in coil order.
    pub positions_m: Vec<[f64; 2]>,
    /// Rows, columns and pitch (m) where the positions come from a grid.
    pub grid: Option<ArrayGrid>,
    /// Coupling between cores.
    pub coupling: Coupling,
    /// Measured scale of each coil's map; one entry a coil.
    pub gain: Vec<f64>,
}

/// A rectangular arrangement: index = row * columns + column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArrayGrid {
    /// Rows; y grows with the row.
    pub rows: usize,
    /// Columns; x grows with the column.
    pub columns: usize,
    /// Distance between neighbours, m.
    pub pitch_m: f64,
}

/// Which way a positive current pushes the magnet on the coil's axis.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, EnumMessage, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "lowercase")]
pub enum Polarity {
    /// Up: the moment points down, m_z < 0.
    Repel,
    /// Down: m_z > 0.
    Attract,
}

/// How the magnet's force is computed.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, EnumMessage, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "lowercase")]
pub enum MagnetModel {
    /// A point dipole at the magnet's centre (eq. 5).
    Dipole,
    /// The uniformly magnetised cylinder: (M . grad) B integrated over its volume.
    Cylinder,
}

/// The finger's magnet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Magnet {
    /// Diameter, m.
    pub diameter_m: f64,
    /// Length, m.
    pub length_m: f64,
    /// Axial magnetisation, A/m, positive.
    pub magnetization_a_per_m: f64,
    /// Direction of the moment.
    pub polarity: Polarity,
    /// Dipole or cylinder.
    pub model: MagnetModel,
    /// Moment tilted about x, then y, degrees.
    pub tilt_deg: [f64; 2],
    /// Whether the unpowered steel's pull is added.
    pub passive_force: bool,
}

/// Current and voltage limits of the drivers.
#[derive(Debug, Clone, PartialEq)]
pub struct Supply {
    /// Upper current limit of each coil, A (>= 0); one entry a coil.
    pub current_max_a: Vec<f64>,
    /// Lower current limit of each coil, A (<= 0); one entry a coil.
    pub current_min_a: Vec<f64>,
    /// Limit of the sum of the currents, A.
    pub total_current_max_a: Option<f64>,
    /// Supply voltage, V.
    pub voltage_v: Option<f64>,
    /// The quantity that the drivers set.
    pub driver: Driver,
    /// Bandwidth of drivers that set currents, Hz.
    pub bandwidth_hz: f64,
}

/// Bandwidth of drivers that set currents where none is given, Hz: an ordinary servo amplifier's.
pub const BANDWIDTH_HZ: f64 = 1000.0;

/// The quantity that drivers set.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, EnumMessage, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "lowercase")]
pub enum Driver {
    /// A voltage: the current follows by the coil's time constant
    #[default]
    Voltage,
    /// A current: a loop uses the supply's voltage to bring it about
    Current,
}

impl Design {
    /// The same with other samples of the workspace along x, y and z.
    #[must_use]
    pub fn with_nodes(&self, samples: [usize; 3]) -> Self {
        let mut design = self.clone();
        let workspace = &mut design.workspace;
        let axes = [&mut workspace.x_m, &mut workspace.y_m, &mut workspace.z_m];
        for (axis, samples) in axes.into_iter().zip(samples) {
            axis.samples = samples;
        }
        design
    }
}

/// The workspace grid, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Workspace {
    /// x axis, m.
    pub x_m: Axis,
    /// y axis, m.
    pub y_m: Axis,
    /// z axis, m; from the windings' top face up.
    pub z_m: Axis,
    /// Whether the document gives any of them.
    pub is_given: bool,
}
