//! What a step meets on its way: how far surfaces are looked for, into how many pieces a fast step is cut, and whether anything was
//! passed through.
//!
//! The law of contact foresees a gap φ as φ + τ z, along straight lines and flat surfaces. That is exact for what closes slowly against
//! the sizes of the bodies. For what doesn't, the time of impact is found by conservative advancement: the bodies go on at their
//! velocity by the time that their gap takes to close at least, and again. A pair that would meet within a step so fast
//! that it came halfway through the thinner body asks for so many pieces that it doesn't, and has a law as stiff as that of a step of
//! a piece's length.

use super::Stepper;
use super::plan::{Plan, SEEN, Stops};
use super::stages::ContactVelocities;
use super::start::Start;
use crate::Result;
use crate::adjoint::contact::contact_force;
use crate::adjoint::lie::{Pose, Vec3, Vec6, point_velocity};
use crate::contact::ContactPair;
use crate::dynamics::{ContactModel, Evaluation, PairContact, System};
use crate::multibody::Kinematics;
use nalgebra::DVector;
use std::borrow::Cow;
use std::cell::OnceCell;

/// Room for a change of speed on the way.
const ROOM: f64 = 1.25;
/// Part of half the thickness at which surfaces count as met.
const MET: f64 = 0.05;
/// Part of half the thickness that a piece may go past where surfaces meet.
const DEEP: f64 = 0.5;
/// The same of what is nearly that deep already, by all pieces of a step.
const DEEPER: f64 = 0.1;
/// Part of the gap at which surfaces touch that a piece leaves, where there is water.
const LEFT: f64 = 0.1;
/// The angle by which a piece may turn what presses, rad: laws of contact know surfaces that go straight on.
const TURN: f64 = 0.3;
/// The same of what floats freely.
const FREE_TURN: f64 = 1.0;
/// Part by which turns of round bodies about their axes count there: a rim that friction stops turns the body another way.
const ROUND: f64 = 0.3;
/// Part of a joint's range that a piece may come nearer to its end by.
const SHARE: f64 = 0.25;
/// Part of the range that it may end past it.
const PAST: f64 = 0.05;
/// Most advancements along one way; a pair that takes more counts as met.
const ADVANCES: usize = 500;
/// Weight below which a place is about to be taken over by others.
const FULL: f64 = 0.5;

/// The way of the bodies from `q` at the velocity `v`.
struct Way<'s> {
    system: &'s System,
    q: &'s DVector<f64>,
    v: &'s DVector<f64>,
    /// [`Way::at`] its start, and its end after a given time, which most pairs ask for.
    start: OnceCell<(Vec<Pose>, Vec<Vec6>)>,
    end: OnceCell<(Vec<Pose>, Vec<Vec6>)>,
}

/// Where two surfaces meet on their way: the speed at which they close there along their normal, m/s.
struct Meeting {
    speed: f64,
}

impl<'s> Way<'s> {
    fn new(system: &'s System, q: &'s DVector<f64>, v: &'s DVector<f64>) -> Self {
        Self {
            system,
            q,
            v,
            start: OnceCell::new(),
            end: OnceCell::new(),
        }
    }

    /// Poses and spatial twists after the time `t`.
    fn at(&self, t: f64) -> (Vec<Pose>, Vec<Vec6>) {
        let tree = &self.system.tree;
        let there = tree.kinematics(&tree.integrate(self.q, &(t * self.v)));
        let twists = tree.twists(&there, self.v);
        (there.poses, twists)
    }

    /// Where the surfaces of pair `k` first come as near as `target` (m) within the time `horizon`, by conservative advancement.
    fn meeting(
        &self,
        model: &ContactModel,
        k: &ContactPair,
        horizon: f64,
        target: f64,
    ) -> Result<Option<Meeting>> {
        let shapes = &model.shapes;
        let near = target + MET * shapes.halfway(k);
        let mut time = 0.0;
        for _ in 0..ADVANCES {
            let there = match time == 0.0 {
                true => Cow::Borrowed(self.start.get_or_init(|| self.at(0.0))),
                false => Cow::Owned(self.at(time)),
            };
            let (poses, twists) = &*there;
            let closing = ROOM * shapes.closing(k, poses, twists);
            let reach = near + closing * (horizon - time);
            // Of speeds out of range nothing is foreseen: the stage refuses them.
            if !reach.is_finite() {
                return Ok(None);
            }
            let mut points = shapes.points_within(k, poses, reach)?;
            points.retain(|p| p.weight >= FULL);
            let gap = points.iter().map(|p| p.gap).fold(f64::INFINITY, f64::min);
            if gap == f64::INFINITY {
                return Ok(None);
            }
            if gap <= near {
                let met = points.iter().filter(|p| p.gap <= near);
                let speed = met.map(|p| {
                    let twist = relative(k, twists);
                    -p.normal.dot(&point_velocity(&twist, &p.position))
                });
                let speed = speed.fold(0.0, f64::max);
                return Ok(Some(Meeting { speed }));
            }
            // Nothing closes: it stays as it is.
            if closing <= 0.0 {
                return Ok(None);
            }
            time += (gap - target) / closing;
            if time >= horizon {
                return Ok(None);
            }
        }
        let (poses, twists) = self.at(time);
        let speed = shapes.closing(k, &poses, &twists);
        Ok(Some(Meeting { speed }))
    }
}

