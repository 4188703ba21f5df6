//! Memory that triangles and points take, held against what a run may take as soon as their number is known.

use std::fmt::Display;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Bytes that a surface and its points may take; everything unless [`grant`] was called.
static GRANTED: AtomicU64 = AtomicU64::new(u64::MAX);

/// Bytes of a triangle with its places in the index and the certificate, and of so many of them those that a finer
/// index takes more: the peak of `discretize` at 0.1, 0.5, 2 and 8 million triangles, to a fifth.
const TRIANGLE_BYTES: u64 = 305;
const FINE_INDEX_BYTES: u64 = 185;
const FINELY_INDEXED: u64 = 1 << 20;
/// Bytes of a constraint point, with its row of a table.
pub const POINT_BYTES: f64 = 320.0;

/// Grants each surface of this process, and its points, so many bytes.
pub fn grant(bytes: u64) {
    GRANTED.store(bytes, Relaxed);
}

/// Checks a surface of so many triangles before they are made.
///
/// # Errors
/// More bytes than granted, and what to do.
pub(crate) fn check(triangles: u64) -> Result<(), String> {
    let advice = "export the surface coarser (an image with fewer pixels)";
    within(
        bytes_of(triangles) as f64,
        format_args!("its {triangles} triangles"),
        advice,
    )
}

/// Checks what would take so many `bytes`.
///
/// # Errors
/// More than granted, and what to do: `advice`, or a larger grant.
pub fn within(bytes: f64, what: impl Display, advice: &str) -> Result<(), String> {
    let granted = GRANTED.load(Relaxed) as f64;
    if bytes <= granted {
        return Ok(());
    }
    Err(format!(
        "{what} would take about {:.0} MB of memory, and this run may take {:.0} MB: {advice}, or grant more with \
         --memory {:.0}MB",
        bytes / 1e6,
        (granted / 1e6).floor(),
        (1.1 * bytes / 1e6).ceil(),
    ))
}

/// Memory that so many triangles take, bytes.
pub(crate) fn bytes_of(triangles: u64) -> u64 {
    let fine = FINE_INDEX_BYTES * triangles.min(FINELY_INDEXED);
    triangles
        .saturating_mul(TRIANGLE_BYTES)
        .saturating_add(fine)
}

#[cfg(test)]
mod tests {
    use super::bytes_of;

    #[test]
    fn the_peaks_that_were_measured_are_met() {
        for (triangles, peak) in [
            (100_352, 52e6),
            (500_000, 254e6),
            (2_000_000, 802e6),
            (8_000_000, 2.65e9),
        ] {
            let ratio = bytes_of(triangles) as f64 / peak;
            assert!((0.9..1.2).contains(&ratio), "{triangles}: {ratio}");
        }
        assert!(bytes_of(u64::MAX) == u64::MAX);
    }
}
