//! Bodies that settle in water into a heap: what a step costs, whether any is lost, and how the cost grows with the bodies.
//!
//! `cargo bench --bench heap [-- --bodies N] [--seconds T] [--step DT] [--fidelity NAME] [--accuracy A] [--exchange auto|factor|products] [--integrator NAME] [--no-films] [--roughness R] [--growth]`: 200 bodies
//! over 5 s in steps of 0.005 s, `isolated`, by momentum Euler; with viscous water in their gaps where a roughness (m) is given; `--growth` instead 25 to 400 bodies over a shorter time.

#[allow(dead_code)]
mod common;

use common::arguments;
use common::support::heap::{Heap, heap};
use hydrograd::dynamics::Integrator;
use hydrograd::scene::Lubrication;
use hydrograd::simulate::Exchange;
use hydrograd::{Controls, Fidelity, Rollout, Settings, Simulator};
use std::time::{Duration, Instant};

/// How often a run tells how far it has come.
const TELL: Duration = Duration::from_secs(30);

/// What is run.
#[derive(Clone, Copy)]
struct Case {
    bodies: usize,
    seconds: f64,
    step: f64,
    fidelity: Fidelity,
    accuracy: Option<f64>,
    exchange: Exchange,
    integrator: Integrator,
    films: bool,
    roughness: Option<f64>,
}

impl Case {
    /// The rollout, seconds to prepare it, and seconds a step.
    fn run(&self) -> hydrograd::Result<(Rollout, f64, f64)> {
        let settings = Settings::default()
            .fidelity(self.fidelity)
            .exchange(self.exchange)
            .integrator(self.integrator)
            .films(self.films);
        let settings = match self.accuracy {
            Some(accuracy) => settings.accuracy(accuracy),
            None => settings,
        };
        let start = Instant::now();
        let mut scene = heap(self.bodies, self.step);
        if let Some(roughness) = self.roughness {
            scene.add_force(Lubrication::new(roughness).into());
        }
        let simulator = Simulator::new(&scene, settings)?;
        let prepared = start.elapsed().as_secs_f64();
        let steps = (self.seconds / self.step).round() as usize;
        let controls = Controls::zeros(&simulator, steps);
        let start = Instant::now();
        let mut told = Duration::ZERO;
        // A run of many minutes that is cut off has told how far it came.
        let rollout = simulator.rollout_with(&controls, |done| {
            let passed = start.elapsed();
            if passed - told >= TELL {
                told = passed;
                let each = 1e3 * passed.as_secs_f64() / done as f64;
                eprintln!("{done} of {steps} steps, {each:.0} ms each so far");
            }
        })?;
        let each = start.elapsed().as_secs_f64() / steps as f64;
        Ok((rollout, prepared, each))
    }

    fn tell(&self) -> hydrograd::Result<f64> {
        let (rollout, prepared, each) = self.run()?;
        let (found, summary) = (Heap::of(&rollout, 10)?, rollout.summary());
        let steps = rollout.steps();
        let touching = rollout.contacts(steps - 1, 0.0)?.len();
        println!(
            "{} bodies, {} s in steps of {} s: {:.3} s to prepare, {:.1} ms a step; {} of {} inside, finite: {}; deepest overlap {:.2} mm, {:.3} at the end, of surfaces \
             that touch at {:.2} mm; kinetic energy {:.1e} J at the end, {:.1e} at most; highest {:.2} m; {touching} points press at the end; {} steps cut, into at most {}",
            self.bodies,
            self.seconds,
            self.step,
            prepared,
            1e3 * each,
            found.inside,
            self.bodies,
            found.finite,
            1e3 * (-found.deepest).max(0.0),
            1e3 * (-found.deepest_at_end).max(0.0),
            1e3 * found.gap,
            found.kinetic,
            found.most_kinetic,
            found.height,
            summary.cut_steps,
            summary.most_pieces
        );
        Ok(each)
    }
}

fn main() -> hydrograd::Result<()> {
    let arguments = arguments();
    let after = |name: &str| {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1)
    };
    let number = |name: &str, or: f64| after(name).and_then(|x| x.parse().ok()).unwrap_or(or);
    let case = Case {
        bodies: number("--bodies", 200.0) as usize,
        seconds: number("--seconds", 5.0),
        step: number("--step", 5e-3),
        fidelity: match after("--fidelity") {
            Some(name) => name.parse().expect("the name of a fidelity"),
            None => Fidelity::Isolated,
        },
        accuracy: after("--accuracy").map(|x| x.parse().expect("an accuracy, such as 0.01")),
        exchange: match after("--exchange") {
            Some(name) => name.parse().expect("the name of an exchange"),
            None => Exchange::Auto,
        },
        integrator: match after("--integrator") {
            Some(name) => name.parse().expect("the name of an integrator"),
            None => Integrator::MomentumEuler,
        },
        films: !arguments.iter().any(|a| a == "--no-films"),
        roughness: after("--roughness").map(|x| x.parse().expect("a roughness in m, such as 1e-5")),
    };
    if !arguments.iter().any(|a| a == "--growth") {
        return case.tell().map(drop);
    }
    let mut first = None;
    for bodies in [25, 50, 100, 200, 400] {
        let each = Case { bodies, ..case }.tell()?;
        let ratio = each / *first.get_or_insert(each);
        println!(
            "{:.1} times the time of 25 bodies, of {} times the bodies",
            ratio,
            bodies / 25
        );
    }
    Ok(())
}
