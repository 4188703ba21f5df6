//! The nearest triangle by the tree, against a search through all of them.

use fluxform_numerics::nearest_triangle::Tree;
use fluxform_numerics::random::Random;
use fluxform_numerics::vec3::{dot, minus};

#[test]
fn the_tree_finds_what_a_search_through_all_finds() {
    let mut random = Random::new(7);
    let mut next = || random.unit();
    let triangles: Vec<[[f64; 3]; 3]> = (0..300)
        .map(|_| {
            let at = [next(), next(), next()];
            [0; 3].map(|_| at.map(|c| c + 0.2 * next()))
        })
        .collect();
    let tree = Tree::new(&triangles);
    for _ in 0..200 {
        let p = [next(), next(), next()].map(|c| 1.6 * c - 0.3);
        // Each triangle sampled finely: never nearer than the distance, hardly farther.
        let mut nearest = f64::INFINITY;
        for t in &triangles {
            for i in 0..=40 {
                for j in 0..=40 - i {
                    let (s, r) = (f64::from(i) / 40.0, f64::from(j) / 40.0);
                    let q = [0, 1, 2]
                        .map(|k| t[0][k] + s * (t[1][k] - t[0][k]) + r * (t[2][k] - t[0][k]));
                    nearest = nearest.min(dot(minus(p, q), minus(p, q)).sqrt());
                }
            }
        }
        let found = tree.nearest(p).0;
        assert!(
            found <= nearest + 1e-15 && found > nearest - 0.01,
            "{found} {nearest}"
        );
    }
}
