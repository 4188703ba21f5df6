//! The search on problems whose optimum is known.

use fluxform_base::progress::Interrupted;
use fluxform_numerics::mixed_search::descent::Judged;
use fluxform_numerics::mixed_search::{MET, Problem, Search, Settings, Values, Variable};
use std::sync::atomic::{AtomicUsize, Ordering};

/// A problem from closures.
struct Closed<F, G> {
    variables: Vec<Variable>,
    outputs: F,
    judge: G,
    calls: AtomicUsize,
}

impl<F, G> Problem for Closed<F, G>
where
    F: Fn(&[f64]) -> Option<Vec<f64>> + Sync,
    G: Fn(&[f64], &[f64]) -> Judged + Sync,
{
    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn outputs(&self, x: &[f64]) -> Result<Option<Vec<f64>>, Interrupted> {
        self.calls.fetch_add(1, Ordering::Relaxed);
        Ok((self.outputs)(x))
    }

    fn judge(&self, x: &[f64], outputs: &[f64]) -> Judged {
        (self.judge)(x, outputs)
    }
}

fn variable(low: f64, high: f64, values: Values) -> Variable {
    Variable { low, high, values }
}

/// A coil-like problem: strength falls with the bore and grows with turns, limits on resistance and
/// time bind; layers, turns and wire are whole, so is the optimum found by trying all of them.
fn coil() -> impl Problem {
    let wires = vec![0.5, 0.6, 0.7, 0.9];
    Closed {
        variables: vec![
            variable(10.0, 30.0, Values::Continuous),
            variable(2.0, 14.0, Values::Whole),
            variable(30.0, 160.0, Values::Whole),
            variable(0.5, 0.9, Values::Listed(wires)),
            variable(0.0, 40.0, Values::Continuous),
        ],
        outputs: |x: &[f64]| {
            let turns = x[1] * x[2];
            let length = x[2] * x[3];
            let strength =
                turns * x[0].powf(1.3) / (1.0 + length / 60.0) / (1.0 + x[1] * x[3] / 9.0)
                    * (1.0 + 0.2 * (-(x[4] - 13.0_f64).powi(2) / 300.0).exp());
            let inductance = turns * turns * x[0] * x[0] / (length + 20.0) * (1.0 + 0.01 * x[4]);
            Some(vec![strength.ln(), inductance.ln()])
        },
        judge: |x: &[f64], outputs: &[f64]| {
            let outer = x[0] + 2.0 * x[1] * x[3];
            let resistance = x[1] * x[2] * (x[0] + x[1] * x[3]) / (x[3] * x[3]) / 12_000.0;
            let mut limits = vec![
                (outer / 38.0).ln(),
                (resistance / 6.0).ln(),
                (x[2] * x[3] / 100.0).ln(),
            ];
            if let Some(inductance) = outputs.get(1) {
                limits.push(inductance - resistance.ln() - 13.4);
            }
            Judged {
                objectives: vec![outputs.first().copied().unwrap_or(0.0)],
                limits,
            }
        },
        calls: AtomicUsize::new(0),
    }
}

/// Outputs exist only close to the given design, as where a shape is out of most arrays' reach.
#[test]
fn regression_a_search_ended_where_few_designs_have_outputs() {
    let best = [0.93, 0.07, 0.31, 0.62, 0.48];
    let problem = Closed {
        variables: vec![variable(0.0, 1.0, Values::Continuous); 5],
        outputs: |x: &[f64]| {
            let off = |(x, best): (&f64, f64)| (x - best) * (x - best);
            let far: f64 = x.iter().zip(best).map(off).sum();
            (far < 0.03).then(|| vec![-far])
        },
        judge: |_: &[f64], outputs: &[f64]| Judged {
            objectives: vec![outputs.first().copied().unwrap_or(0.0)],
            limits: Vec::new(),
        },
        calls: AtomicUsize::new(0),
    };
    let mut search = Search::new(&problem, Settings::default());
    search
        .run(&[vec![0.85, 0.13, 0.38, 0.56, 0.42]])
        .expect("not interrupted");
    let (_, judged) = search.best().expect("a design");
    assert!(judged.objective() > -1e-4, "{}", judged.objective());
}

/// The best of all whole values, the two others by a grid that is refined.
fn exhaustive(problem: &dyn Problem) -> f64 {
    let mut best = f64::NEG_INFINITY;
    for wire in [0.5, 0.6, 0.7, 0.9] {
        for layers in 2..=14 {
            for turns in 30..=160 {
                for bore in 0..=100 {
                    let x = [
                        10.0 + 0.2 * f64::from(bore),
                        f64::from(layers),
                        f64::from(turns),
                        wire,
                        12.0,
                    ];
                    let cheap = problem.judge(&x, &[]);
                    if cheap.excess() > 0.0 {
                        continue;
                    }
                    for below in [4.0, 8.0, 10.0, 11.0, 12.0, 13.0] {
                        let x = [x[0], x[1], x[2], x[3], below];
                        let Ok(Some(outputs)) = problem.outputs(&x) else {
                            continue;
                        };
                        let judged = problem.judge(&x, &outputs);
                        if judged.excess() <= 0.0 {
                            best = best.max(judged.objective());
                        }
                    }
                }
            }
        }
    }
    best
}

