//! A hundred random scenes through map, heights and lambda: what `accuracy` claims of every stage
//! against the truth, which is computed by another route or much more finely.
//!
//! A claim must cover the true error in every scene, and not by more than a factor of a hundred in
//! the median.
//! `cargo test -p fluxform-bench --test stages -- --nocapture a_hundred` prints the figures.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use fluxform::commands::bench::clock::quartiles;
use fluxform::commands::lambda::{LambdaOptions, run};
use fluxform::design::{Design, Need};
use fluxform::lambda::{self, ForceProblem, Settings};
use fluxform::map::Components;
use fluxform::map::tabulate::Grid;
use fluxform::numerics::axis::Axis;
use fluxform::numerics::lagrange::locate;
use fluxform::point_weights::Weights;
use fluxform::progress::Silent;
use fluxform::scene::Scene;
use fluxform::scene::maps::{MagnetMean, SceneMap};
use fluxform::scene::steel::{self, Solved};
use fluxform::shape::Surface;
use fluxform::shape::document::ShapeDocument;
use fluxform::shape::height::Grid as Plan;
use fluxform_testing::Random;

use fluxform_testing::force_problems::Case;
use fluxform_testing::least_error;
use rayon::prelude::*;

const SCENES: u64 = 100;
/// A true error below this is the reference's own rounding and counts as so much.
const ROUNDING: f64 = 2.2e-16;
const MOST_MEDIAN: f64 = 100.0;
/// Contents of the bore.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Air,
    Cored,
    Coupled,
}

/// One claim and what is true of it.
struct Claim {
    stage: &'static str,
    claimed: f64,
    found: f64,
}

/// Sixty scenes in air, thirty of a cored coil, ten of a coupled pair.
fn kind(scene: u64) -> Kind {
    match scene % 10 {
        9 => Kind::Coupled,
        6..=8 => Kind::Cored,
        _ => Kind::Air,
    }
}

/// A design of random dimensions; lengths in millimetres.
fn design(kind: Kind, n: &mut Random) -> Design {
    let inner = n.between(4.0, 24.0);
    let depth = n.between(1.5, 9.0);
    let outer = inner + 2.0 * depth;
    let length = n.between(0.6, 3.0) * outer;
    let (rows, columns) = match kind {
        Kind::Air => (1 + (n.unit() * 2.0) as usize, 1 + (n.unit() * 2.0) as usize),
        Kind::Cored => (1, 1),
        Kind::Coupled => (1, 2),
    };
    let pitch = outer * n.between(1.05, 2.0);
    let half = n.between(0.6, 1.6) * outer;
    let low = n.between(0.35, 0.7) * outer;
    let core = if kind == Kind::Air {
        String::new()
    } else {
        format!(
            "[core]\nclearance_mm = {}\nabove_mm = {}\nbelow_mm = {}\nrelative_permeability = {}\n",
            n.between(0.0, 0.1) * inner,
            n.between(-0.2, 0.05) * outer,
            n.between(-0.2, 0.3) * outer,
            10.0_f64.powf(n.between(0.3, 3.5)),
        )
    };
    let text = format!(
        "name = \"random\"\n[coil]\ninner_diameter_mm = {inner}\nouter_diameter_mm = {outer}\n\
         length_mm = {length}\n[wire]\ndiameter_mm = 0.5\n{core}[array]\nrows = {rows}\n\
         columns = {columns}\npitch_mm = {pitch}\n[magnet]\ndiameter_mm = 2.0\nlength_mm = 2.0\n\
         [supply]\ncurrent_max_a = {}\n[workspace]\nx_mm = [{}, {half}, 17]\n\
         y_mm = [{}, {half}, 15]\nz_mm = [{low}, {}, 7]\n",
        n.between(0.5, 3.0),
        -half,
        -half,
        low + n.between(0.5, 1.5) * outer,
    );
    let read = Design::from_toml(&text, Path::new("random.toml"), Need::CALIBRATE);
    read.unwrap_or_else(|faults| panic!("{text}\n{faults}")).0
}

/// A random formula over the workspace's plan, its points on a grid; lengths in millimetres.
fn shape(design: &Design, n: &mut Random) -> ShapeDocument {
    let half = 1e3 * design.workspace.x_m.to;
    let [low, high] = [design.workspace.z_m.from, design.workspace.z_m.to].map(|z| 1e3 * z);
    let base = low + 0.1 * (high - low);
    let primitive = match (n.unit() * 3.0) as usize {
        0 => format!(
            "primitive = \"wedge\"\nside_mm = {}\nlow_mm = {base}\nhigh_mm = {}\n",
            2.2 * half,
            n.between(base, high)
        ),
        1 => format!(
            "primitive = \"half-cylinder\"\nradius_mm = {0}\nlength_mm = {1}\nbase_mm = {base}\n",
            n.between(1.02, 1.5) * half,
            2.2 * half
        ),
        _ => format!(
            "primitive = \"half-sphere\"\nradius_mm = {}\nbase_mm = {base}\n",
            n.between(1.5, 2.0) * half
        ),
    };
    let text = format!(
        "name = \"random\"\n{primitive}[points]\nx_mm = [{}, {half}, 9]\ny_mm = [{}, {half}, 8]\n",
        -half, -half
    );
    let read = ShapeDocument::from_toml(&text, Path::new("random.toml"));
    read.unwrap_or_else(|faults| panic!("{text}\n{faults}")).0
}

