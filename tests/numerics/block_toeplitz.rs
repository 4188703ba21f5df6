//! Products by Fourier transforms, against the blocks one by one.

use fluxform_numerics::block_toeplitz::BlockToeplitz;
use nalgebra::DMatrix;

#[test]
fn products_are_those_of_the_blocks_one_by_one() {
    // A lattice with a gap, blocks of three rows and five columns, odd and even numbers of columns.
    let cells: Vec<[usize; 2]> = (0..4)
        .flat_map(|y| (0..6).map(move |x| [x, y]))
        .filter(|cell| *cell != [2, 1])
        .collect();
    let entry = |[x, y]: [isize; 2], row: usize, column: usize| {
        ((3 * x + 7 * y) as f64 * 0.37 + (row * 5 + column) as f64 * 1.3).sin()
    };
    let toeplitz = BlockToeplitz::new(&cells, (3, 5), |step, block| {
        for row in 0..3 {
            for column in 0..5 {
                block[(row, column)] = entry(step, row, column);
            }
        }
    });
    for columns in [1, 4, 37] {
        let values = DMatrix::from_fn(5 * cells.len(), columns, |i, j| {
            (0.71 * i as f64 + 1.9 * j as f64).cos()
        });
        let product = toeplitz.apply(&values);
        for (i, to) in cells.iter().enumerate() {
            for row in 0..3 {
                let mut sum = 0.0;
                for (j, from) in cells.iter().enumerate() {
                    let step = [0, 1].map(|axis| to[axis] as isize - from[axis] as isize);
                    for column in 0..5 {
                        sum += entry(step, row, column) * values[(5 * j + column, columns - 1)];
                    }
                }
                let off = (product[(3 * i + row, columns - 1)] - sum).abs();
                assert!(off < 1e-11, "{i} {row}: {off:e}");
            }
        }
    }
}
