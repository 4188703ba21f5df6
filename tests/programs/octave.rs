//! GNU Octave reads a bundle: with its own functions, and with `scripts/load_bundle.m`, whose
//! forces, heights and currents are Rust's. The same file serves MATLAB, which is not tried here.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use fluxform::bundle::load::Bundle;
use fluxform::bundle::npz::to_npz;
use fluxform::bundle::replay::Answer;
use fluxform::commands::replay::renderer::Renderer;
use rayon::prelude::*;

use fluxform_testing::bundle::*;
use fluxform_testing::needs::Trial;
use fluxform_testing::{Random, needs, root, trials};

pub fn trials() -> Vec<Trial> {
    trials! {
        needs::octave() => [
            octave_and_rust_give_the_same_forces_heights_and_currents,
            octave_reads_the_tables_and_the_json_files_by_its_own_functions,
            a_loaded_map_goes_into_a_mat_file,
            a_changed_file_is_refused,
            regression_an_unknown_height_was_a_force_of_zero,
            regression_another_schema_and_another_lambda_were_read,
        ],
    }
}

fn command(folder: &Path, script: &str) -> Command {
    let mut command = Command::new("octave-cli");
    command
        .args(["--norc", "--quiet", "--eval", script])
        .env("FLUXFORM_SCRIPTS", root().join("scripts"))
        .current_dir(folder);
    command
}

/// Octave on a script in a folder.
fn octave(folder: &Path, script: &str) -> Output {
    command(folder, script).output().unwrap()
}

/// Output of Octave, as rows of numbers.
fn rows(output: &Output) -> Vec<Vec<f64>> {
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    let number = |word: &str| {
        word.parse()
            .unwrap_or_else(|_| panic!("{word:?}: {errors}"))
    };
    text.lines()
        .map(|line| line.split_whitespace().map(number).collect())
        .collect()
}

/// Positions inside the map, on its nodes and borders, beyond these by their last bits, and outside.
fn positions(bundle: &Bundle) -> Vec<[f64; 3]> {
    let mut random = Random::new(11);
    let map = &bundle.map;
    (0..200)
        .map(|i| {
            [&map.x_m, &map.y_m, &map.z_m].map(|axis| {
                let t = random.unit();
                let (from, to) = (axis[0], axis[axis.len() - 1]);
                match i % 5 {
                    0 => axis[(t * axis.len() as f64) as usize],
                    1 if axis.len() > 1 => from + (to - from) * (1.2 * t - 0.1),
                    2 if t < 0.3 && axis.len() > 1 => to + 1e-10 * (to - axis[axis.len() - 2]),
                    _ => from + (to - from) * t,
                }
            })
        })
        .collect()
}

const FORCES: &str = "\
addpath(getenv('FLUXFORM_SCRIPTS'));
bundle = load_bundle('bundle');
points = csvread('positions.csv');
[current, force, answer] = bundle.currents(points);
[~, code] = ismember(answer, {'ok', 'saturated', 'outside'});
found = [bundle.force_per_ampere(points), bundle.passive_force(points), bundle.height(points), ...
         current, force(:, end), code];
if isfield(bundle.map, 'robust_setting')
    [chosen, given] = bundle.robust_currents(points);
    found = [chosen, given(:, end), found];
