//! Contact of a scene: which surfaces may touch, at which gap, and how stiffly.

use super::Choices;
use crate::adjoint::contact::Law;
use crate::adjoint::lie::{Pose, Vec3};
use crate::contact::{ContactShape, Contacts};
use crate::dynamics::{ContactGap, ContactLaws, ContactModel, Integrator, Parameters};
use crate::scene::{Body, Contact, Scene, Shape};
use crate::water::{Prepared, Surface, pose};
use crate::{Error, Result};
use std::path::Path;

/// Of the heaviest moving mass (a joint's inertia, for its limits) over Δt²: within a step contact takes ten elevenths of the way that it would go too far.
pub(super) const STIFFNESS: f64 = 10.0;
/// Added mass of a plate of area A at a gap h, ρ A²/h, in that: 0.035 of a square, 1/8π of a disc.
const PLATE: f64 = 0.04;
/// The same as [`STIFFNESS`] of what it weighs: ω Δt is no less than 1.6, and little comes back.
const OF_PLATE: f64 = 2.5;
/// How deep in the gap at which surfaces touch a body may rest that carries all that moves, of that.
const SUNK: f64 = 0.5;
/// Half the width over which the force sets in, of the smallest body's radius.
const WIDTH: f64 = 0.004;
/// Gap at which surfaces touch, of the smallest body's radius: distances are smooth outside a body only.
const SKIN: f64 = 0.01;
/// The least, of what sources resolve, without which the flow has no sense: a body that lands goes a little further.
const ROOM: f64 = 1.25;

/// Of the size of the smaller body, a gap at which surfaces touch that the user is told of.
const WIDE: f64 = 0.05;

/// How far a piece for contact may reach out of its body's bounds, in their diagonal.
const OUTSIDE: f64 = 0.05;

/// Refuses contact with an integrator that doesn't solve it.
pub(super) fn check_integrator(scene: &Scene, integrator: Integrator) -> Result<()> {
    if !scene.has_contact() || integrator.solves_contact() {
        return Ok(());
    }
    let what = solved(scene);
    Err(Error::Unsupported {
        what: format!("{what} with the integrator {integrator:?}"),
        why: "contact, limits of joints and viscous water in gaps are solved in the velocity that a step moves by, and this one has none".into(),
        instead: "use the integrator momentum-euler, energy-euler, midpoint or velocity-euler".into(),
    })
}

/// What of a scene is solved with contact.
fn solved(scene: &Scene) -> String {
    match (
        scene.contact,
        scene.limited().next(),
        scene.lubrications().next(),
    ) {
        (None, Some((b, _)), _) => format!("limits of body {:?}", scene.bodies[b].name),
        (None, None, Some((i, _))) => format!("{:?}", scene.force_name(i)),
        _ => "contact".into(),
    }
}

