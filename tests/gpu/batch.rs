//! Many equal scenes together against the CPU's, one by one.

use super::fixture::*;
use super::reduced::three;
use crate::support::example;
use hydrograd::adjoint::lie::Pose;
use hydrograd::coupling::reduced::Reduced;
use hydrograd::coupling::{Coupling, Direction, Exclusions, Linearise, Linearised, Together};
use hydrograd::gpu::Context;
use hydrograd::gpu::reduced::GpuReduced;
use hydrograd::simulate::{Backend, Begin, Cotangents, Member};
use hydrograd::{Controls, Fidelity, Gradient, Rollout, Scene, Settings, Simulator};
use nalgebra::{DMatrix, DVector};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

/// What all rungs give: value, gradient, its columns, along a displacement, answers to further twists, tangents.
pub fn answers(r: &dyn Linearised, bodies: usize, columns: usize) -> Vec<Vec<f64>> {
    let x = DVector::from_vec(wavy(columns, 0.7));
    let y = DVector::from_vec(wavy(columns, 1.9));
    let z = displacement(bodies, 2.3);
    let free = twist(bodies, 4.1);
    let further = basis(bodies, 2 * columns + 1, 3.7);
    let (on, off) = (Direction::Basis(&x), Direction::Twist(&free));
    let mut out = vec![
        r.momenta().as_slice().to_vec(),
        flat(&r.gradient(&x, &y).unwrap()),
        flat(&r.gradient_columns(&x).unwrap().concat()),
        r.gradient_along(&y, &z).unwrap().as_slice().to_vec(),
    ];
    for (x, y) in [(on, off), (off, on), (on, Direction::Basis(&y)), (off, off)] {
        let p = r.vjp(x, y).unwrap();
        out.extend([
            p.momentum_x.as_slice().to_vec(),
            p.momentum_y.as_slice().to_vec(),
            flat(&p.wrench),
        ]);
        let t = r.hvp(x, y, &z).unwrap();
        out.extend([
            t.momentum_x.as_slice().to_vec(),
            t.momentum_y.as_slice().to_vec(),
            flat(&t.gradient),
            flat(&t.wrench),
        ]);
    }
    let (momenta, pairs) = r.respond(&further, &x).unwrap();
    out.extend([momenta.as_slice().to_vec(), flat(&pairs.concat())]);
    let z = [
        z.clone(),
        displacement(bodies, 5.1),
        displacement(bodies, 6.2),
    ];
    for t in r.displaced(&x, &z).unwrap() {
        out.extend([t.momentum_x.as_slice().to_vec(), flat(&t.wrench)]);
    }
    out
}

fn holds(context: &Arc<Context>, reduced: &Arc<Reduced>, poses: &[Pose], limit: f64) {
    let columns = 5;
    let gpu = GpuReduced::new(context, reduced.clone()).unwrap();
    let table = gpu.together(1, columns).unwrap().unwrap();
    let seated = |_| held(table.as_ref(), reduced, poses, columns, limit);
    table.side_by_side(&seated).unwrap();
    // The CPU answered what had two twists alone.
    assert!(table.report().alone <= 1, "{:?}", table.report());
}

/// One who sits there compares.
fn held(table: &dyn Together, reduced: &Reduced, poses: &[Pose], columns: usize, limit: f64) {
    let (bodies, seat) = (poses.len(), table.coupling());
    let basis = basis(bodies, columns, 0.3);
    let right = reduced.linearise(poses, &basis).unwrap();
    let found = seat.differentiable().unwrap().linearise(poses, &basis);
    let found = found.unwrap();
    println!("cpu {:?}\ngpu {:?}", right.report(), found.report());
    let right = answers(&*right, bodies, columns);
    let all = answers(&*found, bodies, columns);
    let worst = (all.iter().zip(&right)).map(|(a, b)| difference(a, b));
    let worst: Vec<f64> = worst.collect();
    println!("{worst:?}");
    assert!(worst.iter().all(|d| *d <= limit), "{worst:?}");
    // What was pushed out of its slot is placed again.
    for phase in [0.1, 0.2, 0.3, 0.4] {
        let other = self::basis(bodies, columns, phase);
        let kept = seat.differentiable().unwrap().linearise(poses, &other);
        drop(kept.unwrap());
    }
    assert_eq!(all, answers(&*found, bodies, columns));
    let values = seat.evaluate(poses, &basis).unwrap();
    assert_eq!(values.momenta().as_slice(), all[0]);
}

