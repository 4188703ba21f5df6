//! Ctrl-C half way.

use std::collections::BTreeSet;
use std::fs::DirEntry;
use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use crate::support::{Place, SEED};

fn signal(child: &Child) {
    let sent = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(sent.unwrap().success());
}

fn wait(mut child: Child) -> (Option<i32>, String) {
    let mut said = String::new();
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut said)
        .unwrap();
    (child.wait().unwrap().code(), said)
}

#[test]
fn a_long_job_stops_and_leaves_nothing_half_written() {
    let place = Place::new();
    // Seconds of work: four million points.
    let child = place
        .command(&[
            "calibrate",
            SEED,
            "shapes/flat.toml",
            "shapes/half_sphere.stl",
            "--unit",
            "mm",
            "--translate",
            "0,0,30",
            "--grid",
            "2000x2000",
            "--format",
            "json",
        ])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let finished = place.path("results/seed_air/flat/manifest.json");
    for _ in 0..500 {
        if finished.exists() {
            break;
        }
        sleep(Duration::from_millis(20));
    }
    sleep(Duration::from_millis(200));
    signal(&child);
    let (code, said) = wait(child);
    assert_eq!(code, Some(130), "{said}");
    assert!(said.contains("interrupted"), "{said}");
    assert!(said.contains("\"code\":\"E130\""), "{said}");
    assert!(said.contains("\"exit_code\":130"), "{said}");
    let files = |folder: &str| -> BTreeSet<String> {
        let entries = place.path(folder).read_dir().unwrap();
        let name = |entry: DirEntry| entry.file_name().into_string().unwrap();
        entries.map(|entry| name(entry.unwrap())).collect()
    };
    let left = files("results/seed_air");
    let finished = [".fluxform-kept", "flat"].map(str::to_owned);
    assert_eq!(
        left,
        finished.into(),
        "what was finished is kept, nothing else"
    );
    let kept = files("results/seed_air/.fluxform-kept");
    assert!(
        kept.iter().all(|name| name.ends_with(".points")),
        "{kept:?}"
    );
}

#[test]
fn waiting_for_input_ends_at_once() {
    let place = Place::new();
    let mut child = place
        .command(&["evaluate", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    sleep(Duration::from_millis(500));
    let input = child.stdin.take();
    signal(&child);
    let (code, _) = wait(child);
    drop(input);
    assert_eq!(code, Some(130));
}
