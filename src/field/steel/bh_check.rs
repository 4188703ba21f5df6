//! Requirements on a magnetisation table, and the signs of another unit in it.

use fluxform_base::units::MU_0_T_M_PER_A;

/// Beyond this nothing is a flux density, in gauss or any unit.
const LARGEST_B: f64 = 1e6;
/// A step more permeable than this is no step.
const LARGEST_RELATIVE_PERMEABILITY: f64 = 1e12;
/// Share of 1 by which a step may rise less than vacuum does: rounded tables of saturated steel
/// do so.
const VACUUM_TOLERANCE: f64 = 0.05;

/// No ferromagnet's relative permeability is larger than this.
const PLAUSIBLE_PERMEABILITY: f64 = 1e6;
/// Tables end below this many tesla.
const PLAUSIBLE_B_T: f64 = 10.0;
/// Saturated steel stays below this many millitesla, and is above it in gauss.
const MILLITESLA_BELOW: f64 = 5000.0;
/// Gauss go no further; what is larger with a small H is the other column.
const GAUSS_BELOW: f64 = 1e5;
/// (B in T, relative permeability): steel whose table ends above that B should no longer be as
/// permeable as that.
const SATURATED: [(f64, f64); 2] = [(1.5, 300.0), (1.9, 30.0)];
/// Differential relative permeability under which a table's end counts as saturated.
const VACUUM_FOLLOWS: f64 = 10.0;
/// Steel is somewhere more permeable than this.
const LEAST_PERMEABILITY: f64 = 30.0;
/// A/m in an oersted.
const A_PER_M_IN_OERSTED: f64 = 79.577_471_545_947_67;

/// Why points are no magnetisation curve. Rows count from 1, the origin's row.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BhCurveError {
    /// The columns differ in length.
    #[error("{b} values of B and {h} of H: expected as many of one as of the other")]
    Lengths {
        /// Values of B.
        b: usize,
        /// Values of H.
        h: usize,
    },
    /// Too few points.
    #[error("{points} points are too few: expected the origin and at least two points more")]
    TooFew {
        /// Points in the table.
        points: usize,
    },
    /// A number that is infinite, not a number, or beyond anything magnetic.
    #[error(
        "row {row}: expected finite numbers with B up to 1e6 T, found B = {b_t:?}, H = {h_a_per_m:?}"
    )]
    OutOfRange {
        /// Row.
        row: usize,
        /// B, T.
        b_t: f64,
        /// H, A/m.
        h_a_per_m: f64,
    },
    /// The first point is elsewhere.
    #[error(
        "the first row is B = {b_t:?} T, H = {h_a_per_m:?} A/m: expected 0,0 (add the row 0,0 before it, \
         or shift a loop's branch through the origin: the curve is the one without hysteresis)"
    )]
    NotFromOrigin {
        /// B, T.
        b_t: f64,
        /// H, A/m.
        h_a_per_m: f64,
    },
    /// A column does not grow.
    #[error(
        "row {row}: {column} is {value:?} after {before:?}: expected it to grow with every row (sort the rows; keep one of equal ones)"
    )]
    NotGrowing {
        /// Row.
        row: usize,
        /// `b_t` or `h_a_per_m`.
        column: &'static str,
        /// The row's value.
        value: f64,
        /// The value before.
        before: f64,
    },
    /// Less permeable than vacuum.
    #[error(
        "row {row}: up to B = {b_t:?} T the steel would be less permeable than vacuum (relative permeability \
         {relative_permeability:.3} of this step; are B in T and H in A/m?)"
    )]
    BelowVacuum {
        /// Row at the step's end.
        row: usize,
        /// B at the step's end, T.
        b_t: f64,
        /// Differential relative permeability of the step.
        relative_permeability: f64,
    },
    /// More permeable than anything.
    #[error(
        "row {row}: up to B = {b_t:?} T the relative permeability would be {relative_permeability:e} (are B in T and H in A/m?)"
    )]
    Unbounded {
        /// Row at the step's end.
        row: usize,
        /// B at the step's end, T.
        b_t: f64,
        /// Differential relative permeability of the step.
        relative_permeability: f64,
    },
}

