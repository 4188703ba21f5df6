//! What the solvers ask of a material: an isotropic, single-valued B(H).

/// A material's answer at one field strength, over mu_0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// B / (mu_0 H); at H = 0 its limit.
    pub relative: f64,
    /// dB/dH / mu_0.
    pub differential: f64,
}

/// An isotropic material without memory. B must grow with H and be at least mu_0 H.
pub trait Permeability {
    /// The material's relative and differential permeability at `h_a_per_m` >= 0.
    fn response(&self, h_a_per_m: f64) -> Response;
}

/// A material whose permeability does not depend on the field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constant {
    /// Relative permeability, >= 1.
    pub relative: f64,
}

impl Permeability for Constant {
    fn response(&self, _h_a_per_m: f64) -> Response {
        Response {
            relative: self.relative,
            differential: self.relative,
        }
    }
}
