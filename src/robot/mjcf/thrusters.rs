//! Actuators of sites as thrusters: they push the body at the site, along an axis of it.

use super::Made;
use super::actuators::{Law, law};
use crate::robot::file::SiteThruster;
use mjcf_rs::extras::Actuator;
use nalgebra::Vector3;

/// Part of a moment that may be across the axis before it isn't one about it any more.
const ACROSS: f64 = 1e-9;

impl Made<'_> {
    /// Reads one, or says why not.
    pub(super) fn thruster(&mut self, actuator: &Actuator, site: &str) {
        match self.pushing(actuator, site) {
            Ok(thruster) => {
                let SiteThruster { name, push, .. } = &thruster;
                self.file.notes.push(format!(
                    "the file's actuator of site {site:?} is the thruster {name:?}, {push} N a unit of its control"
                ));
                self.file.thrusters.push(thruster);
            }
            Err(why) => {
                let note = format!("the actuator of site {site:?} isn't read: {why}");
                self.file.notes.push(note);
            }
        }
    }

    fn pushing(&self, actuator: &Actuator, site: &str) -> Result<SiteThruster, String> {
        let Some(link) = self.sites.get(site) else {
            return Err("sites of the world move nothing".into());
        };
        if !matches!(law(actuator), Law::Force) {
            return Err(
                "its force isn't a multiple of its control, as that of <motor> is".to_string(),
            );
        }
        let gain = actuator.gainprm.first().copied().unwrap_or(1.0);
        let [x, y, z, turns @ ..] = actuator.gear;
        let (force, moment) = (Vector3::new(x, y, z), Vector3::from(turns));
        let size = force.norm();
        let push = gain * size;
        if !(size > 0.0 && push.is_finite()) {
            return Err(format!(
                "a thruster pushes along an axis, and its gear {:?} has no force, or its gain {gain} no size",
                actuator.gear
            ));
        }
        let axis = force / size;
        let torque = moment.dot(&axis) / size;
        if (moment - moment.dot(&axis) * axis).norm() > ACROSS * (size + moment.norm()) {
            return Err(format!(
                "the moment of its gear {:?} isn't about the axis that it pushes along",
                actuator.gear
            ));
        }
        let used = |name: &str| self.file.thrusters.iter().any(|t| t.name == name);
        let own = (actuator.name.clone()).unwrap_or_else(|| format!("{site} thruster"));
        let numbered = (2..).map(|k| format!("{own} ({k})"));
        let mut names = std::iter::once(own.clone()).chain(numbered);
        Ok(SiteThruster {
            name: names.find(|name| !used(name)).unwrap_or(own.clone()),
            link: link.clone(),
            axis: axis.into(),
            push,
            torque,
        })
    }
}
