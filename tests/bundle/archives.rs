//! Malformed archives: every loader refuses every one of them, the digests being right.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use fluxform::bundle::artefact::sha256_hex;
use fluxform::bundle::json::to_json;
use fluxform::bundle::load::Bundle;

use fluxform_testing::bundle::*;
use fluxform_testing::loaders::c_loader;
use fluxform_testing::needs::{self, Trial};
use fluxform_testing::run::Ran;
use fluxform_testing::{root, trials};

pub fn trials() -> Vec<Trial> {
    trials! {
        None => [
            the_library_refuses_malformed_archives,
            files_of_holes_are_refused_by_the_library_before_they_are_read,
        ],
        needs::numpy() => [
            python_refuses_malformed_archives,
            files_of_holes_are_refused_by_python_before_they_are_read,
        ],
        needs::c_compiler() => [
            c_refuses_malformed_archives,
            files_of_holes_are_refused_by_c_before_they_are_read,
        ],
        needs::octave() => [octave_refuses_malformed_archives],
    }
}

/// The Python loader as a program.
pub fn python_loads(bundle: &Path) -> Ran {
    let mut python = Command::new("python3");
    python
        .arg(root().join("src/python/fluxform/load_bundle.py"))
        .arg(bundle);
    python.env("PYTHONDONTWRITEBYTECODE", "1");
    Ran::of(python.output().unwrap())
}

/// A good archive taken apart.
#[derive(Clone)]
struct Archive {
    data: Vec<u8>,
    heads: Vec<Vec<u8>>,
    count: u16,
    behind: Vec<u8>,
}

impl Archive {
    fn of(bytes: &[u8]) -> Self {
        let end = bytes.len() - 22;
        let place = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let (mut at, mut heads) = (place(end + 16), Vec::new());
        let data = bytes[..at].to_vec();
        while at < end {
            let step = 46 + usize::from(bytes[at + 28]) + usize::from(bytes[at + 30]);
            heads.push(bytes[at..at + step].to_vec());
            at += step;
        }
        Self {
            count: heads.len() as u16,
            data,
            heads,
            behind: Vec::new(),
        }
    }

    fn bytes(&self) -> Vec<u8> {
        let directory = self.heads.concat();
        let mut bytes = [self.data.as_slice(), &directory].concat();
        bytes.extend([b'P', b'K', 5, 6, 0, 0, 0, 0]);
        bytes.extend([self.count.to_le_bytes(), self.count.to_le_bytes()].concat());
        bytes.extend((directory.len() as u32).to_le_bytes());
        bytes.extend((self.data.len() as u32).to_le_bytes());
        bytes.extend((self.behind.len() as u16).to_le_bytes());
        bytes.extend(&self.behind);
        bytes
    }

    /// Other words in the header of an array, under a fitting checksum.
    fn reword(&mut self, array: &str, from: &str, to: &str) {
        let name = format!("{array}.npy");
        let named = |head: &Vec<u8>| head[46..].starts_with(name.as_bytes());
        let head = self.heads.iter_mut().find(|head| named(head)).unwrap();
        let number =
            |bytes: &[u8], at| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let (local, size) = (number(head, 42), number(head, 24));
        let skipped = self.data[local + 26..local + 30].iter();
        let skipped: Vec<usize> = skipped.map(|byte| usize::from(*byte)).collect();
        let start = local + 30 + skipped[0] + 256 * skipped[1] + skipped[2] + 256 * skipped[3];
        let content = &mut self.data[start..start + size];
        let at = content
            .windows(from.len())
            .position(|part| part == from.as_bytes());
        let at = at.unwrap();
        content[at..at + from.len()].copy_from_slice(to.as_bytes());
        let sum = crc32fast::hash(content).to_le_bytes();
        self.data[local + 14..local + 18].copy_from_slice(&sum);
        head[16..20].copy_from_slice(&sum);
    }

