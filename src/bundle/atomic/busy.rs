//! The process's current write or wait, so that a request to stop never cuts a write in two.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use fluxform_base::progress::poll;

/// Writers at work.
static WRITERS: AtomicUsize = AtomicUsize::new(0);
/// The folder whose lock another process holds.
static AWAITED: Mutex<Option<PathBuf>> = Mutex::new(None);
/// Pause between two attempts at a lock.
const PAUSE: Duration = Duration::from_millis(20);

/// Held while files are being made or put in place.
#[derive(Debug)]
pub(super) struct Writing(());

impl Writing {
    pub(super) fn begin() -> Self {
        WRITERS.fetch_add(1, Ordering::SeqCst);
        Self(())
    }
}

impl Drop for Writing {
    fn drop(&mut self) {
        WRITERS.fetch_sub(1, Ordering::SeqCst);
    }
}

/// True while a file or folder is being made or put in place: ending the process now would leave a
/// temporary file, which the next run clears.
#[must_use]
pub fn is_writing() -> bool {
    WRITERS.load(Ordering::SeqCst) > 0
}

/// The folder for whose lock this process is waiting, held by another run.
#[must_use]
pub fn awaited_folder() -> Option<PathBuf> {
    awaited().clone()
}

fn awaited() -> std::sync::MutexGuard<'static, Option<PathBuf>> {
    AWAITED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Locks the opened `folder` and polls for a stop while another run holds it. False where the
/// system knows no locks.
pub(super) fn lock(handle: &File, folder: &Path) -> bool {
    /// Withdraws the notice, on unwinding too.
    struct Notice;
    impl Drop for Notice {
        fn drop(&mut self) {
            *awaited() = None;
        }
    }
    let mut notice = None;
    loop {
        match handle.try_lock() {
            Ok(()) => return true,
            Err(TryLockError::Error(_)) => return false,
            Err(TryLockError::WouldBlock) => {}
        }
        if notice.is_none() {
            *awaited() = Some(folder.to_path_buf());
            notice = Some(Notice);
        }
        poll();
        std::thread::sleep(PAUSE);
    }
}
