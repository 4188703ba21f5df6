//! Means over a magnet's places: by series about the axis as by sums at each place.

use fluxform_base::progress::Silent;
use fluxform_field::magnet::{Cylinder, MagnetRule, Sources};
use fluxform_field::winding::Winding;
use fluxform_map::mean::MeanField;
use fluxform_map::{Components, Grid, PlacedCoil, tabulate};

#[test]
fn a_map_of_means_is_the_weighted_sum_of_shifted_maps() {
    let winding = Winding {
        inner_radius_m: 0.012,
        outer_radius_m: 0.019,
        length_m: 0.05,
        turns: 700.0,
    };
    let size = Cylinder {
        diameter_m: 0.01,
        length_m: 0.01,
    };
    let nodes = |from: f64, to: f64, n: usize| -> Vec<f64> {
        let step = (to - from) / (n - 1) as f64;
        (0..n).map(|i| from + step * i as f64).collect()
    };
    let grid = Grid {
        x_m: nodes(-0.02, 0.03, 23),
        y_m: nodes(-0.03, 0.02, 21),
        z_m: vec![0.011, 0.023],
    };
    let coil = |number, axis_m, gain| PlacedCoil {
        number,
        axis_m,
        gain,
    };
    let coils = [coil(0, [0.0, 0.0], 1.0), coil(1, [0.05, -0.003], 0.7)];
    let (all, tolerance) = (Components::Gradient, 1e-8);
    for moment in [[0.0, 0.0, -0.7], [0.13, -0.07, -0.7]] {
        let height_m = grid.z_m[0];
        let rule = MagnetRule::cylinder(size, moment, Sources::Below { height_m }, 1e-4)
            .expect("above the coil");
        let square: f64 = moment.iter().map(|m| m * m).sum();
        let shares: Vec<([f64; 3], f64)> = rule
            .nodes()
            .iter()
            .map(|node| {
                let part: f64 = (0..3).map(|i| node.moment_a_m2[i] * moment[i]).sum();
                (node.offset_m, part / square)
            })
            .collect();
        assert!(shares.len() > 50);
        let means =
            MeanField::new(&winding, &coils, &grid, all, tolerance, 1e-10).expect("many places");
        let map = means
            .map(&shares, &coils, &grid, all, &Silent)
            .expect("off the edges")
            .expect("few modes");
        let mut sum = vec![0.0; map.gz_t_per_m_per_a.len() * 9];
        for (offset, share) in &shares {
            let moved = |nodes: &[f64], by: f64| nodes.iter().map(|x| x + by).collect();
            let places = Grid {
                x_m: moved(&grid.x_m, offset[0]),
                y_m: moved(&grid.y_m, offset[1]),
                z_m: moved(&grid.z_m, offset[2]),
            };
            let one = tabulate(&winding, &coils, &places, all, 1e-10, &Silent).expect("off");
            let one = one.gradient_t_per_m_per_a.expect("the gradient");
            for (sum, value) in sum.iter_mut().zip(one) {
                *sum += share * value;
            }
        }
        let got = map.gradient_t_per_m_per_a.expect("the gradient");
        let plane = 9 * grid.x_m.len() * grid.y_m.len();
        for (got, sum) in got.chunks_exact(plane).zip(sum.chunks_exact(plane)) {
            let size = sum.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            let off = got.iter().zip(sum).map(|(a, b)| (a - b).abs());
            let off = off.fold(0.0_f64, f64::max) / size;
            assert!(off < tolerance, "{moment:?}: {off:e}");
        }
        for (gz, gradient) in map.gz_t_per_m_per_a.iter().zip(got.chunks_exact(9)) {
            assert_eq!(*gz, gradient[8]);
        }
    }
}
