//! Contact among bodies and with walls: which surfaces may touch, by which law, and where they are near.

use super::{ContactLaws, Parameter, Parameters};
use crate::adjoint::contact::{ContactBar, Law, PointState, Rates, positive};
use crate::adjoint::lie::{Pose, Vec3, Vec6, angular, point_velocity, point_wrench, six};
use crate::contact::{ContactPair, ContactPoint, Contacts};
use crate::multibody::Virtual;
use nalgebra::DVector;
use serde::Serialize;

/// Which surfaces may touch, and how.
#[derive(Clone)]
pub struct ContactModel {
    /// Their shapes.
    pub shapes: Contacts,
    /// Shapes with a parameter of theirs changed.
    pub changed: Vec<ChangedShape>,
    /// Law of each pair.
    pub laws: ContactLaws,
    /// Whether the stiffness is near rigid at the time step, so that it rises where a step is cut; one that was given stays what it is.
    pub rigid: bool,
    /// Whether there is water between the surfaces, which has no flow where they meet.
    pub wet: bool,
}

/// All shapes with a shape parameter of one body a little larger, and a little smaller.
#[derive(Clone)]
pub struct ChangedShape {
    /// The body.
    pub body: usize,
    /// Its parameter.
    pub parameter: Parameter,
    /// The change of it.
    pub step: f64,
    /// How far any point of the surface moves by that, m.
    pub reach: f64,
    /// The shapes.
    pub shapes: [Contacts; 2],
}

/// Gap at which the surfaces of a pair are taken to touch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ContactGap {
    /// A body.
    pub first: usize,
    /// The other one; none for a wall.
    pub second: Option<usize>,
    /// m
    pub gap: f64,
    /// The same as a part of the size of the smaller body, the diameter of the ball around it.
    pub part: f64,
}

/// A place where two surfaces are near at a configuration.
#[derive(Clone, Debug)]
pub struct PairContact {
    /// The pair.
    pub pair: ContactPair,
    /// Body to which the normal points.
    pub first: usize,
    /// The other body; none for a wall.
    pub second: Option<usize>,
    /// Its law.
    pub law: Law,
    /// The law's stiffness over the parameter's: the square of its sharpness.
    pub scale: f64,
    /// Where, with its derivatives.
    pub point: ContactPoint,
}

/// A law that is as stiff in the `n`-th part of a step as it was in the whole, and foresees no further than that part. Its force sets in over a width that is
/// less by as much as it is stiffer, or at no depth at all it would press n² times as hard.
pub(super) fn sharpened(law: Law, n: usize) -> Law {
    let n = n as f64;
    Law {
        stiffness: law.stiffness * n * n,
        horizon: law.horizon / n,
        width: law.width / (n * n),
        ..law
    }
}

/// The gap that a law is asked with at `gap`, whose stiffness is `scale` times what it was, and its slope. A sharper law stops what comes, but presses on what is in
/// already as hard as before, or it would throw it out: of a depth d below g₀ it is asked with d/`scale`.
pub(super) fn eased(law: &Law, scale: f64, gap: f64) -> (f64, f64) {
    if scale == 1.0 {
        return (gap, 1.0);
    }
    let share = 1.0 - 1.0 / scale;
    let (depth, slope) = positive(law.gap - gap, scale * law.width);
    (gap + share * depth, 1.0 - share * slope)
}

impl ContactModel {
    /// The gap of each pair, in the order of [`Contacts::pairs`].
    pub fn gaps(&self) -> impl Iterator<Item = ContactGap> {
        self.shapes.pairs().map(|pair| {
            let gap = self.laws.of(&pair).gap;
            ContactGap {
                first: pair.first,
                second: pair.second_body(),
                gap,
                part: gap / (2.0 * self.laws.smaller(&pair)),
            }
        })
    }

    /// The pairs whose surfaces may be as near as `beyond` (m) past where their forces set in, and some that aren't: `beyond` tells what a body has of that, so
    /// that of a pair it is no more than the sum of both, or twice that of a body and a wall. In the order of [`Contacts::pairs`].
    pub(super) fn near(&self, poses: &[Pose], beyond: impl Fn(usize) -> f64) -> Vec<ContactPair> {
        let laws = &self.laws;
        // A pair's gap is one of its bodies'.
        let widest = (0..poses.len()).map(|b| laws.widest(b)).fold(0.0, f64::max);
        let onset = 0.5 * (widest + laws.common.width);
        self.shapes.near(poses, |b| onset + beyond(b))
    }

