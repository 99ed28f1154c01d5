//! The pairs of surfaces that may come in contact, and the contact points of two bodies and of a body and a wall.

use super::point::ContactPoint;
use super::shape::ContactShape;
use super::{core_core, cylinder, cylinder_pair, plane, round_core, round_pair};
use crate::adjoint::lie::{Pose, Vec3, Vec6, angular, point_velocity};
use crate::geometry::convex::Form;
use crate::geometry::{Ball, Casing, HalfSpace, Neighbours, Other, Pairing, Region, Wall};
use crate::{Error, Result};

/// Two surfaces that may come in contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ContactPair {
    /// The body that normals point to.
    pub first: usize,
    /// What it may come in contact with.
    pub second: Other,
    /// Number of the first body's piece, and of the second's; zero of a wall and of bodies that are one piece.
    pub pieces: [usize; 2],
}

impl ContactPair {
    /// Number of the second body, unless it's a wall.
    pub fn second_body(&self) -> Option<usize> {
        match self.second {
            Other::Body(b) => Some(b),
            Other::Wall(_) => None,
        }
    }
}

/// Shapes of the bodies of a scene, its walls, and which of them may come in contact.
#[derive(Clone, Debug)]
pub struct Contacts {
    /// Of each body its convex pieces; of a convex one itself.
    shapes: Vec<Vec<ContactShape>>,
    /// Boxes around the bodies.
    casings: Vec<Option<Casing>>,
    walls: Vec<HalfSpace>,
    pairing: Pairing,
}

/// A box around all pieces of a body.
fn casing(pieces: &[ContactShape]) -> Option<Casing> {
    let each = pieces.iter().map(|piece| Casing::new(piece.bounds()));
    each.reduce(Casing::joined)
}

/// Points are kept up to this part of the smaller body's radius beyond the distance asked for: what may close in a step.
const AHEAD: f64 = 0.5;

impl Contacts {
    /// From the convex pieces of each body (one of a convex body, none of a body without surface), the walls, and which bodies may come in contact with one another and with
    /// walls; each piece then may with each.
    ///
    /// # Errors
    /// A wall without a normal.
    pub fn new(shapes: Vec<Vec<ContactShape>>, walls: &[Wall], pairing: Pairing) -> Result<Self> {
        Ok(Self {
            pairing,
            walls: Wall::half_spaces(walls)?,
            casings: shapes.iter().map(|pieces| casing(pieces)).collect(),
            shapes,
        })
    }

    /// The same with another shape of a body that is one piece.
    pub fn with_piece(&self, b: usize, shape: ContactShape) -> Self {
        let mut out = self.clone();
        out.shapes[b] = vec![shape];
        out.casings[b] = casing(&out.shapes[b]);
        out
    }

    /// The pairs that may come in contact, ascending: of bodies in pieces each piece by itself, and so the same bodies several times.
    pub fn pairs(&self) -> impl Iterator<Item = ContactPair> {
        let bodies = self.shapes.len();
        (0..bodies).flat_map(move |a| {
            let later = a + 1..bodies;
            let others = later.filter(move |b| self.pairing.has(a, *b));
            let walls = self.walls_of(a).map(|(w, _)| Other::Wall(w));
            let others = others.map(Other::Body).chain(walls);
            others.flat_map(move |second| self.pieces_of(a, second))
        })
    }

