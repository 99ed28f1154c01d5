//! The controller that a scene names.

use crate::dynamics::System;
use crate::policy::{
    Constant, OpenLoop, Pd, PdAxis, Playback, Policy, PushThenLock, SpeedStages, Stage,
};
use crate::scene::{self, Controller, Scene};
use crate::{Error, Result};

/// The scene's controller.
pub(super) fn policy(scene: &Scene, system: &System) -> Result<Box<dyn Policy>> {
    let count = |name: &str, n: usize| {
        if n == system.controls {
            return Ok(());
        }
        Err(Error::input(
            format!("controller.{name}"),
            format!("{n} numbers"),
            format!("must be {} numbers, one per control", system.controls),
        ))
    };
    Ok(match &scene.controller {
        None => Box::new(OpenLoop),
        Some(Controller::Constant { control }) => {
            count("control", control.len())?;
            Box::new(Constant {
                control: control.clone(),
            })
        }
        Some(Controller::Pd {
            target,
            stiffness,
            damping,
        }) => {
            count("target", target.len())?;
            count("stiffness", stiffness.len())?;
            count("damping", damping.len())?;
            let mut axes = Vec::new();
            for (body, link) in system.bodies.iter().zip(system.tree.links()) {
                let Some(at) = body.joint_control else {
                    continue;
                };
                for k in 0..link.v.len() {
                    axes.push(PdAxis {
                        control: at + k,
                        q: link.q.start + k,
                        v: link.v.start + k,
                        target: target[at + k],
                        stiffness: stiffness[at + k],
                        damping: damping[at + k],
                    });
                }
            }
            Box::new(Pd {
                controls: system.controls,
                velocities: system.tree.velocities(),
                axes,
            })
        }
        Some(Controller::PushThenLock {
            body,
            force,
            stop_at,
        }) => {
            let b = system.bodies.iter().position(|x| x.name == *body);
            let found = b.and_then(|b| Some((b, system.bodies[b].joint_control?)));
            let Some((b, control)) = found else {
                return Err(Error::input(
                    "controller.body",
                    body,
                    "must be the name of a body with an actuated one-coordinate joint",
                ));
            };
            Box::new(PushThenLock {
                controls: system.controls,
                bodies: system.len(),
                body: b,
                control,
                q: system.tree.links()[b].q.start,
                force: *force,
                stop_at: *stop_at,
                from_above: *force < 0.0,
            })
        }
        Some(Controller::SpeedStages { bodies, stages }) => {
            let mut watch = Vec::with_capacity(bodies.len());
            for name in bodies {
                let b = system.bodies.iter().position(|x| x.name == *name);
                let link = b.map(|b| &system.tree.links()[b]);
                let Some(link) = link.filter(|l| l.v.len() == 1) else {
                    return Err(Error::input(
                        "controller.bodies",
                        name,
                        "must be names of bodies with a one-coordinate joint",
                    ));
                };
                watch.push(link.v.start);
            }
            for (k, stage) in stages.iter().enumerate() {
                count(&format!("stages[{k}].control"), stage.control.len())?;
            }
            let of = |s: &scene::SpeedStage| Stage {
                until: s.until,
                control: s.control.clone(),
            };
            Box::new(SpeedStages {
                watch,
                stages: stages.iter().map(of).collect(),
            })
        }
        Some(Controller::Playback { control }) => {
            for (n, step) in control.iter().enumerate() {
                count(&format!("control[{n}]"), step.len())?;
            }
            Box::new(Playback {
                controls: system.controls,
                steps: control.clone(),
            })
        }
    })
}
