//! Enums that users choose from: what all of them can do, declared once.

/// An enum of named choices: in files and on the command line by its variants' names in kebab case, listed with their
/// documentation (`strum::VariantArray`, `strum::EnumMessage`), and read from a name (`FromStr`).
macro_rules! choices {
    ($(#[$meta:meta])* $visibility:vis enum $name:ident { $($body:tt)* }) => {
        $(#[$meta])*
        #[derive(
            Clone,
            Copy,
            Debug,
            Default,
            PartialEq,
            Eq,
            serde::Serialize,
            serde::Deserialize,
            strum::EnumMessage,
            strum::EnumString,
            strum::IntoStaticStr,
            strum::VariantArray,
        )]
        #[serde(rename_all = "kebab-case")]
        #[strum(serialize_all = "kebab-case")]
        $visibility enum $name { $($body)* }
    };
}
