//! The limits of equation 11 and of good practice: one table, from which the optimiser's, the
//! evaluation's and the reports' lists are made.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize, Serializer};

use super::array_heat::Drivers;
use super::circuit::{Circuit, turns_that_fit};
use fluxform_base::units::STEEL_DENSITY_KG_PER_M3;
use fluxform_design::iron::Plate;
use fluxform_design::{Coil, Design, Limits};

/// Relative difference between turns and turns that fit that counts as none.
const FULL: f64 = 1e-12;

/// The limits of a coil: the design file's, then those that follow from supply, wire and
/// dimensions that are given. In the order of [`LIMITS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum LimitName {
    /// Outer diameter, m.
    OuterDiameter,
    /// Inner diameter, m; a lower limit.
    InnerDiameter,
    /// Length, m.
    Length,
    /// R, ohm.
    Resistance,
    /// Five time constants, s.
    Settling,
    /// Heat at the rated current, W.
    Power,
    /// Mass of wire and core, kg.
    Mass,
    /// Length of wire, m.
    WireLength,
    /// Flux density in the core, T.
    CoreField,
    /// Larger side of the rectangle that holds all coils and the plate, m.
    Footprint,
    /// Most heat of all coils that drivers and supply allow, W.
    ArrayPower,
    /// Heat of all coils at the static currents of the shape that takes most, W.
    StaticPower,
    /// Mean heat of all coils with position feedback over the shape that takes most, W.
    FeedbackPower,
    /// Mass of all coils, cores and the plate, kg.
    ArrayMass,
    /// Five time constants of the slowest pattern of currents in the array, s.
    ArraySettling,
    /// Cost of all coils, cores and the plate.
    ArrayCost,
    /// Turns over turns that fit; always holds.
    WindingFill,
    /// The supply's voltage, V, where the driver's current is the rated one.
    Voltage,
    /// The driver's current, A, where the supply's voltage sets the rated one.
    Current,
    /// One layer of wire must fit.
    OneLayer,
    /// One turn a layer must fit.
    OneTurn,
    /// The inner radius is not negative.
    Axis,
    /// Distance of the array's nearest axes, m: wider coils overlap.
    Pitch,
    /// A given inner diameter.
    FixedInner,
    /// A given outer diameter.
    FixedOuter,
    /// A given length.
    FixedLength,
}

/// Which side of a limit a value must be on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// At most the limit.
    AtMost,
    /// At least the limit.
    AtLeast,
    /// The limit itself.
    Equal,
}

/// What of one coil a limit bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CoilQuantity {
    /// Outer diameter, m.
    OuterDiameter,
    /// Inner diameter, m.
    InnerDiameter,
    /// Length, m.
    Length,
    /// Depth of the winding, m.
    Depth,
    /// R, ohm.
    Resistance,
    /// Five time constants, s.
    Settling,
    /// Heat at the rated current, W.
    Power,
    /// Mass of wire and core, kg.
    Mass,
    /// Length of wire, m.
    WireLength,
    /// Flux density in the core, T.
    CoreField,
    /// Turns over turns that fit.
    WindingFill,
    /// Voltage at the rated current, V.
    Voltage,
    /// The rated current, A.
    Current,
    /// Heat of all coils of the array, W.
    ArrayPower,
    /// Mass of all coils and cores of the array, kg.
    ArrayMass,
}

