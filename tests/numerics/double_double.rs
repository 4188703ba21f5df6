//! Double-double numbers: exact on integers, right to 106 bits, the same bits in lists as one by one.

use fluxform_numerics::double_double::DoubleDouble;
use fluxform_numerics::random::Random;

const ULP: f64 = 1.0 / (1_u128 << 106) as f64;

fn integer(value: i128) -> DoubleDouble {
    let hi = value as f64;
    DoubleDouble::exactly(hi) + DoubleDouble::exactly((value - hi as i128) as f64)
}

fn as_integer(value: DoubleDouble) -> i128 {
    value.nearest() as i128 + value.remainder() as i128
}

/// Odd numbers of up to 50 bits.
fn numbers() -> impl Iterator<Item = i128> {
    (1..400_u64).map(|k| {
        let bits = k.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 14;
        i128::from(bits | 1) * if k % 3 == 0 { -1 } else { 1 }
    })
}

#[test]
fn sums_and_products_of_integers_are_exact() {
    for (a, b) in numbers().zip(numbers().skip(7)) {
        assert_eq!(as_integer(integer(a) * integer(b)), a * b);
        let (c, d) = (a * b, a << 40);
        assert_eq!(as_integer(integer(c) + integer(d)), c + d);
        assert_eq!(as_integer(integer(c) - integer(d)), c - d);
        assert_eq!(integer(c) < integer(d), c < d);
    }
}

#[test]
fn quotients_and_roots_multiply_back() {
    for (a, b) in numbers().zip(numbers().skip(11)) {
        let (x, y) = (integer(a * b), integer(b * 3));
        let back = (x / y) * y - x;
        assert!(
            back.nearest().abs() <= 24.0 * ULP * x.nearest().abs(),
            "{a} {b}: {back:?}"
        );
        let x = integer((a * b).abs());
        let root = x.square_root();
        let back = root * root - x;
        assert!(
            back.nearest().abs() <= 48.0 * ULP * x.nearest(),
            "{a} {b}: {back:?}"
        );
    }
    let third = DoubleDouble::exactly(1.0) / DoubleDouble::exactly(3.0);
    let back = third * DoubleDouble::exactly(3.0) - DoubleDouble::exactly(1.0);
    assert!(back.nearest().abs() <= 4.0 * ULP);
}

/// Vector instructions change nothing: sums and multiples have the bits of the plain operations.
/// Four at once have the bits of one alone, and lengths stay.
#[test]
fn rotations_of_columns_side_by_side_have_the_bits_of_each_alone() {
    let exact = DoubleDouble::exactly;
    let third = |k: i32| exact(f64::from(k)) / exact(3.0);
    let columns = [1, 4, -2, 7].map(|k| [third(k), third(k + 1), third(2 - k), third(k * k)]);
    let rotations = [3.0, -4.0, 0.75].map(|tan| {
        let cos = exact(1.0) / (exact(1.0) + exact(tan) * exact(tan)).square_root();
        [cos, exact(tan) * cos]
    });
    let square = |v: &[DoubleDouble]| DoubleDouble::sum_of_products(v, v);
    let (mut together, mut alone) = (columns, columns);
    let [a, b, c, d] = &mut together;
    DoubleDouble::rotate(&rotations, [a, b, c, d].map(|column| &mut column[..]));
    for (k, column) in alone.iter_mut().enumerate() {
        DoubleDouble::rotate(&rotations, [&mut column[..]]);
        assert_eq!(*column, together[k]);
        let off = square(column) - square(&columns[k]);
        assert!(off.nearest().abs() < 1e-29);
    }
    // The first entry of the first column: cos / 3 + sin 2 / 3 of the first rotation.
    let [cos, sin] = rotations[0];
    let first = third(1) * cos + third(2) * sin;
    assert!((together[0][0] - first).nearest().abs() < 1e-30);
}

#[test]
fn sums_over_lists_have_the_bits_of_one_operation_after_another() {
    let mut random = Random::new(3);
    let mut next = || {
        let value = random.between(-1.0, 1.0);
        DoubleDouble::exactly(value) + DoubleDouble::exactly(value * 1e-17 * random.unit())
    };
    for count in 0..80 {
        let a: Vec<DoubleDouble> = (0..count).map(|_| next()).collect();
        let b: Vec<DoubleDouble> = (0..count + 1).map(|_| next()).collect();
        let mut lanes = [DoubleDouble::exactly(0.0); 5];
        for k in 0..count {
            let lane = if k < count / 4 * 4 { k % 4 } else { 4 };
            lanes[lane] += a[k] * b[k];
        }
        let [p, q, r, s, rest] = lanes;
        let sum = (p + q) + (r + s) + rest;
        assert_eq!(DoubleDouble::sum_of_products(&a, &b), sum, "{count}");
        let factor = next();
        let mut y = a.clone();
        DoubleDouble::add_multiple(&mut y, factor, &b);
        for k in 0..count {
            assert_eq!(y[k], a[k] + factor * b[k], "{count} {k}");
        }
    }
}
