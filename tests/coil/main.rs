//! What a coil's circuit does: against direct integration and limits.

mod transient;
