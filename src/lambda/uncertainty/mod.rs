//! The felt error that the uncertainties of a real display cause, and the currents for which it is least.
//!
//! A force per ampere `G` is that of the magnet's moment along its own axis and along both axes across;
//! around a place where it is measured or meant to be, the magnet is displaced, tilted, warmer, and its
//! currents are off. For currents `I` chosen for a request `F`,
//!
//! ```text
//! E |F(I) - F|^2 = I'HI - 2 b'I + c,
//! H = E[s^2] sum_q w_q sum_k E[m_k^2] (G_qk'G_qk + d^2 diag(|G_qki|^2)),   b = E[s] E[m_0] sum_q w_q G_q0'F
//! ```
//!
//! with places `q` of a rule for the box of displacements, shares `m_k` of the moment, strength `s` and mean
//! square `d^2` of a driver's error: a quadratic, whose minimum over the limits is exact
//! (`error_form`). The rule is that of Hammer and Stroud (1958) of degree 5, 14 places within the box.
//!
//! Unpowered steel pulls a warmer and tilted magnet by `s^2 p P`, the magnet as stated by `P`, with `p` as above a
//! half space of steel. `F - s^2 p P` takes the place of `F` then, in `b` and `c` under the means.
//!
//! The request is that of the measured place: a sensor that is off by a constant moves the object, which no
//! finger feels as a wrong force. Static currents know no sensor; for them the same displacement is that of
//! the magnet from the place of the surface that it renders.

mod draws;
mod error_form;
mod felt_error;
mod runtime;
mod study;

pub use draws::{Draw, draws};
pub use error_form::ErrorForm;
pub(crate) use error_form::Target;
pub use felt_error::{CauseCost, CurrentsError, FeltError, RobustSetting, Shares, Study, TradeOff};
pub use runtime::{RobustForm, RobustRuntime};
pub use study::{Drawn, Surroundings, study};

use fluxform_base::uncertainty::Uncertainty;

use super::problem::ForceProblem;

/// Force per ampere on a moment along the magnet's own axis, then along two axes across: x, y and z of each.
pub type Turned = [f64; 9];

/// Places of the rule of degree 5 over a box.
const RULE: usize = 14;
/// Edges of a box.
const EDGES: usize = 12;
/// Shares of the box's half widths at which its places are, on the axes and on the diagonals, and weights.
const ON_AXES: (f64, f64) = (0.795_822_425_754_221_5, 40.0 / 361.0);
const ON_DIAGONALS: (f64, f64) = (0.758_786_910_639_328_1, 121.0 / 2888.0);

/// Which of the places around a point take part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Reach {
    /// None but the point.
    Point,
    /// Those of the rule over the box of half the bound.
    Half,
    /// Those of the rule over the box.
    Whole,
    /// Faces, corners and edges of the box, at their middles: all components of a force are harmonic, so
    /// the largest error is on its surface.
    Surface,
}

impl Reach {
    fn places(self) -> std::ops::Range<usize> {
        match self {
            Self::Point => 0..1,
            Self::Half => 1..1 + RULE,
            Self::Whole => 1 + RULE..1 + 2 * RULE,
            Self::Surface => 1 + 2 * RULE..1 + 3 * RULE + EDGES,
        }
    }
}

/// Unit displacements of a rule: along the axes by `on_axis`, along the diagonals by `on_diagonal`.
fn displaced(on_axis: f64, on_diagonal: f64) -> impl Iterator<Item = [f64; 3]> {
    let axes = (0..6).map(move |k| {
        let mut place = [0.0; 3];
        place[k / 2] = if k % 2 == 0 { on_axis } else { -on_axis };
        place
    });
    let diagonals = (0..8_usize).map(move |k| {
        std::array::from_fn(|axis| {
            if k >> axis & 1 == 0 {
                on_diagonal
            } else {
                -on_diagonal
            }
        })
    });
    axes.chain(diagonals)
}

/// Middles of the edges of a box whose half widths are 1.
fn edges() -> impl Iterator<Item = [f64; 3]> {
    (0..EDGES).map(|k| {
        let sign = |bit: usize| if k >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let mut place = [0.0; 3];
        place[(k / 4 + 1) % 3] = sign(0);
        place[(k / 4 + 2) % 3] = sign(1);
        place
    })
}

