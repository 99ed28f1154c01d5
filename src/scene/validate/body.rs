//! One body: shape, mass, joint, drag.

use nalgebra::Matrix6;

use super::{bounded, finite, limits, list, mimic, passive, place, rotation, servo};
use crate::geometry::impossible_inertia;
use crate::scene::{Body, Carriers, Motion, Scene, Shape};
use crate::{Error, Result};

pub(super) fn check(scene: &Scene, carriers: &Carriers, index: usize) -> Result<()> {
    let body = &scene.bodies[index];
    for (field, placement) in [("shape_at", &body.shape_at), ("placement", &body.placement)] {
        finite(
            &place(body, &format!("{field}.position")),
            &placement.position,
        )?;
        rotation(
            &place(body, &format!("{field}.rotation")),
            &placement.rotation,
        )?;
    }
    check_shape(body)?;
    check_collision(body)?;
    check_mass(body, carriers.is_static(index))?;
    check_buoyancy(body)?;
    if let Some(rows) = &body.added_mass {
        check_added_mass(body, rows)?;
    }
    mimic::check(scene, body)?;
    check_joint(body)?;
    if body.thruster && carriers.is_static(index) {
        return Err(Error::input(
            place(body, "thruster"),
            true,
            "the body can't move, so a thruster does nothing; give it a joint or take it away",
        ));
    }
    check_overlap(scene, carriers, index)?;
    check_drag(body)
}

fn check_overlap(scene: &Scene, carriers: &Carriers, index: usize) -> Result<()> {
    let body = &scene.bodies[index];
    if !body.overlaps_parent {
        return Ok(());
    }
    let refused = |remedy: &str| {
        let place = place(body, "overlaps_parent");
        Err(Error::input(place, true, remedy.to_owned()))
    };
    match (&body.parent, &body.shape) {
        (None, _) => refused(
            "the body has no parent, and only links of one mechanism may overlap: name the parent, \
             or take `overlaps_parent` away and move the bodies apart",
        ),
        (_, None) => refused(
            "the body has no shape that could overlap: take `overlaps_parent` away, or give it one",
        ),
        _ if carriers.submerged_parent(index).is_none() => refused(
            "none of the bodies that carry this one has a shape to overlap: take `overlaps_parent` \
             away",
        ),
        _ => Ok(()),
    }
}

fn check_shape(body: &Body) -> Result<()> {
    crate::geometry::validate_refinements(&body.refine, &format!("body {:?}", body.name))?;
    let Some(shape) = &body.shape else {
        if !body.refine.is_empty() {
            return Err(Error::input(
                place(body, "refine"),
                "regions without a shape",
                "there are no faces to make smaller: add a shape or take the regions away",
            ));
        }
        return Ok(());
    };
    check_surface(body, shape, "shape")
}

fn check_surface(body: &Body, shape: &Shape, field: &str) -> Result<()> {
    if let Shape::Mesh { path, .. } = shape
        && path.as_os_str().is_empty()
    {
        return Err(Error::input(
            place(body, &format!("{field}.path")),
            "nothing",
            "give the path of an OBJ, STL, PLY or DAE file",
        ));
    }
    crate::shape::validate(shape, &place(body, field))
}

/// The convex pieces that the body is for contact; whether they are convex and where the body is shows once they are made.
fn check_collision(body: &Body) -> Result<()> {
    if body.shape.is_none() && !body.collision.is_empty() {
        return Err(Error::input(
            place(body, "collision"),
            format!("{} pieces without a shape", body.collision.len()),
            "they stand for the body's shape in contact: add the shape, or take the pieces away",
        ));
    }
    for (k, piece) in body.collision.iter().enumerate() {
        let field = format!("collision[{k}]");
        let at = |name: &str| place(body, &format!("{field}.at.{name}"));
        finite(&at("position"), &piece.at.position)?;
        rotation(&at("rotation"), &piece.at.rotation)?;
        check_surface(body, &piece.shape, &format!("{field}.shape"))?;
    }
    Ok(())
}

