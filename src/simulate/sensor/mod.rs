//! Sensors in the water: its velocity and pressure at places fixed in the world or to bodies, with the transpose to how the bodies are and move.
//!
//! A sensor reads the flow as the layers on the bodies' panels make it ([`super::surface_flow`]), with every fidelity; it stands where these are what the flow
//! is, three quarters of an edge from every surface or more.

mod back;
mod bar;
mod moving;
mod place;
mod sensed;

pub use place::Sensor;

use super::flow::NEAR;
use super::observable::{observable, velocity};
use super::{Cotangents, Rollout};
use crate::adjoint::lie::Vec3;
use crate::{Error, Result};
use back::Bars;
use nalgebra::DMatrix;
use place::Placed;
use sensed::Sensed;

/// Most sensors of one reading.
const MOST: usize = 1_000_000;

impl Rollout {
    /// The water's velocity at sensors at state `n`: m/s, world axes, a uniform current included. As [`Rollout::flow`] tells it at the same places, but that with
    /// the fidelity `full` that is by panels of two meshes, or by sources, and this by the panels of one mesh.
    ///
    /// # Errors
    /// A state that there isn't; a sensor whose place isn't finite, on a body that there isn't, in a body, behind a wall, or nearer than three quarters of an edge to
    /// a surface; more than a million sensors; a force `current`; gaps that films carry, bodies without a surface or of more faces than panels are solved for; whatever the solves report.
    pub fn sensor_flow(&self, n: usize, sensors: &[Sensor]) -> Result<Vec<Vec3>> {
        let placed = self.placed(sensors)?;
        let current = self.simulator().system().current;
        let made = self.sensed(n, &placed, false)?;
        Ok(made.velocity.iter().map(|u| u + current).collect())
    }

    /// The flow's pressure at sensors at state `n`: Pa, zero far away; that of the water at rest isn't in it. By Bernoulli's law as [`Rollout::flow_pressure`], at places at rest in the world, with
    /// the mean accelerations over the step that starts there, contact and all, as the observable `accelerations` has them; at the last state over the one that ends there.
    ///
    /// # Errors
    /// As [`Rollout::sensor_flow`], water without density, and a rollout without steps.
    pub fn sensor_pressure(&self, n: usize, sensors: &[Sensor]) -> Result<Vec<f64>> {
        let placed = self.placed(sensors)?;
        let density = self.simulator().parameters().density();
        let made = self.sensed(n, &placed, true)?;
        Ok(made.pressure.iter().map(|p| density * p).collect())
    }

