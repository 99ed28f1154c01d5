//! `shaders/place.wgsl`: faces and sources at the bodies' poses.

use super::buffer::Buffer;
use super::context::Context;
use super::geometry::{Geometry, Surfaces};
use super::kernel::{Call, threads};
use super::source::Arithmetic;
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

/// Points of compressed bodies and their images, fine; shapes' points, which body and point each is, poses as
/// above. `counts`: 0, points, bodies, images.
pub(super) fn place_points(
    context: &Context,
    (shape_points, map, poses): (&Buffer, &Buffer, &Buffer),
    out: &Buffer,
    counts: [usize; 4],
) -> Result<Call> {
    let uniform = context.uniform(&counts.map(|n| n as u32));
    // The entry writes both arithmetics.
    let single = context.reals("points", Arithmetic::Single, 3 * counts[1] * counts[3])?;
    let buffers = [
        ("shape_sources", shape_points.into()),
        ("poses", poses.into()),
        ("source_map", map.into()),
        ("sources", out.into()),
        ("sources_single", (&single).into()),
        ("counts", (&uniform).into()),
    ];
    let kernel = context.kernel("place", "place_sources", context.fine(), &[])?;
    context.call(&kernel, &buffers, threads(counts[1]))
}
