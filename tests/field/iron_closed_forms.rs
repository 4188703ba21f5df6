//! Bodies of steel against closed forms and series; the table of their errors.

use std::f64::consts::PI;

use cpu_time::ProcessTime;
use nalgebra::{DMatrix, DVector};

use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_field::components::Components;
use fluxform_field::iron::array::{IronArray, RESOLUTIONS};
use fluxform_field::iron::bodies::{Coils, Iron, Outline, Plate, cuboid, tube};
use fluxform_field::iron::face::{Face, Point};
use fluxform_field::iron::mesh_body::mesh;
use fluxform_field::iron::uniform::InUniformField;
use fluxform_field::steel::clearance::Clearance;
use fluxform_field::winding::Winding;
use fluxform_testing::boxes::block;

const UP: Point = [0.0, 0.0, 1.0];
const TERMS: usize = 400;

fn solved(bodies: &[Vec<Face>], chi: f64, tier: usize) -> InUniformField {
    let bodies: Vec<(Vec<Face>, f64)> = bodies.iter().map(|body| (body.clone(), chi)).collect();
    InUniformField::new(&bodies, UP, tier)
}

fn moment_m3(bodies: &[Vec<Face>], chi: f64, tier: usize) -> f64 {
    solved(bodies, chi, tier).moment_m3()[2]
}

fn shifted(faces: Vec<Face>, z_m: f64) -> Vec<Face> {
    let moved = |face: Face| face.moved(|p| p, [0.0, 0.0, z_m]);
    faces.into_iter().map(moved).collect()
}

/// Unknowns, and the error relative to what is exact.
type Outcome = (usize, f64);

fn of_moment(bodies: &[Vec<Face>], chi: f64, exact_m3: f64, tier: usize) -> Outcome {
    let found = solved(bodies, chi, tier);
    (found.size(), found.moment_m3()[2] / exact_m3 - 1.0)
}

fn sphere(chi: f64, tier: usize) -> Outcome {
    let exact = 4.0 * PI * 0.343 * chi / (chi + 3.0);
    of_moment(&[Face::ball([0.3, -0.1, 0.2], [0.7; 3])], chi, exact, tier)
}

/// V chi / (1 + N chi), N of a spheroid with c = 2 a: 0.1736.
fn spheroid(tier: usize) -> Outcome {
    let eccentricity = 0.75_f64.sqrt();
    let n = (1.0 - eccentricity.powi(2)) / eccentricity.powi(2)
        * (eccentricity.atanh() / eccentricity - 1.0);
    let chi = 300.0;
    let exact = 4.0 / 3.0 * PI * 0.7 * 0.7 * 1.4 * chi / (1.0 + n * chi);
    let body = Face::ball([0.0; 3], [0.7, 0.7, 1.4]);
    of_moment(&[body], chi, exact, tier)
}

const SHELL: (f64, f64, f64) = (0.9, 1.0, 200.0);

fn shell() -> (Vec<Face>, f64) {
    let (inner, outer, mu) = SHELL;
    let mut shell = Face::ball([0.0; 3], [outer; 3]);
    let cavity = Face::ball([0.0; 3], [inner; 3]).into_iter();
    shell.extend(cavity.map(Face::turned));
    let ratio = (inner / outer).powi(3);
    let below = (2.0 * mu + 1.0) * (mu + 2.0) - 2.0 * ratio * (mu - 1.0).powi(2);
    (shell, below)
}

/// Jackson 5.121: the moment of a shell.
fn shell_moment(tier: usize) -> Outcome {
    let (inner, outer, mu) = SHELL;
    let (faces, below) = shell();
    let alpha = (2.0 * mu + 1.0) * (mu - 1.0) / below * (outer.powi(3) - inner.powi(3));
    of_moment(&[faces], mu - 1.0, 4.0 * PI * alpha, tier)
}

