//! What tells that a run isn't to be trusted: drag or springs too stiff for an integrator's step, and energy that comes from nowhere.
//!
//! Energy may come from controls, which have done at most Σ Δt Σ |uᵢ| |rᵢ| by a state, rᵢ being the faster of a control's rates at both ends of a step (of servos, rotors, tendons and
//! thrusters the force is the larger of both ends, too); from a motion
//! that drives a joint or a current past what doesn't drift, whose work isn't known, but is of the order of the kinetic energy of all bodies at the speeds that these give
//! them. So a run without the latter is told from a small part of its energy on, one with them where it runs away.

use super::{Rollout, Sample, Simulator};
use crate::adjoint::lie::{Vec3, Vec6, angular, point_velocity};
use crate::adjoint::rigid::inertia_matrix;
use crate::dynamics::force::ForceModel;
use crate::dynamics::{ContactForce, Drive, Integrator, System};
use crate::error::readable;
use crate::multibody::Link;
use nalgebra::DVector;

/// Share of the largest kinetic energy that may come from nowhere before a run warns. Every integrator but the paper's
/// stays under 1.2 % on the example scenes.
pub(super) const GAIN: f64 = 0.02;
/// States in which what is pressed together at the start comes apart.
const SOON: usize = 20;
/// The angle that a free body may turn by in a step, rad, before that is named as what the step is too long for.
const RESOLVED: f64 = 1.0;
/// How many times the energy of all bodies at the speeds of motions and currents counts as running away.
const RUNAWAY: f64 = 1e4;

impl Simulator {
    /// What the user should know before a run of drag and of springs at the start, where the integrator takes them explicitly.
    pub fn start_stiffness_warning(&self) -> Option<String> {
        let (q, v) = (&self.assembled.q, &self.assembled.v);
        let control = DVector::zeros(self.system().controls);
        self.stiffness(0.0, q, v, &control)
    }

    /// The same of one state.
    fn stiffness(
        &self,
        time: f64,
        q: &DVector<f64>,
        v: &DVector<f64>,
        control: &DVector<f64>,
    ) -> Option<String> {
        (self.stiff_damping(time, q, v, control)).or_else(|| self.stiff_spring(time, q, control))
    }

    fn stiff_damping(
        &self,
        time: f64,
        q: &DVector<f64>,
        v: &DVector<f64>,
        control: &DVector<f64>,
    ) -> Option<String> {
        let stepper = self.stepper();
        let (limit, dt) = (stepper.integrator.damping_limit()?, self.time_step());
        let system = self.system();
        let step = (stepper.integrator, dt);
        let found = system.damping(self.parameters(), q, v, control, time, step);
        // What fails here fails in the run, with its error.
        let damping = found.ok().flatten()?;
        let name = &system.bodies[damping.body].name;
        Some(format!(
            "drag, damping or a servo slows body {name:?} at the rate {:.3e} 1/s at t = {} s: {:.3} times in the time step of {dt} s, where the integrator {:?}, which takes it \
             explicitly, is stable up to {limit} times: the run, or its gradient, may grow without bound; take a time step under {:.2e} s, or the integrator midpoint",
            damping.rate,
            readable(time),
            damping.rate * dt,
            stepper.integrator,
            limit / damping.rate
        ))
    }

    fn stiff_spring(&self, time: f64, q: &DVector<f64>, control: &DVector<f64>) -> Option<String> {
        let (integrator, dt) = (self.stepper().integrator, self.time_step());
        let limit = integrator.swing_limit()?;
        let implicit = integrator.damping_limit().is_none().then_some(dt);
        let (system, parameters) = (self.system(), self.parameters());
        let found = system.swinging(parameters, q, control, time, implicit, limit / dt);
        let swing = found.ok().flatten()?;
        let name = &system.bodies[swing.body].name;
        Some(format!(
            "springs, or other forces of the place, swing body {name:?} by {:.3e} rad/s at t = {} s, {:.3} rad in the time step of {dt} s, where the integrator {integrator:?}, which takes them where a \
             step starts, is stable up to {limit:.3}: the run, or its gradient, may grow without bound; take a time step under {:.2e} s, softer springs, or the integrator midpoint",
            swing.rate,
            readable(time),
            swing.rate * dt,
            limit / swing.rate
        ))
    }
}

impl Rollout {
    /// Drag or springs too stiff for a step at the start, or where all is fastest.
    pub(super) fn stiffness_warning(&self) -> Option<String> {
        let samples = self.samples();
        let fastest = (samples.iter()).max_by(|a, b| a.kinetic_energy.total_cmp(&b.kinetic_energy));
        let none = DVector::zeros(self.simulator.system().controls);
        [samples.first(), fastest]
            .into_iter()
            .flatten()
            .find_map(|s| {
                let control = match s.control.is_empty() {
                    true => &none,
                    false => &s.control,
                };
                self.simulator.stiffness(s.time, &s.q, &s.v, control)
            })
    }