fn check_mass(body: &Body, is_static: bool) -> Result<()> {
    for (field, value) in [("mass", body.mass), ("density", body.density)] {
        let Some(value) = value else { continue };
        let remedy = "give zero (a massless link) or more";
        bounded(&place(body, field), value, true, remedy)?;
    }
    if let Some(center) = &body.center_of_mass {
        finite(&place(body, "center_of_mass"), center)?;
    }
    if let Some(inertia) = &body.inertia {
        check_inertia(body, inertia)?;
    }
    match (body.mass, body.density) {
        (Some(mass), Some(density)) => Err(Error::input(
            place(body, "mass"),
            format!("{mass} beside density {density}"),
            "give either the mass or the density, not both",
        )),
        (None, Some(density)) if body.shape.is_none() => Err(Error::input(
            place(body, "density"),
            density,
            "there is no shape whose volume would make it a mass; add a shape, or give mass and \
             inertia",
        )),
        (None, None) if !is_static => Err(Error::input(
            place(body, "mass"),
            "neither mass nor density",
            "a body that moves needs one of them (mass = 0 is allowed for massless links)",
        )),
        (Some(mass), None) if mass > 0.0 && body.shape.is_none() && body.inertia.is_none() => {
            Err(Error::input(
                place(body, "inertia"),
                "nothing",
                "there is no shape to take it from: give xx, yy, zz in kg m² (three zeros for a \
                 point mass)",
            ))
        }
        _ => Ok(()),
    }
}

fn check_buoyancy(body: &Body) -> Result<()> {
    if let Some(volume) = body.volume {
        let remedy = "give zero or more, in m³: what the body is buoyant by";
        bounded(&place(body, "volume"), volume, true, remedy)?;
    }
    let Some(center) = &body.center_of_buoyancy else {
        return Ok(());
    };
    let place = place(body, "center_of_buoyancy");
    finite(&place, center)?;
    match body.shape.is_some() || body.volume.is_some() {
        true => Ok(()),
        false => Err(Error::input(
            place,
            list(center),
            "nothing is buoyant there: give the body a shape or a `volume`",
        )),
    }
}

/// Symmetric positive semi-definite, with principal moments that a mass distribution can have.
fn check_inertia(body: &Body, inertia: &[f64]) -> Result<()> {
    let place = place(body, "inertia");
    finite(&place, inertia)?;
    let (xy, xz, yz) = match inertia {
        [_, _, _] => (0.0, 0.0, 0.0),
        [_, _, _, xy, xz, yz] => (*xy, *xz, *yz),
        _ => {
            return Err(Error::input(
                place,
                format!("{} numbers", inertia.len()),
                "give 3 (xx, yy, zz) or 6 (xx, yy, zz, xy, xz, yz), in kg m²",
            ));
        }
    };
    let six = [inertia[0], inertia[1], inertia[2], xy, xz, yz];
    let wrong = impossible_inertia(&six, 1e-9);
    wrong.map_or(Ok(()), |why| Err(Error::input(place, list(inertia), why)))
}

