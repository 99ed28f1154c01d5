//! The flow at sensors by the layers on all bodies.

use super::super::{Sample, Simulator};
use super::moving::Moving;
use crate::adjoint::lie::{Mat3, Vec3, Vec6, point_velocity};
use crate::boundary::PanelBoundary;
use crate::coupling::SurfacePotential;
use crate::geometry::Image;
use crate::{Error, Result};
use std::sync::Arc;

/// What sensors see at one moment, at unit density.
pub(super) struct Sensed<'s> {
    pub simulator: &'s Simulator,
    pub moving: Moving,
    pub surfaces: Vec<Arc<PanelBoundary>>,
    pub potentials: Vec<SurfacePotential>,
    /// Of every body in the water and every image.
    pub layers: Vec<Layer>,
    /// Where they are, world frame, m.
    pub points: Vec<Vec3>,
    /// The velocity that the bodies give to the water, world axes, m/s.
    pub velocity: Vec<Vec3>,
    /// ∂φ/∂t − ½ u², m²/s²; zeros where it isn't asked for.
    pub pressure: Vec<f64>,
    /// Whether it is.
    pub by_pressure: bool,
}

/// The layers of a body or of an image of it, as the sensors see them.
pub(super) struct Layer {
    /// The body among those in the water.
    pub body: usize,
    pub image: Image,
    pub rotation: Mat3,
    /// The sensors in the body's frame.
    pub seen: Vec<Vec3>,
    /// What it gives to the water there, the image's sign left out, m/s.
    pub velocity: Vec<Vec3>,
}

impl Layer {
    /// Velocity of the sensors' places as the body would carry them, its own frame.
    pub fn carried(&self, twist: &Vec6) -> Vec<Vec3> {
        self.seen.iter().map(|x| point_velocity(twist, x)).collect()
    }
}

impl<'s> Sensed<'s> {
    /// At these points, with velocities, and accelerations where the pressure is asked for, of all bodies.
    ///
    /// # Errors
    /// Bodies without a surface, and whatever the coupling reports.
    pub fn new(
        simulator: &'s Simulator,
        sample: &Sample,
        velocities: &[f64],
        gains: Option<&[f64]>,
        points: Vec<Vec3>,
    ) -> Result<Self> {
        let moving = Moving::new(simulator, &sample.poses, velocities, gains);
        let surfaces: Vec<Arc<PanelBoundary>> = (simulator.flow_surfaces()?.iter())
            .map(|s| s.panels.clone())
            .collect();
        let coupling = &simulator.system().coupling;
        let mut out = Self {
            potentials: coupling.surface_potentials(&moving.motion(), &surfaces)?,
            layers: Vec::new(),
            velocity: vec![Vec3::zeros(); points.len()],
            pressure: vec![0.0; points.len()],
            by_pressure: gains.is_some(),
            simulator,
            moving,
            surfaces,
            points,
        };
        for image in simulator.flow_images()? {
            for body in 0..out.surfaces.len() {
                out.add(body, image);
            }
        }
        if out.by_pressure {
            let pairs = out.pressure.iter_mut().zip(&out.velocity);
            pairs.for_each(|(p, u)| *p -= 0.5 * u.norm_squared());
        }
        Ok(out)
    }

    fn add(&mut self, body: usize, image: Image) {
        let (rotation, shift) = image.placement(&self.moving.poses[body]);
        let seen: Vec<Vec3> = (self.points.iter())
            .map(|x| rotation.tr_mul(&(x - shift)))
            .collect();
        let (panels, potential) = (&self.surfaces[body], &self.potentials[body]);
        let [twist, rate] = self.moving.twist(body);
        let q = panels.own_normal_velocity(&twist);
        let layer = Layer {
            velocity: panels.velocity(&q, &potential.value, &seen),
            body,
            image,
            rotation,
            seen,
        };
        for (out, u) in self.velocity.iter_mut().zip(&layer.velocity) {
            *out += image.sign * (rotation * u);
        }
        if self.by_pressure {
            // What stands still in the water moves against the body: ∂φ/∂t = φ(q', φ') + u·V.
            let own = panels.potential_at(&rate, &potential.rate, &layer.seen);
            let carried = layer.carried(&twist);
            let moved = layer.velocity.iter().zip(&carried).map(|(u, v)| u.dot(v));
            for (out, (own, moved)) in self.pressure.iter_mut().zip(own.iter().zip(moved)) {
                *out += image.sign * (own + moved);
            }
        }
        self.layers.push(layer);
    }
}

impl Simulator {
    /// Refuses what sensors can't be read with.
    pub(super) fn check_sensors(&self, pressure: bool) -> Result<()> {
        if pressure {
            return self.check_pressure();
        }
        match self.system().streams.is_empty() {
            true => Ok(()),
            false => Err(Error::Unsupported {
                what: "a sensor in a force `current`".into(),
                why: "bodies feel a stream that changes with depth or time each alone, and readings have no transpose to it".into(),
                instead: "use a uniform `fluid.current`, or Rollout::flow".into(),
            }),
        }
    }
}
