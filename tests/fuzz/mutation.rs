//! Damage to surface files: of bytes, of words and lines, of what containers hold.

use std::io::{Cursor, Read, Write};

use flate2::Compression;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use fluxform_testing::Random;

/// No mutated content grows beyond this, bytes.
const MOST: usize = 4 << 20;

/// A whole file, taken apart as far as it can be packed again.
#[derive(Clone)]
pub enum Seed {
    /// Bytes as they are.
    Plain(Vec<u8>),
    /// An archive's parts by name.
    Zip(Vec<(String, Vec<u8>)>),
    /// The display lists of a native part.
    Display(Vec<u8>),
}

impl Seed {
    /// The seed of a file's bytes.
    pub fn of(bytes: Vec<u8>) -> Self {
        let Ok(mut archive) = ZipArchive::new(Cursor::new(&bytes)) else {
            return Self::Plain(bytes);
        };
        let mut parts = Vec::new();
        for k in 0..archive.len() {
            let Ok(mut part) = archive.by_index(k) else {
                continue;
            };
            let mut content = Vec::new();
            if part.read_to_end(&mut content).is_ok() {
                let name = part
                    .name()
                    .map_or_else(|_| "?".into(), |name| name.into_owned());
                parts.push((name, content));
            }
        }
        Self::Zip(parts)
    }

    /// The file.
    pub fn pack(&self) -> Vec<u8> {
        match self {
            Self::Plain(bytes) => bytes.clone(),
            Self::Zip(parts) => zipped(parts),
            Self::Display(stream) => fluxform_testing::surface_files::sldprt_of(stream),
        }
    }

    /// Bytes of the content, unpacked.
    pub fn content(&self) -> usize {
        match self {
            Self::Plain(bytes) | Self::Display(bytes) => bytes.len(),
            Self::Zip(parts) => parts
                .iter()
                .map(|(name, part)| name.len() + part.len())
                .sum(),
        }
    }

    /// The seed with some damage, packed; and the bytes of the content.
    pub fn mutated(&self, random: &mut Random) -> (Vec<u8>, usize) {
        let mut copy = self.clone();
        let inside = random.below(5) > 0;
        if inside {
            match &mut copy {
                Self::Plain(bytes) | Self::Display(bytes) => damage(bytes, random),
                Self::Zip(parts) => damage_parts(parts, random),
            }
        }
        let mut bytes = copy.pack();
        if !inside {
            for _ in 0..=random.below(4) {
                damage_bytes(&mut bytes, random);
            }
        }
        (bytes, copy.content())
    }
}

/// An archive of these parts; names are taken as they are.
pub fn zipped(parts: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(i64::from(Compression::fast().level())));
    for (name, content) in parts {
        // The writer refuses a name that it has: such a part is left out.
        if zip.start_file(name.as_str(), options).is_ok() {
            zip.write_all(content).expect("memory takes all");
        }
    }
    zip.finish().expect("memory takes all").into_inner()
}

fn damage_parts(parts: &mut Vec<(String, Vec<u8>)>, random: &mut Random) {
    const NAMES: [&str; 8] = [
        "../../etc/passwd",
        "/etc/passwd",
        "C:\\a.model",
        "3D/../3D/3dmodel.model",
        "",
        "3d/3DMODEL.MODEL",
        "a\u{0}b",
        "\u{202e}ledom.3",
    ];
    if parts.is_empty() {
        return;
    }
    let k = random.below(parts.len());
    match random.below(12) {
        0 => parts[k].0 = NAMES[random.below(NAMES.len())].into(),
        1 => {
            parts.remove(k);
        }
        2 => {
            let mut copy = parts[k].clone();
            copy.0 += "2";
            parts.push(copy);
        }
        3 => {
            let l = random.below(parts.len());
            let content = parts[l].1.clone();
            parts[k].1 = content;
        }
        _ => damage(&mut parts[k].1, random),
    }
}

/// Some damage to a content, textual or binary.
pub fn damage(bytes: &mut Vec<u8>, random: &mut Random) {
    for _ in 0..=random.below(5) {
        let before = bytes.len();
        match random.below(4) {
            0 => damage_bytes(bytes, random),
            1 => damage_lines(bytes, random),
            _ => damage_words(bytes, random),
        }
        if bytes.len() > MOST {
            bytes.truncate(before.min(MOST));
        }
    }
}

