//! Small files of which many are written and any can be made again.

use std::io::Write;
use std::path::Path;

use super::WriteError;
use super::busy::Writing;
use super::leftovers::temporary_file;
use super::made::made_in;

/// Writes one file beside its target and renames it into place, replacing what is there, without
/// forcing anything to the disk: readers and other runs see it whole or not at all, but a lost
/// system may leave it empty or cut short. Its reader must recognise that, by a checksum.
///
/// # Errors
/// [`WriteError`]; the target is then as it was.
pub fn write_unforced(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), WriteError> {
    let _writing = Writing::begin();
    let target = folder.join(name);
    let fail = |error| WriteError::from_io("write", &target, error);
    let made = made_in(folder, temporary_file).map_err(|error| error.of("write", &target))?;
    // Dropped in the reverse order: a file that is not put in place goes before its folder does.
    let (_folders, mut file) = (made.1, made.0);
    file.write_all(bytes).map_err(fail)?;
    file.persist(&target).map_err(|error| fail(error.error))?;
    Ok(())
}
