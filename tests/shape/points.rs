//! From documents to constraint points: the seed's shapes, placements, and what is refused.

use std::path::Path;

use fluxform_base::progress::{Progress, Silent};
use fluxform_numerics::axis::Axis;
use fluxform_shape::bodies::BodyOptions;
use fluxform_shape::document::{
    AxisRequest, GridRequest, Placement, Primitive, ShapeDocument, SurfaceSource,
};
use fluxform_shape::{ConstraintPoints, Discretized, ShapeError, discretize};

use fluxform_testing::root;
use fluxform_testing::surfaces::{file, lifted, seed_grid};

const NAMES: [&str; 4] = ["flat", "half_sphere", "half_cylinder", "wedge"];

/// Height of the body's z = 0 and the largest distance of its facets from the shape, m.
fn body(name: &str) -> (f64, f64) {
    match name {
        "flat" => (0.05, 0.0),
        "half_sphere" => (0.03, 12.2e-6),
        "half_cylinder" => (0.03, 0.99e-6),
        _ => (0.03, 0.0),
    }
}

fn primitive(name: &str) -> Primitive {
    match name {
        "flat" => Primitive::Flat {
            side_m: 0.1,
            height_m: 0.05,
        },
        "half_sphere" => Primitive::HalfSphere {
            radius_m: 0.05,
            base_m: 0.03,
        },
        "half_cylinder" => Primitive::HalfCylinder {
            radius_m: 0.05,
            length_m: 0.1,
            base_m: 0.03,
        },
        _ => Primitive::Wedge {
            side_m: 0.1,
            low_m: 0.03,
            high_m: 0.08,
        },
    }
}

fn from_stl(name: &str, placement: Placement, grid: GridRequest) -> Discretized {
    let path = root().join(format!("shapes/{name}.stl"));
    discretize(&file(&path, 0.001, placement, grid), &Silent).unwrap()
}

fn exactly(primitive: Primitive, placement: Placement, grid: GridRequest) -> ShapeDocument {
    ShapeDocument {
        force: Default::default(),
        name: "exact".into(),
        source: SurfaceSource::Primitive(primitive),
        bodies: BodyOptions::default(),
        scale: [1.0; 3],
        placement,
        grid,
        weights: None,
        direction_jnd_deg: fluxform_base::units::DIRECTION_JND_DEG,
        grid_is_given: true,
    }
}

fn message(document: &ShapeDocument) -> String {
    discretize(document, &Silent).unwrap_err().to_string()
}

/// Distance of a point to the shape along its normal, m.
fn off(name: &str, points: &ConstraintPoints, row: usize, exact_m: f64) -> f64 {
    let (x, y, rise) = (
        points.x_m[row],
        points.y_m[row],
        points.height_m[row] - 0.03,
    );
    match name {
        "half_sphere" => (x.hypot(y).hypot(rise) - 0.05).abs(),
        "half_cylinder" => (x.hypot(rise) - 0.05).abs(),
        _ => (points.height_m[row] - exact_m).abs(),
    }
}

