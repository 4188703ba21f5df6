//! Sweeps: plans, and what shards wrote.

use std::path::{Path, PathBuf};

use fluxform::bundle::artefact::{Input as Entry, sha256_hex};
use fluxform::bundle::json::to_json;
use fluxform::bundle::sweep::{Axis, Mode, PlanFile, PointFile, Row, Status, Value};
use fluxform::commands::sweep::merge::{MergeRequest, merge_table};
use fluxform::commands::sweep::run::run;
use fluxform::progress::Silent;

use super::{limits, refusal};
use crate::harness::{Content, Input, Kind};
use crate::structure::damage_json;
use fluxform_testing::Random;

pub fn kinds() -> Vec<Kind> {
    vec![
        Kind {
            name: "plan",
            limits: limits(128.0, 32.0),
            seeds: plans,
            hostile: hostile_plans,
            mutate: mutate_plan,
            give: give_plan,
        },
        Kind {
            name: "shard",
            limits: limits(128.0, 32.0),
            seeds: shards,
            hostile: hostile_shards,
            mutate: mutate_shard,
            give: give_shard,
        },
    ]
}

const PLAN: &str = "plan.json";
const POINT: &str = "out/points/000/000000.json";
const DESIGN: &str = "name = \"a\"\n[coil]\ninner_diameter_mm = 24.0\nouter_diameter_mm = 38.0\n\
                      length_mm = 70.0\n[wire]\ndiameter_mm = 0.7\n";

fn plan() -> PlanFile {
    let axis = |key: &str, values: &[f64]| Axis {
        key: key.to_owned(),
        values: values.iter().map(|v| Value::Number(*v)).collect(),
    };
    let axes = vec![
        axis("wire.diameter_mm", &[0.7, 1.3]),
        axis("coil.length_mm", &[30.0, 70.0]),
    ];
    let inputs = vec![Entry::of_bytes("a.toml", DESIGN.as_bytes())];
    PlanFile::new(
        "a".into(),
        inputs,
        Mode::Evaluate,
        7,
        None,
        axes,
        DESIGN.into(),
    )
}

fn plans() -> Vec<Input> {
    vec![Input::file(PLAN, to_json(&plan()).expect("a plan"))]
}

fn of_plan(what: &str, edit: impl FnOnce(&mut PlanFile)) -> (String, Input) {
    let mut plan = plan();
    edit(&mut plan);
    let mut input = Input::file(PLAN, serde_json::to_vec(&plan).expect("a plan"));
    seal_plan(&mut input);
    (what.to_owned(), input)
}

fn hostile_plans() -> Vec<(String, Input)> {
    let axis = |key: &str, count: usize| Axis {
        key: key.to_owned(),
        values: vec![Value::Number(1.0); count],
    };
    vec![
        of_plan("more designs than a sweep has", |plan| {
            plan.axes = (0..40).map(|k| axis(&format!("a{k}"), 2)).collect();
            plan.points = 1 << 40;
        }),
        of_plan("no values", |plan| {
            plan.axes[0].values.clear();
            plan.points = 0;
        }),
        of_plan("no axes", |plan| {
            plan.axes.clear();
            plan.points = 1;
        }),
        of_plan("no inputs", |plan| plan.inputs.clear()),
        of_plan("a key of many dots", |plan| {
            plan.axes[0].key = vec!["a"; 20_000].join(".");
        }),
        of_plan("a deep value", |plan| {
            let mut value = Value::Number(1.0);
            for _ in 0..100 {
                value = Value::List(vec![value]);
            }
            plan.axes[0].values = vec![value; 2];
        }),
        of_plan("a table that is a device", |plan| {
            plan.inputs.push(Entry::of_bytes("/dev/zero", b""));
        }),
        (
            "deep brackets".into(),
            Input::file(PLAN, "[".repeat(1 << 20)),
        ),
        (
            "a deep design".into(),
            Input::file(
                PLAN,
                format!("{{\"axes\":{}", "[{\"values\":".repeat(100_000)),
            ),
        ),
    ]
}

/// Its own digest, so that the damage lies behind it.
fn seal_plan(input: &mut Input) {
    if let Some(bytes) = input.get_mut(PLAN)
        && let Ok(mut plan) = serde_json::from_slice::<PlanFile>(bytes)
    {
        plan.plan_sha256 = String::new();
        plan.plan_sha256 = sha256_hex(&serde_json::to_vec(&plan).unwrap_or_default());
        *bytes = serde_json::to_vec(&plan).unwrap_or_default();
    }
}

fn mutate_plan(input: &mut Input, random: &mut Random) {
    if let Some(bytes) = input.get_mut(PLAN) {
        damage_json(bytes, random);
    }
    if random.below(8) > 0 {
        if let Some(bytes) = input.get_mut(PLAN)
            && let Ok(mut plan) = serde_json::from_slice::<PlanFile>(bytes)
        {
            // As many points as there are.
            let count = |axis: &Axis| axis.values.len() as u64;
            let product = plan.axes.iter().map(count).fold(1, u64::saturating_mul);
            plan.points = product;
            *bytes = serde_json::to_vec(&plan).unwrap_or_default();
        }
        seal_plan(input);
    }
}