    /// Energy that comes from nowhere: the step is too long.
    pub(super) fn energy_warning(&self) -> Option<String> {
        let system = self.simulator.system();
        let samples = self.samples();
        let first = samples[0].energy();
        let kinetic = samples.iter().map(|s| s.kinetic_energy).fold(0.0, f64::max);
        let worked = self.worked();
        let given = system.drives.iter().any(|d| matches!(d, Drive::Motion(_)));
        if given || system.has_current() || !system.streams.is_empty() {
            return self.runaway(&worked);
        }
        let beyond = |(s, worked): (&Sample, &f64)| s.energy() - first - worked;
        let each = samples.iter().zip(&worked);
        let worst = each.max_by(|a, b| beyond(*a).total_cmp(&beyond(*b)))?;
        let gained = beyond(worst);
        if gained <= GAIN * kinetic.max(f64::MIN_POSITIVE) {
            return None;
        }
        let work = match *worst.1 > 0.0 {
            true => format!(
                "more than the {:.3e} J that controls can have done",
                worst.1
            ),
            false => "though nothing does work".into(),
        };
        // What presses from the start may give what was spent on pressing it together, which it does soon.
        let soon = (samples.iter().position(|s| s.time >= worst.0.time)).is_some_and(|n| n <= SOON);
        // Of what is seen from farther because it closes fast nothing is pressed yet.
        let touches = |c: &ContactForce| {
            let both = std::iter::once(c.first).chain(c.second);
            let widest = |b| (system.contact.as_ref()).map_or(0.0, |m| m.laws.widest(b));
            c.gap < both.map(widest).fold(0.0, f64::max)
        };
        let found = self.contacts(0, 0.0);
        let pressed = soon && found.is_ok_and(|found| found.iter().any(touches));
        let cause = match pressed {
            true => {
                "surfaces start pressed together, nearer than the gap of contact: start them apart"
                    .into()
            }
            false => format!(
                "the time step of {} s is too long for these velocities, this drag or these springs; {}",
                self.simulator.time_step(),
                self.finer()
            ),
        };
        Some(format!(
            "the energy grows by {:.3e} J by t = {} s, {work}, by {:.1} % of the largest kinetic energy: {cause}",
            worst.0.energy() - first,
            worst.0.time,
            100.0 * gained / kinetic,
        ))
    }

    /// What may be taken instead of a step that is too long, as a message ends.
    pub(super) fn finer(&self) -> String {
        let (turn, body) = self.largest_turn();
        if turn > RESOLVED {
            let name = &self.simulator.system().bodies[body].name;
            return format!(
                "take a smaller one: body {name:?} turns by up to {} rad in a step",
                readable((turn * 10.0).round() / 10.0)
            );
        }
        match self.simulator.choices.integrator {
            Integrator::Midpoint => "take a smaller one".into(),
            _ => "take a smaller one, or the integrator midpoint".into(),
        }
    }

    /// The largest angle by which a body turns in a step, rad, of those that may do so about any axis, and which.
    fn largest_turn(&self) -> (f64, usize) {
        let tree = &self.simulator.system().tree;
        // Those whose coordinates hold a quaternion.
        let about_any = |l: &Link| l.q.len() > l.v.len();
        let free: Vec<usize> = (0..tree.links().len())
            .filter(|b| about_any(&tree.links()[*b]))
            .collect();
        let turns = self.samples().iter().flat_map(|s| {
            let twists = tree.twists(&tree.kinematics(&s.q), &s.v);
            let of = |b: &usize| (angular(&twists[*b]).norm() * self.simulator.time_step(), *b);
            free.iter().map(of).collect::<Vec<_>>()
        });
        turns.fold((0.0, 0), |a, x| if x.0 > a.0 { x } else { a })
    }

    /// The most that controls can have done by each state, J.
    fn worked(&self) -> Vec<f64> {
        let (system, dt) = (self.simulator.system(), self.simulator.time_step());
        let samples = self.samples();
        if system.controls == 0 {
            return vec![0.0; samples.len()];
        }
        let tree = &system.tree;
        let twists: Vec<Vec<Vec6>> = (samples.iter())
            .map(|s| tree.twists(&tree.kinematics(&s.q), &s.v))
            .collect();
        let moves: Vec<(&Sample, &[Vec6])> = (samples.iter())
            .zip(twists.iter().map(|each| each.as_slice()))
            .collect();
        let rates: Vec<DVector<f64>> = (moves.iter())
            .map(|(s, twists)| control_rates(system, s, twists))
            .collect();
        let mut out = vec![0.0];
        let mut so_far = 0.0;
        for (n, s) in samples.iter().enumerate().take(samples.len() - 1) {
            for (i, u) in s.control.iter().enumerate() {
                so_far += dt * u.abs() * rates[n][i].abs().max(rates[n + 1][i].abs());
            }
            so_far += dt * self.driven_power([moves[n], moves[n + 1]]);
            out.push(so_far);
        }
        out
    }

