//! Compressed bodies so many that no matrix of them all is formed: the exchange between them is summed where it is used, near ones point by point, groups of
//! others by moments about their centres, groups of groups the farther they are.
//!
//! The same energy as [`Reduced`](super::reduced), whose G is replaced by Ĝ, symmetric and a smooth function of the poses:
//!
//! ```text
//! α = Ū x̄ + L a,   a = Lᵀ Ĝ α            by GMRES: I − LᵀĜL is near the identity while bodies are apart
//! M̄ x̄ = M̄₀ x̄ + 4π Ūᵀ Ĝ α
//! ```
//!
//! In gaps that the points don't resolve films add impulses K x̄ of their own, and hold bodies apart: Ĝ has their distance as it is held there (`narrow`).
//!
//! Where momenta are given instead of twists, the twists are eliminated with them (recoil, [`Scattered::recoil`]): with what the bodies' own inertias answer to
//! impulses, `x̄ = x̄₀ − T(4π Ūᵀ Ĝ α)`, it is still one system with one right-hand side,
//!
//! ```text
//! (I − Ŝ Ĝ) α = Ū x̄₀,   Ŝ = L Lᵀ − 4π Ū T Ūᵀ
//! ```
//!
//! whose M̄ is never formed. The energy's gradient is a Coulomb sum of the charges, its derivatives those of the same sums in dual numbers.
//!
//! Walls and free surfaces are mirror images of the bodies, with trees of their own, that no image but bodies see: with charges c = [α, ½ σ α] on bodies and their images (σ = −1 of those that are
//! mirrored in free surfaces an odd number of times) the energy is still ½ cᵀĜc, so that all of the above stays true of it.

mod answers;
mod blocks;
mod cells;
mod elsewhere;
mod far;
mod kept;
mod levels;
mod linearised;
mod mirrors;
mod narrow;
mod near;
mod pairs;
mod parts;
mod places;
mod quotients;
mod recoiled;
mod scattered;
mod spare;
mod sums;
mod surface;
mod unlike;

pub use elsewhere::{Changed, Summing, SummingAt};
pub use kept::{Answer, Told};
pub use levels::{Apart, Levels};
pub use linearised::{Displaced, ScatteredLinearised};
pub use recoiled::{Goal, Own, Recoiled};
pub use scattered::{Motions, Scattered};

use super::Exclusions;
use super::film::Films;
use super::isolated::Isolated;
use super::reduced::{Link, Reduced, ReducedBody};
use super::settings::{end, ranges};
use crate::adjoint::lie::{Mat6, Pose};
use crate::adjoint::multipole::{Pack, Table};
use crate::geometry::Image;
use crate::{Error, Result};
use cells::Cells;
use spare::Spare;
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

/// Compressed bodies that are coupled by products alone.
#[derive(Clone)]
pub struct Scattering {
    bodies: Vec<Arc<ReducedBody>>,
    names: Vec<String>,
    /// The same where they don't feel each other, by M̄₀ of each: its own, or what is given in its place.
    alone: Isolated,
    /// Those that walls make, none being the first.
    images: Vec<Image>,
    /// Of the bodies, then of all that mirrors show of them, image by image.
    points: Vec<Range<usize>>,
    modes: Vec<Range<usize>>,
    /// Of the few numbers that a body's charges are told by while they are solved for; bodies and what mirrors show.
    numbers: Vec<Range<usize>>,
    /// Largest distance of a body's points from its centre, m; bodies and what mirrors show.
    sizes: Vec<f64>,
    /// By how much each body counts more where all count alike, if they are unlike.
    unlike: Option<Vec<f64>>,
    cells: Cells,
    /// Pairs of cells with bodies that don't feel each other.
    refused: BTreeSet<[usize; 2]>,
    levels: Levels,
    table: Table,
    /// Of gaps that the points don't resolve.
    films: Films,
    /// Where sums are made instead of here.
    summing: Option<Arc<dyn Summing>>,
    /// Memory for the matrices of near pairs, and for what is kept of far ones.
    spare: Spare<f64>,
    spare_packs: Spare<Pack>,
}

impl Scattering {
    /// From compressed bodies with their names, and where they are at the start (all in the water): those that lie together there are seen together from afar. It stays right
    /// wherever they go, but is fast as long as neighbours stay about each other.
    ///
    /// # Errors
    /// [`Error::Input`] for other numbers of names or poses, or poses that aren't finite.
    pub fn new(
        bodies: Vec<Arc<ReducedBody>>,
        names: Vec<String>,
        start: &[Pose],
        levels: Levels,
    ) -> Result<Self> {
        Self::between(bodies, names, start, vec![Image::identity()], levels)
    }

