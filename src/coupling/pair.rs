//! A body and the points of another body's image, whose relative placement changes.

use crate::adjoint::kernel::Sources;
use crate::adjoint::lie::{Mat3, Pose, Vec3, Vec6, cross_force, point_velocity, point_wrench};
use crate::coupling::film::{Apart, MovingFilm, MovingFilms, PlacedFilm, PlacedFilms};
use crate::geometry::Image;

/// One pair at given poses.
pub(super) struct Pair {
    /// Body whose faces see the sources.
    pub target: usize,
    /// Body whose sources, or their images, are seen.
    pub source: usize,
    /// The image.
    pub image: Image,
    /// From the source body's axes to the target's, mirrored as the image is.
    pub rotation: Mat3,
    /// Source positions in the target's frame.
    pub points: Sources,
    /// The same as vectors, where they aren't held off.
    pub positions: Vec<Vec3>,
    /// By how much they are.
    apart: Option<Apart>,
}

impl Pair {
    /// From both bodies' poses and the source body's points in its own frame.
    pub fn new(
        (target, at): (usize, &Pose),
        (source, from): (usize, &Pose),
        image: &Image,
        points: &[Vec3],
    ) -> Self {
        let (rotation, shift) = image.placement(from);
        let rotation = at.rotation.tr_mul(&rotation);
        let shift = at.rotation.tr_mul(&(shift - at.translation));
        let positions: Vec<Vec3> = points.iter().map(|s| rotation * s + shift).collect();
        Self {
            target,
            source,
            image: *image,
            rotation,
            points: Sources::new(&positions),
            positions,
            apart: None,
        }
    }

    /// The same with the sources as far off as a film holds them, if one does; their arms stay those of the bodies' own points.
    pub fn held_off(mut self, films: &PlacedFilms) -> Self {
        self.apart = films.apart(self.target, self.source, &self.image);
        if let Some((apart, film)) = self.film(films) {
            let shift = apart.shift(film);
            let moved: Vec<Vec3> = self.positions.iter().map(|s| s + shift).collect();
            self.points = Sources::new(&moved);
        }
        self
    }

    /// What holds the sources off, if anything does.
    pub fn film<'f>(&self, films: &'f PlacedFilms) -> Option<(Apart, &'f PlacedFilm)> {
        self.apart
            .and_then(|apart| Some((apart, films.of(&apart)?)))
    }

    /// The same along a displacement.
    pub fn moving<'f, 'a>(
        &self,
        films: &'f MovingFilms<'a>,
    ) -> Option<(Apart, &'f MovingFilm<'a>)> {
        self.apart
            .and_then(|apart| Some((apart, films.of(&apart)?)))
    }

    /// Displacement of each source in the target's frame, relative to the target, where they aren't held off.
    pub fn displacements(&self, pose: &Pose, z: &[Vec6]) -> Vec<Vec3> {
        let local = self.relative_twist(pose, z);
        let velocity = |s| point_velocity(&local, s);
        self.positions.iter().map(velocity).collect()
    }

    /// Twist of the sources in the target's frame, relative to the target.
    pub fn relative_twist(&self, pose: &Pose, z: &[Vec6]) -> Vec6 {
        let relative = self.image.twist(&z[self.source]) - z[self.target];
        pose.twist_to_body(&relative)
    }

    /// Adds a wrench on the sources (given in the target's frame) to both bodies, as spatial wrenches.
    pub fn apply(&self, pose: &Pose, wrench: &Vec6, out: &mut [Vec6]) {
        self.apply_world(&pose.wrench_to_world(wrench), out);
    }

    fn apply_world(&self, world: &Vec6, out: &mut [Vec6]) {
        out[self.source] += self.image.twist_vjp(world);
        out[self.target] -= world;
    }

    /// Tangent of [`Pair::apply`] when the target moves with `z`.
    pub fn apply_jvp(
        &self,
        pose: &Pose,
        wrench: &Vec6,
        dwrench: &Vec6,
        z: &Vec6,
        out: &mut [Vec6],
    ) {
        let world = cross_force(z, &pose.wrench_to_world(wrench)) + pose.wrench_to_world(dwrench);
        self.apply_world(&world, out);
    }
}

/// Wrench about the origin of forces at points: Σ (f, s × f).
pub(super) fn wrench(positions: &[Vec3], force: impl Fn(usize) -> Vec3) -> Vec6 {
    let wrenches = positions.iter().enumerate();
    wrenches.map(|(j, s)| point_wrench(s, &force(j))).sum()
}

/// Three-vector `k` of row `j` in a `[j][columns][3]` array.
#[inline]
pub(super) fn vector(g: &[f64], columns: usize, j: usize, k: usize) -> Vec3 {
    Vec3::from_column_slice(&g[3 * (j * columns + k)..][..3])
}
