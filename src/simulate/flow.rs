//! The water's velocity around the bodies.

use super::surface_flow::{Asked, BodyFlow, Water};
use super::{Rollout, Sample, Simulator};
use crate::adjoint::lie::{Pose, Vec3, Vec6};
use crate::geometry::{Distance, Other};
use crate::{Error, Result};
use nalgebra::DVector;
use rayon::prelude::*;

/// Distance from a surface, in edges of its mesh, from which on the flow is known whatever is around. Nearer than this it is known where
/// the surface is smooth and nothing else is near.
pub const FLOW_EDGES: f64 = 0.5;

/// Most points at which the flow is asked for at once.
pub const FLOW_POINTS: usize = 20_000_000;

/// Distance in edges up to which the flow is continued between the surface and three places farther off: panels are flat and sources are points, and show so near.
pub(super) const NEAR: f64 = 0.75;
/// Those places, in edges.
const PLACES: [f64; 3] = [0.75, 1.25, 1.75];
/// Part of an edge within which a point is on the surface.
const ON_SURFACE: f64 = 1e-9;

/// A point that is near one surface and no other.
struct Near {
    body: usize,
    face: usize,
    /// The point of the surface under it, world frame.
    under: Vec3,
    /// The closest point of the faces, the direction from there, and the distance.
    foot: Vec3,
    out: Vec3,
    distance: f64,
    edge: f64,
}

/// How the flow at a point is found.
enum Approach {
    Far,
    Near(Near),
    /// What is too near.
    Unknown(Distance),
}

impl Near {
    /// The places beyond.
    fn places(&self) -> [Vec3; 3] {
        PLACES.map(|t| self.foot + self.out * (t * self.edge))
    }

    /// The cubic functions through what is at the surface and at the places.
    fn between(&self, surface: &Water, beyond: &[Water]) -> Water {
        // Of a body by formula the surface is a little above its faces.
        let lift = (self.under - self.foot).dot(&self.out) / self.edge;
        let nodes = [lift, PLACES[0], PLACES[1], PLACES[2]];
        let t = self.distance / self.edge;
        let mut out = Water::default();
        for (i, water) in [surface].into_iter().chain(beyond).enumerate() {
            let others = (0..nodes.len()).filter(|k| *k != i);
            let weight: f64 = others
                .map(|k| (t - nodes[k]) / (nodes[i] - nodes[k]))
                .product();
            out.velocity += weight * water.velocity;
            out.pressure += weight * water.pressure;
            out.potential += weight * water.potential;
        }
        out
    }
}

/// Where the flow is asked for, and how it is found there.
pub(super) struct Places {
    /// At the points, or at three places beyond those near a surface.
    pub asked: Vec<Vec3>,
    near: Vec<Option<Near>>,
}

impl Places {
    /// The water at the points from that at the places asked for.
    pub fn join(&self, flows: &[BodyFlow], found: &[Water]) -> Vec<Water> {
        let surfaces = at_surfaces(flows, &self.near);
        let mut next = 0;
        let each = self.near.iter().zip(&surfaces).map(|(near, surface)| {
            let count = near.as_ref().map_or(1, |near| near.places().len());
            let found = &found[next..next + count];
            next += count;
            (near.as_ref()).map_or(found[0], |near| near.between(surface, found))
        });
        each.collect()
    }
}

impl Simulator {
    /// Whether the fidelity has a flow of its own, and the flow on the surfaces, where that is needed: without one of its own, or at points near them. None where there
    /// is none for the asking, though the fidelity has its own.
    fn flows(&self, sample: &Sample, points: &[Vec3]) -> Result<(bool, Vec<BodyFlow<'_>>)> {
        let own = self.own_flow(sample, &[])?.is_some();
        let beside = |x: &Vec3| {
            let mut distances = self.gaps().distances(x, &sample.poses);
            distances.any(|d| d.distance < NEAR * d.edge)
        };
        if own && !points.par_iter().any(beside) {
            return Ok((own, Vec::new()));
        }
        match self.open_surface_flow(sample, None) {
            Err(Error::Unsupported { .. }) if own => Ok((own, Vec::new())),
            made => Ok((own, made?)),
        }
    }

