//! Equation 11 in scaled coordinates: ln of force and limits over ln of mean radius, depth, length.
//!
//! In these three logarithms resistance, wire length and wire mass are planes, every limit is a
//! ratio to its bound, and a wire of 0.05 mm or a target at 100 m changes nothing but an offset.
//! The rated current min(I_max, V/R) has a kink where the supply takes over, and heat at a given
//! voltage falls with the resistance: either side of the kink is a smooth problem of its own.

use serde::Serialize;

use super::loop_settling::Loop;
use super::model::{CoilModel, Sloped, Strand, Window};
use super::sqp::{Local, Point, Smooth};
use crate::array_heat::Drivers;
use crate::circuit::SETTLING_TIME_CONSTANTS;
pub use crate::limits::LimitName;
use crate::limits::{CoilQuantity, LIMITS, bobbin_bore_m};
use fluxform_design::Limits;

/// Dimensions that are given, not sought; diameters and length in m.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Fixed {
    /// Inner diameter, m.
    pub inner_diameter_m: Option<f64>,
    /// Outer diameter, m.
    pub outer_diameter_m: Option<f64>,
    /// Length, m.
    pub length_m: Option<f64>,
}

impl Fixed {
    /// Whether nothing is left of the limit `name` to hold: a size that is given, and turns, which are
    /// what fits.
    fn settles(&self, name: LimitName) -> bool {
        let given = [
            (LimitName::OuterDiameter, self.outer_diameter_m),
            (LimitName::InnerDiameter, self.inner_diameter_m),
            (LimitName::Length, self.length_m),
            (LimitName::WindingFill, Some(1.0)),
        ];
        given
            .iter()
            .any(|(size, value)| *size == name && value.is_some())
    }
}

/// The request, for one coil.
#[derive(Debug, Clone, PartialEq)]
pub struct Task {
    /// The limits.
    pub limits: Limits,
    /// Dimensions that are given.
    pub fixed: Fixed,
    /// Distance of the array's nearest axes, m: no coil is wider.
    pub pitch_m: Option<f64>,
    /// Whether a bore is at least that of a bobbin, where the limits name none.
    pub bobbin: bool,
    /// The driver's limit, A; > 0.
    pub current_max_a: f64,
    /// The supply's voltage, V.
    pub voltage_v: Option<f64>,
    /// Bandwidth of the drivers' current loops, Hz; `None` where they set voltages.
    pub bandwidth_hz: Option<f64>,
    /// The currents that all coils of the array may have.
    pub drivers: Drivers,
    /// The wires to choose among.
    pub strands: Vec<Strand>,
}

impl Task {
    /// The bound on the outer diameter, m, and its name: the tighter one of array and limits.
    #[must_use]
    pub fn outer_max(&self) -> Option<(LimitName, f64)> {
        let limit = self.limits.outer_diameter_max_m;
        match self.pitch_m {
            Some(pitch_m) if limit.is_none_or(|limit_m| pitch_m < limit_m) => {
                Some((LimitName::Pitch, pitch_m))
            }
            _ => limit.map(|limit_m| (LimitName::OuterDiameter, limit_m)),
        }
    }

    /// Heat of all coils, W, of `resistance_ohm` each, as `evaluate` states it, and its derivative by that.
    #[must_use]
    pub fn array_heat_w(&self, resistance_ohm: f64) -> [f64; 2] {
        self.drivers.most_heat_w(self.voltage_v, resistance_ohm)
    }

    /// Whether a driver reverses farther than the rated current: the supply may limit it where it limits no other.
    #[must_use]
    pub(crate) fn reverses_farther(&self) -> bool {
        let mut ends = self.drivers.ends_a.iter();
        ends.any(|[least_a, _]| -least_a > self.current_max_a)
    }

    /// The same heat with the derivatives of the resistance.
    fn array_power_w(&self, resistance: Sloped) -> Sloped {
        let [value, by_ohm] = self.array_heat_w(resistance.value);
        let slope = resistance.slope.map(|slope| slope * by_ohm);
        Sloped { value, slope }
    }

    /// Time until a step to `current` has settled, s.
    fn settling_s(&self, resistance: Sloped, inductance: Sloped, current: Sloped) -> Sloped {
        match self.bandwidth_hz {
            None => inductance.ratio(resistance).times(SETTLING_TIME_CONSTANTS),
            Some(bandwidth_hz) => Loop {
                bandwidth_hz,
                voltage_v: self.voltage_v,
            }
            .settling_s(resistance, inductance, current),
        }
    }