    /// Those that may be nearer than the sum of `reach` (m) of both bodies, twice that of a body and a wall, the bodies being at `poses`;
    /// and, in the same order, some that aren't.
    pub fn near(&self, poses: &[Pose], reach: impl Fn(usize) -> f64) -> Vec<ContactPair> {
        let region = |b: usize| {
            let around = |shape: &ContactShape| Region::around(&shape.ball_at(&poses[b]), reach(b));
            self.shapes[b].iter().map(around).reduce(Region::joined)
        };
        let near = Neighbours::new((0..self.shapes.len()).map(region).collect());
        let mut bodies = near.pairs().peekable();
        let mut out = Vec::new();
        for (a, (own, pose)) in self.shapes.iter().zip(poses).enumerate() {
            while let Some((_, b)) = bodies.next_if(|(first, _)| *first == a) {
                if self.pairing.has(a, b) && !self.are_far(poses, [a, b], reach(a) + reach(b)) {
                    out.extend(self.pieces_of(a, Other::Body(b)));
                }
            }
            for (w, wall) in self.walls_of(a) {
                let far = |shape: &ContactShape| {
                    let ball = shape.ball_at(pose);
                    wall.height(&ball.center) - ball.radius >= 2.0 * reach(a)
                };
                // What isn't a number isn't far.
                if !own.iter().all(far) {
                    out.extend(self.pieces_of(a, Other::Wall(w)));
                }
            }
        }
        out
    }

    /// Whether boxes around two bodies tell that they aren't nearer than `reach`, m.
    fn are_far(&self, poses: &[Pose], [a, b]: [usize; 2], reach: f64) -> bool {
        let (Some(own), Some(other)) = (&self.casings[a], &self.casings[b]) else {
            return false;
        };
        let apart = own.apart_at(&poses[a], other, &poses[b]);
        apart > 0.0 && apart >= reach
    }

    /// Whether any of the bodies that `inside` names may come in contact with a wall or with one that it doesn't.
    pub fn reach_out(&self, inside: &[bool]) -> bool {
        let (own, others): (Vec<usize>, Vec<usize>) = (0..self.shapes.len())
            .filter(|b| !self.shapes[*b].is_empty())
            .partition(|b| inside[*b]);
        let meets = |a: usize| {
            self.walls_of(a).next().is_some() || others.iter().any(|b| self.pairing.has(a, *b))
        };
        own.into_iter().any(meets)
    }

    /// The walls that a body may come in contact with, with their numbers.
    fn walls_of(&self, body: usize) -> impl Iterator<Item = (usize, &HalfSpace)> {
        let all = self.pairing.has_walls(body).then_some(&self.walls);
        all.into_iter().flatten().enumerate()
    }

    /// The pairs of the pieces of a body and another, or a wall.
    fn pieces_of(&self, a: usize, second: Other) -> impl Iterator<Item = ContactPair> + use<> {
        let others = match second {
            Other::Body(b) => self.shapes[b].len(),
            Other::Wall(_) => 1,
        };
        (0..self.shapes[a].len()).flat_map(move |i| {
            (0..others).map(move |j| ContactPair {
                first: a,
                second,
                pieces: [i, j],
            })
        })
    }

    /// Convex pieces of body `b`: itself, if it is convex.
    pub fn pieces(&self, b: usize) -> &[ContactShape] {
        &self.shapes[b]
    }

    /// A ball around body `b`, in its frame; of several pieces around their bounds; none without surface.
    pub fn ball(&self, b: usize) -> Option<Ball> {
        match self.pieces(b) {
            [] => None,
            [whole] => Some(whole.ball()),
            pieces => {
                let joined = |x: [Vec3; 2], y: [Vec3; 2]| [x[0].inf(&y[0]), x[1].sup(&y[1])];
                let bounds = pieces.iter().map(ContactShape::bounds).reduce(joined);
                bounds.map(|[low, high]| Ball {
                    center: 0.5 * (low + high),
                    radius: 0.5 * (high - low).norm(),
                })
            }
        }
    }

    /// Radius of that ball, m.
    pub fn radius(&self, b: usize) -> Option<f64> {
        self.ball(b).map(|ball| ball.radius)
    }

    /// Where the surfaces of a pair are near, the bodies being at `poses`; all places with a gap under `distance` (m) and some beyond,
    /// as far as bodies may come in a step.
    ///
    /// # Errors
    /// A signed distance that can't be found.
    pub fn points(
        &self,
        pair: &ContactPair,
        poses: &[Pose],
        distance: f64,
    ) -> Result<Vec<ContactPoint>> {
        self.points_within(pair, poses, distance + self.ahead(pair))
    }

