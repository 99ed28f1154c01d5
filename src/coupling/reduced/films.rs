//! Which films there are, and from which gap on they carry what the sources don't resolve.

use super::{Reduced, ReducedBody, compress};
use crate::adjoint::lie::Pose;
use crate::coupling::film::{FilmBody, Films, PlacedFilms, Shares};
use crate::geometry::{Solid, TriMesh, Wall};
use crate::{Error, Result};
use nalgebra::DMatrix;
use std::sync::Arc;

/// The gap below which compressed sources are held apart, in the least that they resolve, times the area of a body over that of the ball of equal volume: flat bodies
/// have less room for sources.
const REACH: f64 = 1.4;
/// Power of the compression's tolerance by which gaps narrow in which its sources are right.
const FINER: f64 = 0.6;
/// How often faces are split for films at most: once for each third of the default tolerance.
const SPLITS: usize = 2;
const SHARES: Shares = Shares {
    floor: 0.25,
    // What compressed bodies with edges answer to sources nearer than that may be more than a body can: I − LᵀGL isn't positive definite then.
    floor_at_edges: 0.5,
    floor_between_faces: 0.5,
    rim: 0.43,
    rim_to_wall: 0.65,
    farther_between_faces: 1.0,
    in_corners: true,
};

/// The films of [`Reduced::with_films`], of any compressed bodies.
///
/// # Errors
/// As there.
pub(crate) fn films(
    bodies: &[Arc<ReducedBody>],
    surfaces: &[(&TriMesh, Option<&Solid>)],
    tolerances: &[f64],
    walls: &[Wall],
) -> Result<Films> {
    let count = bodies.len();
    for (what, given) in [
        ("films: surfaces", surfaces.len()),
        ("films: tolerances", tolerances.len()),
    ] {
        if given != count {
            let expected = format!("give one for each of {count} bodies");
            return Err(Error::input(what, given, expected));
        }
    }
    let same = |a: usize, b: usize| Arc::ptr_eq(&bodies[a], &bodies[b]);
    let finer =
        |b: usize| (tolerances[b] / compress::CompressSettings::default().tolerance).min(1.0);
    // A film between round bodies is as good as its faces are small against the gap.
    let splits = |b: usize| {
        let third = |splits: &usize| finer(b) < 1.01 / 3f64.powi(*splits as i32);
        (1..=SPLITS).take_while(third).count()
    };
    let seen = FilmBody::all(surfaces, splits, same);
    let reach = |b: usize| {
        let fit = &bodies[b].parts().fit;
        // Sources of a smaller tolerance are right in narrower gaps, and more than films are.
        let finer = finer(b);
        REACH * seen[b].surface.flatness * fit.finest() * finer.powf(FINER)
    };
    let reaches = (0..count).map(reach).collect();
    Films::new(seen, reaches, &SHARES, walls)
}

impl Reduced {
    /// The same with films in the gaps between bodies, and to rigid walls, that the sources don't resolve: from the surface of each body in its own frame, and its
    /// shape by formula where it has one, and the tolerance to which it was compressed.
    ///
    /// # Errors
    /// [`Error::Input`] if there isn't one surface and tolerance for each body, or for a wall without normal.
    pub fn with_films(
        mut self,
        surfaces: &[(&TriMesh, Option<&Solid>)],
        tolerances: &[f64],
        walls: &[Wall],
    ) -> Result<Self> {
        self.films = films(&self.bodies, surfaces, tolerances, walls)?;
        self.films.exclude(&self.excluded);
        Ok(self)
    }

    /// All films that there may be.
    pub(crate) fn films(&self) -> &Films {
        &self.films
    }

    /// The films at the poses, for a basis of body-frame twists.
    ///
    /// # Errors
    /// Bodies that touch.
    pub(super) fn placed_films(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<PlacedFilms> {
        self.films.place(poses, basis, &self.names)
    }

    /// Whether there are films at the poses.
    ///
    /// # Errors
    /// Bodies that touch.
    #[cfg(feature = "gpu")]
    pub(crate) fn narrow(&self, poses: &[Pose]) -> Result<bool> {
        let none = DMatrix::zeros(6 * self.bodies.len(), 0);
        Ok(self.placed_films(poses, &none)?.any())
    }
}