/// A unit and how many of it are one SI unit.
pub type Scaled = (&'static str, f64);

/// One limit.
pub struct Limit {
    /// Which.
    pub name: LimitName,
    /// Its name in artefacts.
    pub key: &'static str,
    /// Key that sets it in a design file.
    pub design_key: &'static str,
    /// Its name on screen.
    pub label: &'static str,
    /// Its unit on screen; empty for a ratio.
    pub unit: &'static str,
    /// The unit of its design key.
    pub written: Scaled,
    /// The step by which it is said to move.
    pub step: Scaled,
    /// Which side is allowed.
    pub direction: Direction,
    /// Whether it alone gives the force a maximum.
    pub ends_growth: bool,
    /// What it bounds of one coil, or of an array of such coils; `None` where more than the coil decides.
    pub quantity: Option<CoilQuantity>,
    /// Whether its value follows from shapes, not from a design alone.
    pub of_shapes: bool,
    /// The limit that a design sets, SI.
    pub of: fn(&Limits) -> Option<f64>,
    /// Its value in an evaluated coil, SI.
    pub value: fn(&Evaluated<'_>) -> Option<f64>,
}

/// A coil as evaluated.
#[derive(Debug, Clone, Copy)]
pub struct Evaluated<'a> {
    /// Its design.
    pub design: &'a Design,
    /// Its circuit.
    pub circuit: &'a Circuit,
    /// Heat at the rated current, W.
    pub power_w: f64,
    /// Mass of wire and core, kg.
    pub mass_kg: f64,
    /// Flux density in the core where there is one, T.
    pub core_field_t: Option<f64>,
    /// Inductance of the slowest pattern of currents in the array, H, where that is known.
    pub array_inductance_h: Option<f64>,
    /// What the shapes take, where they are known.
    pub used: UsedPower,
}

/// Heat of all coils by the use of the array, W: of the shape that takes most, at its force constant.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct UsedPower {
    /// With static currents; `None` where they are not known.
    pub static_w: Option<f64>,
    /// The mean with position feedback, by currents of least power; `None` where they are not known.
    pub feedback_w: Option<f64>,
}

impl Evaluated<'_> {
    fn coil(&self) -> Option<&Coil> {
        self.design.coil.as_ref()
    }

    /// Time until a step to the rated current has settled, s.
    fn settling_s(&self, inductance_h: f64) -> f64 {
        let supply = &self.design.supply;
        let current_a = self.circuit.rated_current_a(supply);
        let circuit = Circuit {
            inductance_h,
            ..*self.circuit
        };
        circuit.settling_under_s(supply, current_a)
    }

    /// Mass of all coils, cores and the plate, kg.
    fn array_mass_kg(&self) -> f64 {
        let plate_m3 = self.design.plate.as_ref();
        let plate_m3 = plate_m3.map_or(0.0, Plate::volume_m3);
        self.mass_kg * self.design.array.positions_m.len() as f64
            + plate_m3 * STEEL_DENSITY_KG_PER_M3
    }

    /// Cost of all coils, cores and the plate.
    fn array_cost(&self) -> f64 {
        let prices = &self.design.prices;
        let coils = self.design.array.positions_m.len() as f64;
        let wire_kg = coils * self.circuit.wire_mass_kg;
        coils * prices.per_coil
            + wire_kg * prices.wire_per_kg
            + (self.array_mass_kg() - wire_kg) * prices.steel_per_kg
    }

    /// Larger side of the rectangle that holds all coils and the plate, m.
    fn footprint_m(&self) -> Option<f64> {
        let outer_m = self.coil()?.outer_diameter_m;
        let side_m = |axis: usize| {
            let ends = self
                .design
                .array
                .positions_m
                .iter()
                .map(|place| place[axis]);
            let [low, high] = ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                [low.min(x), high.max(x)]
            });
            high - low + outer_m
        };
        let plate = self.design.plate.iter();
        let of_plate = plate.flat_map(|plate| plate.sides_m()).flatten();
        Some(of_plate.fold(side_m(0).max(side_m(1)), f64::max))
    }

    /// The most heat of all coils that drivers and supply allow, W.
    fn array_power_w(&self) -> f64 {
        let supply = &self.design.supply;
        let resistance_ohm = self.circuit.resistance_ohm;
        let [heat_w, _] = Drivers::of(supply).most_heat_w(supply.voltage_v, resistance_ohm);
        heat_w
    }
}

/// Turns over turns that fit; a window of whole layers is full but for the rounding of its
/// dimensions.
fn winding_fill(at: &Evaluated<'_>) -> Option<f64> {
    let fill = at.circuit.turns / turns_that_fit(at.coil()?, &at.design.wire);
    Some(if (fill - 1.0).abs() <= FULL {
        1.0
    } else {
        fill
    })
}

const MM: Scaled = ("mm", 1e3);

/// A size of the coil, and what most rows have.
const SIZE: Limit = Limit {
    name: LimitName::OuterDiameter,
    key: "outer_diameter_m",
    design_key: "limits.outer_diameter_max_mm",
    label: "outer diameter",
    unit: "mm",
    written: MM,
    step: MM,
    direction: Direction::AtMost,
    ends_growth: false,
    quantity: Some(CoilQuantity::OuterDiameter),
    of_shapes: false,
    of: |limits| limits.outer_diameter_max_m,
    value: |at| Some(at.coil()?.outer_diameter_m),
};