    /// By the fidelity itself, if it can.
    fn own_flow(&self, sample: &Sample, points: &[Vec3]) -> Result<Option<Vec<Vec3>>> {
        let (system, v) = (self.system(), &sample.v);
        let kinematics = system.tree.kinematics(&sample.q);
        let twists = system.tree.twists(&kinematics, v);
        let place = sample.place(self.parameters());
        let at = system.moving(place, &twists, v, &sample.control);
        let through: Vec<Vec6> = (0..twists.len()).map(|b| at.relative(b)).collect();
        let through = system.submerged_twists(&kinematics, &through);
        let poses: Vec<Pose> = (system.submerged().map(|(b, _)| kinematics.poses[b])).collect();
        system.coupling.velocity(&poses, &through, points)
    }

    /// How the flow is found at points, `what`.
    ///
    /// # Errors
    /// Points that aren't finite, or where it isn't known; more than [`FLOW_POINTS`].
    pub(super) fn places(
        &self,
        what: &str,
        points: &[Vec3],
        poses: &[Pose],
        flows: &[BodyFlow],
    ) -> Result<Places> {
        few(what, points.len())?;
        let found: Vec<Approach> = (points.par_iter())
            .map(|x| self.approach(x, poses, flows))
            .collect();
        let mut asked: Vec<Vec3> = Vec::with_capacity(points.len());
        let mut near: Vec<Option<Near>> = Vec::with_capacity(points.len());
        for (i, (point, found)) in points.iter().zip(found).enumerate() {
            if let Some(bad) = point.iter().find(|x| !x.is_finite()) {
                return Err(Error::input(format!("{what}[{i}]"), bad, "must be finite"));
            }
            match found {
                Approach::Unknown(obstacle) => {
                    let place = format!("{what}[{i}] at {:?} m", point.as_slice());
                    return Err(self.too_near(&place, &obstacle, FLOW_EDGES));
                }
                Approach::Far => {
                    asked.push(*point);
                    near.push(None);
                }
                Approach::Near(found) => {
                    asked.extend(found.places());
                    near.push(Some(found));
                }
            }
        }
        Ok(Places { asked, near })
    }

    fn flow(&self, sample: &Sample, points: &[Vec3]) -> Result<Vec<Vec3>> {
        few("flow: points", points.len())?;
        // What doesn't know the flow at all isn't asked for it.
        if points.is_empty() {
            return Ok(Vec::new());
        }
        let (own, flows) = self.flows(sample, points)?;
        self.flow_by(sample, own, &flows, points)
    }

    /// From what [`Simulator::flows`] found for these points, or for more.
    pub(super) fn flow_by(
        &self,
        sample: &Sample,
        own: bool,
        flows: &[BodyFlow],
        points: &[Vec3],
    ) -> Result<Vec<Vec3>> {
        let places = self.places("flow: points", points, &sample.poses, flows)?;
        let found = match own {
            true => {
                let own = self.own_flow(sample, &places.asked)?.unwrap_or_default();
                let still = |velocity| Water {
                    velocity,
                    ..Water::default()
                };
                own.into_iter().map(still).collect()
            }
            false => self.layered(flows, &places.asked, Asked::Velocity)?,
        };
        let each = places.join(flows, &found).into_iter().zip(points);
        let water = |x| (self.system()).water_velocity(x, sample.time, self.parameters());
        Ok(each.map(|(u, x)| u.velocity + water(x)).collect())
    }

    /// Whether the flow is known at each point, from what [`Simulator::flows`] found for them.
    pub(super) fn resolved(
        &self,
        sample: &Sample,
        flows: &[BodyFlow],
        points: &[Vec3],
    ) -> Vec<bool> {
        let clear = |x: &Vec3| {
            let finite = x.iter().all(|c| c.is_finite());
            let found = || self.approach(x, &sample.poses, flows);
            finite && !matches!(found(), Approach::Unknown(_))
        };
        points.par_iter().map(clear).collect()
    }

    /// The flow where it is known, by one solve.
    fn known_flow(&self, sample: &Sample, points: &[Vec3]) -> Result<Vec<Option<Vec3>>> {
        let (own, flows) = match self.flows(sample, points) {
            Err(Error::Unsupported { .. }) => return Ok(vec![None; points.len()]),
            made => made?,
        };
        let resolved = self.resolved(sample, &flows, points);
        let marked = points.iter().zip(&resolved);
        let clear: Vec<Vec3> = marked.filter(|(_, r)| **r).map(|(x, _)| *x).collect();
        let mut found = match clear.is_empty() {
            true => Vec::new(),
            false => self.flow_by(sample, own, &flows, &clear)?,
        }
        .into_iter();
        let each = resolved.into_iter();
        Ok(each.map(|r| r.then(|| found.next()).flatten()).collect())
    }

