//! The clock of the measurements: a process of its own, because processor time is that of all
//! threads of the process, and tests beside this one would count.

use std::convert::Infallible;

use fluxform::commands::bench::clock::{Effort, measure};

#[test]
fn known_work_is_measured() {
    ten_times_the_work_takes_ten_times_as_long();
    short_work_is_gathered_into_samples_and_long_work_is_not_repeated();
}

/// Work whose amount is known: so many dependent multiplications.
fn spin(steps: u64) -> Result<f64, Infallible> {
    let mut x = 1.3_f64;
    for _ in 0..steps {
        x = std::hint::black_box(x * 0.999_999_9 + 1e-7);
    }
    Ok(x)
}

fn ten_times_the_work_takes_ten_times_as_long() {
    let effort = Effort {
        sample_s: 2e-3,
        enough_s: 0.2,
        samples: 15,
    };
    let (_, one) = measure(&effort, || spin(200_000)).unwrap();
    let (_, ten) = measure(&effort, || spin(2_000_000)).unwrap();
    let ratio = ten.seconds / one.seconds;
    assert!((6.0..16.0).contains(&ratio), "{ratio}: {one:?} {ten:?}");
    for timing in [one, ten] {
        assert!(timing.low_s <= timing.seconds && timing.seconds <= timing.high_s);
        assert!(timing.samples > 1);
    }
}

fn short_work_is_gathered_into_samples_and_long_work_is_not_repeated() {
    let mut calls = 0;
    let effort = Effort {
        sample_s: 5e-4,
        enough_s: 0.05,
        samples: 3,
    };
    let (_, timing) = measure(&effort, || {
        calls += 1;
        spin(100)
    })
    .unwrap();
    assert!(calls > 30 && timing.seconds < 1e-4, "{calls} {timing:?}");
    let mut calls = 0;
    let short = Effort {
        enough_s: 1e-5,
        ..effort
    };
    measure(&short, || {
        calls += 1;
        spin(2_000_000)
    })
    .unwrap();
    assert_eq!(calls, 1);
    let mut calls = 0;
    measure(&Effort::ONCE, || {
        calls += 1;
        spin(1)
    })
    .unwrap();
    assert_eq!(calls, 2, "a warm-up and one sample");
}
