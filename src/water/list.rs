//! Lists of choices: an enum that names them, and what each does.

/// An enum of named choices, each with the object that does what it says. A choice is one line here.
macro_rules! listed {
    (
        $(#[$meta:meta])*
        pub enum $name:ident as $kind:ident {
            $($(#[$variant_meta:meta])* $variant:ident => $object:expr,)*
        }
    ) => {
        choices! {
            $(#[$meta])*
            pub enum $name {
                $($(#[$variant_meta])* $variant,)*
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.into())
            }
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
