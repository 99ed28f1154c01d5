//! The pressure of the water on the bodies' surfaces.

use super::surface_flow::{BodyFlow, Past, Streams};
use super::{Recorded, Rollout, Sample, Simulator};
use crate::adjoint::lie::{Vec3, Vec6, six};
use crate::{Error, Result};
use nalgebra::DVector;

/// Pressure on the faces of one body at one moment, by Bernoulli's law for unsteady flow: p = −ρ (∂Φ/∂t + ½ |u|²), Φ the flow's potential, which follows
/// from the accelerations and not from differences in time. World frame.
///
/// Faces are those of the mesh that the water sees, of an ellipsoid by formula those of its shape. Their pressures add up to what
/// the dynamics do to the body, to the error of the faces: [`SurfacePressure::wrench`].
#[derive(Clone, Debug)]
pub struct SurfacePressure {
    /// The body's number in the scene.
    pub body: usize,
    /// Its name.
    pub name: String,
    /// Its origin, m.
    pub origin: Vec3,
    /// Centroids of the faces, m.
    pub centres: Vec<Vec3>,
    /// Their unit normals into the water.
    pub normals: Vec<Vec3>,
    /// Their areas, m².
    pub areas: Vec<f64>,
    /// Velocity of the water at the centroids, m/s; a current is in it.
    pub velocities: Vec<Vec3>,
    /// Pressure of the flow at the centroids, Pa, zero far away.
    pub pressures: Vec<f64>,
    /// Pressure of the water at rest, Pa: zero at the world's origin, or under a `waterline` at the water's surface and all above it, of a face that reaches through it the mean over the face.
    pub hydrostatic: Vec<f64>,
    /// How much of each face lies at a gap that a film carries, in parts of it: there the pressure is that of the film, which is the same across the gap.
    pub at_films: Vec<f64>,
}

impl SurfacePressure {
    /// −∮ p n dA of the flow's pressure, and its moment about the body's origin: N and N m, world axes. What [`Loads`](super::Loads) call
    /// "water", in a force `current` with what they call "current", but of a body with an added mass of the user's own: the pressure is that of the flow that its shape makes.
    pub fn wrench(&self) -> Vec6 {
        self.sum(&self.pressures)
    }

    /// The same of the water at rest: buoyancy of the closed surface, of what of it is below a `waterline`.
    pub fn hydrostatic_wrench(&self) -> Vec6 {
        self.sum(&self.hydrostatic)
    }

    fn sum(&self, pressures: &[f64]) -> Vec6 {
        let faces = self.centres.iter().zip(&self.normals).zip(&self.areas);
        let each = faces.zip(pressures).map(|(((x, n), area), p)| {
            let force = -n * (p * area);
            six(&force, &(x - self.origin).cross(&force))
        });
        each.sum()
    }
}

impl Simulator {
    /// Pressures with the generalised accelerations `gains`.
    fn pressure(&self, sample: &Sample, gains: &DVector<f64>) -> Result<Vec<SurfacePressure>> {
        let density = self.parameters().density();
        let gravity = Vec3::from(self.scene().gravity);
        let (current, streams) = (self.system().current, &self.system().streams);
        let surface = self.scene().waterline.map(|_| streams.surface());
        let of = |flow: BodyFlow| {
            let (faces, pose) = (flow.faces(), &flow.pose);
            let (mut velocities, mut dynamic) = flow.water();
            if !streams.is_empty() {
                let water = streams.at_body(flow.body, &sample.place(self.parameters()));
                let past = Past {
                    velocity: pose.rotation.tr_mul(&water.velocity),
                    acceleration: pose.rotation.tr_mul(&water.acceleration),
                };
                flow.add_stream(&past, (&mut velocities, &mut dynamic));
            }
            let centres: Vec<Vec3> = faces.centres.iter().map(|x| pose.apply(x)).collect();
            SurfacePressure {
                body: flow.body,
                name: self.system().bodies[flow.body].name.clone(),
                origin: pose.translation,
                normals: faces.normals.iter().map(|n| pose.rotation * n).collect(),
                areas: faces.areas.clone(),
                at_films: flow.at_films(),
                velocities: (velocities.iter())
                    .map(|u| pose.rotation * u + current)
                    .collect(),
                pressures: dynamic.iter().map(|p| density * p).collect(),
                hydrostatic: match surface {
                    None => centres.iter().map(|x| density * gravity.dot(x)).collect(),
                    Some(surface) => {
                        let depth = |x: &Vec3| surface.depth(&pose.apply(x));
                        let each = faces.corners.iter().zip(&faces.centres);
                        let means = each
                            .map(|(corners, x)| wet_depth(corners.map(|c| depth(&c)), depth(x)));
                        means.map(|mean| density * gravity.norm() * mean).collect()
                    }
                },
                centres,
            }
        };
        let flows = self.surface_flow(sample, Some(gains), Streams::LeftOut)?;
        Ok(flows.into_iter().map(of).collect())
    }
}

