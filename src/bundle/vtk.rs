//! Maps as VTK ImageData (`.vti`): XML head, arrays appended as raw little-endian bytes.
//!
//! One array a coil and quantity, named `gz_t_per_m_per_a_coil_0`, ...; fields have three
//! components, gradients nine (row by row). ParaView opens it.

use std::io::{self, Write};

use super::npz::{MapArrays, SIDES};

/// Steps of an axis may differ by this, relative to the axis' length.
const EVEN: f64 = 1e-9;

/// Writes the map.
///
/// # Errors
/// The writer's; `InvalidData` for an axis whose nodes are not equally spaced.
pub(crate) fn write_vti(out: &mut dyn Write, map: &MapArrays) -> io::Result<()> {
    let axes = [("x_m", &*map.x_m), ("y_m", &*map.y_m), ("z_m", &*map.z_m)];
    let mut steps = [0.0; 3];
    for (step, (name, nodes)) in steps.iter_mut().zip(axes) {
        *step = even_step(nodes).ok_or_else(|| {
            let message = format!("VTK ImageData needs equally spaced nodes, {name} has others");
            io::Error::new(io::ErrorKind::InvalidData, message)
        })?;
    }
    let extent: Vec<String> = axes
        .iter()
        .map(|(_, nodes)| format!("0 {}", nodes.len() - 1))
        .collect();
    let extent = extent.join(" ");
    let [x, y, z] = [map.x_m[0], map.y_m[0], map.z_m[0]];
    let [dx, dy, dz] = steps;
    writeln!(
        out,
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         <ImageData WholeExtent=\"{extent}\" Origin=\"{x} {y} {z}\" Spacing=\"{dx} {dy} {dz}\">\n\
         <Piece Extent=\"{extent}\">\n<PointData>"
    )?;
    let nodes = map.x_m.len() * map.y_m.len() * map.z_m.len();
    let mut arrays: Vec<&[f64]> = Vec::new();
    let mut offset = 0usize;
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
        for (&coil, block) in map.coil.iter().zip(blocks) {
            writeln!(
                out,
                "<DataArray type=\"Float64\" Name=\"{name}_coil_{coil}\" \
                 NumberOfComponents=\"{components}\" format=\"appended\" offset=\"{offset}\"/>"
            )?;
            offset += size_of::<u64>() + size_of_val(block);
            arrays.push(block);
        }
    }
    write!(
        out,
        "</PointData>\n</Piece>\n</ImageData>\n<AppendedData encoding=\"raw\">\n_"
    )?;
    for block in arrays {
        out.write_all(&(size_of_val(block) as u64).to_le_bytes())?;
        out.write_all(bytemuck::cast_slice(block))?;
    }
    writeln!(out, "\n</AppendedData>\n</VTKFile>")
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
