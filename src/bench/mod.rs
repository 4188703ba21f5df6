//! Error against run time.

pub mod clock;