    /// The same, of all places with a gap under `reach` (m) and no others.
    ///
    /// # Errors
    /// As [`Contacts::points`].
    pub fn points_within(
        &self,
        pair: &ContactPair,
        poses: &[Pose],
        reach: f64,
    ) -> Result<Vec<ContactPoint>> {
        let a = pair.first;
        match self.solids(pair) {
            Some((first, Partner::Wall(wall))) => against_wall(first, wall, &poses[a], reach),
            Some((first, Partner::Body(b, second))) => {
                between(first, second, &poses[a], &poses[b], reach)
            }
            None => Ok(Vec::new()),
        }
    }

    /// How far beyond the distance asked for [`Contacts::points`] looks, m.
    pub fn ahead(&self, pair: &ContactPair) -> f64 {
        match self.solids(pair) {
            Some((first, Partner::Wall(_))) => AHEAD * first.radius(),
            Some((first, Partner::Body(_, second))) => AHEAD * first.radius().min(second.radius()),
            None => 0.0,
        }
    }

    /// How deep the surfaces of a pair may overlap before the way out may lead through the other side, m: half the thickness of the
    /// thinner body, or the least radius of those that are round. Of a wall, that of its body, which could be deeper.
    pub fn halfway(&self, pair: &ContactPair) -> f64 {
        match self.solids(pair) {
            Some((first, Partner::Wall(_))) => half_thickness(first).1,
            Some((first, Partner::Body(_, second))) => {
                match (half_thickness(first), half_thickness(second)) {
                    ((true, a), (false, _)) => a,
                    ((false, _), (true, b)) => b,
                    ((_, a), (_, b)) => a.min(b),
                }
            }
            None => f64::INFINITY,
        }
    }

    /// The speed at which the surfaces of a pair come nearer at most, m/s, of bodies at `poses` with these spatial twists: that of
    /// their middles, and what either adds by turning; not negative.
    pub fn closing(&self, pair: &ContactPair, poses: &[Pose], twists: &[Vec6]) -> f64 {
        let a = pair.first;
        let middle = |shape: &ContactShape, b: usize| {
            let center = shape.ball_at(&poses[b]).center;
            let turning = angular(&twists[b]).norm() * lever(shape);
            (point_velocity(&twists[b], &center), turning)
        };
        let speed = match self.solids(pair) {
            Some((first, Partner::Wall(wall))) => {
                let (velocity, turning) = middle(first, a);
                turning - wall.normal.dot(&velocity)
            }
            Some((first, Partner::Body(b, second))) => {
                let (u, own) = middle(first, a);
                let (v, other) = middle(second, b);
                (u - v).norm() + own + other
            }
            None => 0.0,
        };
        speed.max(0.0)
    }

    /// What a body has of [`Contacts::ahead`] at most, m: that of a pair is no more than the sum of both, or twice that of a body and a wall.
    pub fn share_ahead(&self, b: usize) -> f64 {
        let radii = self.shapes[b].iter().map(ContactShape::radius);
        0.5 * AHEAD * radii.fold(0.0, f64::max)
    }

    /// The same of [`Contacts::halfway`].
    pub fn share_halfway(&self, b: usize) -> f64 {
        let halves = self.shapes[b].iter().map(|s| half_thickness(s).1);
        halves.fold(0.0, f64::max)
    }

    /// The same of [`Contacts::closing`], m/s, of a body at `pose` with this spatial twist.
    pub fn share_closing(&self, b: usize, pose: &Pose, twist: &Vec6) -> f64 {
        let speed = |shape: &ContactShape| {
            let center = shape.ball_at(pose).center;
            point_velocity(twist, &center).norm() + angular(twist).norm() * lever(shape)
        };
        let speeds = self.shapes[b].iter().map(speed);
        // What isn't a number stays; with room for rounding.
        let most = speeds.fold(0.0, |a: f64, x| if a.is_nan() || x <= a { a } else { x });
        most * (1.0 + 1e-9)
    }