/// Doubtful features of a magnetisation table. The numbers are used as they are all the same.
#[derive(Debug, Clone, PartialEq)]
pub enum BhWarning {
    /// B looks like another unit.
    UnitOfB {
        /// The largest B, taken as T.
        largest_b_t: f64,
        /// The unit probably meant.
        unit: &'static str,
        /// Times this, B is in T.
        times: f64,
    },
    /// H looks like another unit.
    UnitOfH {
        /// The largest relative permeability of the table, H taken as A/m.
        relative_permeability: f64,
        /// The differential one at its end.
        last_relative_permeability: f64,
        /// The unit probably meant.
        unit: &'static str,
        /// Times this, H is in A/m.
        times: f64,
    },
    /// The columns look exchanged.
    Exchanged {
        /// The largest B, taken as T.
        largest_b_t: f64,
        /// The largest H, taken as A/m.
        largest_h_a_per_m: f64,
    },
    /// Somewhere the curve rises a little less than vacuum does.
    BelowVacuum {
        /// B where that step begins, T.
        from_b_t: f64,
        /// Least differential relative permeability there.
        relative_permeability: f64,
    },
    /// The last step is far from vacuum's slope, which is assumed beyond it.
    EndsEarly {
        /// B of the last point, T.
        largest_b_t: f64,
        /// Differential relative permeability there.
        relative_permeability: f64,
    },
    /// The steps near the origin are so unequal that the cubic starts level.
    LevelOrigin {
        /// B of the first point after the origin, T.
        first_b_t: f64,
    },
}

impl std::fmt::Display for BhWarning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::UnitOfB {
                largest_b_t,
                unit,
                times,
            } => write!(
                f,
                "B up to {largest_b_t:?}, taken as T, looks like {unit} (multiply b_t by {times:?} if that is meant)"
            ),
            Self::UnitOfH {
                relative_permeability,
                last_relative_permeability,
                unit,
                times,
            } => write!(
                f,
                "H, taken as A/m, gives a relative permeability of up to {relative_permeability:.3e}, and \
                 {last_relative_permeability:.3} at the table's end: it looks like {unit} (multiply h_a_per_m by {times:.6} if that is meant)"
            ),
            Self::Exchanged {
                largest_b_t,
                largest_h_a_per_m,
            } => write!(
                f,
                "B up to {largest_b_t:?}, taken as T, and H up to {largest_h_a_per_m:?}, taken as A/m: the columns look exchanged (the header is b_t,h_a_per_m)"
            ),
            Self::BelowVacuum {
                from_b_t,
                relative_permeability,
            } => write!(
                f,
                "above B = {from_b_t:?} T the curve rises less than vacuum does (relative permeability {relative_permeability:.4}): it is used as it stands (check the rows near saturation)"
            ),
            Self::EndsEarly {
                largest_b_t,
                relative_permeability,
            } => write!(
                f,
                "the table ends at {largest_b_t:?} T with a relative permeability of {relative_permeability:.1}; beyond it vacuum's slope is assumed (add rows up to saturation)"
            ),
            Self::LevelOrigin { first_b_t } => write!(
                f,
                "between 0 and {first_b_t:?} T the interpolant starts level, so its permeability at 0 is infinite (add rows near the origin)"
            ),
        }
    }
}

/// Refuses points through which no curve goes.
pub(super) fn points(b: &[f64], h: &[f64]) -> Result<(), BhCurveError> {
    if b.len() != h.len() {
        let (b, h) = (b.len(), h.len());
        return Err(BhCurveError::Lengths { b, h });
    }
    let out = |i: &usize| !(h[*i].is_finite() && b[*i].abs() <= LARGEST_B);
    if let Some(i) = (0..b.len()).find(out) {
        return Err(BhCurveError::OutOfRange {
            row: i + 1,
            b_t: b[i],
            h_a_per_m: h[i],
        });
    }
    if let (Some(&b_t), Some(&h_a_per_m)) = (b.first(), h.first())
        && (b_t, h_a_per_m) != (0.0, 0.0)
    {
        return Err(BhCurveError::NotFromOrigin { b_t, h_a_per_m });
    }
    if b.len() < 3 {
        return Err(BhCurveError::TooFew { points: b.len() });
    }
    for row in 1..b.len() {
        for (column, values) in [("b_t", b), ("h_a_per_m", h)] {
            if values[row] <= values[row - 1] {
                return Err(BhCurveError::NotGrowing {
                    row: row + 1,
                    column,
                    value: values[row],
                    before: values[row - 1],
                });
            }
        }
        let (b_t, row) = (b[row], row + 1);
        let relative_permeability = step_permeability(b, h, row - 2);
        if relative_permeability * (1.0 + VACUUM_TOLERANCE) < 1.0 {
            return Err(BhCurveError::BelowVacuum {
                row,
                b_t,
                relative_permeability,
            });
        }
        if relative_permeability > LARGEST_RELATIVE_PERMEABILITY {
            return Err(BhCurveError::Unbounded {
                row,
                b_t,
                relative_permeability,
            });
        }
    }
    Ok(())
}