#[test]
fn the_bodies_have_the_primitives_heights_and_borders() {
    for name in NAMES {
        let (lift, deviation) = body(name);
        let mesh = from_stl(name, lifted(lift), seed_grid());
        let exact = discretize(
            &exactly(primitive(name), Placement::default(), seed_grid()),
            &Silent,
        )
        .unwrap();
        let expected = if name == "half_sphere" { 2821 } else { 3721 };
        assert_eq!(
            (mesh.points.len(), mesh.points.outside),
            (expected, 3721 - expected),
            "{name}"
        );
        assert_eq!(mesh.points.grid_index, exact.points.grid_index, "{name}");
        assert!(mesh.warnings.is_empty() && mesh.mesh.unwrap().degenerate == 0);
        let mut worst = 0.0f64;
        for row in 0..expected {
            worst = worst.max(off(name, &mesh.points, row, exact.points.height_m[row]));
            let (n, e) = (mesh.points.normal[row], exact.points.normal[row]);
            // A facet's normal is off by the angle it spans.
            let cosine = n[0] * e[0] + n[1] * e[1] + n[2] * e[2];
            assert!(
                cosine > 1.0 - 2.0 * deviation / 0.05 - 2e-3,
                "{name} {row}: {n:?} {e:?}"
            );
        }
        // Nothing but the facets' own deviation, and not much less.
        assert!(worst <= deviation + 1e-15, "{name}: {worst}");
        assert!(worst >= 0.7 * deviation, "{name}: {worst}");
        let facts = mesh.points.facts();
        let (low, high) = match name {
            "flat" => (0.05, 0.05),
            _ => (0.03, 0.08),
        };
        assert_eq!(
            (facts.min_height_m, facts.max_height_m),
            (low, high),
            "{name}"
        );
    }
}

#[test]
fn points_stand_in_the_grids_order() {
    let result = from_stl("half_sphere", lifted(0.03), seed_grid());
    let points = &result.points;
    let rows = points.row_of_grid_point();
    assert_eq!(rows.iter().flatten().count(), points.len());
    for (row, index) in points.grid_index.iter().enumerate() {
        assert_eq!(rows[*index], Some(row));
        assert_eq!(points.x_m[row], points.grid.x_m.node(index % 61));
        assert_eq!(points.y_m[row], points.grid.y_m.node(index / 61));
    }
    assert!(rows[0].is_none() && rows[30].is_some());
    let mean: f64 = points.height_m.iter().map(|h| h * h).sum::<f64>() / points.len() as f64;
    assert!((points.facts().rms_height_m - mean.sqrt()).abs() < 1e-15);
}

#[test]
fn the_surfaces_own_extent_reaches_its_borders() {
    let grid = GridRequest {
        x: AxisRequest::Extent(31),
        y: AxisRequest::Extent(23),
    };
    for name in NAMES {
        let (lift, _) = body(name);
        let mesh = from_stl(name, lifted(lift), grid);
        let exact = discretize(
            &exactly(primitive(name), Placement::default(), grid),
            &Silent,
        )
        .unwrap();
        assert_eq!(mesh.points.grid, exact.points.grid, "{name}");
        assert_eq!(
            mesh.points.grid.x_m,
            Axis {
                from: -0.05,
                to: 0.05,
                samples: 31
            }
        );
        assert_eq!(mesh.points.grid_index, exact.points.grid_index, "{name}");
    }
}

#[test]
fn a_turned_body_and_a_turned_primitive_agree() {
    for turn in [90.0, 30.0, -123.4] {
        for name in ["wedge", "half_cylinder"] {
            let (lift, deviation) = body(name);
            let grid = GridRequest {
                x: AxisRequest::Extent(37),
                y: AxisRequest::Extent(37),
            };
            let turned = |z| Placement {
                translate_m: [0.011, -0.023, z],
                rotate_deg: [0.0, 0.0, turn],
                ..Placement::default()
            };
            let mesh = from_stl(name, turned(lift), grid);
            let mut document = exactly(primitive(name), turned(0.0), grid);
            let axes = mesh.points.grid;
            document.grid = GridRequest {
                x: AxisRequest::Given(axes.x_m),
                y: AxisRequest::Given(axes.y_m),
            };
            let exact = discretize(&document, &Silent).unwrap();
            let (a, b) = (
                mesh.points.row_of_grid_point(),
                exact.points.row_of_grid_point(),
            );
            let both: Vec<_> = a
                .iter()
                .zip(&b)
                .filter_map(|(a, b)| Some(((*a)?, (*b)?)))
                .collect();
            // Border points may differ by rounding: at most the four corners' few.
            assert!(both.len() + 4 >= mesh.points.len().max(exact.points.len()));
            for (i, j) in both {
                let slope = 1.0 / exact.points.normal[j][2].max(0.05);
                let error = (mesh.points.height_m[i] - exact.points.height_m[j]).abs();
                assert!(
                    error <= (deviation * 1.1) * slope + 1e-9,
                    "{name} {turn}: {error}"
                );
            }
        }
    }
}

