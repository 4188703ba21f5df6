//! The unpowered steel's pull on the magnet: against finite elements, limits and symmetries.
//!
//! `oracles/steel/magnet_force.json` holds finite-element results of stated accuracy (relative
//! 1e-5, two formulations); `scripts/peers/core_ngsolve.py` solves the same linear problem.

use std::f64::consts::PI;

use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_field::dipole::cylinder_moment_a_m2;
use fluxform_field::magnet::{Cylinder, MagnetRule, Sources};
use fluxform_field::steel::CoreShape;
use fluxform_field::steel::cored_coil::CoredCoil;
use fluxform_field::steel::passive::{NoPull, PassivePull, Pulled, Region};
use fluxform_field::winding::Winding;
use fluxform_numerics::vec3::norm;
use serde_json::Value;

const ORACLE: &str = include_str!("../oracles/steel/magnet_force.json");
/// Of the finite elements, relative.
const ORACLE_ERROR: f64 = 1e-5;
const CORE: CoreShape = CoreShape {
    radius_m: 0.012,
    bottom_m: -0.11,
    top_m: 0.0,
};
const SIZE: Cylinder = Cylinder {
    diameter_m: 0.01,
    length_m: 0.01,
};

fn moment() -> f64 {
    cylinder_moment_a_m2(0.01, 0.01, 1.1579e6)
}

/// One core alone and an upright dipole.
fn one<'a>(z_m: [f64; 2]) -> Pulled<'a> {
    Pulled {
        shape: CORE,
        relative_permeability: 1000.0,
        positions_m: &[[0.0, 0.0]],
        coupled: false,
        moment_a_m2: [0.0, 0.0, moment()],
        size: None,
        region: Region {
            x_m: [-0.03, 0.03],
            y_m: [-0.03, 0.03],
            z_m,
        },
    }
}

fn oracle() -> Vec<(f64, Value)> {
    let document: Value = serde_json::from_str(ORACLE).unwrap();
    let forces = document["forces"].as_object().unwrap();
    let rows: Vec<_> = forces
        .iter()
        .map(|(key, row)| {
            let z_mm: f64 = key.strip_prefix("z_mm=").unwrap().parse().unwrap();
            (1e-3 * z_mm, row.clone())
        })
        .collect();
    assert!(rows.len() >= 5);
    rows
}

#[test]
fn the_pull_of_one_core_is_that_of_finite_elements() {
    let pulled = Pulled {
        size: Some(SIZE),
        ..one([0.02, 0.08])
    };
    for tolerance in [1e-3, 1e-4] {
        let pull = PassivePull::new(&pulled, tolerance).unwrap();
        assert!(pull.relative_error <= tolerance, "{}", pull.relative_error);
        for (z_m, row) in oracle() {
            let expected = row["passive_N"].as_f64().unwrap();
            let [x, y, found] = pull.force_n([0.0, 0.0, z_m]);
            let miss = (found / expected - 1.0).abs();
            assert!(miss < tolerance + ORACLE_ERROR, "{z_m}: {miss:e}");
            assert_eq!([x, y], [0.0, 0.0]);
        }
    }
}

/// The driven coil's force has no passive part: it is the magnet's rule in the coil's field.
#[test]
fn the_driven_coils_force_on_the_whole_magnet_is_that_of_finite_elements() {
    let winding = Winding {
        inner_radius_m: 0.012,
        outer_radius_m: 0.019,
        length_m: 0.1,
        turns: 1429.0,
    };
    let coil = CoredCoil::new(&winding, CORE, 1000.0, 1e-6, 0.01).unwrap();
    // Positive current pulls: the moment points up, along B_z.
    for (z_m, row) in oracle() {
        let sources = Sources::Below { height_m: z_m };
        let rule = MagnetRule::cylinder(SIZE, [0.0, 0.0, moment()], sources, 1e-6).unwrap();
        let gradients: Vec<f64> = rule
            .nodes()
            .iter()
            .map(|node| {
                let [x, y, z] = node.offset_m;
                coil.field(x.hypot(y), z_m + z).unwrap().dbz_dz
            })
            .collect();
        let found = 2.0 * rule.vertical_force_n(&gradients);
        let expected = row["current_2A_finite_magnet_N"].as_f64().unwrap();
        assert!(
            (found / expected - 1.0).abs() < 2.0 * ORACLE_ERROR,
            "{z_m}: {found} {expected}"
        );
        let dipole = 2.0 * moment() * coil.field(0.0, z_m).unwrap().dbz_dz;
        let expected = row["dipole_2A_N"].as_f64().unwrap();
        assert!(
            (dipole / expected - 1.0).abs() < 2.0 * ORACLE_ERROR,
            "{z_m}"
        );
    }
}

