//! Lists of choices: an enum that names them, and what each does.

/// An enum of named choices, each with the object that does what it says. A choice is one line here.
macro_rules! listed {
    (
        $(#[$meta:meta])*
        pub enum $name:ident as $kind:ident {
            $($(#[$variant_meta:meta])* $variant:ident => $object:expr,)*
        }
    ) => {
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
            strum::Display,
            strum::EnumMessage,
            strum::EnumString,
            strum::IntoStaticStr,
            strum::VariantArray,
        )]
        #[serde(rename_all = "kebab-case")]
        #[strum(serialize_all = "kebab-case")]
        pub enum $name {
            $($(#[$variant_meta])* $variant,)*
        }

        impl $name {
            /// What does it.
            pub(crate) fn kind(self) -> &'static dyn $kind {
                match self {
                    $(Self::$variant => &$object,)*
                }
            }
        }
    };
}

pub(crate) use listed;
