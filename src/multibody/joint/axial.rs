//! Translation along an axis, rotation about it, and both at once on a screw thread.

use super::{JointMotion, Refused};
use crate::adjoint::lie::{Mat3, Pose, Vec3, Vec6, exp_matrix, six, unit};
use std::f64::consts::TAU;

#[derive(Debug)]
pub(super) enum Axial {
    Prismatic(Axis),
    Revolute(Axis),
    /// With the advance in one revolution, m.
    Screw(Axis, f64),
}

/// An axis through the frame's origin as it was given, and of unit length.
#[derive(Debug)]
pub(super) struct Axis {
    given: [f64; 3],
    unit: Vec3,
}

impl Axis {
    pub fn new(given: [f64; 3]) -> Self {
        Self {
            given,
            unit: unit(&Vec3::from(given)),
        }
    }
}

impl Axial {
    fn axis(&self) -> &Axis {
        match self {
            Self::Prismatic(axis) | Self::Revolute(axis) | Self::Screw(axis, _) => axis,
        }
    }
}

impl JointMotion for Axial {
    fn kind(&self) -> &'static str {
        match self {
            Self::Prismatic(_) => "prismatic",
            Self::Revolute(_) => "revolute",
            Self::Screw(..) => "screw",
        }
    }

    fn coordinate_labels(&self) -> &'static [&'static str] {
        match self {
            Self::Prismatic(_) => &["position"],
            _ => &["angle"],
        }
    }

    fn velocity_labels(&self) -> &'static [&'static str] {
        match self {
            Self::Prismatic(_) => &["velocity"],
            _ => &["rate"],
        }
    }

    fn basis(&self) -> Vec<Vec6> {
        let (unit, zero) = (&self.axis().unit, &Vec3::zeros());
        vec![match self {
            Self::Prismatic(_) => six(unit, zero),
            Self::Revolute(_) => six(zero, unit),
            Self::Screw(_, pitch) => six(&(pitch / TAU * unit), unit),
        }]
    }

    fn pose(&self, q: &[f64]) -> Pose {
        let moved = q[0] * self.axis().unit;
        match self {
            Self::Prismatic(_) => Pose::new(Mat3::identity(), moved),
            Self::Revolute(_) => Pose::new(exp_matrix(&moved), Vec3::zeros()),
            Self::Screw(_, pitch) => Pose::new(exp_matrix(&moved), pitch / TAU * moved),
        }
    }

    fn refused(&self) -> Option<Refused> {
        let given = self.axis().given;
        let (field, given, remedy) = match self {
            _ if given.iter().any(|x| !x.is_finite()) => {
                ("axis", format!("{given:?}"), "give finite numbers")
            }
            _ if given == [0.0; 3] => (
                "axis",
                format!("{given:?}"),
                "give a direction, e.g. [0, 0, 1]; its length doesn't matter",
            ),
            Self::Screw(_, pitch) if !pitch.is_finite() => (
                "pitch",
                pitch.to_string(),
                "give the advance in one revolution, in m; negative for a left-handed thread",
            ),
            _ => return None,
        };
        Some(Refused {
            field,
            given,
            remedy,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{Axis, Vec3};

    #[test]
    fn lengths_of_axes_play_no_part() {
        for length in [1e-300, 1e-160, 1.0, 1e160, 1e300] {
            let axis = Axis::new([0.0, 3.0 * length, -4.0 * length]);
            assert!(
                (axis.unit - Vec3::new(0.0, 0.6, -0.8)).norm() < 1e-15,
                "{length}"
            );
        }
    }
}
