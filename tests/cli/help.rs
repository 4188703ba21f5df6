//! Help pages, their examples, completions and manual pages.

use std::collections::BTreeSet;

use fluxform::bundle::artefact::SCHEMA_VERSION;

use fluxform_testing::place::Place;
use fluxform_testing::root;
use fluxform_testing::tree::tree;

/// Every command that the program takes, with the commands below it: `sweep`, `sweep plan`.
pub fn commands() -> Vec<Vec<String>> {
    fn below(command: &clap::Command, path: &[String], all: &mut Vec<Vec<String>>) {
        for next in command.get_subcommands() {
            let mut path = path.to_vec();
            path.push(next.get_name().to_owned());
            all.push(path.clone());
            below(next, &path, all);
        }
    }
    let mut all = Vec::new();
    below(&fluxform::commands::command(), &[], &mut all);
    assert!(all.len() > 15, "{all:?}");
    all
}

fn help_of(place: &Place, path: &[String]) -> String {
    let mut arguments: Vec<&str> = path.iter().map(String::as_str).collect();
    arguments.push("--help");
    place.run(&arguments).ends(0).out
}

#[test]
fn every_command_explains_itself() {
    let place = Place::new();
    let main = place.run(&["--help"]).ends(0).out;
    for path in commands() {
        let (command, page) = (path.join(" "), help_of(&place, &path));
        if path.len() == 1 {
            assert!(main.contains(&format!("\n  {command} ")), "{main}");
        }
        for part in ["Usage:", "Exit codes:", "Examples:", "--quiet"] {
            assert!(page.contains(part), "{command}: {part}");
        }
        assert!(page.contains(&format!("fluxform {command} ")), "{page}");
        let about = page.split("\n\n").nth(1).unwrap();
        assert!(about.len() > 100, "{command} has no paragraph: {about}");
        assert!(page.lines().filter(|l| l.starts_with("  # ")).count() >= 2);
    }
    // A build for tests has no revision.
    let crate_version = concat!("fluxform ", env!("CARGO_PKG_VERSION"));
    assert_eq!(place.run(&["-V"]).ends(0).out.trim(), crate_version);
    let whole = place.run(&["--version"]).ends(0).out;
    let schema = format!("writes artefacts of schema {SCHEMA_VERSION}");
    assert_eq!(
        whole.trim().lines().collect::<Vec<_>>(),
        [crate_version, schema.as_str()]
    );
}

/// `sweep plan` called the number the most that is computed; up to eighteen times as many were.
#[test]
fn the_searches_of_arrays_say_the_same_of_their_evaluations() {
    let place = Place::new();
    for path in [&["optimize"][..], &["sweep", "plan"]] {
        let page = help_of(
            &place,
            &path.iter().map(ToString::to_string).collect::<Vec<_>>(),
        );
        let words: Vec<&str> = page.split_whitespace().collect();
        let expected = "the search for a design computes; what limits and trade-offs around the best are worth takes more";
        assert!(words.join(" ").contains(expected), "{path:?}");
    }
}

/// Texts and comments name flags as `` `command --flag` ``.
#[test]
fn every_flag_that_a_text_names_is_one() {
    fn flags_of(command: &clap::Command) -> BTreeSet<String> {
        let longs = command.get_arguments().filter_map(clap::Arg::get_long);
        let own = longs.map(|long| format!("--{long}"));
        own.chain(command.get_subcommands().flat_map(flags_of))
            .collect()
    }
    let main = fluxform::commands::command();
    let own = main.get_arguments().filter_map(clap::Arg::get_long);
    let common: BTreeSet<String> = own.map(|long| format!("--{long}")).collect();
    let texts = tree(&root().join("src"))
        .into_iter()
        .filter(|(path, _)| path.ends_with(".rs"));
    let (mut named, mut wrong) = (0, Vec::new());
    for (path, text) in texts {
        let text = String::from_utf8(text).unwrap();
        // Every second piece is within backticks.
        for quoted in text
            .lines()
            .flat_map(|line| line.split('`').skip(1).step_by(2))
        {
            let mut words = quoted.split_whitespace();
            let Some(command) = words.next().and_then(|word| main.find_subcommand(word)) else {
                continue;
            };
            let known = flags_of(command);
            for word in words.filter(|word| word.starts_with("--")) {
                let flag = word.split('=').next().unwrap_or_default();
                named += 1;
                if !known.contains(flag) && !common.contains(flag) {
                    wrong.push(format!("{path}: `{quoted}`"));
                }
            }
        }
    }
    assert!(named > 20 && wrong.is_empty(), "{named}, {wrong:#?}");
}