#[test]
fn the_rounding_is_the_stages_error() {
    let accuracy = from_stl("wedge", lifted(0.03), seed_grid()).accuracy;
    // Of height, and of plan on a slope of a half, which was left out.
    let estimate = 1.5 * 0.05 * 2f64.powi(-24);
    assert!((accuracy.estimate - estimate).abs() < 1e-20);
    assert_eq!(accuracy.relative_to, "1 m");
    assert!(accuracy.method.contains("tessellation"));
}

#[test]
fn a_surface_outside_the_grid_is_refused_with_both_extents() {
    let path = root().join("shapes/wedge.stl");
    // The usual slip: the file's millimetres taken as metres.
    let far = Placement {
        translate_m: [0.25, 0.0, 0.03],
        rotate_deg: [0.0; 3],
        ..Placement::default()
    };
    let said = message(&file(&path, 0.001, far, seed_grid()));
    assert!(
        said.contains("x 200 to 300 mm") && said.contains("x -50 to 50 mm"),
        "{said}"
    );
    // Overlapping, but between the grid's points.
    let small = Placement {
        translate_m: [0.0007, 0.0007, 0.03],
        rotate_deg: [0.0; 3],
        ..Placement::default()
    };
    let said = message(&file(&path, 1e-6, small, seed_grid()));
    assert!(said.contains("none of the 3721 grid points"), "{said}");
}

#[test]
fn a_surface_below_the_windings_is_refused_with_the_lift() {
    let path = root().join("shapes/wedge.stl");
    let said = message(&file(&path, 0.001, lifted(-0.0125), seed_grid()));
    // Heights x / 2 + 12.5 mm: below zero for x < -25 mm, 15 of 61 columns.
    assert!(said.starts_with("915 of 3721 points"), "{said}");
    assert!(said.contains("lowest -12.500000 mm") && said.contains("at least 12.500000 mm"));
    let low = exactly(
        Primitive::Flat {
            side_m: 0.1,
            height_m: -0.003,
        },
        Placement::default(),
        seed_grid(),
    );
    assert!(message(&low).contains("3721 of 3721"));
    // Resting on z = 0 is allowed.
    assert_eq!(
        from_stl("wedge", lifted(0.0), seed_grid())
            .points
            .facts()
            .min_height_m,
        0.0
    );
}

#[test]
fn files_that_cannot_be_read_are_named() {
    let open = |path: &Path, unit_m| {
        let mut document = file(path, 0.001, lifted(0.03), seed_grid());
        document.source = SurfaceSource::File {
            path: path.into(),
            unit_m,
        };
        message(&document)
    };
    let folder = tempfile::tempdir().unwrap();
    let stl_folder = folder.path().join("part.stl");
    std::fs::DirBuilder::new().create(&stl_folder).unwrap();
    assert!(open(&stl_folder, Some(0.001)).contains("part.stl: this is a folder"));
    let missing = open(&folder.path().join("lost.STL"), Some(0.001));
    assert!(missing.contains("lost.STL: no such file"), "{missing}");
    let unit = open(&root().join("shapes/flat.stl"), None);
    assert!(
        unit.contains("STL files carry no unit") && unit.contains("--unit mm"),
        "{unit}"
    );
    for name in ["a.step", "a.SLDPRT", "a.3mf", "a.obj"] {
        let said = open(Path::new(name), Some(0.001));
        assert!(said.contains("no such file"), "{said}");
    }
    assert!(open(Path::new("a.ply"), None).contains("PLY files carry no unit"));
    assert!(open(Path::new("surface.txt"), Some(0.001)).contains("not a surface that is read"));
    assert!(open(Path::new("surface"), Some(0.001)).contains("no such file"));
    assert!(open(Path::new("/dev/null.stl"), Some(0.001)).contains("no such file"));
}