    /// The most power that the first state's controls can have put in by the second, each with its bodies' twists, other than as forces of their own, W. A servo's force is largest where it starts from
    /// rest, with no power yet, and next to nothing where its joint is fast.
    fn driven_power(&self, step: [(&Sample, &[Vec6]); 2]) -> f64 {
        let (system, parameters) = (self.simulator.system(), self.simulator.parameters());
        let control = &step[0].0.control;
        let [start, end] =
            step.map(|(s, twists)| system.moving(s.place(parameters), twists, &s.v, control));
        let pairs = [
            (&start, &start),
            (&start, &end),
            (&end, &start),
            (&end, &end),
        ];
        let most = |f: &dyn ForceModel| {
            let each = pairs.map(|(at, moving)| f.driven_power(at, moving));
            each.into_iter().fold(0.0, f64::max)
        };
        system.forces.iter().map(|f| most(f.as_ref())).sum()
    }

    /// Kinetic energy far beyond what motions and the current could give.
    fn runaway(&self, worked: &[f64]) -> Option<String> {
        let samples = self.samples();
        let potential = samples.iter().map(|s| s.potential_energy);
        let fall = potential.clone().fold(f64::NEG_INFINITY, f64::max)
            - potential.fold(f64::INFINITY, f64::min);
        let given = samples.iter().map(|s| self.given(s)).fold(0.0, f64::max);
        let first = samples[0].kinetic_energy;
        let reach = |worked: f64| RUNAWAY * given + worked + first + fall;
        let mut each = samples.iter().zip(worked);
        let (s, worked) = each.find(|(s, worked)| s.kinetic_energy > reach(**worked))?;
        Some(format!(
            "the kinetic energy is {:.3e} J at t = {} s, far beyond the {:.3e} J that motions, current and controls account for: the time step of {} s is too long for these \
             velocities, this drag or these springs; take a smaller one, or the integrator midpoint",
            s.kinetic_energy,
            s.time,
            given + worked,
            self.simulator.time_step()
        ))
    }

    /// Kinetic energy of all bodies, and as much water as they displace, at the speeds that motions and the current give them, J.
    fn given(&self, s: &Sample) -> f64 {
        let (system, parameters) = (self.simulator.system(), self.simulator.parameters());
        let tree = &system.tree;
        let mut driven = DVector::zeros(s.v.len());
        for (drive, link) in system.drives.iter().zip(tree.links()) {
            if matches!(drive, Drive::Motion(_)) {
                for i in link.v.clone() {
                    driven[i] = s.v[i];
                }
            }
        }
        let twists = tree.twists(&tree.kinematics(&s.q), &driven);
        let of = |(b, twist): (usize, &Vec6)| {
            let (body, pose) = (&system.bodies[b], &s.poses[b]);
            let (mass, displaced) = (parameters.mass(b), parameters.density() * body.volume);
            let square = |x: &Vec3| point_velocity(twist, &pose.apply(x)).norm_squared();
            // The body's own is known to the last digit: a dry one far off its axis has no other.
            let turning = pose.rotation.tr_mul(&angular(twist));
            let turned = inertia_matrix(&parameters.inertia(b)) * turning;
            let own = mass * square(&parameters.center_of_mass(b)) + turning.dot(&turned);
            let around = body.volume.cbrt().powi(2) * turning.norm_squared();
            let moved = displaced * (square(&parameters.center_of_buoyancy(b)) + around);
            let water = system.water_velocity(&pose.translation, s.time, parameters);
            0.5 * (own + moved + (mass + displaced) * water.norm_squared())
        };
        twists.iter().enumerate().map(of).sum()
    }
}

/// The rate that each control that is a force does work against.
fn control_rates(system: &System, s: &Sample, twists: &[Vec6]) -> DVector<f64> {
    let mut out = DVector::zeros(system.controls);
    for ((body, link), (twist, pose)) in
        (system.bodies.iter().zip(system.tree.links())).zip(twists.iter().zip(&s.poses))
    {
        if let Some(first) = body.joint_control {
            for (k, i) in link.v.clone().enumerate() {
                out[first + k] = s.v[i];
            }
        }
        if let Some(first) = body.thruster {
            let velocity = point_velocity(twist, &pose.translation);
            for k in 0..3 {
                out[first + k] = velocity[k];
                out[first + 3 + k] = angular(twist)[k];
            }
        }
    }
    for target in system.forces.iter().flat_map(|f| f.targets()) {
        out[target] = 0.0;
    }
    out
}
