//! What of compressed bodies lies on the device: constants once, placed points at each set of poses.
//!
//! Lengths are in units of the scene's size and positions relative to its middle. With L that size:
//! `G = Ĝ/L`, modes `√L`, twists in units of lengths and of each column's own size s, charges `α = L³ s α̂`,
//! `a = L^{5/2} s â`, impulses `L⁴ s` and `L⁵ s`, energies `L⁵`.

use super::buffer::Buffer;
use super::context::Context;
use super::kernel::{Batch, Bound};
use super::place::place_points;
use super::share::shapes;
use crate::Result;
use crate::adjoint::lie::{Pose, Vec3, Vec6, angular, linear};
use crate::coupling::reduced::{Reduced, ReducedBody};
use crate::geometry::Image;
use std::sync::Arc;

/// Points of one block of sources.
const BLOCK: usize = 64;
/// Workgroups that keep a large card busy.
const BUSY: usize = 1024;

/// Numbers of things.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sizes {
    pub points: usize,
    pub modes: usize,
    pub bodies: usize,
    pub images: usize,
    /// Blocks of sources.
    pub blocks: usize,
}

impl Sizes {
    /// Workgroups for all points.
    pub fn groups(&self) -> usize {
        self.points.div_ceil(BLOCK)
    }

    /// Into how many shares the sources are cut.
    pub fn shares(&self) -> usize {
        BUSY.div_ceil(self.groups().max(1))
            .clamp(1, self.blocks.max(1))
    }
}

/// All that doesn't change with the poses.
pub(super) struct Compressed {
    pub context: Arc<Context>,
    pub reduced: Arc<Reduced>,
    /// L, m.
    pub length: f64,
    pub sizes: Sizes,
    /// The images, the identity first.
    images: Vec<Image>,
    /// Whether weights of pairs change with the poses.
    pub fading: bool,
    shape_points: Buffer,
    /// `[point]`: body, shape's point.
    map: Buffer,
    /// `[point]`: body.
    pub owners: Buffer,
    /// `[mode]`: body.
    pub mode_owners: Buffer,
    /// Of sources: body, first, count.
    blocks: Buffer,
    /// `[body]`: first point, points, first mode, modes.
    pub bodies: Buffer,
    /// [L, Ū] of every shape.
    pub table: Buffer,
    /// `[body]`: where its shape's block begins.
    pub shapes: Buffer,
    /// Sign times weight where no pair fades.
    weights: Option<Arc<Buffer>>,
    sizes_uniform: wgpu::Buffer,
    /// Always one: what isn't part of a solve goes on.
    pub open: Buffer,
}

/// The bodies' points at given poses.
pub(super) struct PlacedPoints {
    pub model: Arc<Compressed>,
    pub poses: Vec<Pose>,
    /// The scene's middle, m.
    pub middle: Vec3,
    /// `[image][point][3]`.
    pub points: Buffer,
    weights: Arc<Buffer>,
    /// w' e of the pairs, and the bodies' centres.
    slopes: Buffer,
    pub centres: Buffer,
}

/// A displacement of the bodies.
pub(super) struct Motion {
    motions: Buffer,
    rates: Buffer,
}

/// Largest distance of a point from its body's origin.
fn length(shapes: &[Arc<ReducedBody>]) -> f64 {
    let of = |b: &Arc<ReducedBody>| -> f64 {
        let points = b.parts().points.iter().map(|p| p.norm());
        points.fold(b.parts().radius, f64::max)
    };
    match shapes.iter().map(of).fold(0.0, f64::max) {
        l if l > 0.0 => l,
        _ => 1.0,
    }
}

