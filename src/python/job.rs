//! A computation beside Python: the interpreter goes on, Ctrl-C stops it, progress is reported.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;

use fluxform::RunError;
use fluxform::cli::failure::Failure;
use fluxform::cli::shell::{Bar, Watch};
use fluxform::progress::{Progress, interruptible, request_stop, withdraw_stop};

use super::failure::{internal, raised};

/// Pause between two looks at Python's signals.
const LOOK: Duration = Duration::from_millis(50);

/// One computation.
pub(crate) struct Job {
    /// Called with the stage's name, items done and items in all.
    progress: Option<Py<PyAny>>,
}

impl Job {
    pub(crate) fn new(progress: Option<Py<PyAny>>) -> Self {
        Self { progress }
    }

    /// Runs `work` on a thread of its own and returns its result. An exception of Python's (Ctrl-C is
    /// one) stops it.
    pub(crate) fn wait<T: Send>(
        &self,
        py: Python,
        work: impl FnOnce(Watch, &Bar) -> T + Send,
    ) -> PyResult<T> {
        let watch = Watch::default();
        let bar = Bar::new(false);
        watch.follow(&bar);
        thread::scope(|scope| {
            let (done, finished) = channel();
            let seen = watch.clone();
            let bar = &bar;
            let worker = scope.spawn(move || {
                let result = work(watch, bar);
                // Whoever waits may have been called away.
                let _ = done.send(());
                result
            });
            let mut stopped = None;
            // The receiver stays here: only its waits are without the interpreter.
            let mut finished = finished;
            loop {
                let (back, waited) = py.detach(move || {
                    let waited = finished.recv_timeout(LOOK);
                    (finished, waited)
                });
                finished = back;
                match waited {
                    Ok(()) | Err(RecvTimeoutError::Disconnected) => break,
                    Err(RecvTimeoutError::Timeout) => {}
                }
                if stopped.is_none()
                    && let Err(error) = self.look(py, &seen)
                {
                    request_stop();
                    stopped = Some(error);
                }
            }
            let result = worker.join();
            if let Some(error) = stopped {
                withdraw_stop();
                return Err(error);
            }
            result.map_err(|panic| {
                let message = panic.downcast_ref::<String>().map(String::as_str);
                let message = message.or_else(|| panic.downcast_ref::<&str>().copied());
                internal(py, message.unwrap_or("an internal error"))
            })
        })
    }

    /// As [`Job::wait`], for work of the library; its failure is raised.
    pub(crate) fn result<T: Send>(
        &self,
        py: Python,
        work: impl FnOnce(&dyn Progress) -> Result<T, RunError> + Send,
    ) -> PyResult<T> {
        let ran = self.wait(py, |_, bar| {
            interruptible(|| work(bar)).unwrap_or_else(|stop| Err(stop.into()))
        })?;
        ran.map_err(|error| raised(py, &Failure::Job(error), None))
    }

    /// Reports progress and lets Python answer signals.
    fn look(&self, py: Python, watch: &Watch) -> PyResult<()> {
        py.check_signals()?;
        if let (Some(progress), Some(stage)) = (&self.progress, watch.stage()) {
            progress.call1(py, stage)?;
        }
        Ok(())
    }
}
