//! The flow on the bodies' surfaces at one moment: what pressure, and the flow around bodies that a fidelity knows by sources alone, follow from.

use super::{Sample, Simulator};
use crate::adjoint::lie::{Pose, Vec3, Vec6, angular, cross_motion, point_velocity, six};
use crate::coupling::{Motion, SurfacePotential};
use crate::geometry::{Faces, Image};
use crate::multibody::Virtual;
use crate::water::FlowSurface;
use crate::{Error, Result};
use nalgebra::DVector;

/// The water at one place, at unit density: the velocity that bodies give to it (m/s, world axes), the pressure of their flow (m²/s²) and its potential (m²/s).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Water {
    pub velocity: Vec3,
    pub pressure: f64,
    pub potential: f64,
}

/// What of it is asked for, beside the velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Asked {
    Velocity,
    Pressure,
    Potential,
}

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

/// What becomes of streams by depth and time in the twists of bodies through the water.
#[derive(Clone, Copy)]
pub(super) enum Streams {
    /// Each body moves through its own.
    Counted,
    /// Bodies move through the uniform current alone, as their inertia does in the equations of motion: [`BodyFlow::add_stream`] has the rest.
    LeftOut,
}

/// The undisturbed water that streams past a body by depth and time, where the body feels it, body frame.
pub(super) struct Past {
    /// m/s.
    pub velocity: Vec3,
    /// Its own acceleration, m/s².
    pub acceleration: Vec3,
}