/// Mean over a face of how deep it is below the water's surface, m, what is above it counting as nothing: from the depths of its corners and that of its centroid, which is theirs where the face is flat.
fn wet_depth(corners: [f64; 3], centre: f64) -> f64 {
    let curved = centre - corners.iter().sum::<f64>() / 3.0;
    let mut depths = corners.map(|d| d + curved);
    depths.sort_by(f64::total_cmp);
    let [a, b, c] = depths;
    // A corner cut off alone is similar to a triangle with two of the face's edges.
    match depths {
        _ if a >= 0.0 => centre,
        _ if c <= 0.0 => 0.0,
        _ if b <= 0.0 => c * (c / (c - a)) * (c / (c - b)) / 3.0,
        _ => centre - a * (a / (a - b)) * (a / (a - c)) / 3.0,
    }
}

impl Rollout {
    /// [`Rollout::pressure`] at all states, to be put among the [observables](super::Recording::observables) of a recording: of the name "pressure", with an entry a face, "coin.pressure_0" and on, of one body after the
    /// other, Pa. Bodies keep their faces, so that it has as many in every row.
    ///
    /// # Errors
    /// As [`Rollout::pressure`].
    pub fn pressures(&self) -> Result<Recorded> {
        let (mut labels, mut values) = (Vec::new(), Vec::with_capacity(self.steps() + 1));
        for n in 0..=self.steps() {
            let found = self.pressure(n)?;
            if n == 0 {
                let names = |p: &SurfacePressure| {
                    let faces = 0..p.pressures.len();
                    faces
                        .map(|k| format!("{}.pressure_{k}", p.name))
                        .collect::<Vec<_>>()
                };
                labels = found.iter().flat_map(names).collect();
            }
            values.push(found.into_iter().flat_map(|p| p.pressures).collect());
        }
        Ok(Recorded {
            name: "pressure",
            labels,
            scalar: false,
            values,
        })
    }

    /// The water's pressure on the surfaces of all bodies in it at state `n`, with the accelerations of [`Rollout::loads`]: it takes solves of its own, but for those of the accelerations none of the loads. It is there to
    /// be looked at: nothing of a step depends on it, and it has no transpose.
    ///
    /// # Errors
    /// A state that there isn't; a scene without water; any body in the water without a surface, or of more faces than panels are solved for; bodies without
    /// a factor on a GPU; whatever the equations of motion or the coupling report.
    pub fn pressure(&self, n: usize) -> Result<Vec<SurfacePressure>> {
        let simulator = self.simulator();
        simulator.check_water()?;
        let sample = self.samples().get(n).ok_or_else(|| {
            let expected = format!("must be at most {}", self.steps());
            Error::input("pressure: state", n, expected)
        })?;
        let gains = self.acceleration(n)?;
        let made = simulator.pressure(sample, &gains);
        made.map_err(|e| e.at_time(sample.time))
    }
}
