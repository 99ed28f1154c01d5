//! The flow on the bodies' surfaces at one moment: what pressure, and the flow around bodies that a fidelity knows by sources alone, follow from.

use super::{Sample, Simulator};
use crate::adjoint::lie::{Pose, Vec3, Vec6, cross_motion, point_velocity, six};
use crate::assembly::FlowSurface;
use crate::coupling::{Motion, SurfacePotential};
use crate::geometry::{Faces, Image};
use crate::multibody::Virtual;
use crate::{Error, Result};
use nalgebra::DVector;

/// The flow on one body's surface, body frame.
pub(super) struct BodyFlow<'s> {
    /// Its number in the scene.
    pub body: usize,
    pub pose: Pose,
    surface: &'s FlowSurface,
    potential: SurfacePotential,
    /// Its twist through the undisturbed water, and the rate of these numbers.
    twist: Vec6,
    twist_rate: Vec6,
}

impl BodyFlow<'_> {
    /// The faces where velocities and pressures are known.
    pub fn faces(&self) -> &Faces {
        match &self.surface.exact {
            Some(exact) => &exact.faces,
            None => &self.surface.panels.faces,
        }
    }

    /// Velocity that the bodies give to the water at each centroid, m/s.
    pub fn velocities(&self) -> Vec<Vec3> {
        let panels = &self.surface.panels;
        let slopes = match &self.surface.exact {
            Some(exact) => {
                let mut rest = self.potential.value.clone();
                let own = panels.own_potential(&self.twist);
                rest.iter_mut().zip(own).for_each(|(all, own)| *all -= own);
                let mut slopes = panels.surface_gradient(&rest);
                let own = exact.gradients(&self.twist).into_iter();
                slopes
                    .iter_mut()
                    .zip(own)
                    .for_each(|(all, own)| *all += own);
                slopes
            }
            None => panels.surface_gradient(&self.potential.value),
        };
        let faces = self.faces();
        let places = faces.centres.iter().zip(&faces.normals).zip(slopes);
        // The water keeps up with the body along the normal.
        places
            .map(|((x, n), slope)| n * n.dot(&point_velocity(&self.twist, x)) - slope)
            .collect()
    }

    /// Unsteady Bernoulli in the body's frame, at unit density, from the velocities there, m²/s²: with φ' the rate at a point that goes
    /// with the body at V, `p = φ' + V·u − ½ u²` (velocity −∇φ).
    pub fn pressures(&self, velocities: &[Vec3]) -> Vec<f64> {
        let mut rates = self.potential.rate.clone();
        if let Some(exact) = &self.surface.exact {
            let own = exact.potentials(&self.twist_rate).into_iter();
            let panels = self.surface.panels.own_potential(&self.twist_rate);
            let own = own.zip(panels);
            rates
                .iter_mut()
                .zip(own)
                .for_each(|(rate, (own, panels))| *rate += own - panels);
        }
        let places = self.faces().centres.iter().zip(&rates);
        let of = |(((x, rate), u), square): (((&Vec3, &f64), &Vec3), f64)| {
            rate + point_velocity(&self.twist, x).dot(u) - 0.5 * square
        };
        let squares = self.surface.panels.mean_squares(velocities);
        places.zip(velocities).zip(squares).map(of).collect()
    }

    /// The velocity that the layers on its panels, and on those of its images, give to the water at points (m, world frame): m/s, world axes.
    fn layers(&self, images: &[Image], points: &[Vec3], out: &mut [Vec3]) {
        let panels = &self.surface.panels;
        let faces = &panels.faces;
        let normal: Vec<f64> = (0..faces.len())
            .map(|i| faces.twist_flux(i).dot(&self.twist) / faces.areas[i])
            .collect();
        for image in images {
            let (rotation, shift) = image.placement(&self.pose);
            let seen: Vec<Vec3> = (points.iter())
                .map(|x| rotation.tr_mul(&(x - shift)))
                .collect();
            let made = panels.velocity(&normal, &self.potential.value, &seen);
            let turned = made.iter().map(|u| image.sign * (rotation * u));
            out.iter_mut().zip(turned).for_each(|(o, u)| *o += u);
        }
    }
}

