//! Reading a design file: text to a validated [`Design`], or every fault in it.

use std::path::{Path, PathBuf};

use super::checks;
use super::diagnostics::{Faults, InvalidDocument};
use super::draft::{Draft, Need};
use super::iron::{Iron, IronShape};
use super::keys;
use super::model::{
    Array, BANDWIDTH_HZ, Coil, Core, Coupling, Design, Magnet, Steel, Supply, Wire, Workspace,
};
use super::reader::{Sink, read_document};
use super::sections::{CoilDraft, CoreDraft, Layout, MagnetDraft};
use super::sections::{SupplyDraft, WireDraft, WorkspaceDraft, axis_m};
use super::source;
use super::values::OneOrMany;
use fluxform_base::units::m_from_mm;

impl Design {
    /// The design that `text` describes, and the warnings about it. `path` names it in messages
    /// and its folder is where files that it names are looked for.
    ///
    /// # Errors
    /// Every fault found.
    pub fn from_toml(
        text: &str,
        path: &Path,
        need: Need,
    ) -> Result<(Self, Faults), InvalidDocument> {
        read_document(text, path, keys::of_designs, |root, sink| {
            let draft = Draft::read(root, need);
            checks::check(&draft, need, sink);
            draft.design(path, need, sink)
        })
    }

    /// Whether every key of `text` is known and every value of its kind and within its bounds;
    /// whether the parts fit together is not checked.
    ///
    /// # Errors
    /// Every fault found.
    pub fn check_keys(text: &str, path: &Path) -> Result<(), InvalidDocument> {
        read_document(text, path, keys::of_designs, |root, _| {
            Draft::read(root, Need::SWEEP);
            Some(())
        })
        .map(|_| ())
    }

    /// The design in the file `path`, as [`Design::from_toml`].
    ///
    /// # Errors
    /// Every fault found, or why the file cannot be read.
    pub fn read(path: &Path, need: Need) -> Result<(Self, Faults), InvalidDocument> {
        Self::from_toml(&source::text_of(path)?, path, need)
    }
}

impl Draft {
    /// The design in SI; `None` where an error prevents it.
    fn design(self, path: &Path, need: Need, sink: &Sink) -> Option<Design> {
        if sink.has_errors() {
            return None;
        }
        let positions_m = self.array.layout.positions_m();
        let coils = positions_m.len();
        let coupling = match self.core {
            Some(_) => Coupling::Full,
            None => Coupling::None,
        };
        Some(Design {
            name: self.name?,
            coil: self.coil.map(coil_m),
            wire: wire_m(self.wire),
            core: self.core.map(|core| core_m(core, path)),
            plate: self.plate,
            iron: self
                .iron
                .into_iter()
                .map(|iron| iron_m(iron, path))
                .collect(),
            array: Array {
                positions_m,
                grid: match self.array.layout {
                    Layout::Grid(grid, _) => Some(grid),
                    _ => None,
                },
                coupling: self.array.coupling.unwrap_or(coupling),
                gain: self
                    .array
                    .gain
                    .map_or_else(|| vec![1.0; coils], |gain| gain.value),
            },
            magnet: magnet_m(&self.magnet),
            supply: supply_of(self.supply, coils),
            limits: self.limits,
            prices: self.prices,
            cooling: self.cooling,
            uncertainty: self.uncertainty,
            target_height_m: m_from_mm(self.target_height.value),
            workspace: workspace_m(&self.workspace)?,
            search: self.search,
            assumed: sink
                .assumed()
                .into_iter()
                .filter(|one| need.uses(&one.key))
                .collect(),
        })
    }
}

fn coil_m(draft: CoilDraft) -> Coil {
    Coil {
        inner_diameter_m: m_from_mm(draft.inner.value),
        outer_diameter_m: m_from_mm(draft.outer.value),
        length_m: m_from_mm(draft.length.value),
        turns: draft.turns.map(|turns| turns.value),
    }
}

fn wire_m(draft: WireDraft) -> Wire {
    Wire {
        diameter_m: m_from_mm(draft.diameter.value),
        conductor_diameter_m: m_from_mm(draft.conductor.value),
        resistivity_ohm_m: draft.resistivity_ohm_m.value,
        temperature_c: draft.temperature_c.value,
        choices_m: draft.choices.into_iter().map(m_from_mm).collect(),
    }
}

fn core_m(draft: CoreDraft, path: &Path) -> Core {
    Core {
        clearance_m: m_from_mm(draft.clearance.value),
        above_m: m_from_mm(draft.above.value),
        below_m: m_from_mm(draft.below.value),
        knee_t: draft.knee_t,
        steel: match draft.bh_curve {
            Some(file) => Steel::Curve(beside(path, file)),
            None => Steel::Linear(draft.relative_permeability),
        },
        conductivity_s_per_m: draft.conductivity_s_per_m,
        lamination_m: draft.lamination.map(m_from_mm),
    }
}

fn iron_m(mut iron: Iron, path: &Path) -> Iron {
    if let IronShape::Mesh { surface, .. } = &mut iron.shape {
        *surface = beside(path, &*surface);
    }
    iron
}

/// A file that the design at `path` names.
fn beside(path: &Path, file: impl AsRef<Path>) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).join(file)
}

fn magnet_m(draft: &MagnetDraft) -> Magnet {
    Magnet {
        diameter_m: m_from_mm(draft.diameter),
        length_m: m_from_mm(draft.length),
        magnetization_a_per_m: draft.magnetization_a_per_m,
        polarity: draft.polarity,
        model: draft.model,
        tilt_deg: draft.tilt_deg,
        passive_force: draft.passive_force,
    }
}

fn supply_of(draft: SupplyDraft, coils: usize) -> Supply {
    let each = |current: OneOrMany| match current {
        OneOrMany::One(current) => vec![current; coils],
        OneOrMany::Many(currents) => currents,
    };
    Supply {
        current_max_a: each(draft.current_max_a.value),
        current_min_a: each(draft.current_min_a.value),
        total_current_max_a: draft.total_current_max_a,
        voltage_v: draft.voltage_v,
        driver: draft.driver,
        bandwidth_hz: draft.bandwidth_hz.map_or(BANDWIDTH_HZ, |hz| hz.value),
    }
}

fn workspace_m(draft: &WorkspaceDraft) -> Option<Workspace> {
    Some(Workspace {
        x_m: axis_m(draft.x.as_ref()?.value),
        y_m: axis_m(draft.y.as_ref()?.value),
        z_m: axis_m(draft.z.as_ref()?.value),
        is_given: draft.is_given,
    })
}