/// The heat of all coils, and what its other rows have.
const HEAT_OF_ALL: Limit = Limit {
    name: LimitName::ArrayPower,
    key: "array_power_w",
    design_key: "limits.array_power_max_w",
    label: "heat of all coils",
    unit: "W",
    written: ("W", 1.0),
    step: ("W", 1.0),
    quantity: Some(CoilQuantity::ArrayPower),
    of: |limits| limits.array_power_max_w,
    value: |at| Some(at.array_power_w()),
    ..SIZE
};

/// Limits that follow from more than the coil's design file.
const IMPLIED: Limit = Limit {
    of: |_| None,
    value: |_| None,
    ..SIZE
};

/// Every limit, in the order of [`LimitName`].
pub static LIMITS: &[Limit] = &[
    SIZE,
    Limit {
        name: LimitName::InnerDiameter,
        key: "inner_diameter_m",
        design_key: "limits.inner_diameter_min_mm",
        label: "inner diameter",
        direction: Direction::AtLeast,
        quantity: Some(CoilQuantity::InnerDiameter),
        of: |limits| limits.inner_diameter_min_m,
        value: |at| Some(at.coil()?.inner_diameter_m),
        ..SIZE
    },
    Limit {
        name: LimitName::Length,
        key: "length_m",
        design_key: "limits.length_max_mm",
        label: "length",
        quantity: Some(CoilQuantity::Length),
        of: |limits| limits.length_max_m,
        value: |at| Some(at.coil()?.length_m),
        ..SIZE
    },
    Limit {
        name: LimitName::Resistance,
        key: "resistance_ohm",
        design_key: "limits.resistance_max_ohm",
        label: "resistance",
        unit: "ohm",
        written: ("ohm", 1.0),
        step: ("ohm", 1.0),
        ends_growth: true,
        quantity: Some(CoilQuantity::Resistance),
        of: |limits| limits.resistance_max_ohm,
        value: |at| Some(at.circuit.resistance_ohm),
        ..SIZE
    },
    Limit {
        name: LimitName::Settling,
        key: "settling_s",
        design_key: "limits.settling_max_ms",
        label: "settling",
        unit: "s",
        written: ("ms", 1e3),
        step: ("ms", 1e3),
        ends_growth: true,
        quantity: Some(CoilQuantity::Settling),
        of: |limits| limits.settling_max_s,
        value: |at| Some(at.settling_s(at.circuit.inductance_h)),
        ..SIZE
    },
    Limit {
        name: LimitName::Power,
        key: "power_w",
        design_key: "limits.power_max_w",
        label: "heat",
        unit: "W",
        written: ("W", 1.0),
        step: ("W", 1.0),
        ends_growth: true,
        quantity: Some(CoilQuantity::Power),
        of: |limits| limits.power_max_w,
        value: |at| Some(at.power_w),
        ..SIZE
    },
    Limit {
        name: LimitName::Mass,
        key: "mass_kg",
        design_key: "limits.mass_max_kg",
        label: "mass",
        unit: "g",
        written: ("kg", 1.0),
        step: ("g", 1e3),
        ends_growth: true,
        quantity: Some(CoilQuantity::Mass),
        of: |limits| limits.mass_max_kg,
        value: |at| Some(at.mass_kg),
        ..SIZE
    },
    Limit {
        name: LimitName::WireLength,
        key: "wire_length_m",
        design_key: "limits.wire_length_max_m",
        label: "wire length",
        unit: "m",
        written: ("m", 1.0),
        step: ("m of wire", 1.0),
        ends_growth: true,
        quantity: Some(CoilQuantity::WireLength),
        of: |limits| limits.wire_length_max_m,
        value: |at| Some(at.circuit.wire_length_m),
        ..SIZE
    },
    Limit {
        name: LimitName::CoreField,
        key: "core_field_t",
        design_key: "limits.core_field_max_t",
        label: "core field",
        unit: "T",
        written: ("T", 1.0),
        step: ("mT", 1e3),
        quantity: Some(CoilQuantity::CoreField),
        of: |limits| limits.core_field_max_t,
        value: |at| at.core_field_t,
        ..SIZE
    },
    Limit {
        name: LimitName::Footprint,
        key: "footprint_m",
        design_key: "limits.footprint_max_mm",
        label: "footprint",
        quantity: None,
        of: |limits| limits.footprint_max_m,
        value: |at| at.footprint_m(),
        ..SIZE
    },
    HEAT_OF_ALL,
    Limit {
        name: LimitName::StaticPower,
        key: "static_power_w",
        design_key: "limits.static_power_max_w",
        label: "heat at static currents",
        quantity: None,
        of_shapes: true,
        of: |limits| limits.static_power_max_w,
        value: |at| at.used.static_w,
        ..HEAT_OF_ALL
    },
    Limit {
        name: LimitName::FeedbackPower,
        key: "feedback_power_w",
        design_key: "limits.feedback_power_max_w",
        label: "heat with feedback",
        quantity: None,
        of_shapes: true,
        of: |limits| limits.feedback_power_max_w,
        value: |at| at.used.feedback_w,
        ..HEAT_OF_ALL
    },
    Limit {
        name: LimitName::ArrayMass,
        key: "array_mass_kg",
        design_key: "limits.array_mass_max_kg",
        label: "mass of all coils",
        unit: "g",
        written: ("kg", 1.0),
        step: ("kg", 1.0),
        quantity: Some(CoilQuantity::ArrayMass),
        of: |limits| limits.array_mass_max_kg,
        value: |at| Some(at.array_mass_kg()),
        ..SIZE
    },
    Limit {
        name: LimitName::ArraySettling,
        key: "array_settling_s",
        design_key: "limits.array_settling_max_ms",
        label: "settling in the array",
        unit: "s",
        written: ("ms", 1e3),
        step: ("ms", 1e3),
        quantity: None,
        of: |limits| limits.array_settling_max_s,
        value: |at| Some(at.settling_s(at.array_inductance_h?)),
        ..SIZE
    },
    Limit {
        name: LimitName::ArrayCost,
        key: "array_cost",
        design_key: "limits.array_cost_max",
        label: "cost of all coils",
        unit: "",
        written: ("", 1.0),
        step: ("", 1.0),
        quantity: None,
        of: |limits| limits.array_cost_max,
        value: |at| Some(at.array_cost()),
        ..SIZE
    },
    Limit {
        name: LimitName::WindingFill,
        key: "winding_fill",
        design_key: "coil.turns",
        label: "winding fill",
        unit: "",
        written: ("", 1.0),
        step: ("", 1.0),
        quantity: Some(CoilQuantity::WindingFill),
        of: |_| Some(1.0),
        value: winding_fill,
        ..SIZE
    },
    Limit {
        name: LimitName::Voltage,
        key: "voltage_v",
        design_key: "supply.voltage_v",
        label: "the supply's voltage",
        unit: "V",
        written: ("V", 1.0),
        step: ("V", 1.0),
        quantity: Some(CoilQuantity::Voltage),
        ..IMPLIED
    },
    Limit {
        name: LimitName::Current,
        key: "current_a",
        design_key: "supply.current_max_a",
        label: "the drivers' current",
        unit: "A",
        written: ("A", 1.0),
        step: ("A", 1.0),
        quantity: Some(CoilQuantity::Current),
        ..IMPLIED
    },
    Limit {
        name: LimitName::OneLayer,
        key: "one_layer_m",
        design_key: "wire.diameter_mm",
        label: "wire diameter",
        direction: Direction::AtLeast,
        quantity: Some(CoilQuantity::Depth),
        ..IMPLIED
    },
    Limit {
        name: LimitName::OneTurn,
        key: "one_turn_m",
        design_key: "wire.diameter_mm",
        label: "wire diameter",
        direction: Direction::AtLeast,
        quantity: Some(CoilQuantity::Length),
        ..IMPLIED
    },
    Limit {
        name: LimitName::Axis,
        key: "axis_m",
        design_key: "coil.inner_diameter_mm",
        label: "axis",
        direction: Direction::AtLeast,
        quantity: Some(CoilQuantity::InnerDiameter),
        ..IMPLIED
    },
    Limit {
        name: LimitName::Pitch,
        key: "pitch_m",
        design_key: "array.pitch_mm",
        label: "the array's pitch",
        ..IMPLIED
    },
    Limit {
        name: LimitName::FixedInner,
        key: "inner_diameter_m",
        design_key: "coil.inner_diameter_mm",
        label: "inner diameter",
        direction: Direction::Equal,
        quantity: Some(CoilQuantity::InnerDiameter),
        ..IMPLIED
    },
    Limit {
        name: LimitName::FixedOuter,
        design_key: "coil.outer_diameter_mm",
        direction: Direction::Equal,
        ..IMPLIED
    },
    Limit {
        name: LimitName::FixedLength,
        key: "length_m",
        design_key: "coil.length_mm",
        label: "length",
        direction: Direction::Equal,
        quantity: Some(CoilQuantity::Length),
        ..IMPLIED
    },
];

