//! Lines along a plane field: they close, keep their distance and end with the field.

use fluxform_numerics::streamlines::PlaneField;

fn field(vector: impl Fn(f64, f64) -> Option<[f64; 2]>) -> PlaneField {
    let (columns, rows) = (60, 40);
    let place = |k: usize, count: usize, [from, to]: [f64; 2]| {
        from + (to - from) * (k as f64 + 0.5) / count as f64
    };
    let ends = [[-1.3, 1.7], [-0.9, 1.1]];
    let cells = (0..columns * rows).map(|k| {
        let x = place(k % columns, columns, ends[0]);
        vector(x, place(k / columns, rows, ends[1]))
    });
    PlaneField {
        ends,
        columns,
        vectors: cells.collect(),
    }
}

#[test]
fn lines_about_a_point_keep_their_distance_from_it() {
    let lines = field(|x, y| Some([-y, x])).streamlines(0.13);
    assert!(lines.len() > 6, "{}", lines.len());
    let mut closed = 0;
    for line in &lines {
        let radii = line.iter().map(|[x, y]| x.hypot(*y));
        let (low, high) = radii.fold((f64::INFINITY, 0.0_f64), |(a, b), r| (a.min(r), b.max(r)));
        assert!(high - low < 0.02, "{low} {high}");
        closed += usize::from(line.first() == line.last());
    }
    assert!(closed >= 4, "{closed} are closed");
}

#[test]
fn lines_are_neither_too_close_nor_leave_gaps() {
    let distance = 0.11;
    let lines = field(|_, _| Some([0.7, 0.2])).streamlines(distance);
    let between = |a: &[[f64; 2]], b: &[[f64; 2]]| {
        let pairs = a
            .iter()
            .flat_map(|p| b.iter().map(move |q| (p[0] - q[0]).hypot(p[1] - q[1])));
        pairs.fold(f64::INFINITY, f64::min)
    };
    for (k, line) in lines.iter().enumerate() {
        for other in &lines[..k] {
            assert!(between(line, other) > 0.45 * distance);
        }
    }
    // Any place in the middle has a line within a distance and a half.
    for k in 0..50 {
        let place = [0.02 * f64::from(k) - 0.5, 0.013 * f64::from(k) - 0.3];
        let near = lines
            .iter()
            .map(|line| between(&[place], line))
            .fold(f64::INFINITY, f64::min);
        assert!(near < 1.5 * distance, "{place:?}: {near}");
    }
}

#[test]
fn lines_end_where_there_is_no_field() {
    let lines = field(|x, _| (x < 0.3).then_some([1.3, 0.0])).streamlines(0.1);
    assert!(!lines.is_empty());
    assert!(lines.iter().flatten().all(|[x, _]| *x < 0.3));
    assert!(field(|_, _| None).streamlines(0.1).is_empty());
    assert!(field(|_, _| Some([0.0, 0.0])).streamlines(0.1).is_empty());
}
