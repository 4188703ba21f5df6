//! Rules on a number in a document: its unit, its range, and values that betray another unit.

use std::ops::Range;

use super::diagnostics::Fault;
use super::message_text::{number, quantity, twelve_digits};
use fluxform_base::units::MU_0_T_M_PER_A;

/// The values a key accepts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bound {
    /// Any finite number.
    Any,
    /// Greater than 0.
    Positive,
    /// Greater than 0 and only compared with: of any size.
    Limit,
    /// 0 or greater.
    NotNegative,
    /// 0 or less.
    NotPositive,
    /// At least this.
    AtLeast(f64),
    /// From the first to the second, both included.
    Within(f64, f64),
}

impl Bound {
    fn admits(self, value: f64) -> bool {
        match self {
            Self::Any => true,
            Self::Positive | Self::Limit => value > 0.0,
            Self::NotNegative => value >= 0.0,
            Self::NotPositive => value <= 0.0,
            Self::AtLeast(least) => value >= least,
            Self::Within(least, most) => (least..=most).contains(&value),
        }
    }

    /// In a table: `> 0`; empty where any number will do.
    pub(crate) fn symbols(self) -> String {
        match self {
            Self::Any => String::new(),
            Self::Positive | Self::Limit => "> 0".to_owned(),
            Self::NotNegative => ">= 0".to_owned(),
            Self::NotPositive => "<= 0".to_owned(),
            Self::AtLeast(least) => format!(">= {}", number(least)),
            Self::Within(least, most) => format!("{} to {}", number(least), number(most)),
        }
    }

    fn words(self, unit: &str) -> String {
        match self {
            Self::Any => format!("any number{}", spaced(unit)),
            Self::Positive | Self::Limit => "a number greater than 0".to_owned(),
            Self::NotNegative => "0 or more".to_owned(),
            Self::NotPositive => "0 or less".to_owned(),
            Self::AtLeast(least) => format!("at least {}", quantity(least, unit)),
            Self::Within(least, most) => {
                format!(
                    "between {} and {}",
                    quantity(least, ""),
                    quantity(most, unit)
                )
            }
        }
    }
}

/// Values that look as if another unit was meant: `from < |value| < to`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slip {
    /// Lower end, excluded.
    pub from: f64,
    /// Upper end, excluded.
    pub to: f64,
    /// The unit that is probably meant.
    pub unit: &'static str,
    /// Times this it is in the key's unit.
    pub times: f64,
}

/// Larger numbers, in their keys' units, are no part of a display.
const LARGEST: f64 = 1e16;

/// A number's unit, range and likely slips.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rule {
    /// Unit for the messages; empty for a pure number.
    pub unit: &'static str,
    /// Values that are accepted.
    pub bound: Bound,
    /// Values that are warned about.
    pub slips: &'static [Slip],
    /// Whether a wire gauge, `"AWG 22"`, may stand for the millimetres of its bare wire.
    pub gauges: bool,
}

impl Rule {
    /// Any finite number of `unit`.
    #[must_use]
    pub const fn any(unit: &'static str) -> Self {
        Self {
            unit,
            bound: Bound::Any,
            slips: &[],
            gauges: false,
        }
    }

    /// The same with these slips.
    #[must_use]
    pub const fn slips(self, slips: &'static [Slip]) -> Self {
        Self { slips, ..self }
    }

    /// The same, or a wire gauge.
    #[must_use]
    pub const fn gauges(self) -> Self {
        Self {
            gauges: true,
            ..self
        }
    }

    /// The same within `bound`.
    #[must_use]
    pub const fn bound(self, bound: Bound) -> Self {
        Self { bound, ..self }
    }

    /// The same, greater than 0.
    #[must_use]
    pub const fn positive(self) -> Self {
        self.bound(Bound::Positive)
    }

