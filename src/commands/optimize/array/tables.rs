//! The trade-offs of `optimize --for` as a table and a drawing.

use super::ArrayOptimization;
use crate::coil::array_search::study::TRADED;
use crate::coil::limits::LimitName;
use crate::plot::pareto::{Panel, ParetoPlot};

/// How the table begins.
pub const HEAD: &str = "quantity,value,gain,coils";

/// Worths of limits that fit above the panels.
const WORTHS: usize = 2;

/// One row a point: quantity, its value, the gain, and every variable; for each choice of layout, magnet
/// and core one of the number of coils.
pub fn csv(result: &ArrayOptimization) -> String {
    let points = result.study.as_ref().map_or(&[][..], |study| &study.front);
    let keys: Vec<&str> = result.values.keys().map(String::as_str).collect();
    let mut text = format!("{HEAD},{}\n", keys.join(","));
    for point in points {
        let value = |key: &&str| {
            point
                .values
                .get(*key)
                .map_or_else(String::new, f64::to_string)
        };
        let values: Vec<String> = keys.iter().map(value).collect();
        text.push_str(&format!(
            "{},{},{},{},{}\n",
            point.quantity,
            point.value,
            point.objective,
            point.coils,
            values.join(",")
        ));
    }
    for choice in &result.choices {
        let value = |key: &&str| {
            choice
                .values
                .get(*key)
                .map_or_else(String::new, f64::to_string)
        };
        let values: Vec<String> = keys.iter().map(value).collect();
        if let Some(gain) = choice.objective {
            text.push_str(&format!(
                "coils,{0},{gain},{0},{1}\n",
                choice.coils,
                values.join(",")
            ));
        }
    }
    text
}

/// Gain against mass, heat and settling of the whole array, and above them the `worths` of limits; `None`
/// where these were not studied.
pub fn pareto(result: &ArrayOptimization, worths: &[String]) -> Option<ParetoPlot> {
    let study = result.study.as_ref()?;
    let panel = |cost: usize| {
        let (_, name): (_, LimitName) = TRADED[cost];
        let limit = name.limit();
        Panel {
            name: limit.label,
            unit: limit.written.0,
            values: study
                .designs
                .iter()
                .map(|design| design.costs[cost] * limit.written.1)
                .collect(),
            front: study.on_front[cost].clone(),
        }
    };
    Some(ParetoPlot {
        title: std::iter::once(format!("{}: gain against cost", result.design))
            .chain(worths.iter().take(WORTHS).cloned())
            .collect::<Vec<_>>()
            .join("; "),
        gain: "force constants, relative",
        gain_unit: "",
        gains: study
            .designs
            .iter()
            .map(|design| design.objective)
            .collect(),
        limits_met: study.designs.iter().map(|design| design.met).collect(),
        front: "computed arrays that no other one beats",
        panels: std::array::from_fn(panel),
    })
}
