//! Joints that follow others, as an MJCF file couples them.

use super::Made;
use mjcf_rs::equality::{Equality, EqualityJoint};

impl Made<'_> {
    /// Joints that follow others, and what isn't read.
    pub(super) fn equalities(&mut self) {
        for equality in &self.model.equality {
            let what = match equality {
                Equality::Connect(_) => "an <equality> of the kind connect",
                Equality::Weld(_) => "an <equality> of the kind weld",
                Equality::Tendon(_) => "an <equality> of the kind tendon",
                Equality::Joint(joint) => match self.follow(joint) {
                    None => continue,
                    Some(why) => &format!("the <equality> of joint {:?}, {why},", joint.joint1),
                },
            };
            let note = format!("{what} isn't read");
            if !self.file.notes.contains(&note) {
                self.file.notes.push(note);
            }
        }
    }

    /// Lets a joint follow another; why not, if it doesn't. Both are there, with one coordinate each.
    fn follow(&mut self, joint: &EqualityJoint) -> Option<&'static str> {
        let curve = joint.polycoef;
        if !joint.common.active {
            return Some("which isn't active");
        }
        let Some(leader) = joint.joint2.as_ref().filter(|name| !name.is_empty()) else {
            return Some("which holds it in one place");
        };
        if curve[2..].iter().any(|c| *c != 0.0) {
            return Some("which isn't a straight line (polycoef)");
        }
        // y − y₀ = a₀ + a₁ (x − x₀), y that of the first joint.
        let zero = |name: &str| {
            let found = self.model.joint_by_name(name);
            found.map_or(0.0, |(b, j)| self.model.bodies[b].body.joints[j].ref_)
        };
        let offset = zero(&joint.joint1) + curve[0] - curve[1] * zero(leader);
        let mut joints = self.file.robot.joints.iter_mut();
        let Some(follower) = joints.find(|j| j.name == joint.joint1) else {
            return Some("which isn't there");
        };
        if follower.mimic.is_some() {
            return Some("which follows a second one");
        }
        follower.mimic = Some(urdf_rs::Mimic {
            joint: leader.clone(),
            multiplier: Some(curve[1]),
            offset: Some(offset),
        });
        None
    }
}
