//! Random numbers: the bits of the reference implementation, moments of the distributions.

use fluxform_numerics::random::{Random, seed_at};

/// The first outputs of the reference implementation for the seed 1234567.
#[test]
fn the_bits_are_those_of_splitmix64() {
    let mut random = Random::new(1_234_567);
    let first = [
        6_457_827_717_110_365_317,
        3_203_168_211_198_807_973,
        9_817_491_932_198_370_423,
        4_593_380_528_125_082_431,
        16_408_922_859_458_223_821,
    ];
    assert_eq!(first.map(|_| random.bits()), first);
    assert_eq!(seed_at(1_234_567, 1), first[1]);
}

#[test]
fn moments_are_those_of_the_distributions() {
    let mut random = Random::new(7);
    let n = 100_000;
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / f64::from(n);
    assert!((mean((0..n).map(|_| random.between(0.7, 1.3)).collect()) - 1.0).abs() < 3e-3);
    assert!(mean((0..n).map(|_| random.normal()).collect()).abs() < 0.02);
    assert!((mean((0..n).map(|_| random.normal().powi(2)).collect()) - 1.0).abs() < 0.02);
    assert!((mean((0..n).map(|_| random.below(7) as f64).collect()) - 3.0).abs() < 0.03);
}
