//! The constraint points as a surface: heights and force errors, few enough to draw.

use serde_json::{Value, json};

use super::data::CalibratedObject;
use super::frame::{Section, figure};
use super::html::{Cell, Html, Table};
use super::number::{count, figures, force};
use super::pack::f32s;

/// Points along either side, at most: of more the one most in error stands for its neighbours.
const MOST: usize = 81;

/// Points of a grid, x fastest; `None` where there is no surface.
struct Surface {
    /// The grid's ends along x, m.
    x_m: [f64; 2],
    /// The grid's ends along y, m.
    y_m: [f64; 2],
    /// Points along x.
    columns: usize,
    /// Heights, m.
    height_m: Vec<Option<f64>>,
    /// Upward force minus lambda h, N; empty without a force constant.
    error_n: Vec<Option<f64>>,
}

impl Surface {
    fn new(object: &CalibratedObject) -> Self {
        let grid = &object.manifest.points;
        // A manifest that was made here has flags that fit its axes.
        let flags = grid.flags().unwrap_or_default();
        let at_points = |values: &mut dyn Iterator<Item = f64>| -> Vec<Option<f64>> {
            let value = |flag: &bool| flag.then(|| values.next()).flatten();
            flags.iter().map(value).collect()
        };
        let error_n = object.curves.chosen.as_ref().map(|forces| {
            let pairs = forces.static_n.iter().zip(&forces.requested_n);
            at_points(&mut pairs.map(|(given, target)| given - target))
        });
        Self {
            x_m: [grid.x_m.from_m, grid.x_m.to_m],
            y_m: [grid.y_m.from_m, grid.y_m.to_m],
            columns: grid.x_m.samples,
            height_m: at_points(&mut object.points.iter().map(|row| row.height_m)),
            error_n: error_n.unwrap_or_default(),
        }
    }

    fn rows(&self) -> usize {
        self.height_m.len() / self.columns.max(1)
    }

    /// Every how many points one is drawn.
    fn step(&self) -> usize {
        self.columns.max(self.rows()).div_ceil(MOST).max(1)
    }

    /// Where the one that stands for a block lies.
    fn thinned(&self) -> Vec<Option<usize>> {
        let (columns, rows, step) = (self.columns.max(1), self.rows(), self.step());
        let size = |at: &usize| {
            let error = self.error_n.get(*at).copied().flatten();
            error.map_or(0.0, f64::abs)
        };
        let block = |row: usize, column: usize| {
            let all = (row..(row + step).min(rows)).flat_map(|row| {
                (column..(column + step).min(columns)).map(move |column| row * columns + column)
            });
            // The first of equals.
            all.filter(|at| self.height_m[*at].is_some())
                .reduce(|a, b| if size(&b) > size(&a) { b } else { a })
        };
        (0..rows)
            .step_by(step)
            .flat_map(|row| (0..columns).step_by(step).map(move |c| (row, c)))
            .map(|(row, column)| block(row, column))
            .collect()
    }

    fn json(&self) -> Value {
        let (columns, rows, step) = (self.columns.max(1), self.rows(), self.step());
        let kept = self.thinned();
        let of = |values: &[Option<f64>], factor: f64| {
            let value = |at: &Option<usize>| {
                let at = (*at)?;
                values.get(at).copied().flatten()
            };
            f32s(
                kept.iter()
                    .map(|at| value(at).map_or(f64::NAN, |v| v * factor)),
            )
        };
        let mm = |[from, to]: [f64; 2], samples: usize| {
            // The first point of every block is given by the grid's ends.
            let last = samples.div_ceil(step).max(1) - 1;
            let share = (last * step) as f64 / (samples.max(2) - 1) as f64;
            [from * 1e3, (from + (to - from) * share) * 1e3]
        };
        json!({
            "x": mm(self.x_m, columns),
            "y": mm(self.y_m, rows),
            "columns": columns.div_ceil(step),
            "rows": rows.div_ceil(step),
            "step": step,
            "height": of(&self.height_m, 1e3),
            "error": of(&self.error_n, 1e3),
        })
    }
}