    /// The same with the images that walls make, which begin with none ([`Image::of_walls`]).
    ///
    /// # Errors
    /// As [`Scattering::new`], and images that don't begin so.
    pub fn between(
        bodies: Vec<Arc<ReducedBody>>,
        names: Vec<String>,
        start: &[Pose],
        images: Vec<Image>,
        levels: Levels,
    ) -> Result<Self> {
        if [names.len(), start.len()] != [bodies.len(); 2] {
            return Err(Error::input(
                "many bodies: names and poses",
                format!("{} and {}", names.len(), start.len()),
                format!("must be {} each, one a body", bodies.len()),
            ));
        }
        if !images.first().is_some_and(Image::is_identity) {
            return Err(Error::input(
                "many bodies: images",
                format!("{} of them", images.len()),
                "must begin with none, the identity, as those of walls do",
            ));
        }
        let centre = |(body, pose): (&Arc<ReducedBody>, &Pose)| pose.apply(&body.parts().centre);
        let centres: Vec<_> = bodies.iter().zip(start).map(centre).collect();
        if let Some(b) = centres
            .iter()
            .position(|c| !c.iter().all(|x| x.is_finite()))
        {
            return Err(Error::input(
                format!("many bodies: pose of body {:?}", names[b]),
                format!("{:?}", centres[b].as_slice()),
                "must be finite",
            ));
        }
        let size = |body: &Arc<ReducedBody>| {
            let parts = body.parts();
            let reach = parts.points.iter().map(|x| (x - parts.centre).norm());
            reach.fold(0.0, f64::max)
        };
        let seen = || images.iter().flat_map(|_| &bodies);
        let shown = images.iter().flat_map(|image| {
            let centres = centres.iter();
            centres.map(|c| image.linear * c + image.shift)
        });
        Ok(Self {
            alone: Isolated::new(bodies.iter().map(|b| b.parts().added_mass).collect()),
            points: ranges(seen().map(|b| b.points())),
            modes: ranges(bodies.iter().map(|b| b.modes())),
            numbers: ranges(seen().map(|b| b.points().min(b.modes() + 6))),
            sizes: seen().map(size).collect(),
            unlike: unlike::weights(&bodies),
            cells: Cells::new(&shown.collect::<Vec<_>>(), images.len()),
            table: Table::new(levels.degree),
            refused: BTreeSet::new(),
            films: Films::default(),
            summing: None,
            spare: Spare::default(),
            spare_packs: Spare::default(),
            images,
            names,
            levels,
            bodies,
        })
    }

    /// The same, without the flow between these pairs of bodies; that of each other's images stays.
    ///
    /// # Errors
    /// A pair that names a body that doesn't exist.
    pub fn excluding(mut self, pairs: &Exclusions) -> Result<Self> {
        pairs.check(self.bodies.len())?;
        for (a, b) in pairs.iter() {
            let [left, right] = [a, b].map(|b| self.cells.around(b));
            for i in &left {
                self.refused
                    .extend(right.iter().map(|j| [*i.min(j), *i.max(j)]));
            }
        }
        Ok(self)
    }

    /// The same, with these films in gaps that the points don't resolve.
    pub(crate) fn with_films(mut self, films: Films) -> Self {
        self.films = films;
        self
    }

    /// The same, whose sums are made elsewhere: of the same bodies between the same walls, without the same pairs.
    pub fn summed_by(mut self, summing: Arc<dyn Summing>) -> Self {
        self.summing = Some(summing);
        self
    }

    /// From bodies that were coupled by a factor, with their names and its films.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for images and pairs that fade out or are left out; as [`Scattering::new`].
    pub fn of(reduced: &Reduced, start: &[Pose], levels: Levels) -> Result<Self> {
        let bodies = reduced.reduced_bodies();
        let plain = |l: &Link| l.image.is_identity() && l.cutoff.is_none();
        let pairs = bodies.len() * bodies.len().saturating_sub(1) / 2;
        if !reduced.links().iter().all(plain) || reduced.links().len() != pairs {
            return Err(Error::Unsupported {
                what: "products alone between many bodies".into(),
                why: "walls, pairs that are left out, and pairs that fade out aren't there".into(),
                instead: "use the coupling by a factor".into(),
            });
        }
        let names = reduced.names().to_vec();
        let made = Self::new(bodies.to_vec(), names, start, levels)?;
        Ok(made.with_films(reduced.films().clone()))
    }

    /// The bodies.
    pub fn reduced_bodies(&self) -> &[Arc<ReducedBody>] {
        &self.bodies
    }

    /// The added mass of each body alone, at unit density (body frame, about its origin), with what is given in its place.
    pub fn own(&self) -> &[Mat6] {
        self.alone.added_masses()
    }

    /// The bodies where they don't feel each other.
    pub fn alone(&self) -> &Isolated {
        &self.alone
    }

    /// How the exchange is cut into levels.
    pub fn levels(&self) -> &Levels {
        &self.levels
    }

    fn mode_count(&self) -> usize {
        end(&self.modes)
    }
}
