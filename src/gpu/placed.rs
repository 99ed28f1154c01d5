//! Surfaces at the bodies' poses (`shaders/place.wgsl`).

use super::buffer::Buffer;
use super::kernel::{Table, threads};
use super::source::Arithmetic;
use super::surfaces::Surfaces;
use super::units::{motions, placements};
use crate::Result;
use crate::adjoint::lie::{Pose, Vec3, Vec6};
use std::sync::Arc;

/// The bodies at given poses.
pub(super) struct PlacedSurfaces {
    pub surfaces: Arc<Surfaces>,
    /// The scene's middle, m.
    pub middle: Vec3,
    /// The surfaces' table with faces and sources where they are, in both arithmetics.
    fine: Table,
    single: Table,
}

impl PlacedSurfaces {
    /// Places all bodies; `own` are arrays of these poses that the shaders see as well.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(
        surfaces: &Arc<Surfaces>,
        poses: &[Pose],
        own: &[(&'static str, Buffer)],
    ) -> Result<Self> {
        let (context, sizes) = (&surfaces.context, &surfaces.sizes);
        let (fine, single) = (context.fine(), Arithmetic::Single);
        let [points, vectors, numbers] = surfaces.surface.layout();
        let face = 3 * (points + vectors) + numbers;
        let (middle, values) = placements(poses, &surfaces.images, surfaces.length);
        let poses = context.upload("poses", fine, &values)?;
        let table = |arithmetic| -> Result<Table> {
            let sources = 3 * sizes.images * sizes.sources;
            let faces = context.reals("faces", arithmetic, face * sizes.faces)?;
            let placed = [
                ("faces", faces),
                ("sources", context.reals("sources", arithmetic, sources)?),
            ];
            let shared = own.iter().chain(&surfaces.table).cloned();
            Ok(placed.into_iter().chain(shared).collect())
        };
        let out = Self {
            surfaces: surfaces.clone(),
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
        let constants = surfaces.surface.constants();
        let of = |entry, count| {
            let (shader, buffers) = (("place", entry, fine), (&out.fine[..], &own[..]));
            context.call(shader, &constants, &words, buffers, threads(count))
        };
        context.submit(&[
            of("place_faces", sizes.faces)?,
            of("place_sources", sizes.sources)?,
        ])?;
        Ok(out)
    }

    /// The variables of `pairs.wgsl`, and all else that the shaders share.
    pub fn table(&self, arithmetic: Arithmetic) -> &Table {
        match arithmetic {
            Arithmetic::Single => &self.single,
            _ => &self.fine,
        }
    }

    /// Twists of all images of all bodies, then of the bodies as they see, about the scene's middle.
    pub fn motions(&self, z: &[Vec6]) -> Vec<f64> {
        let images = self.surfaces.images.iter();
        let seen = images.flat_map(|image| z.iter().map(|z| image.twist(z)));
        let all = seen.chain(z.iter().copied());
        motions(all, &self.middle, self.surfaces.length)
    }
}
