//! An underwater vehicle with an arm, held against recordings from a tank: the twin of uvms.py.
//!
//! The thrusters are off and the arm moves; the vehicle pitches and rolls. Its joints are driven through what was recorded, the run starts in the recorded attitude, rates and velocity,
//! and nothing else is told to the simulation. Nine constants of the vehicle are identified from the training runs (`optimize::identify`, exact Jacobians), and the other runs are
//! predicted; beside that the attitude at which the same weights would float still at each instant, and the constants as they are documented. uvms.py says more (rates, swings, coupling,
//! pictures), docs/tank.md where the recordings come from and which form they have. Without them recordings are made here, with noise, and the truth is known.
//!
//! `--rival N` gives the evolution strategy CMA-ES N simulations to get as low as that misfit.
//!
//! ```text
//! cargo run --release --features urdf --example uvms -- [--data FOLDER] [--rival N] [--json]
//! ```

#[path = "uvms/recording.rs"]
mod recording;
#[path = "uvms/vehicle.rs"]
mod vehicle;

use cmaes::{CMAESOptions, DVector as Point};
use hydrograd::optimize::{Experiment, Identified, IdentifySettings, Recorded, Unknown, identify};
use hydrograd::{Controls, Simulator};
use nalgebra::DVector;
use rayon::prelude::*;
use recording::Recording;
use serde::Serialize;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::error::Error;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;
use vehicle::{FOUND, TRUTH, VEHICLE, ZEROS, prepare};

const TRAIN: [&str; 5] = ["004-0", "006-1", "014-1", "030-1", "alt-001-2"];
/// How much of a run counts as independent, and how far off the model may be: rad, rad/s.
const INDEPENDENT: f64 = 10.0;
const OFF: [(&str, f64); 2] = [("attitudes", 0.25 * DEGREE), ("gyros", 0.5 * DEGREE)];
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Of the samples that are compared.
const EVERY: usize = 5;

/// Name, mean and deviation beforehand, and least value of what is to be found.
fn known() -> Vec<(String, f64, f64, f64)> {
    let none = f64::NEG_INFINITY;
    let lift = vehicle::LIFT * vehicle::GRAVITY;
    let place = |axis: &str, k: usize, moment: f64| {
        let name = format!("{VEHICLE}.center_of_buoyancy.{axis}");
        (name, vehicle::CENTER[k], moment / lift, none)
    };
    let mut out = vec![place("x", 0, 1.0), place("y", 1, 1.0), place("z", 2, 2.0)];
    out.extend(ZEROS.map(|joint| (format!("zero of {joint}"), 0.0, 0.05, none)));
    for (axis, k) in [("xx", 0), ("yy", 1)] {
        let name = format!("{VEHICLE}.inertia.{axis}");
        out.push((name, vehicle::INERTIA[k], 0.2, 0.05));
    }
    for axis in ["wx", "wy"] {
        out.push((format!("water.linear.{axis}"), vehicle::LINEAR[3], 0.2, 0.0));
    }
    out
}

/// The coordinate of the start that an unknown is, if it is one.
fn coordinate(name: &str) -> Option<String> {
    let joint = name.strip_prefix("zero of ")?;
    Some(format!("r5m_{joint} zero.angle"))
}

fn unknowns() -> Vec<Unknown> {
    let each = known().into_iter().map(|(name, mean, deviation, least)| {
        let mut made = Unknown::new(&name).prior(mean, deviation);
        if least.is_finite() {
            made = made.within(least, 5.0);
        }
        match coordinate(&name) {
            Some(label) => made.sets_start(label, 1.0),
            None => made,
        }
    });
    each.collect()
}

/// What is compared of a run: roll and pitch of the vehicle, which is the first body, and its rates about x and y.
fn recorded(run: &Recording) -> Vec<Recorded> {
    let all = (0..=run.steps()).step_by(EVERY);
    let states: Vec<usize> = all.filter(|n| run.free[*n]).collect();
    let weight = (states.len() as f64 / INDEPENDENT).sqrt();
    let each = OFF.iter().flat_map(|off| [0, 1].map(|k| (off, k)));
    each.map(|((name, deviation), entry)| {
        let column = run.seen(name, entry);
        Recorded {
            observable: (*name).into(),
            entry,
            values: states.iter().map(|n| column[*n]).collect(),
            states: states.clone(),
            deviation: weight * deviation,
        }
    })
    .collect()
}

