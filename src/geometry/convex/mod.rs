//! Convex bodies by formula: outermost points, signed distances of points, and how far bodies are from one
//! another and from walls.
//!
//! A body is one of three things: an *ellipsoid*, a *cylinder*, or a *core*, the convex hull of its corners,
//! with a radius about it: a ball is a corner, a capsule an edge, a box a polyhedron of radius zero.

mod core;
mod cylinder;
mod ellipsoid;
mod field;
mod nearest;
mod overlap;
mod polish;
mod round;

use super::points::Ball;
use super::wall::HalfSpace;
use hydrograd_adjoint::lie::{Pose, Vec3};
use nearest::{TOUCHING, nearest};
use overlap::overlap;
use polish::polish;

pub(crate) use self::core::{Core, Edge, Face};
pub(crate) use cylinder::{Cylinder, Disc};
pub(crate) use ellipsoid::Ellipsoid;
pub(crate) use field::{AtCorner, Field, across, perpendicular};
pub(crate) use round::{Round, Support, rising_root};

/// Most different directions of edges of either body that are held against one another in an overlap.
const EDGES: usize = 40;
/// Numbers beyond which poses aren't looked at, m.
const FAR: f64 = 1e60;

/// A convex body by formula, placed in a body's frame.
#[derive(Clone, Debug)]
pub struct Solid {
    pub(crate) form: Form,
    /// Frame of the form to frame of the body.
    pub(crate) offset: Pose,
}

/// What it is, in its own frame.
#[derive(Clone, Debug)]
pub(crate) enum Form {
    Core(Core),
    Ellipsoid(Ellipsoid),
    Cylinder(Cylinder),
}

/// How far apart two bodies are, and where.
pub(super) struct Between {
    /// m; negative: minus the shift that parts them.
    pub distance: f64,
    /// The nearest points of the two, each in the frame of its body; of bodies that overlap, the deepest.
    pub points: [Vec3; 2],
}

impl Form {
    /// The outermost point in a direction of any length, without the radius.
    fn outermost(&self, direction: &Vec3) -> Vec3 {
        match self {
            Self::Core(core) => core.outermost(direction),
            Self::Ellipsoid(ellipsoid) => ellipsoid.outermost(direction),
            Self::Cylinder(cylinder) => cylinder.outermost(direction),
        }
    }

    /// Signed distance of a point, without the radius.
    pub(super) fn field(&self, y: &Vec3) -> Field {
        match self {
            Self::Ellipsoid(ellipsoid) => ellipsoid.field(y),
            Self::Cylinder(cylinder) => cylinder.field(y),
            Self::Core(core) => {
                let field = core.field(y, f64::INFINITY);
                field.unwrap_or(Field::flat(f64::NAN, Vec3::x()))
            }
        }
    }

    /// What is about it.
    pub(super) fn radius(&self) -> f64 {
        match self {
            Self::Core(core) => core.radius,
            Self::Ellipsoid(_) | Self::Cylinder(_) => 0.0,
        }
    }

    fn ball(&self) -> Ball {
        let about = |radius: f64| Ball {
            center: Vec3::zeros(),
            radius,
        };
        match self {
            Self::Ellipsoid(e) => about(e.semi_axes.max()),
            Self::Cylinder(c) => about(c.radius.hypot(c.half)),
            Self::Core(core) => {
                let ball = Ball::around(core.corners.iter());
                Ball {
                    radius: ball.radius + core.radius,
                    ..ball
                }
            }
        }
    }

    /// Directions along which bodies that overlap may part soonest, and directions of straight edges.
    fn directions(&self) -> (Vec<Vec3>, Vec<Vec3>) {
        let axes = || (0..3).flat_map(|i| [Vec3::ith(i, 1.0), Vec3::ith(i, -1.0)]);
        match self {
            Self::Ellipsoid(_) => (axes().collect(), Vec::new()),
            Self::Cylinder(_) => (axes().collect(), vec![Vec3::z()]),
            Self::Core(core) => {
                let mut along: Vec<Vec3> = Vec::new();
                for edge in &core.edges {
                    let new = |d: &Vec3| d.cross(&edge.along).norm() > 1e-9;
                    if along.len() < EDGES && along.iter().all(new) {
                        along.push(edge.along);
                    }
                }
                (core.faces.iter().map(|f| f.normal).collect(), along)
            }
        }
    }
}