/// Whether next to nothing is left of the water between a pair after the time `t`; where there was as little before, but some still is, it is pressed there.
fn closed(way: &Way, model: &ContactModel, k: &ContactPair, t: f64) -> bool {
    let least = LEFT * model.laws.of(k).gap;
    let under = |poses: &[Pose], gap: f64| {
        let points = model.shapes.points_within(k, poses, gap);
        points.is_ok_and(|points| points.iter().any(|p| p.weight >= FULL))
    };
    let end = &way.end.get_or_init(|| way.at(t)).0;
    under(end, least)
        && (under(end, 0.0) || !under(&way.start.get_or_init(|| way.at(0.0)).0, least))
}

/// Whether a pair presses, of `points` that are seen, in bodies with these twists.
fn presses(points: &[PairContact], k: &ContactPair, twists: &[Vec6]) -> bool {
    let mut own = points.iter().filter(|c| c.pair == *k);
    own.any(|c| contact_force(&c.law, &c.point_state(twists)).force != Vec3::zeros())
}

/// Whether a pair gets too deep from these poses, with these twists, within the time `dt` of one of so many pieces: halfway, or where it nearly is already and is pressed there, by all pieces together, little
/// deeper.
fn deep(
    way: &Way,
    (poses, twists): (&[Pose], &[Vec6]),
    model: &ContactModel,
    k: &ContactPair,
    (dt, pieces): (f64, usize),
) -> bool {
    let shapes = &model.shapes;
    let halfway = shapes.halfway(k);
    let (most, share) = (DEEP * halfway, DEEPER * halfway / pieces as f64);
    let closing = shapes.closing(k, poses, twists) * dt;
    if closing <= share {
        return false;
    }
    let points = shapes.points_within(k, poses, share - most);
    let full = points.iter().flatten().filter(|p| p.weight >= FULL);
    let in_already = full.map(|p| p.gap).fold(0.0, f64::min);
    let end = match in_already < 0.0 {
        true => in_already - share - MET * halfway,
        false if closing <= most => return false,
        false => -most,
    };
    // Where no distance is found bodies are deep in one another.
    !matches!(way.meeting(model, k, dt, end), Ok(None))
}

fn relative(pair: &ContactPair, twists: &[Vec6]) -> Vec6 {
    let second = pair.second_body();
    twists[pair.first] - second.map_or(Vec6::zeros(), |b| twists[b])
}

/// The pairs that may meet within the time `dt` of bodies at these poses that move with these twists, those that are near beforehand, and some others.
fn met_within(model: &ContactModel, poses: &[Pose], twists: &[Vec6], dt: f64) -> Vec<ContactPair> {
    let shapes = &model.shapes;
    model.near(poses, |b| {
        let way = ROOM * dt * shapes.share_closing(b, &poses[b], &twists[b]);
        way + shapes.share_ahead(b) + MET * shapes.share_halfway(b)
    })
}

/// A number of pieces in which each does `share` at most of what a step does.
fn pieces(share: f64) -> usize {
    // One of what isn't a number: that is said elsewhere.
    share.ceil().max(1.0).min(SEEN as f64) as usize
}

