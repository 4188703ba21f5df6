//! Regression tests, each named by its fault.

use std::process::Command;
use std::thread::sleep;
use std::time::Duration;

use crate::scenario::written;
use fluxform_testing::needs::Trial;
use fluxform_testing::{
    inputs::{OUT, scenes},
    place::Place,
    run::Ran,
    trials,
};

pub fn trials() -> Vec<Trial> {
    trials! {
        None => [
            sigterm_is_heeded_as_ctrl_c_is,
            an_interrupted_run_leaves_no_empty_folder,
            a_map_leaves_no_other_format_of_an_older_one_beside_it,
            a_shape_named_like_a_temporary_folder_is_refused_not_lost,
            temporary_files_of_a_killed_run_go_with_no_cache,
            two_plans_at_once_do_not_share_a_folder,
        ],
    }
}

/// Seconds of work on one bundle.
const LONG: [&str; 8] = [
    "calibrate",
    "air.toml",
    "bump.stl",
    "--unit=mm",
    "--translate=0,0,37",
    "--grid=2000x2000",
    "--out=out/results",
    "--no-cache",
];

fn with_a_surface() -> Place {
    let place = scenes();
    let facet = "facet normal 0 0 1\nouter loop\nvertex -13 -13 0\nvertex 13 -13 0\nvertex 0 13 3\n\
                 endloop\nendfacet\n";
    place.write("bump.stl", &format!("solid bump\n{facet}endsolid bump\n"));
    place
}

/// Sends the signal half way; the second one where the first is not heeded would end it.
fn stopped(place: &Place, signal: &str) -> Ran {
    let child = place.spawn(&LONG);
    sleep(Duration::from_millis(400));
    let sent = Command::new("kill")
        .args([signal, &child.id().to_string()])
        .status();
    assert!(sent.unwrap().success());
    Ran::of(child.wait_with_output().unwrap())
}

fn sigterm_is_heeded_as_ctrl_c_is() {
    for signal in ["-TERM", "-INT"] {
        let place = with_a_surface();
        let ran = stopped(&place, signal);
        ran.ended_with(&[130]).unwrap();
        assert!(ran.err.contains("interrupted"), "{}", ran.err);
    }
}

fn an_interrupted_run_leaves_no_empty_folder() {
    let place = with_a_surface();
    stopped(&place, "-TERM").ended_with(&[130]).unwrap();
    assert!(written(&place).is_empty(), "{:?}", written(&place).keys());
}

fn a_map_leaves_no_other_format_of_an_older_one_beside_it() {
    let place = scenes();
    let map = |flags: &[&str]| {
        let args = [&["map", "air.toml", "--out", "out"], flags].concat();
        place.run(&args).ended_with(&[0]).unwrap();
        written(&place).into_keys().collect::<Vec<String>>()
    };
    assert_eq!(
        map(&["--csv", "--vtk"]),
        ["map.csv", "map.json", "map.npz", "map.vti"]
    );
    assert_eq!(map(&["--vtk"]), ["map.json", "map.npz", "map.vti"]);
    // A file that is not the program's own stays, whatever its name.
    place.write("out/map.csv", "mine\n");
    assert_eq!(map(&[]), ["map.csv", "map.json", "map.npz"]);
    assert_eq!(written(&place)["map.csv"], b"mine\n");
}

fn a_shape_named_like_a_temporary_folder_is_refused_not_lost() {
    let place = scenes();
    let shape = String::from_utf8(std::fs::read(place.path("bump.toml")).unwrap()).unwrap();
    place.write(
        "odd.toml",
        &shape.replace("\"bump\"", "\".fluxform-7.tmp\""),
    );
    let ran = place.run(&["calibrate", "air.toml", "odd.toml", "--out", "out"]);
    ran.ended_with(&[4]).unwrap();
    assert!(ran.err.contains("choose another name"), "{}", ran.err);
}

fn temporary_files_of_a_killed_run_go_with_no_cache() {
    let place = scenes();
    let args = [
        "calibrate",
        "two.toml",
        "bump.toml",
        "--out",
        "out",
        "--no-report",
    ];
    place.run(&args).ended_with(&[0]).unwrap();
    place.write("out/two/.fluxform-cache/.fluxform-7Xq.tmp", "");
    let again = [&args[..], &["--no-cache"]].concat();
    place.run(&again).ended_with(&[0]).unwrap();
    assert!(!place.path(OUT).join("two/.fluxform-cache").exists());
}

fn two_plans_at_once_do_not_share_a_folder() {
    let place = scenes();
    for (design, plan) in [("air.toml", "one.json"), ("other_air.toml", "two.json")] {
        let args = [
            "sweep",
            "plan",
            design,
            "--set",
            "wire.diameter_mm=0.5:0.8:0.1",
            "--out",
            plan,
        ];
        place.run(&args).ended_with(&[0]).unwrap();
    }
    for round in 0..6 {
        let out = format!("out/{round}");
        let run = |plan| place.spawn(&["sweep", "run", plan, "--out", &out]);
        let codes = [run("one.json"), run("two.json")]
            .map(|child| Ran::of(child.wait_with_output().unwrap()))
            .map(|ran| ran.code);
        assert!(
            codes == [Some(0), Some(4)] || codes == [Some(4), Some(0)],
            "{codes:?}"
        );
    }
}
