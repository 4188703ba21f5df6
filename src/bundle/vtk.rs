//! VTK's XML files, which ParaView opens: ImageData (`.vti`) and PolyData (`.vtp`), heads in XML and
//! arrays appended as raw little-endian bytes.

use std::io::{self, Write};

use super::npz::{MapArrays, PASSIVE, SIDES};

/// Steps of an axis may differ by this, relative to the axis' length.
const EVEN: f64 = 1e-9;

/// Numbers of an array.
#[derive(Debug, Clone, Copy)]
pub enum Values<'a> {
    /// Doubles.
    Number(&'a [f64]),
    /// Whole numbers.
    Index(&'a [i64]),
}

/// A named array of tuples of `components` numbers.
#[derive(Debug, Clone)]
pub struct Array<'a> {
    /// Its name, with the unit.
    pub name: String,
    /// Numbers of a tuple.
    pub components: usize,
    /// All tuples.
    pub values: Values<'a>,
}

impl<'a> Array<'a> {
    /// An array of doubles.
    #[must_use]
    pub fn numbers(name: &str, components: usize, values: &'a [f64]) -> Self {
        Self {
            name: name.to_owned(),
            components,
            values: Values::Number(values),
        }
    }

    /// An array of whole numbers.
    #[must_use]
    pub fn indices(name: &str, values: &'a [i64]) -> Self {
        Self {
            name: name.to_owned(),
            components: 1,
            values: Values::Index(values),
        }
    }

    fn bytes(&self) -> &'a [u8] {
        match self.values {
            Values::Number(values) => bytemuck::cast_slice(values),
            Values::Index(values) => bytemuck::cast_slice(values),
        }
    }
}

/// Points and polygons between them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PolyData {
    /// m.
    pub points_m: Vec<[f64; 3]>,
    /// Points of every polygon, one after the other.
    pub corners: Vec<i64>,
    /// Where every polygon ends among the corners.
    pub ends: Vec<i64>,
}

impl PolyData {
    /// Adds a polygon.
    pub fn push(&mut self, corners: impl IntoIterator<Item = usize>) {
        self.corners.extend(corners.into_iter().map(|at| at as i64));
        self.ends.push(self.corners.len() as i64);
    }
}

/// The arrays of a file: declared in its head, appended at its end.
#[derive(Default)]
struct Appended<'a> {
    offset: usize,
    blocks: Vec<&'a [u8]>,
}