impl Stepper<'_> {
    /// How the step from `e` at the velocity `v` is cut, as far as contact and limits know beforehand.
    pub(super) fn foreseen(&self, e: &Evaluation, v: &DVector<f64>) -> Result<Plan> {
        let mut plan = Plan::whole();
        let (system, dt) = (self.system, self.dt);
        if let Some(model) = &system.contact {
            let way = Way::new(system, &e.q, v);
            let twists = system.tree.twists(&e.kinematics, v);
            for k in &met_within(model, &e.kinematics.poses, &twists, dt) {
                let (shapes, law) = (&model.shapes, model.laws.of(k));
                let halfway = shapes.halfway(k);
                if shapes.closing(k, &e.kinematics.poses, &twists) * dt <= halfway {
                    continue;
                }
                let met = way.meeting(model, k, dt, law.gap + law.width)?;
                let wanted = met.map_or(1, |m| pieces(m.speed * dt / halfway));
                plan.pieces = plan.pieces.max(wanted);
                if wanted > 1 && model.rigid {
                    plan.sharp.pairs.push(*k);
                }
            }
            // A blow on a thin body's side may have it spin so fast that its own motion isn't resolved, which gives and takes energy.
            for (b, link) in system.tree.links().iter().enumerate() {
                if link.q.len() > link.v.len() {
                    let pose = &e.kinematics.poses[b];
                    let turn = model.shapes.share_turning(b, pose, &twists[b]) * dt;
                    plan.pieces = plan.pieces.max(pieces(turn / FREE_TURN));
                }
            }
        }
        for (k, limit) in e.limits.iter().enumerate() {
            let (q, v) = (e.q[limit.q], v[limit.v]);
            let wanted = pieces(dt * v.abs() / (SHARE * limit.room()));
            if wanted > 1 && limit.past(q + dt * v) > 0.0 {
                plan.pieces = plan.pieces.max(wanted);
                if limit.rigid {
                    plan.sharp.limits.push(k);
                }
            }
        }
        Ok(plan)
    }

    /// Places where surfaces are near, as a piece of a step sees them that starts at `q` with the velocity `v`; none where it sees what
    /// every step does. What closes fast, and will meet, is seen from as far as it comes within its law's horizon.
    pub(super) fn seen(
        &self,
        kinematics: &Kinematics,
        q: &DVector<f64>,
        v: &DVector<f64>,
        plan: &Plan,
    ) -> Result<Option<Vec<PairContact>>> {
        let system = self.system;
        let Some(model) = &system.contact else {
            return Ok(None);
        };
        let twists = system.tree.twists(kinematics, v);
        let poses = &kinematics.poses;
        let horizon = model.laws.common.horizon;
        // Bodies that don't come farther than one always looks are seen as ever.
        let near = met_within(model, poses, &twists, horizon);
        let way = Way::new(system, q, v);
        let mut travels = Vec::with_capacity(near.len());
        for k in &near {
            let law = model.laws.of(k);
            let horizon = law.horizon / plan.of_pair(k) as f64;
            let closing = model.shapes.closing(k, poses, &twists);
            let travel = ROOM * closing * horizon;
            let far = closing * horizon > model.shapes.ahead(k)
                && (way.meeting(model, k, horizon, law.gap + law.width)?).is_some();
            travels.push(if far { travel } else { 0.0 });
        }
        let sharp = plan.pieces > 1 && !plan.sharp.pairs.is_empty();
        if !sharp && travels.iter().all(|travel| *travel == 0.0) {
            return Ok(None);
        }
        let mut out = Vec::new();
        for (k, travel) in near.iter().zip(travels) {
            let n = plan.of_pair(k);
            out.extend(system.pair_points(self.parameters, poses, k, n, travel)?);
        }
        Ok(Some(out))
    }

    /// `e` with the contacts and limits that a piece of a step sees; none where they are those of `e`.
    pub(super) fn near<'e>(
        &self,
        e: &Evaluation<'e>,
        v: &DVector<f64>,
        plan: &Plan,
    ) -> Result<Option<Evaluation<'e>>> {
        let points = self.seen(&e.kinematics, &e.q, v, plan)?;
        let sharp = plan.pieces > 1 && !plan.sharp.limits.is_empty();
        if points.is_none() && !sharp {
            return Ok(None);
        }
        let mut out = e.clone();
        if let Some(points) = points {
            out.contact_points = points;
        }
        for (k, limit) in out.limits.iter_mut().enumerate() {
            *limit = limit.sharpened(plan.of_limit(k));
        }
        Ok(Some(out))
    }

    /// What is passed by the step that starts so and moves by `velocities`: surfaces that get so deep that they might come out on the other side, or so near that there
    /// is no water left between them, what presses and turns too far, and joints that get past their limit by a part of their range. Where the stiffness was given, what
    /// presses sinks in as it was asked for; what comes by unseen is met.
    pub(super) fn passed(&self, start: &Start, velocities: &ContactVelocities) -> Stops {
        let mut out = Stops::default();
        let (system, dt) = (self.system, self.dt);
        let (e, v) = (start.e, &velocities.after);
        if let Some(model) = &system.contact {
            let pressed = |k: &ContactPair| e.contact_points.iter().any(|c| c.pair == *k);
            let wet = model.rigid && model.wet;
            let way = Way::new(system, &e.q, v);
            let poses = &e.kinematics.poses;
            let twists = system.tree.twists(&e.kinematics, v);
            let acting = || system.tree.twists(&e.kinematics, velocities.acting());
            let mut near = met_within(model, poses, &twists, dt);
            if wet {
                let end = &way.end.get_or_init(|| way.at(dt)).0;
                near.extend(model.near(end, |_| 0.0));
                near.sort_unstable();
                near.dedup();
            }
            for k in &near {
                if model.shapes.turning(k, poses, &twists, ROUND) * dt > TURN
                    && presses(&start.near.contact_points, k, &acting())
                {
                    out.turned.push(*k);
                }
                if !model.rigid && pressed(k) {
                    continue;
                }
                let dry = wet && closed(&way, model, k, dt);
                if dry || deep(&way, (poses, &twists), model, k, (dt, start.plan.pieces)) {
                    out.pairs.push(*k);
                }
            }
        }
        for (k, limit) in e.limits.iter().enumerate() {
            let [before, after] = [0.0, dt].map(|t| limit.past(e.q[limit.q] + t * v[limit.v]));
            if limit.rigid && after > PAST * limit.room() && after > before {
                out.limits.push(k);
            }
        }
        out
    }
}
