//! How the core tells of its progress, and learns that it should stop.

/// Receives progress from the core. The core never prints and never reads a clock.
pub trait Progress: Sync {
    /// A stage begins; `total` is its number of work items.
    fn begin(&self, _stage: &str, _total: u64) {}
    /// `items` more work items of the current stage are finished.
    fn advance(&self, _items: u64) {}
    /// A search has found a better value than any told before, in its own SI unit.
    fn improved(&self, _value: f64) {}
    /// The current stage is finished.
    fn end(&self) {}
    /// True when the user asked to stop: the core returns [`Interrupted`] soon.
    fn interrupted(&self) -> bool {
        false
    }
    /// `Err` when the user asked to stop.
    ///
    /// # Errors
    /// [`Interrupted`].
    fn check(&self) -> Result<(), Interrupted> {
        if self.interrupted() {
            Err(Interrupted)
        } else {
            Ok(())
        }
    }
    /// Seconds spent in each stage since the last call, in order; empty where nobody measures.
    fn take_seconds(&self) -> Vec<(String, f64)> {
        Vec::new()
    }
}

/// The user asked to stop; what was finished is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Interrupted;

/// Hears nothing and never stops anything.
#[derive(Debug, Default, Clone, Copy)]
pub struct Silent;

impl Progress for Silent {}
