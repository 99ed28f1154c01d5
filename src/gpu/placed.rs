//! Surfaces at the bodies' poses, with what goes with them.

use super::diagonal::diagonal;
use super::geometry::{Geometry, PlacedSystem, Surfaces};
use super::kernel::Batch;
use super::place::place;
use super::source::Arithmetic;
use crate::Result;
use crate::adjoint::lie::{Mat3, Pose, Vec3};
use std::sync::Arc;

impl PlacedSystem {
    /// Places all bodies.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(geometry: &Arc<Geometry>, poses: &[Pose]) -> Result<Self> {
        let context = &geometry.context;
        let sizes = &geometry.sizes;
        let length = geometry.length;
        let sum: Vec3 = poses.iter().map(|p| p.translation).sum();
        let middle = sum / poses.len().max(1) as f64;
        let mut values = Vec::new();
        let mut add = |linear: &Mat3, shift: &Vec3| {
            for i in 0..3 {
                values.extend(linear.row(i).iter());
            }
            values.extend(shift.iter());
        };
        for pose in poses {
            add(&pose.rotation, &((pose.translation - middle) / length));
        }
        for image in &geometry.model.images {
            let shift = image.linear * middle + image.shift - middle;
            add(&image.linear, &(shift / length));
        }
        let surfaces = |arithmetic| -> Result<Surfaces> {
            Ok(Surfaces {
                faces: context.reals("faces", arithmetic, 13 * sizes.faces)?,
                sources: context.reals("sources", arithmetic, 3 * sizes.images * sizes.sources)?,
            })
        };
        let out = Self {
            geometry: geometry.clone(),
            middle,
            fine: surfaces(context.fine())?,
            single: surfaces(Arithmetic::Single)?,
            scaling: context.upload("scaling", Arithmetic::Single, &vec![1.0; sizes.sources])?,
        };
        let poses = context.upload("poses", context.fine(), &values)?;
        let calls = place(context, geometry, &poses, &out.fine, &out.single)?;
        let mut batch = Batch::default();
        batch.extend(&calls);
        let scaling = geometry
            .diagonal
            .then(|| diagonal(context, &out, &out.scaling));
        let scaling = scaling.transpose()?;
        batch.extend(&scaling);
        context.submit(&batch)?;
        Ok(out)
    }
}
