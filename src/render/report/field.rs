//! Maps of dB_z/dz at a few heights, small enough for a page.

use fluxform_bundle::npz::MapArrays;
use serde_json::{Value, json};

use super::data::CalibratedObject;
use super::frame::{Section, figure};
use super::html::{Cell, Html, Table};
use super::number::figures;
use super::pack::u16s;

/// Heights of the maps that a page shows of all coils together, at most.
const HEIGHTS: usize = 12;
/// Nodes along either side of those.
const SIDE: usize = 61;
/// Heights that it shows of each coil.
const COIL_HEIGHTS: usize = 5;
/// Nodes of all coils' maps together, and along either side of each.
const COIL_NODES: usize = 45_000;
const COIL_SIDE: usize = 31;
/// Of more coils none is shown alone.
const COILS: usize = 64;

/// Values on planes above the coils.
struct Layer {
    /// The quantity shown.
    name: String,
    /// Unit of the values.
    unit: &'static str,
    /// Nodes along x.
    columns: usize,
    /// Heights of the planes, m.
    height_m: Vec<f64>,
    /// [plane, y, x].
    values: Vec<f64>,
}

/// About `count` of `all` places, both ends among them.
pub(super) fn some(all: usize, count: usize) -> Vec<usize> {
    if all <= count || count < 2 {
        return (0..all.min(count.max(1)).max(usize::from(all > 0)))
            .map(|at| at.min(all - 1))
            .collect();
    }
    let place = |at: usize| (at * (all - 1) + (count - 1) / 2) / (count - 1);
    (0..count).map(place).collect()
}

/// Part of the nodes of a plane: places along x and y.
pub(super) struct Plan {
    pub(super) x: Vec<usize>,
    pub(super) y: Vec<usize>,
}

impl Plan {
    pub(super) fn new(map: &MapArrays, side: usize) -> Self {
        Self {
            x: some(map.x_m.len(), side),
            y: some(map.y_m.len(), side),
        }
    }

    /// Adds `factor` times a coil's values on a plane.
    fn add(&self, map: &MapArrays, coil: usize, plane: usize, factor: f64, sum: &mut [f64]) {
        let (columns, rows) = (map.x_m.len(), map.y_m.len());
        let from = (coil * map.z_m.len() + plane) * rows * columns;
        let values = &map.gz_t_per_m_per_a[from..from + rows * columns];
        let nodes = self
            .y
            .iter()
            .flat_map(|y| self.x.iter().map(move |x| y * columns + x));
        for (sum, node) in sum.iter_mut().zip(nodes) {
            *sum += factor * values[node];
        }
    }

    pub(super) fn len(&self) -> usize {
        self.x.len() * self.y.len()
    }
}

/// dB_z/dz of all coils at the chosen currents, T/m, on some planes.
pub(super) fn together(object: &CalibratedObject, planes: &[usize], plan: &Plan) -> Vec<f64> {
    let map = object.map;
    let currents = object.lambda.currents_a.as_deref().unwrap_or(&[]);
    let mut values = vec![0.0; planes.len() * plan.len()];
    for (plane, sum) in planes.iter().zip(values.chunks_exact_mut(plan.len())) {
        for (at, coil) in map.coil.iter().enumerate() {
            let current = usize::try_from(*coil)
                .ok()
                .and_then(|coil| currents.get(coil));
            let current = current.copied().unwrap_or(0.0);
            plan.add(map, at, *plane, current, sum);
        }
    }
    values
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

/// All coils together, then each alone.
fn layers(object: &CalibratedObject) -> Vec<Layer> {
    let map = object.map;
    let heights = |planes: &[usize]| planes.iter().map(|at| map.z_m[*at]).collect::<Vec<_>>();
    let mut layers = Vec::new();
    if object.lambda.currents_a.is_some() {
        let (planes, plan) = (some(map.z_m.len(), HEIGHTS), Plan::new(map, SIDE));
        layers.push(Layer {
            name: "all coils at their currents".to_owned(),
            unit: "T/m",
            columns: plan.x.len(),
            height_m: heights(&planes),
            values: together(object, &planes, &plan),
        });
    }
    if map.coil.len() <= COILS {
        let planes = some(map.z_m.len(), COIL_HEIGHTS);
        let share = COIL_NODES / (map.coil.len() * planes.len()).max(1);
        let plan = Plan::new(map, COIL_SIDE.min(share.isqrt()).max(2));
        layers.extend(map.coil.iter().enumerate().map(|(at, coil)| {
            let mut values = vec![0.0; planes.len() * plan.len()];
            for (plane, sum) in planes.iter().zip(values.chunks_exact_mut(plan.len())) {
                plan.add(map, at, *plane, 1e3, sum);
            }
            Layer {
                name: format!("coil {coil} alone, per ampere"),
                unit: "mT/m/A",
                columns: plan.x.len(),
                height_m: heights(&planes),
                values,
            }
        }));
    }
    layers
}

pub(super) fn section(
    object: &CalibratedObject,
    data: &mut serde_json::Map<String, Value>,
) -> Section {
    let layers = layers(object);
    let mut body = Html::default();
    body.raw("<div class=\"pair\">");
    figure(
        &mut body,
        "field",
        "Map of the vertical gradient dBz/dz at a height",
        "dBz/dz at the height chosen with the slider, from the nodes of map.npz; dashed circles are \
         the coils. The force on an upright magnet is its moment times this.",
    );
    if let Some(layer) = layers.first() {
        body.raw("<div>").table(&extremes(layer)).raw("</div>");
    }
    body.raw("</div>");
    let mm = |nodes: &[f64]| {
        let from = nodes.first().copied().unwrap_or(0.0);
        [from, nodes.last().copied().unwrap_or(from)].map(|end| end * 1e3)
    };
    let [x, y, z] = object.manifest.magnet.moment_a_m2;
    // A tilted magnet's force is no multiple of the vertical gradient.
    let force_a_m2 = (x == 0.0 && y == 0.0).then_some(z);
    data.insert(
        "field".to_owned(),
        json!({
            "x": mm(&object.map.x_m),
            "y": mm(&object.map.y_m),
            "first": object.lowest_m() * 1e3,
            "force": force_a_m2,
            "layers": layers.iter().map(Layer::json).collect::<Vec<_>>(),
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

#[cfg(test)]
mod tests {
    use super::some;

    #[test]
    fn some_places_keep_both_ends() {
        assert_eq!(some(5, 9), [0, 1, 2, 3, 4]);
        assert_eq!(some(61, 3), [0, 30, 60]);
        assert_eq!(some(7, 4), [0, 2, 4, 6]);
        assert_eq!(some(1, 12), [0]);
        assert!(some(0, 3).is_empty());
        assert_eq!(some(9, 1).len(), 1);
    }
}