impl Serialize for LimitName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.key())
    }
}

impl LimitName {
    /// Its row of the table.
    #[must_use]
    pub fn limit(self) -> &'static Limit {
        &LIMITS[self as usize]
    }

    /// The name that artefacts use.
    #[must_use]
    pub fn key(self) -> &'static str {
        self.limit().key
    }

    /// Whether the value must stay above the limit.
    #[must_use]
    pub fn is_lower(self) -> bool {
        self.limit().direction == Direction::AtLeast
    }

    /// Whether the value is given.
    #[must_use]
    pub fn is_equality(self) -> bool {
        self.limit().direction == Direction::Equal
    }

    /// Whether it limits a dimension of the coil, not what it is made of or does.
    #[must_use]
    pub fn is_dimension(self) -> bool {
        self.is_geometry()
            || matches!(
                self,
                Self::OuterDiameter | Self::InnerDiameter | Self::Length | Self::Pitch
            )
    }

    /// Whether it follows from geometry and cannot be blamed on a limit that was set.
    #[must_use]
    pub(crate) fn is_geometry(self) -> bool {
        self.is_equality() || self.is_least_size()
    }

    /// Whether it is the least size that a coil of its wire can have, which no limit that is set changes.
    #[must_use]
    pub fn is_least_size(self) -> bool {
        matches!(self, Self::OneLayer | Self::OneTurn | Self::Axis)
    }
}

