//! What of compressed bodies lies on the device: constants once, placed points at each set of poses.
//!
//! Lengths are in units of the scene's size and positions relative to its middle. With L that size:
//! `G = Ĝ/L`, modes `√L`, twists in units of lengths and of each column's own size s, charges `α = L³ s α̂`,
//! `a = L^{5/2} s â`, impulses `L⁴ s` and `L⁵ s`, energies `L⁵`.

use super::buffer::Buffer;
use super::context::Context;
use super::kernel::{Table, threads};
use super::source::{Arithmetic, Surface};
use super::surfaces::shapes;
use super::units::{motions, placements};
use crate::Result;
use crate::adjoint::lie::{Pose, Vec3, Vec6, angular, linear};
use crate::coupling::reduced::{Link, Reduced, ReducedBody};
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
    /// What the shaders share.
    pub table: Table,
    /// Always one: what isn't part of a solve goes on.
    pub open: Buffer,
}

/// The bodies' points at given poses.
pub(super) struct PlacedPoints {
    pub model: Arc<Compressed>,
    pub poses: Vec<Pose>,
    /// The scene's middle, m.
    pub middle: Vec3,
    /// The model's table with the points where they are, `[image][point][3]`, the weights of pairs, w' e of the pairs and
    /// the bodies' centres.
    pub table: Table,
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
        let reals = |label, values: &[f64]| context.upload(label, fine, values);
        let whole = |label, words: &[u32]| context.upload_words(label, words);
        let open = whole("open", &[1])?;
        let table = vec![
            ("sizes", context.uniform(&words)),
            (
                "shape_sources",
                reals("points of the shapes", &shape_points)?,
            ),
            // `[point]`: body, shape's point.
            ("source_map", whole("map of the points", &map)?),
            ("owners", whole("bodies of the points", &owners)?),
            ("mode_owners", whole("bodies of the modes", &mode_owners)?),
            ("blocks", whole("blocks", &blocks)?),
            ("bodies", whole("bodies", &bodies)?),
            // [L, Ū] of every shape, and where each body's begins.
            ("table", reals("modes and strengths", &table)?),
            ("shapes", whole("shapes", &table_starts)?),
        ];
        let mut out = Self {
            table,
            open,
            context: context.clone(),
            reduced: reduced.clone(),
            length,
            sizes,
            images,
            fading,
        };
        if !fading {
            // Sign times weight.
            let values = out.over_links(|_, _, link| [link.image.sign]);
            let weights = context.upload("weights", fine, &values)?;
            out.table.push(("weights", weights));
        }
        Ok(out)
    }

    /// Numbers a shader has for every (image, target, source), `f` of target, source and their link: zero where neither
    /// sees the other.
    fn over_links<const N: usize>(&self, f: impl Fn(usize, usize, &Link) -> [f64; N]) -> Vec<f64> {
        let n = self.sizes.bodies;
        let mut out = vec![[0.0; N]; self.images.len() * n * n];
        for link in self.reduced.links() {
            let Some(g) = self.images.iter().position(|i| *i == link.image) else {
                continue;
            };
            for (t, s) in [(link.target, link.source), (link.source, link.target)] {
                out[(g * n + t) * n + s] = f(t, s, link);
            }
        }
        out.concat()
    }

    /// Vectors of a point's pulls in numbers: F, or F and D.
    pub fn pull(&self) -> usize {
        if self.fading { 6 } else { 3 }
    }
}

impl PlacedPoints {
    /// Places all bodies.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(model: &Arc<Compressed>, poses: &[Pose]) -> Result<Self> {
        let (context, sizes, length) = (&model.context, &model.sizes, model.length);
        let fine = context.fine();
        let (middle, values) = placements(poses, &model.images, length);
        let count = 3 * sizes.images * sizes.points;
        let points = context.reals("points", fine, count)?;
        // The entry writes both arithmetics.
        let single = context.reals("points", Arithmetic::Single, count)?;
        let own = [
            ("poses", &context.upload("poses", fine, &values)?),
            ("sources", &points),
            ("sources_single", &single),
        ];
        let words = [0, sizes.points, sizes.bodies, sizes.images];
        let shader = ("place", "place_sources", fine);
        let (all, threads) = ((&model.table[..], &own[..]), threads(sizes.points));
        // Points alone: what a face is doesn't matter.
        let constants = Surface::Faces.constants();
        let call = context.call(shader, &constants, &words, all, threads)?;
        context.submit([&call])?;
        let mut out = Self {
            model: model.clone(),
            poses: poses.to_vec(),
            middle,
            table: model.table.clone(),
        };
        // A displacement isn't read without one, but the variable may still be bound.
        let motions = ("motions", points.clone());
        out.table.extend([("points", points), motions]);
        let (mut slopes, mut centres) = (Vec::new(), Vec::new());
        if model.fading {
            let weights = model.over_links(|t, s, link| {
                let (_, _, [weight, ..]) = out.apart(t, s, link);
                [link.image.sign * weight]
            });
            slopes = model.over_links(|t, s, link| {
                let (e, _, [_, slope, _]) = out.apart(t, s, link);
                (e * (link.image.sign * slope * length)).data.0[0]
            });
            centres = (0..poses.len())
                .flat_map(|b| ((out.centre(b) - middle) / length).data.0[0])
                .collect();
            let weights = context.upload("weights", fine, &weights)?;
            out.table.push(("weights", weights));
        }
        out.table.extend([
            ("slopes", context.upload("slopes", fine, &slopes)?),
            ("centres", context.upload("centres", fine, &centres)?),
        ]);
        Ok(out)
    }

    /// A body's centre in the world.
    fn centre(&self, b: usize) -> Vec3 {
        let body = &self.model.reduced.reduced_bodies()[b];
        self.poses[b].apply(&body.parts().centre)
    }

    /// The direction from the source's (image's) centre to the target's, their distance, and the weight with two
    /// derivatives.
    fn apart(&self, t: usize, s: usize, link: &Link) -> (Vec3, f64, [f64; 3]) {
        let between = self.centre(t) - (link.image.linear * self.centre(s) + link.image.shift);
        let distance = between.norm();
        let weight = match &link.cutoff {
            Some(cutoff) => cutoff.weight(distance),
            None => [1.0, 0.0, 0.0],
        };
        // A weight that changes is that of centres apart.
        let e = if distance > 0.0 {
            between / distance
        } else {
            Vec3::zeros()
        };
        (e, distance, weight)
    }

    /// The table as the bodies are displaced by spatial twists `z`.
    ///
    /// # Errors
    /// A device that fails.
    pub fn displaced(&self, z: &[Vec6]) -> Result<Table> {
        let model = &self.model;
        let (context, length) = (&model.context, model.length);
        let images = model.images.iter();
        let seen = images.flat_map(|image| z.iter().map(|z| image.twist(z)));
        let values = motions(seen, &self.middle, length);
        let rates = if model.fading {
            let moved = |z: &Vec6, at: &Vec3| linear(z) + angular(z).cross(at);
            let of = |t: usize, s: usize, link: &Link| {
                let (e, distance, [_, slope, bend]) = self.apart(t, s, link);
                let image = &link.image;
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
            model.over_links(of)
        } else {
            Vec::new()
        };
        let of = |label, values: &[f64]| context.upload(label, context.fine(), values);
        let own = [
            ("motions", of("motions", &values)?),
            ("rates", of("rates", &rates)?),
        ];
        Ok(own.into_iter().chain(self.table.clone()).collect())
    }
}
