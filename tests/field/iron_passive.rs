//! The pull of unpowered steel of any shape: images, cores by the axisymmetric route, energy.

use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_field::iron::bodies::{Coils, Iron, Outline, Plate};
use fluxform_field::iron::passive::IronPull;
use fluxform_field::magnet::Cylinder;
use fluxform_field::steel::CoreShape;
use fluxform_field::steel::passive::magnet::PassiveMagnet;
use fluxform_field::steel::passive::{PassivePull, Pulled, Region};
use fluxform_field::winding::Winding;
use std::f64::consts::PI;

const WINDING: Winding = Winding {
    inner_radius_m: 0.012,
    outer_radius_m: 0.019,
    length_m: 0.1,
    turns: 1429.0,
};
const SHAPE: CoreShape = CoreShape {
    radius_m: 0.012,
    bottom_m: -0.11,
    top_m: 0.0,
};
const MOMENT_A_M2: [f64; 3] = [0.13, -0.21, -0.7];

fn coils(positions_m: &[[f64; 2]], core: Option<(CoreShape, f64)>) -> Coils<'_> {
    Coils {
        winding: WINDING,
        positions_m,
        core,
    }
}

fn dipole(moment_a_m2: [f64; 3], top_m: f64, lowest_m: f64) -> PassiveMagnet {
    PassiveMagnet::new(moment_a_m2, None, top_m, lowest_m, 1e-6).unwrap()
}

fn plate(outline: Outline, top_m: f64, thickness_m: f64, chi: f64) -> Plate {
    Plate {
        outline,
        centre_m: [0.0, 0.0],
        top_m,
        thickness_m,
        chi,
        holes: Vec::new(),
    }
}

fn length(force: [f64; 3]) -> f64 {
    force.iter().map(|f| f * f).sum::<f64>().sqrt()
}

/// Above a half space of permeability mu the image of a dipole m at the height d pulls it down with
/// (mu - 1) / (mu + 1) 3 mu_0 (m^2 + m_z^2) / (64 pi d^4).
fn image_force_n(mu: f64, height_m: f64) -> f64 {
    let square = length(MOMENT_A_M2).powi(2) + MOMENT_A_M2[2].powi(2);
    -(mu - 1.0) / (mu + 1.0) * 3.0 * MU_0_T_M_PER_A * square / (64.0 * PI * height_m.powi(4))
}

#[test]
fn a_large_thick_plate_pulls_a_dipole_as_its_image_does() {
    let height_m = 0.013;
    for (mu, tier) in [(1.7, 2), (7.0, 2), (1e6, 2)] {
        let thick = plate(Outline::Rectangle([0.24, 0.2]), -0.11, 0.1, mu - 1.0);
        let iron = Iron::new(coils(&[[0.0, 0.0]], None), Some(&thick)).unwrap();
        let magnet = dipole(MOMENT_A_M2, -0.11, -0.11 + height_m);
        let pull = IronPull::at_resolution(&iron, magnet, tier).unwrap();
        let place = [0.004, -0.003, -0.11 + height_m];
        let force = pull.forces_n(&[place])[0];
        let image = image_force_n(mu, height_m);
        assert!(
            (force[2] / image - 1.0).abs() < 5e-3,
            "{mu}: {force:?} {image}"
        );
        assert!(force[0].hypot(force[1]) < 5e-3 * image.abs(), "{force:?}");
    }
}