/// In both fine arithmetics, with the image of a wall.
pub fn rungs() {
    let reduced = three(&[WALL], None, &Exclusions::none());
    holds(context(), &reduced, &poses(), 1e-9);
    holds(two_float(), &reduced, &poses(), 1e-8);
}

#[test]
fn a_seat_answers_as_the_cpu_does() {
    rungs();
    let excluded = Exclusions::new([(0, 2)]);
    let reduced = three(&[], None, &excluded);
    holds(context(), &reduced, &poses(), 1e-9);
}

const STEPS: usize = 3;
const MEMBERS: usize = 64;

/// The grasp with bodies of few sources: a software driver computes it about as fast as one core.
fn grasp(backend: Backend) -> Simulator {
    let settings = Settings::default()
        .fidelity(Fidelity::Reduced)
        .rank(20)
        .backend(backend);
    Simulator::new(&example("grasp"), settings).unwrap()
}

/// Different starts and pushes; some of fewer steps.
fn members(simulator: &Simulator, count: usize) -> Vec<Member> {
    let (q, v) = simulator.start();
    let size = simulator.system().controls;
    let member = |m: usize| {
        let shifts = wavy(q.len(), 0.3 + m as f64);
        let q = q + 0.02 * DVector::from_vec(shifts);
        let v = v + 0.1 * DVector::from_vec(wavy(v.len(), 0.9 + m as f64));
        let steps = STEPS - usize::from(m % 5 == 3);
        let pushes = wavy(size * steps, 1.7 + m as f64);
        let pushes = 300.0 * DMatrix::from_vec(size, steps, pushes);
        Member {
            begin: Begin::At(q, v),
            controls: Controls::from_matrix(simulator, pushes).unwrap(),
        }
    };
    (0..count).map(member).collect()
}

fn go_on() -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn rollouts(simulator: &Simulator, members: &[Member]) -> Vec<Rollout> {
    let (made, report) = simulator.rollout_batch(members, go_on).unwrap();
    println!("{report:?}");
    made.into_iter()
        .map(|one| one.map_err(|halted| halted.error).unwrap())
        .collect()
}

fn cotangents(rollout: &Rollout) -> Cotangents {
    let mut out = rollout.zero_cotangents();
    let fill = |m: &mut DMatrix<f64>, phase: f64| {
        m.copy_from_slice(&wavy(m.len(), phase));
    };
    fill(&mut out.q, 0.3);
    fill(&mut out.v, 0.7);
    fill(&mut out.positions, 1.1);
    fill(&mut out.rotations, 1.9);
    out
}

fn gradients(simulator: &Simulator, rollouts: &[Rollout]) -> Vec<Gradient> {
    let bars: Vec<Cotangents> = rollouts.iter().map(cotangents).collect();
    let all: Vec<&Rollout> = rollouts.iter().collect();
    let (made, report) = simulator.vjp_batch(&all, &bars, go_on).unwrap();
    println!("{report:?}");
    made.into_iter().collect::<Result<_, _>>().unwrap()
}

fn states(rollout: &Rollout) -> Vec<f64> {
    [rollout.q().as_slice(), rollout.v().as_slice()].concat()
}

fn parts(g: &Gradient) -> [Vec<f64>; 4] {
    [
        g.controls.as_slice().to_vec(),
        g.initial.q.as_slice().to_vec(),
        g.initial.v.as_slice().to_vec(),
        g.parameters.to_vec(),
    ]
}

