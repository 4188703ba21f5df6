//! Axes of a grid: exact ends, mirrored nodes.

use fluxform_numerics::axis::Axis;

#[test]
fn ends_are_exact_and_nodes_mirror() {
    let axis = Axis {
        from: -0.05,
        to: 0.05,
        samples: 61,
    };
    let nodes = axis.nodes();
    assert_eq!(nodes[0], -0.05);
    assert_eq!(nodes[60], 0.05);
    for i in 0..61 {
        assert_eq!(nodes[i], -nodes[60 - i]);
    }
    for samples in 2..200 {
        let axis = Axis {
            from: -0.043,
            to: 0.05,
            samples,
        };
        assert_eq!((axis.node(0), axis.node(samples - 1)), (-0.043, 0.05));
    }
    let skew = Axis {
        from: 0.013,
        to: 0.071,
        samples: 30,
    };
    assert_eq!((skew.node(0), skew.node(29)), (0.013, 0.071));
}
