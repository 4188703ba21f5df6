//! One run of the program with its processor time and its memory.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use fluxform_testing::run::program_or_other;

use crate::linux::{CPU_SECONDS, MEMORY_KIB};

/// How a run ended.
pub struct Measured {
    /// `None` where a signal ended it.
    pub code: Option<i32>,
    /// Processor time, s, in hundredths.
    pub seconds: f64,
    /// The most memory that it was seen to hold, KiB.
    pub kib: u64,
    /// Its output, on both streams.
    pub said: String,
}

/// Runs the program, or that named by `FLUXFORM_OTHER`, on one thread.
pub fn measured(place: &Path, words: &[&str]) -> Measured {
    let bounds =
        format!("ulimit -c 0; ulimit -t {CPU_SECONDS}; ulimit -v {MEMORY_KIB}; exec \"$0\" \"$@\"");
    let log = place.join("said.log");
    let file = fs::File::create(&log).unwrap();
    let mut child = Command::new("sh")
        .args(["-c", &bounds])
        .arg(program_or_other())
        .args(words)
        .args(["--threads", "1"])
        .current_dir(place)
        .env_remove("NO_COLOR")
        .stdin(Stdio::null())
        .stdout(file.try_clone().unwrap())
        .stderr(file)
        .spawn()
        .unwrap();
    let facts = |name: &str| fs::read_to_string(format!("/proc/{}/{name}", child.id()));
    let mut kib = 0;
    let seconds = loop {
        let status = facts("status").unwrap_or_default();
        kib = kib.max(number_after(&status, "VmHWM:"));
        // A process that ended keeps its times until it is waited for.
        let stat = facts("stat").unwrap_or_default();
        let after_name = stat.rsplit(") ").next().unwrap_or("");
        let words: Vec<&str> = after_name.split(' ').collect();
        if words.first().is_none_or(|state| *state == "Z") {
            let ticks = |at: usize| words.get(at).and_then(|word| word.parse().ok());
            break (ticks(11).unwrap_or(0.0) + ticks(12).unwrap_or(0.0)) / 100.0;
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    let code = child.wait().unwrap().code();
    let said = String::from_utf8_lossy(&fs::read(&log).unwrap()).into_owned();
    Measured {
        code,
        seconds,
        kib,
        said,
    }
}

fn number_after(text: &str, label: &str) -> u64 {
    let rest = text.split(label).nth(1).unwrap_or("");
    let word = rest.split_whitespace().next().unwrap_or("");
    word.parse().unwrap_or(0)
}
