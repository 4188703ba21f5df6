//! The designs that a search goes through: from numbers to a design and to the keys of its file.

use std::collections::BTreeMap;

use fluxform_base::units::m_from_mm;
use fluxform_design::array::grid_positions_m;
use fluxform_design::message_text::twelve_digits;
use fluxform_design::search::{SearchKey, SearchLayout, SearchSpace, SearchValues};
use fluxform_design::{ArrayGrid, Coil, Design};
use fluxform_numerics::mixed_search::{Values, Variable};

use super::choice::Choice;
use super::plate;
use super::positions::{self, Mode};

/// A variable of the search. Lengths are millimetres, as in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axis {
    /// Inner diameter of the winding.
    Bore,
    /// Layers of wire.
    Layers,
    /// Turns a layer.
    TurnsPerLayer,
    /// Diameter of the wire over its insulation.
    Wire,
    /// Gap between core and bore.
    Clearance,
    /// The core's top above the winding's.
    Above,
    /// The core's bottom below the winding's.
    Below,
    /// A length of the plate; its key.
    Plate(SearchKey),
    /// Distance of neighbouring axes.
    Pitch,
    /// How far a group of coils is moved; its number.
    Move(usize),
    /// How far the shapes are raised.
    Height,
}

impl Axis {
    /// Its name in results: the design's key where it has one.
    #[must_use]
    pub fn key(self) -> String {
        let key = match self {
            Self::Bore => SearchKey::InnerDiameter,
            Self::Layers => return "layers".to_owned(),
            Self::TurnsPerLayer => return "turns_per_layer".to_owned(),
            Self::Wire => SearchKey::Wire,
            Self::Clearance => SearchKey::Clearance,
            Self::Above => SearchKey::Above,
            Self::Below => SearchKey::Below,
            Self::Plate(key) => key,
            Self::Pitch => SearchKey::Pitch,
            Self::Move(group) => return format!("array.move_{}_mm", group + 1),
            Self::Height => SearchKey::Height,
        };
        key.path().to_owned()
    }
}

/// Designs of one choice.
#[derive(Debug, Clone)]
pub struct Space {
    base: Design,
    axes: Vec<Axis>,
    variables: Vec<Variable>,
    /// Layers and turns are whole numbers of wires; otherwise the coil is as given.
    wound: bool,
    /// Ranges of the length and outer diameter that layers and turns give, mm.
    pub(super) outer_mm: [f64; 2],
    pub(super) length_mm: [f64; 2],
    bore_mm: f64,
    wire_mm: f64,
    layers: f64,
    turns_per_layer: f64,
    raised_mm: f64,
    clearance_above_below_mm: [f64; 3],
    pitch_mm: f64,
    layout: Option<(SearchLayout, [usize; 2])>,
    /// Positions at pitch 1.
    unit: Vec<[f64; 2]>,
    modes: Vec<Mode>,
}

/// Rounding of lengths that are made, mm.
const MADE_MM: f64 = 1e-3;
/// Most layers and turns of a layer.
const MOST_LAYERS: f64 = 400.0;
const MOST_TURNS: f64 = 5000.0;

fn mm(length_m: f64) -> f64 {
    twelve_digits(length_m * 1e3)
}

fn made_step_mm(axis: &Axis) -> f64 {
    match axis {
        // A plate's mass is to stay within its limit.
        Axis::Plate(_) => 0.01 * MADE_MM,
        _ => MADE_MM,
    }
}

/// To nanometres, as it is written.
fn to_nanometres(length_mm: f64) -> f64 {
    (length_mm * 1e6).round() / 1e6 + 0.0
}

/// To whole steps.
fn rounded_mm(length_mm: f64, step_mm: f64) -> f64 {
    to_nanometres((length_mm / step_mm).round() * step_mm)
}