/// Four cores without a plate, which the axisymmetric solver has too.
#[test]
fn cores_pull_as_the_axisymmetric_route_has_it() {
    let positions_m: Vec<[f64; 2]> = (0..4)
        .map(|k| {
            [
                0.05 * f64::from(k % 2) - 0.025,
                0.06 * f64::from(k / 2) - 0.03,
            ]
        })
        .collect();
    let size = Cylinder {
        diameter_m: 0.01,
        length_m: 0.008,
    };
    let region = Region {
        x_m: [-0.03, 0.03],
        y_m: [-0.03, 0.03],
        z_m: [0.021, 0.05],
    };
    let iron = Iron::new(coils(&positions_m, Some((SHAPE, 999.0))), None).unwrap();
    let places = [
        [0.025, 0.03, 0.021],
        [0.001, -0.002, 0.021],
        [-0.027, 0.013, 0.035],
    ];
    for size in [None, Some(size)] {
        let pulled = Pulled {
            shape: SHAPE,
            relative_permeability: 1000.0,
            positions_m: &positions_m,
            coupled: true,
            moment_a_m2: MOMENT_A_M2,
            size,
            region,
        };
        let known = PassivePull::new(&pulled, 1e-4).unwrap();
        let magnet = PassiveMagnet::new(MOMENT_A_M2, size, 0.0, 0.021, 1e-3).unwrap();
        let pull = IronPull::new(&iron, magnet, &places, 1e-2).unwrap();
        assert!(pull.relative_error < 1e-2, "{}", pull.relative_error);
        for (at, force) in places.iter().zip(pull.forces_n(&places)) {
            let exact = known.force_n(*at);
            let apart = length(std::array::from_fn(|i| force[i] - exact[i])) / length(exact);
            assert!(
                apart < pull.relative_error + known.relative_error,
                "{apart}"
            );
        }
    }
}

/// Panels were parts of the steel's size, however close the magnet: 16 % off, and 0.7 stated.
#[test]
fn regression_steel_much_larger_than_the_magnet_s_height_was_cut_coarsely() {
    let height_m = 0.016;
    let wide = plate(Outline::Rectangle([0.6, 0.6]), -0.11, 0.1, 1e5);
    let iron = Iron::new(coils(&[[0.0, 0.0]], None), Some(&wide)).unwrap();
    let places = [[0.0, 0.0, 0.0], [0.017, -0.008, 0.0], [-0.02, 0.02, 0.02]]
        .map(|[x, y, z]| [x, y, z + height_m - 0.11]);
    let magnet = dipole(MOMENT_A_M2, -0.11, height_m - 0.11);
    let pull = IronPull::new(&iron, magnet, &places, 1e-2).unwrap();
    assert!(pull.relative_error < 1e-2, "{}", pull.relative_error);
    for (at, force) in places.iter().zip(pull.forces_n(&places)) {
        let exact = image_force_n(1e5, at[2] + 0.11);
        // The sides are far, not infinitely so.
        assert!(
            (force[2] / exact - 1.0).abs() < pull.relative_error + 2e-3,
            "{force:?} {exact}"
        );
    }
}

#[test]
fn the_force_of_a_plate_is_the_slope_of_the_energy() {
    let positions_m = [[-0.025, 0.0], [0.025, 0.0]];
    let joined = plate(
        Outline::Rectangle([0.09, 0.05]),
        SHAPE.bottom_m,
        0.005,
        999.0,
    );
    let with = coils(&positions_m, Some((SHAPE, 999.0)));
    let iron = Iron::new(with, Some(&joined)).unwrap();
    let pull = IronPull::at_resolution(&iron, dipole(MOMENT_A_M2, 0.0, 0.01), 1).unwrap();
    let place = [0.013, 0.004, 0.017];
    let force = pull.forces_n(&[place])[0];
    let step = 5e-4;
    for axis in 0..3 {
        let places = [-2.0, -1.0, 1.0, 2.0].map(|k| {
            let mut at = place;
            at[axis] += k * step;
            at
        });
        let w = pull.energies_j(&places);
        let slope = -(w[0] - 8.0 * w[1] + 8.0 * w[2] - w[3]) / (12.0 * step);
        assert!(
            (force[axis] - slope).abs() < 2e-3 * length(force),
            "{axis}: {force:?} {slope}"
        );
    }
    // Steel that is hardly any pulls hardly at all, by as much less.
    let pulls = [1e-3, 1e-6].map(|chi| {
        let faint = Plate {
            chi,
            ..joined.clone()
        };
        let with = coils(&positions_m, Some((SHAPE, chi)));
        let iron = Iron::new(with, Some(&faint)).unwrap();
        let pull = IronPull::at_resolution(&iron, dipole(MOMENT_A_M2, 0.0, 0.01), 0).unwrap();
        length(pull.forces_n(&[place])[0])
    });
    assert!(pulls[0] < 2e-3 * length(force), "{pulls:?}");
    assert!((pulls[0] / pulls[1] / 1e3 - 1.0).abs() < 1e-2, "{pulls:?}");
}
