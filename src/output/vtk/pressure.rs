//! What the water does to the faces of bodies.

use super::file::array;
use super::placed::Placed;
use crate::adjoint::lie::Vec3;
use crate::simulate::{Rollout, SurfacePressure};
use crate::{Error, Result};
use vtkio::model::Attribute;

/// Pressures and the water's velocity at state `n`, in the order of the faces: zero, and not `wetted`, where there is none.
pub(super) fn fields(rollout: &Rollout, all: &[Placed], n: usize) -> Result<[Attribute; 4]> {
    let found = rollout.pressure(n)?;
    let count = all.iter().map(Placed::count).sum();
    let (mut dynamic, mut hydrostatic) = (Vec::with_capacity(count), Vec::with_capacity(count));
    let (mut velocity, mut wetted) = (Vec::with_capacity(3 * count), Vec::with_capacity(count));
    for placed in all {
        let own = found.iter().find(|p| p.body == placed.body);
        if let Some(own) = own {
            check(own, placed)?;
        }
        for face in 0..placed.count() {
            // Readers stumble over what isn't a number.
            let known = own.map(|p| (p.pressures[face], p.hydrostatic[face], p.velocities[face]));
            let known = known.filter(|(p, h, u)| u.iter().chain([p, h]).all(|x| x.is_finite()));
            wetted.push(u8::from(known.is_some()));
            let (p, h, u) = known.unwrap_or((0.0, 0.0, Vec3::zeros()));
            dynamic.push(p);
            hydrostatic.push(h);
            velocity.extend_from_slice(u.as_slice());
        }
    }
    Ok([
        array("pressure", 1, dynamic),
        array("hydrostatic", 1, hydrostatic),
        array("water_velocity", 3, velocity),
        array("wetted", 1, wetted),
    ])
}

/// Refuses pressures of other faces than those that are drawn.
fn check(own: &SurfacePressure, placed: &Placed) -> Result<()> {
    let drawn = placed.faces.map_or(0, <[_]>::len);
    let each = [
        own.pressures.len(),
        own.hydrostatic.len(),
        own.velocities.len(),
    ];
    match each.into_iter().find(|known| *known != drawn) {
        None => Ok(()),
        Some(known) => Err(Error::input(
            format!("vtk: pressure: faces of body {:?}", own.name),
            known,
            format!("must be the {drawn} of its mesh: write the run without pressure"),
        )),
    }
}
