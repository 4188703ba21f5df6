//! `optimize --for`: choices without an order, and given arrays that no search begins at.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::SEED;
use fluxform_testing::place::Place;

const FLAT: &str = "shapes/flat.toml";

/// The columns were the best array's variables, and none named the choice: rows of another one could not be rebuilt.
#[test]
fn regression_rows_of_the_front_lacked_their_choice_and_its_variables() {
    let place = Place::new();
    let text = place
        .text(SEED)
        .replace("rows = 3", "rows = 2")
        .replace("columns = 3", "columns = 2");
    let vary = "[search]\narray.layout = [\"grid\", \"shifted\"]\narray.move_mm = [-1.5, 1.5]\n";
    let text = text.replace("resistance_max_ohm = 6.0", "resistance_max_ohm = 7.0");
    place.write("layouts.toml", &format!("{text}\n{vary}"));
    let mut arguments = vec!["optimize", "layouts.toml", "--for", FLAT];
    arguments.extend(["--evaluations", "12", "--starts", "1", "--format", "json"]);
    arguments.extend(["--front", "trade.csv"]);
    let result = place.run(&arguments).ends(0).json();
    let table = place.text("trade.csv");
    let mut lines = table.lines().map(|line| line.split(','));
    let head: Vec<&str> = lines.next().expect("a head").collect();
    let rows: Vec<BTreeMap<&str, &str>> = lines
        .map(|row| head.iter().copied().zip(row).collect())
        .collect();
    let best: Vec<&String> = result["values"].as_object().unwrap().keys().collect();
    assert_eq!(&head[4..4 + best.len()], &best[..], "{head:?}");
    let choices = result["choices"].as_array().unwrap();
    assert_eq!(choices.len(), 2);
    for choice in choices {
        let values = choice["values"].as_object().unwrap();
        let row = rows.iter().find(|row| {
            row["quantity"] == "coils" && row["array.layout"] == choice["layout"].as_str().unwrap()
        });
        let row = row.expect("a row of every choice");
        for key in head.iter().filter(|key| key.contains(".move_")) {
            let value = values.get(*key).and_then(Value::as_f64);
            assert_eq!(row[key].parse().ok(), value, "{key} {row:?}");
        }
        assert!(values.keys().all(|key| head.contains(&key.as_str())));
        let rest = ["array.rows", "array.columns", "core", "plate"].map(|key| row[key]);
        assert_eq!(rest, ["2", "2", "false", "false"]);
    }
    let front = result["study"]["front"].as_array().unwrap();
    assert!(front.iter().all(|point| point["layout"].is_string()));
}

/// The costs were those before lengths are rounded, 8e-9 beside those of the design in the row here.
#[test]
fn regression_the_front_s_costs_were_of_other_designs_than_its_rows() {
    let place = Place::empty();
    place.write(
        "array.toml",
        "name = \"array\"\n[coil]\ninner_diameter_mm = 14\nouter_diameter_mm = 28\nlength_mm = 35\n[wire]\n\
         diameter_mm = 0.7\n[array]\nrows = 2\ncolumns = 2\npitch_mm = 40\n[supply]\ncurrent_max_a = 3\n\
         total_current_max_a = 7\n[limits]\narray_mass_max_kg = 0.6\n[search]\ncoil.outer_diameter_mm = [20, 36]\n\
         coil.inner_diameter_mm = [10.0, 20]\n[workspace]\nx_mm = [-40, 40, 9]\ny_mm = [-40, 40, 9]\n\
         z_mm = [15, 60, 10]\n",
    );
    place.write(
        "dome.toml",
        "name = \"dome\"\nprimitive = \"half-sphere\"\nradius_mm = 25\nbase_mm = 20\n[points]\n\
         x_mm = [-25, 25, 9]\ny_mm = [-25, 25, 8]\n",
    );
    let mut arguments = vec!["optimize", "array.toml", "--for", "dome.toml"];
    arguments.extend([
        "--evaluations",
        "8",
        "--starts",
        "1",
        "--front",
        "trade.csv",
    ]);
    arguments.extend(["--format", "json"]);
    let result = place.run(&arguments).ends(0).json();
    let values = result["values"].as_object().unwrap();
    let front = result["study"]["front"].as_array().unwrap();
    let mut rows = 0;
    for (quantity, limit) in [
        ("array_mass_kg", "array_mass_kg"),
        ("array_power_w", "array_power_w"),
    ] {
        let best = front.iter().find(|point| {
            point["quantity"] == quantity && point["values"].as_object() == Some(values)
        });
        let stated = result["limits"][limit]["value"].as_f64();
        if let (Some(point), Some(stated)) = (best, stated) {
            let cost = point["value"].as_f64().unwrap();
            assert!(
                (cost / stated - 1.0).abs() < 1e-12,
                "{quantity}: {cost} {stated}"
            );
            rows += 1;
        }
    }
    assert!(rows > 0, "{result}");
}

/// A constant that is 0 was taken for an array that renders nothing.
#[test]
fn regression_an_array_without_a_maxmin_was_said_to_render_nothing() {
    let place = Place::new();
    let text = place
        .text(SEED)
        .replace("rows = 3", "rows = 1")
        .replace("columns = 3", "columns = 1");
    place.write("one.toml", &text);
    let mut arguments = vec!["optimize", "one.toml", "--for", FLAT];
    arguments.extend(["--vary", "coil.inner_diameter_mm=6:30"]);
    arguments.extend(["--constant", "maxmin"]);
    place.run(&arguments).ends(3).says(&[
        "lambda_maxmin of the given design is 0 for flat",
        "though its lambda_jnd is ",
        "choose another --constant, like jnd",
    ]);
}
