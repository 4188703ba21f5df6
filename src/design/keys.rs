//! The keys of a document as its reader asks for them: what each may hold, its default, its meaning.
//!
//! A key is declared where it is read, on one line. The list is made by letting the reader read a
//! document in which every section is empty; what cannot follow from that is what a key means,
//! which is written here and held against the reader by a test.

use super::draft::{Draft, Need};
use super::limits;
use super::reader::list_keys;

pub use super::key::{Accepts, Assumed, Key, Without, with_meanings};

/// The keys of a design.
#[must_use]
pub fn of_designs() -> Vec<Key> {
    const SECTIONS: &str = "[coil]\n[wire]\n[core]\n[plate]\n[[iron]]\n[array]\n[magnet]\n[supply]\n[limits]\n\
                            [cost]\n[cooling]\n[uncertainty]\n[target]\n[workspace]\n[search.coil]\n[search.wire]\n\
                            [search.core]\n[search.plate]\n[search.array]\n[search.magnet]\n[search.shapes]\n";
    let keys = list_keys(SECTIONS, |root| {
        Draft::read(root, Need::EVALUATE);
    });
    with_meanings(keys, &[MEANINGS, limits::MEANINGS].concat())
}

const MEANINGS: &[(&str, &str)] = &[
    ("name", "names the folder of results"),
    ("coil.inner_diameter_mm", "the winding's bore"),
    ("coil.outer_diameter_mm", "the winding's outer diameter"),
    ("coil.length_mm", "the winding's length along its axis"),
    (
        "coil.turns",
        "turns of the winding; without it as many as the window holds",
    ),
    (
        "wire.diameter_mm",
        "over the insulation; a gauge is the bare wire's",
    ),
    (
        "wire.conductor_diameter_mm",
        "of the bare conductor; without it `diameter_mm`",
    ),
    (
        "wire.resistivity_ohm_m",
        "of the conductor at 20 C; its mass, its heat capacity and its change with temperature stay those of copper",
    ),
    (
        "wire.temperature_c",
        "of the winding, for its resistance and heat; by its linear law copper has no resistance at -234.45 C",
    ),
    (
        "wire.choices_mm",
        "wires that `optimize` may choose from, over the insulation, the conductor in the proportion of the two above; \
         a gauge is the conductor's",
    ),
    (
        "core.clearance_mm",
        "between the core and the bore, in radius",
    ),
    (
        "core.above_mm",
        "how far the core's top is above the winding's",
    ),
    (
        "core.below_mm",
        "how far the core's bottom is below the winding's",
    ),
    (
        "core.relative_permeability",
        "of linear steel; not with `bh_curve`",
    ),
    (
        "core.bh_curve",
        "a table of the steel's magnetisation, beside the design",
    ),
    (
        "core.knee_t",
        "flux density from which the steel saturates; of a curve its own",
    ),
    (
        "core.conductivity_s_per_m",
        "of the steel, for its eddy currents",
    ),
    (
        "core.lamination_mm",
        "thickness of the core's sheets; without it the core is solid",
    ),
    ("plate.thickness_mm", "the plate's thickness"),
    ("plate.x_mm", "its side along x"),
    ("plate.y_mm", "its side along y"),
    ("plate.diameter_mm", "of a round plate, instead of sides"),
    (
        "plate.gap_mm",
        "from the cores' lower ends (without cores the windings') down to it; at 0 cores join it",
    ),
    (
        "plate.holes_mm",
        "holes through it, as [x, y, diameter]; clear of feet, its edge and each other",
    ),
    ("plate.relative_permeability", "of its linear steel"),
    (
        "plate.knee_t",
        "flux density from which its steel saturates",
    ),
    ("iron.shape", "the body's shape"),
    ("iron.size_mm", "a box's sides along x, y and z"),
    (
        "iron.diameter_mm",
        "outer diameter of a cylinder or tube about z, or of a ball",
    ),
    ("iron.inner_diameter_mm", "of a tube"),
    ("iron.length_mm", "of a cylinder or a tube"),
    (
        "iron.surface",
        "the file of a closed mesh, beside the design",
    ),
    (
        "iron.unit",
        "of the mesh's coordinates, where its file carries none",
    ),
    ("iron.center_mm", "its middle; not of a mesh"),
    (
        "iron.translate_mm",
        "of a mesh: where its file's origin goes",
    ),
    ("iron.rotate_deg", "rotation about x, then y, then z"),
    ("iron.relative_permeability", "of its linear steel"),
    ("iron.knee_t", "flux density from which its steel saturates"),
    ("array.positions_mm", "the coils' axes, instead of a grid"),
    ("array.rows", "rows of the grid, along y"),
    ("array.columns", "columns of the grid, along x"),
    ("array.pitch_mm", "distance of neighbouring axes"),
    (
        "array.coupling",
        "whether cores magnetise each other; without it `full` with cores, else `none`",
    ),
    (
        "array.gain",
        "factor on each coil's field, as measured; without it 1",
    ),
    ("magnet.diameter_mm", "the magnet's diameter"),
    ("magnet.length_mm", "the magnet's length"),
    (
        "magnet.magnetization_a_per_m",
        "its magnetisation, B_r / mu_0",
    ),
    (
        "magnet.polarity",
        "whether positive currents push the magnet away or pull it",
    ),
    (
        "magnet.model",
        "one dipole at its centre, or the whole cylinder",
    ),
    ("magnet.tilt_deg", "rotation about x, then about y"),
    (
        "magnet.passive_force",
        "whether the pull of the unpowered cores is part of the force",
    ),
    (
        "supply.current_max_a",
        "largest current of every coil, or of each",
    ),
    (
        "supply.current_min_a",
        "least current of every coil, or of each",
    ),
    (
        "supply.total_current_max_a",
        "limit of the sum of the currents",
    ),
    (
        "supply.voltage_v",
        "limits the current by the resistance, and how fast it follows",
    ),
    (
        "supply.driver",
        "whether drivers set voltages, or currents in a closed loop; without it `voltage`",
    ),
    (
        "supply.bandwidth_hz",
        "bandwidth of a current loop; without it 1000",
    ),
    (
        "cost.per_coil",
        "price of a coil whatever its size (bobbin, driver, work), in any currency",
    ),
    ("cost.wire_per_kg", "price of a kilogram of wire"),
    (
        "cost.steel_per_kg",
        "price of a kilogram of cores and plate",
    ),
    (
        "cooling.surface_w_per_m2_k",
        "heat that leaves a coil's surface: still air and radiation",
    ),
    ("cooling.ambient_c", "temperature of the air"),
    (
        "cooling.winding_max_c",
        "temperature that the wire's insulation withstands continuously",
    ),
    (
        "cooling.heating_s",
        "how long currents flow for which a temperature is stated",
    ),
    (
        "uncertainty.sensor_mm",
        "how far the magnet may be from where it is measured, along each axis",
    ),
    (
        "uncertainty.tilt_deg",
        "how far the finger may tilt the magnet, in any direction",
    ),
    (
        "uncertainty.heat_c",
        "how much warmer the magnet may become",
    ),
    (
        "uncertainty.driver_percent",
        "by how much each driver's current may be off",
    ),
    (
        "target.height_mm",
        "height of the magnet's centre above the winding, for `evaluate` and `optimize`",
    ),
    ("workspace.x_mm", "nodes of the map along x"),
    ("workspace.y_mm", "nodes of the map along y"),
    (
        "workspace.z_mm",
        "nodes of the map along z, above the windings' top",
    ),
    (
        "search.coil.inner_diameter_mm",
        "range `[from, to]` in which `optimize --for` looks for the bore; one value or three and more are choices",
    ),
    (
        "search.coil.outer_diameter_mm",
        "range of the outer diameter",
    ),
    (
        "search.coil.length_mm",
        "range of the winding's length; layers and turns are whole",
    ),
    (
        "search.wire.diameter_mm",
        "wires to choose from, over the insulation",
    ),
    (
        "search.core.clearance_mm",
        "range of the gap between core and bore",
    ),
    ("search.core.above_mm", "range of the core's top"),
    ("search.core.below_mm", "range of the core's bottom"),
    (
        "search.core.none",
        "whether coils without cores are tried too",
    ),
    (
        "search.plate.thickness_mm",
        "range of the plate's thickness",
    ),
    ("search.plate.x_mm", "range of its side along x"),
    ("search.plate.y_mm", "range of its side along y"),
    (
        "search.plate.diameter_mm",
        "range of a round plate's diameter",
    ),
    (
        "search.plate.gap_mm",
        "range of the gap between cores and plate",
    ),
    (
        "search.plate.none",
        "whether arrays without the plate are tried too",
    ),
    ("search.array.pitch_mm", "range of the pitch"),
    ("search.array.rows", "numbers of rows to choose from"),
    ("search.array.columns", "numbers of columns to choose from"),
    (
        "search.array.move_mm",
        "range in which coils move along x and y, off their layout",
    ),
    (
        "search.array.layout",
        "layouts to choose from: a grid, rows shifted by half a pitch, a ring about one coil",
    ),
    (
        "search.array.symmetry",
        "which coils move alike; without it `square`",
    ),
    (
        "search.magnet.size_mm",
        "diameters and lengths of magnets to choose from",
    ),
    (
        "search.shapes.height_mm",
        "range by which all shapes are raised",
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_knows_what_the_reader_knows() {
        let keys = of_designs();
        let key = |path: &str| keys.iter().find(|key| key.path() == path).unwrap();
        let length = key("coil.length_mm");
        assert_eq!(length.accepts.words(), "number, mm");
        assert_eq!(length.accepts.range, "> 0");
        assert_eq!(length.default, Without::Refused);
        let polarity = key("magnet.polarity");
        assert_eq!(polarity.accepts.words(), "`\"repel\"` or `\"attract\"`");
        assert_eq!(polarity.default, Without::Value("\"repel\"".to_owned()));
        assert_eq!(
            key("supply.current_max_a").default,
            Without::Value("2".to_owned())
        );
        assert_eq!(key("coil.turns").default, Without::Nothing);
        assert_eq!(
            key("workspace.z_mm").default,
            Without::Value("[10, 80, 29]".to_owned())
        );
    }

    #[test]
    #[should_panic(expected = "a key that is new")]
    fn a_key_without_a_meaning_is_seen() {
        let mut keys = of_designs();
        keys.truncate(1);
        keys[0].name = "a key that is new";
        let _ = with_meanings(keys, &[]);
    }
}
