//! What an accessor claims against what the file holds.

use gltf::Accessor;
use gltf::buffer::Source;

/// Data that are not in the file as plain numbers.
pub(super) fn missing() -> String {
    "the GLB file holds a mesh whose data are missing, compressed or in another \
     file: save it again as one file without compression (Draco, meshopt)"
        .to_owned()
}

/// Checks that an accessor's numbers lie within the file.
///
/// # Errors
/// Sparse data; numbers that are not there.
pub(super) fn check(accessor: &Accessor<'_>, blob: &[u8]) -> Result<(), String> {
    // First: sparse data may have nothing else in the file.
    if accessor.sparse().is_some() {
        let what = "the GLB file holds sparse data, which are not read: export it again without \
                    sparse accessors";
        return Err(what.to_owned());
    }
    let held = || {
        let view = accessor.view()?;
        let in_file = matches!(view.buffer().source(), Source::Bin);
        let end = view.offset().checked_add(view.length())?;
        let stride = view.stride().unwrap_or(accessor.size());
        let last = accessor.count().checked_sub(1)?.checked_mul(stride)?;
        let reach = accessor
            .offset()
            .checked_add(last)?
            .checked_add(accessor.size())?;
        (in_file && end <= blob.len() && reach <= view.length() && stride >= accessor.size())
            .then_some(())
    };
    held().ok_or_else(missing)
}
