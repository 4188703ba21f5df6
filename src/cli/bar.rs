//! The progress bar, and the seconds of every stage: the only clock of a job.
#![allow(clippy::disallowed_methods)] // a bar needs a clock

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::quantity::{force, si};
use crate::progress::{Progress, stop_requested};

/// Stages that end sooner are never drawn.
const DELAY: Duration = Duration::from_millis(500);
/// Time between two drawings.
const REFRESH: Duration = Duration::from_millis(100);

/// Held while a bar is drawn or cleared.
static DRAWING: Mutex<()> = Mutex::new(());

/// No bar is drawn or cleared while this is held: what is printed meanwhile stays.
pub fn hold() -> MutexGuard<'static, ()> {
    DRAWING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Draws the current stage once it has lasted half a second, and measures every stage.
#[derive(Debug)]
pub struct Bar {
    shared: Arc<Shared>,
    painter: Option<JoinHandle<()>>,
}

/// Shows another thread how far the running job is.
#[derive(Debug, Clone, Default)]
pub struct Watch(Arc<Mutex<Weak<Shared>>>);

impl Watch {
    /// Looks at the job of `bar` from now on.
    pub fn follow(&self, bar: &Bar) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Arc::downgrade(&bar.shared);
    }

    /// The innermost stage, how many of its items are done, and how many there are.
    #[must_use]
    pub fn stage(&self) -> Option<(String, u64, u64)> {
        let job = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let shared = job.upgrade()?;
        let state = shared.lock();
        let stage = state.stages.last()?;
        Some((stage.name.clone(), stage.done, stage.total))
    }
}

#[derive(Debug, Default)]
struct Shared {
    state: Mutex<State>,
    finished: Condvar,
}

#[derive(Debug, Default)]
struct State {
    /// Stages that have begun; the innermost is last.
    stages: Vec<Stage>,
    /// Stages that ended, with their seconds.
    seconds: Vec<(String, f64)>,
    drawn: Option<ProgressBar>,
    finished: bool,
    /// The best value that a search has found.
    best: Option<String>,
}

#[derive(Debug)]
struct Stage {
    name: String,
    total: u64,
    done: u64,
    began: Instant,
}

impl Bar {
    /// A bar on stderr where `visible`; otherwise stages are measured and nothing is drawn.
    #[must_use]
    pub fn new(visible: bool) -> Self {
        let shared = Arc::new(Shared::default());
        let painter = visible.then(|| {
            let shared = Arc::clone(&shared);
            thread::spawn(move || shared.paint())
        });
        Self { shared, painter }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.shared.lock().finished = true;
        self.shared.finished.notify_all();
        if let Some(painter) = self.painter.take() {
            // A painter that panicked has been reported; the result does not depend on it.
            let _ = painter.join();
        }
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        // Nothing under the lock leaves the state half changed.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn paint(&self) {
        let mut state = self.lock();
        while !state.finished {
            state.draw();
            state = match self.finished.wait_timeout(state, REFRESH) {
                Ok((state, _)) => state,
                Err(poisoned) => poisoned.into_inner().0,
            };
        }
        state.clear();
    }
}

impl State {
    fn draw(&mut self) {
        let Some(stage) = self.stages.last().filter(|s| s.began.elapsed() >= DELAY) else {
            return;
        };
        let _drawing = hold();
        let (name, elapsed) = (&stage.name, stage.began.elapsed());
        let message = if stop_requested() {
            format!("{name} (stopping)")
        } else {
            match &self.best {
                Some(best) => format!("{name} {best}"),
                None => name.clone(),
            }
        };
        let bar = self.drawn.get_or_insert_with(|| {
            let bar = ProgressBar::hidden();
            bar.set_style(style(stage.total));
            bar.with_elapsed(elapsed)
        });
        bar.set_message(message);
        if stage.total > 1 {
            let done = stage.done.min(stage.total);
            bar.set_length(stage.total);
            bar.set_position(done);
            let left = left(elapsed, done, stage.total);
            bar.set_prefix(format!("{}{left}", rate(elapsed, done, stage.total)));
        }
        // Shown last: the first drawing is whole.
        if bar.is_hidden() {
            bar.set_draw_target(ProgressDrawTarget::stderr());
        }
        bar.tick();
    }

    fn clear(&mut self) {
        if let Some(bar) = self.drawn.take() {
            let _drawing = hold();
            bar.finish_and_clear();
        }
    }
}