/// The same steel, much finer; in air the kernel itself.
fn truth(scene: &Scene, kind: Kind, lowest_m: f64) -> Solved {
    let tolerance = match kind {
        Kind::Air => 1e-15,
        Kind::Cored => 1e-9,
        Kind::Coupled => 2e-6,
    };
    steel::solve(scene, tolerance, lowest_m).unwrap()
}

/// |grad B| on the axis of coil 0, per height, T/m/A: at most the largest there.
fn sizes(scene: &Scene, exact: &Solved, z_m: &[f64]) -> Vec<f64> {
    let [x, y] = scene.coils[0].axis_m;
    let points: Vec<[f64; 3]> = z_m.iter().map(|z| [x, y, *z]).collect();
    let forces = scene.forces_n_per_a(exact, &points, &Silent).unwrap();
    let coils = scene.coils.len();
    let moment = scene.moment_a_m2[2];
    let rows = forces.chunks_exact(coils);
    // There the tensor is diag(-g/2, -g/2, g).
    rows.map(|row| 1.5_f64.sqrt() * (row[0] / moment).abs())
        .collect()
}

/// The map: its nodes, and between them.
fn map_claims(scene: &Scene, solved: &Solved, exact: &Solved, n: &mut Random) -> [Claim; 2] {
    let workspace = &scene.design.workspace;
    let grid = Grid {
        x_m: workspace.x_m.nodes(),
        y_m: workspace.y_m.nodes(),
        z_m: workspace.z_m.nodes(),
    };
    let felt = MagnetMean::field();
    let (coils, expected) = (&scene.coils, Components::Gz);
    let made = SceneMap::new(scene, solved, coils, &grid, expected, &felt, &Silent).unwrap();
    let (nx, ny, nz) = (grid.x_m.len(), grid.y_m.len(), grid.z_m.len());
    let moment = scene.moment_a_m2[2];
    let nodes: Vec<[usize; 3]> = (0..120)
        .map(|k| {
            let z = if k % 2 == 0 {
                0
            } else {
                (n.unit() * nz as f64) as usize
            };
            [
                (n.unit() * nx as f64) as usize,
                (n.unit() * ny as f64) as usize,
                z,
            ]
        })
        .collect();
    let places: Vec<[f64; 3]> = nodes
        .iter()
        .map(|[x, y, z]| [grid.x_m[*x], grid.y_m[*y], grid.z_m[*z]])
        .collect();
    let forces = scene.forces_n_per_a(exact, &places, &Silent).unwrap();
    let heights: Vec<f64> = places.iter().map(|p| p[2]).collect();
    let size = sizes(scene, exact, &heights);
    let mut found = 0.0_f64;
    for (row, [x, y, z]) in nodes.iter().enumerate() {
        for coil in 0..coils.len() {
            let value = made.map.gz_t_per_m_per_a[((coil * nz + z) * ny + y) * nx + x];
            let direct = forces[row * coils.len() + coil] / moment;
            found = found.max((value - direct).abs() / size[row]);
        }
    }
    let at_nodes = Claim {
        stage: "map",
        claimed: made.accuracy.estimate,
        found,
    };
    // Between the nodes, relative to the largest |dB_z/dz| at the height; the peak lies over an
    // axis or the winding's rim, within the workspace or not.
    let mut between = 0.0_f64;
    let step = |nodes: &[f64]| nodes[1] - nodes[0];
    let [dx, dy, dz] = [step(&grid.x_m), step(&grid.y_m), step(&grid.z_m)];
    for _ in 0..60 {
        let z = grid.z_m[0] + dz * n.between(0.0, 2.0);
        let plane: Vec<[f64; 3]> = (0..nx * ny)
            .map(|k| [grid.x_m[k % nx], grid.y_m[k / nx], z])
            .chain((0..40).map(|_| {
                let x = n.between(grid.x_m[0], grid.x_m[nx - 1] - dx);
                let y = n.between(grid.y_m[0], grid.y_m[ny - 1] - dy);
                [x, y, z]
            }))
            .collect();
        let forces = scene.forces_n_per_a(exact, &plane, &Silent).unwrap();
        let largest = forces.iter().fold(0.0_f64, |m, f| m.max(f.abs())) / moment.abs();
        for (row, place) in plane.iter().enumerate().skip(nx * ny) {
            let cell = locate([&grid.x_m, &grid.y_m, &grid.z_m], *place).expect("inside");
            for coil in 0..coils.len() {
                let whole = nx * ny * nz;
                let value =
                    cell.value(&made.map.gz_t_per_m_per_a[coil * whole..(coil + 1) * whole]);
                let direct = forces[row * coils.len() + coil] / moment;
                between = between.max((value - direct).abs() / largest);
            }
        }
    }
    let between = Claim {
        stage: "interpolation",
        claimed: made.between.largest,
        found: between,
    };
    [at_nodes, between]
}