impl Space {
    /// The designs of a choice about `design`, as far as `search` varies it.
    ///
    /// # Errors
    /// Keys that the design cannot vary, and what to do; an empty range.
    pub fn new(design: &Design, search: &SearchSpace, choice: &Choice) -> Result<Self, String> {
        let coil = design.coil.ok_or(
            "the design has no [coil], which the search starts from and compares with: add it",
        )?;
        let mut base = design.clone();
        if choice.without_core {
            base.core = None;
        }
        if choice.without_plate {
            base.plate = None;
        }
        if let Some([diameter, length]) = choice.magnet_mm {
            (base.magnet.diameter_m, base.magnet.length_m) =
                (m_from_mm(diameter), m_from_mm(length));
        }
        let core = base.core.as_ref();
        let given = core.map_or([0.0; 3], |core| {
            [core.clearance_m, core.above_m, core.below_m].map(mm)
        });
        let (unit, pitch_mm) = match choice.grid {
            Some((layout, [rows, columns])) => {
                let pitch = design.array.grid.map_or(50.0, |grid| mm(grid.pitch_m));
                (positions::layout(layout, rows, columns), pitch)
            }
            None => {
                let places = &design.array.positions_m;
                let apart = positions::closest(places);
                let pitch_m = if apart.is_finite() { apart } else { 1e-3 };
                (
                    places.iter().map(|p| p.map(|x| x / pitch_m)).collect(),
                    mm(pitch_m),
                )
            }
        };
        let varied = |key| search.values(key);
        let wound = [
            SearchKey::InnerDiameter,
            SearchKey::OuterDiameter,
            SearchKey::Length,
            SearchKey::Wire,
        ]
        .into_iter()
        .any(|key| varied(key).is_some());
        let ends = |key, given_mm: f64| varied(key).map_or([0.0, given_mm], SearchValues::ends);
        let mut space = Self {
            axes: Vec::new(),
            variables: Vec::new(),
            wound,
            outer_mm: ends(SearchKey::OuterDiameter, mm(coil.outer_diameter_m)),
            length_mm: ends(SearchKey::Length, mm(coil.length_m)),
            bore_mm: mm(coil.inner_diameter_m),
            wire_mm: mm(design.wire.diameter_m),
            layers: 1.0,
            turns_per_layer: 1.0,
            raised_mm: 0.0,
            clearance_above_below_mm: given,
            pitch_mm,
            layout: choice.grid,
            modes: match varied(SearchKey::Move) {
                Some(_) => positions::modes(&unit, search.symmetry),
                None => Vec::new(),
            },
            unit,
            base,
        };
        space.add_coil(search)?;
        space.add_others(search)?;
        space.fit_lists(design)?;
        Ok(space)
    }

    fn push(&mut self, axis: Axis, values: &SearchValues) {
        let [low, high] = values.ends();
        let values = match values {
            SearchValues::Range(_) => Values::Continuous,
            SearchValues::Listed(list) => Values::Listed(list.clone()),
        };
        if low < high {
            self.axes.push(axis);
            self.variables.push(Variable { low, high, values });
            return;
        }
        // A single value is the given one.
        match axis {
            Axis::Bore => self.bore_mm = low,
            Axis::Wire => self.wire_mm = low,
            Axis::Clearance => self.clearance_above_below_mm[0] = low,
            Axis::Above => self.clearance_above_below_mm[1] = low,
            Axis::Below => self.clearance_above_below_mm[2] = low,
            Axis::Plate(key) => {
                if let Some(plate) = &mut self.base.plate {
                    plate::set(plate, key, m_from_mm(low));
                }
            }
            Axis::Pitch => self.pitch_mm = low,
            Axis::Layers => self.layers = low,
            Axis::TurnsPerLayer => self.turns_per_layer = low,
            Axis::Height => self.raised_mm = low,
            // Coils that cannot move stay.
            Axis::Move(_) => {}
        }
    }

