//! Whole or absent: replacing, killing, full disks, two runs at once.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use fluxform::bundle::artefact::{Input, sha256_hex};
use fluxform::bundle::atomic::{Overwrite, WriteError, write};
use fluxform::bundle::load::Bundle;
use fluxform::bundle::seal::to_record;
use fluxform::lambda::Criterion;
use serde_json::json;

use fluxform_testing::bundle::*;
use fluxform_testing::needs::Trial;
use fluxform_testing::tree::assert_no_leftovers;
use fluxform_testing::{Random, trials};

pub fn trials() -> Vec<Trial> {
    trials! {
        None => [a_bundle_is_replaced_only_when_it_is_ours_and_the_users_files_stay, single_files_are_whole_or_absent, after_a_kill_at_any_moment_the_bundle_is_whole_or_absent, two_runs_on_one_folder_leave_one_whole_bundle, full_disks_are_reported],
        unbound_by_permissions() => [read_only_folders_are_reported],
        Some("the test that kills it".to_owned()) => [child_that_writes_until_killed],
    }
}

/// Somebody whom permissions bind, where that is somebody else.
fn unbound_by_permissions() -> Option<String> {
    let folder = tempfile::tempdir().unwrap();
    let shut = folder.path().join("shut");
    fs::create_dir(&shut).unwrap();
    let mode = std::os::unix::fs::PermissionsExt::from_mode(0o555);
    fs::set_permissions(&shut, mode).unwrap();
    let unbound = fs::write(shut.join("probe"), "").is_ok();
    unbound.then(|| "a user whom permissions bind".to_owned())
}

fn a_bundle_is_replaced_only_when_it_is_ours_and_the_users_files_stay() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("seed/flat");
    let mut sample = sample(false, [4, 4, 4]);
    sample.write(&target, false).unwrap();
    fs::create_dir(target.join("notes")).unwrap();
    fs::write(target.join("notes/mine.txt"), "felt good").unwrap();
    fs::write(target.join("scan.csv"), "x_m\n").unwrap();
    sample.manifest.lambda.criterion = Criterion::Linear;
    sample.write(&target, false).unwrap();
    assert_eq!(
        Bundle::open(&target).unwrap().manifest.lambda.criterion,
        Criterion::Linear
    );
    assert_eq!(
        fs::read_to_string(target.join("notes/mine.txt")).unwrap(),
        "felt good"
    );
    assert!(target.join("scan.csv").exists());

    sample.manifest.inputs[0].sha256 = sha256_hex(b"another design");
    let error = sample.write(&target, false).unwrap_err();
    assert!(matches!(error, WriteError::OutputExists { .. }), "{error}");
    assert!(
        error.to_string().contains("was made from other inputs")
            && error.to_string().contains("--force")
    );
    assert_eq!(
        Bundle::open(&target).unwrap().manifest.inputs[0].sha256,
        sha256_hex(b"design")
    );
    sample.write(&target, true).unwrap();
    assert_eq!(
        Bundle::open(&target).unwrap().manifest.inputs[0].sha256,
        sha256_hex(b"another design")
    );
    assert!(target.join("scan.csv").exists());

    // A folder that is no bundle; an empty one; a file.
    let other = folder.path().join("other");
    fs::create_dir(&other).unwrap();
    sample.write(&other, false).unwrap();
    fs::remove_file(other.join("manifest.json")).unwrap();
    let error = sample.write(&other, false).unwrap_err();
    assert!(matches!(error, WriteError::OutputExists { .. }), "{error}");
    let file = folder.path().join("file");
    fs::write(&file, "x").unwrap();
    for target in [file.clone(), file.join("below")] {
        let error = sample.write(&target, true).unwrap_err();
        assert!(matches!(error, WriteError::NotFolder { .. }), "{error}");
    }
    assert_no_leftovers(folder.path());
}

