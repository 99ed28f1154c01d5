//! The water's velocity at one moment, where it is known.

use super::super::surface_flow::BodyFlow;
use super::super::{Sample, Simulator};
use super::line::LineEnd;
use crate::Result;
use crate::adjoint::lie::Vec3;
use crate::geometry::Other;

/// The flow of a state, solved once.
pub(super) struct Field<'s> {
    simulator: &'s Simulator,
    sample: &'s Sample,
    flows: Vec<BodyFlow<'s>>,
}

impl<'s> Field<'s> {
    pub fn new(simulator: &'s Simulator, sample: &'s Sample) -> Result<Self> {
        Ok(Self {
            simulator,
            sample,
            flows: simulator.open_surface_flow(sample, None)?,
        })
    }

    /// When it is, s.
    pub fn time(&self) -> f64 {
        self.sample.time
    }

    /// Refuses seeds where the flow isn't known.
    pub fn check(&self, what: &str, seeds: &[Vec3]) -> Result<()> {
        let poses = &self.sample.poses;
        let places = self.simulator.places(what, seeds, poses, &self.flows);
        places.map(drop)
    }

    /// The velocity at each point where it is known, m/s.
    pub fn at(&self, points: &[Vec3]) -> Result<Vec<Option<Vec3>>> {
        let resolved = self.simulator.resolved(self.sample, &self.flows, points);
        let clear: Vec<Vec3> = (points.iter().zip(&resolved))
            .filter_map(|(x, known)| known.then_some(*x))
            .collect();
        let made = match clear.is_empty() {
            true => Vec::new(),
            false => self
                .simulator
                .flow_by(self.sample, false, &self.flows, &clear)?,
        };
        let mut made = made.into_iter();
        let each = resolved.into_iter();
        Ok(each
            .map(|known| known.then(|| made.next()).flatten())
            .map(|u| u.filter(|u| u.iter().all(|x| x.is_finite())))
            .collect())
    }

    /// What is nearest to a point beside which the flow isn't known.
    pub fn obstacle(&self, point: &Vec3) -> LineEnd {
        let near = self.simulator.gaps().distances(point, &self.sample.poses);
        let nearest = near.min_by(|a, b| a.distance.total_cmp(&b.distance));
        match nearest.map(|d| d.from) {
            Some(Other::Body(b)) => LineEnd::Body(self.simulator.system().bodies[b].name.clone()),
            Some(Other::Wall(w)) => LineEnd::Wall(w),
            None => LineEnd::Still,
        }
    }
}
