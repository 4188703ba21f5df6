//! A bundle says some things twice: for people, for C programs, for spreadsheets. They must agree.

use serde::Serialize;

use super::array_check::LARGEST;
use super::artefact::{NAME_BYTES, is_name};
use super::lambda_file::LambdaFile;
use super::manifest::{AxisSummary, INTERPOLATION, Manifest};
use super::npz::{MapArrays, PASSIVE, SIDES};
use super::rendering::HeightGrid;
use super::table::{CurrentRow, PointRow};

/// Points and axes' ends may differ by this from what the manifest says, relative to the largest
/// coordinate: the files hold the numbers themselves.
const ON_GRID: f64 = 1e-9;

/// Checks a bundle's parts against each other.
///
/// # Errors
/// The first contradiction, as a sentence.
pub(super) fn check(
    manifest: &Manifest,
    map: &MapArrays,
    points: &[PointRow],
    currents: &[CurrentRow],
    lambda: &LambdaFile,
) -> Result<(), String> {
    check_names(manifest)?;
    check_errors(manifest)?;
    check_coils(manifest, map)?;
    check_map(manifest, map)?;
    check_points(manifest, points)?;
    let coils = manifest.array.positions_m.len();
    same(
        "currents.csv has as many rows as there are coils",
        currents.len(),
        coils,
    )?;
    for (row, position) in currents.iter().zip(&manifest.array.positions_m) {
        same(
            "currents.csv and the array agree on the coils' positions",
            [row.x_m, row.y_m],
            *position,
        )?;
    }
    same(
        "lambda.json and the manifest agree on lambda",
        lambda.lambda_n_per_m,
        manifest.lambda.lambda_n_per_m,
    )?;
    if let Some(want) = &lambda.currents_a {
        let found: Vec<f64> = currents.iter().map(|row| row.current_a).collect();
        same("currents.csv and lambda.json agree", &found, want)?;
    }
    check_rendering(manifest, map, points, currents)
}

/// Entries that `map.npz` repeats for runtimes that read nothing else.
fn check_rendering(
    manifest: &Manifest,
    map: &MapArrays,
    points: &[PointRow],
    currents: &[CurrentRow],
) -> Result<(), String> {
    // Both came with schema 1.2.
    let Some(rendering) = &map.runtime.rendering else {
        return if manifest.circuit.is_some() || manifest.force.is_some() {
            Err(
                "map.npz lacks what position feedback needs (height_x_m and the arrays after it)"
                    .to_owned(),
            )
        } else {
            Ok(())
        };
    };
    let of_points = HeightGrid::of_points(&manifest.points, points);
    same(
        "map.npz and points.csv agree on the heights",
        of_points.is_some_and(|of_points| rendering.heights.goes_through(&of_points)),
        true,
    )?;
    let fixed: Vec<f64> = currents.iter().map(|row| row.current_a).collect();
    same(
        "map.npz and currents.csv agree",
        &rendering.static_current_a,
        &fixed,
    )?;
    let circuit = manifest.circuit.as_ref();
    same(
        "map.npz and the manifest agree on inductance_h",
        Some(rendering.inductance_h.as_slice()),
        circuit.map(|c| c.inductance_h.concat()).as_deref(),
    )?;
    let requested = rendering.requested.as_ref();
    same(
        "map.npz and the manifest agree on the requested force",
        requested.map(|requested| requested.sideways_weight),
        manifest.force.as_ref().map(|force| force.sideways_weight),
    )?;
    same(
        "map.npz and the manifest agree on voltage_v",
        rendering.voltage_v,
        circuit.and_then(|c| c.voltage_v),
    )
}

/// Stated errors are multiplied with forces and currents.
fn check_errors(manifest: &Manifest) -> Result<(), String> {
    let map = &manifest.map;
    let stages = manifest.accuracy.values().map(|stage| stage.estimate);
    let passive = map.passive_force.as_ref();
    let passive = passive.map(|p| [p.interpolation.largest_error, p.largest_n]);
    let stated = stages
        .chain([map.interpolation.largest_error])
        .chain(map.sides.iter().flat_map(|sides| sides.largest_error))
        .chain(passive.into_iter().flatten());
    for number in stated {
        if number.abs() > LARGEST {
            return Err(format!(
                "errors in accuracy and map must be below {LARGEST:e}, found {number:e}"
            ));
        }
    }
    Ok(())
}

/// Names are printed for people and on terminals.
fn check_names(manifest: &Manifest) -> Result<(), String> {
    let names = [
        ("design", &manifest.design),
        ("shape", &manifest.shape),
        ("fluxform_version", &manifest.fluxform_version),
    ];
    let paths = manifest.inputs.iter().map(|input| ("inputs", &input.path));
    for (key, name) in names.into_iter().chain(paths) {
        if !is_name(name) {
            let shown: String = name.chars().take(40).collect();
            return Err(format!(
                "{key} must be a name of at most {NAME_BYTES} bytes without control characters, \
                 found {shown:?}"
            ));
        }
    }
    Ok(())
}

