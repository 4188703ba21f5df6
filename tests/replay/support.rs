//! Small bundles.

use std::path::PathBuf;
use std::sync::OnceLock;

use fluxform::bundle::artefact::Input;
use fluxform::commands::calibrate::{self, CalibrateOptions};
use fluxform::commands::lambda::LambdaOptions;
use fluxform::commands::replay::Opened;
use fluxform::design::{Design, Need};
use fluxform::force_direction::{ForceDirection, ForceOverride};
use fluxform::progress::Silent;
use fluxform::scene::sources::{DesignSource, ShapeSource};
use fluxform::shape::document::ShapeDocument;
use fluxform_testing::root;
use tempfile::TempDir;

/// Bundles of a design, with every (from, to) in its text replaced.
pub struct Bundles {
    folder: TempDir,
    design: String,
}

impl Bundles {
    fn new(design: &str, changes: &[(&str, &str)], shapes: &[&str]) -> Self {
        Self::of_force(ForceDirection::Vertical, design, changes, shapes)
    }

    fn of_force(
        direction: ForceDirection,
        design: &str,
        changes: &[(&str, &str)],
        shapes: &[&str],
    ) -> Self {
        let path = root().join(design);
        let shipped = std::fs::read_to_string(&path).expect("shipped design");
        let text = changes.iter().fold(shipped, |text, (from, to)| {
            assert!(text.contains(from), "{from} is not in {design}");
            text.replace(from, to)
        });
        let (parsed, _) = Design::from_toml(&text, &path, Need::CALIBRATE).expect("valid");
        let input = Input::of_bytes(design, text.as_bytes());
        let shapes: Vec<ShapeSource> = shapes
            .iter()
            .map(|shape| {
                let text = std::fs::read_to_string(root().join(format!("shapes/{shape}.toml")))
                    .expect("shipped shape")
                    .replace("61]", "21]");
                let path = root().join(format!("shapes/{shape}.toml"));
                let (document, _) = ShapeDocument::from_toml(&text, &path).expect("valid");
                let input = Some(Input::of_bytes(*shape, text.as_bytes()));
                ShapeSource { document, input }
            })
            .collect();
        let folder = TempDir::new().expect("a temporary folder");
        let options = CalibrateOptions {
            lambda: LambdaOptions {
                force: ForceOverride {
                    direction: Some(direction),
                    normal_force: None,
                },
                ..LambdaOptions::default()
            },
            keep: false,
            page: false,
            ..CalibrateOptions::new(folder.path())
        };
        let source = DesignSource {
            design: &parsed,
            text: &text,
            input: &input,
        };
        calibrate::run(source, &shapes, &options, &Silent).expect("calibrates");
        Self {
            folder,
            design: parsed.name,
        }
    }

    pub fn folder(&self, shape: &str) -> PathBuf {
        self.folder.path().join(&self.design).join(shape)
    }

    pub fn open(&self, shape: &str) -> Opened {
        Opened::new(&self.folder(shape)).expect("a bundle")
    }
}

const COARSE: [(&str, &str); 3] = [
    ("x_mm = [-50.0, 50.0, 61]", "x_mm = [-50.0, 50.0, 41]"),
    ("y_mm = [-50.0, 50.0, 61]", "y_mm = [-50.0, 50.0, 41]"),
    ("z_mm = [10.0, 80.0, 29]", "z_mm = [16.0, 80.0, 33]"),
];

/// Flat surface and half-sphere over the array in air.
pub fn in_air() -> &'static Bundles {
    static MADE: OnceLock<Bundles> = OnceLock::new();
    MADE.get_or_init(|| Bundles::new("designs/seed_air.toml", &COARSE, &["flat", "half_sphere"]))
}

/// The half-sphere over the array in air, its force along the normal.
pub fn along_the_normal() -> &'static Bundles {
    static MADE: OnceLock<Bundles> = OnceLock::new();
    MADE.get_or_init(|| {
        let (design, shapes) = ("designs/seed_air.toml", ["half_sphere"]);
        Bundles::of_force(ForceDirection::Normal, design, &COARSE, &shapes)
    })
}

/// 25 coils whose currents flow both ways, and magnets so weak that they push each other less than the coils do.
const BOTH_WAYS: [(&str, &str); 3] = [
    ("rows = 3\ncolumns = 3", "rows = 5\ncolumns = 5"),
    (
        "total_current_max_a = 18.0",
        "total_current_max_a = 50.0\ncurrent_min_a = -2.0",
    ),
    ("1.1579e6", "1.1579e5"),
];

/// The flat surface over such an array in air.
pub fn both_ways() -> &'static Bundles {
    static MADE: OnceLock<Bundles> = OnceLock::new();
    MADE.get_or_init(|| {
        let changes = [COARSE.as_slice(), &BOTH_WAYS].concat();
        Bundles::new("designs/seed_air.toml", &changes, &["flat"])
    })
}

/// The same with its force along the normal.
pub fn both_ways_along_the_normal() -> &'static Bundles {
    static MADE: OnceLock<Bundles> = OnceLock::new();
    MADE.get_or_init(|| {
        let changes = [COARSE.as_slice(), &BOTH_WAYS].concat();
        let (design, shapes) = ("designs/seed_air.toml", ["flat"]);
        Bundles::of_force(ForceDirection::Normal, design, &changes, &shapes)
    })
}

/// Two coupled cored coils with the steel's own pull.
pub fn coupled() -> &'static Bundles {
    static MADE: OnceLock<Bundles> = OnceLock::new();
    MADE.get_or_init(|| {
        let mut changes = COARSE.to_vec();
        changes.extend([
            ("rows = 3\ncolumns = 3", "rows = 1\ncolumns = 2"),
            (
                "model = \"dipole\"",
                "model = \"dipole\"\npassive_force = true",
            ),
            ("total_current_max_a = 18.0", "total_current_max_a = 3.1"),
        ]);
        Bundles::new("designs/seed.toml", &changes, &["flat"])
    })
}
