//! The adjoint of a whole rollout against central differences along random directions.

use super::{Controls, Cotangents, Rollout, Sample, Simulator};
use crate::adjoint::lie::Vec3;
use crate::adjoint::sample::Samples;
use crate::dynamics::Range;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use std::time::Instant;

/// What to check.
#[derive(Clone, Copy, Debug)]
pub struct GradcheckSettings {
    /// Steps of the rollout.
    pub steps: usize,
    /// Random directions per group.
    pub directions: usize,
    /// Seed of the directions.
    pub seed: u64,
    /// Timed repetitions of forward and gradient after a warm-up; 0 for no timing.
    pub timings: usize,
    /// An error of a direction under which no more step sizes are tried: it has passed. None: all are.
    pub enough: Option<f64>,
}

/// Error of one direction at each step size.
#[derive(Clone, Debug, Serialize)]
pub struct Direction {
    /// `controls`, `initial`, `parameters` or `gains`.
    pub group: &'static str,
    /// Derivative by the adjoint.
    pub adjoint: f64,
    /// Central differences at each of [`GradcheckReport::step_sizes`]; NaN where one before was good [enough](GradcheckSettings::enough), and at the
    /// two shortest unless the error still falls towards them.
    pub differences: Vec<f64>,
    /// Relative error at each step size.
    pub rel_errors: Vec<f64>,
}

/// Outcome of a check.
#[derive(Clone, Debug, Serialize)]
pub struct GradcheckReport {
    /// Step sizes, relative to the scale of each direction.
    pub step_sizes: Vec<f64>,
    /// Every direction.
    pub directions: Vec<Direction>,
    /// Largest over the directions of the smallest error over the step sizes.
    pub max_rel_error: f64,
    /// The same for the controls; none where there is no control.
    pub rel_error_controls: Option<f64>,
    /// The same for the initial state.
    pub rel_error_initial: Option<f64>,
    /// The same for physical parameters and gains.
    pub rel_error_parameters: Option<f64>,
    /// Median time of a rollout, s.
    pub forward_seconds: f64,
    /// Median time of a rollout and its gradient, s.
    pub gradient_seconds: f64,
    /// Their ratio.
    pub ratio: f64,
}

/// What a gradient costs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Times {
    /// Median time of a rollout, s.
    pub forward: f64,
    /// Median time of a rollout and its gradient, s.
    pub gradient: f64,
}

impl Times {
    /// Gradient, its forward pass included, over forward alone; 0 where nothing was timed.
    pub fn ratio(&self) -> f64 {
        if self.forward > 0.0 {
            self.gradient / self.forward
        } else {
            0.0
        }
    }
}

/// Differences smaller than this against the group's largest derivative say nothing of the adjoint: they are rounding.
const NEGLIGIBLE: f64 = 1e-9;
/// Rounding of a derivative against the sum of the absolute values that its functional adds up: where nothing in a group
/// matters, adjoint and differences are both under it.
const ROUNDING: f64 = 1e-11;

/// Sizes that make the check independent of units.
struct Scales {
    length: f64,
    velocity: DVector<f64>,
    displacement: DVector<f64>,
    force: Vec<f64>,
    /// The controls that are checked about.
    about: DVector<f64>,
}

impl Scales {
    /// The controls that are checked about, at every step.
    fn controls(&self, simulator: &Simulator, steps: usize) -> Result<Controls> {
        let columns = DMatrix::from_fn(self.about.len(), steps, |i, _| self.about[i]);
        Controls::from_matrix(simulator, columns)
    }
}

/// A random functional of the trajectory: markers on the bodies and velocities, at the middle and the end.
struct Probe([Reading; 2]);

/// What is read at one state: a marker on each body along a direction, and velocities.
struct Reading {
    state: usize,
    arms: Vec<Vec3>,
    directions: Vec<Vec3>,
    velocity: DVector<f64>,
}

impl Probe {
    fn new(
        simulator: &Simulator,
        scale: &Scales,
        steps: usize,
        mut vector: impl FnMut(usize) -> DVector<f64>,
    ) -> Self {
        let bodies = simulator.system().len();
        let velocities = simulator.system().tree.velocities();
        let points = |v: &DVector<f64>, f: f64| -> Vec<Vec3> {
            (0..bodies)
                .map(|b| f * Vec3::from(v.fixed_rows::<3>(3 * b)))
                .collect()
        };
        Self([steps / 2, steps].map(|state| Reading {
            state,
            arms: points(&vector(3 * bodies), scale.length),
            directions: points(&vector(3 * bodies), 1.0 / scale.length),
            velocity: vector(velocities).component_div(&scale.velocity),
        }))
    }