pub(super) fn section(
    object: &CalibratedObject,
    data: &mut serde_json::Map<String, Value>,
) -> Section {
    let surface = Surface::new(object);
    let mut body = Html::default();
    let step = surface.step();
    let drawn = surface.height_m.iter().flatten().count();
    let mut left_out = if step > 1 {
        format!(" Of every {step} x {step} points the one most in error is drawn.")
    } else {
        String::new()
    };
    if drawn < object.points.len() {
        left_out += &format!(
            " {} between them, where the surface ends or bends, are not drawn: the table of errors has all.",
            count(object.points.len() - drawn, "point")
        );
    }
    body.raw("<div class=\"pair\">");
    figure(
        &mut body,
        "turn",
        "The surface with its constraint points above the coils, in three dimensions",
        &format!(
            "The surface that the finger's magnet follows, the {} of its grid and the coils below, \
             windings darker with more current; the ring is where, of these, the force is most wrong. Faces \
             that plunge at a rim are left open. Drag, use the arrow keys or the buttons \
             to turn it.{left_out}",
            count(drawn, "constraint point")
        ),
    );
    if object.lambda.lambda_n_per_m.is_some() {
        figure(
            &mut body,
            "errors",
            "Map of the force error over the surface, seen from above",
            "Upward force of the static currents minus \u{3bb}h, seen from above. Red: too \
             strong; blue: too weak; the line is where it is right.",
        );
        data.insert("errors".to_owned(), json!(true));
    }
    body.raw("</div>");
    if let Some(table) = shares(object) {
        body.folded_table(&table);
    }
    data.insert("surface".to_owned(), surface.json());
    Section {
        id: "surface",
        title: "Surface",
        body,
    }
}

/// How the errors are spread, for those who cannot see the map.
fn shares(object: &CalibratedObject) -> Option<Table> {
    let forces = object.curves.chosen.as_ref()?;
    let pairs = forces.static_n.iter().zip(&forces.requested_n);
    let mut errors: Vec<f64> = pairs.map(|(given, target)| given - target).collect();
    errors.sort_by(f64::total_cmp);
    let last = errors.len().checked_sub(1)?;
    let at = |part: f64| errors[(part * last as f64).round() as usize];
    let parts = [
        ("smallest (most too weak)", 0.0),
        ("a twentieth is below", 0.05),
        ("a quarter is below", 0.25),
        ("half is below", 0.5),
        ("three quarters are below", 0.75),
        ("nineteen twentieths are below", 0.95),
        ("largest (most too strong)", 1.0),
    ];
    let row = |(name, part): (&str, f64)| vec![Cell::from(name), force(at(part)).into()];
    let mut rows: Vec<Vec<Cell>> = parts.into_iter().map(row).collect();
    let heights = || object.points.iter().map(|row| row.height_m);
    let low = heights().fold(f64::INFINITY, f64::min);
    let high = heights().fold(f64::NEG_INFINITY, f64::max);
    rows.push(vec![
        "heights of the points".into(),
        format!("{} to {} mm", figures(low * 1e3, 4), figures(high * 1e3, 4)).into(),
    ]);
    Some(Table {
        caption: "Force error over the points, as numbers".to_owned(),
        head: vec![("part of the points", false), ("given - \u{3bb}h", true)],
        rows,
        prose: false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_points_the_worst_of_each_block_is_kept() {
        let columns = 200;
        let count = columns * 170;
        let mut error_n: Vec<Option<f64>> = (0..count).map(|_| Some(0.0)).collect();
        error_n[3 * columns + 7] = Some(-0.7);
        let surface = Surface {
            x_m: [-0.05, 0.149],
            y_m: [0.0, 0.169],
            columns,
            height_m: (0..count)
                .map(|at| (at % 13 != 5).then_some(0.03 + 1e-6 * at as f64))
                .collect(),
            error_n,
        };
        let json = surface.json();
        assert_eq!(
            (&json["columns"], &json["rows"], &json["step"]),
            (&json!(67), &json!(57), &json!(3))
        );
        // Columns 0, 3, ... 198 at 1 mm.
        assert!((json["x"][1].as_f64().unwrap() - 148.0).abs() < 1e-9);
        assert_eq!(surface.thinned()[67 + 2], Some(3 * columns + 7));
    }
}