    /// The transpose of what sensors read: cotangents for [`Rollout::vjp`] from those of velocities (`flow`, 3·sensors × (N + 1)) and of pressures (sensors × (N + 1)).
    /// They are of positions, rotations, the observables `velocities` and `accelerations`, and the density: what readings follow from.
    ///
    /// # Errors
    /// As [`Rollout::sensor_flow`] and [`Rollout::sensor_pressure`] at states whose cotangents aren't zero; cotangents of other sizes or not finite; shape parameters.
    pub fn sensor_vjp(
        &self,
        sensors: &[Sensor],
        flow: Option<&DMatrix<f64>>,
        pressure: Option<&DMatrix<f64>>,
    ) -> Result<Cotangents> {
        if !self.simulator().system().shapes.water.is_empty() {
            return Err(Error::Unsupported {
                what: "gradients of what sensors read with shape parameters".into(),
                why: "how the flow at a place changes with a shape, all else at rest, isn't told"
                    .into(),
                instead: "leave the setting shape_parameters out, or the sensors".into(),
            });
        }
        let placed = self.placed(sensors)?;
        let (count, states) = (sensors.len(), self.states().len());
        for (name, given, rows) in [("flow", flow, 3 * count), ("pressure", pressure, count)] {
            let Some(given) = given else { continue };
            let place = format!("cotangents.{name}");
            if given.shape() != (rows, states) {
                let expected = format!("must have the shape {:?}", (rows, states));
                return Err(Error::input(
                    place,
                    format!("{:?}", given.shape()),
                    expected,
                ));
            }
            if let Some(bad) = given.iter().find(|x| !x.is_finite()) {
                return Err(Error::input(place, bad, "must be finite"));
            }
        }
        let bodies = self.simulator().system().len();
        let mut out = self.zero_cotangents();
        let mut velocities = DMatrix::zeros(6 * bodies, states);
        let mut gains = velocities.clone();
        let column = |given: Option<&DMatrix<f64>>, rows: usize, n: usize| -> Vec<f64> {
            given.map_or_else(
                || vec![0.0; rows],
                |x| x.column(n).iter().copied().collect(),
            )
        };
        let (mut any, mut gained) = (false, false);
        for n in 0..states {
            let flow = column(flow, 3 * count, n);
            let pressure = column(pressure, count, n);
            let by_pressure = pressure.iter().any(|p| *p != 0.0);
            if !by_pressure && flow.iter().all(|u| *u == 0.0) {
                continue;
            }
            (any, gained) = (true, gained | by_pressure);
            let made = self.sensed(n, &placed, by_pressure)?;
            let sample = &self.samples()[n];
            let bars = made.bars(&placed, &sample.poses, &flow, &pressure);
            let bars = bars.map_err(|e| e.at_time(sample.time))?;
            let Bars { bodies, density } = bars;
            for (b, bar) in bodies.iter().enumerate() {
                let put = |into: &mut DMatrix<f64>, rows: usize, bar: &[f64]| {
                    into.view_mut((rows * b, n), (rows, 1)).copy_from_slice(bar);
                };
                put(&mut out.positions, 3, bar.position.as_slice());
                put(&mut out.rotations, 3, bar.rotation.as_slice());
                put(&mut velocities, 6, bar.velocity.as_slice());
                put(&mut gains, 6, bar.gain.as_slice());
            }
            out.density += density;
        }
        if any {
            out.observables.insert("velocities".into(), velocities);
        }
        if gained {
            out.observables.insert("accelerations".into(), gains);
        }
        Ok(out)
    }

    fn placed(&self, sensors: &[Sensor]) -> Result<Vec<Placed>> {
        if sensors.len() > MOST {
            let expected = format!("must be at most {MOST}: read them in parts");
            return Err(Error::input(
                "sensors: their number",
                sensors.len(),
                expected,
            ));
        }
        let place = |(i, sensor): (usize, &Sensor)| {
            if let Some(bad) = sensor.at.iter().find(|x| !x.is_finite()) {
                return Err(Error::input(
                    format!("sensors[{i}].at"),
                    bad,
                    "must be finite",
                ));
            }
            let what = format!("sensors[{i}]");
            let body = sensor.body.as_ref().map(|b| b.found(&what, self));
            Ok(Placed {
                body: body.transpose()?,
                at: sensor.at.into(),
            })
        };
        sensors.iter().enumerate().map(place).collect()
    }

    /// What the sensors see at state `n`.
    fn sensed(&self, n: usize, sensors: &[Placed], pressure: bool) -> Result<Sensed<'_>> {
        let simulator = self.simulator();
        let sample = self.samples().get(n).ok_or_else(|| {
            let expected = format!("must be at most {}", self.steps());
            Error::input("sensors: state", n, expected)
        })?;
        simulator.check_sensors(pressure)?;
        let reading = self.reading(n);
        let gains = pressure.then(|| observable("accelerations").and_then(|o| o.value(&reading)));
        let points: Vec<Vec3> = sensors.iter().map(|s| s.point(sample)).collect();
        let made = || {
            let gains = gains.transpose()?;
            for (i, point) in points.iter().enumerate() {
                let mut near = simulator.gaps().distances(point, &sample.poses);
                if let Some(near) = near.find(|d| d.distance < NEAR * d.edge || d.distance < 0.0) {
                    let place = format!("sensors[{i}] at {:?} m", point.as_slice());
                    return Err(simulator.too_near(&place, &near, NEAR));
                }
            }
            Sensed::new(
                simulator,
                sample,
                &velocity::velocities(&reading),
                gains.as_deref(),
                points,
            )
        };
        made().map_err(|e| e.at_time(sample.time))
    }
}