fn check_coils(manifest: &Manifest, map: &MapArrays) -> Result<(), String> {
    let coils = manifest.array.positions_m.len();
    let limits = &manifest.limits;
    let runtime = &map.runtime;
    same("there is one gain a coil", manifest.array.gain.len(), coils)?;
    same(
        "there is one upper limit a coil",
        limits.current_max_a.len(),
        coils,
    )?;
    same(
        "map.npz and the manifest agree on current_max_a",
        &runtime.current_max_a,
        &limits.current_max_a,
    )?;
    same(
        "map.npz and the manifest agree on current_min_a",
        &runtime.current_min_a,
        &limits.current_min_a,
    )?;
    same(
        "map.npz and the manifest agree on total_current_max_a",
        runtime.total_current_max_a,
        limits.total_current_max_a,
    )?;
    same(
        "map.npz and the manifest agree on resistance_ohm",
        &runtime.resistance_ohm,
        &manifest.resistance_ohm,
    )?;
    same(
        "map.npz and the manifest agree on moment_a_m2",
        runtime.moment_a_m2,
        manifest.magnet.moment_a_m2,
    )?;
    same(
        "map.npz and the manifest agree on lambda",
        runtime.lambda_n_per_m,
        manifest.lambda.lambda_n_per_m,
    )?;
    if let Some(circuit) = &manifest.circuit {
        let square = circuit.inductance_h.iter().all(|row| row.len() == coils);
        same(
            "circuit.inductance_h has a row and a column a coil",
            (circuit.inductance_h.len(), square),
            (coils, true),
        )?;
    }
    if let Some(point) = &manifest.map.working_point {
        same(
            "map.working_point has one current a coil",
            point.currents_a.len(),
            coils,
        )?;
    }
    let tilted = runtime.moment_a_m2[..2].iter().any(|&part| part != 0.0);
    if tilted && map.gradient_t_per_m_per_a.is_none() {
        return Err("a tilted magnet needs gradient_t_per_m_per_a in map.npz".to_owned());
    }
    Ok(())
}

fn check_map(manifest: &Manifest, map: &MapArrays) -> Result<(), String> {
    let summary = &manifest.map;
    for (name, nodes, axis) in [
        ("x_m", &map.x_m, summary.x_m),
        ("y_m", &map.y_m, summary.y_m),
        ("z_m", &map.z_m, summary.z_m),
    ] {
        let found = AxisSummary::of_nodes(nodes);
        let near = ON_GRID * found.from_m.abs().max(found.to_m.abs());
        let ends = (found.from_m - axis.from_m)
            .abs()
            .max((found.to_m - axis.to_m).abs());
        if found.samples != axis.samples || ends > near {
            let words = |axis: AxisSummary| {
                let AxisSummary {
                    from_m,
                    to_m,
                    samples,
                } = axis;
                format!("from {from_m} to {to_m} with {samples} samples")
            };
            return Err(format!(
                "map.npz has {name} {}, the manifest {}",
                words(found),
                words(axis)
            ));
        }
    }
    same(
        "map.npz and the manifest agree on coil",
        &*map.coil,
        summary.coil.as_slice(),
    )?;
    same(
        "map.npz has a passive_force_n that the manifest does not mention",
        map.passive_force_n.is_some(),
        summary.passive_force.is_some(),
    )?;
    same(
        "map.npz has gx and gy where the manifest states them",
        map.sides_t_per_m_per_a.is_some(),
        summary.sides.is_some(),
    )?;
    if let Some(sides) = &summary.sides {
        same(
            "the arrays of the sideways force are known",
            sides.arrays.each_ref().map(String::as_str),
            SIDES,
        )?;
    }
    if let Some(passive) = &summary.passive_force {
        same(
            "the passive force's array is known",
            passive.array.as_str(),
            PASSIVE,
        )?;
        same(
            "the interpolation of the passive force is known",
            passive.interpolation.name.as_str(),
            INTERPOLATION,
        )?;
    }
    same(
        "the interpolation is known",
        summary.interpolation.name.as_str(),
        INTERPOLATION,
    )
}

fn check_points(manifest: &Manifest, points: &[PointRow]) -> Result<(), String> {
    let grid = &manifest.points;
    let flags = grid
        .flags()
        .ok_or("points.present does not fit points.x_m, y_m and count")?;
    same(
        "points.csv has as many rows as points.count and points.graded",
        points.len(),
        grid.count.saturating_add(grid.graded),
    )?;
    let (x, y) = (grid.x_m.axis(), grid.y_m.axis());
    let near = ON_GRID * (x.to - x.from).abs().max((y.to - y.from).abs());
    let present = flags.iter().enumerate().filter(|(_, flag)| **flag);
    for (row, (point, (node, _))) in points.iter().zip(present).enumerate() {
        let want = [x.node(node % x.samples), y.node(node / x.samples)];
        if (point.x_m - want[0]).abs() > near || (point.y_m - want[1]).abs() > near {
            let found = [point.x_m, point.y_m];
            return Err(format!(
                "row {row} of points.csv is at {found:?}, its grid node at {want:?}"
            ));
        }
    }
    Ok(())
}

fn same<T: PartialEq + Serialize>(rule: &str, found: T, want: T) -> Result<(), String> {
    if found == want {
        return Ok(());
    }
    let short = |value: &T| match serde_json::to_string(value).as_deref() {
        Ok("null") | Err(_) => "nothing".to_owned(),
        Ok(text) => text.chars().take(120).collect(),
    };
    Err(format!(
        "expected that {rule}; found {} and {}",
        short(&found),
        short(&want)
    ))
}

#[cfg(test)]
mod tests {
    use super::same;

    #[test]
    fn contradictions_are_stated_in_values() {
        let found = |found: Option<f64>, want| same("both agree", found, want).unwrap_err();
        let message = found(Some(0.137), None);
        assert_eq!(message, "expected that both agree; found 0.137 and nothing");
        let list = same("both agree", [0.5, 3.0], [0.5, -1e-7]).unwrap_err();
        assert_eq!(
            list,
            "expected that both agree; found [0.5,3.0] and [0.5,-1e-7]"
        );
    }
}