    /// The error where `value` is not finite or out of bounds.
    #[must_use]
    pub fn error(&self, key: &str, value: f64, span: &Range<usize>) -> Option<Fault> {
        if value.is_finite() && self.bound.admits(value) {
            return self.beyond(key, value, span);
        }
        let message = if value.is_finite() {
            let requested = self.bound.words(self.unit);
            format!("expected {requested}, found {}", quantity(value, self.unit))
        } else {
            format!(
                "expected a finite number{}, found {value}",
                spaced(self.unit)
            )
        };
        let fault = Fault::error(key, message).at(span);
        Some(match self.meant(value) {
            Some((slip, meant)) if self.bound.admits(meant) => {
                fault.help(advice(slip, value, meant))
            }
            _ => fault,
        })
    }

    /// The error where `value` is so large, or divides and is so small, that what is computed of
    /// it would be no number.
    fn beyond(&self, key: &str, value: f64, span: &Range<usize>) -> Option<Fault> {
        let size = value.abs();
        let small = matches!(self.bound, Bound::Positive) && size < 1.0 / LARGEST;
        if matches!(self.bound, Bound::Limit) || (size <= LARGEST && !small) {
            return None;
        }
        let message = format!(
            "expected a size between 1e-16 and {}, found {}",
            quantity(LARGEST, self.unit),
            quantity(value, self.unit)
        );
        Some(Fault::error(key, message).at(span))
    }

    /// The slip that `value` looks like, and the value that was then meant.
    fn meant(&self, value: f64) -> Option<(&'static Slip, f64)> {
        let size = value.abs();
        let slip = self.slips.iter().find(|s| s.from < size && size < s.to)?;
        Some((slip, twelve_digits(value * slip.times)))
    }

    /// The warning where `value` looks like one in another unit.
    #[must_use]
    pub fn warning(&self, key: &str, value: f64, span: &Range<usize>) -> Option<Fault> {
        let (slip, meant) = self.meant(value)?;
        let found = quantity(value, self.unit);
        let message = format!("{found} looks like {}", slip.unit);
        Some(
            Fault::warning(key, message)
                .at(span)
                .help(advice(slip, value, meant)),
        )
    }
}

fn advice(slip: &Slip, value: f64, meant: f64) -> String {
    format!(
        "write {} if {} {} is meant",
        number(meant),
        number(value),
        slip.unit
    )
}

fn spaced(unit: &str) -> String {
    if unit.is_empty() {
        String::new()
    } else {
        format!(" of {unit}")
    }
}

/// A slip: values between `from` and `to` are likely in `unit`, `times` too small.
pub(crate) const fn slip(from: f64, to: f64, unit: &'static str, times: f64) -> Slip {
    Slip {
        from,
        to,
        unit,
        times,
    }
}

/// A millimetre key whose value is metres below this size.
pub(crate) const fn metres_below(size: f64) -> Slip {
    slip(0.0, size, "metres", 1000.0)
}

/// Sizes of coils, arrays and workspaces, mm: half a metre is 0.5.
pub const BODY_MM: Rule = Rule::any("mm").slips(&[metres_below(0.5)]);

/// Sizes of magnets, mm.
pub(crate) const MAGNET_MM: Rule = Rule::any("mm").slips(&[metres_below(0.1)]);

/// Gaps and overhangs, mm.
pub(crate) const OFFSET_MM: Rule = Rule::any("mm").slips(&[metres_below(0.02)]);

/// Wire diameters, mm: 8 mm is 0.008. A gauge is the bare wire's diameter: where no other
/// conductor is named, it is taken as the diameter over the insulation too.
pub(crate) const WIRE_MM: Rule = Rule::any("mm").slips(&[metres_below(0.008)]).gauges();

/// Relative permeabilities, from vacuum to beyond any metal. The slips: mu itself in H/m, and thousands.
pub(crate) const RELATIVE_PERMEABILITY: Rule =
    Rule::any("").bound(Bound::Within(1.0, 1e9)).slips(&[
        slip(MU_0_T_M_PER_A, 0.125, "H/m", 1.0 / MU_0_T_M_PER_A),
        slip(0.125, 1.0, "thousands", 1000.0),
    ]);

/// Relative permeability of the reference design's steel.
pub(crate) const RELATIVE_PERMEABILITY_DEFAULT: f64 = 1000.0;

/// Knee of low-carbon steel that is described by its permeability alone, T.
pub(crate) const LOW_CARBON_KNEE_T: f64 = 1.5;
