//! Joint trees: kinematics in spatial coordinates, and their reverse.
//!
//! With joint columns Ŝ (twists about the world origin, moving with the parent) the fields over the bodies are
//!
//! ```text
//! twist      V_b = V_p + Ŝ_b v̂_b
//! virtual    Z_b = Z_p + Ŝ_b ẑ_b
//! turning    D_b = D_p + V_p × (Ŝ_b ẑ_b)                 rate of Z at constant ẑ
//! bias       C_b = C_p + V_p × (Ŝ_b v̂_b) + Ŝ_b (Ẋ v)_b   rate of V at constant v
//! ```
//!
//! and [`Tree::reverse`] is the transpose of all four at once, to coordinates and velocities. No
//! engine that assumes inertia to be (mass, 3 × 3) is used: added mass is a full 6 × 6 and couples bodies. Where none feels another,
//! [`Articulated`] solves for accelerations at a cost linear in the bodies.

mod articulated;
mod charts;
mod fields;
mod joint;
mod joint_blocks;
mod tree;

pub use articulated::{Articulated, Indefinite};
pub use fields::{Cotangents, Fields, Virtual};
pub use joint::{Joint, JointModel, JointMotion, Plane, Refused};
pub use joint_blocks::JointBlocks;
pub use tree::{Kinematics, Link, Tree};