/// The limit that artefacts call `key`.
#[must_use]
pub fn by_key(key: &str) -> Option<&'static Limit> {
    LIMITS.iter().find(|limit| limit.key == key)
}

/// The thinnest mandrel that a coil is wound on where the design names no least bore, m: thinner ones
/// bend under the wire's tension.
pub const MANDREL_M: f64 = 0.003;

/// Diameters of its wire that a mandrel has at least: a rule of thumb, for enamel that is bent does not
/// crack at once.
pub const WIRES_A_MANDREL: f64 = 4.0;

/// The smallest bore, m, of a coil that is to be wound of wire of this diameter over its insulation, m.
#[must_use]
pub fn bobbin_bore_m(wire_diameter_m: f64) -> f64 {
    MANDREL_M.max(WIRES_A_MANDREL * wire_diameter_m)
}

/// A limit beside the value it bounds, SI.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LimitCheck {
    /// The coil's value.
    pub value: f64,
    /// The limit: an upper one but for `inner_diameter_m`.
    pub limit: f64,
    /// Whether the value respects the limit; equality does.
    pub met: bool,
}

/// The limits that a design names whose values follow from shapes.
pub fn of_shapes(limits: &Limits) -> impl Iterator<Item = &'static Limit> {
    let named = LIMITS.iter().filter(|row| row.of_shapes);
    named.filter(|row| (row.of)(limits).is_some())
}

/// A warning for each limit that [`of_shapes`] names, where it is not checked.
pub fn unchecked(limits: &Limits) -> impl Iterator<Item = String> {
    of_shapes(limits).map(|limit| {
        format!(
            "{}: not checked, as it follows from shapes; `optimize --for` checks it",
            limit.design_key
        )
    })
}

/// Every limit that the coil's design names, by the names that artefacts use, and `winding_fill`.
#[must_use]
pub fn check(coil: &Evaluated<'_>) -> BTreeMap<&'static str, LimitCheck> {
    let checked = LIMITS.iter().filter_map(|row| {
        let limit = (row.of)(&coil.design.limits)?;
        let value = (row.value)(coil)?;
        let met = match row.direction {
            Direction::AtMost => value <= limit,
            Direction::AtLeast => value >= limit,
            Direction::Equal => value == limit,
        };
        Some((row.key, LimitCheck { value, limit, met }))
    });
    checked.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_limit_has_its_own_row() {
        for (index, row) in LIMITS.iter().enumerate() {
            assert_eq!(row.name as usize, index, "{}", row.key);
            assert!(by_key(row.key).is_some_and(|first| first.key == row.key));
        }
    }
}