    /// The flow's pressure at points with the generalised accelerations `gains`, Pa.
    fn flow_pressure(
        &self,
        sample: &Sample,
        gains: &DVector<f64>,
        points: &[Vec3],
    ) -> Result<Vec<f64>> {
        let flows = self.open_surface_flow(sample, Some(gains))?;
        let places = self.places("flow_pressure: points", points, &sample.poses, &flows)?;
        let found = self.layered(&flows, &places.asked, Asked::Pressure)?;
        let density = self.parameters().density();
        let each = places.join(&flows, &found).into_iter();
        Ok(each.map(|water| density * water.pressure).collect())
    }

    /// How the flow at a point is found.
    fn approach(&self, point: &Vec3, poses: &[Pose], flows: &[BodyFlow]) -> Approach {
        let distances = self.gaps().distances(point, poses);
        let close: Vec<Distance> = distances
            .filter(|d| d.distance < NEAR * d.edge || d.distance < 0.0)
            .collect();
        if let [one] = close[..]
            && let Some(near) = self.near(point, &one, poses, flows)
        {
            return Approach::Near(near);
        }
        match close.into_iter().find(|d| d.distance < FLOW_EDGES * d.edge) {
            Some(obstacle) => Approach::Unknown(obstacle),
            None => Approach::Far,
        }
    }

    /// The point as one near this surface, where that is smooth and nothing else is near the places beyond.
    fn near(
        &self,
        point: &Vec3,
        from: &Distance,
        poses: &[Pose],
        flows: &[BodyFlow],
    ) -> Option<Near> {
        let Other::Body(body) = from.from else {
            return None;
        };
        // On surfaces that feel nothing of the others their flow isn't known.
        if from.distance < 0.0 || !(self.fidelity().coupled() || flows.len() == 1) {
            return None;
        }
        let flow = flows.iter().find(|flow| flow.body == body)?;
        let (foot, face) = self.gaps().foot(body, point, &poses[body])?;
        let normal = flow.smooth_normal(face)?;
        let near = Near {
            body,
            face,
            under: poses[body].apply(&flow.lifted(&poses[body].apply_inverse(&foot))),
            foot,
            out: match from.distance > ON_SURFACE * from.edge {
                true => (point - foot) / from.distance,
                false => normal,
            },
            distance: from.distance,
            edge: from.edge,
        };
        let clear = |x: &Vec3| {
            let mut distances = self.gaps().distances(x, poses);
            // Over hollows the surface itself may be nearer than where it was left.
            distances.all(|d| d.distance > 0.9 * NEAR * d.edge)
        };
        near.places().iter().all(clear).then_some(near)
    }

    /// Of a place nearer to something than so many edges, or in it.
    pub(super) fn too_near(&self, place: &str, obstacle: &Distance, edges: f64) -> Error {
        let (what, remedy) = match obstacle.from {
            Other::Body(b) => (
                format!("body {:?}", self.system().bodies[b].name),
                "it lies within the body, or so near to an edge of it or to two surfaces that the mesh doesn't resolve it: leave it out, or use more faces",
            ),
            Other::Wall(w) => (format!("wall {w}"), "it lies behind the wall: leave it out"),
        };
        Error::Unresolved {
            place: format!("{place}: {what}"),
            quantity: "distance in m".into(),
            value: obstacle.distance,
            limit: edges * obstacle.edge,
            remedy: remedy.into(),
        }
    }
}

/// Refuses more points than are worked on at once.
pub(super) fn few(what: &str, count: usize) -> Result<()> {
    if count <= FLOW_POINTS {
        return Ok(());
    }
    let expected = format!("must be at most {FLOW_POINTS}: ask for them in parts");
    Err(Error::input(
        format!("{what}: their number"),
        count,
        expected,
    ))
}

