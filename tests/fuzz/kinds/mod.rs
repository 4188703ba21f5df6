//! Every kind of input but surfaces, which `surfaces.rs` has: seeds, damage, reading, limits.

pub mod bundle;
pub mod kept;
pub mod sweep;
pub mod texts;

use crate::harness::{Kind, Limits};

const MIB: f64 = 1_048_576.0;

/// The limits of all kinds. CONTRIBUTING's table repeats them.
pub const fn limits(bytes_per_byte: f64, mib: f64) -> Limits {
    Limits {
        seconds_per_mb: 2.0,
        seconds: 2.0,
        bytes_per_byte,
        bytes: mib * MIB,
    }
}

pub fn all() -> Vec<Kind> {
    let mut kinds = texts::kinds();
    kinds.extend(sweep::kinds());
    kinds.push(bundle::kind());
    kinds.push(kept::kind());
    kinds
}

/// A refusal must name the file and fit on a screen or two.
pub fn refusal(words: &str, file: &str) -> Result<bool, String> {
    if !words.contains(file) {
        return Err(format!("a refusal without the file's name: {words}"));
    }
    if words.len() > 50_000 {
        return Err(format!("a refusal of {} bytes", words.len()));
    }
    Ok(false)
}

/// An accepted value holds finite numbers alone, as `Debug` prints it.
pub fn finite(reported: &str) -> Result<(), String> {
    for (at, _) in reported
        .match_indices("NaN")
        .chain(reported.match_indices("inf"))
    {
        let before = reported[..at].chars().next_back().unwrap_or(' ');
        let after = reported[at + 3..].chars().next().unwrap_or(' ');
        if " [(-".contains(before) && ",)]} \n".contains(after) {
            let around: String = reported[..at].chars().rev().take(60).collect();
            let around: String = around.chars().rev().collect();
            return Err(format!(
                "accepted, but not finite: {around}{}",
                &reported[at..at + 3]
            ));
        }
    }
    Ok(())
}
