//! Scenes: files, what is refused and how that is said, and the example scenes.

mod api_input;
#[cfg(feature = "urdf")]
mod drives;
mod examples;
mod input;
#[cfg(feature = "urdf")]
mod mjcf;
#[cfg(feature = "urdf")]
mod mjcf_text;
#[cfg(feature = "urdf")]
mod robots;
#[cfg(feature = "urdf")]
mod robots_told;
mod tradeoff;
mod validate;

#[path = "../support/mod.rs"]
mod support;
