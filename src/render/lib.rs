//! Pictures and pages: [`plot`] draws figures, [`report`] makes self-contained pages.

pub mod plot;
pub mod report;
