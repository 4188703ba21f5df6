//! Ctrl-C: the first asks the running job to stop, the second ends the process.

use std::sync::atomic::{AtomicBool, Ordering};

use super::exit::Exit;

static WORKING: AtomicBool = AtomicBool::new(false);
static ASKED: AtomicBool = AtomicBool::new(false);

/// Listens from now on. Where the system does not allow it, Ctrl-C ends the process as ever:
/// files are written whole or not at all in any case.
pub fn listen() {
    let _ = ctrlc::set_handler(|| {
        let again = ASKED.swap(true, Ordering::SeqCst);
        if again || !WORKING.load(Ordering::SeqCst) {
            end();
        }
    });
}

#[allow(clippy::exit)] // asked twice, or waiting for input: nobody is left to return to
fn end() -> ! {
    std::process::exit(i32::from(Exit::Interrupted.code()))
}

/// From now on a job runs that looks at [`asked`].
pub fn working() {
    WORKING.store(true, Ordering::SeqCst);
}

/// Whether the user asked to stop.
pub fn asked() -> bool {
    ASKED.load(Ordering::SeqCst)
}
