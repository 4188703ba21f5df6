//! Heights of real files against a search through all triangles.

use fluxform_shape::document::Placement;
use fluxform_shape::mesh::Mesh;
use fluxform_shape::placement::Transform;
use fluxform_shape::stl;
use fluxform_testing::needs::{self, Trial, corpus_folder};
use fluxform_testing::surfaces::{grid, plane_height, sample};
use fluxform_testing::trials;

pub fn trials() -> Vec<Trial> {
    trials! { needs::corpus() => [real_files_match_a_search_through_all_triangles] }
}

fn real_files_match_a_search_through_all_triangles() {
    let folder = corpus_folder();
    for name in [
        "trimesh__angle_block.STL",
        "trimesh__unit_sphere.STL",
        "trimesh__20mm-xyz-cube.stl",
        "swurdf__base_link.STL",
        "sxt__Part1.STL",
    ] {
        let file = stl::read(&std::fs::read(folder.join(name)).unwrap()).unwrap();
        let placement = Placement {
            translate_m: [0.013, -0.007, 0.3],
            rotate_deg: [20.0, -35.0, 55.0],
            ..Placement::default()
        };
        let mesh = Mesh::place(file, &Transform::new(0.0254, &placement)).unwrap();
        let [x, y] = mesh.facts().bounds.plan();
        let plan = grid((x[0], x[1], 41), (y[0], y[1], 41));
        let mut hits = 0;
        for (k, found) in sample(&mesh, &plan).iter().enumerate() {
            let p = [plan.x_m.node(k % 41), plan.y_m.node(k / 41)];
            let expected = mesh
                .triangles()
                .iter()
                .filter_map(|t| plane_height(t, p))
                .fold(None, |m: Option<f64>, h| Some(m.map_or(h, |m| m.max(h))));
            if let Some(expected) = expected {
                let height = found.unwrap().height_m;
                assert!(
                    (height - expected).abs() < 1e-9,
                    "{name} {p:?}: {height} {expected}"
                );
                hits += 1;
            }
        }
        assert!(hits > 400, "{name}: {hits}");
    }
}
