//! Sums of products by vector instructions, on integers.

use fluxform_numerics::real::Real;

#[test]
fn the_vector_sum_of_products_is_exact_on_small_integers() {
    for n in 0..40 {
        let a: Vec<f64> = (0..n).map(|i| f64::from(3 * i - 7)).collect();
        let b: Vec<f64> = (0..n).map(|i| f64::from(i * i % 11)).collect();
        let plain: f64 = a.iter().zip(&b).map(|(x, y)| x * y).sum();
        assert_eq!(f64::dot(&a, &b), plain);
        // Sums end with the shorter one.
        let longer: Vec<f64> = b.iter().copied().chain([1.0; 9]).collect();
        assert_eq!(f64::dot(&a, &longer), plain);
    }
}
