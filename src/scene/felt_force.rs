//! The vertical force that a runtime reads off a map.

use crate::map::FieldMap;
use crate::numerics::lagrange::locate;

/// The force of `currents_a`, one per coil of the array, on a magnet of this moment at `place_m`, N,
/// as the map interpolates it; `None` outside the map.
#[must_use]
pub fn by_map(
    map: &FieldMap,
    moment_a_m2: [f64; 3],
    currents_a: &[f64],
    place_m: [f64; 3],
) -> Option<f64> {
    let nodes = map.x_m.len() * map.y_m.len() * map.z_m.len();
    let cell = locate([&map.x_m, &map.y_m, &map.z_m], place_m)?;
    let [m_x, m_y, m_z] = moment_a_m2;
    let forces = map.coils.iter().enumerate().map(|(at, coil)| {
        let gz = cell.value(&map.gz_t_per_m_per_a[at * nodes..(at + 1) * nodes]);
        let mut force = m_z * gz;
        if let Some(gradient) = &map.gradient_t_per_m_per_a {
            let own = &gradient[9 * at * nodes..9 * (at + 1) * nodes];
            force += m_x * cell.component(own, 9, 2) + m_y * cell.component(own, 9, 5);
        }
        currents_a[*coil] * force
    });
    Some(forces.sum())
}