impl Solid {
    /// Smallest and largest coordinates, frame of the body, m.
    pub(crate) fn bounds(&self) -> [Vec3; 2] {
        let reach = |direction: Vec3| {
            let own = self.offset.rotation.tr_mul(&direction);
            let outermost = self.offset.apply(&self.form.outermost(&own));
            direction.dot(&outermost) + self.form.radius()
        };
        let side = |sign: f64| Vec3::from_fn(|i, _| sign * reach(Vec3::ith(i, sign)));
        [side(-1.0), side(1.0)]
    }

    /// A ball around it, frame of the body.
    pub(crate) fn ball(&self) -> Ball {
        self.form.ball().transformed(&self.offset)
    }

    /// Distance from another; none if a pose isn't finite. Poses are body to world.
    pub(super) fn between(&self, at: &Pose, other: &Self, other_at: &Pose) -> Option<Between> {
        // Difference of the translations first: nothing is lost far from the origin.
        let turn = at.rotation.transpose();
        let way = turn * (other_at.translation - at.translation);
        let there = Pose::new(turn * other_at.rotation, way).compose(&other.offset);
        let there = self.offset.inverse().compose(&there);
        let numbers = there.rotation.iter().chain(there.translation.iter());
        if !numbers.into_iter().all(|x| x.abs() <= FAR) {
            return None;
        }
        let (a, b) = (&self.form, &other.form);
        let first = |n: &Vec3| a.outermost(n);
        let second = |n: &Vec3| there.apply(&b.outermost(&there.rotation.tr_mul(n)));
        let (here, beyond) = (a.ball(), b.ball());
        // The translations were rounded in the world.
        let placed = at.translation.amax().max(other_at.translation.amax());
        let size = here.radius + beyond.radius + 4.0 * f64::EPSILON / TOUCHING * placed;
        let start = here.center - there.apply(&beyond.center);
        let radii = a.radius() + b.radius();
        let found = nearest(&first, &second, &start, size);
        let (distance, normal, points) = match found {
            Some(found) => {
                let found = polish(found, a, b, &there, size);
                (found.distance - radii, found.normal, found.points)
            }
            None => {
                let (mut seeds, ours) = a.directions();
                let (more, theirs) = b.directions();
                seeds.extend(more.iter().map(|d| there.rotation * -d));
                // Outward of the first is against the shift.
                seeds.iter_mut().for_each(|d| *d = -*d);
                for e in &ours {
                    for f in &theirs {
                        let across = e.cross(&(there.rotation * f));
                        seeds.extend([across, -across]);
                    }
                }
                seeds.push(start);
                // Drawn in towards their middles they come apart, along about the shortest way.
                for part in [0.95, 0.8, 0.5, 0.2, 0.02] {
                    let drawn = |x: Vec3, middle: Vec3| middle + part * (x - middle);
                    let inner = |n: &Vec3| drawn(first(n), here.center);
                    let other = |n: &Vec3| drawn(second(n), there.apply(&beyond.center));
                    seeds.extend(nearest(&inner, &other, &start, size).map(|found| found.normal));
                }
                let (height, normal) = overlap(&first, &second, seeds);
                // Touching, to rounding.
                let height = if height >= -TOUCHING * size {
                    0.0
                } else {
                    height
                };
                (height - radii, normal, [first(&-normal), second(&normal)])
            }
        };
        let surface = [
            self.offset.apply(&(points[0] - a.radius() * normal)),
            (other.offset).apply(&there.apply_inverse(&(points[1] + b.radius() * normal))),
        ];
        Some(Between {
            distance,
            points: surface,
        })
    }

    /// Height of the lowest point over a wall, m, and where it is in the frame of the body; the pose is body to world.
    pub(super) fn height(&self, at: &Pose, wall: &HalfSpace) -> (f64, Vec3) {
        let placed = at.compose(&self.offset);
        let down = -placed.rotation.tr_mul(&wall.normal);
        let lowest = self.form.outermost(&down);
        let height = wall.height(&placed.apply(&lowest)) - self.form.radius();
        (
            height,
            self.offset.apply(&(lowest + self.form.radius() * down)),
        )
    }
}

/// The unit vector from the second of two ellipsoids or discs to the first where they are nearest, world frame; none if
/// they overlap. `size` is that of the two together, m.
pub(crate) fn common_normal(
    first: (&impl Round, &Pose),
    second: (&impl Round, &Pose),
    size: f64,
) -> Option<Vec3> {
    let unit = |n: &Vec3| n.try_normalize(0.0).unwrap_or(Vec3::x());
    let a = |n: &Vec3| first.0.support(first.1, &unit(n)).point;
    let b = |n: &Vec3| second.0.support(second.1, &unit(n)).point;
    let way = first.1.translation - second.1.translation;
    nearest(&a, &b, &way, size).map(|found| found.normal)
}
