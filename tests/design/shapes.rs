//! Shape files, and surfaces named on the command line.

use std::path::{Path, PathBuf};

use fluxform_numerics::axis::Axis;
use fluxform_shape::bodies::BodyOptions;
use fluxform_shape::document::{
    AxisRequest, Placement, Primitive, RawSurface, RawSurfaceError, ShapeDocument, SurfaceSource,
    parse_unit,
};

fn read(text: &str) -> (ShapeDocument, String) {
    match ShapeDocument::from_toml(text, Path::new("shapes/s.toml")) {
        Ok((shape, warnings)) => (shape, warnings.plain()),
        Err(invalid) => panic!("{invalid}"),
    }
}

fn refused(text: &str) -> Vec<String> {
    let invalid = ShapeDocument::from_toml(text, Path::new("s.toml")).unwrap_err();
    invalid.to_string().lines().map(str::to_owned).collect()
}

const SURFACE: &str = "name = \"half\"\nsurface = \"half.stl\"\nunit = \"mm\"\n";

#[test]
fn a_surface_is_read_with_its_unit_and_placement() {
    let text = format!(
        "{SURFACE}translate_mm = [0, -0.7, 30]\nrotate_deg = [0, 7.3, -90]\n[points]\nx_mm = [-13, 17, 4]\noutside = \"skip\"\n"
    );
    let (shape, warnings) = read(&text);
    assert_eq!((shape.name.as_str(), warnings.as_str()), ("half", ""));
    let file = SurfaceSource::File {
        path: PathBuf::from("shapes/half.stl"),
        unit_m: Some(0.001),
    };
    assert_eq!(shape.source, file);
    assert_eq!(
        shape.placement,
        Placement {
            translate_m: [0.0, -0.0007, 0.03],
            rotate_deg: [0.0, 7.3, -90.0],
            ..Placement::default()
        }
    );
    assert_eq!(
        shape.grid.x,
        AxisRequest::Given(Axis {
            from: -0.013,
            to: 0.017,
            samples: 4
        })
    );
    assert_eq!(
        shape.grid.y,
        AxisRequest::Given(Axis {
            from: -0.05,
            to: 0.05,
            samples: 61
        })
    );
    let (shape, _) = read(&SURFACE.replace("\"mm\"", "\"inch\""));
    assert_eq!(shape.placement, Placement::default());
    assert!(matches!(
        shape.source,
        SurfaceSource::File {
            unit_m: Some(0.0254),
            ..
        }
    ));
}

#[test]
fn primitives_have_the_seed_s_sizes() {
    let of = |keys: &str| match read(&format!("name = \"p\"\nprimitive = {keys}\n"))
        .0
        .source
    {
        SurfaceSource::Primitive(primitive) => primitive,
        file => panic!("{file:?}"),
    };
    assert_eq!(
        of("\"flat\""),
        Primitive::Flat {
            side_m: 0.1,
            height_m: 0.05
        }
    );
    assert_eq!(
        of("\"half-sphere\""),
        Primitive::HalfSphere {
            radius_m: 0.05,
            base_m: 0.03
        }
    );
    let cylinder = Primitive::HalfCylinder {
        radius_m: 0.05,
        length_m: 0.1,
        base_m: 0.03,
    };
    assert_eq!(of("\"half-cylinder\""), cylinder);
    assert_eq!(
        of("\"wedge\""),
        Primitive::Wedge {
            side_m: 0.1,
            low_m: 0.03,
            high_m: 0.08
        }
    );
    let steep = Primitive::Wedge {
        side_m: 0.1,
        low_m: 0.013,
        high_m: 0.07,
    };
    assert_eq!(of("\"wedge\"\nlow_mm = 13\nhigh_mm = 70"), steep);
}