impl Compressed {
    /// Uploads compressed bodies.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(context: &Arc<Context>, reduced: &Arc<Reduced>) -> Result<Self> {
        let fine = context.fine();
        let (all, of) = shapes(reduced.reduced_bodies().iter());
        let length = length(&all);
        let (mut shape_points, mut table) = (Vec::new(), Vec::new());
        let mut starts = Vec::new();
        for body in &all {
            let parts = body.parts();
            starts.push((shape_points.len() / 3, table.len()));
            for (i, p) in parts.points.iter().enumerate() {
                shape_points.extend((p / length).iter());
                let modes = parts.modes.row(i);
                table.extend(modes.iter().map(|x| x / length.sqrt()));
                let unit = |k: usize| length.powi(if k < 3 { 2 } else { 3 });
                table.extend((0..6).map(|k| parts.strengths[(i, k)] / unit(k)));
            }
        }
        let (mut map, mut owners, mut mode_owners) = (Vec::new(), Vec::new(), Vec::new());
        let (mut blocks, mut bodies) = (Vec::new(), Vec::new());
        for (b, body) in reduced.reduced_bodies().iter().enumerate() {
            let (first, n) = (owners.len(), body.points());
            bodies.extend([first, n, mode_owners.len(), body.modes()].map(|x| x as u32));
            for at in (0..n).step_by(BLOCK) {
                let count = BLOCK.min(n - at);
                blocks.extend([b, first + at, count, 0].map(|x| x as u32));
            }
            let shape = starts[of[b]].0;
            map.extend((0..n).flat_map(|i| [b as u32, (shape + i) as u32]));
            owners.extend(vec![b as u32; n]);
            mode_owners.extend(vec![b as u32; body.modes()]);
        }
        let mut images = vec![Image::identity()];
        for link in reduced.links() {
            if !images.contains(&link.image) {
                images.push(link.image);
            }
        }
        let sizes = Sizes {
            points: owners.len(),
            modes: mode_owners.len(),
            bodies: of.len(),
            images: images.len(),
            blocks: blocks.len() / 4,
        };
        let fading = reduced.links().iter().any(|l| l.cutoff.is_some());
        let words = [sizes.points, sizes.bodies, sizes.images, sizes.blocks];
        let table_starts: Vec<u32> = of.iter().map(|s| starts[*s].1 as u32).collect();
        let mut out = Self {
            sizes_uniform: context.uniform(&words.map(|n| n as u32)),
            shape_points: context.upload("points of the shapes", fine, &shape_points)?,
            map: context.upload_words("map of the points", &map)?,
            owners: context.upload_words("bodies of the points", &owners)?,
            mode_owners: context.upload_words("bodies of the modes", &mode_owners)?,
            blocks: context.upload_words("blocks", &blocks)?,
            bodies: context.upload_words("bodies", &bodies)?,
            table: context.upload("modes and strengths", fine, &table)?,
            shapes: context.upload_words("shapes", &table_starts)?,
            weights: None,
            open: context.upload_words("open", &[1])?,
            context: context.clone(),
            reduced: reduced.clone(),
            length,
            sizes,
            images,
            fading,
        };
        if !fading {
            let values = out.over_links(1, |_, _, image, _| [image.sign, 0.0, 0.0, 0.0]);
            out.weights = Some(Arc::new(context.upload("weights", fine, &values)?));
        }
        Ok(out)
    }

    /// Numbers a shape has for every (image, target, source), zero where neither sees the other: the first
    /// `width` of what `f` of target, source, image and the link's number gives.
    fn over_links(
        &self,
        width: usize,
        f: impl Fn(usize, usize, &Image, usize) -> [f64; 4],
    ) -> Vec<f64> {
        let n = self.sizes.bodies;
        let mut out = vec![0.0; self.images.len() * n * n * width];
        for (number, link) in self.reduced.links().iter().enumerate() {
            let Some(g) = self.images.iter().position(|i| *i == link.image) else {
                continue;
            };
            for (t, s) in [(link.target, link.source), (link.source, link.target)] {
                let at = width * ((g * n + t) * n + s);
                out[at..at + width].copy_from_slice(&f(t, s, &link.image, number)[..width]);
            }
        }
        out
    }

    /// Vectors of a point's pulls in numbers: F, or F and D.
    pub fn pull(&self) -> usize {
        if self.fading { 6 } else { 3 }
    }
}

/// How far apart two bodies' centres are, and how that changes.
struct Apart {
    /// From the source's (image's) centre to the target's, of length 1.
    e: Vec3,
    distance: f64,
    /// Weight with two derivatives.
    weight: [f64; 3],
}