/// Over a plane of infinite permeability the steel is an image dipole at twice the height.
#[test]
fn close_to_a_wide_face_it_is_the_image() {
    let shape = CoreShape {
        radius_m: 0.07,
        bottom_m: -0.09,
        top_m: 0.013,
    };
    let pulled = Pulled {
        shape,
        relative_permeability: 1e7,
        region: Region {
            x_m: [-0.002, 0.002],
            y_m: [-0.002, 0.002],
            z_m: [0.02, 0.023],
        },
        ..one([0.0, 0.0])
    };
    let pull = PassivePull::new(&pulled, 1e-3).unwrap();
    let mut misses = Vec::new();
    for d in [0.007_f64, 0.0098] {
        let image = -3.0 * MU_0_T_M_PER_A * moment().powi(2) / (2.0 * PI * (2.0 * d).powi(4));
        let found = pull.force_n([0.0, 0.0, shape.top_m + d])[2];
        misses.push((found / image - 1.0).abs());
    }
    assert!(
        misses[0] < 3e-3,
        "{misses:?}, estimate {}",
        pull.relative_error
    );
}

#[test]
fn it_grows_with_the_moment_squared_and_keeps_its_shape_with_size() {
    let pull = PassivePull::new(&one([0.013, 0.04]), 1e-3).unwrap();
    let (k, s) = (1.7, 3.1);
    let region = one([s * 0.013, s * 0.04]).region;
    let scaled = Pulled {
        shape: CoreShape {
            radius_m: s * CORE.radius_m,
            bottom_m: s * CORE.bottom_m,
            top_m: 0.0,
        },
        moment_a_m2: [0.0, 0.0, -k * moment()],
        region: Region {
            x_m: region.x_m.map(|x| s * x),
            y_m: region.y_m.map(|y| s * y),
            ..region
        },
        ..one([0.0, 0.0])
    };
    let larger = PassivePull::new(&scaled, 1e-3).unwrap();
    for at in [
        [0.0, 0.0, 0.013],
        [0.007, -0.011, 0.022],
        [0.03, 0.021, 0.037],
    ] {
        let (a, b) = (pull.force_n(at), larger.force_n(at.map(|v| s * v)));
        let size = norm(b);
        for (a, b) in a.iter().zip(b) {
            let expected = a * k * k / s.powi(4);
            assert!((b - expected).abs() < 1e-9 * size, "{b} {expected}");
        }
    }
}

#[test]
fn air_pulls_nothing_and_steel_always_pulls_down() {
    let positions = [[-0.021, 0.0], [0.021, 0.0], [0.0, 0.037]];
    let array = Pulled {
        positions_m: &positions,
        coupled: true,
        moment_a_m2: [0.31 * moment(), -0.22 * moment(), 0.9 * moment()],
        ..one([0.015, 0.06])
    };
    let air = Pulled {
        relative_permeability: 1.0,
        ..array
    };
    let none = PassivePull::new(&air, 1e-3).unwrap();
    assert_eq!(none.force_n([0.003, 0.004, 0.02]), [0.0; 3]);
    assert_eq!(none.relative_error, 0.0);
    let pull = PassivePull::new(&array, 1e-2).unwrap();
    for k in 0..60 {
        let part = |step: f64| (step * f64::from(k)).fract();
        let at = [
            -0.03 + 0.06 * part(0.671),
            -0.03 + 0.06 * part(0.549),
            0.015 + 0.045 * part(0.819),
        ];
        assert!(pull.force_n(at)[2] < 0.0, "{at:?}");
    }
}

#[test]
fn a_symmetric_array_pulls_symmetrically_and_the_force_has_no_curl() {
    let d = 0.0215;
    let square = [[-d, -d], [d, -d], [-d, d], [d, d]];
    let pulled = Pulled {
        positions_m: &square,
        coupled: true,
        ..one([0.02, 0.05])
    };
    let pull = PassivePull::new(&pulled, 1e-3).unwrap();
    assert!(pull.relative_error < 2e-3, "{}", pull.relative_error);
    assert!(pull.coupling_share > 0.03);
    let at = [0.013, 0.0071, 0.027];
    let [fx, fy, fz] = pull.force_n(at);
    let size = norm([fx, fy, fz]);
    let turned = pull.force_n([-at[1], at[0], at[2]]);
    let mirrored = pull.force_n([at[0], -at[1], at[2]]);
    for (found, expected) in [(turned, [-fy, fx, fz]), (mirrored, [fx, -fy, fz])] {
        for (f, e) in found.iter().zip(expected) {
            assert!((f - e).abs() < 1e-9 * size, "{found:?} {expected:?}");
        }
    }
    let many = pull.forces_z_n(&[at, [at[0], -at[1], at[2]]]);
    assert!((many[0] - fz).abs() < 1e-12 * size && (many[1] - fz).abs() < 1e-9 * size);
    // F = -grad W: the work around a small rectangle vanishes.
    let h = 1e-4;
    let shifted = |axis: usize, by: f64| {
        let mut p = at;
        p[axis] += by;
        pull.force_n(p)
    };
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        let a = (shifted(i, h)[j] - shifted(i, -h)[j]) / (2.0 * h);
        let b = (shifted(j, h)[i] - shifted(j, -h)[i]) / (2.0 * h);
        assert!((a - b).abs() < 1e-4 * size / 0.01, "{i}{j}: {a} {b}");
    }
}