fn experiment(run: &Recording, simulator: &Simulator) -> Experiment {
    let controls = Controls::zeros(simulator, run.steps());
    let made = Experiment::new(&run.name, simulator.clone(), controls);
    recorded(run).into_iter().fold(made, Experiment::saw)
}

/// A simulator with other values of the unknowns.
fn with_values(simulator: &Simulator, values: &[f64]) -> hydrograd::Result<Simulator> {
    let mut out = simulator.clone();
    let mut parameters = out.parameters().clone();
    let (mut q, v) = (out.start().0.clone(), out.start().1.clone());
    let labels = out.scene().coordinate_labels();
    for ((name, ..), value) in known().iter().zip(values) {
        match coordinate(name) {
            None => parameters.set(name, *value)?,
            Some(label) => {
                if let Some(i) = labels.iter().position(|l| *l == label) {
                    q[i] = *value;
                }
            }
        }
    }
    out.set_parameters(parameters)?;
    out.set_start(q, v)?;
    Ok(out)
}

/// Root mean squares of roll and pitch, °, simulated and at rest under the same weights.
fn score(run: &Recording, simulator: &Simulator) -> hydrograd::Result<[[f64; 2]; 2]> {
    let rollout = simulator.rollout(&Controls::zeros(simulator, run.steps()))?;
    let attitudes = rollout.observe("attitudes")?;
    let mut still = Vec::new();
    for (n, sample) in rollout.samples().iter().enumerate() {
        if run.free[n] {
            still.push((n, vehicle::equilibrium(simulator, &sample.q)?));
        }
    }
    let rms = |of: &dyn Fn(usize, usize) -> f64, k: usize| {
        let square: f64 = still.iter().map(|(i, _)| of(*i, k).powi(2)).sum();
        (square / still.len() as f64).sqrt() / DEGREE
    };
    let at_rest: BTreeMap<usize, [f64; 2]> = still.iter().copied().collect();
    let seen = [run.seen("attitudes", 0), run.seen("attitudes", 1)];
    let simulated = |n: usize, k: usize| attitudes[(k, n)] - seen[k][n];
    let rest = |n: usize, k: usize| at_rest[&n][k] - seen[k][n];
    Ok([
        [rms(&simulated, 0), rms(&simulated, 1)],
        [rms(&rest, 0), rms(&rest, 1)],
    ])
}

#[derive(Serialize)]
struct Run {
    name: String,
    training: bool,
    /// Roll and pitch, °.
    dynamic: [f64; 2],
    equilibrium: [f64; 2],
    documented: [f64; 2],
}

#[derive(Serialize)]
struct Report {
    runs: Vec<Run>,
    /// None where the training runs aren't there.
    identified: Option<Identified>,
    /// Known where the recordings are made here.
    truth: Option<Vec<f64>>,
    /// Simulations that CMA-ES made, and the misfit that it got to.
    rival: Option<(usize, f64)>,
    seconds: f64,
}

/// The misfit of all training runs, for whom has no derivatives.
fn misfit(runs: &[&Recording], simulators: &[&Simulator], values: &[f64]) -> f64 {
    let of_run = |(run, simulator): (&&Recording, &&Simulator)| -> hydrograd::Result<f64> {
        let simulator = with_values(simulator, values)?;
        let rollout = simulator.rollout(&Controls::zeros(&simulator, run.steps()))?;
        let mut sum = 0.0;
        for r in recorded(run) {
            let made = rollout.observe(&r.observable)?;
            let off =
                |(n, seen): (&usize, &f64)| ((made[(r.entry, *n)] - seen) / r.deviation).powi(2);
            sum += r.states.iter().zip(&r.values).map(off).sum::<f64>();
        }
        Ok(sum)
    };
    let pairs: Vec<_> = runs.iter().zip(simulators).collect();
    let sums: Vec<_> = pairs.into_par_iter().map(of_run).collect();
    let sums: hydrograd::Result<Vec<f64>> = sums.into_iter().collect();
    let prior: f64 = (known().iter().zip(values))
        .map(|((_, mean, deviation, _), x)| ((x - mean) / deviation).powi(2))
        .sum();
    sums.map_or(1e6, |sums| 0.5 * (sums.iter().sum::<f64>() + prior))
}

