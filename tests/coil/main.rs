//! A coil's circuit against direct integration and limits.

mod transient;
