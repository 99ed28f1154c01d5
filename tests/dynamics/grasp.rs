//! The grasp: gradients of its costs, and random ones. That a descent catches what the naive push loses is tested with the paper's first figure (`--example paper`).

#[allow(dead_code)]
#[path = "../../examples/grasp/hold.rs"]
mod hold;
#[allow(dead_code)]
#[path = "../../examples/grasp/task.rs"]
mod task;

use crate::support::grasps::RandomGrasp;
use hydrograd::Controls;
use hydrograd::adjoint::sample::Samples;
use hydrograd::simulate::OpenLoop;
use task::Task;

/// The costs' gradients over the knots, against differences: before the fingers touch the coin, and with the coin held.
#[test]
fn gradients_of_the_costs() {
    let task = Task::new(&task::load().unwrap(), task::CHEAP).unwrap();
    let wavy = |k: usize, scale: f64| scale * (1.3 * k as f64 + 0.7).sin();
    let x: Vec<f64> = (0..33).map(|k| wavy(k, 0.3)).collect();
    let d: Vec<f64> = (0..33).map(|k| wavy(2 * k, 1.0)).collect();
    let h = 1e-5;
    let at = |h: f64| -> Vec<f64> { x.iter().zip(&d).map(|(x, d)| x + h * d).collect() };
    for cost in [Task::approach, Task::hold] {
        let (_, gradient) = cost(&task, &x).unwrap();
        let along: f64 = gradient.iter().zip(&d).map(|(g, d)| g * d).sum();
        let pair = |h: f64| cost(&task, &at(h)).unwrap().0 - cost(&task, &at(-h)).unwrap().0;
        let difference = (8.0 * pair(h) - pair(2.0 * h)) / (12.0 * h);
        let error = (along - difference).abs() / difference.abs();
        println!("{along:.6e} and {difference:.6e}: {error:.1e}");
        assert!(error <= 1e-5, "{along} is not {difference}");
    }
}

/// Grasps with random forces, gaps filled by films: none fails, in the coupling or otherwise, whatever closes on what. A thousand: `cargo bench --bench contact -- grasps`.
#[test]
fn random_grasps_never_fail() {
    let count = 8;
    let scene = task::load().unwrap();
    let mut simulator = task::simulator(&scene, task::RESOLVED).unwrap();
    simulator.set_policy(Box::new(OpenLoop));
    let (q, v) = (simulator.start().0.clone(), simulator.start().1.clone());
    let mut random = Samples::new(1);
    let coin = [hold::COIN_Y, hold::COIN_Z, hold::COIN_TURN];
    let (mut failed, mut cut, mut most, mut past) = (Vec::new(), 0, 1, 0.0_f64);
    let (mut nearest, mut warned) = (f64::INFINITY, 0);
    for grasp in 0..count {
        let drawn = RandomGrasp::draw(&mut random, &q, coin, scene.steps);
        simulator.set_start(drawn.start, v.clone()).unwrap();
        let controls = Controls::from_matrix(&simulator, drawn.forces).unwrap();
        let rollout = match simulator.rollout(&controls) {
            Ok(rollout) => rollout,
            Err(error) => {
                failed.push(format!("grasp {grasp}: {error}"));
                continue;
            }
        };
        let summary = rollout.summary();
        cut += summary.cut_steps;
        most = most.max(summary.most_pieces);
        nearest = nearest.min(summary.min_gap.unwrap());
        warned += usize::from(rollout.warnings().iter().any(|w| w.contains("pieces")));
        for sample in rollout.samples() {
            assert!(sample.q.iter().chain(&sample.v).all(|x| x.is_finite()));
            for limit in &rollout.simulator().system().limits {
                past = past.max(limit.past(sample.q[limit.q]) / limit.room());
            }
        }
    }
    println!(
        "{count} grasps: {} fail; {cut} steps cut, into at most {most}; {past:.4} of a range past a limit; smallest gap {:.1} mm; \
         {warned} go deep",
        failed.len(),
        1e3 * nearest
    );
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    assert!(past < 0.06, "{past}");
    assert_eq!(warned, 0);
    assert!(nearest > 0.0, "{nearest}");
}
