//! The files for ParaView in a bundle: what they hold are the bundle's own numbers.

use std::collections::BTreeMap;
use std::process::Command;

use fluxform::bundle::load::Bundle;
use fluxform::design::{Design, Need};
use fluxform::map::tabulate::Grid;
use fluxform::progress::Silent;
use fluxform::scene::working_point::WorkingPoint;
use fluxform::scene::{Scene, steel};
use fluxform_testing::inputs::{AIR, BUMP, TWO};
use fluxform_testing::needs::{self, Trial};
use fluxform_testing::place::Place;
use fluxform_testing::{root, trials};
use quick_xml::events::Event;

pub fn trials() -> Vec<Trial> {
    trials! {
        None => [
            forces_and_field_for_paraview_are_the_bundles_own,
            a_plate_is_drawn_below_its_coil,
            the_field_of_a_saturated_core_has_the_gradient_of_its_map,
        ],
        needs::vtk() => [the_library_of_paraview_reads_every_file],
    }
}

/// Attributes of the elements of a file, and its arrays by name as doubles.
struct VtkFile {
    attributes: BTreeMap<String, String>,
    arrays: BTreeMap<String, Vec<f64>>,
}

impl VtkFile {
    fn read(bytes: &[u8]) -> Self {
        let marker = b"<AppendedData encoding=\"raw\">\n_";
        let end = "\n</AppendedData>\n</VTKFile>\n";
        let cut = bytes.windows(marker.len()).position(|w| w == marker);
        let start = cut.expect("appended data") + marker.len();
        let head = std::str::from_utf8(&bytes[..start]).unwrap().to_owned() + end;
        let raw = bytes[start..].strip_suffix(end.as_bytes()).unwrap();
        let (mut attributes, mut arrays) = (BTreeMap::new(), BTreeMap::new());
        let mut reader = quick_xml::Reader::from_str(&head);
        let mut used = 0;
        loop {
            let element = match reader.read_event().expect("well-formed XML") {
                Event::Start(element) | Event::Empty(element) => element,
                Event::Eof => break,
                _ => continue,
            };
            let own: BTreeMap<String, String> = element
                .attributes()
                .map(|attribute| {
                    let attribute = attribute.unwrap();
                    (
                        attribute.key.as_ref().to_owned(),
                        attribute.value.into_owned(),
                    )
                })
                .collect();
            if let Some(offset) = own.get("offset") {
                assert_eq!(offset.parse::<usize>().unwrap(), used);
                let (size, rest) = raw[used..].split_at(8);
                let size = u64::from_le_bytes(size.try_into().unwrap()) as usize;
                let numbers = rest[..size].chunks_exact(8).map(|b| b.try_into().unwrap());
                let values = match own["type"].as_str() {
                    "Float64" => numbers.map(f64::from_le_bytes).collect(),
                    "Int64" => numbers.map(|b| i64::from_le_bytes(b) as f64).collect(),
                    other => panic!("{other}"),
                };
                arrays.insert(own["Name"].clone(), values);
                used += 8 + size;
            } else {
                attributes.extend(own);
            }
        }
        assert_eq!(used, raw.len());
        Self { attributes, arrays }
    }

    fn vectors(&self, name: &str) -> Vec<[f64; 3]> {
        self.arrays[name].as_chunks().0.to_vec()
    }

    fn count(&self, name: &str) -> usize {
        self.attributes[name].parse().unwrap()
    }
}

fn calibrated(design: &str) -> Place {
    let place = Place::empty();
    place.write("design.toml", design);
    place.write("bump.toml", BUMP);
    let run = [
        "calibrate",
        "design.toml",
        "bump.toml",
        "--vtk",
        "--out",
        "out",
    ];
    place.run(&run).ends(0);
    place
}