    fn add_coil(&mut self, search: &SearchSpace) -> Result<(), String> {
        if !self.wound {
            return Ok(());
        }
        for key in [SearchKey::OuterDiameter, SearchKey::Length] {
            if let Some(SearchValues::Listed(list)) =
                search.values(key).filter(|v| v.ends()[0] < v.ends()[1])
            {
                return Err(format!(
                    "[search] {} values of the winding's outer diameter or length: they follow from whole \
                     layers and turns; write a range [from, to]",
                    list.len()
                ));
            }
        }
        if let Some(values) = search.values(SearchKey::InnerDiameter) {
            self.push(Axis::Bore, values);
        }
        if let Some(values) = search.values(SearchKey::Wire) {
            self.push(Axis::Wire, values);
        }
        let wires = self.range(Axis::Wire).unwrap_or([self.wire_mm; 2]);
        let bores = self.range(Axis::Bore).unwrap_or([self.bore_mm; 2]);
        let limits = &self.base.limits;
        let most =
            |limit: Option<f64>, given: f64| limit.map_or(given, |limit| given.min(mm(limit)));
        let outer = most(limits.outer_diameter_max_m, self.outer_mm[1]);
        let length = most(limits.length_max_m, self.length_mm[1]);
        let slack = 1.0 + 1e-9;
        let layers = ((outer - bores[0]) / (2.0 * wires[0]) * slack)
            .floor()
            .min(MOST_LAYERS);
        let turns = (length / wires[0] * slack).floor().min(MOST_TURNS);
        if layers < 1.0 || turns < 1.0 {
            return Err(format!(
                "no winding fits: a bore of {} mm at least, wire of {} mm and an outer diameter of {outer} mm \
                 at most leave {} mm for layers, and a length of {length} mm at most holds {turns} turns; widen \
                 [search] or [limits]",
                bores[0],
                wires[0],
                0.5 * (outer - bores[0])
            ));
        }
        let least = |room: f64, wire: f64| (room / wire / slack).ceil().max(1.0);
        let fewest = least(0.5 * (self.outer_mm[0] - bores[1]), wires[1]).min(layers);
        self.whole(Axis::Layers, fewest, layers);
        self.whole(
            Axis::TurnsPerLayer,
            least(self.length_mm[0], wires[1]).min(turns),
            turns,
        );
        Ok(())
    }

    fn whole(&mut self, axis: Axis, low: f64, high: f64) {
        if low < high {
            self.axes.push(axis);
            let values = Values::Whole;
            self.variables.push(Variable { low, high, values });
        } else {
            self.push(axis, &SearchValues::Listed(vec![low]));
        }
    }

    fn add_others(&mut self, search: &SearchSpace) -> Result<(), String> {
        let of_core = [
            (SearchKey::Clearance, Axis::Clearance),
            (SearchKey::Above, Axis::Above),
            (SearchKey::Below, Axis::Below),
        ];
        let mut named = of_core
            .iter()
            .filter_map(|(key, axis)| Some((*axis, search.values(*key)?)));
        if self.base.core.is_some() {
            for (axis, values) in named {
                self.push(axis, values);
            }
        } else if let Some((axis, _)) = named.next().filter(|_| !search.without_core) {
            return Err(format!(
                "[search] varies {}, but the design has no core: add [core], or leave the key out",
                axis.key()
            ));
        }
        self.add_plate(search)?;
        let alone = self.unit.len() < 2;
        let counts = [SearchKey::Rows, SearchKey::Columns].map(|key| search.values(key));
        let other_counts = counts.iter().any(Option::is_some);
        for (key, axis) in [
            (SearchKey::Pitch, Axis::Pitch),
            (SearchKey::Height, Axis::Height),
        ] {
            match search.values(key) {
                Some(_) if axis == Axis::Pitch && alone && other_counts => {}
                Some(_) if axis == Axis::Pitch && alone => {
                    return Err(
                        "[search] varies the pitch of one coil: add rows and columns".to_owned(),
                    );
                }
                Some(values) => self.push(axis, values),
                None => {}
            }
        }
        if let Some(values) = search.values(SearchKey::Move) {
            for group in 0..self.modes.len() {
                self.push(Axis::Move(group), values);
            }
        }
        // A search has a variable, if only that of the plate that is left out.
        if let (true, true, None) = (self.axes.is_empty(), search.without_plate, &self.base.plate)
            && let Some((key, values)) = plate::KEYS
                .iter()
                .find_map(|key| Some((*key, search.values(*key)?)))
        {
            self.push(Axis::Plate(key), values);
        }
        Ok(())
    }

