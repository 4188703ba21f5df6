//! Ctrl-C and the system's request to end (SIGTERM): the first asks the running job to stop, the
//! second ends the process.
//!
//! A job stops by itself within milliseconds wherever it polls. A guard ends the process where a
//! computation of another crate (a factorisation, a mesher) does not, or where nobody reads what it
//! puts into a pipe, but never while a file is being written: what is there is whole.
#![allow(clippy::exit)] // the guard's thread cannot return an exit code

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};
use std::thread;
use std::time::Duration;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use super::args::Common;
use super::bar;
use super::exit::Exit;
use super::failure::Failure;
use super::printer::Printer;
use crate::RunError;
use crate::bundle::atomic::{awaited_folder, is_writing};
use crate::progress::{Interrupted, finishing, stop_flag, stop_requested};

/// Whether a signal ends the process at once: it was signalled before, or no job polls.
static ENDS: LazyLock<Arc<AtomicBool>> = LazyLock::new(|| Arc::new(AtomicBool::new(true)));
/// Whether somebody has taken it on to report how the command ended.
static ENDED: AtomicBool = AtomicBool::new(false);

/// Pause between two looks of the guard.
const LOOK: Duration = Duration::from_millis(10);
/// Looks after a request to stop until the guard ends the process.
const PATIENCE: i32 = 10;
/// The same after work that runs to its end: half a second for whoever reads what it gave.
const PATIENCE_WITH_READERS: i32 = 50;
/// Said where the guard has to end the process.
const NO_POLL: &str = "the command did not stop by itself, at a computation or at an output that nobody \
                       reads: the process was ended";
/// Looks at another run's lock until the wait is reported: one second.
const SILENT_LOOKS: u32 = 100;

/// Listens from now on. Where the system does not allow it, a signal ends the process as ever:
/// files are written whole or not at all in any case.
pub fn listen(common: &Common) {
    let code = i32::from(Exit::Interrupted.code());
    for signal in [SIGINT, SIGTERM] {
        // They act in this order.
        let _ = flag::register_conditional_shutdown(signal, code, Arc::clone(&ENDS))
            .and_then(|_| flag::register(signal, stop_flag()))
            .and_then(|_| flag::register(signal, Arc::clone(&ENDS)));
    }
    // What `ulimit -f` forbids is then a write that fails, not the end of the process.
    #[cfg(unix)]
    let _ = flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
    let common = common.clone();
    thread::spawn(move || guard(&common));
}

/// From now on a job runs that polls for a stop.
pub fn working() {
    ENDS.store(stop_requested(), Ordering::SeqCst);
}

/// Takes it on to report how the command ended; waits for the process's end where the guard has.
pub fn end() {
    if ENDED.swap(true, Ordering::SeqCst) {
        loop {
            thread::park();
        }
    }
}

/// Reports waits for other runs, and ends the process where a job does not stop by itself.
fn guard(common: &Common) {
    let mut waits: (u32, Option<PathBuf>) = (0, None);
    let mut impatience = 0;
    loop {
        thread::sleep(LOOK);
        let folder = awaited_folder();
        waits = match folder {
            Some(folder) if waits.1.as_ref() == Some(&folder) => (waits.0 + 1, Some(folder)),
            other => (0, other),
        };
        if let (SILENT_LOOKS, Some(folder)) = &waits {
            Printer::new(common)
                .notice(&format!("waiting for another run in {}", folder.display()));
        }
        // What a stopped job still writes comes first.
        impatience = match finishing() {
            true => PATIENCE - PATIENCE_WITH_READERS,
            false => impatience + i32::from(stop_requested()),
        };
        if impatience > PATIENCE && !is_writing() {
            if ENDED.swap(true, Ordering::SeqCst) {
                return;
            }
            let _held = bar::hold();
            let printer = Printer::new(common);
            printer.erase_line();
            printer.warning(NO_POLL);
            printer.failure(&Failure::Job(RunError::Interrupted(Interrupted)));
            std::process::exit(i32::from(Exit::Interrupted.code()));
        }
    }
}