/// The water at the feet of points that are near a surface; nothing of others.
fn at_surfaces(flows: &[BodyFlow], near: &[Option<Near>]) -> Vec<Water> {
    let mut out = vec![Water::default(); near.len()];
    for flow in flows {
        let own = near.iter().enumerate();
        let own = own.filter_map(|(i, near)| Some((i, near.as_ref()?)));
        let own: Vec<(usize, &Near)> = own.filter(|(_, near)| near.body == flow.body).collect();
        if own.is_empty() {
            continue;
        }
        let places: Vec<(usize, Vec3)> = (own.iter())
            .map(|(_, near)| (near.face, flow.pose.apply_inverse(&near.under)))
            .collect();
        for ((i, _), water) in own.iter().zip(flow.at(&places)) {
            out[*i] = water;
        }
    }
    out
}

impl Rollout {
    /// The water's velocity at points (m, world frame) at state `n`: m/s, world axes, currents included (those by depth and time as each body feels them alone). It takes solves of its own. It is
    /// there to be looked at: nothing of a step depends on it; that of sensors has a transpose ([`Rollout::sensor_flow`]).
    ///
    /// # Errors
    /// A state that there isn't; more than [`FLOW_POINTS`] points; points that aren't finite, within a body, behind a wall, or nearer than [`FLOW_EDGES`] of its edges to a sharp edge or where another surface is near
    /// as well; with the fidelities `reduced` and `isolated` also gaps that films carry and bodies without a surface, or of more faces than panels are solved for; whatever its solves report.
    pub fn flow(&self, n: usize, points: &[Vec3]) -> Result<Vec<Vec3>> {
        let sample = self.sample("flow", n)?;
        let made = self.simulator().flow(sample, points);
        made.map_err(|e| e.at_time(sample.time))
    }

    /// The pressure of the flow at points (m, world frame) at state `n`, with the accelerations of [`Rollout::loads`]: Pa, zero far away; that of the water at rest isn't in it. By Bernoulli's law as
    /// [`Rollout::pressure`]; that of sensors has a transpose ([`Rollout::sensor_pressure`]).
    ///
    /// # Errors
    /// As [`Rollout::flow`] of the points, and [`Rollout::pressure`].
    pub fn flow_pressure(&self, n: usize, points: &[Vec3]) -> Result<Vec<f64>> {
        let sample = self.sample("flow_pressure", n)?;
        let simulator = self.simulator();
        simulator.check_pressure()?;
        few("flow_pressure: points", points.len())?;
        if points.is_empty() {
            return Ok(Vec::new());
        }
        let gains = self.acceleration(n)?;
        let made = simulator.flow_pressure(sample, &gains, points);
        made.map_err(|e| e.at_time(sample.time))
    }

    /// Whether [`Rollout::flow`] knows the velocity at each of these points at state `n`: one that is finite, in the water, and not too near to edges or to several surfaces. Nowhere where the
    /// flow isn't known at all, as where films carry gaps with the fidelity `reduced`.
    ///
    /// # Errors
    /// A state that there isn't, and a solve that misses its tolerance.
    pub fn flow_resolved(&self, n: usize, points: &[Vec3]) -> Result<Vec<bool>> {
        let sample = self.sample("flow_resolved", n)?;
        few("flow_resolved: points", points.len())?;
        let simulator = self.simulator();
        match simulator.flows(sample, points) {
            Err(Error::Unsupported { .. }) => Ok(vec![false; points.len()]),
            Err(e) => Err(e.at_time(sample.time)),
            Ok((_, flows)) => Ok(simulator.resolved(sample, &flows, points)),
        }
    }

    /// [`Rollout::flow`] where [`Rollout::flow_resolved`], `None` elsewhere, with the solves of one.
    ///
    /// # Errors
    /// A state that there isn't, and a solve that misses its tolerance.
    pub fn known_flow(&self, n: usize, points: &[Vec3]) -> Result<Vec<Option<Vec3>>> {
        let sample = self.sample("flow", n)?;
        let made = self.simulator().known_flow(sample, points);
        made.map_err(|e| e.at_time(sample.time))
    }

    pub(super) fn sample(&self, what: &str, n: usize) -> Result<&Sample> {
        self.samples().get(n).ok_or_else(|| {
            let expected = format!("must be at most {}", self.steps());
            Error::input(format!("{what}: state"), n, expected)
        })
    }
}