    fn value(&self, rollout: &Rollout) -> f64 {
        self.total(rollout.samples(), |x| x)
    }

    /// Sum of the terms, each with its factors as `of` makes them.
    fn total(&self, samples: &[Sample], of: fn(f64) -> f64) -> f64 {
        let mut out = 0.0;
        for r in &self.0 {
            let s = &samples[r.state];
            for (b, pose) in s.poses.iter().enumerate() {
                out += r.directions[b].map(of).dot(&pose.apply(&r.arms[b]).map(of));
            }
            out += r.velocity.map(of).dot(&s.v.map(of));
        }
        out
    }

    fn cotangents(&self, rollout: &Rollout) -> Cotangents {
        let mut out = rollout.zero_cotangents();
        for r in &self.0 {
            for (b, pose) in rollout.samples()[r.state].poses.iter().enumerate() {
                let turn = (pose.rotation * r.arms[b]).cross(&r.directions[b]);
                for k in 0..3 {
                    out.positions[(3 * b + k, r.state)] += r.directions[b][k];
                    out.rotations[(3 * b + k, r.state)] += turn[k];
                }
            }
            let mut column = out.v.column_mut(r.state);
            column += &r.velocity;
        }
        out
    }
}

/// A displacement of each joint coordinate that is as large as the largest body, or a radian; and that length, m.
pub(super) fn unit_displacements(simulator: &Simulator) -> (DVector<f64>, f64) {
    let system = simulator.system();
    let volume = system.bodies.iter().map(|b| b.volume).fold(0.0, f64::max);
    let length = if volume > 0.0 { volume.cbrt() } else { 1.0 };
    let mut displacement = DVector::from_element(system.tree.velocities(), length);
    for link in system.tree.links() {
        for (k, basis) in link.v.clone().zip(link.joint.basis()) {
            if basis.fixed_rows::<3>(3).norm() > 0.0 {
                displacement[k] = 1.0;
            }
        }
    }
    (displacement, length)
}

fn scales(simulator: &Simulator, rollout: &Rollout, steps: usize) -> Result<Scales> {
    let system = simulator.system();
    let duration = simulator.time_step() * steps as f64;
    let (displacement, length) = unit_displacements(simulator);
    let stepper = simulator.stepper();
    let e = stepper.evaluate(simulator.start().0, 0.0)?;
    let mut velocity = &displacement / duration.max(1.0);
    for s in rollout.samples() {
        velocity = velocity.sup(&s.v.abs());
    }
    let mut force = Vec::new();
    let bodies = system.bodies.iter().zip(&simulator.scene.bodies);
    for ((body, given), link) in bodies.zip(system.tree.links()) {
        if given.servo.is_some() {
            force.push(0.1 * displacement[link.v.start]);
        } else if body.joint_control.is_some() {
            for i in link.v.clone() {
                force.push(e.mass_matrix()[(i, i)] * velocity[i] / duration);
            }
        }
        if body.thruster.is_some() {
            let mass = link
                .v
                .clone()
                .map(|i| e.mass_matrix()[(i, i)])
                .fold(0.0, f64::max);
            force.extend([mass * length / duration; 6]);
        }
    }
    // Commands that give forces of that size; about one half of them, since a curve may be as |u| u is at zero, without a second derivative.
    let mut about = DVector::zeros(system.controls);
    let forces = system.forces.iter();
    for c in forces.flat_map(|f| f.commanded(simulator.parameters())) {
        let mass = simulator.parameters().mass(c.body);
        let share = mass * length / duration / c.thrust.abs();
        force.push(c.command * if share < 1.0 { share } else { 1.0 });
        about[c.control] = 0.5 * force[c.control];
    }
    Ok(Scales {
        length,
        velocity,
        displacement,
        force,
        about,
    })
}

/// Wall times of a rollout and of a rollout with its gradient: medians of `repetitions` after a
/// warm-up.
///
/// # Errors
/// A rollout that fails, or no repetitions.
pub fn timings(simulator: &Simulator, steps: usize, repetitions: usize) -> Result<Times> {
    if repetitions == 0 || steps == 0 {
        return Err(Error::input(
            "timings: steps and repetitions",
            format!("{steps} and {repetitions}"),
            "must both be at least 1",
        ));
    }
    let mut random = Samples::new(1);
    let vector = |n: usize| DVector::from_fn(n, |_, _| random.number());
    let zero = Controls::zeros(simulator, steps);
    let scale = scales(simulator, &simulator.rollout(&zero)?, steps)?;
    let zero = scale.controls(simulator, steps)?;
    let probe = Probe::new(simulator, &scale, steps, vector);
    time(simulator, &zero, &probe, repetitions)
}

