use super::cored::*;
use super::*;
use crate::field::magnet::MagnetRule;
use std::time::Instant;
#[test]
fn tune() {
    let rule = CoreRule {
        clearance_m: 0.0,
        above_m: 0.0,
        below_m: 0.01,
        relative_permeability: 1000.0,
    };
    let magnet = MagnetRule::dipole([0.0, 0.0, -0.90941]);
    let model = CoredModel::new(0.03, &magnet, rule, false).unwrap();
    let mut r = 1u64;
    let mut next = || {
        r = r
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (r >> 11) as f64 / (1u64 << 53) as f64
    };
    let near = Window {
        inner_radius_m: 0.0079,
        depth_m: 0.0111,
        length_m: 0.057,
    };
    let t = Instant::now();
    let sharp = model.sharpened(&near).unwrap();
    println!(
        "sharpened {:?} error {:.2e}",
        t.elapsed(),
        sharp.relative_error()
    );
    let t = Instant::now();
    model.response(&near, 1.0 / 0.49e-6, 2.0, false).unwrap();
    println!("coarse cell {:?}", t.elapsed());
    for ind in [false, true] {
        let t = Instant::now();
        for _ in 0..1000 {
            sharp.response(&near, 1.0 / 0.49e-6, 2.0, ind).unwrap();
        }
        println!("response {ind} {:?}/1000", t.elapsed());
    }
    let direct = |w: &Window| {
        use crate::field::{
            steel::{CoreShape, cored_coil::CoredCoil},
            winding::Winding,
        };
        let wd = Winding {
            inner_radius_m: w.inner_radius_m,
            outer_radius_m: w.outer_radius_m(),
            length_m: w.length_m,
            turns: w.depth_m * w.length_m / 0.49e-6,
        };
        let c = CoredCoil::new(
            &wd,
            CoreShape {
                radius_m: w.inner_radius_m,
                bottom_m: -w.length_m - 0.01,
                top_m: 0.0,
            },
            1000.0,
            1e-7,
            0.03,
        )
        .unwrap();
        (
            c.field(0.0, 0.03).unwrap().dbz_dz.abs() * 0.90941 * 2.0,
            c.added_inductance_h + crate::coil::inductance::self_inductance_h(&wd),
        )
    };
    for (name, m, spread) in [
        ("fine", &*sharp, 0.18),
        ("fine wide", &*sharp, 0.5),
        ("coarse", &model as &dyn CoilModel, 2.0),
    ] {
        let (mut ef, mut el) = (0.0_f64, 0.0_f64);
        for _ in 0..12 {
            let w = Window {
                inner_radius_m: near.inner_radius_m * (spread * (next() - 0.5)).exp(),
                depth_m: near.depth_m * (spread * (next() - 0.5)).exp(),
                length_m: near.length_m * (spread * (next() - 0.5)).exp(),
            };
            let r = m.response(&w, 1.0 / 0.49e-6, 2.0, true).unwrap();
            let (f, l) = direct(&w);
            ef = ef.max((r.force_n.value / f - 1.0).abs());
            el = el.max((r.inductance_h.value / l - 1.0).abs());
        }
        println!("{name}: force {ef:.1e} inductance {el:.1e}");
    }
}

#[test]
fn reference() {
    let folder = std::path::Path::new("tests/oracles/nlopt");
    let text = std::fs::read_to_string(folder.join("reference.json")).unwrap();
    let table: serde_json::Value = serde_json::from_str(&text).unwrap();
    for (name, wanted) in table["problems"].as_object().unwrap() {
        if !name.contains("cored") {
            continue;
        }
        let need = crate::design::Need {
            coil: false,
            array: false,
            target: false,
            workspace: false,
        };
        let (design, _) =
            crate::design::Design::read(&folder.join(format!("designs/{name}.toml")), need)
                .unwrap();
        let magnet = MagnetRule::dipole([0.0, 0.0, -1.1579e6 * std::f64::consts::PI / 4.0 * 1e-6]);
        let t = Instant::now();
        let task = task::of_design(&design, Fixed::default()).unwrap();
        let model = task::coil_model(&design, &magnet).unwrap();
        let out = optimise(
            &*model,
            &task,
            &Settings::default(),
            &crate::progress::Silent,
        )
        .unwrap();
        let dt = t.elapsed();
        let b = out.best.as_ref().unwrap_or_else(|| panic!("{out:?}"));
        let f0 = wanted["best"]["force_n"].as_f64().unwrap();
        println!(
            "{name}: {:.8} ref {:.8} rel {:+.1e} (tol {:.1e}) ID {:.5} ({:.5}) OD {:.5} L {:.5} ({:.5}) {dt:?} evals {} valley {:?}",
            b.force_n,
            f0,
            b.force_n / f0 - 1.0,
            wanted["objective_tolerance"].as_f64().unwrap(),
            2e3 * b.window.inner_radius_m,
            1e3 * wanted["best"]["inner_diameter_m"].as_f64().unwrap(),
            2e3 * b.window.outer_radius_m(),
            1e3 * b.window.length_m,
            1e3 * wanted["best"]["length_m"].as_f64().unwrap(),
            out.evaluations,
            out.valley_m
        );
        println!(
            "    active {:?}",
            b.limits
                .iter()
                .filter(|l| l.active)
                .map(|l| (l.name, l.sensitivity_n_per_unit))
                .collect::<Vec<_>>()
        );
    }
}