/// Why another integrator stands in for the preset's, where one does.
pub(super) fn stand_in(scene: &Scene, choices: &Choices) -> Option<String> {
    let [used, instead] = [choices.integrator, choices.in_place_of?].map(<&str>::from);
    let why = match (scene.has_contact(), scene.resisting()) {
        (false, Some(body)) => format!(
            "what the joint of body {:?} resists with (`passive`, `servo`) is taken implicitly, which is stable however stiff",
            body.name
        ),
        _ => format!("{} asks for one that solves contact", solved(scene)),
    };
    let carriers = scene.carriers();
    let swinging = carriers.articulated().map(|b| &scene.bodies[b].name);
    let order = match (choices.integrator, swinging) {
        (Integrator::Midpoint, _) => "it is of second order but for servos and where something presses".into(),
        (_, Some(name)) => format!(
            "it is of first order, and errs by what body {name:?} and those that carry it have of speed: where they move fast and hardly touch take midpoint, which is of second order where nothing presses"
        ),
        (_, None) => "it is of first order; midpoint does that, too, and is of second order but for servos and where something presses".into(),
    };
    Some(format!(
        "the integrator {used} in place of {instead}: {why}; {order}"
    ))
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
            (Some(_), Some(surface)) if !body.collision.is_empty() => pieces(body, surface)?,
            (Some(shape), Some(surface)) => vec![contact_shape(body, shape, surface)?],
            _ => Vec::new(),
        });
    }
    let carriers = scene.carriers();
    let linked = (0..scene.bodies.len()).filter_map(|b| Some((carriers.submerged_parent(b)?, b)));
    let pairing = water.clearance.moving.pairing().clone().but(linked);
    let shapes = Contacts::new(shapes, &scene.walls, pairing)?;
    let moving = |b: &usize| !carriers.is_static(*b);
    let bodies = || (0..scene.bodies.len()).filter(moving);
    let size = bodies()
        .filter_map(|b| shapes.radius(b))
        .reduce(f64::min)
        .unwrap_or(1.0);
    // What is lighter than the water that it displaces presses, and moves, as that does.
    let weight = |b: usize| {
        let displaced = parameters.density() * parameters.volume(b);
        parameters.mass(b).max(displaced)
    };
    let heaviest = bodies().map(weight).fold(0.0, f64::max);
    let wet = scene.fluid.density > 0.0 && water.fidelity.kind().coupled();
    // A plate that lands carries the water under it, which may be a thousand times as heavy.
    let gap = given.gap.unwrap_or(SKIN * size);
    let film = |b: usize| {
        let flat = surfaces[b].as_ref().map_or(0.0, |s| s.mesh.largest_flat());
        PLATE * parameters.density() * flat * flat / gap
    };
    let films = match wet && solves_thin(water) && gap > 0.0 {
        true => bodies().map(film).fold(0.0, f64::max),
        false => 0.0,
    };
    // Small bodies have a thin gap to rest in, however long the step is; and in a heap one may carry all others.
    let pressing =
        |b: usize| (parameters.mass(b) - parameters.density() * parameters.volume(b)).abs();
    let load = bodies().map(pressing).sum::<f64>() * Vec3::from(scene.gravity).norm();
    let held = match gap > 0.0 {
        true => load / (SUNK * gap),
        false => 0.0,
    };
    let stiffness = (given.stiffness)
        .unwrap_or(((STIFFNESS * heaviest).max(OF_PLATE * films) / (dt * dt)).max(held));
    if stiffness <= 0.0 {
        return Err(Error::input(
            "contact.stiffness",
            stiffness,
            "no moving body has mass to take a default from: give a stiffness, N/m",
        ));
    }
    let width = given.width.unwrap_or(WIDTH * size);
    let each = (0..scene.bodies.len()).map(|b| ROOM * resolved(water, surfaces, b));
    let laws = ContactLaws {
        common: Law {
            stiffness,
            dissipation: given.dissipation,
            friction: given.friction,
            torsional_friction: given.torsional_friction,
            rolling_friction: given.rolling_friction,
            stiction_speed: given.stiction_speed,
            stiction_spin: f64::INFINITY,
            gap: 0.0,
            width,
            horizon: dt,
        },
        gap: given.gap,
        least: SKIN * size,
        each: each.collect(),
        radii: (0..scene.bodies.len()).map(|b| shapes.radius(b)).collect(),
    };
    parameters.add_contact([
        stiffness,
        given.dissipation,
        given.friction,
        given.torsional_friction,
        given.rolling_friction,
    ]);
    Ok(ContactModel {
        shapes,
        changed: Vec::new(),
        laws,
        rigid: given.stiffness.is_none(),
        wet,
    })
}

/// What the user should know of the gaps at which surfaces touch, of bodies with these surfaces.
pub(super) fn warnings(
    scene: &Scene,
    given: &Contact,
    water: &Prepared,
    surfaces: &[Option<Surface>],
    model: &ContactModel,
) -> Vec<String> {
    let narrow = narrow(scene, water, surfaces, model);
    wide(scene, given, model)
        .into_iter()
        .chain(narrow)
        .collect()
}

/// The gap that is narrowest against what the coupling resolves, if it is under that.
fn narrow(
    scene: &Scene,
    water: &Prepared,
    surfaces: &[Option<Surface>],
    model: &ContactModel,
) -> Option<String> {
    if scene.fluid.density <= 0.0 || !solves_thin(water) {
        return None;
    }
    let edges = water.clearance.resolved_edges;
    let least = |gap: &ContactGap| {
        let both = [Some(gap.first), gap.second].into_iter().flatten();
        let of = both.filter_map(|b| Some(surfaces[b].as_ref()?.mean_edge()));
        edges * of.fold(0.0, f64::max)
    };
    let all = model.gaps().map(|gap| (gap, least(&gap)));
    let under = all.filter(|(gap, least)| gap.gap < *least);
    let (gap, least) = under.max_by(|a, b| (a.1 / a.0.gap).total_cmp(&(b.1 / b.0.gap)))?;
    Some(format!(
        "{} touch at a gap of {:.3e} m, less than the {least:.3e} m ({edges} of the faces' edges) down to which forces of the water are resolved: \
         once they do, forces across it may be off by 10 % and more (estimated; `check_gap` measures by how much); use more faces, or give a larger contact.gap",
        between(scene, &gap),
        gap.gap
    ))
}

