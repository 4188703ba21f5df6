//! The trade-offs of `optimize --for` as a table and a drawing.

use std::collections::{BTreeMap, BTreeSet};

use super::ArrayOptimization;
use crate::coil::array_search::search::ArrayChoice;
use crate::coil::array_search::study::{FrontPoint, TRADED};
use crate::coil::limits::LimitName;
use crate::design::message_text::twelve_digits;
use crate::plot::pareto::{Panel, ParetoPlot};

/// How the table begins.
pub const HEAD: &str = "quantity,value,gain,coils";

/// Worths of limits that fit above the panels.
const WORTHS: usize = 2;

/// The columns of a choice, last, by the keys of a design.
const CHOICE: &str =
    "array.rows,array.columns,array.layout,core,plate,magnet.diameter_mm,magnet.length_mm";

/// One row a point: quantity, its value, the gain, every variable and the choice that these belong to; for each choice of
/// layout, magnet and core one of the number of coils.
pub fn csv(result: &ArrayOptimization) -> String {
    let points = result.study.as_ref().map_or(&[][..], |study| &study.front);
    let keys = keys(result, points);
    let mut text = format!("{HEAD},{},{CHOICE}\n", keys.join(","));
    for point in points {
        let row = [
            point.quantity.to_owned(),
            point.value.to_string(),
            point.objective.to_string(),
            point.coils.to_string(),
            values(&point.values, &keys),
            of_choice(&point.choice),
        ];
        text.push_str(&(row.join(",") + "\n"));
    }
    for searched in &result.choices {
        let Some(gain) = searched.objective else {
            continue;
        };
        let row = [
            "coils".to_owned(),
            searched.coils.to_string(),
            gain.to_string(),
            searched.coils.to_string(),
            values(&searched.values, &keys),
            of_choice(&searched.choice),
        ];
        text.push_str(&(row.join(",") + "\n"));
    }
    text
}

/// The variables of the best array, then those that only other choices have.
fn keys<'a>(result: &'a ArrayOptimization, points: &'a [FrontPoint]) -> Vec<&'a str> {
    let of_points = points.iter().map(|point| &point.values);
    let of_choices = result.choices.iter().map(|searched| &searched.values);
    let all = of_points.chain(of_choices).flat_map(|values| values.keys());
    let others: BTreeSet<&String> = all
        .filter(|key| !result.values.contains_key(*key))
        .collect();
    let all = result.values.keys().chain(others);
    all.map(String::as_str).collect()
}

/// The values of `keys`, empty where there is none.
fn values(of: &BTreeMap<String, f64>, keys: &[&str]) -> String {
    let value = |key: &&str| of.get(*key).map_or_else(String::new, f64::to_string);
    let values: Vec<String> = keys.iter().map(value).collect();
    values.join(",")
}

/// The columns of a choice; rows, columns and layout are empty where the positions are the design's own.
fn of_choice(choice: &ArrayChoice) -> String {
    let rows_columns = choice.rows_columns.map_or_else(
        || ",".to_owned(),
        |[rows, columns]| format!("{rows},{columns}"),
    );
    let [diameter_mm, length_mm] = choice.magnet_m.map(|m| twelve_digits(m * 1e3));
    format!(
        "{rows_columns},{},{},{},{diameter_mm},{length_mm}",
        choice.layout.unwrap_or_default(),
        choice.core,
        choice.plate
    )
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
