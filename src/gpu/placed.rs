//! Surfaces at the bodies' poses (`shaders/place.wgsl`), and the Jacobi preconditioner (`shaders/diagonal.wgsl`).

use super::geometry::{Geometry, PlacedSystem};
use super::kernel::{Table, threads};
use super::source::Arithmetic;
use super::units::placements;
use crate::Result;
use crate::adjoint::lie::Pose;
use std::sync::Arc;

impl PlacedSystem {
    /// Places all bodies.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(geometry: &Arc<Geometry>, poses: &[Pose]) -> Result<Self> {
        let (context, sizes) = (&geometry.context, &geometry.sizes);
        let (fine, single) = (context.fine(), Arithmetic::Single);
        let (middle, values) = placements(poses, &geometry.model.images, geometry.length);
        let poses = context.upload("poses", fine, &values)?;
        let scaling = context.upload("scaling", single, &vec![1.0; sizes.sources])?;
        let table = |arithmetic| -> Result<Table> {
            let sources = 3 * sizes.images * sizes.sources;
            let placed = [
                (
                    "faces",
                    context.reals("faces", arithmetic, 13 * sizes.faces)?,
                ),
                ("sources", context.reals("sources", arithmetic, sources)?),
                ("scaling", scaling.clone()),
            ];
            Ok(placed.into_iter().chain(geometry.table.clone()).collect())
        };
        let out = Self {
            geometry: geometry.clone(),
            middle,
            fine: table(fine)?,
            single: table(single)?,
        };
        let own = [
            ("poses", &poses),
            ("faces_single", &out.single[0].1),
            ("sources_single", &out.single[1].1),
        ];
        let words = [sizes.faces, sizes.sources, sizes.bodies, sizes.images];
        let of = |entry, count| {
            let (shader, buffers) = (("place", entry, fine), (&out.fine[..], &own[..]));
            context.call(shader, &[], &words, buffers, threads(count))
        };
        let mut calls = vec![
            of("place_faces", sizes.faces)?,
            of("place_sources", sizes.sources)?,
        ];
        if geometry.diagonal {
            // scaling_j = 1/√(Σ_i K_ij² + D_j²).
            let shader = ("diagonal", "main", single);
            let count = [sizes.source_blocks as u32, 1, 1];
            calls.push(context.call(shader, &[], &[], (&out.single, &[]), count)?);
        }
        context.submit(&calls)?;
        Ok(out)
    }

    /// The variables of `pairs.wgsl`, and all else that the shaders share.
    pub fn table(&self, arithmetic: Arithmetic) -> &Table {
        match arithmetic {
            Arithmetic::Single => &self.single,
            _ => &self.fine,
        }
    }
}