impl BodyFlow<'_> {
    /// The faces where velocities and pressures are known.
    pub fn faces(&self) -> &Faces {
        match &self.surface.exact {
            Some(exact) => &exact.faces,
            None => &self.surface.panels.faces,
        }
    }

    /// Whether films carry gaps there.
    fn at_film(&self) -> bool {
        self.potential.film.is_some()
    }

    /// How much of each face lies at a gap that a film carries, in parts of it.
    pub fn at_films(&self) -> Vec<f64> {
        let areas = self.faces().areas.iter();
        match &self.potential.film {
            // Faces are flat, and what lies opposite is as large as the film.
            Some(film) => (film.area.iter().zip(areas))
                .map(|(at, area)| (at / area).min(1.0))
                .collect(),
            None => vec![0.0; areas.len()],
        }
    }

    /// Velocity that the bodies give to the water at each centroid, m/s.
    pub fn velocities(&self) -> Vec<Vec3> {
        let mut potential = self.potential.value.clone();
        if let Some(film) = &self.potential.film {
            let each = potential.iter_mut().zip(&film.potential);
            let each = each.zip(&self.faces().areas);
            each.for_each(|((all, film), area)| *all += film / area);
        }
        self.velocities_of(&potential)
    }

    /// The velocity and, by Bernoulli's law, the pressure (at unit density, m²/s²) at each centroid; in a film that of the sum of both flows, whose squares the film's own faces resolve.
    pub fn water(&self) -> (Vec<Vec3>, Vec<f64>) {
        let velocities = self.velocities();
        let Some(film) = &self.potential.film else {
            let pressures = self.pressures(&velocities);
            return (velocities, pressures);
        };
        let (held, faces) = (self.velocities_of(&self.potential.value), self.faces());
        let mut pressures = self.pressures(&held);
        for (i, p) in pressures.iter_mut().enumerate() {
            let (normal, area) = (&faces.normals[i], faces.areas[i]);
            let along = held[i] - normal * normal.dot(&held[i]);
            *p += (film.pressure[i] + along.dot(&film.gradient[i])) / area;
        }
        (velocities, pressures)
    }

    /// What a stream adds to velocities and pressures of the flow around this body, whose twist leaves the stream out: as in the force that it exerts
    /// ([`crate::adjoint::stream`]) the body answers to it as if alone, and the pressure that accelerates the undisturbed water, zero at the body's origin, comes on top.
    pub fn add_stream(&self, past: &Past, (velocities, pressures): (&mut [Vec3], &mut [f64])) {
        let still = |x: &Vec3| six(x, &Vec3::zeros());
        let turning = angular(&self.twist).cross(&past.velocity);
        let through = self.alone(
            self.twist - still(&past.velocity),
            self.twist_rate - still(&(past.acceleration - turning)),
        );
        let [with, without] = [through, self.alone(self.twist, self.twist_rate)].map(|f| f.water());
        for (u, (with, without)) in velocities.iter_mut().zip(with.0.iter().zip(&without.0)) {
            *u += with - without + past.velocity;
        }
        let pressed = with.1.iter().zip(&without.1).zip(&self.faces().centres);
        for (p, ((with, without), x)) in pressures.iter_mut().zip(pressed) {
            *p += with - without - past.acceleration.dot(x);
        }
    }

    /// The flow around this body as if alone in the water.
    fn alone(&self, twist: Vec6, twist_rate: Vec6) -> Self {
        let own = |twist: &Vec6| {
            let mut potential = self.surface.panels.own_potential(twist);
            self.surface.complete(twist, &mut potential);
            potential
        };
        Self {
            potential: SurfacePotential {
                value: own(&twist),
                rate: own(&twist_rate),
                film: None,
            },
            twist,
            twist_rate,
            ..*self
        }
    }

    /// The velocity there of a flow with this potential.
    fn velocities_of(&self, potential: &[f64]) -> Vec<Vec3> {
        let panels = &self.surface.panels;
        let slopes = match &self.surface.exact {
            Some(exact) => {
                let mut rest = potential.to_vec();
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
            None => panels.surface_gradient(potential),
        };
        let faces = self.faces();
        let places = faces.centres.iter().zip(&faces.normals).zip(slopes);
        // The water keeps up with the body along the normal.
        places
            .map(|((x, n), slope)| n * n.dot(&point_velocity(&self.twist, x)) - slope)
            .collect()
    }

    /// Normal of a face, world axes, where the surface is smooth; `None` at sharp edges.
    pub fn smooth_normal(&self, face: usize) -> Option<Vec3> {
        let panels = &self.surface.panels;
        let normal = panels.faces.normals.get(face)?;
        (!panels.at_sharp_edge(face)).then(|| self.pose.rotation * normal)
    }

    /// The point of the body's surface itself over one of a face, body frame, m.
    pub fn lifted(&self, x: &Vec3) -> Vec3 {
        let exact = self.surface.exact.as_ref();
        exact.map_or(*x, |exact| exact.lifted(x))
    }

    /// Potentials at the centroids, m²/s.
    fn potentials(&self) -> Vec<f64> {
        let mut out = self.potential.value.clone();
        if let Some(exact) = &self.surface.exact {
            let own = exact.potentials(&self.twist).into_iter();
            let panels = self.surface.panels.own_potential(&self.twist);
            let each = out.iter_mut().zip(own.zip(panels));
            each.for_each(|(all, (own, panels))| *all += own - panels);
        }
        out
    }

    /// What is known at the centroids (velocities, pressures and potentials), continued from there along the surface to points of faces without sharp edges, body frame, m.
    pub fn at(&self, places: &[(usize, Vec3)]) -> Vec<Water> {
        let velocities = self.velocities();
        let pressures = self.pressures(&velocities);
        let panels = &self.surface.panels;
        let continued = |values: &[f64]| -> Vec<f64> {
            let slopes = panels.surface_gradient(values);
            let bends = [0, 1, 2].map(|c| {
                let component: Vec<f64> = slopes.iter().map(|s| s[c]).collect();
                panels.surface_gradient(&component)
            });
            let of = |(face, x): &(usize, Vec3)| {
                let arm = x - self.faces().centres[*face];
                let bend = Vec3::from_fn(|c, _| bends[c][*face].dot(&arm));
                values[*face] + slopes[*face].dot(&arm) + 0.5 * bend.dot(&arm)
            };
            places.iter().map(of).collect()
        };
        let [x, y, z] = [0, 1, 2].map(|c| {
            let component: Vec<f64> = velocities.iter().map(|u| u[c]).collect();
            continued(&component)
        });
        let pressures = continued(&pressures).into_iter();
        let potentials = continued(&self.potentials());
        let of = |(i, (pressure, potential)): (usize, (f64, f64))| Water {
            velocity: self.pose.rotation * Vec3::new(x[i], y[i], z[i]),
            pressure,
            potential,
        };
        pressures.zip(potentials).enumerate().map(of).collect()
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

    /// Adds the velocity that the layers on its panels, and on those of its images, give to the water at points (m, world frame), and what is asked for beside it: ∂φ/∂t there in water at rest, or φ.
    fn layers(&self, images: &[Image], points: &[Vec3], asked: Asked, out: &mut [Water]) {
        let panels = &self.surface.panels;
        let velocity = panels.own_normal_velocity(&self.twist);
        let rate = panels.own_normal_velocity(&self.twist_rate);
        for image in images {
            let (rotation, shift) = image.placement(&self.pose);
            let seen: Vec<Vec3> = (points.iter())
                .map(|x| rotation.tr_mul(&(x - shift)))
                .collect();
            let made = panels.velocity(&velocity, &self.potential.value, &seen);
            for (out, u) in out.iter_mut().zip(&made) {
                out.velocity += image.sign * (rotation * u);
            }
            if asked == Asked::Potential {
                let own = panels.layers(&velocity, &self.potential.value, &seen);
                let each = out.iter_mut().zip(own);
                each.for_each(|(out, own)| out.potential += image.sign * own);
            }
            if asked == Asked::Pressure {
                // What stands still in the water moves against the body: ∂φ/∂t = φ(q', φ') + u·V.
                let own = panels.layers(&rate, &self.potential.rate, &seen);
                for (((out, own), u), x) in out.iter_mut().zip(own).zip(&made).zip(&seen) {
                    let moved = u.dot(&point_velocity(&self.twist, x));
                    out.pressure += image.sign * (own + moved);
                }
            }
        }
    }
}

impl Simulator {
    /// [`Simulator::surface_flow`] where no film carries a gap: around bodies the layers on surfaces held apart don't tell it.
    ///
    /// # Errors
    /// Films, and as there.
    pub(super) fn open_surface_flow(
        &self,
        sample: &Sample,
        gains: Option<&DVector<f64>>,
    ) -> Result<Vec<BodyFlow<'_>>> {
        let flows = self.surface_flow(sample, gains, Streams::Counted)?;
        match flows.iter().find(|flow| flow.at_film()) {
            None => Ok(flows),
            Some(flow) => Err(Error::Unsupported {
                what: format!(
                    "the flow around body {:?}, which a film holds apart",
                    self.system().bodies[flow.body].name
                ),
                why: "in a gap that the faces don't resolve it is known on the surfaces alone".into(),
                instead: "use more faces there, or ask before the gap closes; the pressure on bodies is known".into(),
            }),
        }
    }

    /// The flow on the surfaces of all bodies in the water, with its rates at the generalised accelerations `gains`, where they are given.
    ///
    /// # Errors
    /// Bodies without a surface, and whatever the coupling reports.
    pub(super) fn surface_flow(
        &self,
        sample: &Sample,
        gains: Option<&DVector<f64>>,
        streams: Streams,
    ) -> Result<Vec<BodyFlow<'_>>> {
        let system = self.system();
        let (tree, v) = (&system.tree, &sample.v);
        let kinematics = tree.kinematics(&sample.q);
        let none = DVector::zeros(v.len());
        let fields = tree.fields(&kinematics, &sample.q, v, Virtual::User(&none));
        let gained = tree.twists(&kinematics, gains.unwrap_or(&none));
        let at = system.moving(
            sample.place(self.parameters()),
            &fields.twist,
            v,
            &sample.control,
        );
        let uniform = six(&system.current, &Vec3::zeros());
        let through = |b: usize| match streams {
            Streams::Counted => at.relative(b),
            Streams::LeftOut => fields.twist[b] - uniform,
        };
        let through: Vec<Vec6> = (0..system.len()).map(through).collect();
        // In the body's frame the current turns as the body turns: d/dt Ad⁻¹(V − C) = Ad⁻¹(V' + V × C).
        let rates: Vec<Vec6> = (0..system.len())
            .map(|b| gained[b] + fields.bias[b] + cross_motion(&fields.twist[b], &uniform))
            .collect();
        let in_water: Vec<usize> = system.submerged().map(|(b, _)| b).collect();
        let poses: Vec<Pose> = in_water.iter().map(|b| kinematics.poses[*b]).collect();
        let displacement: Vec<Vec6> = in_water.iter().map(|b| fields.twist[*b]).collect();
        let surfaces = self.flow_surfaces()?;
        let panels: Vec<_> = surfaces.iter().map(|s| s.panels.clone()).collect();
        let twist_rates = system.submerged_twists(&kinematics, &rates);
        let potentials = system.coupling.surface_potentials(
            &Motion {
                poses: &poses,
                twists: &system.submerged_twists(&kinematics, &through),
                rates: gains.map(|_| &twist_rates),
                displacement: &displacement,
            },
            &panels,
        )?;
        let each = in_water.into_iter().zip(surfaces).zip(potentials);
        Ok(each
            .map(|((body, surface), mut potential)| {
                let pose = kinematics.poses[body];
                let twist = pose.twist_to_body(&through[body]);
                let twist_rate = pose.twist_to_body(&rates[body]);
                surface.complete(&twist, &mut potential.value);
                surface.complete(&twist_rate, &mut potential.rate);
                BodyFlow {
                    body,
                    pose,
                    surface,
                    potential,
                    twist,
                    twist_rate,
                }
            })
            .collect())
    }

    /// The surfaces of the bodies in the water.
    pub(super) fn flow_surfaces(&self) -> Result<&[FlowSurface]> {
        self.assembled.flow_surfaces(&self.scene, &self.choices)
    }

    /// The images of the bodies that the water knows.
    pub(super) fn flow_images(&self) -> Result<Vec<Image>> {
        match self.fidelity().coupled() {
            true => Image::of_walls(&self.scene.walls),
            false => Ok(vec![Image::identity()]),
        }
    }

    /// The water at points (m, world frame) outside all bodies, by the layers on their surfaces: the velocity, and what is asked for.
    pub(super) fn layered(
        &self,
        flows: &[BodyFlow],
        points: &[Vec3],
        asked: Asked,
    ) -> Result<Vec<Water>> {
        let images = self.flow_images()?;
        let mut out = vec![Water::default(); points.len()];
        for flow in flows {
            flow.layers(&images, points, asked, &mut out);
        }
        if asked == Asked::Pressure {
            // Bernoulli: of ∂φ/∂t, with the velocity −∇φ.
            for water in &mut out {
                water.pressure -= 0.5 * water.velocity.norm_squared();
            }
        }
        Ok(out)
    }

    /// Refuses pressures without water.
    pub(super) fn check_water(&self) -> Result<()> {
        let density = self.parameters().density();
        (density > 0.0)
            .then_some(())
            .ok_or_else(|| Error::Unsupported {
                what: "the pressure without water".into(),
                why: format!("the fluid's density is {density}"),
                instead: "give the fluid a density".into(),
            })
    }

    /// Refuses what pressures at points aren't known with.
    pub(super) fn check_pressure(&self) -> Result<()> {
        self.check_water()?;
        match self.system().streams.is_empty() {
            true => Ok(()),
            false => Err(Error::Unsupported {
                what: "the pressure at points in a force `current`".into(),
                why: "bodies feel a stream that changes with depth or time each alone, and its own pressure isn't known between them".into(),
                instead: "use a uniform `fluid.current`, or ask for the pressure on bodies".into(),
            }),
        }
    }
}
