//! Tendons over joints.

use super::super::is_default;
use super::{Force, Scene, number};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A tendon, or a pair of them, that runs over joints at fixed lever arms r and is pulled by a control u, as a crank does: a spring of the sum Σ r q,
///
/// ```text
/// T = k (g u − Σ r q) − c Σ r q̇        τ_i = r_i T
/// ```
///
/// It pulls and pushes, as two tendons against one another do. The joints share one tension: what bends where is left to them, their springs and the water.
///
/// ```
/// use hydrograd::scene::{Body, Fluid, Joint, Scene, Shape, Tendon};
///
/// let mut scene = Scene::new(Fluid::fresh_water());
/// let axis = [0.0, 0.0, 1.0];
/// scene.add(Body::new(Shape::sphere(0.1)).named("tail").density(1000.0).joint(Joint::Revolute { axis }));
/// scene.add_force(Tendon::new([("tail", 0.04)]).named("crank").stiffness(4000.0).damping(2.0).into());
/// assert_eq!(scene.control_labels(), ["crank"]);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tendon {
    /// Name, unique in the scene, also of its control; default: "tendon" and its number among the forces.
    pub name: Option<String>,
    /// Lever arms by the bodies whose joints it runs over, m/rad, or of a joint that slides 1; each has one coordinate.
    pub arms: BTreeMap<String, f64>,
    /// k, N/m.
    pub stiffness: f64,
    /// c, N s/m.
    #[serde(default, skip_serializing_if = "is_default")]
    pub damping: f64,
    /// g: what the control is multiplied by, the radius of a crank whose sine is the control say, m.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub gain: f64,
}

fn one() -> f64 {
    1.0
}

fn is_one(value: &f64) -> bool {
    *value == one()
}

impl Tendon {
    /// Over the joints of these bodies, each with its lever arm; it still needs a stiffness.
    pub fn new<B: Into<String>>(arms: impl IntoIterator<Item = (B, f64)>) -> Self {
        Self {
            name: None,
            arms: arms.into_iter().map(|(b, r)| (b.into(), r)).collect(),
            stiffness: 0.0,
            damping: 0.0,
            gain: one(),
        }
    }
}

setters! { Tendon {
    /// Name, unique in the scene, also of its control.
    named(name: impl Into<String>) => name = Some(name.into());
    /// k, N/m.
    stiffness(stiffness: f64) => stiffness = stiffness;
    /// c, N s/m.
    damping(damping: f64) => damping = damping;
    /// g.
    gain(gain: f64) => gain = gain;
} }

impl From<Tendon> for Force {
    fn from(tendon: Tendon) -> Self {
        Force::Tendon(tendon)
    }
}

impl Tendon {
    /// Checks all that doesn't need the meshes; `place` names a field.
    pub(super) fn check(&self, scene: &Scene, place: &dyn Fn(&str) -> String) -> Result<()> {
        if self.arms.is_empty() {
            let remedy = "give the bodies whose joints it runs over, each with its lever arm in m";
            return Err(Error::input(place("arms"), "none", remedy));
        }
        for (name, arm) in &self.arms {
            let at = place(&format!("arms.{name}"));
            let body = &scene.bodies[scene.named_body(name, at.clone())?.0];
            if let Some(mimic) = &body.mimic {
                let given = format!("{name:?}, whose joint follows that of {:?}", mimic.body);
                let remedy = format!(
                    "it has no coordinate of its own: give {:?} that arm times the ratio, {} m",
                    mimic.body,
                    arm * mimic.ratio
                );
                return Err(Error::input(at, given, remedy));
            }
            if body.joint.coordinates() != 1 {
                return Err(Error::input(
                    at,
                    format!("a {} joint", body.joint.kind()),
                    "a tendon runs over joints with one coordinate of their own, such as revolute ones",
                ));
            }
            number(at, *arm, true, "give a finite lever arm, in m")?;
        }
        if !(self.stiffness > 0.0 && self.stiffness.is_finite()) {
            let remedy = "give a stiffness above zero, in N/m";
            return Err(Error::input(place("stiffness"), self.stiffness, remedy));
        }
        let slowing = "give zero or more, in N s/m";
        number(place("damping"), self.damping, false, slowing)?;
        number(place("gain"), self.gain, true, "give a finite number")
    }
}
