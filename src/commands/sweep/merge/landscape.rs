//! What ranks a sweep's designs over its one or two keys.

use super::{Brief, SweepBest, ranked_by};
use crate::RunError;
use crate::bundle::sweep::{Axis, PlanFile, value_text};
use crate::plot::landscape::{Landscape, Variable};

/// Values of a key that a drawing has room for.
const MOST_VALUES: usize = 200;

/// Refuses plans that a plane cannot show.
///
/// # Errors
/// More than two keys, or too many values of one.
pub(crate) fn check_drawable(plan: &PlanFile) -> Result<(), RunError> {
    let keys = plan.axes.len();
    if !(1..=2).contains(&keys) {
        return Err(RunError::Sweep(format!(
            "--plot draws over one key or two, this plan has {keys}; plan the others apart, or see \
             the plot beside the table"
        )));
    }
    match plan
        .axes
        .iter()
        .find(|axis| axis.values.len() > MOST_VALUES)
    {
        Some(axis) => Err(RunError::Sweep(format!(
            "--plot draws up to {MOST_VALUES} values of a key, {} has {}; see the table",
            axis.key,
            axis.values.len()
        ))),
        None => Ok(()),
    }
}

/// The drawing; the first key is along x.
pub(super) fn landscape(plan: &PlanFile, briefs: &[Brief], best: Option<&SweepBest>) -> Landscape {
    let columns = plan.axes.first().map_or(1, |axis| axis.values.len());
    let rows = plan.axes.get(1).map(|axis| axis.values.len());
    // The last key is fastest in the plan.
    let place = |index: u64| {
        let index = index as usize;
        [index / rows.unwrap_or(1), index % rows.unwrap_or(1)]
    };
    let count = columns * rows.unwrap_or(1);
    let (mut values, mut met) = (vec![None; count], vec![false; count]);
    for brief in briefs {
        let [column, row] = place(brief.index);
        values[row * columns + column] = Some(brief.merit());
        met[row * columns + column] = brief.met;
    }
    let variable = |axis: &Axis| Variable {
        name: axis.key.clone(),
        labels: axis.values.iter().map(value_text).collect(),
    };
    let named = |best: &SweepBest| {
        let first = best.array.map_or("strongest", |_| "best");
        match best.limits_met {
            true => format!("{first} within its limits"),
            false => format!("{first}; none meets its limits"),
        }
    };
    Landscape {
        title: format!("{}: {} designs", plan.design, briefs.len()),
        quantity: ranked_by(plan),
        across: plan.axes.first().map_or_else(Variable::default, variable),
        up: plan.axes.get(1).map(variable),
        values,
        met,
        limits: Vec::new(),
        best: best.map(|best| {
            let at = place(best.index).map(|k| k as f64);
            (at, named(best))
        }),
        section: None,
    }
}
