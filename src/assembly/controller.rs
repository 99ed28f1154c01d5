//! The controller that a scene names. Whether it fits the scene, [`Scene::validate`] has checked.

use crate::dynamics::System;
use crate::policy::{
    Constant, OpenLoop, Pd, PdAxis, Playback, Policy, PushThenLock, SpeedStage, SpeedStages, Wave,
    WaveJoint,
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
        Some(Controller::Wave {
            bodies,
            places,
            amplitude,
            frequency,
            length,
            bias,
            stiffness,
            damping,
            rise,
        }) => {
            let joint = |(k, name): (usize, &String)| {
                let (b, count) = (body(name), bodies.len() as f64);
                let link = &system.tree.links()[b];
                WaveJoint {
                    control: system.bodies[b].joint_control.unwrap_or_default(),
                    q: link.q.start,
                    v: link.v.start,
                    place: (places.get(k).copied()).unwrap_or((k + 1) as f64 / count),
                }
            };
            Box::new(Wave {
                controls,
                velocities: system.tree.velocities(),
                joints: bodies.iter().enumerate().map(joint).collect(),
                amplitude,
                frequency,
                length,
                bias,
                stiffness,
                damping,
                rise,
            })
        }
        Some(Controller::Playback { control }) => Box::new(Playback {
            controls,
            steps: control,
            time_step: scene.time_step,
        }),
    }
}
