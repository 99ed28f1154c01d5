//! How the bodies in the water move, as what rollouts observe of them.

use super::super::Simulator;
use super::bar::BodyBar;
use crate::adjoint::lie::{Pose, Vec3, Vec6, angular, cross_force, cross_motion, linear, six};
use crate::coupling::{Motion, MotionBar};
use nalgebra::DVector;

/// The bodies in the water at one moment.
///
/// With p the origin, v and a its velocity and acceleration, ω and α the rates of turn and theirs, C the current, all in world axes,
///
/// ```text
/// V = (v − ω × p, ω),   V' = (a − α × p − ω × v, α)         spatial twist and its rate
/// x̄ = Ad⁻¹(V − C),      x̄' = Ad⁻¹(V' + V × C)              in the body's frame, through the water
/// ```
pub(super) struct Moving {
    /// Their numbers in the scene.
    pub bodies: Vec<usize>,
    pub poses: Vec<Pose>,
    /// v and ω; a and α.
    observed: Vec<[Vec6; 2]>,
    /// V.
    displacement: Vec<Vec6>,
    /// V − C and V' + V × C.
    through: Vec<[Vec6; 2]>,
    current: Vec6,
    twists: DVector<f64>,
    rates: Option<DVector<f64>>,
}

impl Moving {
    /// From velocities, and accelerations where rates are asked for, of all bodies, six a body.
    pub fn new(
        simulator: &Simulator,
        poses: &[Pose],
        velocities: &[f64],
        gains: Option<&[f64]>,
    ) -> Self {
        let system = simulator.system();
        let current = six(&system.current, &Vec3::zeros());
        let bodies: Vec<usize> = system.submerged().map(|(b, _)| b).collect();
        let row = |x: &[f64], b: usize| Vec6::from_column_slice(&x[6 * b..6 * b + 6]);
        let still = |b: usize| gains.map_or_else(Vec6::zeros, |gains| row(gains, b));
        let observed: Vec<[Vec6; 2]> = (bodies.iter())
            .map(|b| [row(velocities, *b), still(*b)])
            .collect();
        let poses: Vec<Pose> = bodies.iter().map(|b| poses[*b]).collect();
        let pairs = || poses.iter().zip(&observed);
        let displacement: Vec<Vec6> = pairs()
            .map(|(pose, [v, _])| {
                six(
                    &(linear(v) - angular(v).cross(&pose.translation)),
                    &angular(v),
                )
            })
            .collect();
        let rate = |(pose, [v, a]): (&Pose, &[Vec6; 2])| {
            let turned = angular(a).cross(&pose.translation) + angular(v).cross(&linear(v));
            six(&(linear(a) - turned), &angular(a))
        };
        let through: Vec<[Vec6; 2]> = (displacement.iter().zip(pairs()))
            .map(|(v, pair)| [v - current, rate(pair) + cross_motion(v, &current)])
            .collect();
        let stacked = |k: usize| {
            let each = poses.iter().zip(&through);
            let rows = each.flat_map(|(pose, t)| <[f64; 6]>::from(pose.twist_to_body(&t[k])));
            DVector::from_iterator(6 * poses.len(), rows)
        };
        Self {
            twists: stacked(0),
            rates: gains.map(|_| stacked(1)),
            bodies,
            observed,
            displacement,
            through,
            current,
            poses,
        }
    }

    /// For the coupling.
    pub fn motion(&self) -> Motion<'_> {
        Motion {
            poses: &self.poses,
            twists: &self.twists,
            rates: self.rates.as_ref(),
            displacement: &self.displacement,
        }
    }

    /// Body-frame twist of the k-th body in the water through it, and its rate; zero where that isn't asked for.
    pub fn twist(&self, k: usize) -> [Vec6; 2] {
        let row = |x: &DVector<f64>| x.fixed_rows::<6>(6 * k).into_owned();
        [
            row(&self.twists),
            self.rates.as_ref().map_or_else(Vec6::zeros, row),
        ]
    }

    /// The transpose: of all bodies in the water, what they are observed by.
    pub fn back(&self, bar: &MotionBar) -> Vec<BodyBar> {
        let of = |k: usize| {
            let (pose, [v, a]) = (&self.poses[k], &self.observed[k]);
            let row =
                |x: &DVector<f64>| pose.wrench_to_world(&x.fixed_rows::<6>(6 * k).into_owned());
            let (twist, rate) = (row(&bar.twists), row(&bar.rates));
            let [through, gained] = &self.through[k];
            // Ad⁻¹ X of a pose that is displaced by Y loses Y × X.
            let wrench = bar.poses[k] - cross_force(through, &twist) - cross_force(gained, &rate);
            let spatial = twist + bar.displacement[k] + cross_force(&self.current, &rate);
            let p = pose.translation;
            let (f, df) = (linear(&spatial), linear(&rate));
            let force = linear(&wrench);
            BodyBar {
                position: force - f.cross(&angular(v)) - df.cross(&angular(a)),
                rotation: angular(&wrench) - p.cross(&force),
                velocity: six(
                    &(f - df.cross(&angular(v))),
                    &(angular(&spatial) - p.cross(&f) - linear(v).cross(&df)),
                ),
                gain: six(&df, &(angular(&rate) - p.cross(&df))),
            }
        };
        (0..self.poses.len()).map(of).collect()
    }
}
