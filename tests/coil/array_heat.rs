//! The most heat of an array against all corners of what drivers and supply allow.

use fluxform_coil::array_heat::Drivers;
use fluxform_numerics::random::Random;

/// The maximum over the corners of what is allowed: all currents at an end, or all but one.
fn by_corners(drivers: &Drivers, supplied_a: f64, ohm: f64) -> f64 {
    let most_a = drivers.total_max_a.unwrap_or(f64::INFINITY);
    let ends = drivers.ends_a.iter();
    let ends: Vec<[f64; 2]> = ends
        .map(|ends| ends.map(|a| a.clamp(-supplied_a, supplied_a)))
        .collect();
    let mut hottest = f64::NEG_INFINITY;
    for corner in 0..1_usize << ends.len() {
        let currents: Vec<f64> = (0..ends.len())
            .map(|i| ends[i][(corner >> i) & 1])
            .collect();
        let total_a: f64 = currents.iter().sum();
        let squares: f64 = currents.iter().map(|a| a * a).sum();
        if total_a <= most_a + 1e-12 {
            hottest = hottest.max(ohm * squares);
        }
        for (at_end, [low, high]) in currents.iter().zip(&ends) {
            let between = most_a - (total_a - at_end);
            if (*low..=*high).contains(&between) {
                hottest = hottest.max(ohm * (squares - at_end * at_end + between * between));
            }
        }
    }
    hottest
}

fn drivers(ends_a: Vec<[f64; 2]>, total_max_a: Option<f64>) -> Drivers {
    Drivers {
        ends_a,
        total_max_a,
    }
}

/// The sum was taken of magnitudes: 24.294 W and 48.588 W were stated.
#[test]
fn drivers_that_reverse_make_room_for_each_other() {
    let heat_w = |count, total_a| {
        drivers(vec![[-2.0, 2.0]; count], Some(total_a)).most_heat_w(None, 6.0735)[0]
    };
    assert!((heat_w(9, 2.0) / (36.0 * 6.0735) - 1.0).abs() < 1e-14);
    assert!((heat_w(4, 4.0) / (16.0 * 6.0735) - 1.0).abs() < 1e-14);
    // Two at 2 A, one between at 0.7 A, where -1.3 A would be hotter, and one at -1.3 A.
    let heat_w =
        |total_a| drivers(vec![[-1.3, 2.0]; 4], Some(total_a)).most_heat_w(None, 0.7)[0] / 0.7;
    assert!((heat_w(3.4) - (8.0 + 2.0 * 1.69)).abs() < 1e-12);
    assert!((heat_w(4.3) - (8.0 + 1.6 * 1.6 + 1.69)).abs() < 1e-12);
}

#[test]
fn the_most_heat_is_that_of_the_hottest_corner() {
    let mut random = Random::new(7);
    for trial in 0..4000 {
        let count = 1 + trial % 6;
        let one_a = -1.5 * random.unit();
        let kind = random.unit();
        let ends = |random: &mut Random| {
            let high = 2.0 * random.unit();
            match trial % 4 {
                0 => [0.0, high],
                1 => [one_a, 2.0 * kind],
                2 => [one_a, high],
                _ => [-1.5 * random.unit(), high],
            }
        };
        let ends_a: Vec<[f64; 2]> = (0..count).map(|_| ends(&mut random)).collect();
        let total_a = (trial % 7 != 0).then(|| 2.0 * random.unit() - 0.1);
        let drivers = drivers(ends_a, total_a.map(|a: f64| a.max(0.0)));
        let ohm = 0.7 + random.unit();
        let voltage_v = (trial % 3 == 0).then(|| 0.3 + 2.0 * random.unit());
        let supplied_a = voltage_v.map_or(f64::INFINITY, |v| v / ohm);
        let [stated, _] = drivers.most_heat_w(voltage_v, ohm);
        let right = by_corners(&drivers, supplied_a, ohm);
        let near = (stated - right).abs() <= 1e-12 * right;
        assert!(near, "{drivers:?} {voltage_v:?}: {stated} {right}");
    }
}

/// Broke: with several lower ends the linear relaxation was stated, 1.1999 and 23.224 W of these.
#[test]
fn regression_different_lower_ends_state_what_their_currents_can_give() {
    for (ends_a, total_a, ohm, heat_w) in [
        (vec![[-0.1, 1.0], [0.0, 1.5]], 0.1, 3.8707, 3.8707 * 0.05),
        (vec![[0.0, 2.0], [-1.0, 2.0]], 2.0, 3.8707, 3.8707 * 5.0),
    ] {
        let [stated_w, _] = drivers(ends_a, Some(total_a)).most_heat_w(None, ohm);
        assert!(
            (stated_w / heat_w - 1.0).abs() < 1e-12,
            "{stated_w} {heat_w}"
        );
    }
}

