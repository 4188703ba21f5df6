//! Cubic interpolation: exact on cubics and at nodes, of fourth order.

use fluxform_numerics::lagrange::{Stencil, beside, locate, stencil};

fn cubic(x: f64) -> f64 {
    0.7 - 1.3 * x + 2.1 * x * x - 0.9 * x * x * x
}

#[test]
fn cubics_are_exact_on_uneven_nodes_and_nodes_exactly() {
    let nodes = [-0.31, -0.1, 0.07, 0.33, 0.5, 0.92];
    for step in 0..=100 {
        let x = -0.31 + 1.23 * f64::from(step) / 100.0;
        let s = stencil(&nodes, x.min(0.92)).unwrap();
        let value: f64 = (0..s.count)
            .map(|k| s.weights[k] * cubic(nodes[s.start + k]))
            .sum();
        assert!((value - cubic(x.min(0.92))).abs() < 4e-15, "{x}: {value}");
    }
    for (i, &node) in nodes.iter().enumerate() {
        let s = stencil(&nodes, node).unwrap();
        for k in 0..s.count {
            let want = if s.start + k == i { 1.0 } else { 0.0 };
            assert_eq!(s.weights[k], want);
        }
    }
}

#[test]
fn the_stencil_is_the_nearest_four_and_stays_inside() {
    let nodes: Vec<f64> = (0..7).map(|i| 0.3 * f64::from(i)).collect();
    for (x, start) in [
        (0.0, 0),
        (0.29, 0),
        (0.31, 0),
        (0.7, 1),
        (1.0, 2),
        (1.3, 3),
        (1.75, 3),
    ] {
        assert_eq!(stencil(&nodes, x).unwrap().start, start, "{x}");
    }
    for outside in [-1e-9, 1.800_000_1, f64::NAN, f64::INFINITY] {
        assert_eq!(stencil(&nodes, outside), None);
    }
    assert_eq!(stencil(&[], 0.0), None);
    // Computed otherwise an end has other last bits.
    for (end, node) in [(-1e-11, 0), (1.8 + 1e-11, 6)] {
        let at = stencil(&nodes, end).unwrap();
        let weight = at.weights[node - at.start];
        assert!((weight - 1.0).abs() < 1e-9, "{end} {at:?}");
    }
}

#[test]
fn short_axes_lower_the_order() {
    assert_eq!(stencil(&[0.7], 0.7).unwrap().weights[0], 1.0);
    assert_eq!(stencil(&[0.7], 0.700_000_1), None);
    let s = stencil(&[0.7, 1.3], 0.9).unwrap();
    assert!((s.weights[0] - 2.0 / 3.0).abs() < 1e-15 && s.count == 2);
    let s = stencil(&[0.7, 1.3, 1.4], 0.9).unwrap();
    let value = s.weights[0] * 0.49 + s.weights[1] * 1.69 + s.weights[2] * 1.96;
    assert!((value - 0.81).abs() < 1e-15 && s.count == 3);
}

#[test]
fn the_error_falls_with_the_fourth_power_of_the_step() {
    let field = |x: f64, y: f64, z: f64| (-z * 13.0).exp() * (12.0 * x).cos() * (5.0 * y).sin();
    let worst = |samples: usize| {
        let nodes: Vec<f64> = (0..samples)
            .map(|i| 0.013 + 0.17 * i as f64 / (samples - 1) as f64)
            .collect();
        let mut values = Vec::new();
        for &z in &nodes {
            for &y in &nodes {
                values.extend(nodes.iter().map(|&x| field(x, y, z)));
            }
        }
        let mut worst = 0.0f64;
        for i in 0..20_011u32 {
            let t = |p: u32| 0.013 + 0.17 * f64::from((i * p) % 20_011) / 20_011.0;
            let at = [t(1), t(2_749), t(15_013)];
            let cell = locate([&nodes, &nodes, &nodes], at).unwrap();
            worst = worst.max((cell.value(&values) - field(at[0], at[1], at[2])).abs());
        }
        worst
    };
    let rate = (worst(15) / worst(29)).log2();
    assert!((3.8..4.2).contains(&rate), "rate {rate}");
}

#[test]
fn components_are_picked_out_of_the_last_axis() {
    let axes: [&[f64]; 3] = [&[0.0, 0.4, 1.1], &[0.2, 0.9], &[0.5]];
    let values: Vec<f64> = (0..6)
        .flat_map(|n| [f64::from(n), 10.0 * f64::from(n * n)])
        .collect();
    let second: Vec<f64> = values.chunks(2).map(|pair| pair[1]).collect();
    let cell = locate(axes, [0.7, 0.3, 0.5]).unwrap();
    assert_eq!(cell.component(&values, 2, 1), cell.value(&second));
}

/// Where the nodes resolve a function, stencils beside the central one are off by two to four times its error, in border
/// cells by more; at a node there is none.
#[test]
fn stencils_beside_show_the_error() {
    let nodes: Vec<f64> = (0..12).map(|k| 0.1 * f64::from(k)).collect();
    let function = |x: f64| (1.3 * x).exp();
    let value = |stencil: &Stencil| -> f64 {
        let near = &nodes[stencil.start..stencil.start + stencil.count];
        let terms = near.iter().zip(&stencil.weights);
        terms.map(|(node, weight)| weight * function(*node)).sum()
    };
    for k in 0..110 {
        let at = 0.01 * f64::from(k) + 0.005;
        let central = value(&stencil(&nodes, at).unwrap());
        let error = (central - function(at)).abs();
        let farthest = beside(&nodes, at)
            .iter()
            .map(|other| (value(other) - central).abs())
            .fold(0.0, f64::max);
        let border = !(0.1..1.0).contains(&at);
        let ratio = farthest / error;
        assert!(ratio > 1.9 && (border || ratio < 4.3), "{at}: {ratio}");
    }
    assert!(beside(&nodes, nodes[4]).is_empty());
    for few in [2, 3, 4] {
        assert_eq!(beside(&nodes[..few], 0.05).len(), 2);
    }
}
