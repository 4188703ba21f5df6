//! A synthetic bundle of an analytic field, and helpers.

use std::collections::BTreeMap;
use std::path::Path;

use fluxform_base::accuracy::StageAccuracy;
use fluxform_base::force_constant::{Criterion, ForceConstants};
use fluxform_base::force_direction::{ForceDirection, NormalForce};
use fluxform_base::uncertainty::Uncertainty;
use fluxform_bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION, UNITS, sha256_hex};
use fluxform_bundle::atomic::WriteError;
use fluxform_bundle::json::to_json;
use fluxform_bundle::lambda_file::{AtLambda, LambdaFile, PathStep};
use fluxform_bundle::manifest::*;
use fluxform_bundle::npz::{MapArrays, Runtime, SIDES};
use fluxform_bundle::rendering::{HeightGrid, Rendering, Requested};
use fluxform_bundle::seal::sealed;
use fluxform_bundle::table::{CurrentRow, PointRow};
use fluxform_bundle::timing::StageSeconds;
use fluxform_bundle::write::{BundleContent, write_bundle};
use fluxform_lambda::uncertainty::RobustRuntime;
use fluxform_numerics::axis::Axis;
use serde_json::Value;

/// The text of a record that was changed, its own digest made again.
pub fn resealed(record: &str) -> Vec<u8> {
    let (bare, _) = record.rsplit_once(',').unwrap();
    sealed(format!("{bare}\n}}\n").into_bytes())
}

/// A bundle's manifest, edited, its own digest made again.
pub fn edit_manifest(target: &Path, edit: impl FnOnce(&mut Value)) {
    let path = target.join("manifest.json");
    let mut manifest: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    manifest.as_object_mut().unwrap().remove("record_sha256");
    edit(&mut manifest);
    std::fs::write(&path, sealed(to_json(&manifest).unwrap())).unwrap();
}

/// A bundle's `map.npz`, replaced, its size and digest in the manifest made again.
pub fn replace_map(target: &Path, bytes: &[u8]) {
    std::fs::write(target.join("map.npz"), bytes).unwrap();
    edit_manifest(target, |manifest| {
        let files = manifest["files"].as_array_mut().unwrap();
        let entry = files.iter_mut().find(|file| file["path"] == "map.npz");
        let entry = entry.unwrap();
        entry["bytes"] = bytes.len().into();
        entry["sha256"] = sha256_hex(bytes).into();
    });
}

/// A small bundle of an analytic field: a magnetic charge below each coil.
pub struct Sample {
    pub manifest: Manifest,
    pub map: MapArrays<'static>,
    pub points: Vec<PointRow>,
    pub currents: Vec<CurrentRow>,
    pub lambda: LambdaFile,
}

pub const CHARGE_DEPTH_M: f64 = 0.037;

/// dB_i/dx_j of coil charges q = 1e-4 T m^2 at (x0, y0, -depth).
pub fn gradient(coil_m: [f64; 2], at: [f64; 3]) -> [f64; 9] {
    let d = [at[0] - coil_m[0], at[1] - coil_m[1], at[2] + CHARGE_DEPTH_M];
    let r2 = d.iter().map(|v| v * v).sum::<f64>();
    let mut g = [0.0; 9];
    for i in 0..3 {
        for j in 0..3 {
            let delta = if i == j { r2 } else { 0.0 };
            g[3 * i + j] = 1e-4 * (delta - 3.0 * d[i] * d[j]) / r2.powf(2.5);
        }
    }
    g
}

/// A pull with no symmetry, N.
pub fn pull_n([x, y, z]: [f64; 3]) -> f64 {
    let away = (x - 0.013).powi(2) + (y + 0.021).powi(2) + (z + 0.04).powi(2);
    -3e-3 * (away / 0.0049).powf(-1.7)
}

