//! Memory that a surface's triangles take, held against what a run may take as soon as their number is known.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Bytes that the triangles of a surface may take; everything unless [`grant`] was called.
static GRANTED: AtomicU64 = AtomicU64::new(u64::MAX);

/// Bytes of a triangle with its places in the index and the certificate, and of so many of them those that a finer
/// index takes more: the peak of `discretize` at 2, 8 and 32 million triangles, to a fifth.
const TRIANGLE_BYTES: u64 = 200;
const FINE_INDEX_BYTES: u64 = 120;
const FINELY_INDEXED: u64 = 1 << 22;

/// Grants the surfaces of this process so many bytes each.
pub fn grant(bytes: u64) {
    GRANTED.store(bytes, Relaxed);
}

/// Checks a surface of so many triangles before they are made.
///
/// # Errors
/// More bytes than granted, and what to do.
pub(crate) fn check(triangles: u64) -> Result<(), String> {
    let (bytes, granted) = (bytes_of(triangles), GRANTED.load(Relaxed));
    if bytes <= granted {
        return Ok(());
    }
    let million = |count: u64| count as f64 / 1e6;
    Err(format!(
        "its {triangles} triangles would take about {:.0} MB of memory, and this run may take {:.0} MB: export the \
         surface coarser (an image with fewer pixels), or grant more with --memory {:.0}MB",
        million(bytes),
        million(granted).floor(),
        million(bytes + bytes / 10).ceil(),
    ))
}

fn bytes_of(triangles: u64) -> u64 {
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
        for (triangles, peak) in [(1_996_002, 643e6), (7_992_002, 2.19e9)] {
            let ratio = bytes_of(triangles) as f64 / peak;
            assert!((0.9..1.2).contains(&ratio), "{triangles}: {ratio}");
        }
        assert!(bytes_of(u64::MAX) == u64::MAX);
    }
}
