//! Ctrl-C and the system's request to end (SIGTERM): the first asks the running job to stop, the
//! second ends the process.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use super::exit::Exit;

static ASKED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
/// Whether a signal ends the process at once: it was asked before, or no job looks at [`asked`].
static ENDS: LazyLock<Arc<AtomicBool>> = LazyLock::new(|| Arc::new(AtomicBool::new(true)));

/// Listens from now on. Where the system does not allow it, a signal ends the process as ever:
/// files are written whole or not at all in any case.
pub fn listen() {
    let code = i32::from(Exit::Interrupted.code());
    for signal in [SIGINT, SIGTERM] {
        // They act in this order.
        let _ = flag::register_conditional_shutdown(signal, code, Arc::clone(&ENDS))
            .and_then(|_| flag::register(signal, Arc::clone(&ASKED)))
            .and_then(|_| flag::register(signal, Arc::clone(&ENDS)));
    }
}

/// From now on a job runs that looks at [`asked`].
pub fn working() {
    ENDS.store(asked(), Ordering::SeqCst);
}

/// Whether the user asked to stop.
pub fn asked() -> bool {
    ASKED.load(Ordering::SeqCst)
}
