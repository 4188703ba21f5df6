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

#[cfg(test)]
mod tests {
    use super::front;

    #[test]
    fn it_is_what_the_definition_says() {
        let mut state = 0x9e37_79b9_7f4a_7c15_u64;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(13);
            // Few distinct values, so that ties occur.
            (state >> 59) as f64 * 0.7
        };
        let points: Vec<[f64; 2]> = (0..130).map(|_| [next(), next()]).collect();
        let beaten = |a: usize| {
            (0..points.len()).any(|b| {
                let no_worse = points[b][0] <= points[a][0] && points[b][1] >= points[a][1];
                no_worse && (points[b] != points[a] || b < a)
            })
        };
        let mut expected: Vec<usize> = (0..points.len()).filter(|&a| !beaten(a)).collect();
        expected.sort_by(|&a, &b| points[a][0].total_cmp(&points[b][0]));
        assert_eq!(front(&points), expected);
        assert!(expected.len() > 1);
        assert!(front(&[]).is_empty());
    }
}