    /// The smallest bore of a coil of `strand`, m.
    #[must_use]
    pub fn bore_min_m(&self, strand: &Strand) -> Option<f64> {
        let bobbin = self.bobbin.then(|| bobbin_bore_m(strand.diameter_m));
        self.limits.inner_diameter_min_m.or(bobbin)
    }
}

/// A limit and its size, SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounded {
    /// Which.
    pub name: LimitName,
    /// The limit.
    pub limit: f64,
}

/// Who sets the rated current.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Regime {
    /// The driver: I = I_max, R I_max <= V.
    Driver,
    /// The supply: I = V/R <= I_max.
    Supply,
}

/// One wire, one regime: a smooth problem.
pub struct Problem<'a> {
    /// The coil's physics.
    pub model: &'a dyn CoilModel,
    /// The request.
    pub task: &'a Task,
    /// The wire.
    pub strand: Strand,
    /// Who sets the current.
    pub regime: Regime,
    /// The limits that apply.
    pub bounds: Vec<Bounded>,
    with_inductance: bool,
}

/// A coil with everything that is bounded.
#[derive(Debug, Clone, PartialEq)]
pub struct Rated {
    /// The winding's section.
    pub window: Window,
    /// Rated current, A.
    pub current_a: f64,
    /// |force| at the target, N, by the window.
    pub force_n: Sloped,
    /// Mass of wire and core, kg.
    pub mass_kg: f64,
    /// The bounded values, SI, in the order of the problem's bounds, by the window.
    pub values: Vec<Sloped>,
}

impl<'a> Problem<'a> {
    /// The regimes' problems for one wire.
    #[must_use]
    pub(crate) fn of_wire(model: &'a dyn CoilModel, task: &'a Task, strand: Strand) -> Vec<Self> {
        let regimes: &[Regime] = if task.voltage_v.is_some() {
            &[Regime::Driver, Regime::Supply]
        } else {
            &[Regime::Driver]
        };
        regimes
            .iter()
            .map(|&regime| Self::new(model, task, strand, regime))
            .collect()
    }

    fn new(model: &'a dyn CoilModel, task: &'a Task, strand: Strand, regime: Regime) -> Self {
        let (limits, fixed) = (&task.limits, &task.fixed);
        let mut bounds = Vec::new();
        let mut add = |name, limit: Option<f64>| {
            if let Some(limit) = limit {
                bounds.push(Bounded { name, limit });
            }
        };
        add(LimitName::FixedInner, fixed.inner_diameter_m);
        add(LimitName::FixedOuter, fixed.outer_diameter_m);
        add(LimitName::FixedLength, fixed.length_m);
        for limit in LIMITS.iter().filter(|limit| limit.quantity.is_some()) {
            // A least bore of zero is the axis.
            let (name, set) = match limit.name {
                LimitName::InnerDiameter => (limit.name, task.bore_min_m(&strand)),
                LimitName::OuterDiameter => task
                    .outer_max()
                    .map_or((limit.name, None), |(name, most_m)| (name, Some(most_m))),
                name => (name, (limit.of)(limits)),
            };
            let set = set.filter(|&value| value > 0.0 || !name.is_lower());
            add(name, set.filter(|_| !fixed.settles(limit.name)));
        }
        match regime {
            Regime::Driver => add(LimitName::Voltage, task.voltage_v),
            Regime::Supply => add(LimitName::Current, Some(task.current_max_a)),
        }
        add(LimitName::OneLayer, Some(strand.diameter_m));
        if fixed.length_m.is_none() {
            add(LimitName::OneTurn, Some(strand.diameter_m));
        }
        if fixed.inner_diameter_m.is_none() {
            add(LimitName::Axis, Some(0.0));
        }
        Self {
            model,
            task,
            strand,
            regime,
            bounds,
            with_inductance: limits.settling_max_s.is_some(),
        }
    }

    /// Whether current loops bring a current about that the supply exceeds: where its voltage sets the current, they
    /// take five time constants too.
    #[must_use]
    pub(crate) fn closes_a_loop(&self) -> bool {
        self.regime == Regime::Driver && self.task.bandwidth_hz.is_some()
    }

