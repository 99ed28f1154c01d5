//! Values of flags that are choices from a list: names and help come from the list itself.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::str::FromStr;
use strum::{EnumMessage, VariantArray};

/// A list of named choices.
pub(super) trait Choice:
    VariantArray
    + EnumMessage
    + FromStr<Err: std::error::Error + Send + Sync>
    + Into<&'static str>
    + Copy
{
}

impl<T> Choice for T where
    T: VariantArray
        + EnumMessage
        + FromStr<Err: std::error::Error + Send + Sync>
        + Into<&'static str>
        + Copy
{
}

/// Parser of a choice; it tells each choice's documentation in the help.
pub(super) fn choice<T: Choice + Clone + Send + Sync + 'static>() -> impl TypedValueParser<Value = T>
{
    PossibleValuesParser::new(T::VARIANTS.iter().map(possible)).try_map(|name| name.parse())
}

fn possible<T: Choice>(of: &T) -> PossibleValue {
    let help = of.get_documentation().unwrap_or_default();
    let words: Vec<&str> = help.split_whitespace().collect();
    PossibleValue::new((*of).into()).help(words.join(" ").trim_end_matches('.').to_string())
}
