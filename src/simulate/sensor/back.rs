//! The transpose of readings: from the sensors to the layers, from these to the coupled solution, and from that to how the bodies are and move.
//!
//! Of a layer with the rotation R, the sign s and the displacement ẑ of its image, with u = s R u_s(x_s), x_s = Rᵀ(x − shift), and cotangents ū and p̄ of the
//! velocity and of `s (φ'(x_s) + u_s·V(x_s))`,
//!
//! ```text
//! ξ = ∂/∂x_s { s (Rᵀū + p̄ V)·u_s + s p̄ φ' },     F = R ξ:     force on the sensor, −F at x on the image, and the couple u × ū
//! ```
//!
//! The total velocity has ū − p̄ u, of −½ u² in Bernoulli's law.

use super::bar::BodyBar;
use super::place::Placed;
use super::sensed::{Layer, Sensed};
use crate::Result;
use crate::adjoint::lie::{Pose, Vec3, Vec6, angular, point_wrench, six};
use crate::coupling::{MotionBar, SurfacePotential};

/// Cotangents at one state.
pub(super) struct Bars {
    /// Of all bodies of the scene.
    pub bodies: Vec<BodyBar>,
    /// Of the water's density.
    pub density: f64,
}

/// What the layers get: of all bodies in the water.
struct LayerBars {
    motion: MotionBar,
    potentials: Vec<SurfacePotential>,
    /// Forces on the sensors, world axes.
    points: Vec<Vec3>,
}

impl Sensed<'_> {
    /// From cotangents of velocities, three a sensor, and of pressures, and the poses of all bodies.
    ///
    /// # Errors
    /// Whatever the coupling reports.
    pub fn bars(
        &self,
        sensors: &[Placed],
        poses: &[Pose],
        flow: &[f64],
        pressure: &[f64],
    ) -> Result<Bars> {
        let parameters = self.simulator.parameters();
        let each = pressure.iter().zip(&self.pressure);
        let density = each.map(|(bar, p)| bar * p).sum();
        let pressure: Vec<f64> = pressure.iter().map(|p| parameters.density() * p).collect();
        let flow: Vec<Vec3> = (flow.chunks_exact(3).map(Vec3::from_column_slice))
            .zip(pressure.iter().zip(&self.velocity))
            .map(|(bar, (p, u))| bar - *p * u)
            .collect();
        let bodies = self.surfaces.len();
        let mut bars = LayerBars {
            motion: MotionBar::zeros(bodies),
            potentials: (self.potentials.iter())
                .map(|p| SurfacePotential {
                    value: vec![0.0; p.value.len()],
                    rate: vec![0.0; p.rate.len()],
                    film: None,
                })
                .collect(),
            points: vec![Vec3::zeros(); sensors.len()],
        };
        for layer in &self.layers {
            self.layer_back(layer, &flow, &pressure, &mut bars);
        }
        let coupling = &self.simulator.system().coupling;
        let motion = self.moving.motion();
        let coupled = coupling.surface_potentials_vjp(&motion, &self.surfaces, &bars.potentials)?;
        bars.motion.add(&coupled);

        let mut out = vec![BodyBar::zero(); self.simulator.system().len()];
        for (b, bar) in self
            .moving
            .bodies
            .iter()
            .zip(self.moving.back(&bars.motion))
        {
            out[*b] = bar;
        }
        let places = sensors.iter().zip(&self.points).zip(&bars.points);
        for ((sensor, point), force) in places {
            if let Some(b) = sensor.body {
                let origin = poses[b].translation;
                out[b].position += force;
                out[b].rotation += (point - origin).cross(force);
            }
        }
        Ok(Bars {
            bodies: out,
            density,
        })
    }

    /// Adds what one layer gives.
    fn layer_back(&self, layer: &Layer, flow: &[Vec3], pressure: &[f64], out: &mut LayerBars) {
        let (b, sign) = (layer.body, layer.image.sign);
        let (panels, potential) = (&self.surfaces[b], &self.potentials[b]);
        let [twist, rate] = self.moving.twist(b);
        let carried = layer.carried(&twist);
        let bars: Vec<Vec3> = (flow.iter().zip(pressure).zip(&carried))
            .map(|((u, p), v)| sign * (layer.rotation.tr_mul(u) + *p * v))
            .collect();
        let mut sensed = panels.velocity_vjp(&twist, &potential.value, &layer.seen, &bars);
        add(&mut out.potentials[b].value, &sensed.phi);
        let mut rate_bar = Vec6::zeros();
        if self.by_pressure {
            let bars: Vec<f64> = pressure.iter().map(|p| sign * p).collect();
            let own = panels.potential_at_vjp(&rate, &potential.rate, &layer.seen, &bars);
            add(&mut out.potentials[b].rate, &own.phi);
            rate_bar = own.twist;
            let places = layer.seen.iter().zip(&layer.velocity).zip(&bars);
            for (i, ((x, u), p)) in places.enumerate() {
                sensed.points[i] += own.points[i] + *p * u.cross(&angular(&twist));
                sensed.twist += *p * point_wrench(x, u);
            }
        }
        out.motion.add_twists(b, &[sensed.twist, rate_bar]);
        let mut wrench = Vec6::zeros();
        let places = self.points.iter().zip(&sensed.points);
        for (i, (x, slope)) in places.enumerate() {
            let force = layer.rotation * slope;
            let given = sign * (layer.rotation * layer.velocity[i]);
            out.points[i] += force;
            wrench += six(&Vec3::zeros(), &given.cross(&flow[i])) - point_wrench(x, &force);
        }
        out.motion.poses[b] += layer.image.twist_vjp(&wrench);
    }
}

fn add(out: &mut [f64], more: &[f64]) {
    out.iter_mut()
        .zip(more)
        .for_each(|(out, more)| *out += more);
}