fn forces_and_field_for_paraview_are_the_bundles_own() {
    let place = calibrated(AIR);
    let bundle = Bundle::open(&place.path("out/air/bump")).unwrap();
    let file = |name: &str| VtkFile::read(&place.read(&format!("out/air/bump/vtk/{name}")));
    let lambda = bundle.lambda.lambda_n_per_m.unwrap();

    let object = file("object.vtp");
    assert_eq!(object.count("NumberOfPoints"), bundle.points.len());
    // Of 8 x 8 cells under the half-sphere those with four corners on it.
    let (polygons, corners) = (
        object.count("NumberOfPolys"),
        &object.arrays["connectivity"],
    );
    assert!(
        polygons > 20 && polygons < 64 && corners.len() == 4 * polygons,
        "{polygons}"
    );
    let places = object.vectors("position_m");
    for cell in corners.chunks_exact(4) {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| places[cell[k] as usize]);
        assert!(a[0] < b[0] && a[1] == b[1] && b[0] == c[0] && b[1] < c[1] && d[0] == a[0]);
    }
    let forces = ["requested_n", "static_n", "feedback_n"].map(|name| object.vectors(name));
    let mut per_ampere = vec![0.0; 4];
    for (k, row) in bundle.points.iter().enumerate() {
        let at = [row.x_m, row.y_m, row.height_m];
        assert_eq!(places[k], at);
        let [requested, fixed, feedback] = [0, 1, 2].map(|which| forces[which][k]);
        assert_eq!(requested, [0.0, 0.0, lambda * row.height_m]);
        assert!(bundle.force_per_ampere(at, &mut per_ampere));
        let rows = bundle.currents.iter().zip(&per_ampere);
        let given: f64 = rows.map(|(row, force)| row.current_a * force).sum();
        // The map is interpolated, the file's forces are computed at the points.
        assert!((fixed[2] / given - 1.0).abs() < 1e-3, "{fixed:?} {given}");
        let off = |force: [f64; 3]| (force[2] - requested[2]).abs();
        assert!(
            off(feedback) <= off(fixed) + 1e-12,
            "{feedback:?} {fixed:?}"
        );
    }
    // By symmetry none in the middle.
    let sideways = |[x, y, _]: &[f64; 3]| x.hypot(*y) > 0.0;
    assert!(forces[2].iter().any(sideways));

    let coils = file("coils.vtp");
    let (number, current) = (&coils.arrays["coil"], &coils.arrays["current_a"]);
    for (number, current) in number.iter().zip(current) {
        assert_eq!(*current, bundle.currents[*number as usize].current_a);
    }
    assert_eq!((number[0], number[number.len() - 1]), (0.0, 3.0));

    // The field at some nodes, by another command.
    let field = file("field.vti");
    assert_eq!(field.attributes["WholeExtent"], "0 20 0 20 0 20");
    let nodes = [[3, 7, 0], [17, 2, 11], [20, 20, 20]];
    let at = |node: [usize; 3]| -> [f64; 3] {
        let ends_mm = [[-40.0, 40.0], [-30.0, 30.0], [30.0, 70.0]];
        std::array::from_fn(|axis| {
            let [from, to] = ends_mm[axis];
            1e-3 * (from + (to - from) * node[axis] as f64 / 20.0)
        })
    };
    let rows = nodes
        .map(|node| at(node).map(|x| x.to_string()).join(","))
        .join("\n");
    place.write("places.csv", &format!("x_m,y_m,z_m\n{rows}\n"));
    let probed = place.run(&["probe", "design.toml", "places.csv", "--components", "all"]);
    let probed: Vec<Vec<f64>> = (probed.ends(0).out.lines().skip(1))
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    let all = field.vectors("field_t");
    for ([i, j, k], rows) in nodes.into_iter().zip(probed.chunks_exact(4)) {
        let given = all[(k * 21 + j) * 21 + i];
        for (axis, given) in given.into_iter().enumerate() {
            let rows = rows.iter().zip(&bundle.currents);
            let sum: f64 = rows.map(|(row, coil)| row[4 + axis] * coil.current_a).sum();
            assert!(
                (given - sum).abs() < 1e-8 * sum.abs().max(1e-4),
                "{given:e} {sum:e}"
            );
        }
    }
    place.run(&["verify", "out/air/bump"]).ends(0);
}

fn a_plate_is_drawn_below_its_coil() {
    let one = TWO.replace("columns = 2", "columns = 1");
    let plate =
        "[plate]\nthickness_mm = 3.0\nx_mm = 90.0\ny_mm = 60.0\nrelative_permeability = 700.0\n";
    let place = calibrated(&format!("{one}{plate}"));
    let coils = VtkFile::read(&place.read("out/two/bump/vtk/coils.vtp"));
    let places = coils.vectors("position_m");
    let (mut area_m2, mut seen) = (0.0, 0);
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let mut start = 0;
    for (cell, end) in coils.arrays["offsets"].iter().enumerate() {
        let corners = &coils.arrays["connectivity"][start..*end as usize];
        start = *end as usize;
        if coils.arrays["part"][cell] != 2.0 {
            continue;
        }
        assert_eq!(
            (coils.arrays["coil"][cell], coils.arrays["current_a"][cell]),
            (-1.0, 0.0)
        );
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| places[corners[k] as usize]);
        let [p, q]: [[f64; 3]; 2] =
            [[a, c], [b, d]].map(|[from, to]| std::array::from_fn(|k| to[k] - from[k]));
        let normal: [f64; 3] = std::array::from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            p[i] * q[j] - p[j] * q[i]
        });
        area_m2 += 0.5 * normal.iter().map(|part| part * part).sum::<f64>().sqrt();
        for corner in [a, b, c, d] {
            for axis in 0..3 {
                low[axis] = low[axis].min(corner[axis]);
                high[axis] = high[axis].max(corner[axis]);
            }
        }
        seen += 1;
    }
    assert!(seen > 100, "{seen}");
    let expected = 2.0 * (0.09 * 0.06 + 0.003 * (0.09 + 0.06));
    assert!((area_m2 / expected - 1.0).abs() < 1e-9, "{area_m2:e}");
    let ends = [[-0.045, 0.045], [-0.03, 0.03], [-0.11, -0.107]];
    for (axis, [from, to]) in ends.into_iter().enumerate() {
        assert!(
            (low[axis] - from).abs() < 1e-9 && (high[axis] - to).abs() < 1e-9,
            "{low:?} {high:?}"
        );
    }
}