    fn add_plate(&mut self, search: &SearchSpace) -> Result<(), String> {
        for key in plate::KEYS {
            let Some(values) = search.values(key) else {
                continue;
            };
            let Some(plate) = &self.base.plate else {
                if search.without_plate {
                    continue;
                }
                return Err(format!(
                    "[search] varies {}, but the design has no plate: add [plate], or leave the key out",
                    key.path()
                ));
            };
            if plate::length_m(plate, key).is_none() {
                return Err(format!(
                    "[search] varies {}, which the design's plate has not: one with sides has x_mm and y_mm, a \
                     round one diameter_mm",
                    key.path()
                ));
            }
            self.push(Axis::Plate(key), values);
        }
        Ok(())
    }

    /// Limits that are lists, one entry a coil, for another number of coils.
    fn fit_lists(&mut self, design: &Design) -> Result<(), String> {
        let coils = self.unit.len();
        if design.array.positions_m.len() == coils {
            return Ok(());
        }
        let supply = &mut self.base.supply;
        let lists = [
            ("supply.current_max_a", &mut supply.current_max_a),
            ("supply.current_min_a", &mut supply.current_min_a),
            ("array.gain", &mut self.base.array.gain),
        ];
        for (key, list) in lists {
            let first = list[0];
            if list.iter().any(|value| *value != first) {
                return Err(format!(
                    "{key} differs from coil to coil, so rows and columns cannot vary: give one number"
                ));
            }
            *list = vec![first; coils];
        }
        Ok(())
    }

    /// The variables, in order.
    #[must_use]
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Its variables at `x` by key, but for those of a plate that is left out.
    #[must_use]
    pub fn named(&self, x: &[f64]) -> BTreeMap<String, f64> {
        let there = |axis: &Axis| self.base.plate.is_some() || !matches!(axis, Axis::Plate(_));
        let pairs = self.axes.iter().zip(x).filter(|(axis, _)| there(axis));
        pairs.map(|(axis, x)| (axis.key(), *x)).collect()
    }

    /// Whether lengths of the plate vary.
    pub(super) fn varies_plate(&self) -> bool {
        self.axes.iter().any(|axis| matches!(axis, Axis::Plate(_)))
    }

    /// The given design with this choice's magnet and core.
    pub(super) fn base(&self) -> &Design {
        &self.base
    }

    /// Whether `design` is of this choice: its rows and columns, magnet, core and plate.
    pub(super) fn holds(&self, design: &Design) -> bool {
        let rows_columns = |grid: &ArrayGrid| (SearchLayout::Grid, [grid.rows, grid.columns]);
        let magnet_m = |of: &Design| [of.magnet.diameter_m, of.magnet.length_m];
        let steel = |of: &Design| [of.core.is_some(), of.plate.is_some()];
        self.layout == design.array.grid.as_ref().map(rows_columns)
            && magnet_m(&self.base) == magnet_m(design)
            && steel(&self.base) == steel(design)
    }

    /// Coils of the array.
    #[must_use]
    pub fn coils(&self) -> usize {
        self.unit.len()
    }

    /// How the coils lie, with rows and columns; `None` for the design's own positions.
    pub(super) fn layout(&self) -> Option<(SearchLayout, [usize; 2])> {
        self.layout
    }

