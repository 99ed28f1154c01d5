//! Which of inertia and viscosity rules the water in a trajectory's smallest gap.

use super::{Rollout, Simulator};
use crate::Result;
use crate::adjoint::lie::{Pose, Vec6, six};
use crate::assembly::bearing;
use crate::coupling::lubrication::PlacedBearing;
use crate::dynamics::Drive;
use crate::geometry::{Gap, Other, WallSurface};
use crate::scene::{Lubrication, WATER_VISCOSITY};
use nalgebra::{DVector, Vector3};
use serde::Serialize;

/// Of the smallest gap, how far above it steps count whose speed is taken.
const NEAR: f64 = 2.0;
/// Roughness with which the film is looked at where no force gives one, of the gap.
const SMOOTH: f64 = 1e-3;
/// Part of the inertial forces from which on viscous ones matter, and the Stokes number below which they stop bodies.
const MATTERS: f64 = 0.1;
const STOPS: f64 = 10.0;

/// Inertia and viscosity of the water in a trajectory's smallest gap ([`Rollout::gap_flow`]).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GapFlow {
    /// When the gap is smallest, s.
    pub time: f64,
    /// The smallest gap h, m.
    pub gap: f64,
    /// Names of the bodies; of the second none for a wall.
    pub bodies: (String, Option<String>),
    /// ḣ: the fastest that it opens or closes in a step that begins or ends with it no wider than twice h, m/s.
    pub speed: f64,
    /// Kinematic viscosity ν of the water, m²/s: that of the scene's first force of viscous water, or of water at 20 °C.
    pub viscosity: f64,
    /// Film Reynolds number Re_h = h |ḣ|/ν.
    pub film_reynolds: f64,
    /// 24/Re_h: the viscous pressure in a film that closes, over that of its inertia. Infinite at rest.
    pub viscous_over_inertial: f64,
    /// Stokes number m |ḣ|/(C h): the inertia of the bodies over the viscous force that closing meets at h. C is its damping, and m the inertia of bodies and
    /// water against what the film pushes with; for a ball over a wall it is m |ḣ|/(6π μ R²). A body is stopped by the film well below 1, and hits
    /// through it well above 10. None where nothing may move, or no film is found.
    pub stokes: Option<f64>,
    /// Whether a force of viscous water acts in this gap.
    pub lubricated: bool,
}

impl GapFlow {
    /// What there is to know, where viscosity would matter and isn't there.
    pub fn advice(&self) -> Option<String> {
        let weak = self.viscous_over_inertial < MATTERS && self.stokes.is_none_or(|s| s > STOPS);
        (!self.lubricated && self.speed > 0.0 && !weak)
            .then(|| "viscosity matters there, and no force of lubrication acts in that gap".into())
    }
}

impl Rollout {
    /// Which of inertia and viscosity rules the water in the smallest gap of the trajectory, whether or not viscous water acts there. None where there is no gap, no
    /// water, at a free surface, and where surfaces overlap.
    ///
    /// # Errors
    /// A mesh file that can't be read any more; a film whose pressure isn't found; whatever evaluating the system reports.
    pub fn gap_flow(&self) -> Result<Option<GapFlow>> {
        let simulator = self.simulator();
        let density = simulator.parameters().density();
        let Some((at, gap)) = self.nearest() else {
            return Ok(None);
        };
        // A free surface gives way.
        let free = |w: usize| simulator.scene.walls[w].surface == WallSurface::Free;
        let yields = matches!(gap.second, Other::Wall(w) if free(w));
        if density <= 0.0 || gap.distance <= 0.0 || yields {
            return Ok(None);
        }
        let h = gap.distance;
        let name = |b: usize| simulator.system().bodies[b].name.clone();
        let second = match gap.second {
            Other::Body(b) => Some(name(b)),
            Other::Wall(_) => None,
        };
        let bodies = (name(gap.first), second);
        let names: Vec<&str> = [Some(&bodies.0), bodies.1.as_ref()]
            .into_iter()
            .flatten()
            .map(String::as_str)
            .collect();
        let carriers = simulator.scene.carriers();
        let neighbours = match gap.second {
            Other::Body(b) => carriers.are_neighbours(gap.first, b),
            Other::Wall(_) => false,
        };
        let mut forces = simulator.scene.lubrications();
        // Past a force's reach nothing of it is left.
        let reaches = |force: &Lubrication| force.reach.is_none_or(|reach| gap.distance < reach);
        let acts =
            |force: &Lubrication| !neighbours && force.acts_between(&names) && reaches(force);
        let acting = forces.find(|(_, force)| acts(force));
        let reach = acting.and_then(|(_, force)| force.reach);
        let any = acting.or_else(|| simulator.scene.lubrications().next());
        let value = |(i, _): (usize, _), what: &str| {
            let name = format!("{}.{what}", simulator.scene.force_name(i));
            simulator.parameters().get(&name)
        };
        let dynamic = any.map_or(Ok(WATER_VISCOSITY), |force| value(force, "viscosity"))?;
        let roughness = acting.map_or(Ok(SMOOTH * h), |force| value(force, "roughness"))?;
        let speed = self.speed(&gap);
        let viscosity = dynamic / density;
        let film_reynolds = h * speed / viscosity;
        let poses = &self.samples()[at].poses;
        let film = Film::new(simulator, poses, &gap, roughness, reach)?;
        let inertia = match &film {
            Some(film) => film.inertia(simulator, &self.samples()[at].q)?,
            None => None,
        };
        let stokes = inertia.map(|(mass, damping)| mass * speed / (dynamic * damping * h));
        Ok(Some(GapFlow {
            time: self.samples()[at].time,
            gap: h,
            bodies,
            speed,
            viscosity,
            film_reynolds,
            viscous_over_inertial: 24.0 / film_reynolds,
            stokes: stokes.filter(|s| s.is_finite()),
            lubricated: acting.is_some(),
        }))
    }

