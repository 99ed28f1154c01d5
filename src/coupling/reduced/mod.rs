//! Multiple scattering between a few sources a body: the solution of each body to the water is computed
//! once per shape ([`compress`]); what remains at run time are Coulomb sums and a small dense system.
//!
//! With all points x of all bodies, `G_ij = 1/|x_i − x_j|` between points of different bodies (with
//! walls also the images of all points, of the same body too), body-frame twists x̄, and per body
//! `S̄ = L Lᵀ`, all at unit density:
//!
//! ```text
//! α = Ū x̄ + L a,        (I − LᵀG L) a = LᵀG Ū x̄        (α = (I − S̄G)⁻¹ Ū x̄)
//! M̄ x̄ = M̄₀ x̄ + 4π Ūᵀ G α                               symmetric by construction
//! δE(x, y) = 4π α_xᵀ δG α_y                             a Coulomb energy: no adjoint solve
//! δα = L δa,            (I − LᵀG L) δa = Lᵀ δG α
//! δ²E(x, y) = 4π [ α_xᵀ δδG α_y + δα_xᵀ δG α_y + α_xᵀ δG δα_y ]
//! ```
//!
//! Where a gap is below what the sources resolve they are held apart, and the film in it has its own added mass ([`Reduced::with_films`]).
//!
//! `I − LᵀGL` is symmetric, and positive definite while the bodies are apart: a Cholesky
//! factorisation that fails tells of a gap that the sources don't resolve.

mod body;
pub mod cache;
mod charges;
mod check;
pub mod compress;
pub(crate) mod films;
mod linearised;
mod link;
mod many;
mod placed;
mod region;
mod resolved;
mod second;
mod shape;
mod slope;
mod surface;
mod views;

pub use body::{CompressedParts, Fit, ReducedBody};
pub use link::{Cutoff, Link};
pub(in crate::coupling) use placed::{Charge, PlacedSkeletons};
pub use region::Region;
pub use slope::ShapeSlope;
pub(super) use views::FLUX;

use super::Exclusions;
use super::film::Films;
use super::settings::{end, ranges};
use crate::geometry::{Image, Wall};
use crate::{Error, Result};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Coulomb forces that take as long as waking another thread, many times over (0.1 ms).
const WORTH_WAKING: usize = 100_000;

/// All bodies coupled through a few sources each.
#[derive(Clone)]
pub struct Reduced {
    bodies: Vec<Arc<ReducedBody>>,
    /// For messages: bodies of equal shape share what they are compressed to.
    names: Vec<String>,
    links: Vec<Link>,
    /// Of gaps that the sources don't resolve.
    films: Films,
    /// Pairs of bodies that don't feel each other but by images: also of films that are given later.
    excluded: Exclusions,
    points: Vec<Range<usize>>,
    modes: Vec<Range<usize>>,
    /// A body with its slope, one a shape parameter.
    shapes: Vec<(usize, ShapeSlope)>,
}

impl Reduced {
    /// From the bodies and the walls (one, or mutually perpendicular ones). `cutoff` gives the
    /// distances between which a pair of bodies fades out (equal indices: a body and its image),
    /// `None` for a pair that is always coupled.
    ///
    /// # Errors
    /// Walls that don't close under reflection.
    pub fn new(
        bodies: Vec<Arc<ReducedBody>>,
        walls: &[Wall],
        cutoff: impl Fn(usize, usize) -> Option<Cutoff>,
    ) -> Result<Self> {
        let links = Link::all(bodies.len(), &Image::of_walls(walls)?, cutoff);
        Ok(Self {
            points: ranges(bodies.iter().map(|b| b.points())),
            modes: ranges(bodies.iter().map(|b| b.modes())),
            links,
            shapes: Vec::new(),
            films: Films::default(),
            excluded: Exclusions::none(),
            names: bodies.iter().map(|b| b.parts().name.clone()).collect(),
            bodies,
        })
    }

    /// The same, without the flow between these pairs of bodies.
    ///
    /// # Errors
    /// A pair that names a body that doesn't exist.
    pub fn excluding(mut self, pairs: &Exclusions) -> Result<Self> {
        pairs.check(self.bodies.len())?;
        let apart = |l: &Link| !l.image.is_identity() || !pairs.contains(l.target, l.source);
        self.links.retain(apart);
        self.films.exclude(pairs);
        self.excluded = Exclusions::new(self.excluded.iter().chain(pairs.iter()));
        Ok(self)
    }

    /// The same with shape parameters: each a body, by its number, and how it changes.
    ///
    /// # Errors
    /// [`Error::Input`] for a body that isn't there, or a slope of another number of points.
    pub fn with_shapes(mut self, shapes: Vec<(usize, ShapeSlope)>) -> Result<Self> {
        for (b, slope) in &shapes {
            let points = self.bodies.get(*b).map_or(0, |body| body.points());
            let sizes = [
                slope.points.len(),
                slope.strengths.nrows(),
                slope.solution.nrows(),
            ];
            if points == 0 || sizes != [points; 3] {
                let right = format!("must be a body with as many points: it has {points}");
                let value = format!("body {b} with {sizes:?} points");
                return Err(Error::input("shape parameter", value, right));
            }
        }
        self.shapes = shapes;
        Ok(self)
    }

    /// The same with names of the bodies, for messages; those beyond the bodies are dropped.
    pub fn named(mut self, names: impl IntoIterator<Item = String>) -> Self {
        let given = self.names.iter_mut().zip(names);
        given.for_each(|(own, name)| *own = name);
        self
    }

    /// Names of the bodies, for messages.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The bodies.
    pub fn reduced_bodies(&self) -> &[Arc<ReducedBody>] {
        &self.bodies
    }

    /// The blocks of G that aren't zero, those below the diagonal left out.
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// `f` of each item (a link's), in order; on several threads where the points are so many that it
    /// pays to wake them. `work` per pair of points is relative to one Coulomb force.
    fn over<'i, I: Sync, T: Send>(
        &self,
        items: &'i [I],
        work: usize,
        f: impl Fn(&'i I) -> T + Sync + Send,
    ) -> Vec<T> {
        let mean = self.point_count() / self.bodies.len().max(1);
        if items.len() * mean * mean * work < WORTH_WAKING {
            items.iter().map(f).collect()
        } else {
            items.par_iter().map(f).collect()
        }
    }

    fn point_count(&self) -> usize {
        end(&self.points)
    }

    fn mode_count(&self) -> usize {
        end(&self.modes)
    }
}
