//! The variables that move, and the least squares over them.

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

use super::model::{Factor, Minimiser, Model};

/// Rates above this share of the target are never taken for rounding.
const MOST_BLUR: f64 = 1e-9;

/// A line of targets, `constant + lambda slope`.
#[derive(Debug, Clone)]
pub(super) struct Target {
    pub constant: Vec<Num>,
    pub slope: Vec<Num>,
}

impl Target {
    /// The line through zero along `slope`.
    pub fn along(slope: &[Num]) -> Self {
        Self {
            constant: vec![Num::ZERO; slope.len()],
            slope: slope.to_vec(),
        }
    }
}

/// The minimiser at one lambda.
pub(super) struct Values {
    /// One entry a variable; zero where it does not move.
    pub x: Vec<Num>,
    /// Target minus fit.
    pub residual: Vec<Num>,
    /// Reduced gradients.
    pub gradient: Vec<Num>,
}

/// Least squares for a line of targets over the variables that move, with the model's equality
/// `sum w_i x_i = total`.
pub(super) trait Basis {
    /// The problem's columns.
    fn model(&self) -> &Model;
    /// The line of targets.
    fn target(&self) -> &Target;
    /// Lets the listed variables move and no others; some are left out if they depend on the rest.
    fn set(&mut self, variables: &[usize]);
    /// Adds one to those listed `before`; false if it depends on them.
    fn add(&mut self, before: &[usize], variable: usize) -> bool;
    /// Variables that move; with an equality one that is not among them moves too.
    fn members(&self) -> &[usize];
    /// That one: the variable of the smallest column per weight.
    fn pivot(&self) -> Option<usize>;
    /// Smallest share of a member's column that lies outside the span of others.
    fn independence(&self) -> f64;
    /// Relative error that the arithmetic leaves in values and rates.
    fn resolution(&self) -> f64;
    /// Rates of the minimiser for the slope alone, whose weights add up to zero.
    fn rates(&mut self) -> Vec<Num>;
    /// `slope - A rates` of the same.
    fn residual_rate(&self, rates: &[Num]) -> Vec<Num>;
    /// Reduced gradients of the same; zero for what moves.
    fn gradient_rates(&self) -> Vec<Num>;
    /// The minimiser at `lambda` where the `fixed` variables have the values given; its rates are known.
    fn values(
        &self,
        lambda: Num,
        total: Num,
        fixed: &[(usize, Num)],
        rates: (&[Num], &[Num]),
    ) -> Values;

    /// Relative size of the gradients that errors of the columns leave where zero is meant.
    fn noise(&self) -> f64 {
        let model = self.model();
        (4 * model.rows) as f64 * model.epsilon / self.independence() + self.resolution()
    }

    /// Natural sizes of the reduced gradients per unit of residual.
    fn gradient_scales(&self) -> Vec<Num> {
        let model = self.model();
        let shift = self
            .pivot()
            .map_or(Num::ZERO, |p| model.norm[p] / model.weight_of(p));
        (0..model.count())
            .map(|i| model.norm[i] + model.weight_of(i) * shift)
            .collect()
    }

    /// Relative error of the rates: a residual of the given share of the target is felt with
    /// the square of the condition.
    fn blur(&self, residual_share: f64) -> f64 {
        (self.noise() * (1.0 + residual_share / self.independence())).min(MOST_BLUR)
    }

    /// Size of a rate that rounding leaves where variable `i` should not move; `blur` is
    /// the same relative to the target.
    fn rate_noise(&self, i: usize, rates: &[Num], target_norm: Num, blur: f64) -> Num {
        let model = self.model();
        let mut scale = target_norm;
        if self.pivot() == Some(i) {
            let others = self.members().iter().filter(|&&j| j != i);
            let moved = others.fold(Num::ZERO, |s, &j| {
                s + model.weight_of(j) * (rates[j].abs() + target_norm)
            });
            scale = scale.larger(moved / model.weight_of(i));
        }
        scale * Num::of(blur)
    }
}

/// The basis by a QR factorisation of its columns, which keeps its digits however nearly they
/// depend on each other; a change costs some squares of the rows.
pub(super) struct QrBasis<'a> {
    model: &'a Model,
    target: Target,
    factor: Factor,
    residual_rate: Vec<Num>,
}

impl<'a> QrBasis<'a> {
    /// Without members.
    pub fn new(model: &'a Model, target: Target) -> Self {
        Self {
            model,
            factor: Factor::new(model, &[]),
            residual_rate: target.slope.clone(),
            target,
        }
    }
}

impl Basis for QrBasis<'_> {
    fn model(&self) -> &Model {
        self.model
    }

    fn target(&self) -> &Target {
        &self.target
    }

    fn set(&mut self, variables: &[usize]) {
        self.factor.change_to(self.model, variables);
    }

    fn add(&mut self, before: &[usize], variable: usize) -> bool {
        self.factor.add(self.model, before, variable)
    }

    fn members(&self) -> &[usize] {
        self.factor.members()
    }

    fn pivot(&self) -> Option<usize> {
        self.factor.pivot()
    }

    fn independence(&self) -> f64 {
        self.factor.independence(self.model)
    }

    fn resolution(&self) -> f64 {
        0.0
    }

    fn rates(&mut self) -> Vec<Num> {
        let Minimiser { x, residual } =
            (self.factor).solve(self.model, &self.target.slope, Num::ZERO);
        self.residual_rate = residual;
        x
    }

    fn residual_rate(&self, _: &[Num]) -> Vec<Num> {
        self.residual_rate.clone()
    }

    fn gradient_rates(&self) -> Vec<Num> {
        self.factor.gradient(self.model, &self.residual_rate)
    }

    fn values(
        &self,
        lambda: Num,
        total: Num,
        fixed: &[(usize, Num)],
        (rates, residual_rate): (&[Num], &[Num]),
    ) -> Values {
        let constant = &self.target.constant;
        let (rest, total) = (self.model).remainder(constant, total, fixed.iter().copied());
        let base = self.factor.solve(self.model, &rest, total);
        let at = |(&base, &rate): (&Num, &Num)| base + lambda * rate;
        let mut x = base.x;
        for &i in self.members().iter().chain(&self.pivot()) {
            x[i] = at((&x[i], &rates[i]));
        }
        let residual: Vec<Num> = base.residual.iter().zip(residual_rate).map(at).collect();
        Values {
            gradient: self.factor.gradient(self.model, &residual),
            x,
            residual,
        }
    }
}