fn single_files_are_whole_or_absent() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/points.csv");
    let inputs = [Input::of_bytes("a.stl", b"solid")];
    let ours =
        |inputs: &[Input]| Overwrite::new(false, folder.path().join("new/points.json"), inputs);
    let put =
        |text: &'static str| move |out: &mut dyn std::io::Write| out.write_all(text.as_bytes());
    let written = write(&path, &ours(&inputs), put("x_m\n")).unwrap();
    assert_eq!((written.bytes, written.sha256), (4, sha256_hex(b"x_m\n")));
    // No sidecar: not ours. With one: ours. Of other inputs: not ours.
    let error = write(&path, &ours(&inputs), put("y"))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("points.json states what it was made from"),
        "{error}"
    );
    let sidecar = json!({ "schema_version": "1.4.0", "fluxform_version": "0.1.0",
        "inputs": [{ "path": "other/name.stl", "sha256": sha256_hex(b"solid") }],
        "files": [{ "path": "points.csv", "bytes": 4, "sha256": sha256_hex(b"x_m\n") }] });
    let sidecar = to_record(&sidecar).unwrap();
    fs::write(folder.path().join("new/points.json"), sidecar).unwrap();
    write(&path, &ours(&inputs), put("y_m\n")).unwrap();
    let other = [Input::of_bytes("a.stl", b"other")];
    assert!(matches!(
        write(&path, &ours(&other), put("z")),
        Err(WriteError::OutputExists { .. })
    ));
    assert_eq!(fs::read_to_string(&path).unwrap(), "y_m\n");
    write(&path, &Overwrite::force(), put("z_m\n")).unwrap();
    assert_eq!(fs::read_to_string(&path).unwrap(), "z_m\n");
    // Content that fails half way.
    let error = write(&path, &Overwrite::force(), |out| {
        out.write_all(&[b'x'; 5 << 20])?;
        Err(std::io::Error::from(std::io::ErrorKind::StorageFull))
    });
    assert!(matches!(error, Err(WriteError::DiskFull { .. })));
    assert_eq!(fs::read_to_string(&path).unwrap(), "z_m\n");
    assert!(matches!(
        write(folder.path(), &Overwrite::force(), put("x")),
        Err(WriteError::IsFolder { .. })
    ));
    let below_file = path.join("map.npz");
    assert!(matches!(
        write(&below_file, &Overwrite::force(), put("x")),
        Err(WriteError::NotFolder { .. })
    ));
    assert_no_leftovers(&folder.path().join("new"));
    assert_eq!(fs::read_dir(folder.path().join("new")).unwrap().count(), 2);
}

fn put(out: &mut dyn std::io::Write) -> std::io::Result<()> {
    out.write_all(&[b'x'; 3 << 20])
}

fn full_disks_are_reported() {
    if Path::new("/dev/full").exists() {
        let error = write(Path::new("/dev/full"), &Overwrite::force(), put).unwrap_err();
        assert!(matches!(error, WriteError::DiskFull { .. }), "{error}");
        assert!(error.to_string().contains("the disk is full"));
        write(Path::new("/dev/null"), &Overwrite::force(), put).unwrap();
        assert!(!Path::new("/dev/null").metadata().unwrap().is_file());
    }
}

fn read_only_folders_are_reported() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let shut = folder.path().join("shut");
    fs::create_dir(&shut).unwrap();
    fs::set_permissions(&shut, fs::Permissions::from_mode(0o555)).unwrap();
    let error = write(&shut.join("map.npz"), &Overwrite::force(), put).unwrap_err();
    assert!(matches!(error, WriteError::ReadOnly { .. }), "{error}");
    let error = sample(false, [4, 4, 4])
        .write(&shut.join("flat"), false)
        .unwrap_err();
    assert!(matches!(error, WriteError::ReadOnly { .. }), "{error}");
}

/// The child of the test below: writes the same bundle again and again until it is killed.
fn child_that_writes_until_killed() {
    let Some(target) = std::env::var_os("FLUXFORM_KILL_TARGET") else {
        return;
    };
    let sample = sample(false, [9, 9, 9]);
    loop {
        sample.write(Path::new(&target), false).unwrap();
    }
}

fn after_a_kill_at_any_moment_the_bundle_is_whole_or_absent() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("flat");
    let mut random = Random::new(11);
    let mut present = 0;
    for round in 0..30 {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args([
                "--ignored",
                "--exact",
                "whole::child_that_writes_until_killed",
            ])
            .env("FLUXFORM_KILL_TARGET", &target)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(std::time::Duration::from_millis(
            4 + (random.unit() * 26.0) as u64,
        ));
        child.kill().unwrap();
        child.wait().unwrap();
        if target.exists() {
            present += 1;
            Bundle::open(&target).unwrap_or_else(|error| panic!("round {round}: {error}"));
        }
    }
    eprintln!(
        "30 kills: the bundle was whole {present} times, absent {} times",
        30 - present
    );
    sample(false, [9, 9, 9]).write(&target, false).unwrap();
    Bundle::open(&target).unwrap();
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "leftovers");
}

fn two_runs_on_one_folder_leave_one_whole_bundle() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("flat");
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for _ in 0..10 {
                    sample(false, [5, 5, 5]).write(&target, false).unwrap();
                }
            });
        }
    });
    Bundle::open(&target).unwrap();
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "leftovers");
}
