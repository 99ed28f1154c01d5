//! `shaders/place.wgsl`: faces and sources at the bodies' poses.

use super::buffer::Buffer;
use super::context::Context;
use super::geometry::{Geometry, Surfaces};
use super::kernel::{Call, threads};
use crate::Result;

/// Faces and sources in the fine arithmetic and in single precision; poses `[body][12]`, then
/// `[image][12]`: rotation row by row, translation.
pub(super) fn place(
    context: &Context,
    geometry: &Geometry,
    poses: &Buffer,
    fine: &Surfaces,
    single: &Surfaces,
) -> Result<[Call; 2]> {
    let sizes = &geometry.sizes;
    let words = [sizes.faces, sizes.sources, sizes.bodies, sizes.images];
    let uniform = context.uniform(&words.map(|n| n as u32));
    let buffers = [
        ("shape_faces", (&geometry.shape_faces).into()),
        ("shape_sources", (&geometry.shape_sources).into()),
        ("poses", poses.into()),
        ("face_map", (&geometry.face_map).into()),
        ("source_map", (&geometry.source_map).into()),
        ("faces", (&fine.faces).into()),
        ("faces_single", (&single.faces).into()),
        ("sources", (&fine.sources).into()),
        ("sources_single", (&single.sources).into()),
        ("counts", (&uniform).into()),
    ];
    let of = |entry: &str| context.kernel("place", entry, context.fine(), &[]);
    Ok([
        context.call(&of("place_faces")?, &buffers, threads(sizes.faces))?,
        context.call(&of("place_sources")?, &buffers, threads(sizes.sources))?,
    ])
}