    pub(super) fn law(&self, pair: &ContactPair, parameters: &Parameters) -> Law {
        let [
            stiffness,
            dissipation,
            friction,
            torsional_friction,
            rolling_friction,
        ] = parameters.contact();
        Law {
            stiffness,
            dissipation,
            friction,
            torsional_friction,
            rolling_friction,
            ..self.laws.of(pair)
        }
    }
}

/// What two surfaces do to one another at a point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ContactForce {
    /// Body that the force acts on.
    pub first: usize,
    /// The other one, on which the opposite force acts; none for a wall.
    pub second: Option<usize>,
    /// Signed distance of the surfaces, m.
    pub gap: f64,
    /// Where, m, world frame.
    pub position: [f64; 3],
    /// Unit normal, world frame, towards the first body.
    pub normal: [f64; 3],
    /// Force on the first body, N, world frame.
    pub force: [f64; 3],
    /// Torque on the first body beside the force's own, N m, world frame: of torsional and rolling friction.
    pub torque: [f64; 3],
}

impl PairContact {
    /// Relative twist of two bodies' spatial fields.
    pub(super) fn relative(&self, field: &[Vec6]) -> Vec6 {
        field[self.first] - self.second.map_or(Vec6::zeros(), |b| field[b])
    }

    /// [`eased`] at its gap.
    pub(super) fn eased_gap(&self) -> (f64, f64) {
        eased(&self.law, self.scale, self.point.gap)
    }

    /// How the first body moves against the second at the point.
    pub(super) fn rates(&self, twists: &[Vec6]) -> Rates {
        let twist = self.relative(twists);
        Rates {
            velocity: point_velocity(&twist, &self.point.position),
            spin: angular(&twist),
        }
    }

    /// Wrench of a push at the point, and by that cotangent of a twist from one of [`PairContact::rates`].
    pub(super) fn wrench(&self, force: &Vec3, torque: &Vec3) -> Vec6 {
        point_wrench(&self.point.position, force) + six(&Vec3::zeros(), torque)
    }

    /// Where bodies move with these spatial twists.
    pub(super) fn point_state(&self, twists: &[Vec6]) -> PointState {
        let p = &self.point;
        PointState {
            gap: self.eased_gap().0,
            weight: p.weight,
            normal: p.normal,
            rates: self.rates(twists),
        }
    }

    /// Adds a wrench to the first body and takes it from the second.
    pub(super) fn exchange(&self, wrench: &Vec6, out: &mut [Vec6]) {
        out[self.first] += wrench;
        if let Some(b) = self.second {
            out[b] -= wrench;
        }
    }

    /// Cotangent of a displacement of both bodies from those of what the point consists of: the point and its normal are carried
    /// along by the second body, and its slopes tell what the first one's displacement relative to it adds.
    pub(super) fn displacement_vjp(&self, bar: &ContactBar, position: &Vec3, out: &mut [Vec6]) {
        let (p, s) = (&self.point, &self.point.slopes);
        let own = s.gap * bar.gap
            + s.weight * bar.weight
            + s.normal.tr_mul(&bar.normal)
            + s.position.tr_mul(position);
        self.exchange(&own, out);
        if let Some(b) = self.second {
            out[b] += point_wrench(&p.position, position)
                + six(&Vec3::zeros(), &p.normal.cross(&bar.normal));
        }
    }
}

/// In which coordinates generalised forces are dual to velocities.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dual {
    /// The user's: what M(q) v̇ is.
    User,
    /// The frame momenta's.
    Frame,
}

impl Dual {
    /// A velocity that generalised forces of these coordinates do work on.
    pub(super) fn virtual_velocity(self, z: &DVector<f64>) -> Virtual<'_> {
        match self {
            Self::User => Virtual::User(z),
            Self::Frame => Virtual::Frame(z),
        }
    }
}
