//! A map as CSV: what `probe` gives at its nodes.

use std::io::{self, Write};

use super::npz::MapArrays;
use super::table::{FIELD_COLUMNS, GRADIENT_COLUMNS, write_samples};

/// Writes a map as `probe` would at its nodes: x fastest, then y, then z; field and gradient where
/// the map has them, else dB_z/dz, with dB_x/dz and dB_y/dz where those are there.
///
/// # Errors
/// As [`super::table::write_columns`].
pub fn write_map(out: &mut dyn Write, map: &MapArrays) -> io::Result<()> {
    let [_, nz, ny, nx] = map.shape();
    let nodes = nz * ny * nx;
    let points = (0..nodes).map(|n| {
        let (x, y, z) = (n % nx, n / nx % ny, n / nx / ny);
        [map.x_m[x], map.y_m[y], map.z_m[z]]
    });
    let field = map.field_t_per_a.as_deref();
    let gradient = map.gradient_t_per_m_per_a.as_deref();
    let mut columns = Vec::new();
    if field.is_some() {
        columns.extend(FIELD_COLUMNS);
    }
    // Beside the whole tensor the components along z would be there twice.
    let sides = map.sides().filter(|_| gradient.is_none());
    match (gradient, sides) {
        (Some(_), _) => columns.extend(GRADIENT_COLUMNS),
        (None, Some(_)) => columns.extend([2, 5, 8].map(|place| GRADIENT_COLUMNS[place])),
        (None, None) => columns.push(GRADIENT_COLUMNS[8]),
    }
    write_samples(out, &columns, points, &map.coil, |node, coil| {
        let at = coil * nodes + node;
        let mut row = Row::default();
        row.extend(field.map_or(&[], |values| &values[3 * at..3 * at + 3]));
        for side in sides.into_iter().flatten() {
            row.extend(&side[at..=at]);
        }
        row.extend(match gradient {
            Some(values) => &values[9 * at..9 * at + 9],
            None => &map.gz_t_per_m_per_a[at..=at],
        });
        row
    })
}

/// Up to twelve numbers without a heap.
#[derive(Default)]
struct Row {
    values: [f64; 12],
    count: usize,
}

impl Row {
    fn extend(&mut self, values: &[f64]) {
        self.values[self.count..self.count + values.len()].copy_from_slice(values);
        self.count += values.len();
    }
}

impl AsRef<[f64]> for Row {
    fn as_ref(&self) -> &[f64] {
        &self.values[..self.count]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::npz::Runtime;

    #[test]
    fn a_map_is_written_coil_by_coil_within_a_point() {
        let mut map = MapArrays {
            x_m: vec![0.1, 0.2].into(),
            y_m: vec![0.3].into(),
            z_m: vec![0.01].into(),
            coil: vec![1, 4].into(),
            gz_t_per_m_per_a: vec![0.5, 0.6, 0.7, 0.8].into(),
            sides_t_per_m_per_a: None,
            gradient_t_per_m_per_a: None,
            field_t_per_a: None,
            passive_force_n: None,
            working_point_gz_t_per_m: None,
            runtime: Runtime {
                moment_a_m2: [0.0, 0.0, 1.0],
                current_min_a: vec![],
                current_max_a: vec![],
                resistance_ohm: vec![],
                total_current_max_a: None,
                lambda_n_per_m: None,
                rendering: None,
            },
        };
        let mut text = Vec::new();
        write_map(&mut text, &map).unwrap();
        assert_eq!(
            String::from_utf8(text).unwrap(),
            "x_m,y_m,z_m,coil,dbz_dz_t_per_m_per_a\n0.1,0.3,0.01,1,0.5\n0.1,0.3,0.01,4,0.7\n\
             0.2,0.3,0.01,1,0.6\n0.2,0.3,0.01,4,0.8\n"
        );
        map.sides_t_per_m_per_a =
            Some([(10..14).map(f64::from), (20..24).map(f64::from)].map(Iterator::collect));
        let mut text = Vec::new();
        write_map(&mut text, &map).unwrap();
        assert_eq!(
            String::from_utf8(text).unwrap(),
            "x_m,y_m,z_m,coil,dbx_dz_t_per_m_per_a,dby_dz_t_per_m_per_a,dbz_dz_t_per_m_per_a\n\
             0.1,0.3,0.01,1,10,20,0.5\n0.1,0.3,0.01,4,12,22,0.7\n\
             0.2,0.3,0.01,1,11,21,0.6\n0.2,0.3,0.01,4,13,23,0.8\n"
        );
        map.field_t_per_a = Some((0..12).map(f64::from).collect());
        map.gradient_t_per_m_per_a = Some((100..136).map(f64::from).collect());
        let mut text = Vec::new();
        write_map(&mut text, &map).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert!(
            text.ends_with("0.2,0.3,0.01,4,9,10,11,127,128,129,130,131,132,133,134,135\n"),
            "{text}"
        );
    }
}
