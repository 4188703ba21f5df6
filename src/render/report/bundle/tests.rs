//! A page of made-up facts with names that want to be more than names.

use fluxform_base::force_constant::{Criterion, NamedConstant};

use super::page;
use crate::plot::lambda::LambdaPlot;
use crate::report::data::{
    Breakpoint, BudgetPart, BundleFacts, Chosen, CoilFacts, Deciding, ErrorTime, LimitRow,
    StageFacts, WorstPlace,
};
use crate::report::field::{Field, Layer};
use crate::report::measured::{MeasuredCurve, MeasuredRow};
use crate::report::surface::Surface;

const HOSTILE: &str = "</script><img src=x onerror=alert(1)>\u{202e}\u{0}\"'&<!--";

fn plot() -> LambdaPlot {
    LambdaPlot {
        title: HOSTILE.to_owned(),
        end_n_per_m: 1.3,
        lambda_n_per_m: vec![0.0, 0.7, 1.3],
        rms_error_n: vec![0.0, 1e-3, 5e-3],
        relative_error: vec![None, Some(0.07), Some(0.13)],
        currents_a: vec![vec![0.0, 0.0], vec![0.7, 1.3], vec![1.3, 1.3]],
        breakpoint: vec![true, true, false],
        constants: Vec::new(),
        chosen: None,
    }
}

fn measured((error, seconds): &(f64, f64)) -> MeasuredRow {
    MeasuredRow {
        knob: *error,
        marked: *error < 1e-4,
        error: *error,
        stated: None,
        seconds: *seconds,
        quartiles_s: [*seconds, *seconds],
    }
}

fn facts<'a>(plot: &'a LambdaPlot, rows: &[(f64, f64)], notes: &'a [String]) -> BundleFacts<'a> {
    let coil = |x: f64, current_a: f64| CoilFacts {
        axis_m: [x, 0.0],
        radius_m: 0.019,
        current_a,
        min_a: 0.0,
        max_a: 1.3,
    };
    BundleFacts {
        design: HOSTILE,
        shape: HOSTILE,
        version: "0.1.0",
        inputs: vec![(HOSTILE, "00")],
        criterion: Criterion::Jnd,
        jnd: 0.07,
        chosen: Some(Chosen {
            lambda_n_per_m: 0.7,
            rms_error_n: 1e-3,
            worst_error_n: 3e-3,
            relative_rms_error: Some(0.13),
            duality_gap_n2: 1e-18,
            worst_at: Some(WorstPlace {
                position_m: [0.01, -0.02, 0.03],
                wanted_n: 0.02,
                given_n: 0.017,
            }),
        }),
        rank: 2,
        points: 4,
        constants: vec![NamedConstant {
            name: "jnd",
            meaning: "the chosen one",
            lambda_n_per_m: None,
        }],
        coils: vec![coil(-0.025, 0.7), coil(0.025, 1.3)],
        total_max_a: Some(2.6),
        limits: vec![LimitRow {
            name: "resistance_ohm",
            value: 6.075,
            limit: 6.0,
            met: false,
        }],
        unchecked: vec!["core field"],
        deciding: vec![Deciding {
            position_m: [0.0, 0.0, 0.03],
            share: -0.7,
        }],
        accuracy: vec![StageFacts {
            name: HOSTILE,
            estimate: 3e-5,
            relative_to: HOSTILE,
            method: HOSTILE,
        }],
        budget: vec![BudgetPart {
            name: "field",
            part: 3e-5,
            basis: "made up",
        }],
        left_out: vec![(HOSTILE, HOSTILE, 0.0)],
        breakpoints: vec![Breakpoint {
            lambda_n_per_m: 0.7,
            event: HOSTILE,
        }],
        curves: plot,
        worst_turns: vec![(0.0, 0.0), (1.3, 7e-3)],
        surface: Surface {
            x_m: [-0.05, 0.05],
            y_m: [-0.05, 0.05],
            columns: 2,
            height_m: vec![Some(0.03), None, Some(0.04), Some(0.05)],
            error_n: vec![Some(-1e-3), None, Some(1e-3), Some(3e-3)],
        },
        field: Field {
            x_m: [-0.05, 0.05],
            y_m: [-0.05, 0.05],
            layers: vec![Layer {
                name: HOSTILE.to_owned(),
                unit: "T/m",
                columns: 2,
                height_m: vec![0.03],
                values: vec![0.1, 0.2, 0.3, 0.4],
            }],
            first_m: 0.03,
            force_a_m2: Some(-0.909),
        },
        warnings: notes,
        files: vec![HOSTILE],
        error_time: Some(ErrorTime {
            curve: MeasuredCurve {
                name: HOSTILE.to_owned(),
                knob: HOSTILE,
                peer: false,
                rows: rows.iter().map(measured).collect(),
            },
            timed: HOSTILE,
            error_of: HOSTILE,
            tolerance: 1e-4,
            version: HOSTILE,
            machine: HOSTILE,
        }),
    }
}

#[test]
fn names_stay_names_everywhere() {
    let (plot, notes) = (plot(), [HOSTILE.to_owned()]);
    let html = page(&facts(&plot, &[(1e-3, 0.01), (1e-6, 0.1)], &notes));
    assert_eq!(html.matches("<script").count(), 2);
    assert_eq!(html.matches("</script>").count(), 2);
    assert!(!html.contains("<img") && !html.contains("<!--"));
    assert!(!html.contains(['\u{0}', '\u{202e}']));
    assert!(html.matches("&lt;img src=x").count() > 10);
}

#[test]
fn the_same_facts_give_the_same_bytes_with_every_part() {
    let (plot, rows) = (plot(), [(1e-3, 0.01), (1e-6, 0.1)]);
    let facts = facts(&plot, &rows, &[]);
    let html = page(&facts);
    assert!(html == page(&facts));
    for told in [
        "draw-cost",
        "too weak",
        "misses its limit of resistance",
        "core field",
        "\u{25b2} 1.3",
        "6.075 \u{3a9}",
        "1 of 2 coils at the limit: 1.",
        "too strong 70 %",
    ] {
        assert!(html.contains(told), "{told}");
    }
    let without = BundleFacts {
        error_time: None,
        chosen: None,
        ..facts
    };
    let html = page(&without);
    assert!(!html.contains("draw-cost") && html.contains("There is no force constant"));
}
