//! Maps of fields over a workspace: against direct evaluation.

mod harmonic;
mod mean;
mod tabulation;