/// Displacements from a point at which forces are needed, m: one where the position is exact, 55 otherwise.
#[must_use]
pub fn displacements_m(given: &Uncertainty) -> Vec<[f64; 3]> {
    let s = given.sensor_m;
    if s == 0.0 {
        return vec![[0.0; 3]];
    }
    let of = |share: f64, (on_axis, on_diagonal): (f64, f64)| {
        displaced(on_axis, on_diagonal).map(move |place| place.map(|v| share * s * v))
    };
    let rule = (ON_AXES.0, ON_DIAGONALS.0);
    std::iter::once([0.0; 3])
        .chain(of(0.5, rule))
        .chain(of(1.0, rule))
        .chain(of(1.0, (1.0, 1.0)))
        .chain(edges().map(move |place| place.map(|v| s * v)))
        .collect()
}

/// Points that a study of an array takes at most: its memory and time grow with the coils' square.
#[must_use]
pub fn most_points(coils: usize) -> usize {
    const MOST: usize = 200;
    const NUMBERS: usize = 4_000_000;
    (NUMBERS / (coils * coils).max(1)).clamp(20, MOST)
}

/// The mean square error of currents at one place, upward and sideways apart.
pub(crate) struct Forms {
    pub(crate) upward: ErrorForm,
    pub(crate) sideways: ErrorForm,
}

impl Forms {
    /// Of a request `force_n` where the force per ampere at each of the `places` with its weight is `field`
    /// and the force without currents `pull_n`.
    pub(crate) fn new<'a>(
        coils: usize,
        given: &Uncertainty,
        request_n: [f64; 3],
        places: impl Iterator<Item = (&'a [Turned], f64, f64)>,
    ) -> Self {
        let moments = given.moments();
        let mut forms = Self {
            upward: ErrorForm::new(coils),
            sideways: ErrorForm::new(coils),
        };
        let mut row = vec![0.0; coils];
        for (field, pull_n, weight) in places {
            for axis in 0..3 {
                let form = if axis == 2 {
                    &mut forms.upward
                } else {
                    &mut forms.sideways
                };
                let pull_n = if axis == 2 { pull_n } else { 0.0 };
                let scale = (moments.gain, moments.along);
                let target = Target::new(request_n[axis], pull_n, scale, moments.pull);
                let shares = [
                    moments.along_square,
                    moments.across_square,
                    moments.across_square,
                ];
                for (turn, share) in shares
                    .into_iter()
                    .enumerate()
                    .filter(|(_, share)| *share > 0.0)
                {
                    for (value, force) in row.iter_mut().zip(field) {
                        *value = force[3 * turn + axis];
                    }
                    let square = weight * moments.gain_square * share;
                    form.add_square(&row, square, moments.driver_square);
                    if turn == 0 {
                        form.add_target(&row, target, weight);
                    }
                }
            }
        }
        forms
    }

    /// Of currents, upward and sideways, N^2.
    pub(crate) fn values(&self, currents_a: &[f64]) -> [f64; 2] {
        [&self.upward, &self.sideways].map(|form| form.value(currents_a))
    }

    /// Upward and sideways parts as one, the sideways one counting if the request is a vector.
    pub(crate) fn combined(&self, vector: bool) -> ErrorForm {
        let mut form = self.upward.clone();
        if vector {
            form.add(&self.sideways, 1.0);
        }
        form
    }
}

/// The currents of the least expected error at one place plus `price_n2_per_w` (> 0) times their power, into
/// `currents_a`, which hold currents within the limits. `places` are forces per ampere with the pull and the
/// weight of each, the weights adding up to 1.
pub fn robust_currents<'a>(
    limits: &ForceProblem,
    given: &Uncertainty,
    (request_n, vector): ([f64; 3], bool),
    places: impl Iterator<Item = (&'a [Turned], f64, f64)>,
    price_n2_per_w: f64,
    currents_a: &mut [f64],
) {
    let forms = Forms::new(currents_a.len(), given, request_n, places);
    forms
        .combined(vector)
        .minimise(limits, price_n2_per_w, currents_a);
}
