//! All of `tests/crash.rs` at length, with the figures as a table.
//!
//! ```text
//! cargo bench --locked --bench crash_safety -- [KILLS] [--seed 1]
//! ```
//!
//! KILLS (500) runs are killed with SIGKILL at random moments, shared out among `calibrate`,
//! `sweep run` and `map`, and a tenth of that among the other commands that write; every call that
//! changes files is struck once in each way. Ends with an error at the first run that left something
//! behind that it must not.

// A measurement: it reads the clock, prints and ends with a code.
#![allow(clippy::print_stdout, clippy::disallowed_methods, clippy::exit)]

#[cfg(unix)]
mod disk;
#[cfg(unix)]
mod kill;
#[cfg(unix)]
mod place;
#[cfg(unix)]
mod scenario;
#[cfg(unix)]
mod table;
#[cfg(unix)]
mod together;

#[cfg(not(unix))]
fn main() {
    println!("skipped: signals and permissions are those of Unix");
}

#[cfg(unix)]
fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|arg| arg != "--bench").collect();
    let after = |name: &str| args.iter().position(|arg| arg == name).map(|at| at + 1);
    let seed = after("--seed").and_then(|at| args.get(at)?.parse().ok()).unwrap_or(1);
    let kills = args.first().and_then(|arg| arg.parse().ok()).unwrap_or(500);
    let mut all = unix::All::new(kills, seed);
    let outcome = all.run();
    println!("{}", table::markdown(&all.rows));
    for reason in &all.skipped {
        println!("skipped: {reason}");
    }
    if let Err(told) = outcome {
        println!("failed: {told}");
        std::process::exit(1);
    }
}

#[cfg(unix)]
mod unix {
    use crate::disk::{Somebody, file_limit, small_disk};
    use crate::kill::{How, Strike, at_random};
    use crate::place::Dice;
    use crate::scenario::{MAIN, MORE, Prepared};
    use crate::table::Row;
    use crate::together::{RIVALS, asked_to_stop, other_inputs, same_inputs};

    /// What is done and what came of it so far.
    pub struct All {
        kills: usize,
        dice: Dice,
        pub rows: Vec<Row>,
        pub skipped: Vec<String>,
    }

    impl All {
        pub fn new(kills: usize, seed: u64) -> Self {
            Self {
                kills,
                dice: Dice::new(seed),
                rows: Vec::new(),
                skipped: Vec::new(),
            }
        }

        pub fn run(&mut self) -> Result<(), String> {
            let strike = Strike::new();
            let somebody = Somebody::new();
            let disturbed = self.kills.div_ceil(50).max(2);
            for (scenarios, kills) in [(MAIN, self.kills), (MORE, self.kills / 10)] {
                for (number, scenario) in scenarios.iter().enumerate() {
                    let prepared = Prepared::new(scenario)?;
                    let part = |n: usize| kills * n / scenarios.len();
                    let kills = part(number + 1) - part(number);
                    let name = |told: String| format!("{}: {told}", scenario.name);
                    let row = at_random(&prepared, kills, &mut self.dice).map_err(name)?;
                    self.rows.push(row);
                    if let Ok(strike) = &strike {
                        for how in [How::Kill, How::Full, How::Denied, How::Broken] {
                            let row = strike.at_every(&prepared, how, 1, &mut self.dice);
                            self.rows.push(row.map_err(name)?);
                        }
                    }
                    match small_disk(&prepared, disturbed, &mut self.dice) {
                        Err(reason) if reason.starts_with("no disk") => self.skip(reason),
                        row => self.rows.push(row.map_err(name)?),
                    }
                    let row = file_limit(&prepared, disturbed, &mut self.dice);
                    self.rows.push(row.map_err(name)?);
                    if let Ok(somebody) = &somebody {
                        let row = somebody.closed(&prepared, disturbed, &mut self.dice);
                        self.rows.push(row.map_err(name)?);
                    }
                    let row = asked_to_stop(&prepared, 2 * disturbed, &mut self.dice);
                    self.rows.push(row.map_err(name)?);
                    let row = same_inputs(&prepared, disturbed, &mut self.dice);
                    self.rows.push(row.map_err(name)?);
                }
            }
            for rivals in RIVALS {
                let row = other_inputs(rivals, 2 * disturbed, &mut self.dice);
                self.rows.push(row.map_err(|told| format!("{}: {told}", rivals.name))?);
            }
            for reason in [strike.err(), somebody.err()].into_iter().flatten() {
                self.skip(reason);
            }
            Ok(())
        }

        fn skip(&mut self, reason: String) {
            if !self.skipped.contains(&reason) {
                self.skipped.push(reason);
            }
        }
    }
}
