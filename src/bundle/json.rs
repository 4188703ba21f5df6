//! JSON artefacts: pretty, keys in the structs' order, shortest round-trip numbers, and never a
//! number that is not one.

use std::fmt::Display;

use serde::ser::{self, Serialize, Serializer};

/// Why a value has no JSON.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum JsonError {
    /// A NaN or an infinity; JSON would silently say `null`.
    #[error("{key} is not a finite number")]
    NotFinite {
        /// Its place, such as `path[3].currents_a[0]`.
        key: String,
    },
    /// The value cannot be serialised at all.
    #[error("{0}")]
    Other(String),
}

/// The value as pretty JSON with a final newline.
///
/// # Errors
/// [`JsonError::NotFinite`] names the key.
pub fn to_json<T: Serialize + ?Sized>(value: &T) -> Result<Vec<u8>, JsonError> {
    value.serialize(Finite {
        key: &mut String::new(),
    })?;
    let mut text =
        serde_json::to_vec_pretty(value).map_err(|error| JsonError::Other(error.to_string()))?;
    text.push(b'\n');
    Ok(text)
}

/// The fault in JSON that was read. It may quote a text of any length: the middle of a long
/// message is left out, its end names line and column.
pub(crate) fn fault(error: &serde_json::Error) -> String {
    const HALF: usize = 400;
    let text = error.to_string();
    let count = text.chars().count();
    if count <= 2 * HALF {
        return text;
    }
    let start: String = text.chars().take(HALF).collect();
    let end: String = text.chars().skip(count - HALF).collect();
    format!("{start} ... {end}")
}

impl ser::Error for JsonError {
    fn custom<T: Display>(message: T) -> Self {
        Self::Other(message.to_string())
    }
}

/// Walks a value and stops at the first number that is not finite; keeps the key it is at.
struct Finite<'a> {
    key: &'a mut String,
}

/// The parts of a sequence or struct.
struct Parts<'a> {
    key: &'a mut String,
    /// Length of the container's own key.
    own: usize,
    index: usize,
}

impl<'a> Finite<'a> {
    fn parts(self) -> Parts<'a> {
        Parts {
            own: self.key.len(),
            key: self.key,
            index: 0,
        }
    }
}

impl Parts<'_> {
    fn item<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), JsonError> {
        use std::fmt::Write;
        // Writing to a string cannot fail.
        let _ = write!(self.key, "[{}]", self.index);
        self.index += 1;
        self.finish(value)
    }

    fn enter(&mut self, name: &str) {
        if self.own > 0 {
            self.key.push('.');
        }
        self.key.push_str(name);
    }

    fn finish<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), JsonError> {
        value.serialize(Finite { key: self.key })?;
        self.key.truncate(self.own);
        Ok(())
    }
}

macro_rules! accept {
    ($($method:ident: $type:ty),*) => {$(
        fn $method(self, _: $type) -> Result<(), JsonError> {
            Ok(())
        }
    )*};
}

macro_rules! containers {
    ($($trait:ident :: $method:ident),*) => {$(
        impl ser::$trait for Parts<'_> {
            type Ok = ();
            type Error = JsonError;
            fn $method<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), JsonError> {
                self.item(value)
            }
            fn end(self) -> Result<(), JsonError> {
                Ok(())
            }
        }
    )*};
}

macro_rules! structs {
    ($($trait:ident),*) => {$(
        impl ser::$trait for Parts<'_> {
            type Ok = ();
            type Error = JsonError;
            fn serialize_field<T: Serialize + ?Sized>(
                &mut self,
                name: &'static str,
                value: &T,
            ) -> Result<(), JsonError> {
                self.enter(name);
                self.finish(value)
            }
            fn end(self) -> Result<(), JsonError> {
                Ok(())
            }
        }
    )*};
}

containers!(
    SerializeSeq::serialize_element,
    SerializeTuple::serialize_element,
    SerializeTupleStruct::serialize_field,
    SerializeTupleVariant::serialize_field
);
structs!(SerializeStruct, SerializeStructVariant);

impl ser::SerializeMap for Parts<'_> {
    type Ok = ();
    type Error = JsonError;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), JsonError> {
        let name =
            serde_json::to_value(key).map_err(|error| JsonError::Other(error.to_string()))?;
        self.enter(name.as_str().unwrap_or("?"));
        Ok(())
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), JsonError> {
        self.finish(value)
    }

    fn end(self) -> Result<(), JsonError> {
        Ok(())
    }
}

