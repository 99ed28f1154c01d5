//! What holds for whatever scene: symmetry and definiteness of the added mass, momentum and energy that are kept, scales, frames, mirrors, the
//! order of bodies, and bits that don't depend on the number of threads; on scenes drawn by chance.
//!
//! `PROPTEST_CASES=1000 cargo test --release --test properties` draws more of them. Tolerances are those of rounding where a property is one of
//! the discrete equations, and of the compression where bodies are compressed from points that don't turn with them.

mod invariance;
mod kept;
mod matrix;
mod scenes;