end
found(isnan(found)) = 0;
format = [repmat('%.17g ', 1, columns(found)), '\\n'];
printf(format, found.');
";

fn octave_and_rust_give_the_same_forces_heights_and_currents() {
    // Octave takes one core each.
    SAMPLES.into_par_iter().for_each(|name| {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("bundle");
        Sample::named(name).write(&target, false).unwrap();
        let bundle = Bundle::open(&target).unwrap();
        let mut renderer = Renderer::new(&bundle).unwrap();
        let mut robust = Renderer::robust(&bundle).ok();
        let at = positions(&bundle);
        let table: String = at
            .iter()
            .map(|[x, y, z]| format!("{x},{y},{z}\n"))
            .collect();
        fs::write(folder.path().join("positions.csv"), table).unwrap();
        let output = octave(folder.path(), FORCES);
        let found = rows(&output);
        assert_eq!(found.len(), at.len(), "{name}");
        let mut worst = [0.0_f64; 4];
        let mut outside = 0;
        let mut answers = [0; 3];
        for (position, found) in at.iter().zip(&found) {
            let coils = bundle.coil_count();
            let mut want = vec![f64::NAN; coils];
            let mut found = &found[..];
            if let Some(robust) = &mut robust {
                let step = robust.step(*position, &mut want);
                want.push(step.force_n);
                let chosen;
                (chosen, found) = found.split_at(coils + 1);
                let scale = want.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
                // Currents that nearly give the same forces follow the order of Octave's sums.
                for (f, w) in chosen.iter().zip(&want) {
                    assert!((f - w).abs() <= 1e-10 * scale, "{name}: {f} and {w}");
                }
                want.truncate(coils);
            }
            outside += usize::from(!bundle.force_per_ampere(*position, &mut want));
            want.push(bundle.passive_force_n(*position).unwrap_or(0.0));
            let [x, y, _] = *position;
            want.push(renderer.heights().height_m(x, y).unwrap_or(0.0));
            let mut currents = vec![f64::NAN; coils];
            let step = renderer.step(*position, &mut currents);
            want.extend(currents);
            assert_eq!(found.len(), want.len() + 2, "{name}");
            let [.., force_n, code] = found[..] else {
                panic!("{name}")
            };
            // A force that cancels the pull is compared with the pull.
            let least = step.force_n.abs().max(step.without_currents_n[2].abs());
            assert!((force_n - step.force_n).abs() <= 1e-12 * least, "{name}");
            let answer = [Answer::Ok, Answer::Saturated, Answer::Outside]
                .iter()
                .position(|answer| *answer == step.answer)
                .unwrap();
            assert_eq!(code, (answer + 1) as f64, "{name}");
            answers[answer] += 1;
            let parts = [0, coils, coils + 1, coils + 2, 2 * coils + 2];
            for (part, ends) in parts.windows(2).map(|ends| (ends[0], ends[1])).enumerate() {
                let scale = want[ends.0..ends.1]
                    .iter()
                    .fold(0.0_f64, |m, v| m.max(v.abs()));
                for (f, w) in found[ends.0..ends.1].iter().zip(&want[ends.0..ends.1]) {
                    assert!((f - w).abs() <= 1e-12 * scale, "{name}: {f} and {w}");
                    worst[part] = worst[part].max(if scale > 0.0 {
                        (f - w).abs() / scale
                    } else {
                        0.0
                    });
                }
            }
        }
        assert!(outside > 5 && outside < at.len() / 2, "{outside} outside");
        assert!(
            name.contains("short axes") || answers.iter().all(|n| *n > 5),
            "{answers:?}"
        );
        let worst = worst.map(|w| format!("{w:.1e}")).join(" ");
        eprintln!(
            "{name}: forces, pull, heights and currents differ by at most {worst} of the largest; \
             {answers:?} positions ok, saturated, outside"
        );
    });
}

/// Octave's own functions are enough for the tables and the JSON files.
const TABLES: &str = "\
manifest = jsondecode(fileread('bundle/manifest.json'));
lambda = jsondecode(fileread('bundle/lambda.json'));
points = csvread('bundle/points.csv', 1, 0);
currents = csvread('bundle/currents.csv', 1, 0);
printf('%.17g ', size(points), points(:, 1:3).');
printf('\\n');
printf('%.17g ', currents(:, end));
printf('\\n');
printf('%.17g ', lambda.lambda_n_per_m, lambda.currents_a, manifest.lambda.lambda_n_per_m);
printf('\\n');
printf('%d ', strcmp(manifest.map.interpolation.name, 'tricubic-lagrange'), numel(manifest.files));
printf('\\n');
";

fn octave_reads_the_tables_and_the_json_files_by_its_own_functions() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bundle");
    sample(false, [4, 3, 2]).write(&target, false).unwrap();
    let bundle = Bundle::open(&target).unwrap();
    let output = octave(folder.path(), TABLES);
    let found = rows(&output);
    let points = bundle
        .points
        .iter()
        .flat_map(|p| [p.x_m, p.y_m, p.height_m]);
    let mut want = vec![bundle.points.len() as f64, 6.0];
    want.extend(points);
    assert_eq!(found[0], want);
    let currents: Vec<f64> = bundle.currents.iter().map(|row| row.current_a).collect();
    assert_eq!(found[1], currents);
    let lambda = bundle.lambda.lambda_n_per_m.unwrap();
    let mut reported = vec![lambda];
    reported.extend(&currents);
    reported.push(lambda);
    // Its reader of JSON may lose the last digit.
    for (found, want) in found[2].iter().zip(&reported) {
        assert!(
            (found - want).abs() <= 4.0 * f64::EPSILON * want.abs(),
            "{found} and {want}"
        );
    }
    assert_eq!(found[2].len(), reported.len());
    assert_eq!(found[3], [1.0, bundle.manifest.files.len() as f64]);
}

/// `save` of the arrays gives a MAT file that holds them.
const KEPT: &str = "\
addpath(getenv('FLUXFORM_SCRIPTS'));
bundle = load_bundle('bundle');
map = bundle.map;
save('-v7', 'map.mat', '-struct', 'map');
again = load('map.mat');
printf('%d\\n', isequal(again, map));
printf('%d ', size(again.gz_t_per_m_per_a));
";

fn a_loaded_map_goes_into_a_mat_file() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bundle");
    sample(false, [5, 4, 3]).write(&target, false).unwrap();
    let output = octave(folder.path(), KEPT);
    assert_eq!(rows(&output), [vec![1.0], vec![3.0, 3.0, 4.0, 5.0]]);
}

