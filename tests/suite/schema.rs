//! The JSON Schemas of the suite's files, generated from the structs and committed in `schema/`.

use fluxform::bundle::schema::record;

use crate::catalogue::CatalogueFile;
use crate::file::BenchFile;

/// The committed schemas: file name and text.
pub const SCHEMAS: [(&str, &str); 2] = [
    (
        "bench.schema.json",
        include_str!("schema/bench.schema.json"),
    ),
    (
        "extreme.schema.json",
        include_str!("schema/extreme.schema.json"),
    ),
];

/// The schemas as the structs have them now, in the order of [`SCHEMAS`].
#[must_use]
pub fn generated() -> [String; 2] {
    [record::<BenchFile>(), record::<CatalogueFile>()]
}

#[cfg(test)]
mod tests {
    use super::{SCHEMAS, generated};

    #[test]
    fn the_committed_schemas_are_the_generated_ones() {
        for ((name, committed), generated) in SCHEMAS.iter().zip(generated()) {
            assert!(
                *committed == generated,
                "tests/suite/schema/{name} is out of date: run `cargo test -p fluxform-bench --lib \
                 -- --ignored regenerate_schemas`"
            );
        }
    }

    #[test]
    #[ignore = "writes tests/suite/schema"]
    #[allow(clippy::disallowed_methods)]
    fn regenerate_schemas() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("schema");
        for ((name, _), generated) in SCHEMAS.iter().zip(generated()) {
            std::fs::write(folder.join(name), generated).unwrap();
        }
    }
}
