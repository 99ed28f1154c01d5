//! Shapes that are parameters: declared, with what of their bodies follows from them.

use super::bodies::{body_values, elements, hull};
use crate::adjoint::lie::Pose;
use crate::contact::{ContactShape, Contacts};
use crate::dynamics::force::{ChangedSurface, Lubricated};
use crate::dynamics::{
    BodyValues, ChangedShape, Declarations, Declared, Follows, Owner, Parameter, Range, Shapes,
    body_places,
};
use crate::scene::Scene;
use crate::water::{ShapeChange, Surface, pose};
use crate::{Error, Result};
use std::path::Path;

/// Names that parameters of shapes begin with, and their units.
const NAMES: [(&str, &str); 7] = [
    ("radius", "m"),
    ("length", "m"),
    ("semi_axes", "m"),
    ("size", "m"),
    ("profile", "m"),
    ("vertex", "m"),
    ("scale", "1"),
];

/// Numbers of a body that may follow from its shape.
const NUMBERS: usize = 14;

/// Declares the parameters of `changes`, whose bodies in the water are `in_water`, and finds what follows from them.
///
/// # Errors
/// A formula whose numbers left what they may be.
pub(super) fn declare(
    scene: &Scene,
    changes: &[ShapeChange],
    in_water: &[usize],
    surfaces: &[Option<Surface>],
    declared: &mut Declarations,
) -> Result<Shapes> {
    let mut out = Shapes::default();
    for change in changes {
        let Some(surface) = &surfaces[change.body] else {
            continue;
        };
        let shape = one(change, declared)?;
        out.all.push(shape);
        if in_water.contains(&change.body) {
            out.water.push(shape);
        }
        let body = &scene.bodies[change.body];
        let slopes = change.slope(|t| {
            let properties = change.properties(surface, t)?;
            Ok(numbers(&body_values(scene, body, Some(&properties))))
        })?;
        let followers = body_places(change.body).into_iter().zip(slopes);
        out.follows
            .extend(
                followers
                    .filter(|(_, slope)| *slope != 0.0)
                    .map(|(follower, slope)| Follows {
                        shape,
                        follower,
                        slope,
                    }),
            );
    }
    Ok(out)
}

/// Part of a length by which surfaces are changed where forces take differences: these err by its square, and by rounding over it.
const STEP: f64 = 1e-5;

/// Surfaces changed by the parameters `shapes`, for forces that follow from them.
pub(super) fn changed_surfaces<'a>(
    changes: &'a [ShapeChange],
    shapes: &Shapes,
    surfaces: &'a [Option<Surface>],
) -> Vec<ChangedSurface<'a>> {
    let changed = |(change, parameter): (&'a ShapeChange, &Parameter)| {
        let surface = surfaces[change.body].as_ref()?;
        let (mesh, given) = (&surface.mesh, surface.given());
        Some(ChangedSurface {
            body: change.body,
            parameter: *parameter,
            step: STEP * change.size,
            surface: Box::new(move |t| elements(&change.moved(mesh, t))),
            hull: Box::new(move |t| hull(&change.moved(given, t))),
        })
    };
    changes
        .iter()
        .zip(&shapes.all)
        .filter_map(changed)
        .collect()
}

/// The contact shapes of all bodies with each parameter changed.
///
/// # Errors
/// A mesh that is convex, but not with one of its vertices moved.
pub(super) fn changed_contacts(
    scene: &Scene,
    changes: &[ShapeChange],
    shapes: &Shapes,
    surfaces: &[Option<Surface>],
    contacts: &Contacts,
) -> Result<Vec<ChangedShape>> {
    let mut out = Vec::new();
    for (change, parameter) in changes.iter().zip(&shapes.all) {
        let body = &scene.bodies[change.body];
        // Pieces for contact stand for themselves.
        let (Some(surface), true) = (&surfaces[change.body], body.collision.is_empty()) else {
            continue;
        };
        let step = CONTACT_STEP * change.size;
        let at = |t: f64| {
            let shape = match change.formula(t) {
                Some(shape) if !shape.is_mesh() => {
                    ContactShape::of_shape(&shape, pose(&body.shape_at), Path::new(""))
                }
                _ => ContactShape::of_mesh(&change.moved(surface.given(), t), Pose::identity()),
            };
            let shape = shape.map_err(|e| Error::Unsupported {
                what: format!(
                    "contact of body {:?} with its shape parameter {}",
                    body.name, change.name
                ),
                why: e.to_string(),
                instead:
                    "give it convex pieces for contact (`collision`), which stand for themselves"
                        .into(),
            })?;
            Ok::<_, Error>(contacts.with_piece(change.body, shape))
        };
        out.push(ChangedShape {
            body: change.body,
            parameter: *parameter,
            step,
            reach: step * change.reach(&surface.mesh),
            shapes: [at(step)?, at(-step)?],
        });
    }
    Ok(out)
}

/// As [`STEP`], for places where surfaces are near: smaller, lest a place that is there on one side is gone on the other.
const CONTACT_STEP: f64 = 1e-6;

/// Refuses what has no derivative with respect to shapes.
///
/// # Errors
/// A force that acts on a body whose shape is a parameter.
pub(super) fn refuse(
    scene: &Scene,
    changes: &[ShapeChange],
    lubricated: &[Lubricated],
    streams: bool,
) -> Result<()> {
    for change in changes {
        let name = &scene.bodies[change.body].name;
        let gap = |l: &&Lubricated| l.first == change.body || l.second == Some(change.body);
        let what = match lubricated.iter().find(gap) {
            Some(found) => scene.force_name(found.force),
            None if streams => "a force of kind current".into(),
            None => continue,
        };
        return Err(Error::Unsupported {
            what: format!("shape parameter {name}.{} beside {what:?}", change.name),
            why: "that force has no derivative with respect to shapes".into(),
            instead: "leave the force out, or the shape as it is".into(),
        });
    }
    Ok(())
}

/// Declares one.
fn one(change: &ShapeChange, declared: &mut Declarations) -> Result<Parameter> {
    let (head, part) = match change.name.split_once('.') {
        Some((head, part)) => (head, Some(part)),
        None => (change.name.as_str(), None),
    };
    let known = NAMES.iter().find(|(name, _)| *name == head);
    let (name, unit) = known.ok_or_else(|| {
        let right = format!("must begin with one of {:?}", NAMES.map(|(name, _)| name));
        Error::input("name of a shape parameter", &change.name, right)
    })?;
    let (owner, form) = (
        Owner::Body(change.body),
        Declared::new(name, unit)
            .range(Range::Built(change.value))
            .size(|value, typical| value.abs().max(0.05 * typical.length)),
    );
    Ok(match part {
        Some(part) => declared.declare_part(owner, form, part, change.value),
        None => declared.declare(owner, form, change.value),
    })
}

/// In the order of [`body_places`].
fn numbers(values: &BodyValues) -> [f64; NUMBERS] {
    let mut out = [0.0; NUMBERS];
    out[0] = values.mass;
    out[1..7].copy_from_slice(&values.inertia);
    out[7..10].copy_from_slice(values.center_of_mass.as_slice());
    out[10] = values.volume.unwrap_or(0.0);
    out[11..].copy_from_slice(values.center_of_buoyancy.as_slice());
    out
}