#[test]
fn a_coil_like_problem_comes_to_the_best_of_all_whole_values() {
    let problem = coil();
    let known = exhaustive(&problem);
    for seed in [1, 2, 3] {
        let settings = Settings {
            seed,
            ..Settings::default()
        };
        let mut search = Search::new(&problem, settings);
        search
            .run(&[vec![24.0, 10.0, 100.0, 0.7, 10.0]])
            .expect("not interrupted");
        let (_, judged) = search.best().expect("a design");
        assert!(judged.excess() <= MET);
        assert!(
            judged.objective() > known - 2e-3,
            "{} of {known}",
            judged.objective()
        );
    }
}

#[test]
fn the_outcome_does_not_depend_on_threads_and_follows_from_the_seed() {
    let of = |threads, seed| {
        let problem = coil();
        let settings = Settings {
            seed,
            evaluations: 60,
            ..Settings::default()
        };
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        pool.install(|| {
            let mut search = Search::new(&problem, settings);
            search.run(&[]).expect("not interrupted");
            search.samples().to_vec()
        })
    };
    assert_eq!(of(1, 7), of(3, 7));
    assert_ne!(of(1, 7), of(1, 8));
}

/// Two valleys: the second start sees the deeper one, from a given design in the other.
#[test]
fn several_starts_leave_a_lesser_valley() {
    let problem = Closed {
        variables: vec![
            variable(-1.0, 1.0, Values::Continuous),
            variable(-1.0, 1.0, Values::Continuous),
        ],
        outputs: |x: &[f64]| {
            let hill =
                |a: f64, b: f64, w: f64| (-((x[0] - a).powi(2) + (x[1] - b).powi(2)) / w).exp();
            Some(vec![0.8 * hill(-0.6, -0.5, 0.2) + hill(0.6, 0.3, 0.15)])
        },
        judge: |_: &[f64], outputs: &[f64]| Judged {
            objectives: outputs.to_vec(),
            limits: vec![],
        },
        calls: AtomicUsize::new(0),
    };
    let mut search = Search::new(&problem, Settings::default());
    search.run(&[vec![-0.7, -0.4]]).expect("not interrupted");
    let (sample, _) = search.best().expect("a design");
    assert!(
        (sample.x[0] - 0.6).abs() < 0.01 && (sample.x[1] - 0.3).abs() < 0.01,
        "{sample:?}"
    );
}

#[test]
fn contradicting_limits_give_the_design_that_breaks_them_least() {
    let problem = Closed {
        variables: vec![
            variable(0.0, 1.0, Values::Continuous),
            variable(0.0, 1.0, Values::Continuous),
        ],
        outputs: |x: &[f64]| Some(vec![x[0] + 0.3 * x[1]]),
        judge: |x: &[f64], outputs: &[f64]| Judged {
            objectives: outputs.to_vec(),
            limits: vec![x[0] - 0.3, 0.7 - x[0]],
        },
        calls: AtomicUsize::new(0),
    };
    let mut search = Search::new(&problem, Settings::default());
    search.run(&[]).expect("not interrupted");
    let (sample, judged) = search.best().expect("a design");
    assert!((judged.excess() - 0.2).abs() < 1e-3, "{sample:?}");
}

/// The user stops it: what was evaluated is there.
#[test]
fn what_was_evaluated_before_an_interruption_is_kept() {
    struct Stopped(Vec<Variable>, AtomicUsize);
    impl Problem for Stopped {
        fn variables(&self) -> &[Variable] {
            &self.0
        }
        fn outputs(&self, x: &[f64]) -> Result<Option<Vec<f64>>, Interrupted> {
            match self.1.fetch_add(1, Ordering::Relaxed) {
                0..20 => Ok(Some(vec![x[0] * (0.7 - x[0])])),
                _ => Err(Interrupted),
            }
        }
        fn judge(&self, _: &[f64], outputs: &[f64]) -> Judged {
            Judged {
                objectives: outputs.to_vec(),
                limits: vec![],
            }
        }
    }
    let problem = Stopped(
        vec![variable(0.0, 1.0, Values::Continuous)],
        AtomicUsize::new(0),
    );
    let mut search = Search::new(&problem, Settings::default());
    assert!(search.run(&[vec![0.9]]).is_err());
    assert!(search.samples().len() >= 17, "{}", search.samples().len());
    assert!(search.best().is_some());
}
