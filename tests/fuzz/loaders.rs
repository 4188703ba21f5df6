//! The loaders of bundles in Python, Octave and C on the same mutants as the library's.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::PoisonError;
use std::time::Instant;

use fluxform::commands::replay::Opened;
use fluxform_testing::loaders::c_loader;
use fluxform_testing::needs::{self, SANITIZERS, Trial};
use fluxform_testing::{Random, root, trials};

use crate::harness::Input;
use crate::kinds::bundle::{hostile, mutate, seeds};

use crate::{MEASURED, another};

pub fn trials() -> Vec<Trial> {
    trials! {
        needs::sanitizers() => [the_c_loader_reads_or_refuses_the_same_bundles_under_sanitizers],
        needs::numpy() => [the_python_loader_reads_or_refuses_the_same_bundles_with_its_own_error],
        needs::octave() => [the_octave_loader_reads_or_refuses_the_same_bundles_with_its_own_error],
    }
}

/// Positions in, around and far from the samples' map.
const POSITIONS: &str =
    "0 0 0.05\n-0.05 -0.043 0.01\n0.05 0.051 0.08\n0.013 -0.021 0.033\n1 1e300 -1\n";

/// All hostile bundles, the seeds, then mutants.
fn corpus(random: &mut Random) -> impl Iterator<Item = (String, Input)> {
    let seeds = seeds();
    let good = seeds
        .clone()
        .into_iter()
        .map(|seed| ("a seed".to_owned(), seed));
    let mutants = std::iter::from_fn({
        let mut round = 0;
        move || {
            let mut input = seeds[round % seeds.len()].clone();
            mutate(&mut input, random);
            round += 1;
            Some((format!("mutant {round}"), input))
        }
    });
    hostile().into_iter().chain(good).chain(mutants)
}

/// Whether the library reads the bundle as far as the other loaders do.
fn ours(folder: &Path) -> bool {
    Opened::new(folder).is_ok()
}

