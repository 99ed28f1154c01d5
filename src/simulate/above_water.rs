//! Bodies above the surface of the water: what of it ends there, and what doesn't.

use super::{Rollout, Sample, Simulator};
use crate::adjoint::lie::Vec3;
use crate::error::readable;
use crate::scene::Force;
use std::f64::consts::PI;

impl Rollout {
    /// Of each body that is wholly above the `waterline` at some state, and that acts there as if it weren't: when first, and how high.
    pub(super) fn above_water_warnings(&self) -> Vec<String> {
        let bodies = 0..self.simulator.system().len();
        match self.simulator.scene.waterline {
            Some(_) => bodies.filter_map(|b| self.above_water(b)).collect(),
            None => Vec::new(),
        }
    }

    fn above_water(&self, b: usize) -> Option<String> {
        let (simulator, system) = (&self.simulator, self.simulator.system());
        let (acting, surface) = (simulator.endless_water(b), system.streams.surface());
        let center = simulator.parameters().center_of_buoyancy(b);
        let height = |s: &Sample, x: &Vec3| -surface.depth(&s.poses[b].apply(x));
        // Surfaces are made when they are asked for: only of bodies that may be all out of the water.
        let risen = |s: &&Sample| !acting.is_empty() && height(s, &center) > 0.0;
        let first = self.samples().iter().position(|s| risen(&s))?;
        let made = simulator
            .assembled
            .surfaces(&simulator.scene, simulator.choices());
        let mesh = made.ok()?[b].as_ref().map(|s| &s.mesh);
        let clear = |s: &Sample| match mesh {
            Some(mesh) => {
                let each = mesh.vertices().iter().map(|x| height(s, x));
                each.fold(f64::INFINITY, f64::min)
            }
            // Buoyant as a ball, if at all.
            None => height(s, &center) - (0.75 / PI * simulator.parameters().volume(b)).cbrt(),
        };
        let states = self.samples()[first..].iter().filter(risen);
        let (s, clear) = states.map(|s| (s, clear(s))).find(|(_, h)| *h > 0.0)?;
        Some(format!(
            "body {:?} is wholly above the waterline at t = {} s, by {clear:.3e} m, where these act on it as under water: {}; a waterline ends buoyancy and `drag` alone: leave out what \
             isn't meant there, an added mass by `added_mass` of zeros",
            system.bodies[b].name,
            readable(s.time),
            acting.join(", "),
        ))
    }
}

impl Simulator {
    /// What the water does to a body wherever it is, in words.
    fn endless_water(&self, b: usize) -> Vec<String> {
        let (scene, body) = (&self.scene, &self.system().bodies[b]);
        let given = scene.bodies[b].added_mass.as_ref();
        let none = given.is_some_and(|rows| rows.iter().flatten().all(|x| *x == 0.0));
        let felt = body.submerged.is_some() && !none && self.parameters().density() > 0.0;
        let mut out: Vec<String> = felt.then(|| "its added mass".into()).into_iter().collect();
        for (i, force) in scene.forces.iter().enumerate() {
            let (kind, on) = match force {
                Force::Damping(of) => ("damping", &of.body),
                Force::Thruster(of) => ("thruster", &of.body),
                Force::Fin(of) => ("fin", &of.body),
                Force::Edge(of) => ("edge", &of.body),
                _ => continue,
            };
            if *on == body.name {
                out.push(format!("the {kind} {:?}", scene.force_name(i)));
            }
        }
        out
    }
}