    /// Where the entry's own header begins.
    fn local(&self, entry: usize) -> usize {
        let at = &self.heads[entry][42..46];
        u32::from_le_bytes(at.try_into().unwrap()) as usize
    }

    /// Another name in the directory alone.
    fn rename(&mut self, entry: usize) {
        self.heads[entry][46] = b'q';
    }

    fn twice(&mut self, entry: usize) {
        self.heads.push(self.heads[entry].clone());
        self.count += 1;
    }
}

type Damage = (&'static str, fn(&mut Archive));

const DAMAGES: &[Damage] = &[
    ("an array twice", |a| a.twice(5)),
    ("the first array twice", |a| a.twice(0)),
    ("an unknown array twice", |a| {
        a.rename(3);
        let own = a.local(3) + 30;
        a.data[own] = b'q';
        a.twice(3);
    }),
    // Broke: C read a bundle without the limit of the sum.
    ("another name in the directory", |a| {
        let named = |head: &Vec<u8>| head[46..].starts_with(b"total_current_max_a.npy");
        let entry = a.heads.iter().position(named).unwrap();
        a.rename(entry);
    }),
    ("a comment", |a| a.behind = b"made by hand".to_vec()),
    ("one entry less", |a| a.count -= 1),
    ("one entry more", |a| a.count += 1),
    ("more than 64 entries", |a| {
        for k in 0..60u8 {
            let mut head = a.heads[0].clone();
            head[46] = b'A' + k % 26;
            head[47] = b'a' + k / 26;
            a.heads.push(head);
            a.count += 1;
        }
    }),
    ("a compressed entry", |a| a.heads[4][10] = 8),
    ("an encrypted entry", |a| a.heads[4][8] |= 1),
    ("another packed size", |a| a.heads[4][20] ^= 8),
    ("an entry beyond the directory", |a| {
        a.heads[4][45] = 0x7f;
    }),
    ("an entry that reaches into the directory", |a| {
        let long = (a.data.len() as u32).to_le_bytes();
        a.heads[4][20..24].copy_from_slice(&long);
        a.heads[4][24..28].copy_from_slice(&long);
    }),
    ("no local header", |a| a.data[0] = b'X'),
    ("a name longer than the directory", |a| {
        a.heads.last_mut().unwrap()[29] = 0xff
    }),
    ("no mark in the directory", |a| a.heads[2][0] = b'X'),
    ("an array of another shape", |a| {
        a.reword("resistance_ohm", "(4,)", "(2,)");
    }),
    ("inductances in two rows of eight", |a| {
        a.reword("inductance_h", "(4, 4)", "(2, 8)");
    }),
    ("a voltage of another kind", |a| {
        a.reword("voltage_v", "<f8", "<i8");
    }),
    ("a header that does not end", |a| {
        a.reword("resistance_ohm", "}", " ")
    }),
    ("a header of more keys", |a| {
        a.reword("resistance_ohm", ", }", ",x}")
    }),
    // Broke: Octave read it.
    ("a header that does not begin", |a| {
        a.reword("resistance_ohm", "{", " ")
    }),
    // Broke: the library and Python read these seven, Octave all but the last.
    ("a tab behind the header", |a| {
        a.reword("resistance_ohm", "}  ", "} \t")
    }),
    ("a line feed behind the header", |a| {
        a.reword("resistance_ohm", "}  ", "}\n ")
    }),
    ("two line feeds at the end", |a| {
        a.reword("resistance_ohm", " \n", "\n\n")
    }),
    ("a vertical tab behind the header", |a| {
        a.reword("resistance_ohm", "}  ", "}\x0b ")
    }),
    ("a form feed behind the header", |a| {
        a.reword("resistance_ohm", "}  ", "}\x0c ")
    }),
    ("a carriage return at the end", |a| {
        a.reword("resistance_ohm", " \n", "\r\n")
    }),
    ("a tab in the header", |a| {
        a.reword("resistance_ohm", ": (", ":\t(")
    }),
    // Broke: the library and Python read it.
    ("a space in a number", |a| {
        a.reword("x_m", "(13,), } ", "(1 3,), }")
    }),
    // Broke: the library read it.
    ("a sign in the shape", |a| {
        a.reword("resistance_ohm", "(4,), } ", "(+4,), }")
    }),
    // Broke: Octave read it.
    ("two commas in the shape", |a| {
        a.reword("resistance_ohm", "(4,), } ", "(4,,), }")
    }),
];

/// Other forms of a header, which every loader reads.
const FORMS: &[Damage] = &[
    ("spaces elsewhere", |a| {
        a.reword("resistance_ohm", "(4,), } ", " ( 4 ) }")
    }),
    ("no space", |a| {
        a.reword("inductance_h", ": (4, 4), } ", ":(4,4)}     ")
    }),
    ("no line feed", |a| a.reword("resistance_ohm", " \n", "  ")),
];

/// Bundles with such archives, their digests sealed: those that every loader reads, and those that none does.
fn bundles(folder: &Path) -> [Vec<(&'static str, PathBuf)>; 2] {
    let sample = sample(false, [13, 4, 4]);
    let good = folder.join("good");
    sample.write(&good, false).unwrap();
    let bytes = fs::read(good.join("map.npz")).unwrap();
    let whole = Archive::of(&bytes);
    assert_eq!(whole.bytes(), bytes);
    let changed = |(name, change): &Damage| {
        let mut archive = whole.clone();
        change(&mut archive);
        (*name, archive.bytes())
    };
    let edited = [
        ("bytes behind the end", [bytes.as_slice(), &[0; 5]].concat()),
        (
            "bytes before the start",
            [&[0; 5], bytes.as_slice()].concat(),
        ),
        ("cut short", bytes[..bytes.len() - 1].to_vec()),
        ("an end record alone", bytes[bytes.len() - 22..].to_vec()),
        ("nothing", Vec::new()),
    ];
    let written = |(name, map): (&'static str, Vec<u8>)| {
        let target = folder.join(name.replace(' ', "_"));
        let mut manifest = sample.write(&target, false).unwrap();
        let entry = manifest
            .files
            .iter_mut()
            .find(|file| file.path == "map.npz")
            .unwrap();
        (entry.bytes, entry.sha256) = (map.len() as u64, sha256_hex(&map));
        fs::write(target.join("map.npz"), map).unwrap();
        fs::write(target.join("manifest.json"), to_json(&manifest).unwrap()).unwrap();
        (name, target)
    };
    let read = FORMS.iter().map(changed).map(written);
    let read = [("good", good.clone())].into_iter().chain(read).collect();
    let damaged = DAMAGES.iter().map(changed).chain(edited);
    [read, damaged.map(written).collect()]
}

const OCTAVE: &str = "addpath(getenv('FLUXFORM_SCRIPTS'));
folders = strsplit(strtrim(fileread('folders.txt')), \"\\n\");
for k = 1:numel(folders)
    try
        load_bundle(folders{k});
        printf('read\\n');
    catch problem
        printf('%s\\n', problem.identifier);
    end
end";

/// `load` reads the bundles that it should, and refuses the others in words that contain `named`.
fn only_malformed_are_refused(named: &str, load: impl Fn(&Path) -> Result<(), String>) {
    let folder = tempfile::tempdir().unwrap();
    let [read, damaged] = bundles(folder.path());
    for (name, target) in read {
        assert_eq!(load(&target), Ok(()), "{name}");
    }
    for (name, target) in damaged {
        let refused = load(&target).expect_err(name);
        assert!(refused.contains(named), "{name}: {refused}");
    }
}

fn the_library_refuses_malformed_archives() {
    only_malformed_are_refused("", |target| {
        let loaded = Bundle::open(target);
        loaded.map(drop).map_err(|error| error.to_string())
    });
}

/// What a loader that is a program answers.
fn answered(ran: Ran) -> Result<(), String> {
    match ran.code {
        Some(0) => Ok(()),
        Some(3) => Err(ran.err),
        _ => panic!("{ran:?}"),
    }
}

fn python_refuses_malformed_archives() {
    only_malformed_are_refused("map.npz", |target| answered(python_loads(target)));
}

fn c_refuses_malformed_archives() {
    let folder = tempfile::tempdir().unwrap();
    let program = c_loader(folder.path(), &[]);
    only_malformed_are_refused("", |target| {
        let mut c = Command::new(&program);
        c.arg(target.join("map.npz")).stdin(Stdio::null());
        answered(Ran::of(c.output().unwrap()))
    });
}

fn octave_refuses_malformed_archives() {
    let folder = tempfile::tempdir().unwrap();
    let [read, damaged] = bundles(folder.path());
    let folders: String = read
        .iter()
        .chain(&damaged)
        .map(|(_, target)| format!("{}\n", target.display()))
        .collect();
    fs::write(folder.path().join("folders.txt"), folders).unwrap();
    let output = Command::new("octave-cli")
        .args(["--norc", "--quiet", "--eval", OCTAVE])
        .env("FLUXFORM_SCRIPTS", root().join("scripts"))
        .current_dir(folder.path())
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    let mut answers = printed.lines();
    for (name, _) in &read {
        assert_eq!(answers.next(), Some("read"), "{name}: {printed}");
    }
    for (name, _) in &damaged {
        assert_eq!(answers.next(), Some("fluxform:bundle"), "{name}");
    }
}

/// A file of holes took the memory that it claims to need.
fn bundles_with_holes(refuse: impl Fn(&Path, &str)) {
    let folder = tempfile::tempdir().unwrap();
    let sample = sample(false, [4, 4, 4]);
    for (name, bytes) in [
        ("map.npz", 6_000_000_000),
        ("map.npz", 3_000_000_000),
        ("more", 20_000_000_000_u64),
    ] {
        let target = folder.path().join(format!("{name}{bytes}"));
        let mut manifest = sample.write(&target, false).unwrap();
        let file = fs::File::options()
            .create(true)
            .append(true)
            .open(target.join(name))
            .unwrap();
        file.set_len(bytes).unwrap();
        let entry = manifest.files.iter_mut().find(|file| file.path == name);
        match entry {
            Some(entry) => entry.bytes = bytes,
            None => manifest.files.push(fluxform::bundle::artefact::FileEntry {
                path: name.to_owned(),
                bytes,
                sha256: sha256_hex(b""),
            }),
        }
        fs::write(target.join("manifest.json"), to_json(&manifest).unwrap()).unwrap();
        refuse(&target, name);
    }
}

fn files_of_holes_are_refused_by_the_library_before_they_are_read() {
    bundles_with_holes(|target, _| {
        let error = Bundle::open(target).unwrap_err().to_string();
        assert!(
            error.contains("holes") || error.contains("at most"),
            "{error}"
        );
    });
}

fn files_of_holes_are_refused_by_python_before_they_are_read() {
    bundles_with_holes(|target, _| {
        // 2 GB of address space are too few to read any of them.
        let mut python = Command::new("sh");
        python
            .args(["-c", "ulimit -v 2000000; exec python3 \"$0\" \"$1\""])
            .arg(root().join("src/python/fluxform/load_bundle.py"))
            .arg(target)
            .env("OPENBLAS_NUM_THREADS", "1")
            .env("PYTHONDONTWRITEBYTECODE", "1");
        let ran = Ran::of(python.output().unwrap());
        assert_eq!(ran.code, Some(3), "{}", ran.err);
        assert!(
            ran.err.contains("holes") || ran.err.contains("4 GiB"),
            "{}",
            ran.err
        );
    });
}

fn files_of_holes_are_refused_by_c_before_they_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let program = c_loader(folder.path(), &[]);
    bundles_with_holes(|target, name| {
        if name == "map.npz" {
            let output = Command::new(&program).arg(target.join(name)).output();
            assert_eq!(output.unwrap().status.code(), Some(3));
        }
    });
}