fn give_plan(input: &Input, folder: &Path) -> Result<bool, String> {
    let bytes = input.get(PLAN).unwrap_or_default();
    let plan = match PlanFile::parse(PLAN, bytes) {
        Err(words) => return refusal(&words, PLAN),
        Ok(plan) => plan,
    };
    let out = folder.join("out");
    // The designs that are tried are small; a mutant's may not be.
    let cored =
        plan.design_text.contains("core") || plan.axes.iter().any(|a| a.key.contains("core"));
    if plan.mode != Mode::Evaluate || cored {
        return Ok(true);
    }
    if let Err(error) = run(&plan, &out, 0..plan.points.min(2), false, &Silent) {
        return if error.to_string().is_empty() {
            Err("no words".to_owned())
        } else {
            Ok(true)
        };
    }
    let request = MergeRequest {
        folders: vec![out],
        partial: true,
        page: true,
        landscape: false,
    };
    if plan.points < 100_000 {
        let entry = Entry::of_bytes(PLAN, bytes);
        merge_table(&plan, entry, &request, &Silent).map_err(|error| error.to_string())?;
    }
    Ok(true)
}

fn shards() -> Vec<Input> {
    let plan = plan();
    let row = Row {
        turns: 1_428.571_428_571_4,
        resistance_ohm: 0.3,
        inductance_h: 0.2,
        settling_s: 0.011_9,
        power_w: 7.0,
        mass_kg: 0.3,
        wire_length_m: 13.0,
        current_a: 2.0,
        gradient_t_per_m_per_a: -0.7,
        force_n: 0.099_709,
        core_peak_field_t: None,
        limits_met: true,
        optimum: None,
        array: None,
        iron: None,
    };
    let good = PointFile::new(&plan.plan_sha256, 0, Ok((row, Status::Done)));
    let failed = PointFile::new(&plan.plan_sha256, 0, Err("a reason".into()));
    [good, failed]
        .map(|point| {
            let mut input = plans().remove(0);
            let bytes = point.to_bytes().expect("a point");
            input.put(POINT, Content::Bytes(bytes));
            input
        })
        .into()
}

fn seal_point(input: &mut Input) {
    if let Some(bytes) = input.get_mut(POINT)
        && let Ok(mut point) = serde_json::from_slice::<PointFile>(bytes)
    {
        point.point_sha256 = String::new();
        point.point_sha256 = sha256_hex(&serde_json::to_vec(&point).unwrap_or_default());
        *bytes = serde_json::to_vec(&point).unwrap_or_default();
    }
}

fn mutate_shard(input: &mut Input, random: &mut Random) {
    if let Some(bytes) = input.get_mut(POINT) {
        damage_json(bytes, random);
    }
    if random.below(6) > 0 {
        seal_point(input);
    }
}

fn hostile_shards() -> Vec<(String, Input)> {
    let with = |what: &str, content: Content| {
        let mut input = shards().remove(0);
        input.put(POINT, content);
        (what.to_owned(), input)
    };
    let mut found = vec![
        with("a point that is a pipe", Content::Pipe),
        with("a point that never ends", Content::Link("/dev/zero".into())),
        with("a point that is a folder", Content::Folder),
        with("a large point", Content::Bytes(vec![b' '; 8 << 20])),
        with("a deep point", Content::Bytes(b"[".repeat(1 << 20))),
    ];
    let mut input = shards().remove(0);
    input.put("out/plan.json", Content::Pipe);
    found.push(("the folder's plan is a pipe".into(), input));
    let mut input = shards().remove(0);
    if let Some(bytes) = input.get_mut(POINT) {
        let text = String::from_utf8_lossy(bytes).replace("13.0", "1e308");
        *bytes = text.replace("0.099709", "-1.7e308").into_bytes();
    }
    seal_point(&mut input);
    found.push(("numbers at the end".into(), input));
    found
}

fn give_shard(input: &Input, folder: &Path) -> Result<bool, String> {
    let bytes = input.get(PLAN).unwrap_or_default();
    let plan = PlanFile::parse(PLAN, bytes)?;
    let request = MergeRequest {
        folders: vec![PathBuf::from(folder).join("out")],
        partial: true,
        page: true,
        landscape: false,
    };
    match merge_table(&plan, Entry::of_bytes(PLAN, bytes), &request, &Silent) {
        Err(error) => refusal(&error.to_string(), "000000.json"),
        Ok((table, report)) => {
            to_json(&report.summary).map_err(|error| error.to_string())?;
            let text = String::from_utf8(table).map_err(|error| error.to_string())?;
            if text
                .lines()
                .any(|line| line.split(',').any(|cell| cell == "NaN" || cell == "inf"))
            {
                return Err(format!("a table that is not finite: {text}"));
            }
            Ok(report.summary.rows > 0)
        }
    }
}