/// Runs the check. The simulator's solver tolerance decides how small an error can be seen: use 1e-12.
///
/// # Errors
/// A rollout that fails.
pub fn gradcheck(
    simulator: &mut Simulator,
    settings: &GradcheckSettings,
) -> Result<GradcheckReport> {
    gradcheck_with(simulator, settings, |_, _| {})
}

/// As [`gradcheck`]; `progress` is called with the number of directions done and that of all.
///
/// # Errors
/// A rollout that fails.
pub fn gradcheck_with(
    simulator: &mut Simulator,
    settings: &GradcheckSettings,
    mut progress: impl FnMut(usize, usize),
) -> Result<GradcheckReport> {
    if settings.steps == 0 || settings.directions == 0 {
        return Err(Error::input(
            "gradcheck: steps and directions",
            format!("{} and {}", settings.steps, settings.directions),
            "must both be at least 1",
        ));
    }
    let steps = settings.steps;
    let zero = Controls::zeros(simulator, steps);
    let scale = scales(simulator, &simulator.rollout(&zero)?, steps)?;
    let about = scale.controls(simulator, steps)?;
    let rollout = simulator.rollout(&about)?;
    let mut random = Samples::new(settings.seed);
    let mut vector = |n: usize| DVector::from_fn(n, |_, _| random.number());
    let nv = simulator.system().tree.velocities();
    let probe = Probe::new(simulator, &scale, steps, &mut vector);
    let gradient = rollout.vjp(&probe.cotangents(&rollout))?;
    let size = probe.total(rollout.samples(), f64::abs);
    let split = simulator.stepper().split_at(&rollout.states()[0]);
    drop(rollout);

    let step_sizes = vec![1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7];
    let enough = settings.enough;
    let (q0, v0) = (simulator.start().0.clone(), simulator.start().1.clone());
    let parameters = simulator.parameters().clone();
    let gains = simulator.policy().gains();
    let groups = [
        simulator.system().controls > 0,
        nv > 0,
        true,
        gains.iter().any(|g| *g != 0.0),
    ];
    let all = settings.directions * groups.iter().filter(|g| **g).count();
    let mut directions = Vec::new();
    let mut add = |group, adjoint, value: &mut dyn FnMut(f64) -> Result<f64>| -> Result<()> {
        directions.push(measure(group, adjoint, &step_sizes, enough, value)?);
        progress(directions.len(), all);
        Ok(())
    };
    let value = |simulator: &Simulator| Ok(probe.value(&simulator.rollout(&about)?));
    for _ in 0..settings.directions {
        let controls = simulator.system().controls;
        if controls > 0 {
            let random = vector(controls * steps);
            let mut d = DMatrix::from_column_slice(controls, steps, random.as_slice());
            for (mut row, f) in d.row_iter_mut().zip(&scale.force) {
                row *= *f;
            }
            add("controls", gradient.controls.dot(&d), &mut |h| {
                let c = Controls::from_matrix(simulator, about.matrix() + h * &d)?;
                Ok(probe.value(&simulator.rollout(&c)?))
            })?;
        }
        let (mut dq, mut dv) = (
            vector(nv).component_mul(&scale.displacement) * 0.1,
            vector(nv).component_mul(&scale.velocity) * 0.3,
        );
        split.forget_moved(&mut dq);
        split.forget_driven(&mut dv);
        let adjoint = gradient.initial.q.dot(&dq) + gradient.initial.v.dot(&dv);
        if nv > 0 {
            add("initial", adjoint, &mut |h| {
                let q = simulator.system().tree.integrate(&q0, &(h * &dq));
                simulator.set_start(q, &v0 + h * &dv)?;
                let value = value(simulator)?;
                simulator.set_start(q0.clone(), v0.clone())?;
                Ok(value)
            })?;
        }
        // A part of each value, or a size of its own where the value is zero.
        let sizes = DVector::from_vec(parameters.sizes(scale.velocity.max(), scale.length));
        let mut d = (0.3 * &sizes).component_mul(&vector(sizes.len()));
        // Shapes change with the scene, not with the parameters of one.
        for (x, entry) in d.iter_mut().zip(parameters.table()) {
            if matches!(entry.declared.range, Range::Built(_)) {
                *x = 0.0;
            }
        }
        let base = DVector::from_vec(parameters.to_vec());
        let adjoint = dot(&gradient.parameters.to_vec(), d.as_slice());
        add("parameters", adjoint, &mut |h| {
            if let Some(p) = parameters.with_values((&base + h * &d).as_slice()) {
                simulator.replace_parameters(p);
            }
            let value = value(simulator);
            simulator.replace_parameters(parameters.clone());
            value
        })?;
        if gains.iter().any(|g| *g != 0.0) {
            let gains = DVector::from_column_slice(&gains);
            let d = vector(gains.len()).component_mul(&gains);
            let adjoint = dot(&gradient.gains, d.as_slice());
            add("gains", adjoint, &mut |h| {
                let moved = simulator
                    .policy()
                    .with_gains((&gains + h * &d).as_slice())?;
                simulator.set_policy(moved);
                let value = value(simulator);
                let policy = simulator.policy().with_gains(gains.as_slice())?;
                simulator.set_policy(policy);
                value
            })?;
        }
    }
    let times = match settings.timings {
        0 => Times::default(),
        n => time(simulator, &about, &probe, n)?,
    };
    let worst = |names: &[&str]| {
        let group: Vec<&Direction> = directions
            .iter()
            .filter(|d| names.contains(&d.group))
            .collect();
        let largest = group.iter().map(|d| d.adjoint.abs()).fold(0.0, f64::max);
        let limit = (NEGLIGIBLE * largest).max(ROUNDING * size);
        let errors = group.iter().map(|d| {
            let smallest = (d.differences.iter()).fold(f64::INFINITY, |m, x| m.min(x.abs()));
            // What isn't a number is not under it.
            if d.adjoint.abs() <= limit && smallest <= limit {
                0.0
            } else {
                d.rel_errors.iter().copied().fold(f64::INFINITY, f64::min)
            }
        });
        errors.reduce(f64::max)
    };
    Ok(GradcheckReport {
        max_rel_error: worst(&["controls", "initial", "parameters", "gains"]).unwrap_or(0.0),
        rel_error_controls: worst(&["controls"]),
        rel_error_initial: worst(&["initial"]),
        rel_error_parameters: worst(&["parameters", "gains"]),
        forward_seconds: times.forward,
        gradient_seconds: times.gradient,
        ratio: times.ratio(),
        step_sizes,
        directions,
    })
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Number of the shortest step that all directions take.
const USUAL: usize = 3;

fn measure(
    group: &'static str,
    adjoint: f64,
    step_sizes: &[f64],
    enough: Option<f64>,
    value: &mut dyn FnMut(f64) -> Result<f64>,
) -> Result<Direction> {
    let error = |d: f64| {
        let size = d.abs().max(adjoint.abs());
        if size == 0.0 {
            0.0
        } else {
            (d - adjoint).abs() / size
        }
    };
    let mut differences = vec![f64::NAN; step_sizes.len()];
    let mut rel_errors = differences.clone();
    // From the middle on: the best ones are seldom at an end.
    for i in [1, 2, 0, 3, 4, 5] {
        let h = step_sizes[i];
        // Shorter ones serve where a kink is at the start, as of a drag of |v| v at rest: there differences are off by h itself.
        let falls = |i: usize| rel_errors[..i - 1].iter().all(|e| rel_errors[i - 1] < *e);
        if i > USUAL && !falls(i) {
            break;
        }
        // Fourth order: at 1e-3 its own error is far under rounding.
        let mut pair = |h: f64| -> Result<f64> { Ok(value(h)? - value(-h)?) };
        differences[i] = (8.0 * pair(h)? - pair(2.0 * h)?) / (12.0 * h);
        rel_errors[i] = error(differences[i]);
        if enough.is_some_and(|enough| rel_errors[i] < enough) {
            break;
        }
    }
    Ok(Direction {
        group,
        adjoint,
        differences,
        rel_errors,
    })
}

fn time(
    simulator: &Simulator,
    controls: &Controls,
    probe: &Probe,
    repetitions: usize,
) -> Result<Times> {
    let (mut forward, mut gradient) = (Vec::new(), Vec::new());
    for i in 0..=repetitions {
        let start = Instant::now();
        let rollout = simulator.rollout(controls)?;
        let middle = start.elapsed().as_secs_f64();
        rollout.vjp(&probe.cotangents(&rollout))?;
        if i > 0 {
            forward.push(middle);
            gradient.push(start.elapsed().as_secs_f64());
        }
    }
    let median = |x: &mut Vec<f64>| {
        x.sort_by(f64::total_cmp);
        x[x.len() / 2]
    };
    Ok(Times {
        forward: median(&mut forward),
        gradient: median(&mut gradient),
    })
}
