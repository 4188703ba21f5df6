//! Calibration files of mag_manip, ETH Zurich's runtime for magnetic manipulation: the field on
//! nodes (its `ForwardModelLinearVField`) and multipole sources (its `ForwardModelMPEM`), as YAML.
//!
//! Keys are padded with zeros because that runtime takes coils in the order of their names.

use std::io::{self, Write};

use super::number::push_number;

/// How every such file begins: what distinguishes ours from others'.
pub(super) const HEAD: &str = "# fluxform ";

/// The field per ampere on equally spaced nodes, as many along every axis: mag_manip 3.0.0 finds
/// its way through the list only then.
#[derive(Debug, Clone)]
pub struct VectorField<'a> {
    /// Name of the design.
    pub name: &'a str,
    /// First and last node along x, y and z, m.
    pub ends_m: [[f64; 2]; 3],
    /// Nodes along each axis.
    pub nodes: usize,
    /// T/A, [coil, z, y, x, 3].
    pub field_t_per_a: &'a [f64],
}

/// Terms of one source: P_n(cos t) / r^(n+1), n = 1, 2, ..., as scalar potential.
#[derive(Debug, Clone, PartialEq)]
pub struct MultipoleSource<'a> {
    /// m.
    pub position_m: [f64; 3],
    /// Unit vector.
    pub direction: [f64; 3],
    /// T m^(n+2) / A, from n = 1 on.
    pub coefficients: &'a [f64],
}

/// The sources of every coil.
#[derive(Debug, Clone)]
pub struct Multipoles<'a> {
    /// Name of the design.
    pub name: &'a str,
    /// From, to along x, y and z, m.
    pub workspace_m: [[f64; 2]; 3],
    /// Coil by coil.
    pub coils: Vec<Vec<MultipoleSource<'a>>>,
}

/// Digits that the largest index below `count` needs.
fn width(count: usize) -> usize {
    count.saturating_sub(1).max(1).ilog10() as usize + 1
}

fn push_list(text: &mut Vec<u8>, values: &[f64]) {
    text.push(b'[');
    for (k, value) in values.iter().enumerate() {
        if k > 0 {
            text.extend_from_slice(b", ");
        }
        push_number(text, *value);
    }
    text.extend_from_slice(b"]\n");
}

fn line(text: &mut Vec<u8>, start: &str, values: &[f64]) {
    text.extend_from_slice(start.as_bytes());
    push_list(text, values);
}

/// Writes the field on nodes: x slowest, z fastest.
///
/// # Errors
/// The writer's.
pub(crate) fn write_vector_field(out: &mut dyn Write, field: &VectorField) -> io::Result<()> {
    let n = field.nodes;
    let whole = 3 * n * n * n;
    let coils = field.field_t_per_a.len() / whole.max(1);
    writeln!(
        out,
        "{HEAD}map for mag_manip: B per ampere, T/A, lengths in m; x slowest, z fastest\n\
         name: \"{}\"\nvfields:",
        field.name
    )?;
    let width = width(coils);
    let mut text = Vec::new();
    for (coil, values) in field.field_t_per_a.chunks_exact(whole).enumerate() {
        writeln!(out, "  coil_{coil:0width$}:")?;
        for (axis, [from, to]) in ["x", "y", "z"].iter().zip(field.ends_m) {
            text.clear();
            text.extend_from_slice(format!("    dim_{axis}: {n}\n    min_{axis}: ").as_bytes());
            push_number(&mut text, from);
            text.extend_from_slice(format!("\n    max_{axis}: ").as_bytes());
            push_number(&mut text, to);
            text.push(b'\n');
            out.write_all(&text)?;
        }
        writeln!(out, "    data:")?;
        for x in 0..n {
            text.clear();
            for y in 0..n {
                for z in 0..n {
                    let first = 3 * ((z * n + y) * n + x);
                    line(&mut text, "    - ", &values[first..first + 3]);
                }
            }
            out.write_all(&text)?;
        }
    }
    Ok(())
}