impl<'a> Serializer for Finite<'a> {
    type Ok = ();
    type Error = JsonError;
    type SerializeSeq = Parts<'a>;
    type SerializeTuple = Parts<'a>;
    type SerializeTupleStruct = Parts<'a>;
    type SerializeTupleVariant = Parts<'a>;
    type SerializeMap = Parts<'a>;
    type SerializeStruct = Parts<'a>;
    type SerializeStructVariant = Parts<'a>;

    accept!(
        serialize_bool: bool, serialize_i8: i8, serialize_i16: i16, serialize_i32: i32,
        serialize_i64: i64, serialize_u8: u8, serialize_u16: u16, serialize_u32: u32,
        serialize_u64: u64, serialize_char: char, serialize_str: &str, serialize_bytes: &[u8],
        serialize_unit_struct: &'static str
    );

    fn serialize_f32(self, value: f32) -> Result<(), JsonError> {
        self.serialize_f64(f64::from(value))
    }

    fn serialize_f64(self, value: f64) -> Result<(), JsonError> {
        if value.is_finite() {
            Ok(())
        } else {
            Err(JsonError::NotFinite {
                key: self.key.clone(),
            })
        }
    }

    fn serialize_none(self) -> Result<(), JsonError> {
        Ok(())
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<(), JsonError> {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Result<(), JsonError> {
        Ok(())
    }

    fn serialize_unit_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
    ) -> Result<(), JsonError> {
        Ok(())
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        value: &T,
    ) -> Result<(), JsonError> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        name: &'static str,
        value: &T,
    ) -> Result<(), JsonError> {
        let mut parts = self.parts();
        parts.enter(name);
        parts.finish(value)
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<Parts<'a>, JsonError> {
        Ok(self.parts())
    }

    fn serialize_tuple(self, _: usize) -> Result<Parts<'a>, JsonError> {
        Ok(self.parts())
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<Parts<'a>, JsonError> {
        Ok(self.parts())
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Parts<'a>, JsonError> {
        Ok(self.parts())
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Parts<'a>, JsonError> {
        Ok(self.parts())
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Parts<'a>, JsonError> {
        Ok(self.parts())
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        _: &'static str,
        _: usize,
    ) -> Result<Parts<'a>, JsonError> {
        Ok(self.parts())
    }
}

/// Serialises a path as text; one that is no text as nearly as it can be.
///
/// # Errors
/// The serialiser's.
pub fn displayed<S: Serializer>(path: &std::path::Path, out: S) -> Result<S::Ok, S::Error> {
    out.collect_str(&path.display())
}

#[cfg(test)]
mod tests {
    use super::{JsonError, fault, to_json};
    use serde::Serialize;
    use std::collections::BTreeMap;

    #[derive(Serialize)]
    struct Step {
        lambda_n_per_m: Option<f64>,
        currents_a: Vec<f64>,
    }

    #[test]
    fn names_the_key_that_is_not_finite() {
        let mut path = BTreeMap::new();
        path.insert(
            "steps",
            vec![
                Step {
                    lambda_n_per_m: None,
                    currents_a: vec![0.7, 1.3],
                },
                Step {
                    lambda_n_per_m: Some(5.9),
                    currents_a: vec![0.7, f64::NAN],
                },
            ],
        );
        let key = "steps[1].currents_a[1]".to_owned();
        assert_eq!(to_json(&path), Err(JsonError::NotFinite { key }));
        let step = Step {
            lambda_n_per_m: Some(f64::INFINITY),
            currents_a: vec![],
        };
        let key = "lambda_n_per_m".to_owned();
        assert_eq!(to_json(&step), Err(JsonError::NotFinite { key }));
    }

    #[test]
    fn writes_shortest_round_trip_numbers_and_null() {
        let step = Step {
            lambda_n_per_m: None,
            currents_a: vec![0.1 + 0.2],
        };
        let text = String::from_utf8(to_json(&step).unwrap()).unwrap();
        assert_eq!(
            text,
            "{\n  \"lambda_n_per_m\": null,\n  \"currents_a\": [\n    0.30000000000000004\n  ]\n}\n"
        );
    }

    #[test]
    fn a_message_that_quotes_a_long_text_is_cut_in_its_middle() {
        let long = format!("\n\"{}\"", "a.".repeat(60_000));
        let reported = fault(&serde_json::from_str::<u8>(&long).unwrap_err());
        assert!(reported.len() < 900 && reported.starts_with("invalid type: string"));
        assert!(
            reported.ends_with("expected u8 at line 2 column 120002"),
            "{reported}"
        );
        let short = serde_json::from_str::<u8>("\"a\"").unwrap_err();
        assert_eq!(fault(&short), short.to_string());
    }
}