/// The same: what is left of the field inside, 9 mu over the denominator, about 1/16 here.
fn shell_cavity(tier: usize) -> Outcome {
    let (faces, below) = shell();
    let found = solved(&[faces], SHELL.2 - 1.0, tier);
    let left = found.field_t_m_per_a([0.13, -0.27, 0.31])[2] / MU_0_T_M_PER_A;
    (found.size(), left / (9.0 * SHELL.2 / below) - 1.0)
}

/// The moment of two unit spheres in a field along the line of their centres, by multipoles about both:
/// A_m = k_m (delta_m1 + sum_n C(n + m, m) A_n / d^(n + m + 1)), k_m = m chi / (m (chi + 2) + 1).
fn two_spheres_m3(chi: f64, gap: f64) -> f64 {
    let distance = 2.0 + gap;
    let k = |m: usize| m as f64 * chi / (m as f64 * (chi + 2.0) + 1.0);
    let mut matrix = DMatrix::<f64>::identity(TERMS, TERMS);
    for n in 1..=TERMS {
        let mut value = distance.powi(-(n as i32) - 1);
        for m in 1..=TERMS {
            value *= (n + m) as f64 / (m as f64 * distance);
            matrix[(m - 1, n - 1)] -= k(m) * value;
        }
    }
    let mut rhs = DVector::zeros(TERMS);
    rhs[0] = k(1);
    let solution = matrix.lu().solve(&rhs).expect("the matrix is regular");
    8.0 * PI * solution[0]
}

fn two_spheres(gap: f64, tier: usize) -> Outcome {
    let chi = 999.0;
    let at = |sign: f64| shifted(Face::ball([0.0; 3], [1.0; 3]), sign * (1.0 + 0.5 * gap));
    of_moment(&[at(-1.0), at(1.0)], chi, two_spheres_m3(chi, gap), tier)
}

/// A winding above a plate without end, by layered images: k = (mu - 1) / (mu + 1), the mirrored winding
/// times k, and below it by 2 t j further ones times -k (1 - k^2) k^(2 (j - 1)).
fn wide_plate(tier: usize) -> Outcome {
    let coil = Winding {
        inner_radius_m: 0.008,
        outer_radius_m: 0.011,
        length_m: 0.004,
        turns: 37.0,
    };
    let alone = Coils {
        winding: coil,
        positions_m: &[[0.0, 0.0]],
        core: None,
    };
    let (mu, thickness_m, top_m) = (20.0, 0.002, -0.010);
    let plate = Plate {
        outline: Outline::Round(0.4),
        centre_m: [0.0, 0.0],
        top_m,
        thickness_m,
        chi: mu - 1.0,
        holes: Vec::new(),
    };
    let iron = Iron::new(alone, Some(&plate)).unwrap();
    let array = IronArray::at_resolution(alone, &iron, 1e-6, tier).unwrap();
    let (r, z) = (0.003, 0.009);
    let mut found = [0.0];
    let sources = array.sources(Clearance::above(z, z), 1e-8);
    sources.sample(&[[r, 0.0, z]], Components::Gz, &mut found);
    let k = (mu - 1.0) / (mu + 1.0);
    let image = |shift_m: f64| {
        let height_m = z - 2.0 * top_m - coil.length_m + shift_m;
        coil.field(r, height_m).unwrap().dbz_dz
    };
    let further = (1..TERMS as i32).map(|j| {
        let shift_m = 2.0 * thickness_m * f64::from(j);
        -k * (1.0 - k * k) * k.powi(2 * (j - 1)) * image(shift_m)
    });
    let exact = k * image(0.0) + further.sum::<f64>();
    (array.size(), found[0] / exact - 1.0)
}

