//! The designs and reference values that the measurements use, built into the program.

use std::path::Path;

use serde::de::DeserializeOwned;

use fluxform::RunError;
use fluxform::bundle::artefact::Input;
use fluxform::design::{Design, Need};

/// A file of the repository that is part of the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BuiltIn {
    /// Where it lies in the repository.
    pub path: &'static str,
    /// Its text.
    pub text: &'static str,
}

macro_rules! built_in {
    ($(#[$about:meta] $name:ident = $path:literal;)*) => {
        $(#[$about] pub const $name: BuiltIn = BuiltIn {
            path: $path,
            text: include_str!(concat!("../../", $path)),
        };)*
    };
}

built_in! {
    /// Nine cored coils.
    SEED = "designs/seed.toml";
    /// The same without steel.
    SEED_AIR = "designs/seed_air.toml";
    /// The seed's flat surface, as a formula.
    FLAT = "shapes/primitives/flat.toml";
    /// Fields and inductances of air coils to 20 digits and more, by another formula.
    AIR_COIL = "tests/oracles/air_coil.json";
    /// Cored coils by their surface charge.
    CORES = "tests/oracles/steel/cores.json";
    /// The force constant in exact rational numbers.
    LAMBDA = "tests/oracles/lambda.json";
    /// The best coils that three solvers of NLopt found, with other models of the coil.
    NLOPT = "tests/oracles/nlopt/reference.json";
    /// Equation 11 with all its limits.
    AIR_ALL_LIMITS = "tests/oracles/nlopt/designs/air_all_limits.toml";
    /// Equation 11 with the seed's limits, in air.
    OPTIMUM_AIR = "tests/oracles/nlopt/designs/seed_air.toml";
    /// The same with the core.
    OPTIMUM_CORED = "tests/oracles/nlopt/designs/seed_cored.toml";
}

impl BuiltIn {
    /// Its entry among the inputs.
    #[must_use]
    pub fn input(&self) -> Input {
        Input::of_bytes(self.path, self.text.as_bytes())
    }

    /// The design that it describes.
    ///
    /// # Errors
    /// A design that cannot be read: a mistake of the program, reported like a user's.
    pub fn design(&self, need: Need) -> Result<Design, RunError> {
        let read = Design::from_toml(self.text, Path::new(self.path), need);
        read.map(|(design, _)| design)
            .map_err(|fault| RunError::Input(format!("{}: {fault}", self.path)))
    }

    /// The values that it holds.
    ///
    /// # Errors
    /// As [`BuiltIn::design`].
    pub fn values<T: DeserializeOwned>(&self) -> Result<T, RunError> {
        serde_json::from_str(self.text)
            .map_err(|fault| RunError::Input(format!("{}: {fault}", self.path)))
    }
}