    /// Their ranges.
    #[must_use]
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn range(&self, axis: Axis) -> Option<[f64; 2]> {
        let index = self.axes.iter().position(|known| *known == axis)?;
        let variable = &self.variables[index];
        Some([variable.low, variable.high])
    }

    pub(super) fn value(&self, x: &[f64], axis: Axis) -> Option<f64> {
        self.axes
            .iter()
            .position(|known| *known == axis)
            .map(|index| x[index])
    }

    /// The variables of the given design, moved into their ranges.
    #[must_use]
    pub fn given(&self, design: &Design) -> Vec<f64> {
        let coil = design.coil.as_ref();
        let of = |length: fn(&Coil) -> f64| coil.map_or(0.0, |coil| mm(length(coil)));
        let core = design.core.as_ref();
        let wire = mm(design.wire.diameter_m);
        let pitch = if design.array.positions_m.len() > 1 {
            mm(positions::closest(&design.array.positions_m))
        } else {
            self.pitch_mm
        };
        let value = |axis: &Axis| match axis {
            Axis::Bore => of(|coil| coil.inner_diameter_m),
            Axis::Layers => {
                0.5 * (of(|coil| coil.outer_diameter_m) - of(|coil| coil.inner_diameter_m)) / wire
            }
            Axis::TurnsPerLayer => of(|coil| coil.length_m) / wire,
            Axis::Wire => wire,
            Axis::Clearance => core.map_or(0.0, |core| mm(core.clearance_m)),
            Axis::Above => core.map_or(0.0, |core| mm(core.above_m)),
            Axis::Below => core.map_or(0.0, |core| mm(core.below_m)),
            Axis::Plate(key) => {
                let plate = design.plate.as_ref();
                plate
                    .and_then(|plate| plate::length_m(plate, *key))
                    .map_or(0.0, mm)
            }
            Axis::Pitch => pitch,
            Axis::Move(_) | Axis::Height => 0.0,
        };
        let within = |(axis, variable): (&Axis, &Variable)| {
            let value = value(axis).clamp(variable.low, variable.high);
            match &variable.values {
                Values::Continuous => value,
                Values::Whole => (value + 1e-6).floor().max(variable.low),
                Values::Listed(list) => {
                    let near =
                        |a: &&f64, b: &&f64| (*a - value).abs().total_cmp(&(*b - value).abs());
                    list.iter().min_by(near).copied().unwrap_or(value)
                }
            }
        };
        self.axes.iter().zip(&self.variables).map(within).collect()
    }

    /// The same with lengths that are made rounded to micrometres.
    #[must_use]
    pub fn made(&self, x: &[f64]) -> Vec<f64> {
        let rounded = |((x, variable), axis): ((&f64, &Variable), &Axis)| match variable.values {
            Values::Continuous => {
                rounded_mm(*x, made_step_mm(axis)).clamp(variable.low, variable.high)
            }
            Values::Whole | Values::Listed(_) => *x,
        };
        let variables = x.iter().zip(&self.variables);
        variables.zip(&self.axes).map(rounded).collect()
    }

    /// What [`Self::made`] would have of each variable that it rounded, on the other side of `x`.
    pub(super) fn made_beyond(&self, x: &[f64], made: &[f64]) -> Vec<(usize, f64)> {
        let beyond = |index: usize| {
            let Variable { low, high, .. } = self.variables[index];
            let step = made_step_mm(&self.axes[index]).copysign(x[index] - made[index]);
            (index, to_nanometres(made[index] + step).clamp(low, high))
        };
        let rounded = (0..x.len()).filter(|index| x[*index] != made[*index]);
        rounded.map(beyond).collect()
    }

    /// Whether any length is rounded where it is made.
    pub(super) fn rounds(&self) -> bool {
        let mut variables = self.variables.iter();
        variables.any(|variable| matches!(variable.values, Values::Continuous))
    }