/// A body's name, its solution at a resolution, and the largest error at resolution 2.
type Case = (&'static str, fn(usize) -> Outcome, f64);

const CASES: [Case; 7] = [
    ("sphere, mu 1000: moment", |tier| sphere(999.0, tier), 1e-4),
    ("spheroid 2 : 1, mu 301: moment", spheroid, 5e-4),
    ("shell 0.9 : 1, mu 200: moment", shell_moment, 1e-3),
    ("the same: field inside", shell_cavity, 1e-2),
    (
        "two spheres 0.1 radii apart, mu 1000: moment",
        |tier| two_spheres(0.1, tier),
        1e-3,
    ),
    (
        "two spheres 0.01 radii apart, mu 1000: moment",
        |tier| two_spheres(0.01, tier),
        3e-2,
    ),
    (
        "winding above a wide plate, mu 20: gradient",
        wide_plate,
        1e-2,
    ),
];

#[test]
fn bodies_have_the_moments_and_fields_of_closed_forms() {
    for (name, outcome, bound) in CASES {
        let (size, error) = outcome(2);
        assert!(error.abs() < bound, "{name}: {error} with {size} unknowns");
    }
}

/// The series itself: point dipoles far apart, and its own limit.
#[test]
fn the_series_of_two_spheres_has_its_limits() {
    let apart = two_spheres_m3(1e9, 8.0) / (8.0 * PI);
    assert!((apart * (1.0 - 2.0 / 1e3) - 1.0).abs() < 1e-5, "{apart}");
    // Of steel that touches: twice zeta(3), to which ever smaller gaps come from below.
    let near = two_spheres_m3(1e9, 1e-3) / (8.0 * PI);
    let nearer = two_spheres_m3(1e9, 3e-4) / (8.0 * PI);
    assert!(near < nearer && nearer < 2.404_113_8, "{near} {nearer}");
}

#[test]
#[ignore = "prints a table; takes minutes"]
#[expect(clippy::print_stdout, reason = "the table is what it is for")]
fn error_against_unknowns() {
    println!("| case | unknowns | CPU s | relative error | order |\n|---|---|---|---|---|");
    for (name, outcome, _) in CASES {
        let mut before: Option<Outcome> = None;
        for tier in 0..RESOLUTIONS.len() {
            let start = ProcessTime::now();
            let (size, error) = outcome(tier);
            let cpu_s = start.elapsed().as_secs_f64();
            // Without edges some resolutions are the same.
            if before.is_some_and(|(fewer, _)| fewer == size) {
                continue;
            }
            // Of the panels' length, which goes with the root of the unknowns.
            let order = before.map_or(String::new(), |(fewer, larger)| {
                let finer = (size as f64 / fewer as f64).sqrt();
                format!("{:.1}", (larger / error).abs().ln() / finer.ln())
            });
            println!("| {name} | {size} | {cpu_s:.2} | {error:.1e} | {order} |");
            before = Some((size, error));
        }
    }
}

#[test]
fn a_sphere_has_its_moment_at_any_permeability() {
    for chi in [1e-9, 0.7, 999.0, 1e9] {
        let (_, error) = sphere(chi, 2);
        assert!(error.abs() < 1e-4, "{chi}: {error}");
    }
}

/// A cube's polarisability by its mesh and by its faces.
#[test]
fn a_mesh_is_the_body_that_it_bounds() {
    let chi = 50.0;
    let faces = moment_m3(&[cuboid([1.0, 1.3, 0.8])], chi, 2);
    let triangles = block([-0.5, -0.65, -0.4], [0.5, 0.65, 0.4]);
    // The diagonals alone are not sharp.
    let sharp = |number: usize, side: usize| {
        if number.is_multiple_of(2) {
            side != 2
        } else {
            side != 0
        }
    };
    let meshed = moment_m3(&[mesh(&triangles, 1.0, sharp)], chi, 1);
    assert!((meshed / faces - 1.0).abs() < 2e-3, "{meshed} {faces}");
}

/// Two tubes end to end, apart by less and less, come to one.
#[test]
fn bodies_close_to_each_other_act_as_one() {
    let half = |z: f64| shifted(tube(0.3, 0.5, 1.0), z);
    let one = moment_m3(&[tube(0.3, 0.5, 2.0)], 20.0, 1);
    let apart = |gap: f64| moment_m3(&[half(0.5 + 0.5 * gap), half(-0.5 - 0.5 * gap)], 20.0, 1);
    let (near, far) = (apart(1e-3) / one, apart(1e-1) / one);
    assert!(far < near && near < 1.0 && near > 0.97, "{near} {far}");
}
