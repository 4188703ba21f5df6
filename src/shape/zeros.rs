//! Holes in files: long runs of zeros, which a copy that broke off leaves.

/// No surface file holds so many zeros in a row, bytes: a copy that broke off leaves them, and so
/// does a file that is longer than what was written to it.
const LONGEST_HOLE: u64 = 16 << 20;

/// Looks for holes in a file that is read piece by piece.
#[derive(Default)]
pub(super) struct Zeros {
    seen: u64,
    run: u64,
}

impl Zeros {
    /// Sees the next piece; false where a hole is too long.
    pub(super) fn see(&mut self, piece: &[u8]) -> bool {
        self.seen += piece.len() as u64;
        match piece.iter().rposition(|byte| *byte != 0) {
            None => self.run += piece.len() as u64,
            Some(last) => self.run = (piece.len() - 1 - last) as u64,
        }
        self.run < LONGEST_HOLE
    }

    /// Where the hole is, and what to do.
    pub(super) fn what(&self) -> String {
        format!(
            "from byte {} on there are zeros alone: the copy or the download broke off; copy it \
             again",
            self.seen - self.run
        )
    }
}
