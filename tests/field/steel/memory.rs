//! Memory that coupled cores take against what is stated before they are solved.

use std::process::Command;

use fluxform_field::steel::CoreShape;
use fluxform_field::steel::array::CoupledArray;
use fluxform_field::steel::array_cost::ArrayCost;
use fluxform_field::winding::Winding;

/// The coil of a dense display and its core.
const COIL: Winding = Winding {
    inner_radius_m: 0.0025,
    outer_radius_m: 0.0045,
    length_m: 0.04,
    turns: 800.0,
};
const CORE: CoreShape = CoreShape {
    radius_m: 0.0025,
    bottom_m: -0.045,
    top_m: 0.0,
};
const PITCH_M: f64 = 0.01;
const LOWEST_M: f64 = 0.01;
/// Names the array that a process solves: cores along a side, tolerance.
const SOLVED: &str = "FLUXFORM_TEST_SOLVED";

fn square(side: usize) -> Vec<[f64; 2]> {
    let at = |k: usize| PITCH_M * k as f64;
    (0..side * side)
        .map(|k| [at(k % side), at(k / side)])
        .collect()
}

fn peak_bytes() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kibibytes: f64 = line
        .expect("a peak")
        .split_whitespace()
        .next()
        .unwrap()
        .parse()
        .unwrap();
    1024.0 * kibibytes
}

/// Solves what the environment names, in a process of its own.
#[test]
#[ignore = "a part of the other tests"]
fn memory_of_one_array() {
    let Ok(solved) = std::env::var(SOLVED) else {
        return;
    };
    let (side, tolerance) = solved.split_once(' ').expect("a side and a tolerance");
    let (side, tolerance) = (side.parse().unwrap(), tolerance.parse().unwrap());
    let before = peak_bytes();
    let positions_m = square(side);
    CoupledArray::new(&COIL, CORE, 1000.0, &positions_m, tolerance, LOWEST_M)
        .expect("off the winding's edges");
    println!("peak {}", peak_bytes() - before);
}

/// Stated and measured peak, bytes.
fn stated_and_measured(side: usize, tolerance: f64) -> [f64; 2] {
    let cost = ArrayCost::new(CORE, COIL.length_m, &square(side), PITCH_M, tolerance);
    let output = Command::new(std::env::current_exe().expect("this test"))
        .args(["memory_of_one_array", "--ignored", "--nocapture"])
        .env(SOLVED, format!("{side} {tolerance}"))
        .output()
        .expect("runs");
    let text = String::from_utf8_lossy(&output.stdout);
    let peak = text.lines().find_map(|line| line.strip_prefix("peak "));
    [cost.bytes, peak.expect("solved").trim().parse().unwrap()]
}

fn held(cases: &[(usize, f64)]) {
    println!("cores, tolerance: stated, measured peak in MB");
    for (side, tolerance) in cases {
        let [stated, measured] = stated_and_measured(*side, *tolerance);
        let ratio = stated / measured;
        println!(
            "{}, {tolerance:e}: {:.0}, {:.0}, ratio {ratio:.2}",
            side * side,
            1e-6 * stated,
            1e-6 * measured
        );
        assert!(
            (0.8..1.5).contains(&ratio),
            "{side}, {tolerance:e}: {ratio}"
        );
    }
}

#[test]
#[cfg(target_os = "linux")]
fn memory_is_what_was_stated() {
    held(&[(6, 1e-2), (6, 1e-3), (9, 1e-2)]);
}

/// `cargo test --release --test field steel -- --ignored --nocapture memory_of_hundreds` prints the table.
#[test]
#[ignore = "minutes of CPU: 900 coupled cores"]
#[cfg(target_os = "linux")]
fn memory_of_hundreds_is_what_was_stated() {
    held(&[(15, 1e-2), (15, 1e-3), (15, 1e-4), (30, 1e-2), (30, 1e-3)]);
}