fn the_field_of_a_saturated_core_has_the_gradient_of_its_map() {
    let curve = format!("bh_curve = {:?}", root().join("designs/steel_1010.csv"));
    let text = TWO.replace("relative_permeability = 1300.0", &curve);
    let path = root().join("designs/two.toml");
    let (design, _) = Design::from_toml(&text, &path, Need::CALIBRATE).unwrap();
    let scene = Scene::new(&design).unwrap();
    let solved = steel::solve(&scene, scene.tolerances.map, 0.03).unwrap();
    let point = WorkingPoint::new(&scene, &solved, &[1.3, 0.4], 0.03).unwrap();
    let point = point.expect("a B-H curve");
    let step_m = 2e-4;
    let grid = Grid {
        x_m: vec![-0.013, 0.007],
        y_m: vec![0.004],
        z_m: [-1.0, 0.0, 1.0].map(|k| 0.037 + k * step_m).to_vec(),
    };
    let field_t = point.field_t(&scene, &grid, &Silent).unwrap();
    let gz = point.gz_t_per_m(&scene, &grid, &Silent).unwrap();
    for x in 0..2 {
        let up = |layer: usize| field_t[3 * (2 * layer + x) + 2];
        let difference = (up(2) - up(0)) / (2.0 * step_m);
        assert!(
            (difference / gz[2 + x] - 1.0).abs() < 1e-3,
            "{difference} {}",
            gz[2 + x]
        );
    }
}

const READ: &str = "\
import sys, vtk
for name in sys.argv[1:]:
    image = name.endswith('vti')
    reader = vtk.vtkXMLImageDataReader() if image else vtk.vtkXMLPolyDataReader()
    reader.SetFileName(name)
    reader.Update()
    data = reader.GetOutput()
    parts = [data.GetPointData(), data.GetCellData()]
    arrays = [p.GetArray(i) for p in parts for i in range(p.GetNumberOfArrays())]
    ranges = [f'{a.GetName()} {a.GetNumberOfTuples()} {a.GetRange(-1)[1]!r}' for a in arrays]
    print(data.GetNumberOfPoints(), data.GetNumberOfCells(), *ranges, sep=';')
";

fn the_library_of_paraview_reads_every_file() {
    let place = calibrated(TWO);
    let folder = place.path("out/two/bump/vtk");
    let names = ["object.vtp", "coils.vtp", "field.vti"];
    let mut python = Command::new("python3");
    python.args(["-c", READ]).args(names).current_dir(&folder);
    let output = python.output().unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(text.lines().count(), names.len(), "{text}");
    for (name, line) in names.iter().zip(text.lines()) {
        let own = VtkFile::read(&place.read(&format!("out/two/bump/vtk/{name}")));
        let mut arrays = 0;
        for word in line.split(';').skip(2) {
            let parts: Vec<&str> = word.split(' ').collect();
            let (tuples, largest): (usize, f64) =
                (parts[1].parse().unwrap(), parts[2].parse().unwrap());
            let values = &own.arrays[parts[0]];
            let sizes = values.chunks_exact(values.len() / tuples);
            let expected = sizes.map(|tuple| match tuple {
                [one] => *one,
                more => more.iter().map(|x| x * x).sum::<f64>().sqrt(),
            });
            let expected = expected.fold(f64::NEG_INFINITY, f64::max);
            assert!(
                (largest - expected).abs() <= 1e-12 * expected.abs(),
                "{name}: {word}"
            );
            arrays += 1;
        }
        assert!(arrays > 0, "{line}");
    }
}