/// Of three kinds, or all with other ends: close below the relaxation, which a search that is given up would state.
#[test]
fn many_coils_of_different_ends_are_searched_to_the_end() {
    let mut random = Random::new(41);
    let mut bound = 0;
    for trial in 0..30 {
        let kinds: Vec<[f64; 2]> = (0..3)
            .map(|_| [-1.5 * random.unit(), 2.0 * random.unit()])
            .collect();
        let ends_a: Vec<[f64; 2]> = (0..225)
            .map(|coil| match trial % 2 {
                0 => kinds[coil % 3],
                _ => [-1.5 * random.unit(), 2.0 * random.unit()],
            })
            .collect();
        let total_a = 40.0 * random.unit();
        let [stated_w, _] = drivers(ends_a.clone(), Some(total_a)).most_heat_w(None, 1.0);
        // The relaxation, from the hottest coil for each ampere on.
        let mut left_a = total_a - ends_a.iter().map(|[low, _]| low).sum::<f64>();
        let mut relaxed_w: f64 = ends_a.iter().map(|[low, _]| low * low).sum();
        let mut hotter: Vec<&[f64; 2]> = ends_a.iter().filter(|[low, high]| high > &-low).collect();
        hotter.sort_by(|a, b| (b[0] + b[1]).total_cmp(&(a[0] + a[1])));
        for [low, high] in hotter {
            let raised_a = (high - low).min(left_a);
            relaxed_w += raised_a * (low + high);
            left_a -= raised_a;
        }
        // Where the sum binds some coil stays between its ends.
        if left_a == 0.0 {
            bound += 1;
            assert!(
                stated_w < relaxed_w * (1.0 - 1e-12),
                "{stated_w} {relaxed_w}"
            );
        }
        assert!(
            stated_w <= relaxed_w * (1.0 + 1e-12),
            "{stated_w} {relaxed_w}"
        );
        assert!(
            stated_w >= relaxed_w * (1.0 - 3e-3),
            "{stated_w} {relaxed_w}"
        );
    }
    assert!(bound >= 15, "{bound}");
}

#[test]
fn the_heat_of_all_coils_has_the_slope_of_small_steps() {
    let one_way = drivers([3.0, 2.0, 2.0, 1.3].map(|a| [0.0, a]).to_vec(), Some(6.0));
    let both_ways = drivers(vec![[-1.3, 2.0]; 4], Some(4.3));
    // The drivers', the sum's and the supply's currents in turn; 12 V.
    for (drivers, ohm, heat_w) in [
        (&one_way, 0.7, 9.8),
        (&one_way, 5.0, 61.6),
        (&one_way, 7.0, 468.0 / 7.0),
        (&one_way, 20.0, 28.8),
        (&both_ways, 0.7, 0.7 * 12.25),
        (&both_ways, 7.0, 0.0),
        (&both_ways, 20.0, 28.8),
    ] {
        let of = |ohm| drivers.most_heat_w(Some(12.0), ohm);
        let [value, slope] = of(ohm);
        let stated = heat_w == 0.0 || (value / heat_w - 1.0).abs() < 1e-12;
        assert!(stated, "{ohm}: {value}");
        let small = 1e-5 * ohm;
        let by = (of(ohm + small)[0] - of(ohm - small)[0]) / (2.0 * small);
        assert!((slope - by).abs() < 1e-7 * value, "{ohm}: {slope} {by}");
    }
}

#[test]
fn below_the_least_resistance_all_coils_are_too_hot() {
    let mut random = Random::new(11);
    let mut falls = 0;
    for trial in 0..300 {
        let count = 1 + trial % 5;
        let ends_a: Vec<[f64; 2]> = (0..count)
            .map(|_| [-2.0 * random.unit(), 0.3 + 2.0 * random.unit()])
            .collect();
        let total_a = (trial % 2 == 0).then(|| 3.0 * random.unit());
        let drivers = drivers(ends_a, total_a);
        let heat_w = |ohm| drivers.most_heat_w(Some(10.0), ohm)[0];
        let most_w = heat_w(4.0) * (0.2 + random.unit());
        let least_ohm = drivers.least_resistance_ohm(10.0, most_w, 4.0);
        let below = (0..200).map(|k| 4.0 + (least_ohm - 4.0) * f64::from(k) / 200.0);
        assert!(least_ohm == 4.0 || below.into_iter().all(|ohm| heat_w(ohm) > most_w));
        let [at_w, slope] = drivers.most_heat_w(Some(10.0), least_ohm);
        if least_ohm > 4.0 && slope < 0.0 {
            assert!((at_w / most_w - 1.0).abs() < 1e-11, "{at_w} {most_w}");
            falls += 1;
        }
        assert!(at_w <= most_w * (1.0 + 1e-11), "{at_w} {most_w}");
    }
    assert!(falls >= 100, "{falls}");
}