impl Simulator {
    /// The flow on the surfaces of all bodies in the water, with the generalised accelerations `gains`.
    ///
    /// # Errors
    /// Bodies without a surface, and whatever the coupling reports.
    pub(super) fn surface_flow(
        &self,
        sample: &Sample,
        gains: &DVector<f64>,
    ) -> Result<Vec<BodyFlow<'_>>> {
        let system = self.system();
        let (tree, v) = (&system.tree, &sample.v);
        let kinematics = tree.kinematics(&sample.q);
        let none = DVector::zeros(v.len());
        let fields = tree.fields(&kinematics, &sample.q, v, Virtual::User(&none));
        let gained = tree.twists(&kinematics, gains);
        let at = system.moving(
            sample.place(self.parameters()),
            &fields.twist,
            v,
            &sample.control,
        );
        let through: Vec<Vec6> = (0..system.len()).map(|b| at.relative(b)).collect();
        let uniform = six(&system.current, &Vec3::zeros());
        // In the body's frame the current turns as the body turns: d/dt Ad⁻¹(V − C) = Ad⁻¹(V' + V × C).
        let rates: Vec<Vec6> = (0..system.len())
            .map(|b| gained[b] + fields.bias[b] + cross_motion(&fields.twist[b], &uniform))
            .collect();
        let in_water: Vec<usize> = system.submerged().map(|(b, _)| b).collect();
        let poses: Vec<Pose> = in_water.iter().map(|b| kinematics.poses[*b]).collect();
        let displacement: Vec<Vec6> = in_water.iter().map(|b| fields.twist[*b]).collect();
        let surfaces = self.assembled.flow_surfaces(&self.scene, &self.choices)?;
        let panels: Vec<_> = surfaces.iter().map(|s| s.panels.clone()).collect();
        let potentials = system.coupling.surface_potentials(
            &Motion {
                poses: &poses,
                twists: &system.submerged_twists(&kinematics, &through),
                rates: &system.submerged_twists(&kinematics, &rates),
                displacement: &displacement,
            },
            &panels,
        )?;
        let each = in_water.into_iter().zip(surfaces).zip(potentials);
        Ok(each
            .map(|((body, surface), potential)| {
                let pose = kinematics.poses[body];
                BodyFlow {
                    body,
                    pose,
                    surface,
                    potential,
                    twist: pose.twist_to_body(&through[body]),
                    twist_rate: pose.twist_to_body(&rates[body]),
                }
            })
            .collect())
    }

    /// The images of the bodies that the water knows.
    fn flow_images(&self) -> Result<Vec<Image>> {
        match self.fidelity().coupled() {
            true => Image::of_walls(&self.scene.walls),
            false => Ok(vec![Image::identity()]),
        }
    }

    /// The velocity that all bodies give to the water at points (m, world frame) outside them, by the layers on their surfaces: m/s, world axes.
    pub(super) fn layered_flow(&self, sample: &Sample, points: &[Vec3]) -> Result<Vec<Vec3>> {
        let still = DVector::zeros(sample.v.len());
        let mut out = vec![Vec3::zeros(); points.len()];
        let images = self.flow_images()?;
        for flow in self.surface_flow(sample, &still)? {
            flow.layers(&images, points, &mut out);
        }
        Ok(out)
    }

    /// Refuses what pressures aren't known with.
    pub(super) fn check_pressure(&self) -> Result<()> {
        let unsupported = |what: &str, why: &str, instead: &str| {
            Err(Error::Unsupported {
                what: what.into(),
                why: why.into(),
                instead: instead.into(),
            })
        };
        if self.parameters().density() <= 0.0 {
            return unsupported(
                "the pressure without water",
                "the fluid's density is 0",
                "give the fluid a density",
            );
        }
        if !self.system().streams.is_empty() {
            return unsupported(
                "the pressure in a force `current`",
                "bodies feel a stream that changes with depth or time each alone, and its own pressure isn't known beside them",
                "use a uniform `fluid.current`",
            );
        }
        Ok(())
    }
}
