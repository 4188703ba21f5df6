//! The designs that no other one beats in two respects.

/// Positions in `points`, `[cost, gain]`, of those for which no other costs no more and gains no
/// less, one of the two strictly: ascending in cost. Of equal points the first stands for all.
#[must_use]
pub fn front(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| {
        let ([cost_a, gain_a], [cost_b, gain_b]) = (points[a], points[b]);
        cost_a
            .total_cmp(&cost_b)
            .then(gain_b.total_cmp(&gain_a))
            .then(a.cmp(&b))
    });
    let mut best = f64::NEG_INFINITY;
    order.retain(|&at| {
        let better = points[at][1] > best;
        if better {
            best = points[at][1];
        }
        better
    });
    order
}
