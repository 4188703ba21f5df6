//! Least squares, against a line's textbook formulas; what is not determined is named.

use fluxform_numerics::least_squares::solve;

/// A straight line through points with residuals known in closed form.
#[test]
fn a_line_has_the_textbook_slope_and_errors() {
    let x = [0.7, 1.3, 2.9, 4.1, 5.3];
    let y = [1.1, 1.9, 4.7, 6.1, 8.3];
    let columns = [vec![1.0; 5], x.to_vec()];
    let fit = solve(&columns, &y);
    let (mx, my) = (x.iter().sum::<f64>() / 5.0, y.iter().sum::<f64>() / 5.0);
    let sxx: f64 = x.iter().map(|x| (x - mx).powi(2)).sum();
    let sxy: f64 = x.iter().zip(&y).map(|(x, y)| (x - mx) * (y - my)).sum();
    assert!((fit.values[1] - sxy / sxx).abs() < 1e-13);
    assert!((fit.values[0] - (my - sxy / sxx * mx)).abs() < 1e-13);
    let slope_error = fit.unit_errors[1].unwrap();
    assert!((slope_error - sxx.sqrt().recip()).abs() < 1e-13);
    let level_error = (0.2 + mx * mx / sxx).sqrt();
    assert!((fit.unit_errors[0].unwrap() - level_error).abs() < 1e-13);
    let left: f64 = x
        .iter()
        .zip(&y)
        .map(|(x, y)| (y - fit.values[0] - fit.values[1] * x).powi(2))
        .sum();
    let all: f64 = y.iter().map(|y| y * y).sum();
    assert!((fit.removed - (all - left)).abs() < 1e-12);
}

#[test]
fn what_is_not_determined_is_named_and_the_rest_is_solved() {
    let a = vec![0.7, 1.3, -0.3, 2.1];
    let twice: Vec<f64> = a.iter().map(|v| 2.0 * v).collect();
    let other = vec![0.2, -1.1, 0.9, 0.4];
    let b: Vec<f64> = a
        .iter()
        .zip(&other)
        .map(|(a, o)| 3.0 * a + 1.7 * o)
        .collect();
    let fit = solve(&[a, twice, other, vec![0.0; 4]], &b);
    assert_eq!(fit.rank, 2);
    assert_eq!(fit.without_effect, [3]);
    assert_eq!(fit.degenerate, [vec![0, 1]]);
    assert!(fit.unit_errors[0].is_none() && fit.unit_errors[1].is_none());
    assert!((fit.values[2] - 1.7).abs() < 1e-12 && fit.unit_errors[2].is_some());
    assert!((fit.values[0] + 2.0 * fit.values[1] - 3.0).abs() < 1e-12);
}

#[test]
fn fewer_rows_than_columns_determine_nothing_alone() {
    let fit = solve(&[vec![0.7], vec![1.3]], &[2.0]);
    assert_eq!(fit.rank, 1);
    assert!(fit.unit_errors.iter().all(Option::is_none));
    assert!(solve(&[vec![]], &[]).unit_errors[0].is_none());
}

/// Broke: a column that enters a direction without effect by less than a twentieth had no error, and no name.
#[test]
fn every_column_without_an_error_is_named() {
    let a = vec![0.7, 1.3, -0.3, 2.1, 0.9];
    let b = vec![0.2, -1.1, 0.9, 0.4, -0.6];
    let c: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a + 0.03 * b).collect();
    let fit = solve(&[a.clone(), b, c], &a);
    assert_eq!(fit.rank, 2);
    for (column, error) in fit.unit_errors.iter().enumerate() {
        let is_named = fit.degenerate.iter().flatten().any(|one| *one == column);
        assert_eq!(error.is_none(), is_named, "{column}: {fit:?}");
    }
    assert!(fit.unit_errors.iter().all(Option::is_none));
}
