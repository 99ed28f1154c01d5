//! The undisturbed water: what streams past bodies by depth and time, beside the uniform steady current.
//!
//! Each current has the velocity V f(d) g(t), with a share f by the depth d of a point and a factor g by time; several add up. As V is level where f isn't constant, the water's own
//! acceleration is V f(d) ġ(t): moving with itself it stays at its depth.

use super::curve::Curve;
use super::waterline::Waterline;
use super::{LoadBars, Place};
use crate::adjoint::lie::{Vec3, point_wrench};
use crate::dynamics::Parameters;
use crate::dynamics::parameters::{Declarations, Declared, Owner, Parameter, Range};
use crate::scene::{Current, Motion, Scene};

const VELOCITY: Declared = Declared::new("velocity", "m/s")
    .range(Range::Finite)
    .size(|value, typical| value.abs().max(1e-3 * typical.speed));
const SHARE: Declared = Declared::new("share", "1")
    .range(Range::Finite)
    .size(|value, _| value.abs().max(1e-3));

/// Currents of a scene.
pub struct Streams {
    currents: Vec<Law>,
    /// Where depth is zero.
    surface: Waterline,
    /// Where a body feels them, by body: in its frame, m.
    points: Vec<Vec3>,
}

struct Law {
    velocity: [Parameter; 3],
    share: Option<Curve>,
    over_time: Option<Motion>,
}

/// The undisturbed water at a point, world frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Undisturbed {
    /// m/s.
    pub velocity: Vec3,
    /// Its own acceleration, m/s².
    pub acceleration: Vec3,
}

impl Streams {
    /// Of a scene; `points` are where its bodies feel them.
    pub fn new(scene: &Scene, points: Vec<Vec3>, parameters: &mut Declarations) -> Self {
        let mut law = |(i, given): (usize, &Current)| {
            let owner = Owner::Named(scene.force_name(i));
            let axes = ["x", "y", "z"].into_iter().zip(given.velocity);
            let velocity: Vec<Parameter> = axes
                .map(|(axis, v)| parameters.declare_part(owner.clone(), VELOCITY, axis, v))
                .collect();
            let points = given.profile.iter().enumerate();
            let shares: Vec<Parameter> = points
                .map(|(k, [_, share])| {
                    parameters.declare_part(owner.clone(), SHARE, &k.to_string(), *share)
                })
                .collect();
            Law {
                velocity: [velocity[0], velocity[1], velocity[2]],
                share: level_beyond(&given.profile, shares),
                over_time: given.over_time.clone(),
            }
        };
        Self {
            currents: scene.currents().map(&mut law).collect(),
            surface: Waterline {
                up: scene.up().into(),
                height: scene.waterline.unwrap_or(0.0),
            },
            points,
        }
    }

    /// Where depths are counted from: the water's surface, if it has one.
    pub fn surface(&self) -> Waterline {
        self.surface
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.currents.is_empty()
    }

    /// Whether none flows at these parameters.
    pub(super) fn rest(&self, parameters: &Parameters) -> bool {
        let mut each = self.currents.iter().flat_map(|law| law.velocity);
        each.all(|v| parameters[v] == 0.0)
    }

    /// The water at the point `x` of the world at the time `t`, s.
    pub fn at(&self, x: &Vec3, t: f64, parameters: &Parameters) -> Undisturbed {
        let mut out = Undisturbed::default();
        let depth = self.surface.depth(x);
        for law in &self.currents {
            let ([factor, rate], share) = (law.factor(t), law.share(depth, parameters).0);
            let velocity = parameters.point(law.velocity);
            out.velocity += share * factor * velocity;
            out.acceleration += share * rate * velocity;
        }
        out
    }

    /// The water at body `b`.
    pub fn at_body(&self, b: usize, place: &Place) -> Undisturbed {
        match self.is_empty() {
            true => Undisturbed::default(),
            false => self.at(&self.point(b, place), place.time, place.parameters),
        }
    }

    /// Transpose of [`Streams::at_body`], added to the cotangents of the pose and of the parameters.
    pub(super) fn at_body_vjp(
        &self,
        b: usize,
        place: &Place,
        water_bar: &Undisturbed,
        bar: &mut LoadBars,
    ) {
        if self.is_empty() {
            return;
        }
        let (x, parameters) = (self.point(b, place), place.parameters);
        let depth = self.surface.depth(&x);
        let mut depth_bar = 0.0;
        for law in &self.currents {
            let [factor, rate] = law.factor(place.time);
            let (share, slope, by) = law.share(depth, parameters);
            let full_bar = factor * water_bar.velocity + rate * water_bar.acceleration;
            bar.parameters.add_point(law.velocity, &(share * full_bar));
            let share_bar = parameters.point(law.velocity).dot(&full_bar);
            depth_bar += slope * share_bar;
            for (parameter, by) in by {
                bar.parameters[parameter] += by * share_bar;
            }
        }
        bar.pose[b] += point_wrench(&x, &(-depth_bar * self.surface.up));
    }

    fn point(&self, b: usize, place: &Place) -> Vec3 {
        place.poses[b].apply(&self.points[b])
    }
}

impl Law {
    /// g and its rate.
    fn factor(&self, t: f64) -> [f64; 2] {
        let motion = self.over_time.as_ref();
        motion.map_or([1.0, 0.0], |g| [g.value(t), g.rate(t)])
    }

    /// f, its slope, and its derivatives by parameters.
    fn share(&self, depth: f64, parameters: &Parameters) -> (f64, f64, Vec<(Parameter, f64)>) {
        match &self.share {
            None => (1.0, 0.0, Vec::new()),
            Some(curve) => {
                let at = curve.at(depth, parameters);
                (at.value, at.slope, at.by)
            }
        }
    }
}

/// A curve through points that is level before the first and after the last: there the first and the last stand a second time.
fn level_beyond(profile: &[[f64; 2]], shares: Vec<Parameter>) -> Option<Curve> {
    let (first, last) = (profile.first()?[0], profile.last()?[0]);
    let beyond = last - first;
    let mut arguments: Vec<f64> = vec![first - beyond];
    arguments.extend(profile.iter().map(|point| point[0]));
    arguments.push(last + beyond);
    let mut values = vec![*shares.first()?];
    values.extend(&shares);
    values.push(*shares.last()?);
    Some(Curve::Table { arguments, values })
}
