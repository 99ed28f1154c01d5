//! Contact of a scene: which surfaces may touch, at which gap, and how stiffly.

use super::assemble::Surface;
use super::clearance::Clearance;
use super::{Fidelity, Settings};
use crate::contact::{ContactPair, Contacts, Geometry};
use crate::dynamics::{self, ContactModel, Integrator, Regularisation};
use crate::scene::{Contact, Scene};
use crate::shape::{Other, TriMesh};
use crate::{Error, Result};

/// Of the heaviest moving mass over Δt²: a mass on it rings with a period of some twelve steps, near rigid at that step.
const STIFFNESS: f64 = 0.25;
/// Half the width over which the force sets in, of the smallest body's radius.
const WIDTH: f64 = 0.004;
/// Part of the edges that the fidelity `Full` resolves.
const EDGES: f64 = 0.5;

/// What contact is made from.
pub(super) struct Parts<'a> {
    pub scene: &'a Scene,
    pub given: &'a Contact,
    pub settings: &'a Settings,
    pub clearance: &'a Clearance,
    pub fidelity: Fidelity,
    /// Gap that each body's compression resolves, m.
    pub resolved: &'a [f64],
    pub surfaces: &'a [Option<Surface>],
    pub mass: &'a [f64],
}

pub(super) fn assemble(p: Parts) -> Result<(ContactModel, dynamics::Contact)> {
    if p.settings.integrator != Integrator::MomentumEuler {
        return Err(Error::Unsupported {
            what: format!("contact with the integrator {:?}", p.settings.integrator),
            why: "contact is solved in the velocity at the end of a step, and this one doesn't solve for it"
                .into(),
            instead: "use the integrator momentum-euler".into(),
        });
    }
    let mut shapes = Vec::with_capacity(p.scene.bodies.len());
    for (body, surface) in p.scene.bodies.iter().zip(p.surfaces) {
        shapes.push(match (&body.shape, surface) {
            (Some(shape), Some(surface)) => {
                Some(Geometry::new(&body.name, shape, &body.shape_at, &surface.mesh)?)
            }
            _ => None,
        });
    }
    let neighbours = |a: usize, b: usize| {
        p.scene.wet_parent(a) == Some(b) || p.scene.wet_parent(b) == Some(a)
    };
    let pairs: Vec<ContactPair> = (p.clearance.moving.pairs().iter())
        .filter(|(a, other)| !matches!(other, Other::Body(b) if neighbours(*a, *b)))
        .map(|&(first, second)| ContactPair { first, second })
        .collect();
    let shapes = Contacts::new(shapes, &p.scene.walls, &pairs);
    let gaps = (shapes.pairs().iter())
        .map(|pair| p.given.gap.unwrap_or_else(|| resolved(&p, pair)))
        .collect();
    let dt = p.settings.time_step.unwrap_or(p.scene.time_step);
    let moving = |b: &usize| !p.scene.is_static(*b);
    let bodies = || (0..p.scene.bodies.len()).filter(moving);
    let heaviest = bodies().map(|b| p.mass[b]).fold(0.0, f64::max);
    let stiffness = p.given.stiffness.unwrap_or(STIFFNESS * heaviest / (dt * dt));
    if stiffness <= 0.0 {
        return Err(Error::input(
            "contact.stiffness",
            stiffness,
            "no moving body has mass to take a default from: give a stiffness, N/m",
        ));
    }
    let smallest = bodies()
        .filter_map(|b| shapes.shape(b).map(Geometry::radius))
        .fold(f64::INFINITY, f64::min);
    let width = match p.given.width {
        Some(width) => width,
        None if smallest.is_finite() => WIDTH * smallest,
        None => WIDTH,
    };
    let model = ContactModel {
        shapes,
        gaps,
        regularisation: Regularisation {
            stiction_speed: p.given.stiction_speed,
            width,
            horizon: dt,
        },
    };
    let parameters = dynamics::Contact {
        stiffness,
        dissipation: p.given.dissipation,
        friction: p.given.friction,
    };
    Ok((model, parameters))
}

/// The gap that the coupling resolves between a pair, m.
fn resolved(p: &Parts, pair: &ContactPair) -> f64 {
    let edge = |b: usize| p.surfaces[b].as_ref().map_or(0.0, |s| mean_edge(&s.mesh));
    let of = |value: &dyn Fn(usize) -> f64| match pair.second {
        Other::Body(b) => value(pair.first).max(value(b)),
        // The image is twice as far away.
        Other::Wall(_) => 0.5 * value(pair.first),
    };
    match p.fidelity {
        Fidelity::Isolated => 0.0,
        Fidelity::Reduced => of(&|b| p.resolved[b]),
        Fidelity::Full | Fidelity::Auto => EDGES * of(&edge),
    }
}

/// Edge of the equilateral triangle of mean area.
fn mean_edge(mesh: &TriMesh) -> f64 {
    let area: f64 = (0..mesh.faces().len()).map(|f| mesh.area(f)).sum();
    (4.0 / 3.0_f64.sqrt() * area / mesh.faces().len() as f64).sqrt()
}
