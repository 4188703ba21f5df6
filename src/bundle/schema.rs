//! The JSON Schemas of the artefacts, generated from the structs and committed in `schema/`.

use schemars::{JsonSchema, schema_for};
use serde_json::json;

use super::bench::BenchFile;
use super::lambda_file::LambdaFile;
use super::manifest::{Manifest, MapSidecar};
use super::scan::ScanFile;
use super::seal::SEAL;
use super::sweep::{MergeSummary, PlanFile, PointFile};

/// The committed schemas: file name and text.
pub const SCHEMAS: [(&str, &str); 8] = [
    (
        "manifest.schema.json",
        include_str!("schema/manifest.schema.json"),
    ),
    ("map.schema.json", include_str!("schema/map.schema.json")),
    (
        "lambda.schema.json",
        include_str!("schema/lambda.schema.json"),
    ),
    (
        "sweep_plan.schema.json",
        include_str!("schema/sweep_plan.schema.json"),
    ),
    (
        "sweep_point.schema.json",
        include_str!("schema/sweep_point.schema.json"),
    ),
    (
        "sweep_merge.schema.json",
        include_str!("schema/sweep_merge.schema.json"),
    ),
    (
        "bench.schema.json",
        include_str!("schema/bench.schema.json"),
    ),
    ("scan.schema.json", include_str!("schema/scan.schema.json")),
];

/// The schemas as the structs have them now, in the order of [`SCHEMAS`].
#[must_use]
pub fn generated() -> [String; 8] {
    [
        record::<Manifest>(),
        record::<MapSidecar>(),
        text::<LambdaFile>(),
        text::<PlanFile>(),
        text::<PointFile>(),
        record::<MergeSummary>(),
        record::<BenchFile>(),
        text::<ScanFile>(),
    ]
}

/// The schema of `T`, as it is committed.
#[must_use]
pub fn text<T: JsonSchema>() -> String {
    format!("{:#}\n", schema_for!(T).as_value())
}

/// The schema of a value that is written with its seal.
#[must_use]
pub fn record<T: JsonSchema>() -> String {
    let mut schema = schema_for!(T).to_value();
    schema["properties"][SEAL] = json!({
        "type": "string",
        "description": "SHA-256 of this text without this line and the comma before it, 64 lower-case \
                        hexadecimal digits; absent from files of schema 1.3 and before. A checksum, no \
                        signature.",
    });
    format!("{schema:#}\n")
}

#[cfg(test)]
mod tests {
    use super::{SCHEMAS, generated};

    #[test]
    fn the_committed_schemas_are_the_generated_ones() {
        for ((name, committed), generated) in SCHEMAS.iter().zip(generated()) {
            assert!(
                *committed == generated,
                "src/bundle/schema/{name} is out of date: raise SCHEMA_VERSION where the layout \
                 changed and run `cargo test -p \
                 fluxform-bundle --lib -- --ignored regenerate_schemas`"
            );
        }
    }

    #[test]
    #[ignore = "writes src/bundle/schema"]
    #[allow(clippy::disallowed_methods)]
    fn regenerate_schemas() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("schema");
        for ((name, _), generated) in SCHEMAS.iter().zip(generated()) {
            std::fs::write(folder.join(name), generated).unwrap();
        }
    }
}