    /// The fastest that the gap between the same two changes near its smallest, m/s.
    fn speed(&self, smallest: &Gap) -> f64 {
        let same = |gap: &Option<Gap>| {
            let gap = (*gap)?;
            let both = (gap.first, gap.second) == (smallest.first, smallest.second);
            both.then_some(gap.distance)
        };
        let dt = self.simulator().time_step();
        let steps = self.gaps().windows(2).filter_map(|pair| {
            let (a, b) = (same(&pair[0])?, same(&pair[1])?);
            (a.min(b) <= NEAR * smallest.distance).then(|| (b - a).abs() / dt)
        });
        steps.fold(0.0, f64::max)
    }
}

/// The film in a gap.
struct Film {
    first: usize,
    second: Option<usize>,
    /// Axes of the other, about the origin of the first.
    frame: Pose,
    placed: PlacedBearing,
}

impl Film {
    fn new(
        simulator: &Simulator,
        poses: &[Pose],
        gap: &Gap,
        roughness: f64,
        reach: Option<f64>,
    ) -> Result<Option<Self>> {
        let scene = &simulator.scene;
        let surfaces = simulator.assembled.surfaces(scene, simulator.choices())?;
        let sides = (gap.first, gap.second);
        let Some((first, second, bearing)) = bearing(scene, surfaces, sides, reach)? else {
            return Ok(None);
        };
        let other = second.map_or(Pose::identity(), |b| poses[b]);
        let relative = other.inverse().compose(&poses[first]);
        let name = |b: usize| simulator.system().bodies[b].name.as_str();
        let placed = bearing.placed(&relative, roughness);
        let placed = placed.map_err(|why| why.error(name(first), second.map(name)))?;
        Ok(placed.map(|placed| Self {
            first,
            second,
            frame: Pose::new(other.rotation, poses[first].translation),
            placed,
        }))
    }

    /// The inertia against what the film pushes with as the gap closes, and its damping C/μ there; none where nothing may move.
    fn inertia(&self, simulator: &Simulator, q: &DVector<f64>) -> Result<Option<(f64, f64)>> {
        let system = simulator.system();
        let approach = six(&self.placed.way(), &Vector3::zeros());
        let push = self.placed.damping * approach;
        let damping = approach.dot(&push);
        let wrench = self.frame.wrench_to_world(&push);
        let mut wrenches = vec![Vec6::zeros(); system.len()];
        wrenches[self.first] += wrench;
        if let Some(b) = self.second {
            wrenches[b] -= wrench;
        }
        let e = system.evaluate(simulator.parameters(), q, 0.0)?;
        let all = system.tree.project(&e.kinematics.columns, wrenches);
        let drives = system.drives.iter().zip(system.tree.links());
        let free: Vec<usize> = drives
            .filter(|(drive, _)| **drive == Drive::Free)
            .flat_map(|(_, link)| link.v.clone())
            .collect();
        let Ok(factor) = e.factored(&free) else {
            return Ok(None);
        };
        let yielding = all.dot(&factor.solve(&all));
        Ok((yielding > 0.0).then(|| (damping * damping / yielding, damping)))
    }
}
