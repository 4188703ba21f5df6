//! Measuring the program itself: what it costs and whether it holds at the limits.

pub mod extreme;
