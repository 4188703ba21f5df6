//! The measurements themselves: rows fall along their knobs, tables and JSON are as promised, and
//! what stages claim of their errors holds on scenes that nobody chose.

#[path = "bench/command.rs"]
mod command;
#[path = "bench/coverage.rs"]
mod coverage;
#[path = "bench/rows.rs"]
mod rows;

#[path = "lambda/case.rs"]
#[allow(dead_code)]
mod case;
#[path = "lambda/search.rs"]
#[allow(dead_code)]
mod search;
