//! The bar at a terminal: what it shows, and that nothing of it is left behind.

use std::fs::{File, OpenOptions};
use std::io::Read;
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use fluxform_testing::needs::Trial;
use fluxform_testing::place::Place;
use fluxform_testing::trials;

const SEED: &str = "designs/seed_air.toml";

pub fn trials() -> Vec<Trial> {
    trials! {
        no_terminal() => [ctrl_c_leaves_no_bar_behind, a_bench_shows_how_far_it_is_in_all],
    }
}

/// Pseudo-terminals, where there are none.
fn no_terminal() -> Option<String> {
    let missing = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).is_err();
    missing.then(|| "pseudo-terminals".to_owned())
}

/// A terminal's line is emptied by this, and the cursor at its start.
const CLEARED: &str = "\r\u{1b}[2K";
/// Longer than any command here takes to draw its bar, on a loaded machine too.
const PATIENCE: Duration = Duration::from_secs(120);

/// Runs a command at a terminal of its own; interrupts it once it has shown `shown`. Returns the exit code and all
/// that it showed.
fn interrupted_at(place: &Place, arguments: &[&str], shown: &str) -> (Option<i32>, String) {
    let terminal = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&terminal).unwrap();
    unlockpt(&terminal).unwrap();
    let name = ptsname(&terminal, Vec::new()).unwrap();
    let end = OpenOptions::new()
        .read(true)
        .write(true)
        .open(name.to_str().unwrap())
        .unwrap();
    let stdio = || Stdio::from(end.try_clone().unwrap());
    let mut command = place.command(arguments);
    command.stdin(stdio()).stdout(stdio()).stderr(stdio());
    command.env("TERM", "xterm").env("COLUMNS", "80");
    let mut child = command.spawn().unwrap();
    // Reading ends once nobody holds the terminal's other end any more.
    drop((command, end));
    let (sender, receiver) = mpsc::channel();
    let reader = std::thread::spawn(move || {
        let mut from = File::from(terminal);
        let mut buffer = [0; 4096];
        while let Ok(count @ 1..) = from.read(&mut buffer) {
            if sender.send(buffer[..count].to_vec()).is_err() {
                break;
            }
        }
    });
    let (mut all, mut sent) = (Vec::new(), false);
    while let Ok(part) = receiver.recv_timeout(PATIENCE) {
        all.extend(part);
        if !sent && String::from_utf8_lossy(&all).contains(shown) {
            let child = child.id().to_string();
            let kill = Command::new("kill").args(["-INT", &child]).status();
            sent = kill.unwrap().success();
            assert!(sent);
        }
    }
    let code = child.wait().unwrap().code();
    reader.join().unwrap();
    let text = String::from_utf8_lossy(&all).into_owned();
    assert!(sent, "never showed {shown:?}: {text}");
    (code, text)
}

/// After the last bar its line is emptied, and only then the end is reported.
#[track_caller]
fn assert_cleared(text: &str) {
    // Every bar states items a second.
    let after = &text[text.rfind("/s").unwrap()..];
    let (cleared, said) = (after.rfind(CLEARED), after.rfind("interrupted"));
    assert!(cleared.is_some() && cleared < said, "{after:?}");
}

fn ctrl_c_leaves_no_bar_behind() {
    let place = Place::new();
    let surface = [
        "shapes/half_sphere.stl",
        "--unit",
        "mm",
        "--translate",
        "0,0,30",
    ];
    let long = [&["calibrate", SEED][..], &surface, &["--grid", "2000x2000"]].concat();
    let (code, text) = interrupted_at(&place, &long, "/s");
    assert_eq!(code, Some(130), "{text:?}");
    assert_cleared(&text);
}

/// The stage within, and the part of all runs above it.
fn a_bench_shows_how_far_it_is_in_all() {
    let place = Place::new();
    let bench = [
        "bench",
        SEED,
        "shapes/half_sphere.toml",
        "--out",
        "measured",
    ];
    let (code, text) = interrupted_at(&place, &bench, " of 55, ");
    assert_eq!(code, Some(130), "{text:?}");
    assert_cleared(&text);
}
