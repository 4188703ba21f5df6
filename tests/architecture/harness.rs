//! Every test is run by something: in a target with `harness = false` the compiler drops `#[test]`
//! without a word, so there each is named in a `trials!`.

use crate::source::{files, manifests, read};

/// The files of the test targets that have `harness = false`.
fn listed_by_hand() -> Vec<String> {
    let mut folders = Vec::new();
    for path in manifests() {
        let manifest: toml::Table = read(&path).parse().unwrap();
        let targets = manifest.get("test").and_then(toml::Value::as_array);
        for target in targets.into_iter().flatten() {
            if target.get("harness").and_then(toml::Value::as_bool) == Some(false) {
                // Members name their tests from their own folder.
                let path = target["path"].as_str().unwrap();
                let path = path.trim_start_matches("../");
                let alone = path.matches('/').count() == 1;
                let folder = if alone {
                    path
                } else {
                    path.rsplit_once('/').unwrap().0
                };
                folders.push(folder.to_owned());
            }
        }
    }
    let mut all = files();
    all.retain(|path| path.ends_with(".rs") && folders.iter().any(|f| path.starts_with(f)));
    all
}

#[test]
fn no_test_is_dropped_where_the_harness_is_ours() {
    let files = listed_by_hand();
    assert!(files.len() > 20, "{files:?}");
    for path in files {
        let dropped = read(&path).lines().any(|line| line.trim() == "#[test]");
        assert!(
            !dropped,
            "{path}: name its tests in `trials!`, without #[test]"
        );
    }
}

#[test]
fn nothing_is_included_by_its_path() {
    for path in files().iter().filter(|path| path.ends_with(".rs")) {
        let included = read(path)
            .lines()
            .any(|line| line.trim_start().starts_with("#[path ="));
        assert!(!included, "{path}: share it through tests/support");
    }
}
