//! Joints, one file each; those with an axis share one.
//!
//! To add one: a file with its type and [`JointMotion`], and its entry in the list below, from which its variant of
//! [`Joint`], its keys in scene files and its place everywhere else follow.

mod axial;
mod fixed;
mod free;
mod model;
mod planar;
mod spherical;

pub use model::JointModel;
pub use planar::Plane;

use crate::adjoint::lie::{Pose, Vec6};
use axial::{Axial, Axis};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Declares the joints: variants of [`Joint`] as users write them, each with the motion that it stands for.
macro_rules! joints {
    ($($(#[$about:meta])* $name:ident $({ $($(#[$what:meta])* $field:ident: $type:ty),* })? => $motion:expr;)*) => {
        /// How a body moves against its parent (coordinates q, generalised velocity v).
        #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[serde(from = "JointFile", into = "JointFile")]
        pub enum Joint {
            $($(#[$about])* $name $({ $($(#[$what])* $field: $type),* })?,)*
        }

        /// [`Joint`] with braces on every variant: serde accepts stray keys beside a unit variant of an
        /// internally tagged enum, and refuses them beside an empty struct variant.
        #[derive(Serialize, Deserialize)]
        #[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
        enum JointFile {
            $($name { $($($field: $type),*)? },)*
        }

        impl From<JointFile> for Joint {
            fn from(joint: JointFile) -> Self {
                match joint {
                    $(JointFile::$name { $($($field),*)? } => Joint::$name $({ $($field),* })?,)*
                }
            }
        }

        impl From<Joint> for JointFile {
            fn from(joint: Joint) -> Self {
                match joint {
                    $(Joint::$name $({ $($field),* })? => JointFile::$name { $($($field),*)? },)*
                }
            }
        }

        impl Joint {
            /// The motion that it stands for.
            pub fn model(&self) -> JointModel {
                match *self {
                    $(Joint::$name $({ $($field),* })? => JointModel::new($motion),)*
                }
            }
        }
    };
}

joints! {
    /// Not at all.
    Fixed => fixed::Fixed;
    /// Along an axis: q, v in m, m/s.
    Prismatic {
        /// Direction in the joint's frame; need not be of unit length.
        axis: [f64; 3]
    } => Axial::Prismatic(Axis::new(axis));
    /// About an axis: q, v in rad, rad/s.
    Revolute {
        /// Direction in the joint's frame.
        axis: [f64; 3]
    } => Axial::Revolute(Axis::new(axis));
    /// About an axis with an advance along it, as a nut on its thread: q, v in rad, rad/s.
    Screw {
        /// Direction in the joint's frame; need not be of unit length.
        axis: [f64; 3],
        /// Advance along the axis in one revolution, m; negative for a left-handed thread.
        pitch: f64
    } => Axial::Screw(Axis::new(axis), pitch);
    /// In a plane of the joint's frame: two translations, then the rotation about its normal.
    Planar {
        /// The plane.
        plane: Plane
    } => planar::Planar::new(plane);
    /// About a point: q a unit quaternion (w, x, y, z), v the angular velocity in the parent's frame.
    Spherical => spherical::Spherical;
    /// Freely: q = position of the body's origin and unit quaternion (w, x, y, z), v = velocity
    /// of the body's origin and angular velocity, all in the parent's (joint's) frame.
    #[default]
    Free => free::Free;
}

impl Joint {
    /// Number of coordinates q: 1 for an axis, 3 in a plane, 4 (unit quaternion) about a point, 7 (position, unit quaternion) free.
    pub fn coordinates(&self) -> usize {
        self.coordinate_labels().len()
    }

    /// Number of generalised velocities v.
    pub fn velocities(&self) -> usize {
        self.velocity_labels().len()
    }

    /// The joint's name in a scene file.
    pub fn kind(&self) -> &'static str {
        self.model().kind()
    }

    /// Whether q has unit quaternions, so that v is not its rate.
    pub fn has_quaternion(&self) -> bool {
        self.model().quaternion_at().is_some()
    }

    /// Short names of the coordinates q, for tables.
    pub fn coordinate_labels(&self) -> &'static [&'static str] {
        self.model().coordinate_labels()
    }

    /// Short names of the generalised velocities v, for tables.
    pub fn velocity_labels(&self) -> &'static [&'static str] {
        self.model().velocity_labels()
    }

    /// Coordinates of the joint at its origin: zero, with identity quaternions.
    pub fn origin(&self) -> Vec<f64> {
        self.model().origin()
    }
}

/// What is wrong with a joint as it was given: the field, what stands there, what to write instead.
#[derive(Clone, Debug)]
pub struct Refused {
    /// Field of the joint.
    pub field: &'static str,
    /// What stands there.
    pub given: String,
    /// What to do.
    pub remedy: &'static str,
}

/// The motions of one kind of joint: a subgroup of the rigid motions, with a constant basis of twists in the joint's own frame.
///
/// Coordinates are translations, angles, and at most one unit quaternion, in place of which the velocities have an angular velocity.
/// The maps of `X(q)` (see [`JointModel`]) are the identity where a joint doesn't give them.
pub trait JointMotion: fmt::Debug + Send + Sync + 'static {
    /// Name in a scene file.
    fn kind(&self) -> &'static str;

    /// Short names of the coordinates q.
    fn coordinate_labels(&self) -> &'static [&'static str];

    /// Short names of the generalised velocities v.
    fn velocity_labels(&self) -> &'static [&'static str];

    /// Basis of the joint's twists about its frame's origin, constant.
    fn basis(&self) -> Vec<Vec6>;

    /// Pose of the body in the joint's frame at coordinates `q`.
    fn pose(&self, q: &[f64]) -> Pose;

    /// What is wrong with it as it was given, if anything is.
    fn refused(&self) -> Option<Refused> {
        None
    }

    /// Index of a unit quaternion's w in q; the angular velocity has the same one in v.
    fn quaternion_at(&self) -> Option<usize> {
        None
    }

    /// Whether X(q) is anything but the identity.
    fn has_frame_map(&self) -> bool {
        false
    }

    /// Frame velocity `v̂ = X(q) v`.
    fn frame_velocity(&self, _q: &[f64], v: &[f64]) -> Vec<f64> {
        v.to_vec()
    }

    /// `v = X(q)⁻¹ v̂`.
    fn frame_velocity_inverse(&self, _q: &[f64], hat: &[f64]) -> Vec<f64> {
        hat.to_vec()
    }

    /// Generalised momentum or force `p = X(q)ᵀ p̂`.
    fn frame_momentum_transpose(&self, _q: &[f64], hat: &[f64]) -> Vec<f64> {
        hat.to_vec()
    }

    /// Frame momentum or force `p̂ = X(q)⁻ᵀ p`.
    fn frame_momentum(&self, _q: &[f64], p: &[f64]) -> Vec<f64> {
        p.to_vec()
    }

    /// Gradient of `v̂̄ · X(q) v` over the tangent space of q. That of `v̂ᵀ X⁻ᵀ p` (see [`JointMotion::frame_momentum`]) is its
    /// negative with `X⁻¹ v̂` as velocity and `X⁻ᵀ p` as cotangent.
    fn frame_velocity_vjp(&self, v: &[f64], _hat_bar: &[f64]) -> Vec<f64> {
        vec![0.0; v.len()]
    }

    /// Rate of the frame velocity at constant `v`: `Ẋ v` along `v` itself.
    fn frame_bias(&self, v: &[f64]) -> Vec<f64> {
        vec![0.0; v.len()]
    }

    /// Cotangent of `v` of [`JointMotion::frame_bias`].
    fn frame_bias_vjp(&self, v: &[f64], _bar: &[f64]) -> Vec<f64> {
        vec![0.0; v.len()]
    }
}
