//! The one form of zip archive that all loaders of bundles accept.
//!
//! The directory fills the file from the last entry to an end record without a comment; every entry
//! is stored as it is, undamaged, its name the same in both places and there once. Of two entries
//! of one name, or of two directories, other programs might read the other one; a damaged name
//! would hide an array. Nothing is copied or allocated by what the archive claims.

use std::collections::BTreeMap;

/// The most entries: an archive of ours has half as many.
const ENTRIES_MAX: usize = 64;
const END_BYTES: usize = 22;
const HEAD_BYTES: usize = 46;
const LOCAL_BYTES: usize = 30;
const END_MARK: u32 = 0x0605_4b50;
const HEAD_MARK: u32 = 0x0201_4b50;
const LOCAL_MARK: u32 = 0x0403_4b50;

fn u16_at(bytes: &[u8], at: usize) -> Option<usize> {
    let found = bytes.get(at..)?.first_chunk::<2>()?;
    Some(usize::from(u16::from_le_bytes(*found)))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    let found = bytes.get(at..)?.first_chunk::<4>()?;
    Some(u32::from_le_bytes(*found))
}

fn place_at(bytes: &[u8], at: usize) -> Option<usize> {
    usize::try_from(u32_at(bytes, at)?).ok()
}

/// The entries of an untrusted archive by name.
///
/// # Errors
/// The first thing that is not of that form, as a sentence.
pub(super) fn entries(bytes: &[u8]) -> Result<BTreeMap<&[u8], &[u8]>, String> {
    let cut = || "it is cut short, or has bytes behind its end".to_owned();
    let damaged = || "its directory is damaged".to_owned();
    let end = bytes.len().checked_sub(END_BYTES).ok_or_else(cut)?;
    if u32_at(bytes, end) != Some(END_MARK) || u16_at(bytes, end + 20) != Some(0) {
        return Err(cut());
    }
    let count = u16_at(bytes, end + 10).ok_or_else(cut)?;
    let directory = place_at(bytes, end + 16).ok_or_else(cut)?;
    let whole = place_at(bytes, end + 12).and_then(|size| directory.checked_add(size));
    let one_disk = u32_at(bytes, end + 4) == Some(0) && u16_at(bytes, end + 8) == Some(count);
    if !one_disk || whole != Some(end) {
        return Err(damaged());
    }
    if count > ENTRIES_MAX {
        return Err(format!("it has more than {ENTRIES_MAX} entries"));
    }
    let mut entries = BTreeMap::new();
    let (data, mut heads) = (&bytes[..directory], &bytes[directory..end]);
    for _ in 0..count {
        let (name, step) = name_of(heads).ok_or_else(damaged)?;
        let (head, rest) = heads.split_at(step);
        heads = rest;
        let content = content_of(data, head, name)
            .map_err(|message| format!("{} {message}", String::from_utf8_lossy(name)))?;
        if entries.insert(name, content).is_some() {
            let name = String::from_utf8_lossy(name);
            return Err(format!("{name} is there twice"));
        }
    }
    if heads.is_empty() {
        Ok(entries)
    } else {
        Err(damaged())
    }
}

/// The name in the directory's first part, and that part's length.
fn name_of(heads: &[u8]) -> Option<(&[u8], usize)> {
    (u32_at(heads, 0)? == HEAD_MARK).then_some(())?;
    let name = u16_at(heads, 28)?;
    let step = HEAD_BYTES + name + u16_at(heads, 30)? + u16_at(heads, 32)?;
    heads.get(..step)?;
    Some((heads.get(HEAD_BYTES..HEAD_BYTES + name)?, step))
}

/// The bytes of the entry `name` whose part of the directory is `head`.
fn content_of<'a>(data: &'a [u8], head: &[u8], name: &[u8]) -> Result<&'a [u8], &'static str> {
    let plain = u16_at(head, 10) == Some(0) && u16_at(head, 8).is_some_and(|flags| flags & 1 == 0);
    if !plain || u32_at(head, 20) != u32_at(head, 24) {
        return Err("is compressed, encrypted or larger than 4 GiB, expected stored as it is");
    }
    let found = || {
        let size = place_at(head, 24)?;
        let local = data.get(place_at(head, 42)?..)?;
        (u32_at(local, 0)? == LOCAL_MARK).then_some(())?;
        let named = LOCAL_BYTES + u16_at(local, 26)?;
        let begin = named + u16_at(local, 28)?;
        let content = local.get(begin..begin.checked_add(size)?)?;
        Some((&local[LOCAL_BYTES..named], content))
    };
    let (own_name, content) = found().ok_or("lies outside the file")?;
    if own_name != name {
        return Err("has another name in the directory");
    }
    if Some(crc32fast::hash(content)) == u32_at(head, 16) {
        Ok(content)
    } else {
        Err("is damaged (CRC)")
    }
}
