//! Choices by name: enums of documents, artefacts and the command line.

use std::str::FromStr;

use strum::{EnumMessage, VariantArray};

/// An enum whose variants are chosen by name. Its derives make the names from the variants, the
/// meanings from their comments; [`choices!`](crate::choices) gives it methods.
pub trait Choice:
    VariantArray + EnumMessage + Into<&'static str> + FromStr + Copy + Send + Sync + 'static
{
}

impl<T> Choice for T where
    T: VariantArray + EnumMessage + Into<&'static str> + FromStr + Copy + Send + Sync + 'static
{
}

/// `ALL`, `name` and `meaning` for every [`Choice`](crate::choice::Choice) listed.
#[macro_export]
macro_rules! choices {
    ($($choice:ty),+ $(,)?) => {$(
        impl $choice {
            /// All of them.
            pub const ALL: &'static [Self] = <Self as ::strum::VariantArray>::VARIANTS;

            /// Its name in documents, artefacts and on the command line.
            #[must_use]
            pub fn name(self) -> &'static str {
                self.into()
            }

            /// Its meaning: the first line of the variant's comment.
            #[must_use]
            pub fn meaning(self) -> &'static str {
                ::strum::EnumMessage::get_documentation(&self).unwrap_or_default()
            }
        }
    )+};
}