    /// How much of a micrometre the lengths that `decides` names may change where they are made: those that are rounded
    /// already, and those at an end of their range, stay.
    pub(super) fn rounding(&self, x: &[f64], decides: impl Fn(Axis) -> bool) -> f64 {
        let variables = x.iter().zip(&self.variables).zip(&self.axes);
        let rounded = variables.filter(|((_, variable), axis)| {
            matches!(variable.values, Values::Continuous) && decides(**axis)
        });
        let from_end = rounded.map(|((x, variable), axis)| {
            let step = made_step_mm(axis);
            let nearest = (x - variable.low).min(variable.high - x);
            match rounded_mm(*x, step) == *x {
                true => 0.0,
                false => (nearest / step).clamp(0.0, 1.0),
            }
        });
        from_end.fold(0.0, f64::max)
    }

    /// Bore, outer diameter, length and turns of the winding, mm; layers and turns may be fractions.
    fn winding_mm(&self, x: &[f64]) -> [f64; 4] {
        let bore = self.value(x, Axis::Bore).unwrap_or(self.bore_mm);
        let wire = self.wire(x);
        let layers = self.value(x, Axis::Layers).unwrap_or(self.layers);
        let turns = self
            .value(x, Axis::TurnsPerLayer)
            .unwrap_or(self.turns_per_layer);
        [
            bore,
            twelve_digits(bore + 2.0 * layers * wire),
            twelve_digits(turns * wire),
            layers * turns,
        ]
    }

    pub(super) fn wire(&self, x: &[f64]) -> f64 {
        self.value(x, Axis::Wire).unwrap_or(self.wire_mm)
    }

    pub(super) fn is_wound(&self) -> bool {
        self.wound
    }

    /// How far the shapes are raised, m.
    #[must_use]
    pub fn raised_m(&self, x: &[f64]) -> f64 {
        m_from_mm(self.value(x, Axis::Height).unwrap_or(self.raised_mm))
    }

    fn core_mm(&self, x: &[f64]) -> [f64; 3] {
        let [clearance, above, below] = self.clearance_above_below_mm;
        [
            (Axis::Clearance, clearance),
            (Axis::Above, above),
            (Axis::Below, below),
        ]
        .map(|(axis, given)| self.value(x, axis).unwrap_or(given))
    }

    fn positions_mm(&self, x: &[f64]) -> Vec<[f64; 2]> {
        let pitch = self.value(x, Axis::Pitch).unwrap_or(self.pitch_mm);
        let mut places: Vec<[f64; 2]> = self.unit.iter().map(|p| p.map(|u| u * pitch)).collect();
        for (group, mode) in self.modes.iter().enumerate() {
            let far = self.value(x, Axis::Move(group)).unwrap_or(0.0);
            for (place, part) in places.iter_mut().zip(mode) {
                for axis in 0..2 {
                    place[axis] += far * part[axis];
                }
            }
        }
        places.iter().map(|p| p.map(to_nanometres)).collect()
    }

    /// The grid, where the coils lie on one.
    fn grid(&self, x: &[f64]) -> Option<(usize, usize, f64)> {
        let pitch = self.value(x, Axis::Pitch).unwrap_or(self.pitch_mm);
        match self.layout {
            Some((SearchLayout::Grid, [rows, columns])) if self.modes.is_empty() => {
                Some((rows, columns, pitch))
            }
            _ => None,
        }
    }

