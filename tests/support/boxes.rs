//! Closed boxes of triangles.

/// The twelve triangles of a closed box, in order outwards; bit k of a corner's number gives
/// whether it lies at the upper end of axis k.
pub fn box_of<T>(corner: impl Fn(usize) -> T) -> Vec<[T; 3]> {
    let faces = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let halves = |[a, b, c, d]: [usize; 4]| [[a, b, c], [a, c, d]];
    let triangles = faces.into_iter().flat_map(halves);
    triangles.map(|triangle| triangle.map(&corner)).collect()
}

/// A closed box between two corners.
pub fn block(low: [f64; 3], high: [f64; 3]) -> Vec<[[f64; 3]; 3]> {
    box_of(|k| [0, 1, 2].map(|axis| [low, high][k >> axis & 1][axis]))
}