fn damage_bytes(bytes: &mut Vec<u8>, random: &mut Random) {
    const EXTREMES: [u64; 9] = [
        0,
        1,
        0x7f,
        0x7fff_ffff,
        0x8000_0000,
        0xffff_ffff,
        0x7f80_0000,
        0x7ff0_0000_0000_0000,
        u64::MAX,
    ];
    if bytes.is_empty() {
        return;
    }
    let at = random.below(bytes.len());
    let end = (at + 1 + random.below(80)).min(bytes.len());
    match random.below(7) {
        0 => bytes[at] = random.bits() as u8,
        1 => bytes[at] ^= 1 << random.below(8),
        2 => bytes.truncate(at),
        3 => {
            bytes.drain(at..end);
        }
        4 => {
            let copy = bytes[at..end].to_vec();
            let to = random.below(bytes.len());
            bytes.splice(to..to, copy);
        }
        _ => {
            let width = [1, 2, 4, 8][random.below(4)];
            let value = EXTREMES[random.below(EXTREMES.len())].to_le_bytes();
            for (slot, byte) in bytes[at..].iter_mut().zip(&value[..width]) {
                *slot = *byte;
            }
        }
    }
}

/// Deletes, doubles, swaps or repeats what stands between line ends, `;` or `>`.
fn damage_lines(bytes: &mut Vec<u8>, random: &mut Random) {
    let line = |random: &mut Random| {
        let ends = |b: &u8| matches!(b, b'\n' | b'\r' | b';' | b'>');
        let at = random.below(bytes.len().max(1)).min(bytes.len());
        let start = bytes[..at].iter().rposition(ends).map_or(0, |k| k + 1);
        let end = bytes[at..].iter().position(ends);
        start..end.map_or(bytes.len(), |k| at + k + 1)
    };
    let (first, second) = (line(random), line(random));
    let copy = bytes[first.clone()].to_vec();
    match random.below(5) {
        0 => {
            bytes.drain(first);
        }
        1 => {
            bytes.splice(second.start..second.start, copy);
        }
        2 => {
            bytes.splice(second, copy);
        }
        3 => {
            let times = [2, 10, 100, 3000][random.below(4)];
            let times = times.min(MOST / 4 / copy.len().max(1));
            bytes.splice(first.end..first.end, copy.repeat(times));
        }
        _ => {
            let wrap: [(&[u8], &[u8]); 6] = [
                (b"(", b")"),
                (b"<a>", b"</a>"),
                (b"<![CDATA[", b"]]>"),
                (b"<!--", b"-->"),
                (b"'", b"'"),
                (b"/*", b"*/"),
            ];
            let (open, close) = wrap[random.below(wrap.len())];
            let times = [1, 1, 1, 50, 300, 20_000][random.below(6)];
            let wrapped = [open.repeat(times), copy, close.repeat(times)].concat();
            bytes.splice(first, wrapped);
        }
    }
}

/// Replaces a word or number by another of the file, or by one that no program expects.
fn damage_words(bytes: &mut Vec<u8>, random: &mut Random) {
    const WORDS: [&[u8]; 27] = [
        b"0",
        b"-1",
        b"1",
        b"2147483648",
        b"4294967295",
        b"18446744073709551615",
        b"99999999999999999999999",
        b"1e308",
        b"-1e308",
        b"1e309",
        b"1e-320",
        b"nan",
        b"inf",
        b"1E+002",
        b"0.1.2",
        b"1,5",
        b"#1",
        b"#0",
        b"$",
        b"*",
        b"()",
        b"\xff\xfe",
        b"&#0;",
        b"&lol;",
        b"\"",
        b"''",
        b"<!DOCTYPE a [<!ENTITY lol \"&lol;&lol;\">]>",
    ];
    let is_word = |b: &u8| b.is_ascii_alphanumeric() || b"_.+-#".contains(b);
    let word = |random: &mut Random| {
        if bytes.is_empty() {
            return 0..0;
        }
        let from = random.below(bytes.len());
        let start = bytes[from..]
            .iter()
            .position(is_word)
            .map_or(from, |k| from + k);
        let length = bytes[start..].iter().position(|b| !is_word(b));
        start..length.map_or(bytes.len(), |k| start + k)
    };
    let (first, second) = (word(random), word(random));
    let new = if random.below(2) == 0 {
        bytes[second].to_vec()
    } else {
        WORDS[random.below(WORDS.len())].to_vec()
    };
    bytes.splice(first, new);
}
