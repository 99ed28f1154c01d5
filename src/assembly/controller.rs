//! The controller that a scene names. Whether it fits the scene, [`Scene::validate`] has checked.

use crate::dynamics::System;
use crate::policy::{
    Constant, OpenLoop, Pd, PdAxis, Playback, Policy, PushThenLock, SpeedStage, SpeedStages,
};
use crate::scene::{Controller, Scene};

/// The scene's controller.
pub(super) fn policy(scene: &Scene, system: &System) -> Box<dyn Policy> {
    let controls = system.controls;
    let body = |name: &String| scene.body(name).map_or(0, |b| b.0);
    match scene.controller.clone() {
        None => Box::new(OpenLoop),
        Some(Controller::Constant { control }) => Box::new(Constant { control }),
        Some(Controller::Pd {
            target,
            stiffness,
            damping,
        }) => {
            let joints = system.bodies.iter().zip(system.tree.links());
            let driven = joints.filter_map(|(body, link)| Some((body.joint_control?, link)));
            let axes = driven.flat_map(|(at, link)| {
                (0..link.v.len()).map(move |k| (at + k, link.q.start + k, link.v.start + k))
            });
            let axis = |(control, q, v): (usize, usize, usize)| PdAxis {
                control,
                q,
                v,
                target: target[control],
                stiffness: stiffness[control],
                damping: damping[control],
            };
            Box::new(Pd {
                controls,
                velocities: system.tree.velocities(),
                axes: axes.map(axis).collect(),
            })
        }
        Some(Controller::PushThenLock {
            body: name,
            force,
            stop_at,
        }) => {
            let b = body(&name);
            Box::new(PushThenLock {
                controls,
                bodies: system.len(),
                body: b,
                control: system.bodies[b].joint_control.unwrap_or_default(),
                q: system.tree.links()[b].q.start,
                force,
                stop_at,
                from_above: force < 0.0,
            })
        }
        Some(Controller::SpeedStages { bodies, stages }) => {
            let start = |name| system.tree.links()[body(name)].v.start;
            Box::new(SpeedStages {
                watch: bodies.iter().map(start).collect(),
                stages: stages
                    .into_iter()
                    .map(|s| SpeedStage {
                        until: s.until,
                        control: s.control,
                    })
                    .collect(),
            })
        }
        Some(Controller::Playback { control }) => Box::new(Playback {
            controls,
            steps: control,
        }),
    }
}