#[test]
fn every_example_works() {
    let place = Place::new();
    for path in commands() {
        let page = help_of(&place, &path);
        let examples = page.split("Examples:").nth(1).unwrap();
        for line in examples.lines() {
            assert!(
                line.trim().len() < 98,
                "wrapped on a usual terminal: {line}"
            );
        }
        let examples = examples.replace("\\\n", "");
        let lines: Vec<&str> = examples
            .lines()
            .map(str::trim)
            .filter(|line| line.contains("fluxform ") && !line.starts_with('#'))
            .collect();
        assert!(lines.len() >= 2, "{examples}");
        for line in lines {
            let ran = place.shell(line);
            assert_eq!(ran.code, Some(0), "{line}: {ran:#?}");
        }
    }
}

/// `replay` did not say that it ends with 5 where the bundle is damaged.
#[test]
fn regression_a_command_that_reads_a_bundle_hid_an_exit_code() {
    let place = Place::empty();
    let pages = commands().into_iter().map(|path| help_of(&place, &path));
    let reads_a_bundle = |page: &String| page.contains("<BUNDLE");
    let pages: Vec<String> = pages.filter(reads_a_bundle).collect();
    assert!(pages.len() >= 2);
    for page in pages {
        assert!(page.contains("\n  5    "), "{page}");
    }
}

#[test]
fn no_command_is_wrong_usage_and_so_is_an_unknown_one() {
    let place = Place::new();
    place.run(&[]).ends(2).says(&["Usage:"]);
    place.run(&["evaluat", "x"]).ends(2).says(&["evaluate"]);
    let reported = place.run(&["map", "--format", "json"]).ends(2).error();
    assert_eq!(reported["error"]["exit_code"], 2);
}

#[test]
fn completions_and_manual_pages() {
    let place = Place::new();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = place.run(&["completions", shell]).ends(0).out;
        assert!(script.contains("calibrate"), "{shell}");
    }
    place.run(&["completions", "csh"]).ends(2);
    assert!(place.run(&["man"]).ends(0).out.contains(".TH fluxform 1"));
    place.run(&["man", "--out", "man1"]).ends(0);
    for path in commands() {
        let command = path.join("-");
        let page = place.read(&format!("man1/fluxform-{command}.1"));
        let page = String::from_utf8(page).unwrap();
        assert!(
            page.contains(&format!(".TH fluxform-{command} 1")),
            "{page}"
        );
        // Pages left out what options mean that the short help leaves out.
        assert!(page.contains("Threads to compute with"), "{page}");
    }
    place.run(&["man", "--out", "man1"]).ends(0);
    place.write("man1/fluxform-map.1", "mine");
    place
        .run(&["man", "--out", "man1"])
        .ends(4)
        .says(&["exists", "--force"]);
    let written = place
        .run(&["man", "--out", "man1", "--force", "--format", "json"])
        .ends(0);
    let written: serde_json::Value = serde_json::from_str(&written.out).unwrap();
    assert_eq!(written["pages"][0], "fluxform.1", "{written}");
}

/// The arguments that `arg` requires. clap has no way to ask for them but its description of an argument.
fn required(arg: &clap::Arg) -> Vec<String> {
    let described = format!("{arg:?}");
    let (_, rest) = described.split_once(" requires: [").unwrap();
    let (list, _) = rest.split_once(']').unwrap();
    let quoted = list.split('"').skip(1).step_by(2);
    quoted.map(str::to_owned).collect()
}

/// clap drops what an argument requires where another one that is given excludes that: the argument was
/// taken and had no effect. So it must exclude those others itself.
#[test]
fn what_excludes_a_required_argument_excludes_what_requires_it() {
    let main = fluxform::commands::command();
    let (mut pairs, mut wrong) = (0, Vec::new());
    for path in commands() {
        let command = path.iter().fold(&main, |command, name| {
            command.find_subcommand(name).expect("a command")
        });
        let all: Vec<&clap::Arg> = command.get_arguments().collect();
        let excludes = |a: &clap::Arg, b: &clap::Arg| {
            let either = [(a, b), (b, a)];
            either.iter().any(|(of, other)| {
                let excluded = command.get_arg_conflicts_with(of);
                excluded.iter().any(|arg| arg.get_id() == other.get_id())
            })
        };
        for arg in &all {
            for id in required(arg) {
                let needed = all.iter().find(|other| other.get_id() == id.as_str());
                let needed = needed.expect("an argument of the same command");
                let others = all.iter().filter(|other| other.get_id() != arg.get_id());
                for other in others.filter(|other| excludes(needed, other)) {
                    pairs += 1;
                    if !excludes(arg, other) {
                        wrong.push(format!("{path:?}: {arg} with {other}, without {needed}"));
                    }
                }
            }
        }
    }
    assert!(pairs > 30 && wrong.is_empty(), "{pairs}: {wrong:#?}");
}
