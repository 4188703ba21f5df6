//! The front of designs, against its definition.

use fluxform_numerics::front::front;

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
