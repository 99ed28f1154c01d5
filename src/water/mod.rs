//! The water of a scene: by which method each body is solved, with which fidelity they are coupled, on which device, and
//! how near they may come.

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

pub(crate) mod backend;
mod choices;
mod clearance;
mod device;
mod estimate;
mod exchange;
mod fidelity;
#[cfg(test)]
mod film_limits;
mod flow_surface;
mod gap_error;
mod gap_model;
#[cfg(test)]
mod lubrication_limits;
mod method;
mod numerics;
mod prepared;
mod products;
mod resolved;
mod shape;
mod submerged;
mod surface;
mod too_coarse;

pub use backend::{AdapterName, Arithmetic, Backend, BackendReport, DeviceReport, GpuSettings};
pub use choices::WaterChoices;
pub(crate) use choices::surfaces;
pub use estimate::{ErrorEstimate, Level};
pub use exchange::Exchange;
pub use fidelity::{Fidelity, Knob};
pub use gap_error::{Carried, GapError};
pub use method::Method;
pub use numerics::Numerics;
pub use submerged::Discretisation;

pub(crate) use clearance::Clearance;
pub(crate) use estimate::Subject;
pub(crate) use flow_surface::FlowSurface;
pub(crate) use prepared::{Prepared, own_added_mass, prepare, world_axes};
pub(crate) use shape::ShapeChange;
pub(crate) use submerged::in_water;
pub(crate) use surface::{Surface, pose};
pub(crate) use too_coarse::too_coarse;
