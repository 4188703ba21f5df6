//! The page of a merged sweep.

use super::Brief;
use crate::bundle::sweep::{MergeSummary, PlanFile, value_text};
use crate::plot::pareto::ParetoPlot;
use crate::report::sweep::{BestDesign, SweepFacts, page};

/// The page; `best` are the designs on the fronts and on which ones each is.
pub(super) fn html(
    plan: &PlanFile,
    summary: &MergeSummary,
    plot: &ParetoPlot,
    briefs: &[Brief],
    best: &[(u64, [bool; 3])],
) -> String {
    let mut designs = Vec::new();
    for (index, on) in best {
        // Briefs are in the plan's order.
        let Ok(at) = briefs.binary_search_by_key(index, |brief| brief.index) else {
            continue;
        };
        let brief = &briefs[at];
        designs.push(BestDesign {
            index: *index,
            values: plan.values_at(*index).into_iter().map(value_text).collect(),
            array: brief.array,
            force_n: brief.force_n,
            costs: brief.costs,
            on: *on,
            met: brief.met,
        });
    }
    page(&SweepFacts {
        design: &summary.design,
        version: &summary.fluxform_version,
        inputs: &summary.inputs,
        counts: [
            summary.points,
            summary.rows,
            summary.missing,
            summary.failed,
            summary.inaccurate,
            summary.limits_met,
        ],
        among_met: summary.front_meets_limits,
        largest_force_n: summary.largest_force_n,
        keys: plan.axes.iter().map(|axis| axis.key.as_str()).collect(),
        best: designs,
        designs: briefs.iter().map(|brief| brief.index).collect(),
        plot,
    })
}
