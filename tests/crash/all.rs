//! All of `tests/crash` at length, with the figures as a table.
//!
//! ```text
//! cargo bench --locked --bench crash_safety -- [KILLS] [--every 1] [--seed 1]
//! ```
//!
//! KILLS (500) runs are killed with SIGKILL at random moments, shared out among `calibrate`,
//! `sweep run` and `map`, and a tenth of that among the other commands that write. Then a kill comes
//! before every call that changes files and before every rename, and every third call fails in each way;
//! with `--every 8` every eighth and every 24th. Ends with an error where a run left something behind that it must not.

// A measurement: it reads the clock, prints and ends with a code.
#![allow(clippy::print_stdout, clippy::disallowed_methods, clippy::exit)]

#[cfg(unix)]
mod changes;
#[cfg(unix)]
mod disk;
#[cfg(unix)]
mod kill;
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
    let number = |name: &str, default| {
        after(name)
            .and_then(|at| args.get(at)?.parse().ok())
            .unwrap_or(default)
    };
    let kills = args.first().and_then(|arg| arg.parse().ok()).unwrap_or(500);
    let mut all = unix::All::new(
        kills,
        number("--every", 1).max(1),
        number("--seed", 1) as u64,
    );
    all.run();
    println!("\n{}", table::markdown(&all.rows));
    for reason in &all.skipped {
        println!("skipped: {reason}");
    }
    for reported in &all.failed {
        println!("failed: {reported}");
    }
    if !all.failed.is_empty() {
        std::process::exit(1);
    }
}

#[cfg(unix)]
mod unix {
    use crate::disk::{Somebody, file_limit, small_disk};
    use crate::kill::{How, Strike, at_random};
    use crate::scenario::{MAIN, MORE, Prepared, Scenario};
    use crate::table::{self, Row};
    use crate::together::{RIVALS, asked_to_stop, other_inputs, same_inputs};
    use fluxform_testing::Random;

    /// How calls are struck, and every how many of them.
    const STRIKES: [(How, usize); 6] = [
        (How::Kill, 1),
        (How::Full, 3),
        (How::Denied, 3),
        (How::Broken, 3),
        (How::Renames, 1),
        (How::Plain, 1),
    ];

    /// Task and results so far.
    pub struct All {
        kills: usize,
        every: usize,
        random: Random,
        pub rows: Vec<Row>,
        pub skipped: Vec<String>,
        /// Where something was left behind that must not be.
        pub failed: Vec<String>,
    }

    impl All {
        pub fn new(kills: usize, every: usize, seed: u64) -> Self {
            Self {
                kills,
                every,
                random: Random::new(seed),
                rows: Vec::new(),
                skipped: Vec::new(),
                failed: Vec::new(),
            }
        }

        pub fn run(&mut self) {
            let strike = Strike::new();
            let somebody = Somebody::new();
            let main = self.prepared(MAIN);
            let more = self.prepared(MORE);
            for (all, kills) in [(&main, self.kills), (&more, self.kills / 10)] {
                for (number, it) in all.iter().enumerate() {
                    let part = |n: usize| kills * n / all.len();
                    let kills = part(number + 1) - part(number);
                    self.disturb(it, |it, random| at_random(it, kills, random));
                }
            }
            let few = self.kills.div_ceil(100).max(2);
            for it in main.iter().chain(&more) {
                self.disturb(it, |it, random| small_disk(it, few, random));
                self.disturb(it, |it, random| file_limit(it, few, random));
                if let Ok(somebody) = &somebody {
                    self.disturb(it, |it, random| somebody.closed(it, few, random));
                }
                self.disturb(it, |it, random| asked_to_stop(it, 2 * few, random));
                self.disturb(it, |it, random| same_inputs(it, few, random));
            }
            for rivals in RIVALS {
                let row = other_inputs(rivals, 2 * few, &mut self.random);
                self.keep(rivals.name, row);
            }
            for it in main.iter().chain(&more) {
                if let Ok(strike) = &strike {
                    for (how, every) in STRIKES {
                        let every = every * self.every;
                        self.disturb(it, |it, random| strike.at_every(it, how, every, random));
                    }
                }
            }
            for reason in [strike.err(), somebody.err()].into_iter().flatten() {
                self.skip(reason);
            }
        }

        fn prepared(&mut self, scenarios: &'static [Scenario]) -> Vec<Prepared> {
            let mut all = Vec::new();
            for scenario in scenarios {
                match Prepared::new(scenario) {
                    Ok(prepared) => all.push(prepared),
                    Err(reported) => self.keep(scenario.name, Err(reported)),
                }
            }
            all
        }

        fn disturb(
            &mut self,
            prepared: &Prepared,
            act: impl FnOnce(&Prepared, &mut Random) -> Result<Row, String>,
        ) {
            let row = act(prepared, &mut self.random);
            self.keep(prepared.scenario.name, row);
        }

        fn keep(&mut self, name: &str, row: Result<Row, String>) {
            match row {
                Ok(row) => {
                    println!("{}", table::line(&row));
                    self.rows.push(row);
                }
                Err(reason) if reason.starts_with("no disk") => self.skip(reason),
                Err(reported) => {
                    println!("failed: {name}: {reported}");
                    self.failed.push(format!("{name}: {reported}"));
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
