//! What is wrong with values that are read, as serde tells it.

use serde::de::value::{MapDeserializer, SeqDeserializer};
use serde::de::{Deserializer, Error, IntoDeserializer, Visitor};
use serde::forward_to_deserialize_any;
use std::fmt;
use toml::Value;

/// What is wrong with a value.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Problem {
    UnknownKey {
        key: String,
        known: &'static [&'static str],
    },
    UnknownChoice {
        name: String,
        known: &'static [&'static str],
    },
    Missing {
        key: &'static str,
    },
    /// In serde's words.
    Other(String),
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self:?}")
    }
}

impl std::error::Error for Problem {}

impl Error for Problem {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self::Other(message.to_string())
    }

    fn unknown_field(field: &str, known: &'static [&'static str]) -> Self {
        Self::UnknownKey {
            key: field.into(),
            known,
        }
    }

    fn unknown_variant(variant: &str, known: &'static [&'static str]) -> Self {
        Self::UnknownChoice {
            name: variant.into(),
            known,
        }
    }

    fn missing_field(key: &'static str) -> Self {
        Self::Missing { key }
    }
}

/// Reads a TOML value with [`Problem`] for what is wrong.
pub(super) struct Reader(pub Value);

impl IntoDeserializer<'_, Problem> for Reader {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> Deserializer<'de> for Reader {
    type Error = Problem;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
        match self.0 {
            Value::String(x) => visitor.visit_string(x),
            Value::Integer(x) => visitor.visit_i64(x),
            Value::Float(x) => visitor.visit_f64(x),
            Value::Boolean(x) => visitor.visit_bool(x),
            Value::Datetime(x) => visitor.visit_string(x.to_string()),
            Value::Array(items) => {
                let mut items = SeqDeserializer::new(items.into_iter().map(Reader));
                let out = visitor.visit_seq(&mut items)?;
                items.end().map(|()| out)
            }
            Value::Table(table) => {
                let pairs = table.into_iter().map(|(key, value)| (key, Reader(value)));
                let mut pairs = MapDeserializer::new(pairs);
                let out = visitor.visit_map(&mut pairs)?;
                pairs.end().map(|()| out)
            }
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Problem> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Problem> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Problem> {
        match self.0 {
            Value::String(x) => x
                .into_deserializer()
                .deserialize_enum(name, variants, visitor),
            other => Reader(other).deserialize_any(visitor),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit
        unit_struct seq tuple tuple_struct map struct identifier ignored_any
    }
}
