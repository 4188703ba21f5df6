//! All of `tests/crash.rs` at length, with the figures as a table.
//!
//! ```text
//! cargo bench --locked --bench crash_safety -- [KILLS] [--seed 1]
//! ```
//!
//! KILLS (500) runs are killed with SIGKILL at random moments, shared out among `calibrate`,
//! `sweep run` and `map`, and a tenth of that among the other commands that write; a
//! kill comes before every call that changes files, and every third of them fails in each way. Ends with an error where a run left something behind
//! that it must not.

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
    let args: Vec<String> = std::env::args()
        .skip(1)
        .filter(|arg| arg != "--bench")
        .collect();
    let after = |name: &str| args.iter().position(|arg| arg == name).map(|at| at + 1);
    let seed = after("--seed")
        .and_then(|at| args.get(at)?.parse().ok())
        .unwrap_or(1);
    let kills = args.first().and_then(|arg| arg.parse().ok()).unwrap_or(500);
    let mut all = unix::All::new(kills, seed);
    all.run();
    println!("\n{}", table::markdown(&all.rows));
    for reason in &all.skipped {
        println!("skipped: {reason}");
    }
    for told in &all.failed {
        println!("failed: {told}");
    }
    if !all.failed.is_empty() {
        std::process::exit(1);
    }
}

#[cfg(unix)]
mod unix {
    use crate::disk::{Somebody, file_limit, small_disk};
    use crate::kill::{How, Strike, at_random};
    use crate::place::Dice;
    use crate::scenario::{MAIN, MORE, Prepared};
    use crate::table::{self, Row};
    use crate::together::{RIVALS, asked_to_stop, other_inputs, same_inputs};

    /// How calls are struck, and every how many of them.
    const STRIKES: [(How, usize); 4] = [
        (How::Kill, 1),
        (How::Full, 3),
        (How::Denied, 3),
        (How::Broken, 3),
    ];

    /// What is done and what came of it so far.
    pub struct All {
        kills: usize,
        dice: Dice,
        pub rows: Vec<Row>,
        pub skipped: Vec<String>,
        /// Where something was left behind that must not be.
        pub failed: Vec<String>,
    }

    impl All {
        pub fn new(kills: usize, seed: u64) -> Self {
            Self {
                kills,
                dice: Dice::new(seed),
                rows: Vec::new(),
                skipped: Vec::new(),
                failed: Vec::new(),
            }
        }

        pub fn run(&mut self) {
            let strike = Strike::new();
            let somebody = Somebody::new();
            let disturbed = self.kills.div_ceil(50).max(2);
            for (scenarios, kills) in [(MAIN, self.kills), (MORE, self.kills / 10)] {
                for (number, scenario) in scenarios.iter().enumerate() {
                    let prepared = match Prepared::new(scenario) {
                        Ok(prepared) => prepared,
                        Err(told) => {
                            self.keep(scenario.name, Err(told));
                            continue;
                        }
                    };
                    let part = |n: usize| kills * n / scenarios.len();
                    let kills = part(number + 1) - part(number);
                    self.disturb(&prepared, |it, dice| at_random(it, kills, dice));
                    if let Ok(strike) = &strike {
                        for (how, every) in STRIKES {
                            self.disturb(&prepared, |it, dice| {
                                strike.at_every(it, how, every, dice)
                            });
                        }
                    }
                    self.disturb(&prepared, |it, dice| small_disk(it, disturbed, dice));
                    self.disturb(&prepared, |it, dice| file_limit(it, disturbed, dice));
                    if let Ok(somebody) = &somebody {
                        self.disturb(&prepared, |it, dice| somebody.closed(it, disturbed, dice));
                    }
                    self.disturb(&prepared, |it, dice| asked_to_stop(it, 2 * disturbed, dice));
                    self.disturb(&prepared, |it, dice| same_inputs(it, disturbed, dice));
                }
            }
            for rivals in RIVALS {
                let row = other_inputs(rivals, 2 * disturbed, &mut self.dice);
                self.keep(rivals.name, row);
            }
            for reason in [strike.err(), somebody.err()].into_iter().flatten() {
                self.skip(reason);
            }
        }

        fn disturb(
            &mut self,
            prepared: &Prepared,
            act: impl FnOnce(&Prepared, &mut Dice) -> Result<Row, String>,
        ) {
            let row = act(prepared, &mut self.dice);
            self.keep(prepared.scenario.name, row);
        }

        fn keep(&mut self, name: &str, row: Result<Row, String>) {
            match row {
                Ok(row) => {
                    println!("{}", table::line(&row));
                    self.rows.push(row);
                }
                Err(reason) if reason.starts_with("no disk") => self.skip(reason),
                Err(told) => {
                    println!("failed: {name}: {told}");
                    self.failed.push(format!("{name}: {told}"));
                }
            }
        }

        fn skip(&mut self, reason: String) {
            if !self.skipped.contains(&reason) {
                self.skipped.push(reason);
            }
        }
    }
}