fn the_c_loader_reads_or_refuses_the_same_bundles_under_sanitizers() {
    let _unmeasured = MEASURED.read().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let program = c_loader(folder.path(), &["-g", SANITIZERS[0], SANITIZERS[1]]);
    let bundle = folder.path().join("bundle");
    let (start, mut read, mut inputs) = (Instant::now(), 0, 0);
    let mut random = Random::new(2);
    let must = hostile().len() + seeds().len();
    for (what, input) in corpus(&mut random) {
        if inputs >= must && !another((inputs - must) as u64, start) {
            break;
        }
        inputs += 1;
        input.write(&bundle);
        let mut child = Command::new(&program)
            .arg(bundle.join("map.npz"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // A program that refuses its file does not read.
        let _ = child.stdin.take().unwrap().write_all(POSITIONS.as_bytes());
        let output = child.wait_with_output().unwrap();
        let words = String::from_utf8_lossy(&output.stderr);
        let reported = String::from_utf8_lossy(&output.stdout);
        let code = output.status.code();
        assert!(matches!(code, Some(0 | 3)), "{what}: {code:?}: {words}");
        assert!(
            !words.contains("Sanitizer") && !words.contains("runtime error"),
            "{what}: {words}"
        );
        assert!(
            code == Some(0) || !words.trim().is_empty(),
            "{what}: no words"
        );
        assert!(
            !reported.contains("nan") && !reported.contains("inf"),
            "{what}: {reported}"
        );
        if what.starts_with("the map") {
            assert_eq!(code, Some(3), "{what}");
        }
        if ours(&bundle) {
            // C reads the one form of archive that the writer gives, and may refuse others.
            let form = [
                "archive",
                "lies outside the file",
                "compressed",
                "is there twice",
            ];
            let form = form.iter().any(|words_of| words.contains(words_of));
            assert!(
                code == Some(0) || form,
                "{what}: the library reads it, C does not: {words}"
            );
            read += 1;
        }
    }
    eprintln!("C: {inputs} bundles, {read} read by both");
    assert!(read >= 3);
}

const PYTHON: &str = r#"
import sys, warnings
sys.path.insert(0, sys.argv[1])
import numpy as np
from load_bundle import Bundle, BundleError
warnings.simplefilter("error")
points = [[0, 0, 0.05], [-0.05, -0.043, 0.01], [0.05, 0.051, 0.08], [0.013, -0.021, 0.033], [1, 1e300, -1]]
for folder in sys.stdin.read().splitlines():
    try:
        bundle = Bundle(folder)
        force = bundle.force_per_ampere(points)
        passive = bundle.passive_force(points)
        assert np.all(np.isfinite(force)) and np.all(np.isfinite(passive)), "not finite"
        if bundle.lambda_n_per_m is not None and "height_x_m" in bundle.map:
            currents, given, answers = bundle.currents(points)
            assert np.all(np.isfinite(currents)) and np.all(np.isfinite(given)), "not finite"
        print("read")
    except BundleError as error:
        print("refused", " ".join(str(error).split())[:300] if str(error) else "FAULT no words")
    except BaseException as error:
        import traceback
        at = traceback.extract_tb(error.__traceback__)[-1]
        print("FAULT", type(error), f"{at.name}:{at.lineno}", " ".join(str(error).split())[:300])
"#;

/// Bundles that one Python process is given.
const BATCH: usize = 60;

fn the_python_loader_reads_or_refuses_the_same_bundles_with_its_own_error() {
    let _unmeasured = MEASURED.read().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random::new(3);
    let mut corpus = corpus(&mut random);
    let (start, mut read, mut inputs) = (Instant::now(), 0, 0);
    let must = hostile().len() + seeds().len();
    while inputs < must || another((inputs - must) as u64, start) {
        let mut names = Vec::new();
        let mut batch = String::new();
        for number in 0..BATCH {
            let Some((what, input)) = corpus.next() else {
                break;
            };
            let bundle = folder.path().join(format!("bundle{number}"));
            input.write(&bundle);
            batch.push_str(&format!("{}\n", bundle.display()));
            names.push((what, bundle));
        }
        let mut child = Command::new("python3")
            .args(["-c", PYTHON])
            .arg(root().join("src/python/fluxform"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        child
            .stdin
            .take()
            .unwrap()
            .write_all(batch.as_bytes())
            .unwrap();
        let output = child.wait_with_output().unwrap();
        let reported = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "Python ended: {reported}");
        assert_eq!(reported.lines().count(), names.len(), "{reported}");
        for ((what, bundle), answer) in names.iter().zip(reported.lines()) {
            inputs += 1;
            assert!(!answer.contains("FAULT"), "{what}: {answer}");
            if what.contains("the path")
                || what.starts_with("the map")
                || what.starts_with("the manifest")
            {
                assert!(answer.starts_with("refused"), "{what}: {answer}");
            }
            if ours(bundle) {
                // So does Python, but for what lies beside the archive's entries.
                let read_too = answer == "read" || answer.contains("map.npz: ");
                assert!(
                    read_too,
                    "{what}: the library reads it, Python does not: {answer}"
                );
                read += 1;
            }
        }
    }
    eprintln!("Python: {inputs} bundles, {read} read by both");
    assert!(read >= 3);
}

const OCTAVE: &str = r#"
addpath(getenv('FLUXFORM_SCRIPTS'));
points = [0, 0, 0.05; -0.05, -0.043, 0.01; 0.05, 0.051, 0.08; 0.013, -0.021, 0.033; 1, 1e300, -1];
folders = strsplit(strtrim(fileread('folders.txt')), "\n");
for k = 1:numel(folders)
    try
        bundle = load_bundle(folders{k});
        found = [bundle.force_per_ampere(points), bundle.passive_force(points)];
        if isfield(bundle.map, 'lambda_n_per_m') && isfield(bundle.map, 'height_m')
            [current, force] = bundle.currents(points);
            found = [found, current, force];
        end
        reported = {'FAULT not finite', 'read'}{1 + all(isfinite(found(:)))};
    catch problem
        kind = {'FAULT', 'refused'}{1 + strcmp(problem.identifier, 'fluxform:bundle')};
        reported = [kind, ' ', strrep(problem.message, "\n", ' ')];
    end
    printf('%s\n', reported(1:min(end, 300)));
end
"#;

/// Octave starts slowly: all folders in one process, and few mutants.
fn the_octave_loader_reads_or_refuses_the_same_bundles_with_its_own_error() {
    let _unmeasured = MEASURED.read().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random::new(5);
    let must = hostile().len() + seeds().len();
    let mut names = Vec::new();
    let mut batch = String::new();
    for (number, (what, input)) in corpus(&mut random).take(must + BATCH).enumerate() {
        let bundle = folder.path().join(format!("bundle{number}"));
        input.write(&bundle);
        batch.push_str(&format!("{}\n", bundle.display()));
        names.push((what, bundle));
    }
    std::fs::write(folder.path().join("folders.txt"), batch).unwrap();
    let output = Command::new("octave-cli")
        .args(["--norc", "--quiet", "--eval", OCTAVE])
        .env("FLUXFORM_SCRIPTS", root().join("scripts"))
        .current_dir(folder.path())
        .output()
        .unwrap();
    let reported = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    let last = reported.lines().count();
    assert_eq!(
        last,
        names.len(),
        "Octave ended at {:?}: {errors}",
        names.get(last)
    );
    let mut read = 0;
    for ((what, bundle), answer) in names.iter().zip(reported.lines()) {
        assert!(!answer.contains("FAULT"), "{what}: {answer}");
        if what.contains("the path")
            || what.starts_with("the map")
            || what.starts_with("the manifest")
        {
            assert!(answer.starts_with("refused"), "{what}: {answer}");
        }
        if ours(bundle) {
            // So does Octave, but for other forms of archive and JSON than the writer gives.
            let read_too = answer == "read" || answer.contains("map.npz") || answer.contains("npy");
            assert!(
                read_too,
                "{what}: the library reads it, Octave does not: {answer}"
            );
            read += 1;
        }
    }
    eprintln!("Octave: {} bundles, {read} read by both", names.len());
    assert!(read >= 3);
}
