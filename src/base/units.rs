//! Physical constants with their sources, and the millimetre border.

use std::f64::consts::PI;

/// Vacuum permeability, T m/A: 4 pi 1e-7 exactly (CODATA 2022 lies 1.3e-10 lower, relatively).
pub const MU_0_T_M_PER_A: f64 = 4.0e-7 * PI;

/// Temperature coefficient of copper's resistivity at 20 C, 1/K (IEC 60028).
pub const COPPER_TEMPERATURE_COEFFICIENT_PER_K: f64 = 3.93e-3;

/// Temperature at which a design file states the resistivity, C.
pub const REFERENCE_TEMPERATURE_C: f64 = 20.0;

/// Density of annealed copper at 20 C, kg/m^3 (IEC 60028).
pub const COPPER_DENSITY_KG_PER_M3: f64 = 8890.0;

/// Specific heat of copper at 20 C, J/(kg K) (handbooks: 383 to 387).
pub const COPPER_HEAT_CAPACITY_J_PER_KG_K: f64 = 385.0;

/// Specific heat of low-carbon steel, J/(kg K) (handbooks: 450 to 490).
pub const STEEL_HEAT_CAPACITY_J_PER_KG_K: f64 = 460.0;

/// Smallest force a finger feels, N (Burdea 1999).
pub const DETECTION_THRESHOLD_N: f64 = 0.8e-3;

/// Force below which differences are harder to notice, N, and by how much (introduction of Scientific
/// Reports 2022, s41598-022-12010-0: 7 to 10 % above, 15 to 27 % below).
pub const FAINT_FORCE_N: f64 = 0.5;
/// See [`FAINT_FORCE_N`].
pub const FAINT_FORCE_JND: [f64; 2] = [0.15, 0.27];

/// Just-noticeable relative difference of finger force, of 2.5 to 10 N (Pang, Tan and Durlach 1991).
pub const FORCE_JND: f64 = 0.07;

/// Change of the remanence of sintered NdFeB with temperature, 1/K (0.11 to 0.12 % in makers' data sheets,
/// 20 to 100 C).
pub const MAGNET_COEFFICIENT_PER_K: f64 = -1.2e-3;

/// Just-noticeable difference between directions of force on a finger, degrees (Barbagli, Salisbury, Ho,
/// Spence and Tan 2006: 25 to 32 degrees, whatever the direction).
pub const DIRECTION_JND_DEG: f64 = 25.0;

/// Millimetres to metres. The quotient is correctly rounded: 38 mm is the double nearest 0.038.
#[must_use]
pub fn m_from_mm(length_mm: f64) -> f64 {
    length_mm / 1000.0
}

/// Density of low-carbon steel, kg/m^3 (7.85 to 7.87 g/cm^3 in handbooks).
pub const STEEL_DENSITY_KG_PER_M3: f64 = 7870.0;