/// Of one simulator, for compiling shaders takes longer than all the rest.
#[test]
fn sixty_four_grasps_together_are_the_cpus_one_by_one() {
    let (cpu, gpu) = (grasp(Backend::Cpu), grasp(Backend::Gpu));
    let started = Instant::now();
    let all = members(&cpu, MEMBERS);
    let right = rollouts(&cpu, &all);
    let right_bars = gradients(&cpu, &right);
    let found = rollouts(&gpu, &all);
    let bars = gradients(&gpu, &found);
    println!("{:.1} s", started.elapsed().as_secs_f64());
    let mut worst = [0.0_f64; 5];
    for m in 0..MEMBERS {
        let off = difference(&states(&found[m]), &states(&right[m]));
        worst[0] = worst[0].max(off);
        let both = parts(&bars[m]).into_iter().zip(parts(&right_bars[m]));
        for (k, (a, b)) in both.enumerate() {
            worst[k + 1] = worst[k + 1].max(difference(&a, &b));
        }
    }
    println!("states, controls, initial q and v, parameters: {worst:?}");
    assert!(worst.iter().all(|d| *d <= 1e-9), "{worst:?}");

    // To the last bit: alone, and among others in another order.
    for (m, few) in [(5, vec![5]), (8, vec![3, 8, 63])] {
        let chosen: Vec<Member> = few.iter().map(|m| all[*m].clone()).collect();
        let at = few.iter().position(|k| *k == m).unwrap();
        let again = rollouts(&gpu, &chosen);
        assert_eq!(states(&again[at]), states(&found[m]), "member {m}");
        let bars_again = gradients(&gpu, &again);
        assert_eq!(parts(&bars_again[at]), parts(&bars[m]), "member {m}");
    }
    some_fail(&gpu, &found);
    all_fail(&gpu, &found[..3]);
}

/// A member that fails takes no other along.
fn some_fail(gpu: &Simulator, right: &[Rollout]) {
    let mut all = members(gpu, 5);
    // The finger goes through the coin and out of the world.
    let (q, mut v) = (gpu.start().0.clone(), gpu.start().1.clone());
    v[1] = 1e8;
    all[2].begin = Begin::At(q, v);
    // Controls of another scene.
    all[4].controls = {
        let mut other = Scene::new(hydrograd::Fluid::fresh_water());
        other.add(hydrograd::Body::new(hydrograd::Shape::sphere(0.1)).density(900.0));
        let other = Simulator::new(&other, Settings::default()).unwrap();
        Controls::zeros(&other, 2)
    };
    let (made, report) = gpu.rollout_batch(&all, go_on).unwrap();
    println!("{report:?}");
    for (m, one) in made.iter().enumerate() {
        match one {
            Ok(rollout) => assert_eq!(states(rollout), states(&right[m]), "member {m}"),
            Err(halted) => {
                println!("member {m}: {}", halted.error);
                assert!([2, 4].contains(&m), "member {m}: {}", halted.error);
            }
        }
    }
    assert!(made[2].is_err() && made[4].is_err());
}

/// A lost device is every member's error.
fn all_fail(gpu: &Simulator, found: &[Rollout]) {
    let all = members(gpu, 3);
    gpu.context().unwrap().lose();
    let failed = gpu.rollout_batch(&all, go_on);
    let told = match failed {
        Err(error) => vec![error],
        Ok((made, _)) => made
            .into_iter()
            .map(|one| one.err().map(|halted| halted.error).unwrap())
            .collect(),
    };
    for error in told {
        println!("{error}");
        assert!(error.to_string().contains("GPU"), "{error}");
    }
    let refs: Vec<&Rollout> = found.iter().collect();
    let bars: Vec<Cotangents> = found.iter().map(cotangents).collect();
    if let Ok((made, _)) = gpu.vjp_batch(&refs, &bars, go_on) {
        assert!(made.iter().all(Result::is_err));
    }
}
