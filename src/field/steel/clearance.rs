//! Where places lie at which the field of steel is evaluated.

/// Bounds on places: the closer they come to a part of the steel, the finer its sources are divided.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clearance {
    /// No place is lower, m.
    pub lowest_m: f64,
    /// No place is higher, m.
    pub highest_m: f64,
    /// No place is closer to steel, m.
    pub distance_m: f64,
}

impl Clearance {
    /// Of places of any height from `lowest_m` up that are no closer to steel than `distance_m`.
    #[must_use]
    pub const fn above(lowest_m: f64, distance_m: f64) -> Self {
        Self {
            lowest_m,
            highest_m: f64::INFINITY,
            distance_m,
        }
    }

    /// Of places within `reach_m` of these.
    #[must_use]
    pub fn within(self, reach_m: f64) -> Self {
        Self {
            lowest_m: self.lowest_m - reach_m,
            highest_m: self.highest_m + reach_m,
            distance_m: self.distance_m - reach_m,
        }
    }

    /// Distance of the places from steel between the heights `low_m` and `high_m`, at least, m.
    #[must_use]
    pub fn from_heights_m(&self, low_m: f64, high_m: f64) -> f64 {
        (self.distance_m)
            .max(self.lowest_m - high_m)
            .max(low_m - self.highest_m)
    }
}
