//! The sections of a design file as read, in the file's units, and which of them a command needs.

use super::iron::{self, Iron, Plate};
use super::limits::{self, Limits, Prices};
use super::reader::{Located, Section};
use super::search::{self, SearchSpace};
use super::sections::{self, ArrayDraft, CoilDraft, CoreDraft, MagnetDraft};
use super::sections::{SupplyDraft, WireDraft, WorkspaceDraft};
use fluxform_base::heating::Cooling;
use fluxform_base::uncertainty::Uncertainty;

/// A command's requirements on a design. Coils that it does not place may overlap, with a warning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Need {
    /// The coil as given: `[coil]` is required.
    pub coil: bool,
    /// The coils beside each other: they must not overlap.
    pub array: bool,
    /// The magnet at the target height: it must not overlap winding or core.
    pub target: bool,
    /// The workspace grid: it must lie above the windings and the cores.
    pub workspace: bool,
}

impl Need {
    /// `evaluate`.
    pub const EVALUATE: Self = Self {
        coil: true,
        array: true,
        target: true,
        workspace: false,
    };
    /// `probe`.
    pub const PROBE: Self = Self {
        coil: true,
        array: true,
        target: false,
        workspace: false,
    };
    /// `map`.
    pub const MAP: Self = Self {
        coil: true,
        array: true,
        target: false,
        workspace: true,
    };
    /// `lambda`.
    pub const LAMBDA: Self = Self::PROBE;
    /// `calibrate`.
    pub const CALIBRATE: Self = Self::MAP;
    /// `optimize`.
    pub const OPTIMIZE: Self = Self {
        coil: false,
        array: false,
        target: true,
        workspace: false,
    };
    /// `sweep plan`: each design of the sweep is checked when it runs.
    pub const SWEEP: Self = Self {
        coil: false,
        array: false,
        target: false,
        workspace: false,
    };

    /// Whether a key decides anything that the command computes.
    pub(super) fn uses(self, key: &str) -> bool {
        match key.split('.').next() {
            Some("target") => self.target,
            Some("workspace") => self.workspace,
            // It decides no force; results state it beside the temperatures.
            Some("cooling") => false,
            _ => true,
        }
    }
}

/// The sections as read, in the file's units.
#[derive(Debug)]
pub(super) struct Draft {
    pub(super) name: Option<String>,
    pub(super) coil: Option<CoilDraft>,
    pub(super) wire: WireDraft,
    pub(super) core: Option<CoreDraft>,
    pub(super) plate: Option<Plate>,
    pub(super) iron: Vec<Iron>,
    pub(super) array: ArrayDraft,
    pub(super) magnet: MagnetDraft,
    pub(super) supply: SupplyDraft,
    pub(super) limits: Limits,
    pub(super) prices: Prices,
    pub(super) cooling: Cooling,
    pub(super) uncertainty: Uncertainty,
    pub(super) target_height: Located<f64>,
    pub(super) workspace: WorkspaceDraft,
    pub(super) search: SearchSpace,
}

impl Draft {
    pub(super) fn read(root: &mut Section<'_>, need: Need) -> Self {
        if need.coil && !root.has("coil") {
            root.missing(
                "coil",
                "add [coil] with inner_diameter_mm, outer_diameter_mm, length_mm",
            );
        }
        Self {
            name: root.name(),
            coil: sections::coil(root.section("coil")),
            wire: sections::wire(root.section("wire")),
            core: sections::core(root.section("core")),
            plate: iron::plate(root.section("plate")),
            iron: root
                .sections("iron")
                .into_iter()
                .filter_map(iron::body)
                .collect(),
            array: sections::array(root.section("array")),
            magnet: sections::magnet(root.section("magnet")),
            supply: sections::supply(root.section("supply")),
            limits: limits::read(root.section("limits")),
            prices: limits::prices(root.section("cost")),
            cooling: sections::cooling(root.section("cooling")),
            uncertainty: sections::uncertainty(root.section("uncertainty")),
            target_height: sections::target_height_mm(root.section("target")),
            workspace: sections::workspace(root.section("workspace")),
            search: search::read(root.section("search")),
        }
    }
}