    /// The same wire and regime under another task.
    #[must_use]
    pub(crate) fn with_task<'b>(&self, task: &'b Task) -> Problem<'b>
    where
        'a: 'b,
    {
        Problem::new(self.model, task, self.strand, self.regime)
    }

    /// The same problem on another model.
    #[must_use]
    pub(crate) fn with_model<'b>(&self, model: &'b dyn CoilModel) -> Problem<'b>
    where
        'a: 'b,
    {
        Problem {
            model,
            task: self.task,
            bounds: self.bounds.clone(),
            ..*self
        }
    }

    /// The problem without the limits `names`; `None` where it has none of them.
    #[must_use]
    pub fn without(&self, names: &[LimitName]) -> Option<Problem<'a>> {
        let mut bounds = self.bounds.clone();
        bounds.retain(|bound| !names.contains(&bound.name));
        (bounds.len() < self.bounds.len()).then(|| Problem {
            with_inductance: bounds.iter().any(|b| b.name == LimitName::Settling),
            bounds,
            ..*self
        })
    }

    /// The optimum of `relaxed`, this problem without one of its limits, as a point of this one.
    #[must_use]
    pub(crate) fn adopted(&self, relaxed: &Problem<'_>, local: &Local) -> Option<Local> {
        let multiplier = |bound: &Bounded| {
            let row = relaxed.bounds.iter().position(|b| b == bound);
            row.map_or(0.0, |row| local.multipliers[row])
        };
        Some(Local {
            x: local.x,
            point: self.at(local.x)?,
            multipliers: self.bounds.iter().map(multiplier).collect(),
            evaluations: local.evaluations + 1,
        })
    }

    /// The coil of a window; `None` where the model does not hold.
    #[must_use]
    pub fn rate(&self, window: Window) -> Option<Rated> {
        let volume = window.volume_over_pi_m3();
        let resistance = volume.times(self.strand.resistance_per_volume());
        let current = match self.regime {
            Regime::Driver => Sloped {
                value: self.task.current_max_a,
                slope: [0.0; 4],
            },
            Regime::Supply => {
                let value = self.task.voltage_v? / resistance.value;
                Sloped {
                    value,
                    slope: resistance.slope.map(|s| -value * s / resistance.value),
                }
            }
        };
        let response = self
            .model
            .response(
                &window,
                self.strand.turns_per_m2(),
                current.value,
                self.with_inductance,
            )
            .ok()?;
        let force_n = response.force_n.along(current);
        if !(force_n.value > 0.0 && force_n.value.is_finite()) {
            return None;
        }
        let along = |value: f64, slope: [f64; 3]| Sloped {
            value,
            slope: [slope[0], slope[1], slope[2], 0.0],
        };
        let mass = {
            let mut sum = volume.times(self.strand.mass_per_volume());
            sum.value += response.core_mass_kg.value;
            let slopes = sum.slope.iter_mut().zip(response.core_mass_kg.slope);
            slopes.for_each(|(slope, by_core)| *slope += by_core);
            sum
        };
        let value = |quantity| match quantity {
            CoilQuantity::Resistance => resistance,
            CoilQuantity::Settling => {
                let inductance = response.inductance_h.along(current);
                self.task.settling_s(resistance, inductance, current)
            }
            CoilQuantity::OuterDiameter => along(2.0 * window.outer_radius_m(), [2.0, 2.0, 0.0]),
            CoilQuantity::InnerDiameter => along(2.0 * window.inner_radius_m, [2.0, 0.0, 0.0]),
            CoilQuantity::Length => along(window.length_m, [0.0, 0.0, 1.0]),
            CoilQuantity::Depth => along(window.depth_m, [0.0, 1.0, 0.0]),
            CoilQuantity::WindingFill => along(1.0, [0.0; 3]),
            CoilQuantity::Power => current.product(current).product(resistance),
            CoilQuantity::Mass => mass,
            CoilQuantity::ArrayMass => mass.times(self.task.drivers.ends_a.len() as f64),
            CoilQuantity::ArrayPower => self.task.array_power_w(resistance),
            CoilQuantity::WireLength => volume.times(self.strand.length_per_volume()),
            CoilQuantity::CoreField => response.core_field_t.along(current),
            CoilQuantity::Voltage => current.product(resistance),
            CoilQuantity::Current => current,
        };
        let bounds = self.bounds.iter();
        let values = bounds
            .map(|bound| bound.name.limit().quantity.map(value))
            .collect::<Option<_>>()?;
        Some(Rated {
            window,
            current_a: current.value,
            force_n,
            mass_kg: mass.value,
            values,
        })
    }

    /// The rated coil as a point of the scaled problem.
    #[must_use]
    pub fn scaled(&self, rated: &Rated) -> Point {
        let window = &rated.window;
        let mean = window.inner_radius_m + 0.5 * window.depth_m;
        let chain = |s: &[f64; 4]| {
            [
                mean * s[0],
                window.depth_m * (s[1] - 0.5 * s[0]),
                window.length_m * s[2],
            ]
        };
        let force = rated.force_n;
        let mut rows = Vec::with_capacity(self.bounds.len());
        let mut normals = Vec::with_capacity(self.bounds.len());
        for (bound, value) in self.bounds.iter().zip(&rated.values) {
            let slope = chain(&value.slope);
            let (row, normal) = match bound.name {
                LimitName::InnerDiameter | LimitName::FixedInner => {
                    // (limit - value) / (2 mean): a bore may be as small as it likes.
                    let row = 0.5 * (bound.limit - value.value) / mean;
                    let mut normal = slope.map(|s| -0.5 * s / mean);
                    normal[0] -= row;
                    (row, normal)
                }
                LimitName::Axis => {
                    let row = (0.5 * window.depth_m / mean).ln();
                    (row, [-1.0, 1.0, 0.0])
                }
                LimitName::CoreField if value.value <= 0.0 => (-1.0, [0.0; 3]),
                LimitName::OneLayer | LimitName::OneTurn => (
                    (bound.limit / value.value).ln(),
                    slope.map(|s| -s / value.value),
                ),
                _ => (
                    (value.value / bound.limit).ln(),
                    slope.map(|s| s / value.value),
                ),
            };
            rows.push(row);
            normals.push(normal);
        }
        Point {
            objective: -force.value.ln(),
            slope: chain(&force.slope).map(|s| -s / force.value),
            rows,
            normals,
        }
    }

    /// dF/d(limit), N per SI unit of the limit, from a row's multiplier at the optimum: the
    /// force that a limit wider by one unit would add (a negative number for lower limits).
    #[must_use]
    pub fn sensitivity_n_per_unit(&self, row: usize, multiplier: f64, rated: &Rated) -> f64 {
        let bound = self.bounds[row];
        let force = rated.force_n.value;
        match bound.name {
            LimitName::InnerDiameter | LimitName::FixedInner => {
                let mean = rated.window.inner_radius_m + 0.5 * rated.window.depth_m;
                -force * multiplier * 0.5 / mean
            }
            LimitName::OneLayer | LimitName::OneTurn => -force * multiplier / bound.limit,
            LimitName::Axis => 0.0,
            _ => force * multiplier / bound.limit,
        }
    }

    /// The window of scaled coordinates ln(mean radius), ln(depth), ln(length).
    #[must_use]
    pub fn window(at: [f64; 3]) -> Window {
        let (mean, depth, length) = (at[0].exp(), at[1].exp(), at[2].exp());
        Window {
            inner_radius_m: (mean - 0.5 * depth).max(0.0),
            depth_m: depth,
            length_m: length,
        }
    }

    /// Scaled coordinates of a window.
    #[must_use]
    pub fn coordinates(window: &Window) -> [f64; 3] {
        [
            (window.inner_radius_m + 0.5 * window.depth_m).ln(),
            window.depth_m.ln(),
            window.length_m.ln(),
        ]
    }

    /// The limit called `name`, where it applies.
    #[must_use]
    pub(crate) fn limit_of(&self, name: LimitName) -> Option<f64> {
        self.bounds
            .iter()
            .find(|bound| bound.name == name)
            .map(|bound| bound.limit)
    }
}

impl Smooth for Problem<'_> {
    fn at(&self, x: [f64; 3]) -> Option<Point> {
        if x.iter().any(|v| !v.is_finite() || v.abs() > 600.0) {
            return None;
        }
        Some(self.scaled(&self.rate(Self::window(x))?))
    }

    fn is_equality(&self, row: usize) -> bool {
        self.bounds[row].name.is_equality()
    }
}
