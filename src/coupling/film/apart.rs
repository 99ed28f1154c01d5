//! What is held off by a film, and by how much.

use super::placed::{MovingFilm, PlacedFilm};
use super::{Film, Side};
use crate::adjoint::lie::{Vec3, Vec6};
use crate::geometry::Image;

/// How the points of a body, or of its image, are held off one that sees them, for the gap is narrower than is resolved.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Apart {
    /// Number of the film.
    pub film: usize,
    /// Which of the film's shifts it goes by: 0 in the frame of its first body, 1 in that of the other.
    at: usize,
    /// −1 where the film's first body is the source; twice for an image.
    sign: f64,
}

impl Apart {
    /// By a film of this number, if it holds `source`, as the image shows it, off `target`.
    pub(super) fn of(
        number: usize,
        film: &Film,
        (target, source): (usize, usize),
        image: &Image,
    ) -> Option<Self> {
        let (at, sign) = match film.other {
            Side::Wall(w) => {
                let own = film.body == target && target == source;
                (own && *image == w).then_some((0, 2.0))
            }
            Side::Body(_) if !image.is_identity() => None,
            Side::Body(b) if (film.body, b) == (target, source) => Some((0, 1.0)),
            Side::Body(b) if (b, film.body) == (target, source) => Some((1, -1.0)),
            Side::Body(_) => None,
        }?;
        Some(Self {
            film: number,
            at,
            sign,
        })
    }

    /// In the target's frame.
    pub fn shift(&self, film: &PlacedFilm) -> Vec3 {
        self.sign * film.shift[self.at]
    }

    /// Its rate.
    pub fn rate(&self, film: &MovingFilm) -> Vec3 {
        self.sign * film.shift_rate(self.at)
    }

    /// What a force on all points together, target's frame, exerts by way of the shift, in the film's frame.
    pub fn wrench(&self, film: &PlacedFilm, force: &Vec3) -> Vec6 {
        film.shift_wrench(self.at, &(self.sign * force))
    }

    /// The same and its rate, of a force that changes.
    pub fn wrench_and_rate(&self, film: &MovingFilm, [force, dforce]: [&Vec3; 2]) -> (Vec6, Vec6) {
        film.shift_wrench(self.at, &(self.sign * force), &(self.sign * dforce))
    }
}
