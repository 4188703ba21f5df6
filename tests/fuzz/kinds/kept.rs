//! The store of kept fields: a folder beside the bundles that anybody may have written.

use std::path::Path;

use fluxform::bundle::cache::{Origin, Store};
use sha2::{Digest, Sha256};

use super::limits;
use crate::harness::{Content, Input, Kind};
use crate::structure::damage_text;
use fluxform_testing::Random;

pub fn kind() -> Kind {
    Kind {
        name: "kept",
        limits: limits(16.0, 16.0),
        seeds,
        hostile,
        mutate,
        give,
    }
}

const ENTRY: &str = "flat.points";
/// The magic, the digest of the origin, the digest of the value.
const HEAD: usize = 8 + 2 * 32;
/// The digest of the origin, which depends on the folder and the entry's name too: zeros in an input stand for the right one.
const ORIGIN: std::ops::Range<usize> = 8..40;

/// The two forms of an entry: as the forces are, and as solutions hold them.
type Value = (Vec<f64>, Vec<Vec<f64>>, String, Option<u64>);

fn origin() -> Origin {
    Origin::of_build("a build").and(b"a design")
}

/// The files that the store itself writes.
#[allow(clippy::disallowed_methods)]
fn seeds() -> Vec<Input> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let store = Store::in_folder(folder.path().to_path_buf(), ".");
    let value: Value = (
        vec![0.7; 300],
        vec![vec![1.3; 7]; 5],
        "steel".into(),
        Some(3),
    );
    store.keep(ENTRY, &origin(), &value);
    let mut bytes = std::fs::read(folder.path().join(ENTRY)).expect("an entry");
    bytes[ORIGIN].fill(0);
    vec![Input::file(ENTRY, bytes)]
}

fn seal(bytes: &mut [u8]) {
    if bytes.len() > HEAD {
        let digest = Sha256::digest(&bytes[HEAD..]);
        bytes[HEAD - 32..HEAD].copy_from_slice(&digest);
    }
}

fn mutate(input: &mut Input, random: &mut Random) {
    if let Some(bytes) = input.get_mut(ENTRY) {
        if random.below(4) > 0 && bytes.len() > HEAD {
            let mut value = bytes.split_off(HEAD);
            damage_text(&mut value, random);
            bytes.extend(value);
            seal(bytes);
        } else {
            damage_text(bytes, random);
        }
    }
}

fn hostile() -> Vec<(String, Input)> {
    let with =
        |what: &str, content: Content| (what.to_owned(), Input(vec![(ENTRY.to_owned(), content)]));
    let mut found = vec![
        with("an entry that is a pipe", Content::Pipe),
        with(
            "an entry that never ends",
            Content::Link("/dev/zero".into()),
        ),
        with("an entry that is a folder", Content::Folder),
    ];
    for (what, count) in [
        ("a count beyond memory", [0xff; 9]),
        ("as many again", [0x80; 9]),
    ] {
        let mut input = seeds().remove(0);
        if let Some(bytes) = input.get_mut(ENTRY) {
            bytes.truncate(HEAD);
            bytes.extend(count);
            bytes.push(1);
            seal(bytes);
        }
        found.push((what.to_owned(), input));
    }
    found
}

/// Puts the digest of `store` in place of zeros.
#[allow(clippy::disallowed_methods)]
fn adopt(input: &Input, store: &Store, folder: &Path) {
    let zeros = |bytes: &&[u8]| bytes.get(ORIGIN).is_some_and(|o| o.iter().all(|b| *b == 0));
    if let Some(mut bytes) = input.get(ENTRY).filter(zeros).map(<[u8]>::to_vec) {
        let path = folder.join(ENTRY);
        std::fs::remove_file(&path).expect("its own file");
        store.keep(ENTRY, &origin(), &());
        let own = std::fs::read(&path).expect("an entry");
        bytes[ORIGIN].copy_from_slice(&own[ORIGIN]);
        std::fs::write(path, bytes).expect("writable");
    }
}

fn give(input: &Input, folder: &Path) -> Result<bool, String> {
    let store = Store::in_folder(folder.to_path_buf(), ".");
    adopt(input, &store, folder);
    let read = store.recall::<Value>(ENTRY, &origin()).is_some();
    if store
        .recall::<Value>(ENTRY, &Origin::of_build("a build"))
        .is_some()
    {
        return Err("an entry of another origin is used".to_owned());
    }
    // A file that is no entry is left alone; an entry is written again.
    store.keep(
        ENTRY,
        &origin(),
        &(Vec::<f64>::new(), Vec::<Vec<f64>>::new(), "", None::<u64>),
    );
    Ok(read)
}