    /// The design at `x`.
    #[must_use]
    pub fn design(&self, x: &[f64]) -> Design {
        let mut design = self.base.clone();
        if let (true, Some(coil)) = (self.wound, design.coil.as_mut()) {
            let [bore, outer, length, turns] = self.winding_mm(x);
            *coil = Coil {
                inner_diameter_m: m_from_mm(bore),
                outer_diameter_m: m_from_mm(outer),
                length_m: m_from_mm(length),
                turns: Some(turns),
            };
            let [wire, conductor] = self.wire_mm(x).map(m_from_mm);
            (design.wire.diameter_m, design.wire.conductor_diameter_m) = (wire, conductor);
        }
        if let Some(core) = &mut design.core {
            let [clearance, above, below] = self.core_mm(x).map(m_from_mm);
            (core.clearance_m, core.above_m, core.below_m) = (clearance, above, below);
        }
        if let Some(plate) = &mut design.plate {
            for (axis, value) in self.axes.iter().zip(x) {
                if let Axis::Plate(key) = axis {
                    plate::set(plate, *key, m_from_mm(*value));
                }
            }
        }
        match self.grid(x) {
            Some((rows, columns, pitch)) => {
                design.array.positions_m = grid_positions_m(rows, columns, pitch);
                design.array.grid = Some(ArrayGrid {
                    rows,
                    columns,
                    pitch_m: m_from_mm(pitch),
                });
            }
            None => {
                let places = self.positions_mm(x);
                design.array.positions_m = places.iter().map(|p| p.map(m_from_mm)).collect();
                design.array.grid = None;
            }
        }
        design
    }

    /// Wire and conductor, mm; wires to choose from have the given proportion.
    fn wire_mm(&self, x: &[f64]) -> [f64; 2] {
        let wire = self.wire(x);
        let given = &self.base.wire;
        let share = given.conductor_diameter_m / given.diameter_m;
        [wire, twelve_digits(wire * share)]
    }

    /// The keys that make the design at `x` of the given one, and keys to be left out.
    #[must_use]
    pub fn settings(&self, x: &[f64]) -> (Vec<(&'static str, toml::Value)>, Vec<&'static str>) {
        let number = toml::Value::Float;
        let whole = |count: usize| toml::Value::Integer(count as i64);
        let mut set = Vec::new();
        let mut remove = vec!["search", "wire.choices_mm"];
        if self.wound {
            let [bore, outer, length, turns] = self.winding_mm(x);
            let [wire, conductor] = self.wire_mm(x);
            set.extend([
                ("coil.inner_diameter_mm", number(bore)),
                ("coil.outer_diameter_mm", number(outer)),
                ("coil.length_mm", number(length)),
                ("coil.turns", whole(turns as usize)),
                ("wire.diameter_mm", number(wire)),
                ("wire.conductor_diameter_mm", number(conductor)),
            ]);
        }
        if self.base.core.is_some() {
            let [clearance, above, below] = self.core_mm(x).map(number);
            set.extend([
                ("core.clearance_mm", clearance),
                ("core.above_mm", above),
                ("core.below_mm", below),
            ]);
        } else {
            remove.push("core");
        }
        if self.base.plate.is_some() {
            let design = self.design(x);
            let plate = design.plate.as_ref();
            set.extend(plate::KEYS.iter().filter_map(|key| {
                let length_m = plate::length_m(plate?, *key)?;
                Some((key.path(), number(mm(length_m))))
            }));
        } else {
            remove.push("plate");
        }
        let magnet = &self.base.magnet;
        set.extend([
            ("magnet.diameter_mm", number(mm(magnet.diameter_m))),
            ("magnet.length_mm", number(mm(magnet.length_m))),
        ]);
        const GRID: [&str; 3] = ["array.rows", "array.columns", "array.pitch_mm"];
        if let Some((rows, columns, pitch)) = self.grid(x) {
            remove.push("array.positions_mm");
            set.extend(
                GRID.into_iter()
                    .zip([whole(rows), whole(columns), number(pitch)]),
            );
        } else if self.unit.len() > 1 {
            remove.extend(GRID);
            let pair = |p: [f64; 2]| toml::Value::Array(p.map(number).to_vec());
            let places = self.positions_mm(x).into_iter().map(pair).collect();
            set.push(("array.positions_mm", toml::Value::Array(places)));
        }
        (set, remove)
    }
}