#[test]
fn grids_that_do_not_ascend_are_refused() {
    let given = |from, to, samples| AxisRequest::Given(Axis { from, to, samples });
    let path = root().join("shapes/wedge.stl");
    let y = AxisRequest::Extent(5);
    for (x, part) in [
        (given(0.05, -0.05, 61), "smaller one"),
        (given(0.02, 0.02, 2), "smaller one"),
        (given(0.02, f64::NAN, 2), "finite"),
        (given(-0.05, 0.05, 0), "no sample"),
        (given(-0.05, 0.05, 1 << 40), "at most"),
        (given(-0.05, 0.05, 1), "both ends"),
        // It was put at the border, as if the surface were a line there.
        (AxisRequest::Extent(1), "both ends"),
    ] {
        let said = message(&file(&path, 0.001, lifted(0.03), GridRequest { x, y }));
        assert!(said.contains(part), "{said}");
    }
    let line = GridRequest {
        x: given(0.02, 0.02, 1),
        y,
    };
    assert_eq!(
        from_stl("wedge", lifted(0.03), line).points.height_m.len(),
        5
    );
}

#[test]
fn an_interruption_ends_it() {
    struct Stop;
    impl Progress for Stop {
        fn interrupted(&self) -> bool {
            true
        }
    }
    let path = root().join("shapes/half_sphere.stl");
    let result = discretize(&file(&path, 0.001, lifted(0.03), seed_grid()), &Stop);
    assert!(matches!(result, Err(ShapeError::Interrupted(_))));
}

#[test]
fn the_committed_documents_are_toml_of_the_four_shapes() {
    for name in NAMES {
        let read = |path: String| -> toml::Table {
            std::fs::read_to_string(root().join("shapes").join(path))
                .unwrap()
                .parse()
                .unwrap()
        };
        let (surface, exact) = (
            read(format!("{name}.toml")),
            read(format!("primitives/{name}.toml")),
        );
        let dashed = name.replace('_', "-");
        assert_eq!(surface["name"].as_str(), Some(dashed.as_str()));
        assert_eq!(surface["unit"].as_str(), Some("mm"));
        let lift = surface["translate_mm"][2].as_float().unwrap();
        assert_eq!(lift / 1000.0, body(name).0);
        assert!(
            root()
                .join("shapes")
                .join(surface["surface"].as_str().unwrap())
                .is_file()
        );
        assert_eq!(exact["primitive"].as_str(), Some(dashed.as_str()));
        assert_ne!(exact["name"], surface["name"]);
        assert_eq!(exact["points"], surface["points"]);
    }
}

/// Keys of files were passed over without a word, and every chord was taken for metres.
#[test]
fn keys_of_files_are_refused_beside_a_primitive_and_a_chord_is_no_metre() {
    let read = |keys: &str| {
        let text = format!("name = \"a\"\n{keys}\n");
        ShapeDocument::from_toml(&text, Path::new("a.toml"))
    };
    for key in [
        "chord_mm = 0.3",
        "body = \"lid\"",
        "stretch = true",
        "scale = 1.3",
    ] {
        let invalid = read(&format!("primitive = \"flat\"\n{key}")).unwrap_err();
        let name = key.split(' ').next().unwrap();
        let faults = format!("{:?}", invalid.faults);
        assert!(
            faults.contains("a primitive has") && faults.contains(name),
            "{faults}"
        );
    }
    let (document, warnings) = read("surface = \"a.step\"\nchord_mm = 0.01").unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(document.bodies.chord_m, Some(1e-5));
    assert!(read("surface = \"a.step\"\nchord_mm = 0.0").is_err());
}