/// What Octave says of a script that fails.
fn refusal(folder: &Path, script: &str) -> String {
    let script = format!("addpath(getenv('FLUXFORM_SCRIPTS')); {script}");
    let output = octave(folder, &script);
    assert!(!output.status.success(), "{script}: {output:?}");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn regression_an_unknown_height_was_a_force_of_zero() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bundle");
    let older = sample(false, [4, 3, 2]).without_rendering();
    older.write(&target, false).unwrap();
    for asked in [
        "currents([0 0 0])",
        "height([0 0])",
        "requested_force([0 0])",
    ] {
        let message = refusal(
            folder.path(),
            &format!("b = load_bundle('bundle'); b.{asked}"),
        );
        assert!(message.contains("holds no heights"), "{asked}: {message}");
    }
}

fn regression_another_schema_and_another_lambda_were_read() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bundle");
    sample(false, [4, 3, 2]).write(&target, false).unwrap();
    let honest = fs::read(target.join("map.npz")).unwrap();
    let load = |of: &str, message: &str| {
        let said = refusal(folder.path(), "load_bundle('bundle')");
        assert!(said.contains(message), "{of}: {said}");
    };
    let bundle = Bundle::open(&target).unwrap();
    let mut map = bundle.map.clone();
    map.runtime.lambda_n_per_m = map.runtime.lambda_n_per_m.map(|lambda| 1.01 * lambda);
    replace_map(&target, &to_npz(&map).unwrap());
    load("lambda", "different lambda_n_per_m");
    // The version's three numbers follow the header of its array.
    let name = b"schema_version.npy";
    let at = honest
        .windows(name.len())
        .position(|part| part == name)
        .unwrap()
        + name.len();
    let at = at + honest[at..].iter().position(|byte| *byte == b'\n').unwrap() + 1;
    let mut changed = honest.clone();
    changed[at] = 2;
    replace_map(&target, &changed);
    load("schema", "schema_version is not one");
}

fn a_changed_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bundle");
    for (file, from, to) in [
        ("currents.csv", "1.3", "1.4"),
        ("map.npz", "repel", "repel"),
        ("lambda.json", "4.9429", "4.94290"),
    ] {
        sample(false, [4, 3, 2]).write(&target, true).unwrap();
        let path = target.join(file);
        let mut bytes = fs::read(&path).unwrap();
        if from == to {
            let middle = bytes.len() / 2;
            bytes[middle] ^= 4;
        } else {
            bytes = String::from_utf8(bytes)
                .unwrap()
                .replacen(from, to, 1)
                .into_bytes();
        }
        fs::write(&path, bytes).unwrap();
        let script = "addpath(getenv('FLUXFORM_SCRIPTS')); load_bundle('bundle');";
        let output = octave(folder.path(), script);
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success(), "{file} was read");
        assert!(
            words.contains(file) && words.contains("changed or damaged"),
            "{words}"
        );
    }
}
