//! Tabulation over the workspace and its error.
//!
//! [`tabulate()`] makes the maps of identical coils on a grid; [`interpolation_error`] says how far
//! interpolation between the nodes is off, with the rule that every loader of bundles uses
//! ([`fluxform_numerics::lagrange`]).
//!
//! ```
//! use fluxform_field::winding::Winding;
//! use fluxform_map::{Components, Grid, PlacedCoil, interpolation_error, tabulate};
//! use fluxform_numerics::lagrange::locate;
//! use fluxform_base::progress::Silent;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let winding =
//!     Winding { inner_radius_m: 0.006, outer_radius_m: 0.015, length_m: 0.04, turns: 700.0 };
//! let coils = [PlacedCoil { number: 0, axis_m: [0.004, -0.007], gain: 1.0 }];
//! let nodes = |from: f64, to: f64, n: usize| -> Vec<f64> {
//!     (0..n).map(|i| from + (to - from) * i as f64 / (n - 1) as f64).collect()
//! };
//! let grid =
//!     Grid { x_m: nodes(-0.02, 0.02, 31), y_m: nodes(-0.02, 0.02, 31), z_m: nodes(0.01, 0.03, 17) };
//! let map = tabulate(&winding, &coils, &grid, Components::Gz, 1e-9, &Silent)?;
//!
//! // Between the nodes the map is off by no more than what is claimed.
//! let gz = &map.gz_t_per_m_per_a;
//! let claimed = interpolation_error(&winding, &coils, &grid, gz, 1e-9)?;
//! let place = [0.0093_f64, 0.0021, 0.0131];
//! let cell = locate([&grid.x_m, &grid.y_m, &grid.z_m], place).ok_or("outside the map")?;
//! let r_m = (place[0] - 0.004).hypot(place[1] + 0.007);
//! let exact = winding.field(r_m, place[2])?.dbz_dz;
//! let on_axis = winding.field(0.0, place[2])?.dbz_dz.abs();
//! assert!((cell.value(gz) - exact).abs() < 2.0 * claimed.largest * on_axis);
//! assert!(claimed.largest < 1e-3);
//! # Ok(())
//! # }
//! ```

pub mod catmull_rom;
pub mod coupled_map;
pub mod harmonic;
pub mod interpolation;
pub mod map_source;
pub mod mean;
pub mod multipole;
pub mod multipole_fit;
pub mod radii;
pub mod tabulate;

pub use interpolation::{
    InterpolationError, error_scale, interpolation_error, interpolation_errors_by,
};
pub use tabulate::{Components, FieldMap, Grid, MapError, PlacedCoil, tabulate};