fn check_added_mass(body: &Body, rows: &[Vec<f64>]) -> Result<()> {
    let place = place(body, "added_mass");
    if rows.len() != 6 || rows.iter().any(|row| row.len() != 6) {
        let lengths: Vec<_> = rows.iter().map(Vec::len).collect();
        return Err(Error::input(
            place,
            format!("rows of {lengths:?} numbers"),
            "give 6 rows of 6 numbers: linear x y z, then angular x y z",
        ));
    }
    for (i, row) in rows.iter().enumerate() {
        finite(&format!("{place}[{i}]"), row)?;
    }
    let matrix = Matrix6::from_fn(|i, j| rows[i][j]);
    for i in 0..6 {
        if matrix[(i, i)] < 0.0 {
            return Err(Error::input(
                format!("{place}[{i}][{i}]"),
                matrix[(i, i)],
                "an added mass has no negative diagonal; mind the sign",
            ));
        }
    }
    // Entries have different units: everything is measured against its row's and column's diagonal.
    let size = |i: usize, j: usize| (matrix[(i, i)] * matrix[(j, j)]).sqrt();
    for i in 0..6 {
        for j in 0..i {
            let (a, b) = (matrix[(i, j)], matrix[(j, i)]);
            if (a - b).abs() > 1e-6 * size(i, j).max(a.abs()).max(b.abs()) {
                return Err(Error::input(
                    format!("{place}[{i}][{j}]"),
                    format!("{a}, and {b} across the diagonal"),
                    "the matrix must be symmetric; write the mean of both at both places",
                ));
            }
        }
    }
    let scaled = Matrix6::from_fn(|i, j| {
        let mean = 0.5 * (matrix[(i, j)] + matrix[(j, i)]);
        if mean == 0.0 { 0.0 } else { mean / size(i, j) }
    });
    let lowest = if scaled.iter().all(|x| x.is_finite()) {
        scaled.symmetric_eigenvalues().min()
    } else {
        f64::NEG_INFINITY
    };
    if lowest < -1e-6 {
        return Err(Error::input(
            place,
            format!("least eigenvalue {lowest:.3e} (diagonal scaled to one)"),
            "the kinetic energy of the water can't be negative: the matrix must be positive \
             semi-definite; mind the signs off the diagonal, and that all is about the body's \
             origin",
        ));
    }
    Ok(())
}

fn check_joint(body: &Body) -> Result<()> {
    let joint = &body.joint;
    if let Some(bad) = joint.model().refused() {
        let field = format!("joint.{}", bad.field);
        return Err(Error::input(place(body, &field), bad.given, bad.remedy));
    }
    if let Some(motion) = &body.motion {
        check_motion(body, motion)?;
    }
    limits::check(body)?;
    passive::check(body)?;
    servo::check(body)?;
    if body.actuated && joint.velocities() == 0 {
        return Err(Error::input(
            place(body, "actuated"),
            true,
            "a fixed joint takes no force; take `actuated` away or give the body a joint",
        ));
    }
    if let (true, Some((how, key))) = (body.actuated, limits::prescribed(body)) {
        return Err(Error::input(
            place(body, "actuated"),
            true,
            format!(
                "the joint is {how}, so its force is a result and can't be a control; take \
                 `actuated` or `{key}` away"
            ),
        ));
    }
    Ok(())
}

fn check_motion(body: &Body, motion: &[Motion]) -> Result<()> {
    let joint = &body.joint;
    if body.locked {
        return Err(Error::input(
            place(body, "locked"),
            "true beside a motion",
            "a joint is either held or driven: take `locked` or `motion` away",
        ));
    }
    if joint.has_quaternion() || joint.velocities() == 0 {
        return Err(Error::input(
            place(body, "motion"),
            format!("a motion of a {} joint", joint.kind()),
            "only joints whose coordinates are lengths and angles (such as prismatic, revolute and planar ones) can be driven; build the motion from \
             several of them",
        ));
    }
    if motion.len() != joint.coordinates() {
        return Err(Error::input(
            place(body, "motion"),
            format!("{} motions", motion.len()),
            format!(
                "a {} joint needs {}, one per coordinate",
                joint.kind(),
                joint.coordinates()
            ),
        ));
    }
    for (i, motion) in motion.iter().enumerate() {
        motion.check(&place(body, &format!("motion[{i}]")))?;
    }
    Ok(())
}

fn check_drag(body: &Body) -> Result<()> {
    let Some(drag) = &body.drag else {
        return Ok(());
    };
    if body.shape.is_none() {
        return Err(Error::input(
            place(body, "drag"),
            "drag without a shape",
            "drag is summed over a surface: add a shape or take the drag away",
        ));
    }
    for (field, value) in [("linear", drag.linear), ("quadratic", drag.quadratic)] {
        let place = place(body, &format!("drag.{field}"));
        let remedy = "give zero or more; a negative drag would push the body on";
        bounded(&place, value, true, remedy)?;
    }
    Ok(())
}
