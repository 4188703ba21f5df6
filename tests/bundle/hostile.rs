//! Damaged, hostile and newer bundles.

use std::fs;
use std::path::Path;

use fluxform::bundle::artefact::sha256_hex;
use fluxform::bundle::load::{Bundle, BundleError};
use serde_json::json;

use fluxform_testing::bundle::*;
use fluxform_testing::needs::{self, Trial};
use fluxform_testing::trials;

use crate::archives::python_loads;

pub fn trials() -> Vec<Trial> {
    trials! {
        None => [hostile_and_damaged_bundles_are_refused, another_minor_version_is_read],
        needs::numpy() => [python_refuses_hostile_and_damaged_bundles],
    }
}

/// Has hostile and damaged bundles refused by the library, and then by `refused`.
fn hostile_and_damaged_bundles(refused: &dyn Fn(&Path)) {
    let refuse = |edit: &dyn Fn(&Path), words: &str| {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("flat");
        fs::write(folder.path().join("secret"), "0123").unwrap();
        sample(false, [4, 4, 4]).write(&target, false).unwrap();
        edit(&target);
        let error = Bundle::open(&target).unwrap_err().to_string();
        assert!(error.contains(words), "expected {words:?}, got {error:?}");
        refused(&target);
    };
    let list = |name: &'static str| {
        move |target: &Path| {
            edit_manifest(target, |manifest| {
                let entry = json!({ "path": name, "bytes": 4, "sha256": sha256_hex(b"0123") });
                manifest["files"].as_array_mut().unwrap().push(entry);
            });
        }
    };
    refuse(
        &list("../secret"),
        "not the name of a file inside the bundle",
    );
    refuse(
        &list("/etc/hostname"),
        "not the name of a file inside the bundle",
    );
    refuse(
        &|target| {
            #[cfg(unix)]
            std::os::unix::fs::symlink("../secret", target.join("link")).unwrap();
            list("link")(target);
        },
        "leads out of the bundle",
    );
    refuse(
        &|target| {
            fs::create_dir(target.join("plots")).unwrap();
            list("plots")(target);
        },
        "is not a plain file",
    );
    refuse(&list("absent.svg"), "it is missing");
    refuse(
        &|target| {
            let mut bytes = fs::read(target.join("map.npz")).unwrap();
            let middle = bytes.len() / 2;
            bytes[middle] ^= 1;
            fs::write(target.join("map.npz"), bytes).unwrap();
        },
        "its SHA-256 is",
    );
    refuse(
        &|target| {
            let bytes = fs::read(target.join("points.csv")).unwrap();
            fs::write(target.join("points.csv"), &bytes[..bytes.len() - 9]).unwrap();
        },
        "bytes, the manifest says",
    );
    refuse(
        &|target| fs::remove_file(target.join("lambda.json")).unwrap(),
        "it is missing",
    );
    refuse(
        &|target| fs::remove_file(target.join("manifest.json")).unwrap(),
        "is not a bundle",
    );
    refuse(
        &|target| {
            edit_manifest(target, |m| {
                *m = json!({ "schema_version": "2.0.0", "maps": [] })
            })
        },
        "2.0.0 is newer than this program",
    );
    refuse(
        &|target| edit_manifest(target, |m| m["schema_version"] = json!(7)),
        "invalid type",
    );
    refuse(
        &|target| edit_manifest(target, |m| m["files"] = json!([])),
        "does not list map.npz",
    );
    refuse(
        &|target| {
            edit_manifest(target, |m| {
                m["map"]["interpolation"]["name"] = json!("nearest")
            })
        },
        "the interpolation is known",
    );
    refuse(
        &|target| fs::write(target.join("manifest.json"), "{").unwrap(),
        "manifest.json",
    );
}

fn hostile_and_damaged_bundles_are_refused() {
    hostile_and_damaged_bundles(&|_| {});
}

fn python_refuses_hostile_and_damaged_bundles() {
    hostile_and_damaged_bundles(&|target| {
        let ran = python_loads(target);
        assert_eq!(ran.code, Some(3), "{}", ran.err);
        assert!(!ran.err.contains("Traceback"), "{}", ran.err);
    });
}

fn another_minor_version_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("flat");
    sample(false, [4, 4, 4]).write(&target, false).unwrap();
    edit_manifest(&target, |manifest| {
        manifest["schema_version"] = json!("1.9.3");
        manifest["a_key_of_the_future"] = json!({ "x": 1 });
    });
    Bundle::open(&target).unwrap();
    // Bundles before 1.2 hold no heights, static currents or inductances in map.npz.
    let older = folder.path().join("older");
    sample(false, [4, 4, 4])
        .without_rendering()
        .write(&older, false)
        .unwrap();
    edit_manifest(&older, |manifest| {
        manifest["schema_version"] = json!("1.0.0");
    });
    assert!(
        Bundle::open(&older)
            .unwrap()
            .map
            .runtime
            .rendering
            .is_none()
    );
    let error = Bundle::open(&folder.path().join("nowhere")).unwrap_err();
    assert!(matches!(error, BundleError::NoBundle { .. }));
}
