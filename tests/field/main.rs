//! Fields of coils, steel and magnets: against oracles by other formulations, closed forms and physics.

mod air_coil;
mod bh_curve;
mod core_field;
mod iron;
mod iron_bodies;
mod iron_closed_forms;
mod iron_joined;
mod iron_large;
mod iron_passive;
mod magnet;
mod passive;
mod saturated;
mod steel;