/// The surface between the points, looked at in many places.
fn deviation_m(
    document: &ShapeDocument,
    plan: &Plan,
    height_m: impl Fn(usize) -> Option<f64>,
) -> f64 {
    let (surface, _) = Surface::open(document, &Silent).unwrap();
    let (nx, ny) = (plan.x_m.samples, plan.y_m.samples);
    let places = |axis: &Axis| Axis {
        samples: 16 * (axis.samples - 1) + 1,
        ..*axis
    };
    let fine = Plan {
        x_m: places(&plan.x_m),
        y_m: places(&plan.y_m),
    };
    let samples = surface.heights(&fine, &Silent).unwrap();
    let (fx, fy) = (fine.x_m.samples, fine.y_m.samples);
    let mut worst = 0.0_f64;
    for (k, sample) in samples.iter().enumerate() {
        let (i, j) = ((k % fx).min(fx - 2), (k / fx).min(fy - 2));
        let (ci, cj) = ((i / 16).min(nx - 2), (j / 16).min(ny - 2));
        let u = (k % fx) as f64 / 16.0 - ci as f64;
        let v = (k / fx) as f64 / 16.0 - cj as f64;
        let at = |di: usize, dj: usize| height_m((cj + dj) * nx + ci + di);
        if let (Some(s), Some(a), Some(b), Some(c), Some(d)) =
            (sample, at(0, 0), at(1, 0), at(0, 1), at(1, 1))
        {
            let patch = (1.0 - v) * (a + u * (b - a)) + v * (c + u * (d - c));
            worst = worst.max((s.height_m - patch).abs());
        }
    }
    worst
}

/// Points, forces and lambda, as `lambda` prints them.
fn lambda_claims(scene: &Scene, exact: &Solved, document: &ShapeDocument) -> Vec<Claim> {
    let options = LambdaOptions::default();
    let solved = run(scene.design, document, Vec::new(), &options, &Silent);
    let (points, report) = solved.unwrap();
    let claimed = |stage: &str| report.file.accuracy[stage].estimate;
    let points = &points.discretized.points;
    let plan = points.grid;
    let rows = points.row_of_grid_point();
    let height = |k: usize| rows[k].map(|row| points.height_m[row]);
    let mut claims = vec![Claim {
        stage: "grid",
        claimed: claimed("points_grid"),
        found: deviation_m(document, &plan, height),
    }];
    // The forces that lambda is solved from.
    let positions: Vec<[f64; 3]> = (0..points.len())
        .map(|k| [points.x_m[k], points.y_m[k], points.height_m[k]])
        .collect();
    let lowest_m = points.height_m.iter().fold(f64::INFINITY, |m, h| m.min(*h));
    let solved = steel::solve(scene, scene.tolerances.field, lowest_m).unwrap();
    let ours = scene.forces_n_per_a(&solved, &positions, &Silent).unwrap();
    let direct = scene.forces_n_per_a(exact, &positions, &Silent).unwrap();
    let moment = scene.moment_a_m2[2].abs();
    let coils = scene.coils.len();
    let size = sizes(scene, exact, &points.height_m);
    let off = ours.iter().zip(&direct).enumerate();
    let found = off.fold(0.0_f64, |most, (k, (a, b))| {
        most.max((a - b).abs() / (moment * size[k / coils]))
    });
    claims.push(Claim {
        stage: "forces",
        claimed: claimed("forces"),
        found,
    });
    // e* of these very forces, by trying every set of coils at their limits.
    let case = Case {
        heights: points.height_m.clone(),
        offset: None,
        lower: scene.lower_a.clone(),
        upper: scene.upper_a.clone(),
        total: scene.design.supply.total_current_max_a,
        ohm: scene.resistances_ohm(),
        forces: ours,
    };
    let problem: ForceProblem = case.problem();
    let solution = lambda::solve(&problem, &Settings::default()).unwrap();
    let reach = solution.constants.lambda_jnd_n_per_m.unwrap_or(1.0);
    let search = least_error::Search::new(&case);
    let found = [0.7, 1.0, 1.3].iter().fold(0.0_f64, |most, part| {
        let at = part * reach;
        let scale = at * at * case.mean_square();
        let least = search.least_error(at, true);
        most.max((solution.path.error_n2(at) - least).abs() / scale)
    });
    claims.push(Claim {
        stage: "lambda",
        claimed: claimed("lambda"),
        found,
    });
    claims.extend(points_claims(scene, document));
    claims
}

