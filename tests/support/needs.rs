//! Tests that need another program, reported as ignored where it is missing. The test harness that
//! Rust brings cannot decide that when tests run, so their targets have `harness = false`.

use std::process::ExitCode;

use libtest_mimic::{Arguments, Trial};

/// A test with the name of its function; `missing` names what it needs and this machine lacks.
pub fn trial(name: &str, missing: Option<&str>, test: fn()) -> Trial {
    let trial = Trial::test(name, move || {
        test();
        Ok(())
    });
    match missing {
        None => trial,
        Some(missing) => trial
            .with_kind(format!("needs {missing}"))
            .with_ignored_flag(true),
    }
}

/// Runs them as the arguments of `cargo test` say.
pub fn run(trials: Vec<Trial>) -> ExitCode {
    libtest_mimic::run(&Arguments::from_args(), trials).exit_code()
}

/// `None => [tests that run anywhere], missing() => [tests that need something]`.
macro_rules! trials {
    ($($missing:expr => [$($test:ident),+ $(,)?]),+ $(,)?) => {{
        let mut trials = Vec::new();
        $(
            let missing: Option<String> = $missing;
            $(trials.push(needs::trial(stringify!($test), missing.as_deref(), $test));)+
        )+
        trials
    }};
}
pub(crate) use trials;
