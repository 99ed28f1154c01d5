//! Joints that a transmission moves with others.

use super::Body;
use serde::{Deserialize, Serialize};

/// A joint with one coordinate that follows another: `q = ratio · q(leader) + offset`, by a transmission without losses. It has no coordinate, force or limit of its own:
/// the leader's generalised force and inertia have its part by the transmission's Jacobian.
///
/// ```
/// use hydrograd::scene::{Body, Fluid, Joint, Mimic, Scene, Shape};
///
/// let mut scene = Scene::new(Fluid::fresh_water());
/// let slide = Joint::Prismatic { axis: [0.0, 1.0, 0.0] };
/// let finger = || Body::new(Shape::cuboid([0.05, 0.01, 0.02])).density(1200.0).joint(slide);
/// scene.add(finger().named("left").at([0.0, 0.03, 0.0]).actuated());
/// scene.add(finger().named("right").at([0.0, -0.03, 0.0]).mimic(Mimic::new("left").ratio(-1.0)));
/// assert_eq!(scene.coordinates(), 1);
/// scene.validate()?;
/// # Ok::<(), hydrograd::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mimic {
    /// Name of the body whose joint it follows, which follows none.
    pub body: String,
    /// Its motion per motion of the leader, m or rad for m or rad.
    #[serde(default = "one")]
    pub ratio: f64,
    /// Its coordinate where the leader's is zero, m or rad.
    #[serde(default, skip_serializing_if = "super::is_default")]
    pub offset: f64,
}

fn one() -> f64 {
    1.0
}

impl Mimic {
    /// Of the joint of a body, one to one.
    pub fn new(body: impl Into<String>) -> Self {
        Self {
            body: body.into(),
            ratio: 1.0,
            offset: 0.0,
        }
    }
}

setters! { Mimic {
    /// Motion per motion of the leader.
    ratio(ratio: f64) => ratio = ratio;
    /// Coordinate where the leader's is zero, m or rad.
    offset(offset: f64) => offset = offset;
} }

setters! { Body {
    /// Lets the joint follow another.
    mimic(mimic: Mimic) => mimic = Some(mimic);
} }