impl PlacedPoints {
    /// Places all bodies.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(model: &Arc<Compressed>, poses: &[Pose]) -> Result<Self> {
        let (context, sizes, length) = (&model.context, &model.sizes, model.length);
        let fine = context.fine();
        let sum: Vec3 = poses.iter().map(|p| p.translation).sum();
        let middle = sum / poses.len().max(1) as f64;
        let mut values = Vec::new();
        for pose in poses {
            for i in 0..3 {
                values.extend(pose.rotation.row(i).iter());
            }
            values.extend(((pose.translation - middle) / length).iter());
        }
        for image in &model.images {
            for i in 0..3 {
                values.extend(image.linear.row(i).iter());
            }
            let shift = image.linear * middle + image.shift - middle;
            values.extend((shift / length).iter());
        }
        let points = context.reals("points", fine, 3 * sizes.images * sizes.points)?;
        let uploaded = context.upload("poses", fine, &values)?;
        let counts = [0, sizes.points, sizes.bodies, sizes.images];
        let call = place_points(
            context,
            (&model.shape_points, &model.map, &uploaded),
            &points,
            counts,
        )?;
        let mut batch = Batch::default();
        batch.push(&call);
        context.submit(&batch)?;
        let mut out = Self {
            model: model.clone(),
            poses: poses.to_vec(),
            middle,
            points,
            weights: Arc::new(context.bytes("weights", 16)?),
            slopes: context.bytes("slopes", 16)?,
            centres: context.bytes("centres", 16)?,
        };
        if let Some(weights) = &model.weights {
            out.weights = weights.clone();
            return Ok(out);
        }
        let weights = model.over_links(1, |t, s, image, link| {
            let weight = out.apart(t, s, image, link).weight[0];
            [image.sign * weight, 0.0, 0.0, 0.0]
        });
        let slopes = model.over_links(3, |t, s, image, link| {
            let apart = out.apart(t, s, image, link);
            let v = apart.e * (image.sign * apart.weight[1] * length);
            [v.x, v.y, v.z, 0.0]
        });
        let centres: Vec<f64> = (0..poses.len())
            .flat_map(|b| ((out.centre(b) - middle) / length).data.0[0])
            .collect();
        out.weights = Arc::new(context.upload("weights", fine, &weights)?);
        out.slopes = context.upload("slopes", fine, &slopes)?;
        out.centres = context.upload("centres", fine, &centres)?;
        Ok(out)
    }

    /// A body's centre in the world.
    fn centre(&self, b: usize) -> Vec3 {
        let body = &self.model.reduced.reduced_bodies()[b];
        self.poses[b].apply(&body.parts().centre)
    }

    fn apart(&self, t: usize, s: usize, image: &Image, link: usize) -> Apart {
        let between = self.centre(t) - (image.linear * self.centre(s) + image.shift);
        let distance = between.norm();
        let weight = match &self.model.reduced.links()[link].cutoff {
            Some(cutoff) => cutoff.weight(distance),
            None => [1.0, 0.0, 0.0],
        };
        // A weight that changes is that of centres apart.
        let e = if distance > 0.0 {
            between / distance
        } else {
            Vec3::zeros()
        };
        Apart {
            e,
            distance,
            weight,
        }
    }

    /// The displacement by spatial twists `z`.
    ///
    /// # Errors
    /// A device that fails.
    pub fn motion(&self, z: &[Vec6]) -> Result<Motion> {
        let model = &self.model;
        let (context, length) = (&model.context, model.length);
        let fine = context.fine();
        let mut values = Vec::new();
        for image in &model.images {
            for z in z {
                let z = image.twist(z);
                let u = (linear(&z) + angular(&z).cross(&self.middle)) / length;
                values.extend(u.iter());
                values.extend(angular(&z).iter());
            }
        }
        let rates = if model.fading {
            let moved = |z: &Vec6, at: &Vec3| linear(z) + angular(z).cross(at);
            let of = |t: usize, s: usize, image: &Image, link: usize| {
                let Apart {
                    e,
                    distance,
                    weight: [_, slope, bend],
                } = self.apart(t, s, image, link);
                if slope == 0.0 && bend == 0.0 {
                    return [0.0; 4];
                }
                let seen = image.linear * self.centre(s) + image.shift;
                let d = moved(&z[t], &self.centre(t)) - moved(&image.twist(&z[s]), &seen);
                let rate = e.dot(&d);
                let turn = (d - e * rate) / distance;
                let v = (e * (bend * rate) + turn * slope) * (image.sign * length);
                [image.sign * slope * rate, v.x, v.y, v.z]
            };
            model.over_links(4, of)
        } else {
            Vec::new()
        };
        Ok(Motion {
            motions: context.upload("motions", fine, &values)?,
            rates: context.upload("rates", fine, &rates)?,
        })
    }

    /// The variables of `points.wgsl`, `slopes.wgsl`, and with a motion of `displaced.wgsl`, `shifts.wgsl`.
    pub fn buffers<'a>(&'a self, motion: Option<&'a Motion>) -> Vec<(&'static str, Bound<'a>)> {
        let model = &self.model;
        let mut out: Vec<(&'static str, Bound<'a>)> = vec![
            ("points", (&self.points).into()),
            ("blocks", (&model.blocks).into()),
            ("owners", (&model.owners).into()),
            ("weights", (&*self.weights).into()),
            ("slopes", (&self.slopes).into()),
            ("sizes", (&model.sizes_uniform).into()),
        ];
        if let Some(motion) = motion {
            out.push(("motions", (&motion.motions).into()));
            out.push(("rates", (&motion.rates).into()));
        }
        out
    }

    /// Workgroups and shares of a product with G.
    pub fn groups(&self) -> [u32; 3] {
        let sizes = &self.model.sizes;
        [sizes.groups() as u32, sizes.shares() as u32, 1]
    }
}