/// How many of how many, and how many a second.
fn rate(elapsed: Duration, done: u64, total: u64) -> String {
    let a_second = done as f64 / elapsed.as_secs_f64().max(1e-3);
    let digits = usize::from(a_second < 10.0);
    format!(", {done} of {total}, {a_second:.digits$}/s")
}

/// The time left, if it goes on as it went.
fn left(elapsed: Duration, done: u64, total: u64) -> String {
    if done == 0 {
        return String::new();
    }
    let seconds = elapsed.as_secs_f64() * (total - done) as f64 / done as f64;
    match seconds.ceil() as u64 {
        s @ 0..120 => format!(", {s} s left"),
        s @ 120..7200 => format!(", {} min left", s.div_ceil(60)),
        s => format!(", {} h left", s.div_ceil(3600)),
    }
}

fn style(total: u64) -> ProgressStyle {
    let template = if total > 1 {
        "{msg:20} [{bar:30}] {percent:>3} %{prefix}"
    } else {
        "{msg:20} {spinner} {elapsed}"
    };
    ProgressStyle::with_template(template)
        .unwrap_or_else(|_| ProgressStyle::default_bar())
        .progress_chars("=> ")
}

impl Progress for Bar {
    fn begin(&self, stage: &str, total: u64) {
        let mut state = self.shared.lock();
        state.clear();
        state.stages.push(Stage {
            name: stage.to_owned(),
            total,
            done: 0,
            began: Instant::now(),
        });
    }

    fn advance(&self, items: u64) {
        if let Some(stage) = self.shared.lock().stages.last_mut() {
            stage.done += items;
        }
    }

    fn improved(&self, value: f64, unit: &'static str) {
        let shown = match unit {
            "x" => format!("x {value:.4}"),
            "N" => force(value),
            unit => si(value, unit),
        };
        self.shared.lock().best = Some(shown);
    }

    fn end(&self) {
        let mut state = self.shared.lock();
        state.clear();
        if let Some(stage) = state.stages.pop() {
            let seconds = stage.began.elapsed().as_secs_f64();
            state.seconds.push((stage.name, seconds));
        }
    }

    fn interrupted(&self) -> bool {
        stop_requested()
    }

    fn take_seconds(&self) -> Vec<(String, f64)> {
        std::mem::take(&mut self.shared.lock().seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_are_measured_in_the_order_of_their_ends() {
        let bar = Bar::new(false);
        bar.begin("outer", 4);
        bar.begin("inner", 2);
        bar.advance(2);
        bar.end();
        bar.advance(4);
        bar.end();
        let seconds = bar.take_seconds();
        let names: Vec<&str> = seconds.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["inner", "outer"]);
        assert!(seconds[0].1 <= seconds[1].1);
        assert!(bar.take_seconds().is_empty());
    }

    /// A bar that is cleared later would erase what was printed.
    #[test]
    fn regression_a_held_bar_is_not_cleared() {
        let mut state = State {
            drawn: Some(ProgressBar::hidden()),
            ..State::default()
        };
        let held = hold();
        let (cleared, is_cleared) = std::sync::mpsc::channel();
        let painter = thread::spawn(move || {
            state.clear();
            cleared.send(()).unwrap();
        });
        assert!(is_cleared.recv_timeout(REFRESH).is_err());
        drop(held);
        painter.join().unwrap();
        assert!(is_cleared.recv().is_ok());
    }

    #[test]
    fn the_rate_is_per_second() {
        let second = Duration::from_secs(1);
        assert_eq!(rate(7 * second, 910, 10_000), ", 910 of 10000, 130/s");
        assert_eq!(rate(10 * second, 13, 20), ", 13 of 20, 1.3/s");
    }

    #[test]
    fn the_time_left_is_in_proportion() {
        let second = Duration::from_secs(1);
        assert_eq!(left(second, 0, 7), "");
        assert_eq!(left(7 * second, 7, 20), ", 13 s left");
        assert_eq!(left(70 * second, 7, 40), ", 6 min left");
        assert_eq!(left(700 * second, 1, 14), ", 3 h left");
    }

    #[test]
    fn an_unmatched_end_is_no_matter() {
        let bar = Bar::new(false);
        bar.end();
        bar.advance(3);
        assert!(bar.take_seconds().is_empty());
    }
}
