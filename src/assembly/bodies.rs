//! What bodies of a scene start from, and their surfaces as forces see them.

use crate::Result;
use crate::adjoint::drag::Element;
use crate::adjoint::lie::{Mat3, Vec3};
use crate::adjoint::waterline::Hull;
use crate::dynamics::BodyValues;
use crate::geometry::{MassProperties, TriMesh};
use crate::scene::{Body, Scene, Shape};
use crate::shape::build;
use std::f64::consts::PI;
use std::path::Path;

/// What a body starts from, whose shape has these properties.
pub(super) fn body_values(
    scene: &Scene,
    body: &Body,
    properties: Option<&MassProperties>,
) -> BodyValues {
    let own = inertia(body, properties);
    let floats = scene.floats().filter(|float| float.body == body.name);
    let (mass, center_of_mass, inertia) = floats.fold(own, |all, float| {
        with_point_mass(all, float.mass, &float.at.into())
    });
    let centroid = properties.map_or(own.1, |p| p.centroid);
    BodyValues {
        name: body.name.clone(),
        mass,
        inertia,
        center_of_mass,
        volume: body.volume.or(properties.map(|p| p.volume)),
        center_of_buoyancy: body.center_of_buoyancy.map_or(centroid, Vec3::from),
    }
}

/// Mass, centre of mass and inertia of a body.
fn inertia(body: &Body, properties: Option<&MassProperties>) -> (f64, Vec3, [f64; 6]) {
    let mass = body.mass.unwrap_or_else(|| {
        let volume = properties.map_or(0.0, |p| p.volume);
        body.density.unwrap_or(0.0) * volume
    });
    let center = body
        .center_of_mass
        .map(Vec3::from)
        .unwrap_or_else(|| properties.map_or(Vec3::zeros(), |p| p.centroid));
    let six = match (&body.inertia, properties) {
        (Some(given), _) => std::array::from_fn(|k| given.get(k).copied().unwrap_or(0.0)),
        (None, Some(p)) => {
            let i = p.inertia * (mass / p.volume);
            [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(|at| i[at])
        }
        (None, None) => [0.0; 6],
    };
    (mass, center, six)
}

/// The same with a mass at a point: by the theorem of Steiner and Huygens for both about their common centre.
fn with_point_mass(
    (mass, center, inertia): (f64, Vec3, [f64; 6]),
    point_mass: f64,
    point: &Vec3,
) -> (f64, Vec3, [f64; 6]) {
    let total = mass + point_mass;
    if point_mass == 0.0 || total == 0.0 {
        return (mass, center, inertia);
    }
    let apart = point - center;
    let reduced = mass * (point_mass / total);
    let added = reduced * (Mat3::identity() * apart.norm_squared() - apart * apart.transpose());
    let mut six = inertia;
    for (x, at) in six
        .iter_mut()
        .zip([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)])
    {
        *x += added[at];
    }
    (total, center + apart * (point_mass / total), six)
}

pub(super) fn elements(mesh: &TriMesh) -> Vec<Element> {
    (0..mesh.faces().len())
        .map(|f| Element {
            center: mesh.centroid(f),
            normal: mesh.normal(f),
            area: mesh.area(f),
        })
        .collect()
}

/// What is buoyant of a body without a shape, a ball of its volume: how it comes through the surface isn't known any better.
pub(super) fn ball(values: &BodyValues) -> Result<Option<Hull>> {
    let Some(volume) = values.volume.filter(|v| *v > 0.0) else {
        return Ok(None);
    };
    let radius = (0.75 / PI * volume).cbrt();
    let mesh = build(&Shape::sphere(radius), Path::new(""), None)?;
    Ok(Some(hull(&mesh)))
}

pub(super) fn hull(mesh: &TriMesh) -> Hull {
    Hull {
        vertices: mesh.vertices().to_vec(),
        faces: mesh.faces().to_vec(),
    }
}