/// Differential relative permeability of the step from point `k` to the next.
fn step_permeability(b: &[f64], h: &[f64], k: usize) -> f64 {
    (b[k + 1] - b[k]) / MU_0_T_M_PER_A / (h[k + 1] - h[k])
}

/// Slopes dH/dB of the curve through a table, m/H.
pub(super) struct Slopes {
    /// At the origin.
    pub(super) first: f64,
    /// At the last point, seen from below.
    pub(super) last: f64,
    /// The largest in every step.
    pub(super) steepest: Vec<f64>,
}

/// Doubtful features of a table through which the curve has `slopes`.
pub(super) fn warnings(slopes: &Slopes, b: &[f64], h: &[f64]) -> Vec<BhWarning> {
    let (largest_b_t, largest_h_a_per_m) = (b[b.len() - 1], h[h.len() - 1]);
    if largest_b_t > GAUSS_BELOW
        || (largest_b_t > PLAUSIBLE_B_T && largest_h_a_per_m < PLAUSIBLE_B_T)
    {
        return vec![BhWarning::Exchanged {
            largest_b_t,
            largest_h_a_per_m,
        }];
    }
    let mut found = Vec::new();
    // H is judged with B as it is probably meant.
    let times = unit_of_b(largest_b_t, &mut found);
    let before = found.len();
    unit_of_h(slopes.last, b, h, times, &mut found);
    let in_si = found.is_empty();
    let last_permeability = times / (MU_0_T_M_PER_A * slopes.last);
    if found.len() == before && last_permeability > VACUUM_FOLLOWS {
        found.push(BhWarning::EndsEarly {
            largest_b_t: largest_b_t * times,
            relative_permeability: last_permeability,
        });
    }
    if in_si {
        let steepest = slopes.steepest.iter().copied().enumerate();
        let least = steepest.fold(
            (0, 0.0),
            |best, next| if next.1 > best.1 { next } else { best },
        );
        let relative_permeability = 1.0 / (MU_0_T_M_PER_A * least.1);
        // Rounding of the table's own last digits is no news.
        if relative_permeability < 1.0 - 1e-3 {
            found.push(BhWarning::BelowVacuum {
                from_b_t: b[least.0],
                relative_permeability,
            });
        }
    }
    if slopes.first == 0.0 {
        found.push(BhWarning::LevelOrigin { first_b_t: b[1] });
    }
    found
}

/// Warns of B in another unit; the factor that brings it to T.
fn unit_of_b(largest_b_t: f64, found: &mut Vec<BhWarning>) -> f64 {
    if largest_b_t <= PLAUSIBLE_B_T {
        return 1.0;
    }
    let (unit, times) = if largest_b_t < MILLITESLA_BELOW {
        ("mT", 1e-3)
    } else {
        ("gauss", 1e-4)
    };
    found.push(BhWarning::UnitOfB {
        largest_b_t,
        unit,
        times,
    });
    times
}

/// Warns of H in another unit, judged with B times `times`.
fn unit_of_h(last_slope: f64, b: &[f64], h: &[f64], times: f64, found: &mut Vec<BhWarning>) {
    let steps = (0..b.len() - 1).map(|k| times * step_permeability(b, h, k));
    let relative_permeability = steps.fold(0.0, f64::max);
    let last_relative_permeability = times / (MU_0_T_M_PER_A * last_slope);
    let end_t = times * b[b.len() - 1];
    let still_permeable = SATURATED
        .iter()
        .any(|&(b_t, most)| end_t > b_t && last_relative_permeability > most);
    if relative_permeability <= PLAUSIBLE_PERMEABILITY && !still_permeable {
        return;
    }
    // The end of the table would be vacuum or better in the unit meant.
    let (unit, times) = if last_relative_permeability > 0.5 * 1000.0 {
        ("kA/m", 1000.0)
    } else {
        ("oersted", A_PER_M_IN_OERSTED)
    };
    // Steel that is hardly any in another unit is linear in this one.
    if relative_permeability < LEAST_PERMEABILITY * times {
        return;
    }
    found.push(BhWarning::UnitOfH {
        relative_permeability,
        last_relative_permeability,
        unit,
        times,
    });
}
