//! One variable of a search: its range, and which values of it are allowed.

/// Which values a variable may have within its range.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Any.
    Continuous,
    /// Whole numbers.
    Whole,
    /// These, rising.
    Listed(Vec<f64>),
}

/// One variable, `low < high`.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Least value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Which of those between.
    pub values: Values,
}

impl Variable {
    pub(super) fn value(&self, u: f64) -> f64 {
        // Exact at both ends.
        if u >= 1.0 {
            return self.high;
        }
        self.low + u * (self.high - self.low)
    }

    pub(super) fn unit(&self, x: f64) -> f64 {
        (x - self.low) / (self.high - self.low)
    }

    /// Its values, where there are at most so many.
    pub(super) fn all(&self, most: usize) -> Option<Vec<f64>> {
        let all = match &self.values {
            Values::Continuous => return None,
            Values::Whole if self.high - self.low < most as f64 => {
                let count = (self.high - self.low) as usize;
                (0..=count).map(|k| self.low + k as f64).collect()
            }
            Values::Whole => return None,
            Values::Listed(list) => list.clone(),
        };
        (all.len() <= most).then_some(all)
    }

    /// The nearest allowed values at and below, at and above `x`.
    pub(super) fn neighbours(&self, x: f64) -> [f64; 2] {
        match &self.values {
            Values::Continuous => [x, x],
            Values::Whole => {
                let near = x.round();
                if (x - near).abs() < WHOLE {
                    [near, near]
                } else {
                    [x.floor(), x.ceil()]
                }
            }
            Values::Listed(list) => {
                let slack = WHOLE * (self.high - self.low);
                let below = list.iter().copied().filter(|v| *v <= x + slack);
                let above = list.iter().copied().filter(|v| *v >= x - slack);
                [
                    below.fold(self.low, f64::max),
                    above.fold(self.high, f64::min),
                ]
            }
        }
    }

    /// The allowed value nearest to `x`.
    pub(super) fn nearest_value(&self, x: f64) -> f64 {
        let [below, above] = self.neighbours(x);
        let near = if x - below <= above - x { below } else { above };
        near.clamp(self.low, self.high)
    }

    /// The same in units.
    pub(super) fn nearest(&self, u: f64) -> f64 {
        self.unit(self.nearest_value(self.value(u)))
    }
}

/// Distance from a whole number that is rounding.
pub(super) const WHOLE: f64 = 1e-7;

/// Lower and upper ends of a box, in units.
pub(super) type Region = (Vec<f64>, Vec<f64>);