/// CMA-ES until it is as low as `target`, or has made `most` simulations.
fn rival(
    runs: &[&Recording],
    simulators: &[&Simulator],
    target: f64,
    most: usize,
) -> Result<(usize, f64), Box<dyn Error>> {
    let prior = known();
    let (evaluated, best) = (Cell::new(0), Cell::new(f64::INFINITY));
    let objective = |x: &Point<f64>| {
        // In deviations of what was known before; below the least value it stays there.
        let values: Vec<f64> = (prior.iter().zip(x.iter()))
            .map(|((_, mean, deviation, least), x)| (mean + deviation * x).max(*least))
            .collect();
        evaluated.set(evaluated.get() + 1);
        let found = misfit(runs, simulators, &values);
        best.set(best.get().min(found));
        found
    };
    let mut state = CMAESOptions::new(vec![0.0; prior.len()], 0.5)
        .fun_target(target)
        .max_function_evals(most / runs.len())
        .seed(1)
        .build(objective)
        .map_err(|e| format!("{e:?}"))?;
    state.run();
    drop(state);
    Ok((runs.len() * evaluated.get(), best.get()))
}

/// All that is done with a folder of recordings; `most` simulations for CMA-ES, if any.
fn study(folder: &std::path::Path, most: usize, made_here: bool) -> Result<Report, Box<dyn Error>> {
    let began = Instant::now();
    let (runs, urdf) = recording::folder(folder)?;
    let simulators: Vec<Simulator> = (runs.par_iter())
        .map(|run| prepare(run, &urdf).map_err(|e| e.to_string()))
        .collect::<Result<_, _>>()?;
    let is_training = |run: &Recording| TRAIN.contains(&run.name.as_str());
    let training: Vec<_> = (runs.iter().zip(&simulators))
        .filter(|(run, _)| is_training(run))
        .collect();
    let found = match training.is_empty() {
        true => {
            eprintln!(
                "none of the runs {TRAIN:?} is there: constants as found from those of the tank"
            );
            None
        }
        false => {
            let experiments: Vec<_> = training.iter().map(|(r, s)| experiment(r, s)).collect();
            let settings = IdentifySettings {
                cost_tolerance: 1e-5,
                ..IdentifySettings::default()
            };
            Some(identify(&experiments, &unknowns(), &settings, |p| {
                eprintln!(
                    "iteration {}: misfit {:.3}, {} simulations",
                    p.iteration, p.cost, p.simulations
                );
                ControlFlow::Continue(())
            })?)
        }
    };
    let values: Vec<f64> = match &found {
        Some(found) => found.unknowns.iter().map(|u| u.value).collect(),
        None => FOUND.to_vec(),
    };
    let shown: Vec<_> = (runs.iter().zip(&simulators))
        .filter(|(run, _)| !run.name.starts_with("baseline"))
        .collect();
    let scores: Vec<Run> = (shown.par_iter())
        .map(|(run, simulator)| {
            let [dynamic, equilibrium] = score(run, &with_values(simulator, &values)?)?;
            let [documented, _] = score(run, simulator)?;
            Ok(Run {
                name: run.name.clone(),
                training: is_training(run),
                dynamic,
                equilibrium,
                documented,
            })
        })
        .collect::<hydrograd::Result<_>>()?;
    let rival = match &found {
        Some(found) if most > 0 => {
            let (runs, simulators): (Vec<_>, Vec<_>) = training.iter().copied().unzip();
            Some(rival(&runs, &simulators, 1.001 * found.cost, most)?)
        }
        _ => None,
    };
    Ok(Report {
        runs: scores,
        identified: found,
        truth: made_here.then(|| TRUTH.to_vec()),
        rival,
        seconds: began.elapsed().as_secs_f64(),
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let (mut data, mut most, mut json) = (None::<PathBuf>, 0, false);
    let mut arguments = std::env::args().skip(1);
    while let Some(name) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{name} needs a value"));
        match name.as_str() {
            "--data" => data = Some(value()?.into()),
            "--rival" => most = value()?.parse()?,
            "--json" => json = true,
            _ => return Err(format!("{name}: expected --data, --rival or --json").into()),
        }
    }
    let made = match &data {
        Some(_) => None,
        None => Some(tempfile::tempdir()?),
    };
    let folder = match (&data, &made) {
        (Some(folder), _) => folder.clone(),
        (None, Some(made)) => {
            eprintln!("no recordings given: made here, with noise");
            vehicle::make(made.path(), &[&TRAIN[..3], &["made-1", "made-2"]].concat())?;
            made.path().into()
        }
        (None, None) => return Err("no recordings".into()),
    };
    let report = study(&folder, most, data.is_none())?;
    if json {
        println!("{}", serde_json::to_string(&report)?);
    } else {
        tell(&report);
    }
    Ok(())
}

fn tell(report: &Report) {
    println!(
        "{:12} {:>15} {:>15} {:>15}   roll / pitch, °",
        "run", "dynamic", "equilibrium", "documented"
    );
    let cell = |x: [f64; 2]| format!("{:6.2} / {:5.2} ", x[0], x[1]);
    for run in &report.runs {
        let models = [run.dynamic, run.equilibrium, run.documented].map(cell);
        let of = if run.training { "  (training)" } else { "" };
        println!("{:12} {}{of}", run.name, models.join(" "));
    }
    for (part, training) in [("training", true), ("unseen", false)] {
        let chosen: Vec<&Run> = report
            .runs
            .iter()
            .filter(|r| r.training == training)
            .collect();
        let mean = |of: &dyn Fn(&Run) -> [f64; 2]| {
            let sum = chosen.iter().map(|r| DVector::from_row_slice(&of(r)));
            let mean = sum.sum::<DVector<f64>>() / chosen.len() as f64;
            format!("{:6.3} / {:5.3} ", mean[0], mean[1])
        };
        if !chosen.is_empty() {
            let models = [
                mean(&|r| r.dynamic),
                mean(&|r| r.equilibrium),
                mean(&|r| r.documented),
            ];
            println!("{part:12} {}", models.join(" "));
        }
    }
    if let Some(found) = &report.identified {
        for (i, u) in found.unknowns.iter().enumerate() {
            let truth = report.truth.as_ref();
            let truth = truth.map_or(String::new(), |t| format!(", true {}", t[i]));
            println!(
                "{}: {:.4} ± {:.2e}{truth}",
                u.name, u.value, u.standard_error
            );
        }
        println!(
            "misfit {:.2} by {} simulations and {} Jacobians",
            found.cost, found.simulations, found.jacobians
        );
    }
    println!("{:.1} s in all", report.seconds);
    if let Some((simulations, cost)) = report.rival {
        println!("CMA-ES: misfit {cost:.2} after {simulations} simulations");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Within four standard errors, and the runs that weren't used are met better than by an equilibrium.
    #[test]
    fn recordings_of_our_own_say_what_made_them() -> Result<(), Box<dyn Error>> {
        let folder = tempfile::tempdir()?;
        vehicle::make(folder.path(), &["004-0", "006-1", "014-1", "made-1"])?;
        let report = study(folder.path(), 0, true)?;
        let found = report.identified.ok_or("the training runs are there")?;
        for (u, truth) in found.unknowns.iter().zip(TRUTH) {
            let off = (u.value - truth).abs();
            assert!(
                off < 4.0 * u.standard_error,
                "{}: {} for {truth}",
                u.name,
                u.value
            );
        }
        for run in report.runs.iter().filter(|r| !r.training) {
            for k in 0..2 {
                assert!(run.dynamic[k] < 0.1 && run.dynamic[k] < run.equilibrium[k]);
            }
        }
        Ok(())
    }
}