impl<'a> Appended<'a> {
    /// An element of the head that holds arrays.
    fn element(
        &mut self,
        out: &mut dyn Write,
        element: &str,
        arrays: &[Array<'a>],
    ) -> io::Result<()> {
        writeln!(out, "<{element}>")?;
        for array in arrays {
            let kind = match array.values {
                Values::Number(_) => "Float64",
                Values::Index(_) => "Int64",
            };
            writeln!(
                out,
                "<DataArray type=\"{kind}\" Name=\"{}\" NumberOfComponents=\"{}\" \
                 format=\"appended\" offset=\"{}\"/>",
                array.name, array.components, self.offset
            )?;
            let block = array.bytes();
            self.offset += size_of::<u64>() + block.len();
            self.blocks.push(block);
        }
        writeln!(out, "</{element}>")
    }

    fn finish(self, out: &mut dyn Write) -> io::Result<()> {
        write!(out, "<AppendedData encoding=\"raw\">\n_")?;
        for block in self.blocks {
            out.write_all(&(block.len() as u64).to_le_bytes())?;
            out.write_all(block)?;
        }
        writeln!(out, "\n</AppendedData>\n</VTKFile>")
    }
}

fn begin(out: &mut dyn Write, kind: &str) -> io::Result<()> {
    writeln!(
        out,
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"{kind}\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">"
    )
}

/// Writes the map: one array a coil and quantity, named `gz_t_per_m_per_a_coil_0`, ...; fields have
/// three components, gradients nine (row by row).
///
/// # Errors
/// As [`write_image`].
pub(crate) fn write_map_image(out: &mut dyn Write, map: &MapArrays) -> io::Result<()> {
    let nodes = map.x_m.len() * map.y_m.len() * map.z_m.len();
    let mut arrays = Vec::new();
    for (name, components, values) in [
        (SIDES[0], 1, map.sides().map(|[x, _]| x)),
        (SIDES[1], 1, map.sides().map(|[_, y]| y)),
        ("gz_t_per_m_per_a", 1, Some(&*map.gz_t_per_m_per_a)),
        (
            "gradient_t_per_m_per_a",
            9,
            map.gradient_t_per_m_per_a.as_deref(),
        ),
        ("field_t_per_a", 3, map.field_t_per_a.as_deref()),
    ] {
        let blocks = values.unwrap_or_default().chunks_exact(nodes * components);
        let named = (map.coil.iter().zip(blocks))
            .map(|(coil, block)| Array::numbers(&format!("{name}_coil_{coil}"), components, block));
        arrays.extend(named);
    }
    let pull = map.passive_force_n.as_deref();
    arrays.extend(pull.map(|values| Array::numbers(PASSIVE, 1, values)));
    write_image(out, [&*map.x_m, &*map.y_m, &*map.z_m], &arrays)
}

/// Writes arrays on the nodes of a grid, x fastest, then y, then z; axes in m.
///
/// # Errors
/// The writer's; `InvalidData` for an axis whose nodes are not equally spaced.
pub fn write_image(out: &mut dyn Write, axes_m: [&[f64]; 3], arrays: &[Array]) -> io::Result<()> {
    let mut steps = [0.0; 3];
    for ((step, nodes), name) in steps.iter_mut().zip(axes_m).zip(["x_m", "y_m", "z_m"]) {
        *step = even_step(nodes).ok_or_else(|| {
            let message = format!("VTK ImageData needs equally spaced nodes, {name} has others");
            io::Error::new(io::ErrorKind::InvalidData, message)
        })?;
    }
    let extent = axes_m
        .map(|nodes| format!("0 {}", nodes.len() - 1))
        .join(" ");
    let [x, y, z] = axes_m.map(|nodes| nodes[0]);
    let [dx, dy, dz] = steps;
    begin(out, "ImageData")?;
    writeln!(
        out,
        "<ImageData WholeExtent=\"{extent}\" Origin=\"{x} {y} {z}\" Spacing=\"{dx} {dy} {dz}\">\n\
         <Piece Extent=\"{extent}\">"
    )?;
    let mut appended = Appended::default();
    appended.element(out, "PointData", arrays)?;
    writeln!(out, "</Piece>\n</ImageData>")?;
    appended.finish(out)
}

/// Writes points and polygons with the arrays of each.
///
/// # Errors
/// The writer's.
pub fn write_poly(
    out: &mut dyn Write,
    poly: &PolyData,
    of_points: &[Array],
    of_polygons: &[Array],
) -> io::Result<()> {
    begin(out, "PolyData")?;
    writeln!(
        out,
        "<PolyData>\n<Piece NumberOfPoints=\"{}\" NumberOfVerts=\"0\" NumberOfLines=\"0\" \
         NumberOfStrips=\"0\" NumberOfPolys=\"{}\">",
        poly.points_m.len(),
        poly.ends.len()
    )?;
    let mut appended = Appended::default();
    appended.element(out, "PointData", of_points)?;
    appended.element(out, "CellData", of_polygons)?;
    let points = Array::numbers("position_m", 3, poly.points_m.as_flattened());
    appended.element(out, "Points", &[points])?;
    let corners = Array::indices("connectivity", &poly.corners);
    let ends = Array::indices("offsets", &poly.ends);
    appended.element(out, "Polys", &[corners, ends])?;
    writeln!(out, "</Piece>\n</PolyData>")?;
    appended.finish(out)
}

/// The step of equally spaced nodes; 1 for a single node, whose step means nothing.
fn even_step(nodes: &[f64]) -> Option<f64> {
    let (first, last) = (nodes.first()?, nodes.last()?);
    if nodes.len() == 1 {
        return Some(1.0);
    }
    let step = (last - first) / (nodes.len() - 1) as f64;
    let even = nodes
        .iter()
        .enumerate()
        .all(|(i, node)| (node - (first + i as f64 * step)).abs() <= EVEN * (last - first));
    even.then_some(step)
}

#[cfg(test)]
mod tests {
    use super::even_step;

    #[test]
    fn only_equal_steps_have_a_step() {
        assert!((even_step(&[0.01, 0.035, 0.06]).unwrap() - 0.025).abs() < 1e-16);
        assert_eq!(even_step(&[0.7]), Some(1.0));
        assert_eq!(even_step(&[0.01, 0.036, 0.06]), None);
        assert_eq!(even_step(&[]), None);
    }
}
