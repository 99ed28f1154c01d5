//! What is known of a scene's gaps, and the estimated error of the water across them.

use super::clearance::Clearance;
use super::gap_error::{Across, Carried, GapError};
use super::resolved::{Resolved, narrowest};
use crate::adjoint::lie::{Pose, Vec3};
use crate::coupling::film::{Extent, Films};
use crate::geometry::{Gap, Other};
use std::f64::consts::PI;

/// Of the added mass, what films that meet at a right angle lose where both gaps are closed, of flat bodies; and the part of that for round ones.
const CORNER: f64 = 0.5;
const ROUND_CORNER: f64 = 0.1;
/// Distance beyond a gap within which surfaces count as near, in the larger of the gap and the edges there.
const BEYOND: f64 = 0.2;
/// Least of gaps and curvatures, in edges.
const LEAST: f64 = 1e-6;

/// What estimates need of a scene's water, by the numbers of its bodies.
#[derive(Clone, Debug, Default)]
pub(crate) struct GapModel {
    /// By what the water is carried; none where nothing is known.
    pub carried: Option<Carried>,
    /// Relative error that compression aims at, per body.
    pub tolerances: Vec<f64>,
    /// Estimated errors of the bodies' own added mass, per body; 0 where nothing tells them.
    pub own: Vec<f64>,
    /// All films that there may be, by the numbers of bodies in the water.
    pub films: Films,
    /// The bodies in the water, which ascend.
    pub in_water: Vec<usize>,
    /// What compressed bodies resolve.
    pub resolved: Vec<Resolved>,
}

impl GapModel {
    /// The film that a pair may have, and whether the faces of the gap's second body carry it.
    fn film(&self, gap: &Gap) -> Option<(Extent, bool)> {
        let number = |b: usize| self.in_water.binary_search(&b).ok();
        let first = number(gap.first)?;
        let second = match gap.second {
            Other::Body(b) => Other::Body(number(b)?),
            wall => wall,
        };
        let film = self.films.extent(first, second)?;
        Some((film, film.body != first))
    }

    /// The gap from which on a pair has a film, m.
    pub fn reach(&self, gap: &Gap) -> Option<f64> {
        self.film(gap).map(|(film, _)| film.reach)
    }

    /// The gap from which on no pair has a film, m; 0 where there is none.
    pub fn widest(&self) -> f64 {
        self.films.widest()
    }

    /// What is known of a gap at these poses.
    pub fn across(&self, clearance: &Clearance, gap: &Gap, poses: &[Pose]) -> Across {
        let gaps = &clearance.moving;
        let distance = gap.distance.max(LEAST * gap.edge);
        // Between round surfaces the area within a distance d more than the gap is 2πRd.
        let beyond = beyond(gap);
        let near = gaps.near_faces(gap, beyond, poses);
        let area = near[0].area.max(near[1].area);
        let mut edges = near.map(|side| side.edge().unwrap_or(gap.edge));
        if let Other::Wall(_) = gap.second {
            edges[1] = edges[0];
        }
        let film = self.film(gap);
        let film_edge = film.map_or(gap.edge, |(film, second)| {
            let carries = near[usize::from(second)].edge();
            film.finer * carries.unwrap_or(gap.edge)
        });
        let (ratio, resolved) = narrowest(gaps, gap, poses, &self.resolved).unwrap_or((1.0, 0.0));
        let tolerances = gap.sides().map(|(b, _)| self.tolerances.get(b));
        Across {
            gap: distance,
            edge: gap.edge,
            film_edge,
            curvature: (area / (2.0 * PI * beyond)).max(LEAST * gap.edge),
            size: clearance.size(gap),
            area,
            edges: edges.iter().product(),
            own: gap
                .sides()
                .filter_map(|(b, _)| self.own.get(b))
                .fold(0.0, |a, b| b.max(a)),
            expanse: clearance.expanse(gap),
            resolved,
            ratio: ratio.max(LEAST),
            tolerance: tolerances.flatten().fold(0.0, |a, b| b.max(a)),
            reach: film.map(|(film, _)| film.reach),
        }
    }

    /// The estimate at a gap; none with fidelities and methods that none is known for.
    pub fn error(&self, clearance: &Clearance, gap: &Gap, poses: &[Pose]) -> Option<GapError> {
        let across = self.across(clearance, gap, poses);
        let mut error = match self.carried? {
            Carried::Panels => across.coupled(),
            Carried::Sources | Carried::Film => across.compressed(),
        };
        let corner = self.corner(clearance, gap, poses) * (ROUND_CORNER + across.flatness());
        error.added_mass += CORNER * corner;
        error.force += 2.0 * CORNER * corner;
        Some(error)
    }

    /// How far a gap's film, and others of its bodies, are into where they meet: each takes the other's gap for the open. Those on opposite sides of a body don't.
    fn corner(&self, clearance: &Clearance, gap: &Gap, poses: &[Pose]) -> f64 {
        let into = |gap: &Gap| {
            let reach = self.reach(gap).unwrap_or(0.0);
            let part = (1.0 - gap.distance / reach).clamp(0.0, 1.0);
            if reach > 0.0 { part.powi(3) } else { 0.0 }
        };
        let own = into(gap);
        if own == 0.0 {
            return 0.0;
        }
        let gaps = &clearance.moving;
        // Each body with the direction in which its faces at a gap look.
        let facing = |of: &Gap| -> Vec<(usize, Vec3)> {
            let near = gaps.near_faces(of, beyond(of), poses);
            let each = of.sides().zip(near);
            each.filter_map(|((b, _), near)| Some((b, near.facing.try_normalize(0.0)?)))
                .collect()
        };
        let here = facing(gap);
        let met = |other: &Gap| {
            let there = facing(other);
            let both = here
                .iter()
                .flat_map(|own| there.iter().map(move |x| (own, x)));
            let cosine = both
                .filter(|(a, b)| a.0 == b.0)
                .map(|(a, b)| a.1.dot(&b.1))
                .next()?;
            Some(into(other) * (1.0 - cosine * cosine))
        };
        let others = gaps.beside(gap, poses, self.widest()).into_iter();
        own * others.filter_map(|o| met(&o)).fold(0.0, f64::max)
    }
}

/// How far beyond the nearest faces others count as being at a gap, m.
fn beyond(gap: &Gap) -> f64 {
    BEYOND * gap.distance.max(gap.edge)
}