pub fn sample(tilted: bool, samples: [usize; 3]) -> Sample {
    let axis = |from, to, samples| Axis { from, to, samples };
    let x = axis(-0.05, 0.05, samples[0]);
    let y = axis(-0.043, 0.051, samples[1]);
    let z = axis(0.01, if samples[2] > 1 { 0.08 } else { 0.01 }, samples[2]);
    let positions_m = vec![[-0.05, -0.05], [0.05, -0.05], [-0.05, 0.05], [0.05, 0.05]];
    let coil = vec![0i64, 1, 3]; // coil 2 carries no current and is left out
    let moment_a_m2 = if tilted {
        [0.13, -0.07, -0.89]
    } else {
        [0.0, 0.0, -0.90941]
    };
    let (mut gz, mut all) = (Vec::new(), Vec::new());
    for &c in &coil {
        for z in z.nodes() {
            for y in y.nodes() {
                for x in x.nodes() {
                    let g = gradient(positions_m[c as usize], [x, y, z]);
                    gz.push(g[8]);
                    all.extend(g);
                }
            }
        }
    }
    let (current_min_a, current_max_a) = (vec![0.0, -0.7, 0.0, 0.0], vec![2.0, 2.0, 1.3, 2.0]);
    let resistance_ohm = vec![6.07, 6.08, 6.09, 6.11];
    let currents_a = vec![1.3, -0.7, 0.0, 0.9];
    let mut map = MapArrays {
        x_m: x.nodes().into(),
        y_m: y.nodes().into(),
        z_m: z.nodes().into(),
        coil: coil.clone().into(),
        gz_t_per_m_per_a: gz.into(),
        sides_t_per_m_per_a: None,
        gradient_t_per_m_per_a: tilted.then(|| all.into()),
        field_t_per_a: None,
        passive_force_n: None,
        working_point_gz_t_per_m: None,
        runtime: Runtime {
            moment_a_m2,
            current_min_a: current_min_a.clone(),
            current_max_a: current_max_a.clone(),
            resistance_ohm: resistance_ohm.clone(),
            total_current_max_a: Some(5.3),
            lambda_n_per_m: Some(5.9878),
            rendering: None,
        },
    };
    let grid = axis(-0.04, 0.04, 5);
    let present: Vec<bool> = (0..25).map(|n| n != 0 && n != 24).collect();
    let points: Vec<PointRow> = (0..25)
        .filter(|&n| present[n])
        .map(|n| PointRow {
            x_m: grid.node(n % 5),
            y_m: grid.node(n / 5),
            height_m: 0.03 + 0.001 * n as f64,
            normal: [0.0, 0.6, 0.8],
        })
        .collect();
    let points_grid = PointsGrid::new(grid, grid, &present);
    let inductance_h = vec![
        vec![0.21, -0.02, -0.02, -0.01],
        vec![-0.02, 0.22, -0.01, -0.02],
        vec![-0.02, -0.01, 0.19, -0.02],
        vec![-0.01, -0.02, -0.02, 0.2],
    ];
    map.runtime.rendering = Some(Rendering {
        heights: HeightGrid::of_points(&points_grid, &points).unwrap(),
        static_current_a: currents_a.clone(),
        inductance_h: inductance_h.concat(),
        voltage_v: Some(36.0),
        requested: None,
        robust: None,
    });
    let accuracy = BTreeMap::from([(
        "map".to_owned(),
        StageAccuracy {
            estimate: 1e-9,
            relative_to: "largest |grad B| at that height".to_owned(),
            method: "a-priori bound".to_owned(),
        },
    )]);
    let inputs = vec![
        Input::of_bytes("designs/a.toml", b"design"),
        Input::of_bytes("shapes/b.toml", b"shape"),
    ];
    let currents = (0..4)
        .map(|coil| CurrentRow {
            coil,
            x_m: positions_m[coil][0],
            y_m: positions_m[coil][1],
            current_a: currents_a[coil],
        })
        .collect();
    let lambda = LambdaFile {
        schema_version: SCHEMA_VERSION.to_owned(),
        fluxform_version: FLUXFORM_VERSION.to_owned(),
        design: "a".to_owned(),
        shape: "b".to_owned(),
        inputs: inputs.clone(),
        constants: ForceConstants {
            lambda_linear_n_per_m: Some(4.9429),
            lambda_jnd_n_per_m: Some(6.007),
            lambda_saturation_n_per_m: Some(5.9878),
            lambda_maxmin_n_per_m: Some(6.1),
            lambda_floor_n_per_m: None,
        },
        lambda_n_per_m: Some(5.9878),
        criterion: Criterion::Saturation,
        jnd: 0.07,
        currents_a: Some(currents_a),
        rms_error_n: Some(0.0071),
        worst_error_n: Some(0.031),
        relative_rms_error: Some(0.0175),
        duality_gap_n2: Some(1.3e-19),
        rank: 3,
        points: points.len(),
        weights: fluxform_base::point_weights::Weights::Equal,
        hottest_coil: None,
        headline: None,
        path: vec![PathStep {
            lambda_n_per_m: 4.9429,
            currents_a: vec![2.0, 0.7, 0.0, 1.3],
            event: "coil 0 meets its upper limit".to_owned(),
        }],
        at: Some(AtLambda {
            lambda_n_per_m: 2.1,
            currents_a: vec![0.7; 4],
            rms_error_n: 0.0013,
            worst_error_n: 0.0017,
            worst_point: None,
        }),
        worst_point: None,
        sampling: None,
        tolerance: None,
        wiring: None,
        variants: None,
        feedback: None,
        working_point: None,
        given_force: None,
        sideways: None,
        uncertainty: None,
        accuracy: accuracy.clone(),
    };
    let manifest = Manifest {
        schema_version: SCHEMA_VERSION.to_owned(),
        fluxform_version: FLUXFORM_VERSION.to_owned(),
        design: "a".to_owned(),
        shape: "b".to_owned(),
        inputs,
        made_with: None,
        units: UNITS.to_owned(),
        array: ArrayGeometry {
            positions_m,
            coupling: "none".to_owned(),
            gain: vec![1.0; 4],
        },
        limits: CurrentLimits {
            current_min_a,
            current_max_a,
            total_current_max_a: Some(5.3),
        },
        resistance_ohm,
        circuit: Some(CircuitSummary {
            inductance_h,
            voltage_v: Some(36.0),
        }),
        magnet: MagnetSummary {
            moment_a_m2,
            model: "dipole".to_owned(),
            polarity: "repel".to_owned(),
            diameter_m: 0.01,
            length_m: 0.01,
        },
        lambda: LambdaSummary {
            lambda_n_per_m: Some(5.9878),
            criterion: Criterion::Saturation,
        },
        force: None,
        points: points_grid,
        map: MapSummary {
            x_m: x.into(),
            y_m: y.into(),
            z_m: z.into(),
            coil,
            components: "gz".to_owned(),
            interpolation: Interpolation::tricubic(
                1.3e-6,
                "relative to the largest |g| at that height, sampled",
            ),
            sides: None,
            passive_force: None,
            working_point: None,
        },
        left_out: vec![LeftOut {
            what: "coil 2".to_owned(),
            why: "carries no current".to_owned(),
            error_cost: Some(0.0),
        }],
        accuracy,
        files: Vec::new(),
    };
    Sample {
        manifest,
        map,
        points,
        currents,
        lambda,
    }
}

