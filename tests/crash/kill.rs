//! SIGKILL at random moments, and right before each call that changes files.

use std::path::PathBuf;
use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use crate::changes::{after_changes, changes};
use crate::scenario::{Found, Prepared};
use crate::table::Row;
use fluxform_testing::{Random, inputs::OUT, place::Place, run::Ran};

/// Kills until `expected` runs have been killed; half of the moments are spread evenly over the run, half lie
/// close behind a change in its folder.
pub fn at_random(prepared: &Prepared, expected: usize, random: &mut Random) -> Result<Row, String> {
    let mut row = Row::new(prepared.scenario.name, "SIGKILL at a random moment");
    let changed = {
        let place = prepared.fresh();
        let mut child = place.spawn(prepared.scenario.args);
        let changed = changes(&place.path(OUT), &mut child);
        child.wait().unwrap();
        changed.max(1)
    };
    for attempt in 0..3 * expected {
        if row.struck == expected {
            break;
        }
        let place = prepared.fresh();
        let began = Instant::now();
        let mut child = place.spawn(prepared.scenario.args);
        if attempt % 2 == 0 {
            let moment = Duration::from_secs_f64(random.unit() * prepared.seconds);
            sleep(moment.saturating_sub(began.elapsed()));
        } else {
            after_changes(&place.path(OUT), &mut child, 1 + random.below(changed));
            sleep(Duration::from_secs_f64(0.002 * random.unit()));
        }
        child.kill().unwrap();
        let ran = Ran::of(child.wait_with_output().unwrap());
        row.struck += usize::from(ran.code.is_none());
        let found = prepared.survived(&place)?;
        found.no_bundle_is_absent()?;
        row.add(found);
    }
    Ok(row)
}

/// A program that runs another and strikes at its n-th call that changes files.
pub struct Strike {
    program: PathBuf,
    _folder: Place,
}

/// Where to strike.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum How {
    /// SIGKILL.
    Kill,
    /// From here on the disk is full.
    Full,
    /// From here on the folder may not be changed.
    Denied,
    /// This one call fails with an I/O error.
    Broken,
    /// SIGKILL; renames alone count.
    Renames,
    /// As before, where no two names can change places.
    Plain,
}

impl How {
    fn mode(self) -> &'static str {
        match self {
            Self::Kill => "kill",
            Self::Full => "full",
            Self::Denied => "denied",
            Self::Broken => "broken",
            Self::Renames => "renames",
            Self::Plain => "plain",
        }
    }

    fn reported(self) -> &'static str {
        match self {
            Self::Kill => "SIGKILL before the n-th call that changes files",
            Self::Full => "disk full from the n-th call on",
            Self::Denied => "folder closed from the n-th call on",
            Self::Broken => "I/O error in the n-th call",
            Self::Renames => "SIGKILL before the n-th rename",
            Self::Plain => "SIGKILL before the n-th rename, without exchange",
        }
    }
}

impl Strike {
    /// Compiles it; the reason where that cannot be done or tracing is not allowed.
    pub fn new() -> Result<Self, String> {
        if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
            return Err("calls are traced on Linux on x86-64 only".to_owned());
        }
        let folder = Place::empty();
        let program = folder.path("strike");
        let source = fluxform_testing::root().join("tests/crash/strike.c");
        let made = Command::new("cc")
            .args(["-O1", "-o"])
            .arg(&program)
            .arg(source)
            .status();
        match made {
            Ok(status) if status.success() => {}
            Ok(_) => return Err("cc cannot compile tests/crash/strike.c here".to_owned()),
            Err(_) => return Err("no C compiler (cc)".to_owned()),
        }
        let strike = Self {
            program,
            _folder: folder,
        };
        let (ran, calls) = strike.run(&Place::empty(), "count", i64::MAX, &["--version"]);
        match (ran.code, calls) {
            (Some(0), Some(_)) => Ok(strike),
            _ => Err("the system does not allow tracing another process".to_owned()),
        }
    }

    fn run(&self, place: &Place, mode: &str, at: i64, args: &[&str]) -> (Ran, Option<usize>) {
        let log = place.path("calls");
        let mut command = Command::new(&self.program);
        command
            .arg(&log)
            .args([mode, &at.to_string()])
            .arg(fluxform_testing::run::program())
            .args(args);
        place.at_home(&mut command);
        let ran = Ran::of(command.output().unwrap());
        let calls = std::fs::read_to_string(log).ok();
        (ran, calls.and_then(|text| text.trim().parse().ok()))
    }

    /// How many calls of `prepared` may be struck that way.
    pub fn calls(&self, prepared: &Prepared, how: How) -> Result<usize, String> {
        let mode = match how {
            How::Renames | How::Plain => how.mode(),
            _ => "count",
        };
        let (ran, calls) = self.run(&prepared.fresh(), mode, i64::MAX, prepared.scenario.args);
        ran.ended_with(&[0])?;
        calls.ok_or_else(|| "nobody counted the calls".to_owned())
    }

    /// Strikes at every `every`-th call, the first at a random one.
    pub fn at_every(
        &self,
        prepared: &Prepared,
        how: How,
        every: usize,
        random: &mut Random,
    ) -> Result<Row, String> {
        let first = 1 + random.below(every);
        let calls: Vec<usize> = (first..=self.calls(prepared, how)?)
            .step_by(every)
            .collect();
        let outcome = |at: usize| -> Result<(bool, Found), String> {
            let place = prepared.fresh();
            let (ran, _) = self.run(&place, how.mode(), at as i64, prepared.scenario.args);
            let found = self.judged(prepared, how, &place, &ran);
            let found =
                found.map_err(|reported| format!("call {at}, {}: {reported}", how.mode()))?;
            Ok((ran.code != Some(0), found))
        };
        // Each in a folder of its own.
        let outcomes: Vec<_> = calls.into_par_iter().map(outcome).collect();
        let mut row = Row::new(prepared.scenario.name, how.reported());
        for outcome in outcomes {
            let (struck, found) = outcome?;
            row.struck += usize::from(struck);
            row.add(found);
        }
        Ok(row)
    }

    fn judged(
        &self,
        prepared: &Prepared,
        how: How,
        place: &Place,
        ran: &Ran,
    ) -> Result<Found, String> {
        match how {
            // Threads may have done a little more, or all of it.
            How::Kill | How::Renames | How::Plain => ran.ended_with(&[137, 0])?,
            // A failed write to the cache is silent: the next run computes the value again.
            How::Full | How::Denied | How::Broken => ran.ended_with(&[4, 0])?,
        }
        if ran.code == Some(4) {
            let words = match how {
                How::Full => "disk is full",
                How::Denied => "read-only",
                _ => "cannot",
            };
            if !ran.err.contains(words) {
                return Err(format!("does not say {words:?}: {}", ran.err));
            }
        }
        let found = prepared.survived(place)?;
        if how != How::Plain {
            found.no_bundle_is_absent()?;
        }
        // A folder stays put aside where after the exchange not even the way back is free.
        if how == How::Full && found.temporary + found.empty_folders > 0 {
            return Err(format!("left temporary files: {ran:?}"));
        }
        Ok(found)
    }
}