    /// How fast the surfaces of a pair change for one another by turning, rad/s: turns of round ones about an axis of theirs, which change where friction pulls alone, count
    /// by `round`.
    pub fn turning(&self, pair: &ContactPair, poses: &[Pose], twists: &[Vec6], round: f64) -> f64 {
        let own = |b: usize, shape: &ContactShape| turning(shape, &poses[b], &twists[b], round);
        let Some((first, second)) = self.solids(pair) else {
            return 0.0;
        };
        let other = match second {
            Partner::Wall(_) => 0.0,
            Partner::Body(b, second) => own(b, second),
        };
        own(pair.first, first).max(other)
    }

    /// The same of [`Contacts::turning`], rad/s, of a body at `pose` with this spatial twist; round ones turn about their axes as they like.
    pub fn share_turning(&self, b: usize, pose: &Pose, twist: &Vec6) -> f64 {
        let turns = self.shapes[b].iter().map(|s| turning(s, pose, twist, 0.0));
        turns.fold(0.0, f64::max)
    }

    /// The shapes of a pair.
    fn solids(&self, pair: &ContactPair) -> Option<(&ContactShape, Partner<'_>)> {
        let [i, j] = pair.pieces;
        let first = self.shapes[pair.first].get(i)?;
        let second = match pair.second {
            Other::Wall(w) => Partner::Wall(&self.walls[w]),
            Other::Body(b) => Partner::Body(b, self.shapes[b].get(j)?),
        };
        Some((first, second))
    }
}