/// What the bundles hold that every loader is held to.
pub const SAMPLES: [&str; 14] = [
    "upright",
    "upright with pull",
    "tilted with pull",
    "short axes with pull",
    "upright vector",
    "tilted vector with pull",
    "upright uncertain with pull",
    "upright uncertain vector",
    "tilted vector with pull, uncertain",
    // Broke: currents chosen for uncertainties had a larger sum, and coils without force kept the
    // others from the nearest one.
    "upright uncertain with pull, reversing, a small sum",
    "upright vector, reversing",
    "upright vector, two idle, reversing, a small sum",
    // Broke: of coils that are alike no currents out of reach were proven.
    "upright vector, two alike, reversing, a small sum",
    // Broke: Octave ended where a single coil was at a limit.
    "upright vector, one coil",
];

impl Sample {
    /// The sample of a bundle with what the name says.
    pub fn named(name: &str) -> Self {
        let with = |what: &str| name.contains(what);
        let samples = match (with("short axes"), with("tilted")) {
            (true, _) => [2, 3, 1],
            (_, true) => [13, 9, 11],
            _ => [13, 17, 11],
        };
        let mut made = sample(with("tilted"), samples);
        if with("pull") {
            made = made.with_pull();
        }
        if with("vector") {
            made = made.with_vectors();
        }
        if with("uncertain") {
            made = made.with_uncertainty(if with("pull") { 0.004 } else { 0.0 });
        }
        if with("two idle") {
            made = made.without_force(1);
        }
        if with("one coil") {
            made = made.with_one_coil();
        }
        if with("two alike") {
            made = made.with_coils(|nodes, component| component.copy_within(..nodes, nodes));
        }
        if with("reversing") {
            made = made.reversing(with("small sum").then_some(0.4));
        }
        made
    }

    /// The sample of a bundle that holds the unpowered steel's pull too.
    pub fn with_pull(mut self) -> Self {
        let map = &self.map;
        let mut pull = Vec::new();
        for z in map.z_m.iter() {
            for y in map.y_m.iter() {
                pull.extend(map.x_m.iter().map(|x| pull_n([*x, *y, *z])));
            }
        }
        self.manifest.map.passive_force = Some(PassiveForce {
            array: "passive_force_n".to_owned(),
            largest_n: 0.9,
            interpolation: Interpolation::tricubic(1.7e-4, "sampled"),
        });
        self.map.passive_force_n = Some(pull.into());
        self
    }