/// Writes the sources. A source holds terms inside (A, rising with the distance) or outside (B,
/// falling with it): the list of the kind that it does not hold is null.
///
/// # Errors
/// The writer's.
pub(crate) fn write_multipoles(out: &mut dyn Write, model: &Multipoles) -> io::Result<()> {
    writeln!(
        out,
        "{HEAD}multipoles for mag_manip: per ampere, lengths in m, fields in T\n\
         System_Name: \"{}\"\nWorkspace_Dimensions:",
        model.name
    )?;
    let mut text = Vec::new();
    for ends in &model.workspace_m {
        line(&mut text, "  - ", ends);
    }
    let coil_width = width(model.coils.len());
    let list = |stem: &str, count: usize, width: usize| {
        let names: Vec<String> = (0..count).map(|k| format!("{stem}{k:0width$}")).collect();
        format!("[{}]\n", names.join(", "))
    };
    text.extend_from_slice(b"Coil_List: ");
    text.extend_from_slice(list("Coil_", model.coils.len(), coil_width).as_bytes());
    for (coil, sources) in model.coils.iter().enumerate() {
        let width = width(sources.len());
        let names = list("Src_", sources.len(), width);
        let head = format!("Coil_{coil:0coil_width$}:\n  Source_List: {names}");
        text.extend_from_slice(head.as_bytes());
        for (k, source) in sources.iter().enumerate() {
            let head = format!("  Src_{k:0width$}:\n    A_Coeff: ~\n");
            text.extend_from_slice(head.as_bytes());
            line(&mut text, "    B_Coeff: ", source.coefficients);
            line(&mut text, "    Source_Direction: ", &source.direction);
            line(&mut text, "    Source_Position: ", &source.position_m);
        }
    }
    out.write_all(&text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> String {
        let mut out = Vec::new();
        write(&mut out).unwrap();
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn nodes_are_listed_x_slowest() {
        // B_x shows x, B_y shows y, B_z shows z.
        let mut values = Vec::new();
        for (z, y, x) in [0, 1, 2]
            .iter()
            .flat_map(|z| (0..3).flat_map(move |y| (0..3).map(move |x| (*z, y, x))))
        {
            values.extend([f64::from(x), f64::from(y) + 0.5, f64::from(z) * 0.1]);
        }
        let field = VectorField {
            name: "d-1",
            ends_m: [[-0.05, 0.05], [-0.04, 0.0], [0.01, 0.08]],
            nodes: 3,
            field_t_per_a: &values,
        };
        let text = text(|out| write_vector_field(out, &field));
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[1..5],
            ["name: \"d-1\"", "vfields:", "  coil_0:", "    dim_x: 3"]
        );
        assert_eq!(lines[5..7], ["    min_x: -0.05", "    max_x: 0.05"]);
        assert_eq!(
            lines[14..18],
            [
                "    - [0, 0.5, 0]",
                "    - [0, 0.5, 0.1]",
                "    - [0, 0.5, 0.2]",
                "    - [0, 1.5, 0]"
            ]
        );
        assert_eq!(lines.len(), 14 + 27);
    }

    #[test]
    fn every_source_names_the_kind_it_lacks() {
        let source = MultipoleSource {
            position_m: [0.01, -0.02, -0.013],
            direction: [0.0, 0.6, 0.8],
            coefficients: &[1.3e-7, -2e-9],
        };
        let model = Multipoles {
            name: "d",
            workspace_m: [[-0.05, 0.05], [-0.04, 0.0], [0.01, 0.08]],
            coils: vec![vec![source; 11]; 2],
        };
        let text = text(|out| write_multipoles(out, &model));
        assert!(text.contains("Coil_List: [Coil_0, Coil_1]\nCoil_0:\n  Source_List: [Src_00, "));
        let block = "  Src_10:\n    A_Coeff: ~\n    B_Coeff: [1.3e-7, -2e-9]\n    \
                     Source_Direction: [0, 0.6, 0.8]\n    Source_Position: [0.01, -0.02, -0.013]\n";
        assert_eq!(text.matches(block).count(), 2);
    }
}