#[test]
fn a_shape_is_a_surface_or_a_primitive() {
    let cases = [
        (
            "name = \"a\"\n",
            "s.toml:1:1: error: surface: this key is required and missing (write surface = \"part.stl\" with its unit, or primitive = \"flat\")",
        ),
        (
            "name = \"a\"\nsurface = \"a.stl\"\nunit = \"mm\"\nprimitive = \"flat\"\n",
            "s.toml:4:13: error: primitive: surface and primitive exclude each other (write surface = \"part.stl\" with its unit, or primitive = \"flat\")",
        ),
        (
            "name = \"a\"\nsurface = \"a.stl\"\n",
            "s.toml:1:1: error: unit: this key is required and missing (add unit = \"mm\" or what it was drawn in (mm, cm, m, in, ft, um))",
        ),
        (
            "name = \"a\"\nsurface = \"a.stl\"\nunit = \"thou\"\n",
            "s.toml:3:8: error: unit: expected mm, cm, m, in, ft, um, found \"thou\" (name the unit of the file's coordinates)",
        ),
        (
            "name = \"a\"\nsurface = \"a.dae\"\nunit = \"mm\"\n",
            "s.toml:2:11: error: surface: expected a file ending in .stl, .obj, .ply, .off, .glb, .png, .3mf, .amf, .3dxml, .step, .stp, .sldprt, .sldasm, found \"a.dae\" (such files are not read: export the body as STL, OBJ, PLY or 3MF (Blender does))",
        ),
        (
            "name = \"a\"\nprimitive = \"flat\"\nunit = \"mm\"\n",
            "s.toml:3:8: error: unit: a primitive has no unit: its sizes are in mm (leave the key out)",
        ),
        (
            "name = \"a\"\nprimitive = \"half-spere\"\n",
            "s.toml:2:13: error: primitive: expected \"flat\" or \"half-sphere\" or \"half-cylinder\" or \"wedge\", found \"half-spere\" (did you mean \"half-sphere\"?)",
        ),
        (
            "name = \"a\"\nprimitive = \"flat\"\nside_mm = -7\n",
            "s.toml:3:11: error: side_mm: expected a number greater than 0, found -7 mm",
        ),
        (
            "name = \"a\"\nprimitive = \"flat\"\n[points]\noutside = \"keep\"\n",
            "s.toml:4:11: error: points.outside: expected \"skip\", found \"keep\" (choose one of them)",
        ),
        (
            "name = \"a\"\nprimitive = \"flat\"\n[points]\nx_mm = [-50, 50, 100000]\ny_mm = [-50, 50, 100000]\n",
            "s.toml:4:8: error: points.x_mm: 100000 x 100000 points are more than 100000000 (ask for fewer samples)",
        ),
        (
            "name = \"a\"\nprimitive = \"flat\"\n[points]\nx_mm = [-50, 50, 11]\ny_mm = [-50, 50, 1e9]\n",
            "s.toml:5:8: error: points.y_mm: 11 x 1000000000 points are more than 100000000 (ask for fewer samples)",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(refused(text), [expected], "of\n{text}");
    }
    let said = refused("name = \"a\"\nprimitive = \"flat\"\nradius_mm = 7\n");
    assert!(
        said[0].starts_with(
            "s.toml:3:1: error: radius_mm: unknown key \"radius_mm\" in the top level"
        ),
        "{said:?}"
    );
}

#[test]
fn a_unit_beside_a_format_that_carries_its_own_is_kept_to_be_compared() {
    let (shape, said) = read(&SURFACE.replace("half.stl", "half.3MF"));
    let stated = |unit: Option<f64>| unit == Some(1e-3);
    assert!(matches!(
        shape.source,
        SurfaceSource::File { unit_m, .. } if stated(unit_m)
    ));
    assert_eq!(said, "");
}

#[test]
fn metres_in_a_shape_are_a_warning() {
    let (_, said) = read(&format!("{SURFACE}translate_mm = [0, 0, 0.03]\n"));
    assert!(
        said.contains("translate_mm: 0.03 mm looks like metres (write 30 if"),
        "{said}"
    );
}

/// Both set the height; `rest_on_mm` won without a word.
#[test]
fn a_box_and_a_height_to_rest_on_are_refused_together() {
    let box_mm = "fit_mm = [-50, 50, -50, 50, 20, 70]";
    read(&format!("{SURFACE}{box_mm}\n"));
    let said = refused(&format!("{SURFACE}{box_mm}\nrest_on_mm = 30\n"));
    assert!(
        said.len() == 1 && said[0].contains("rest_on_mm"),
        "{said:?}"
    );
}

/// The angle changed nothing of a vertical force, without a word.
#[test]
fn an_angle_that_is_noticed_needs_a_force_whose_sides_are_requested() {
    let shape = |force: &str| format!("{SURFACE}force = \"{force}\"\ndirection_jnd_deg = 7.3\n");
    for force in ["vertical-only", "normal"] {
        let (document, _) = read(&shape(force));
        assert_eq!(document.direction_jnd_deg, 7.3);
    }
    for text in [
        shape("vertical"),
        format!("{SURFACE}direction_jnd_deg = 7.3\n"),
    ] {
        let said = refused(&text);
        let named = said[0].contains("direction_jnd_deg");
        assert!(said.len() == 1 && named, "{said:?}");
    }
}

#[test]
fn several_faults_are_reported_at_once() {
    let said = refused(
        "name = \"a b\"\nsurface = \"a.stl\"\ncolour = 7\ntranslate_mm = [0, 0]\n[points]\nx_mm = [5, -5, 3]\n",
    );
    assert_eq!(said.len(), 5, "{said:#?}");
}

fn raw(path: &str, unit: Option<&str>) -> RawSurface {
    RawSurface {
        bodies: BodyOptions::default(),
        path: PathBuf::from(path),
        unit_m: unit.and_then(parse_unit),
        scale: [1.0; 3],
        placement: Placement {
            translate_m: [0.0, 0.0, 0.03],
            rotate_deg: [0.0; 3],
            ..Placement::default()
        },
        samples_are_given: true,
        samples: [61, 7],
        x_m: None,
        y_m: Some([-0.013, 0.07]),
    }
}

#[test]
fn a_raw_surface_takes_its_flags() {
    let shape = ShapeDocument::raw(&raw("parts/my part.v2.stl", Some("cm"))).unwrap();
    assert_eq!(shape.name, "my part.v2");
    let file = SurfaceSource::File {
        path: PathBuf::from("parts/my part.v2.stl"),
        unit_m: Some(0.01),
    };
    assert_eq!(shape.source, file);
    assert_eq!(shape.grid.x, AxisRequest::Extent(61));
    assert_eq!(
        shape.grid.y,
        AxisRequest::Given(Axis {
            from: -0.013,
            to: 0.07,
            samples: 7
        })
    );
    assert_eq!(shape.placement.translate_m[2], 0.03);
    // A 3MF says itself what its unit is; the reader compares.
    for unit in [None, Some("cm")] {
        let shape = ShapeDocument::raw(&raw("a.3mf", unit)).unwrap();
        let stated = unit.and_then(parse_unit);
        assert!(matches!(
            shape.source,
            SurfaceSource::File { unit_m, .. } if unit_m == stated
        ));
    }
}

#[test]
fn a_raw_surface_names_what_it_lacks() {
    let refusal = |surface: &RawSurface| ShapeDocument::raw(surface).unwrap_err();
    let error = refusal(&raw("a.stl", None));
    assert!(matches!(error, RawSurfaceError::UnitNeeded { .. }));
    assert_eq!(
        error.to_string(),
        "a.stl: this format carries no unit of length: add --unit (mm, cm, m, in, ft, um)"
    );
    let error = refusal(&raw("a.txt", Some("mm")));
    assert_eq!(
        error.to_string(),
        "a.txt: not a surface that is read: expected a shape file (.toml) or .stl, .obj, .ply, .off, .glb, .png, .3mf, .amf, .3dxml, .step, .stp, .sldprt, .sldasm"
    );
    let mut surface = raw("a.stl", Some("mm"));
    surface.y_m = Some([0.7, -0.7]);
    assert_eq!(
        refusal(&surface).to_string(),
        "a.stl: --y with --grid: the axis runs backwards, from 0.7 to -0.7 m (write the lower end first)"
    );
    surface.y_m = None;
    surface.samples = [0, 7];
    assert!(
        refusal(&surface)
            .to_string()
            .contains("--x with --grid: expected at least 1 sample, found 0")
    );
    surface.samples = [usize::MAX, 7];
    assert!(matches!(
        refusal(&surface),
        RawSurfaceError::TooManyPoints { .. }
    ));
    surface.samples = [1, 1];
    assert!(ShapeDocument::raw(&surface).is_ok());
    surface.placement.rotate_deg[1] = f64::NAN;
    assert!(matches!(
        refusal(&surface),
        RawSurfaceError::NotFinite { .. }
    ));
}