    /// The sample of a bundle that requests a force vector, whose direction changes from point to point.
    ///
    /// # Panics
    /// For a sample without rendering.
    pub fn with_vectors(mut self) -> Self {
        let map = &self.map;
        let mut sides = [Vec::new(), Vec::new()];
        for &coil in map.coil.iter() {
            let axis_m = self.manifest.array.positions_m[coil as usize];
            for z in map.z_m.iter() {
                for y in map.y_m.iter() {
                    for x in map.x_m.iter() {
                        let tensor = gradient(axis_m, [*x, *y, *z]);
                        sides[0].push(tensor[2]);
                        sides[1].push(tensor[5]);
                    }
                }
            }
        }
        self.map.sides_t_per_m_per_a = Some(sides.map(Into::into));
        self.manifest.map.components = "force".to_owned();
        self.manifest.map.sides = Some(SidesOfMap {
            arrays: SIDES.map(str::to_owned),
            largest_error: [1.7e-6, 1.9e-6],
        });
        let rendering = self.map.runtime.rendering.as_mut().unwrap();
        let nodes = rendering.heights.height_m.len();
        let direction = (0..nodes).flat_map(|node| {
            let turn = node as f64;
            [0.4 * turn.sin(), 0.3 * (0.7 * turn).cos(), 0.9]
        });
        rendering.requested = Some(Requested {
            direction: direction.collect(),
            sideways_weight: 0.1,
        });
        self.manifest.force = Some(ForceSummary {
            direction: ForceDirection::Normal,
            normal_force: Some(NormalForce::Magnitude),
            sideways_weight: 0.1,
            crease_points: 0,
            rim_points: 0,
            static_currents: "the upward force alone".to_owned(),
        });
        self
    }

    /// The sample of a bundle made for a sensor that is off by up to `sensor_m`, with warm magnets and drivers.
    ///
    /// # Panics
    /// For a sample without rendering.
    pub fn with_uncertainty(mut self, sensor_m: f64) -> Self {
        let given = Uncertainty {
            sensor_m,
            tilt_deg: 0.0,
            heat_c: 20.0,
            driver: 0.02,
        };
        let rendering = self.map.runtime.rendering.as_mut().unwrap();
        rendering.robust = Some(RobustRuntime::new(&given, 3e-4));
        self
    }

    /// The sample of a bundle whose drivers reverse and whose currents sum to `total_a` at most.
    pub fn reversing(mut self, total_a: Option<f64>) -> Self {
        let (runtime, limits) = (&mut self.map.runtime, &mut self.manifest.limits);
        runtime.current_min_a = runtime.current_max_a.iter().map(|most| -most).collect();
        limits.current_min_a = runtime.current_min_a.clone();
        runtime.total_current_max_a = total_a;
        limits.total_current_max_a = total_a;
        self
    }

    /// The sample of a bundle in which this coil of the map gives no force.
    pub fn without_force(self, coil: usize) -> Self {
        self.with_coils(|nodes, component| component[coil * nodes..(coil + 1) * nodes].fill(0.0))
    }

    /// The sample of a bundle whose map has its first coil alone.
    fn with_one_coil(mut self) -> Self {
        let map = &mut self.map;
        let nodes = map.gz_t_per_m_per_a.len() / map.coil.len();
        let sides = map.sides_t_per_m_per_a.iter_mut().flatten();
        for component in sides.chain([&mut map.gz_t_per_m_per_a]) {
            component.to_mut().truncate(nodes);
        }
        map.coil.to_mut().truncate(1);
        self.manifest.map.coil.truncate(1);
        self
    }

    /// The sample of a bundle with each component of the map changed, [coil, node].
    fn with_coils(mut self, change: impl Fn(usize, &mut [f64])) -> Self {
        let map = &mut self.map;
        let nodes = map.gz_t_per_m_per_a.len() / map.coil.len();
        let sides = map.sides_t_per_m_per_a.iter_mut().flatten();
        for component in sides.chain([&mut map.gz_t_per_m_per_a]) {
            change(nodes, component.to_mut());
        }
        self
    }

    /// The sample of a bundle of schema 1.1: without what position feedback needs.
    pub fn without_rendering(mut self) -> Self {
        self.map.runtime.rendering = None;
        self.manifest.circuit = None;
        self
    }

    pub fn write(&self, target: &Path, force: bool) -> Result<Manifest, WriteError> {
        let content = BundleContent {
            manifest: self.manifest.clone(),
            map: &self.map,
            points: &self.points,
            currents: &self.currents,
            lambda: &self.lambda,
            extra: &[],
        };
        let timing = [StageSeconds {
            stage: "map".to_owned(),
            seconds: 0.013,
        }];
        write_bundle(target, force, &content, &timing)
    }
}

pub fn sidecar(manifest: &Manifest) -> MapSidecar {
    MapSidecar {
        made_with: Default::default(),
        schema_version: manifest.schema_version.clone(),
        fluxform_version: manifest.fluxform_version.clone(),
        design: manifest.design.clone(),
        inputs: manifest.inputs.clone(),
        units: manifest.units.clone(),
        array: manifest.array.clone(),
        magnet: manifest.magnet.clone(),
        map: manifest.map.clone(),
        accuracy: manifest.accuracy.clone(),
        files: Vec::new(),
    }
}
