//! The most heat of an array within the limits of its drivers and its supply.

use fluxform_design::Supply;

/// The currents that the drivers and the supply of an array allow.
#[derive(Debug, Clone, PartialEq)]
pub struct Drivers {
    /// Least and largest current of each coil, A: least <= 0 <= largest.
    pub ends_a: Vec<[f64; 2]>,
    /// Limit of the sum of all currents, signs counted, A; >= 0.
    pub total_max_a: Option<f64>,
}

/// A number and its derivative by the resistance.
type Dual = [f64; 2];

fn sum(a: Dual, b: Dual) -> Dual {
    [a[0] + b[0], a[1] + b[1]]
}

fn difference(a: Dual, b: Dual) -> Dual {
    [a[0] - b[0], a[1] - b[1]]
}

fn product(a: Dual, b: Dual) -> Dual {
    [a[0] * b[0], a[1] * b[0] + a[0] * b[1]]
}

impl Drivers {
    /// Those of a design.
    #[must_use]
    pub fn of(supply: &Supply) -> Self {
        let ends = supply.current_min_a.iter().zip(&supply.current_max_a);
        Self {
            ends_a: ends.map(|(&least, &most)| [least, most]).collect(),
            total_max_a: supply.total_current_max_a,
        }
    }

    /// The most heat of all coils, W, of `resistance_ohm` each, and its derivative by that: the maximum of
    /// sum R I_i^2 over l_i <= I_i <= u_i, sum I_i <= I_t, where |l_i|, u_i <= V/R at a supply of `voltage_v`.
    ///
    /// Heat is convex, so all currents but one are at an end. A coil that is no hotter at u_i than at l_i stays at
    /// l_i, which leaves the others most of the sum. The others go from l_i to u_i in the order of what that adds
    /// to the heat for each ampere of the sum, R (u_i + l_i); the first that finds no room for it takes the rest.
    ///
    /// Exact where those others have one l_i, as alike coils and one-way drivers do: their I_i - l_i majorise all
    /// others of the same sum (Marshall and Olkin 1979, chapter 3). With several l_i it is a knapsack problem, of
    /// which the linear relaxation is returned: an upper bound, by less than the heat of one coil at u_i.
    #[must_use]
    pub fn most_heat_w(&self, voltage_v: Option<f64>, resistance_ohm: f64) -> [f64; 2] {
        let resistance = [resistance_ohm, 1.0];
        let supplied_a = voltage_v.map_or(f64::INFINITY, |v| v / resistance_ohm);
        let supplied = |end_a: f64| {
            if end_a.abs() <= supplied_a {
                return [end_a, 0.0];
            }
            let end_a = supplied_a.copysign(end_a);
            [end_a, -end_a / resistance_ohm]
        };
        let heat = |current: Dual| product(product(resistance, current), current);
        let mut left = [self.total_max_a.unwrap_or(f64::INFINITY), 0.0];
        let mut most = [0.0; 2];
        let mut hotter: Vec<[Dual; 2]> = Vec::new();
        for ends_a in &self.ends_a {
            let [low, high] = ends_a.map(supplied);
            left = difference(left, low);
            most = sum(most, heat(low));
            if high[0] > -low[0] {
                hotter.push([low, high]);
            }
        }
        let per_ampere = |[low, high]: &[Dual; 2]| low[0] + high[0];
        hotter.sort_by(|a, b| per_ampere(b).total_cmp(&per_ampere(a)));
        let exact = hotter.windows(2).all(|two| two[0][0][0] == two[1][0][0]);
        for [low, high] in hotter {
            let range = difference(high, low);
            let fits = range[0] <= left[0];
            let added = if fits { range } else { left };
            let to = if fits || !exact {
                high
            } else {
                sum(low, added)
            };
            let gain = product(product(resistance, added), sum(low, to));
            if gain[0] > 0.0 {
                most = sum(most, gain);
            }
            if !fits {
                break;
            }
            left = difference(left, range);
        }
        most
    }
}
