//! Joint dimensions, and the joint as it stands in a scene file.

use serde::{Deserialize, Serialize};

use super::{Body, Joint, Plane, Scene};

impl Joint {
    /// Number of coordinates q: 0, 1, 1, 3, 4 (unit quaternion), 7 (position, unit quaternion).
    pub fn coordinates(&self) -> usize {
        match self {
            Joint::Fixed => 0,
            Joint::Prismatic { .. } | Joint::Revolute { .. } => 1,
            Joint::Planar { .. } => 3,
            Joint::Spherical => 4,
            Joint::Free => 7,
        }
    }

    /// Number of generalised velocities v: 0, 1, 1, 3, 3, 6.
    pub fn velocities(&self) -> usize {
        match self {
            Joint::Fixed => 0,
            Joint::Prismatic { .. } | Joint::Revolute { .. } => 1,
            Joint::Planar { .. } | Joint::Spherical => 3,
            Joint::Free => 6,
        }
    }

    /// The joint's name in a scene file.
    pub fn kind(&self) -> &'static str {
        match self {
            Joint::Fixed => "fixed",
            Joint::Prismatic { .. } => "prismatic",
            Joint::Revolute { .. } => "revolute",
            Joint::Planar { .. } => "planar",
            Joint::Spherical => "spherical",
            Joint::Free => "free",
        }
    }

    /// Whether q has unit quaternions, so that v is not its rate.
    pub fn has_quaternion(&self) -> bool {
        matches!(self, Joint::Spherical | Joint::Free)
    }

    /// Index of the quaternion's w in the joint's q.
    pub(crate) fn quaternion_at(&self) -> Option<usize> {
        match self {
            Joint::Spherical => Some(0),
            Joint::Free => Some(3),
            _ => None,
        }
    }

    /// Short names of the coordinates q, for tables.
    pub fn coordinate_labels(&self) -> &'static [&'static str] {
        match self {
            Joint::Fixed => &[],
            Joint::Prismatic { .. } => &["position"],
            Joint::Revolute { .. } => &["angle"],
            Joint::Planar { plane } => match plane {
                Plane::Yz => &["y", "z", "angle"],
                Plane::Zx => &["z", "x", "angle"],
                Plane::Xy => &["x", "y", "angle"],
            },
            Joint::Spherical => &["qw", "qx", "qy", "qz"],
            Joint::Free => &["x", "y", "z", "qw", "qx", "qy", "qz"],
        }
    }

    /// Short names of the generalised velocities v, for tables.
    pub fn velocity_labels(&self) -> &'static [&'static str] {
        match self {
            Joint::Fixed => &[],
            Joint::Prismatic { .. } => &["velocity"],
            Joint::Revolute { .. } => &["rate"],
            Joint::Planar { plane } => match plane {
                Plane::Yz => &["vy", "vz", "rate"],
                Plane::Zx => &["vz", "vx", "rate"],
                Plane::Xy => &["vx", "vy", "rate"],
            },
            Joint::Spherical => &["wx", "wy", "wz"],
            Joint::Free => &["vx", "vy", "vz", "wx", "wy", "wz"],
        }
    }

    /// Coordinates of the joint at its origin: zero, with identity quaternions.
    pub fn origin(&self) -> Vec<f64> {
        let mut q = vec![0.0; self.coordinates()];
        if let Some(w) = self.quaternion_at() {
            q[w] = 1.0;
        }
        q
    }
}

impl Body {
    /// Whether the joint's motion is given: driven by `motion`, or locked.
    pub fn is_prescribed(&self) -> bool {
        self.motion.is_some() || self.locked
    }

    /// Number of controls of this body: the velocities of an actuated joint, six for a thruster.
    pub fn controls(&self) -> usize {
        let joint = if self.actuated {
            self.joint.velocities()
        } else {
            0
        };
        joint + if self.thruster { 6 } else { 0 }
    }
}

impl Scene {
    /// Number of joint coordinates q of all bodies, those of driven and locked joints included.
    pub fn coordinates(&self) -> usize {
        self.bodies.iter().map(|b| b.joint.coordinates()).sum()
    }

    /// Number of generalised velocities v of all bodies, those of driven and locked joints included.
    pub fn velocities(&self) -> usize {
        self.bodies.iter().map(|b| b.joint.velocities()).sum()
    }

    /// Number of controls a step takes.
    pub fn controls(&self) -> usize {
        self.bodies.iter().map(Body::controls).sum()
    }

    /// Names of the entries of q: `coin.y`, `coin.z`, `coin.angle`, …
    pub fn coordinate_labels(&self) -> Vec<String> {
        self.labels(Joint::coordinate_labels)
    }

    /// Names of the entries of v: `coin.vy`, `coin.vz`, `coin.rate`, …
    pub fn velocity_labels(&self) -> Vec<String> {
        self.labels(Joint::velocity_labels)
    }

    fn labels(&self, of: impl Fn(&Joint) -> &'static [&'static str]) -> Vec<String> {
        let each = self.bodies.iter();
        each.flat_map(|body| {
            let labels = of(&body.joint).iter();
            labels.map(move |label| format!("{}.{label}", body.name))
        })
        .collect()
    }
}

/// [`Joint`] with braces on every variant: serde accepts stray keys beside a unit variant of an
/// internally tagged enum, and refuses them beside an empty struct variant.
#[derive(Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub(super) enum JointFile {
    Fixed {},
    Prismatic { axis: [f64; 3] },
    Revolute { axis: [f64; 3] },
    Planar { plane: Plane },
    Spherical {},
    Free {},
}

impl From<JointFile> for Joint {
    fn from(joint: JointFile) -> Self {
        match joint {
            JointFile::Fixed {} => Joint::Fixed,
            JointFile::Prismatic { axis } => Joint::Prismatic { axis },
            JointFile::Revolute { axis } => Joint::Revolute { axis },
            JointFile::Planar { plane } => Joint::Planar { plane },
            JointFile::Spherical {} => Joint::Spherical,
            JointFile::Free {} => Joint::Free,
        }
    }
}

impl From<Joint> for JointFile {
    fn from(joint: Joint) -> Self {
        match joint {
            Joint::Fixed => JointFile::Fixed {},
            Joint::Prismatic { axis } => JointFile::Prismatic { axis },
            Joint::Revolute { axis } => JointFile::Revolute { axis },
            Joint::Planar { plane } => JointFile::Planar { plane },
            Joint::Spherical => JointFile::Spherical {},
            Joint::Free => JointFile::Free {},
        }
    }
}
