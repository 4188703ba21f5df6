//! Maps of dB_z/dz at a few heights, small enough for a page.

use serde_json::{Value, json};

use super::frame::{Section, figure};
use super::html::{Cell, Html, Table};
use super::number::figures;
use super::pack::u16s;

/// Values on planes above the coils.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// What is shown.
    pub name: String,
    /// Unit of the values.
    pub unit: &'static str,
    /// Nodes along x.
    pub columns: usize,
    /// Heights of the planes, m.
    pub height_m: Vec<f64>,
    /// [plane, y, x].
    pub values: Vec<f64>,
}

/// Maps over one region of the plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// The region's ends along x, m.
    pub x_m: [f64; 2],
    /// The region's ends along y, m.
    pub y_m: [f64; 2],
    /// The first is shown first.
    pub layers: Vec<Layer>,
    /// The height that is shown first, m.
    pub first_m: f64,
    /// Upward force for a gradient, N per T/m; `None` for a tilted magnet.
    pub force_a_m2: Option<f64>,
}

impl Layer {
    fn planes(&self) -> impl Iterator<Item = (f64, &[f64])> {
        let size = (self.values.len() / self.height_m.len().max(1)).max(1);
        let heights = self.height_m.iter().copied();
        heights.zip(self.values.chunks_exact(size))
    }

    fn json(&self) -> Value {
        let planes: Vec<Value> = self.planes().map(|(_, values)| u16s(values)).collect();
        json!({
            "name": self.name,
            "unit": self.unit,
            "columns": self.columns,
            "heights": self.height_m.iter().map(|z| z * 1e3).collect::<Vec<_>>(),
            "planes": planes,
        })
    }
}

pub(super) fn section(field: &Field, data: &mut serde_json::Map<String, Value>) -> Section {
    let mut body = Html::default();
    body.raw("<div class=\"pair\">");
    figure(
        &mut body,
        "field",
        "Map of the vertical gradient dBz/dz at a height",
        "dBz/dz at the height chosen with the slider, from the nodes of map.npz; dashed circles are \
         the coils. The force on an upright magnet is its moment times this.",
    );
    if let Some(layer) = field.layers.first() {
        body.raw("<div>").table(&extremes(layer)).raw("</div>");
    }
    body.raw("</div>");
    let mm = |[from, to]: [f64; 2]| [from * 1e3, to * 1e3];
    data.insert(
        "field".to_owned(),
        json!({
            "x": mm(field.x_m),
            "y": mm(field.y_m),
            "first": field.first_m * 1e3,
            "force": field.force_a_m2,
            "layers": field.layers.iter().map(Layer::json).collect::<Vec<_>>(),
        }),
    );
    Section {
        id: "field",
        title: "Field",
        body,
    }
}

fn extremes(layer: &Layer) -> Table {
    let row = |(height_m, values): (f64, &[f64])| -> Vec<Cell> {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        vec![
            format!("{} mm", figures(height_m * 1e3, 4)).into(),
            format!("{} {}", figures(low, 4), layer.unit).into(),
            format!("{} {}", figures(high, 4), layer.unit).into(),
        ]
    };
    Table {
        caption: format!("dBz/dz of {}: extremes over the plan", layer.name),
        head: vec![("height", false), ("least", true), ("largest", true)],
        rows: layer.planes().map(row).collect(),
        prose: false,
    }
}