#[test]
fn the_estimate_holds_for_tilted_magnets_and_coupled_cores() {
    let positions = [[0.0, 0.0], [0.038, 0.011], [-0.027, 0.031]];
    let tilted = [0.4 * moment(), -0.3 * moment(), 0.75f64.sqrt() * moment()];
    for size in [None, Some(SIZE)] {
        let pulled = Pulled {
            positions_m: &positions,
            coupled: true,
            moment_a_m2: tilted,
            size,
            ..one([0.021, 0.05])
        };
        let coarse = PassivePull::new(&pulled, 1e-2).unwrap();
        let fine = PassivePull::new(&pulled, 2e-4).unwrap();
        assert!(coarse.relative_error <= 1.5e-2, "{}", coarse.relative_error);
        let mut worst = 0.0_f64;
        for k in 0..80 {
            let part = |step: f64| (step * f64::from(k)).fract();
            let at = [
                -0.03 + 0.06 * part(0.671),
                -0.03 + 0.06 * part(0.549),
                0.021 + 0.029 * part(0.819),
            ];
            let (a, b) = (coarse.force_n(at), fine.force_n(at));
            let miss = norm(std::array::from_fn(|i| a[i] - b[i]));
            worst = worst.max(miss / norm(b));
        }
        let allowed = 1.5 * coarse.relative_error + fine.relative_error;
        assert!(worst <= allowed, "{worst:e} {allowed:e}");
    }
}

#[test]
fn what_cannot_be_is_said() {
    let touching = Pulled {
        size: Some(SIZE),
        ..one([0.004, 0.05])
    };
    assert!(matches!(
        PassivePull::new(&touching, 1e-3),
        Err(NoPull::Magnet(_))
    ));
    let inside = one([-0.001, 0.05]);
    assert!(matches!(
        PassivePull::new(&inside, 1e-3),
        Err(NoPull::TouchesSteel { .. })
    ));
    let overlap = Pulled {
        positions_m: &[[0.0, 0.0], [0.02, 0.01]],
        ..one([0.02, 0.05])
    };
    assert!(matches!(
        PassivePull::new(&overlap, 1e-3),
        Err(NoPull::CoresOverlap { .. })
    ));
    let nan = Pulled {
        relative_permeability: f64::NAN,
        ..one([0.02, 0.05])
    };
    assert!(matches!(
        PassivePull::new(&nan, 1e-3),
        Err(NoPull::NotANumber)
    ));
}

/// Each core's field at the others takes a sixth off the pull of nine at 50 mm.
#[test]
fn the_coupling_of_nine_cores_is_no_small_correction() {
    let positions: Vec<[f64; 2]> = (0..9)
        .map(|i| [0.05 * f64::from(i % 3 - 1), 0.05 * f64::from(i / 3 - 1)])
        .collect();
    let alone = Pulled {
        positions_m: &positions,
        region: Region {
            x_m: [-0.05, 0.05],
            y_m: [-0.05, 0.05],
            z_m: [0.05, 0.05],
        },
        ..one([0.05, 0.05])
    };
    let coupled = Pulled {
        coupled: true,
        ..alone
    };
    let [alone, coupled] = [alone, coupled].map(|p| PassivePull::new(&p, 1e-3).unwrap());
    assert_eq!(alone.coupling_share, 0.0);
    for pull in [&alone, &coupled] {
        assert!(pull.relative_error <= 1e-3, "{}", pull.relative_error);
    }
    let at = [0.0, 0.0, 0.05];
    let ratio = coupled.force_n(at)[2] / alone.force_n(at)[2];
    assert!((ratio - 0.8495).abs() < 2e-3, "{ratio}");
}

/// Regression: the magnet's dipoles magnetise the core and feel it, but their rule's error counted once, as in a field.
#[test]
fn far_away_the_error_of_the_magnets_rule_is_that_of_both_its_parts() {
    for (size_m, z_m) in [(0.01, 0.2), (0.01, 0.3), (0.003, 0.06)] {
        let size = Some(Cylinder {
            diameter_m: size_m,
            length_m: size_m,
        });
        let pulled = Pulled {
            size,
            ..one([z_m, 1.1 * z_m])
        };
        let at = |tolerance| {
            let pull = PassivePull::new(&pulled, tolerance).unwrap();
            (pull.force_n([0.0, 0.0, z_m])[2], pull.relative_error)
        };
        let [(loose, stated), (fine, finer)] = [at(1e-3), at(1e-5)];
        let miss = (loose / fine - 1.0).abs();
        assert!(
            miss < stated + finer && finer < 0.1 * stated,
            "{size_m} {z_m}: {miss:e} {stated:e} {finer:e}"
        );
    }
}
