//! Compressed bodies that are coupled by products alone: whether, and how.

use super::device::Device;
use super::exchange::{Exchange, faster};
use super::method::kind::Problem;
use crate::coupling::film::Films;
use crate::coupling::reduced::{Reduced, ReducedBody};
use crate::coupling::scattering::{Levels, Scattering};
use crate::geometry::Image;
use crate::{Error, Result};
use std::sync::Arc;

/// Whether bodies are coupled by products.
///
/// # Errors
/// [`Error::Unsupported`] where they were asked for and something doesn't take them.
pub(super) fn by_products(exchange: Exchange, problem: &Problem) -> Result<bool> {
    match (exchange, problem.changes.is_empty()) {
        (Exchange::Factor, _) | (Exchange::Auto, false) => Ok(false),
        (Exchange::Auto, true) => Ok(faster(problem.bodies.len(), problem.walls.len())),
        (Exchange::Products, true) => Ok(true),
        (Exchange::Products, false) => Err(Error::Unsupported {
            what: "exchange by products with shape parameters".into(),
            why: "what a shape changes is known of the factor alone".into(),
            instead: "leave the setting exchange to auto, or use factor".into(),
        }),
    }
}

/// The bodies coupled by products, with these films in their gaps, whose sums are made on the device.
///
/// # Errors
/// An accuracy out of range, walls that aren't perpendicular to each other, or a device that fails.
pub(super) fn scattering(
    problem: &Problem,
    made: Vec<Arc<ReducedBody>>,
    films: Films,
    device: &mut Device,
) -> Result<Scattering> {
    let names = problem.bodies.iter().map(|b| b.name.to_string()).collect();
    let numerics = problem.numerics;
    // What was chosen for the bodies of a scene follows from the accuracy already.
    let aim = match problem.plan.compress.is_empty() {
        true => numerics.accuracy.min(numerics.compress.tolerance),
        false => numerics.accuracy,
    };
    let levels = Levels::for_accuracy(aim)?;
    let images = Image::of_walls(problem.walls)?;
    let (bodies, walls, excluded) = (made.clone(), problem.walls, &problem.excluded);
    let many = Scattering::between(made, names, problem.start, images, levels)?;
    device.scattering(many.excluding(excluded)?.with_films(films), || {
        Reduced::new(bodies, walls, |_, _| None)?.excluding(excluded)
    })
}
