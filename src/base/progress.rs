//! How the core reports its progress, and how it learns that it should stop.
//!
//! Work that holds a [`Progress`] asks it between its items. Kernels far below a job hold none:
//! they call [`poll`], which costs one load of an atomic flag and, once [`request_stop`] was called,
//! leaves the computation by unwinding up to the enclosing [`interruptible`]. Unwinding passes
//! through `rayon`'s tasks, drops what was being made (temporary files among it) and needs no error
//! in the signature of a function that has none.
//!
//! The flag is the process's, because a kernel may run on any thread: while any computation is
//! [`interruptible`], a stop ends all that the process computes. Otherwise [`poll`] does nothing.
//!
//! ```
//! use fluxform_base::progress::{self, Interrupted};
//!
//! let stopped = progress::interruptible(|| {
//!     progress::request_stop(); // as a rule from another thread, or by a signal
//!     loop {
//!         progress::poll();
//!     }
//! });
//! assert_eq!(stopped, Err::<(), _>(Interrupted));
//! progress::withdraw_stop();
//! assert_eq!(progress::interruptible(|| 7), Ok(7));
//! ```

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock};

/// Whether a stop is requested.
static STOP: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
/// Computations inside [`interruptible`].
static INTERRUPTIBLE: AtomicUsize = AtomicUsize::new(0);
/// Computations inside [`to_its_end`].
static TO_ITS_END: AtomicUsize = AtomicUsize::new(0);
/// Work inside [`for_a_reader`].
static FOR_A_READER: AtomicUsize = AtomicUsize::new(0);

/// Counts work while it runs, on unwinding too.
struct Counted(&'static AtomicUsize);

impl Counted {
    fn begin(count: &'static AtomicUsize) -> Self {
        count.fetch_add(1, Ordering::SeqCst);
        Self(count)
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

/// The process's request to stop, for who sets it from a signal's handler: true to stop.
#[must_use]
pub fn stop_flag() -> Arc<AtomicBool> {
    Arc::clone(&STOP)
}

/// Asks every [`interruptible`] computation of this process to stop.
pub fn request_stop() {
    STOP.store(true, Ordering::SeqCst);
}

/// Takes the request to stop back, so that new computations run.
pub fn withdraw_stop() {
    STOP.store(false, Ordering::SeqCst);
}

/// Whether a stop is requested.
#[must_use]
pub fn stop_requested() -> bool {
    STOP.load(Ordering::Relaxed)
}

/// Leaves the computation where a stop is requested and one is [`interruptible`]; kernels
/// call this at least every few milliseconds.
#[inline]
pub fn poll() {
    if stop_requested() {
        leave();
    }
}

/// Tasks, at most, of a parallel loop over many cheap items.
const MOST_TASKS: usize = 1024;

/// Items that a task of a parallel loop over `count` cheap items takes at least, for `with_min_len`: every task
/// that meets a stop unwinds, which takes longer than thousands of items, so there must not be many.
#[must_use]
pub const fn items_a_task(count: usize) -> usize {
    count / MOST_TASKS + 1
}

#[cold]
fn leave() {
    // A destructor that runs while the thread unwinds must not unwind again.
    let leaves = INTERRUPTIBLE.load(Ordering::SeqCst) > 0;
    let stays = TO_ITS_END.load(Ordering::SeqCst) > 0;
    if leaves && !stays && !std::thread::panicking() {
        // No panic: the hook is not called, so nothing is printed.
        resume_unwind(Box::new(Interrupted));
    }
}

/// Runs `work`, which is short, to its end although a stop is requested: what an interrupted computation
/// still answers. [`poll`] does nothing meanwhile.
///
/// ```
/// use fluxform_base::progress;
///
/// let answered = progress::interruptible(|| {
///     progress::request_stop();
///     progress::to_its_end(|| {
///         progress::poll();
///         7
///     })
/// });
/// assert_eq!(answered, Ok(7));
/// assert!(progress::interruptible(progress::poll).is_err());
/// ```
pub fn to_its_end<T>(work: impl FnOnce() -> T) -> T {
    let _counted = Counted::begin(&TO_ITS_END);
    work()
}

/// Runs `work`, a part of what runs [`to_its_end`], that somebody else may never let come to its end, such as
/// the reader of a pipe: [`poll`] does nothing, but the process may be ended meanwhile ([`finishing`]).
///
/// ```
/// use fluxform_base::progress::{finishing, for_a_reader, to_its_end};
///
/// to_its_end(|| {
///     assert!(finishing());
///     for_a_reader(|| assert!(!finishing()));
///     assert!(finishing());
/// });
/// ```
pub fn for_a_reader<T>(work: impl FnOnce() -> T) -> T {
    let _counted = Counted::begin(&FOR_A_READER);
    work()
}

/// Whether work is being run [`to_its_end`] and not [`for_a_reader`].
#[must_use]
pub fn finishing() -> bool {
    TO_ITS_END.load(Ordering::SeqCst) > 0 && FOR_A_READER.load(Ordering::SeqCst) == 0
}

/// Runs `work` so that [`poll`] can end it.
///
/// # Errors
/// [`Interrupted`] where a stop ended it. Panics of `work` go on as they are.
pub fn interruptible<T>(work: impl FnOnce() -> T) -> Result<T, Interrupted> {
    INTERRUPTIBLE.fetch_add(1, Ordering::SeqCst);
    let result = catch_unwind(AssertUnwindSafe(work));
    INTERRUPTIBLE.fetch_sub(1, Ordering::SeqCst);
    result.map_err(pass_on)
}

/// [`Interrupted`] where that is what `panic` holds; goes on unwinding otherwise. Whoever else
/// catches panics passes on an interruption with [`pass_interruption`].
fn pass_on(panic: Box<dyn Any + Send>) -> Interrupted {
    match panic.downcast::<Interrupted>() {
        Ok(interrupted) => *interrupted,
        Err(panic) => resume_unwind(panic),
    }
}

/// For code that catches panics: goes on unwinding where `panic` is an interruption.
pub fn pass_interruption(panic: &(dyn Any + Send)) {
    if panic.is::<Interrupted>() {
        resume_unwind(Box::new(Interrupted));
    }
}

/// Receives progress from the core. The core never prints and never reads a clock.
pub trait Progress: Sync {
    /// A stage begins; `total` is its number of work items.
    fn begin(&self, _stage: &str, _total: u64) {}
    /// `items` more work items of the current stage are finished.
    fn advance(&self, _items: u64) {}
    /// A search has found a better value than any reported before, in this SI unit; `x` is a factor.
    fn improved(&self, _value: f64, _unit: &'static str) {}
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
