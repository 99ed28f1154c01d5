//! Contact of a scene: which surfaces may touch, at which gap, and how stiffly.

use crate::adjoint::contact::Law;
use crate::adjoint::lie::Pose;
use crate::contact::{ContactPair, ContactShape, Contacts};
use crate::dynamics::{ContactModel, Integrator, Parameters};
use crate::geometry::Other;
use crate::scene::{Body, Contact, Scene, Shape};
use crate::water::{Prepared, Surface, pose};
use crate::{Error, Result};
use std::path::Path;

/// Of the heaviest moving mass (a joint's inertia, for its limits) over Δt²: within a step contact takes ten elevenths of the way that it would go too far.
pub(super) const STIFFNESS: f64 = 10.0;
/// Half the width over which the force sets in, of the smallest body's radius.
const WIDTH: f64 = 0.004;
/// Gap at which surfaces touch, of what the coupling resolves: a body that lands goes a little further.
const ROOM: f64 = 1.25;
/// The same where the water isn't solved, of the smallest body's radius: distances are smooth outside a body only.
const SKIN: f64 = 0.01;

/// Refuses contact with an integrator that doesn't solve it.
pub(super) fn check_integrator(scene: &Scene, integrator: Integrator) -> Result<()> {
    if !scene.has_contact() || integrator.solves_contact() {
        return Ok(());
    }
    let what = match (scene.contact, scene.limited().next()) {
        (None, Some((b, _))) => format!("limits of body {:?}", scene.bodies[b].name),
        _ => "contact".into(),
    };
    Err(Error::Unsupported {
        what: format!("{what} with the integrator {integrator:?}"),
        why: "contact and limits of joints are solved in the velocity that a step moves by, and this one has none".into(),
        instead: "use the integrator momentum-euler, midpoint or velocity-euler".into(),
    })
}

/// Contact as `given`, of bodies with these surfaces, at steps of `dt` s; its parameters are set.
pub(super) fn assemble(
    scene: &Scene,
    given: &Contact,
    dt: f64,
    water: &Prepared,
    surfaces: &[Option<Surface>],
    parameters: &mut Parameters,
) -> Result<ContactModel> {
    let mut shapes = Vec::with_capacity(scene.bodies.len());
    for (body, surface) in scene.bodies.iter().zip(surfaces) {
        shapes.push(match (&body.shape, surface) {
            (Some(shape), Some(surface)) => Some(contact_shape(body, shape, surface)?),
            _ => None,
        });
    }
    let neighbours = |a: usize, b: usize| {
        scene.submerged_parent(a) == Some(b) || scene.submerged_parent(b) == Some(a)
    };
    let pairs: Vec<ContactPair> = (water.clearance.moving.pairs().iter())
        .filter(|(a, other)| !matches!(other, Other::Body(b) if neighbours(*a, *b)))
        .map(|&(first, second)| ContactPair { first, second })
        .collect();
    let shapes = Contacts::new(shapes, &scene.walls, &pairs)?;
    let moving = |b: &usize| !scene.is_static(*b);
    let bodies = || (0..scene.bodies.len()).filter(moving);
    let size = bodies()
        .filter_map(|b| shapes.shape(b).map(ContactShape::radius))
        .reduce(f64::min)
        .unwrap_or(1.0);
    let heaviest = bodies().map(|b| parameters.mass(b)).fold(0.0, f64::max);
    let stiffness = (given.stiffness).unwrap_or(STIFFNESS * heaviest / (dt * dt));
    if stiffness <= 0.0 {
        return Err(Error::input(
            "contact.stiffness",
            stiffness,
            "no moving body has mass to take a default from: give a stiffness, N/m",
        ));
    }
    let width = given.width.unwrap_or(WIDTH * size);
    let gap = |pair: &ContactPair| (ROOM * resolved(water, surfaces, pair)).max(SKIN * size);
    let law = |pair: &ContactPair| Law {
        stiffness,
        dissipation: given.dissipation,
        friction: given.friction,
        stiction_speed: given.stiction_speed,
        gap: given.gap.unwrap_or_else(|| gap(pair)),
        width,
        horizon: dt,
    };
    let laws = shapes.pairs().iter().map(law).collect();
    parameters.add_contact([stiffness, given.dissipation, given.friction]);
    Ok(ContactModel {
        shapes,
        laws,
        rigid: given.stiffness.is_none(),
    })
}

/// Shape of a body: by its formula, or a mesh that is convex.
fn contact_shape(body: &Body, shape: &Shape, surface: &Surface) -> Result<ContactShape> {
    let made = match shape {
        // Already placed in its body.
        mesh if mesh.is_mesh() => ContactShape::of_mesh(&surface.mesh, Pose::identity()),
        _ => ContactShape::of_shape(shape, pose(&body.shape_at), Path::new("")),
    };
    made.map_err(|e| Error::Unsupported {
        what: format!("contact of body {:?}", body.name),
        why: e.to_string(),
        instead: "give it a convex shape, or convex bodies fixed to it".into(),
    })
}

/// The gap that the coupling resolves between a pair, m.
fn resolved(water: &Prepared, surfaces: &[Option<Surface>], pair: &ContactPair) -> f64 {
    let of = |b: usize| {
        let edge = surfaces[b].as_ref().map_or(0.0, Surface::mean_edge);
        (water.fidelity.kind()).resolved_gap(water.resolved[b], edge)
    };
    match pair.second {
        Other::Body(b) => of(pair.first).max(of(b)),
        // The image is twice as far away.
        Other::Wall(_) => 0.5 * of(pair.first),
    }
}