/// What a body is paired with.
enum Partner<'s> {
    Wall(&'s HalfSpace),
    /// With its number.
    Body(usize, &'s ContactShape),
}

/// Whether a body is round, and half of its thickness where it is thinnest, m.
fn half_thickness(shape: &ContactShape) -> (bool, f64) {
    match &shape.solid.form {
        Form::Ellipsoid(ellipsoid) => (true, ellipsoid.semi_axes.min()),
        Form::Core(core) if core.faces.is_empty() => (true, core.radius),
        Form::Core(core) => (false, 0.5 * core.thickness),
        Form::Cylinder(cylinder) => (false, cylinder.radius.min(cylinder.half)),
    }
}

/// How fast it turns, rad/s, with this spatial twist; about an axis about which it is round, by `round` of that. A ball looks the same however it turns.
fn turning(shape: &ContactShape, pose: &Pose, twist: &Vec6, round: f64) -> f64 {
    let turn = pose.compose(&shape.solid.offset).rotation.transpose() * angular(twist);
    let about = |axis: Vec3| {
        let along = turn.dot(&axis).abs();
        turn.cross(&axis).norm().max(round * along)
    };
    match &shape.solid.form {
        Form::Ellipsoid(ellipsoid) => {
            let [a, b, c] = ellipsoid.semi_axes.into();
            match [b == c, c == a, a == b] {
                [true, true, _] => 0.0,
                [true, ..] => about(Vec3::x()),
                [_, true, _] => about(Vec3::y()),
                [.., true] => about(Vec3::z()),
                _ => turn.norm(),
            }
        }
        Form::Core(core) => match &core.corners[..] {
            [_] => 0.0,
            [a, b] => about((b - a).normalize()),
            _ => turn.norm(),
        },
        Form::Cylinder(_) => about(Vec3::z()),
    }
}

/// How far its surface moves, at most, along its own normal as a body turns about its middle by a radian, m.
fn lever(shape: &ContactShape) -> f64 {
    match &shape.solid.form {
        Form::Ellipsoid(ellipsoid) => ellipsoid.semi_axes.max() - ellipsoid.semi_axes.min(),
        Form::Core(core) => shape.radius() - core.radius,
        Form::Cylinder(_) => shape.radius(),
    }
}

/// The places where two bodies are nearer than `reach` (m); poses are body to world. The order is
/// always the same: corners and rims of the first body, those of the second, edges.
///
/// # Errors
/// [`Error::Input`] if a pose or `reach` isn't finite; [`Error::Solver`] if the common normal of
/// two ellipsoids isn't found, which needs one that lies deep in the other.
pub fn between(
    first: &ContactShape,
    second: &ContactShape,
    first_at: &Pose,
    second_at: &Pose,
    reach: f64,
) -> Result<Vec<ContactPoint>> {
    check(reach, &[first_at, second_at])?;
    if first.ball_at(first_at).distance(&second.ball_at(second_at)) >= reach {
        return Ok(Vec::new());
    }
    let (a_at, b_at) = (
        first_at.compose(&first.solid.offset),
        second_at.compose(&second.solid.offset),
    );
    let swapped = |found: Vec<ContactPoint>| found.into_iter().map(ContactPoint::swapped).collect();
    let found = match (&first.solid.form, &second.solid.form) {
        (Form::Core(a), Form::Core(b)) => {
            return Ok(core_core::contacts(a, &a_at, b, &b_at, reach));
        }
        (Form::Cylinder(a), Form::Core(b)) => {
            return Ok(cylinder::contacts(a, &a_at, b, &b_at, reach));
        }
        (Form::Core(a), Form::Cylinder(b)) => {
            return Ok(swapped(cylinder::contacts(b, &b_at, a, &a_at, reach)));
        }
        (Form::Cylinder(a), Form::Cylinder(b)) => {
            return Ok(cylinder_pair::contacts(a, &a_at, b, &b_at, reach));
        }
        (Form::Ellipsoid(a), Form::Cylinder(b)) => {
            cylinder_pair::ellipsoid(a, &a_at, b, &b_at, reach)
        }
        (Form::Cylinder(a), Form::Ellipsoid(b)) => {
            cylinder_pair::ellipsoid(b, &b_at, a, &a_at, reach).map(ContactPoint::swapped)
        }
        (Form::Ellipsoid(a), Form::Core(b)) => round_core::contact(a, &a_at, b, &b_at, reach),
        (Form::Core(a), Form::Ellipsoid(b)) => {
            round_core::contact(b, &b_at, a, &a_at, reach).map(ContactPoint::swapped)
        }
        (Form::Ellipsoid(a), Form::Ellipsoid(b)) => {
            Some(round_pair::ellipsoids(a, &a_at, b, &b_at)?).filter(|p| p.gap < reach)
        }
    };
    Ok(found.into_iter().collect())
}

/// The places where a body is nearer than `reach` (m) to a wall, world frame; the wall counts as the second
/// body. In the order of the corners; of a cylinder, the lowest point of either rim and then those that stay in place.
///
/// # Errors
/// [`Error::Input`] if the pose or `reach` isn't finite.
pub fn against_wall(
    shape: &ContactShape,
    wall: &HalfSpace,
    at: &Pose,
    reach: f64,
) -> Result<Vec<ContactPoint>> {
    check(reach, &[at])?;
    let ball = shape.ball_at(at);
    if wall.height(&ball.center) - ball.radius >= reach {
        return Ok(Vec::new());
    }
    let at = at.compose(&shape.solid.offset);
    let mut found = match &shape.solid.form {
        Form::Ellipsoid(ellipsoid) => vec![plane::lowest(ellipsoid, &at, wall)],
        Form::Cylinder(cylinder) => cylinder::against_plane(cylinder, &at, wall),
        Form::Core(core) => plane::corners(core, &at, wall),
    };
    found.retain(|p| p.gap < reach);
    Ok(found)
}

fn check(reach: f64, poses: &[&Pose]) -> Result<()> {
    if !reach.is_finite() {
        return Err(Error::input(
            "contact: reach",
            reach,
            "give a finite length in metres",
        ));
    }
    let finite = |g: &&Pose| {
        g.rotation
            .iter()
            .chain(g.translation.iter())
            .all(|x| x.is_finite())
    };
    match poses.iter().find(|g| !finite(g)) {
        None => Ok(()),
        Some(pose) => Err(Error::input(
            "contact: pose",
            format!("position {:?}", pose.translation.as_slice()),
            "give finite poses; a smaller time step may keep them so",
        )),
    }
}