/// lambda of few points, equal and by area, against eight times as many along each axis.
fn points_claims(scene: &Scene, document: &ShapeDocument) -> Vec<Claim> {
    let solved = |document: &ShapeDocument, weights: Weights| {
        let options = LambdaOptions {
            weights: Some(weights),
            ..LambdaOptions::default()
        };
        let solved = run(scene.design, document, Vec::new(), &options, &Silent);
        solved.unwrap().1.file
    };
    let grid = [document.grid.x, document.grid.y];
    let fine = document.with_samples(grid.map(|axis| 8 * (axis.samples() - 1) + 1));
    let limit = solved(&fine, Weights::Area).lambda_n_per_m;
    let rules = [
        ("lambda of points", Weights::Equal),
        ("lambda of points by area", Weights::Area),
    ];
    let claims = rules.into_iter().filter_map(|(stage, weights)| {
        let file = solved(document, weights);
        let claimed = file.accuracy.get("lambda_of_points")?.estimate;
        let (lambda, limit) = file.lambda_n_per_m.zip(limit)?;
        Some(Claim {
            stage,
            claimed,
            found: (lambda / limit - 1.0).abs(),
        })
    });
    claims.collect()
}

fn claims(number: u64) -> Vec<Claim> {
    let mut n = Random::new(1_000 + number);
    let kind = kind(number);
    let design = design(kind, &mut n);
    let document = shape(&design, &mut n);
    let scene = Scene::new(&design).unwrap();
    let lowest_m = design.workspace.z_m.from;
    let exact = truth(&scene, kind, lowest_m);
    let solved = steel::solve(&scene, scene.tolerances.map, lowest_m).unwrap();
    let mut all = Vec::from(map_claims(&scene, &solved, &exact, &mut n));
    all.extend(lambda_claims(&scene, &exact, &document));
    all
}

#[test]
fn a_hundred_random_scenes_are_as_exact_as_they_claim() {
    let mut by_stage: BTreeMap<String, Vec<(u64, f64, f64)>> = BTreeMap::new();
    let mut all = Vec::new();
    let of_scenes: Vec<_> = (0..SCENES).into_par_iter().map(claims).collect();
    for (number, claims) in (0..).zip(of_scenes) {
        for claim in claims {
            let stage = match kind(number) {
                Kind::Air => format!("{}, air", claim.stage),
                Kind::Cored | Kind::Coupled => format!("{}, steel", claim.stage),
            };
            let row = (number, claim.claimed, claim.found);
            by_stage.entry(stage).or_default().push(row);
            all.push(claim.claimed / claim.found.max(ROUNDING));
        }
    }
    let mut faults = Vec::new();
    let mut table = String::from(
        "| stage | scenes | claimed over true error: least | quartile | median | quartile | most |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for (stage, rows) in &by_stage {
        let mut ratios: Vec<f64> = rows
            .iter()
            .map(|(_, claimed, found)| claimed / found.max(ROUNDING))
            .collect();
        let [low, median, high] = quartiles(&mut ratios);
        let _ = writeln!(
            table,
            "| {stage} | {} | {:.2} | {low:.2} | {median:.2} | {high:.2} | {:.1e} |",
            rows.len(),
            ratios[0],
            ratios[ratios.len() - 1]
        );
        for (number, claimed, found) in rows.iter().filter(|(_, c, f)| *c < f - ROUNDING) {
            let kind = kind(*number);
            faults.push(format!(
                "{stage}, scene {number} ({kind:?}): {claimed:e} < {found:e}"
            ));
        }
        if median > MOST_MEDIAN {
            faults.push(format!(
                "{stage}: {median:.0} times too large in the median"
            ));
        }
    }
    let [_, median, _] = quartiles(&mut all);
    let covered = if faults.iter().any(|fault| fault.contains('<')) {
        "Not all"
    } else {
        "All"
    };
    let _ = write!(
        table,
        "\n{covered} {} claims cover the truth, {median:.0} times in the median.\n",
        all.len()
    );
    println!("{table}");
    if let Some(path) = std::env::var_os("FLUXFORM_COVERAGE") {
        std::fs::write(path, &table).unwrap();
    }
    if median > MOST_MEDIAN {
        faults.push(format!("{median:.0} times too large in the median of all"));
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
