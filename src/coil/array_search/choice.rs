//! The choices of a search that have no order: rows and columns, layouts, magnets, core and plate.

use fluxform_design::Design;
use fluxform_design::search::{SearchKey, SearchLayout, SearchSpace, SearchValues};

/// Choices that have no order: each is a search of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// Rows and columns; `None` for the design's positions.
    pub grid: Option<(SearchLayout, [usize; 2])>,
    /// Diameter and length of the magnet, mm, where that is another.
    pub magnet_mm: Option<[f64; 2]>,
    /// Whether the core is left out.
    pub without_core: bool,
    /// Whether the plate is left out.
    pub without_plate: bool,
}

impl Choice {
    /// In messages.
    pub(super) fn described(&self) -> String {
        let mut text = match self.grid {
            Some((layout, [rows, columns])) => {
                format!("{rows} x {columns} coils, {}", <&str>::from(layout))
            }
            None => "the given positions".to_owned(),
        };
        if let Some([diameter, length]) = self.magnet_mm {
            text.push_str(&format!(", a magnet of {diameter} mm x {length} mm"));
        }
        if self.without_core {
            text.push_str(", no core");
        }
        if self.without_plate {
            text.push_str(", no plate");
        }
        text
    }
}

/// All choices that `space` names for `design`.
#[must_use]
pub fn choices(design: &Design, space: &SearchSpace) -> Vec<Choice> {
    let given = design.array.grid.map(|grid| [grid.rows, grid.columns]);
    let counts = |key, given: Option<usize>| -> Vec<Option<usize>> {
        match space.values(key) {
            Some(SearchValues::Listed(list)) => list.iter().map(|v| Some(*v as usize)).collect(),
            Some(SearchValues::Range(_)) | None => vec![given],
        }
    };
    let mut all = Vec::new();
    for rows in counts(SearchKey::Rows, given.map(|g| g[0])) {
        for columns in counts(SearchKey::Columns, given.map(|g| g[1])) {
            let layouts = match (rows.zip(columns), &space.layouts[..]) {
                (None, _) => vec![None],
                (Some((rows, columns)), []) => vec![Some((SearchLayout::Grid, [rows, columns]))],
                (Some((rows, columns)), some) => some
                    .iter()
                    .map(|layout| Some((*layout, [rows, columns])))
                    .collect(),
            };
            for grid in layouts {
                let sizes = space.magnets_mm.iter().map(|size| Some(*size));
                let magnets: Vec<_> = if space.magnets_mm.is_empty() {
                    vec![None]
                } else {
                    sizes.collect()
                };
                for magnet_mm in magnets {
                    for &without_core in
                        with_and_without(space.without_core && design.core.is_some())
                    {
                        let without =
                            with_and_without(space.without_plate && design.plate.is_some());
                        all.extend(without.iter().map(|&without_plate| Choice {
                            grid,
                            magnet_mm,
                            without_core,
                            without_plate,
                        }));
                    }
                }
            }
        }
    }
    all
}

fn with_and_without(both: bool) -> &'static [bool] {
    if both { &[false, true] } else { &[false] }
}