fn between(scene: &Scene, gap: &ContactGap) -> String {
    let name = |b: usize| format!("body {:?}", scene.bodies[b].name);
    let other = gap.second.map_or("a wall".into(), name);
    format!("{} and {other}", name(gap.first))
}

/// The largest gap, as a part of a body, if that is no small part.
fn wide(scene: &Scene, given: &Contact, model: &ContactModel) -> Option<String> {
    let wide = || model.gaps().filter(|g| g.part > WIDE);
    let worst = wide().max_by(|a, b| a.part.total_cmp(&b.part))?;
    let more = match wide().count() - 1 {
        0 => String::new(),
        n => format!("; {n} more pairs are over {:.0} %", 100.0 * WIDE),
    };
    let why = match given.gap {
        Some(_) => "as contact.gap says",
        None => {
            "since the coupling resolves no less: resolve more (`films`, `accuracy`, more faces), or give contact.gap, if forces of the water that \
             aren't resolved will do"
        }
    };
    Some(format!(
        "{} touch at a gap of {:.3e} m, {:.0} % of the smaller one's size, {why}{more}",
        between(scene, &worst),
        worst.gap,
        100.0 * worst.part
    ))
}

/// Shape of a body: by its formula, or a mesh that is convex.
fn contact_shape(body: &Body, shape: &Shape, surface: &Surface) -> Result<ContactShape> {
    let made = match shape {
        // Already placed in its body.
        mesh if mesh.is_mesh() => ContactShape::of_mesh(surface.given(), Pose::identity()),
        _ => ContactShape::of_shape(shape, pose(&body.shape_at), Path::new("")),
    };
    made.map_err(|e| Error::Unsupported {
        what: format!("{}contact of body {:?}", body.origin.surface(None), body.name),
        why: e.to_string(),
        instead: "give it a convex shape, or convex pieces for contact: `collision = [{ shape = …, at = … }, …]`"
            .into(),
    })
}

/// The convex pieces that a body is for contact, which must lie about where its surface is.
fn pieces(body: &Body, surface: &Surface) -> Result<Vec<ContactShape>> {
    let vertices = surface.mesh.vertices();
    let start = [Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY)];
    let [low, high] = (vertices.iter()).fold(start, |[low, high], x| [low.inf(x), high.sup(x)]);
    let room = Vec3::repeat(OUTSIDE * (high - low).norm());
    let mut out = Vec::with_capacity(body.collision.len());
    for (k, piece) in body.collision.iter().enumerate() {
        let place = format!("body {:?}: collision[{k}]", body.name);
        let made = ContactShape::of_shape(&piece.shape, pose(&piece.at), Path::new(""));
        let made = made.map_err(|e| Error::Unsupported {
            what: format!("{}{place}", body.origin.surface(Some(k))),
            why: e.to_string(),
            instead: "give a convex shape, or several".into(),
        })?;
        let [from, to] = made.bounds();
        let beyond = (low - room - from).sup(&(to - high - room));
        if beyond.max() > 0.0 {
            let range = |[a, b]: [Vec3; 2]| format!("{:?} to {:?} m", a.as_slice(), b.as_slice());
            return Err(Error::input(
                place,
                format!("reaches from {}", range([from, to])),
                format!(
                    "must lie where the body's shape is, from {} (give or take {OUTSIDE} of the diagonal), since the water sees that one: \
                     `at` places a piece in the body's frame",
                    range([low, high])
                ),
            ));
        }
        out.push(made);
    }
    Ok(out)
}

/// Whether the flow in a gap has sense however narrow it is.
fn solves_thin(water: &Prepared) -> bool {
    let kind = water.fidelity.kind();
    kind.coupled() && (water.clearance.films || !(kind.compresses() || water.clearance.by_sources))
}

/// The gap between a body and others below which the flow has no sense, m.
fn resolved(water: &Prepared, surfaces: &[Option<Surface>], b: usize) -> f64 {
    if solves_thin(water) {
        return 0.0;
    }
    let edge = surfaces[b].as_ref().map_or(0.0, Surface::mean_edge);
    (water.fidelity.kind()).resolved_gap(water.gap_model.resolved[b].everywhere, edge)
}
