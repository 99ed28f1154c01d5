//! Bodies that don't feel each other through the water: what needs no dense mass matrix against that matrix, and what falls apart against the whole.

use crate::support::INTEGRATORS;
use crate::trees::{TREES, scene};
use hydrograd::adjoint::sample::Samples;
use hydrograd::dynamics::{Evaluation, Integrator};
use hydrograd::scene::{Body, Controller, Fluid, Joint, Scene, Spring};
use hydrograd::simulate::gradcheck::{GradcheckSettings, gradcheck};
use hydrograd::{Controls, Error, Fidelity, Settings, Simulator};
use nalgebra::{DMatrix, DVector};

/// All trees in one scene, their bodies in turns (a body of each tree, then the next of each); two of them tied by a spring with a damper.
fn forest() -> Scene {
    let trees: Vec<Scene> = TREES.map(scene).collect();
    let mut out = Scene::new(trees[0].fluid);
    out.gravity = trees[0].gravity;
    for b in 0..4 {
        for (t, tree) in trees.iter().enumerate() {
            let mut body = tree.bodies[b].clone();
            body.name = format!("{t}.{b}");
            body.parent = body.parent.map(|p| format!("{t}.{p}"));
            let before = &tree.bodies[..b];
            let count = |of: fn(&Joint) -> usize| before.iter().map(|b| of(&b.joint)).sum();
            let (q, v): (usize, usize) = (
                count(|joint| joint.coordinates()),
                count(|joint| joint.velocities()),
            );
            let (nq, nv) = (body.joint.coordinates(), body.joint.velocities());
            out.initial.q.extend(&tree.initial.q[q..q + nq]);
            out.initial.v.extend(&tree.initial.v[v..v + nv]);
            out.add(body);
        }
    }
    let spring = Spring::new("0.3")
        .to("1.0", [0.02, 0.0, 0.01])
        .stiffness(30.0);
    out.add_force(spring.damping(4.0).rest_length(0.2).into());
    let mut random = Samples::new(5);
    let control = random.numbers(out.controls(), 0.3);
    out.controller = Some(Controller::Constant { control });
    out
}

fn simulator(scene: &Scene, integrator: Integrator) -> Simulator {
    let settings = Settings::default()
        .fidelity(Fidelity::Isolated)
        .integrator(integrator);
    Simulator::new(scene, settings).unwrap()
}

/// Σ Jᵀ (M_b + ρ A_b) J, from dense Jacobians.
fn mass_matrix(e: &Evaluation) -> DMatrix<f64> {
    let system = e.system;
    let count = 6 * system.coupling.bodies();
    let poses: Vec<_> = system
        .submerged()
        .map(|(b, _)| e.kinematics.poses[b])
        .collect();
    let identity = DMatrix::identity(count, count);
    let found = system.coupling.evaluate(&poses, &identity).unwrap();
    let jacobian = system.tree.jacobian(&e.kinematics);
    let nv = system.tree.velocities();
    let mut out = DMatrix::zeros(nv, nv);
    for (b, body) in system.bodies.iter().enumerate() {
        let mut inertia = e.rigid[b];
        if let Some(w) = body.submerged {
            inertia += e.parameters.density() * found.momenta().fixed_view::<6, 6>(6 * w, 6 * w);
        }
        let mut own = DMatrix::zeros(6, nv);
        for k in 0..nv {
            let spatial = jacobian.fixed_view::<6, 1>(6 * b, k).into_owned();
            own.set_column(k, &e.kinematics.poses[b].twist_to_body(&spatial));
        }
        out += own.tr_mul(&(inertia * &own));
    }
    out
}

#[test]
fn products_and_solves_are_those_of_the_dense_mass_matrix() {
    let simulator = simulator(&forest(), Integrator::Rk4);
    let (q, _) = simulator.start();
    let e = simulator
        .system()
        .evaluate(simulator.parameters(), q, 0.0)
        .unwrap();
    let dense = mass_matrix(&e);
    let nv = dense.nrows();
    let size = dense.amax();
    assert!((e.mass_matrix() - &dense).amax() < 1e-14 * size);
    let mut random = Samples::new(3);
    for trial in 0..20 {
        let mut vector = || DVector::from_vec(random.numbers(nv, 1.0));
        let (v, right) = (vector(), vector());
        assert!((e.mass_times(&v) - &dense * &v).amax() < 1e-14 * size * v.amax());
        // All free, and a third of them driven.
        let free: Vec<usize> = (0..nv)
            .filter(|i| trial == 0 || (i + trial) % 3 > 0)
            .collect();
        let found = e.factored(&free).unwrap().solve(&right);
        let block = dense.select_rows(&free).select_columns(&free);
        let solved = block.cholesky().unwrap().solve(&right.select_rows(&free));
        let error = (found.select_rows(&free) - &solved).amax() / solved.amax();
        assert!(error < 1e-12, "{error:.1e}");
        assert!((0..nv).all(|i| free.contains(&i) || found[i] == 0.0));
    }
}

#[test]
fn how_forces_change_with_the_velocity_is_told_by_islands() {
    let simulator = simulator(&forest(), Integrator::MomentumEuler);
    let (q, v) = simulator.start();
    let e = simulator
        .system()
        .linearise(simulator.parameters(), q, 0.0)
        .unwrap();
    let control = DVector::from_element(simulator.system().controls, 0.2);
    let found = e.force_velocity_jacobian(v, &control).unwrap();
    let h = 1e-6;
    let mut coupled = 0;
    for k in 0..v.len() {
        let at = |h: f64| {
            let mut v = v.clone();
            v[k] += h;
            e.force(&v, &control).unwrap()
        };
        let slope = (at(h) - at(-h)) / (2.0 * h);
        let error = (found.column(k) - &slope).amax() / found.amax();
        assert!(error < 1e-8, "column {k}: {error:.1e}");
        coupled += usize::from(found[(v.len() - 1, k)] != 0.0);
    }
    // The last tree feels only itself.
    assert!(coupled < v.len() / 2);
}

#[test]
fn trees_move_together_as_each_alone() {
    let mut whole = forest();
    whole.forces.clear();
    whole.controller = None;
    let alone: Vec<Scene> = TREES
        .map(|t| {
            let mut tree = scene(t);
            tree.controller = None;
            tree
        })
        .collect();
    for integrator in INTEGRATORS {
        let ends = |scene: &Scene| {
            let simulator = simulator(scene, integrator);
            let rollout = simulator.rollout(&Controls::zeros(&simulator, 10)).unwrap();
            rollout.samples()[10].poses.clone()
        };
        let together = ends(&whole);
        for (t, tree) in alone.iter().enumerate() {
            for (b, pose) in ends(tree).iter().enumerate() {
                let error = (pose.translation - together[4 * b + t].translation).norm();
                assert!(error < 1e-11, "{integrator:?} {t}.{b}: {error:.1e}");
            }
        }
    }
}

#[test]
fn gradients_of_the_forest_hold_against_differences() {
    for integrator in INTEGRATORS {
        let mut simulator = simulator(&forest(), integrator);
        let settings = GradcheckSettings {
            steps: 5,
            directions: 1,
            seed: 11,
            timings: 0,
            enough: Some(1e-7),
        };
        let error = gradcheck(&mut simulator, &settings).unwrap().max_rel_error;
        assert!(error < 1e-7, "{integrator:?}: {error:.1e}");
    }
}

#[test]
fn a_joint_without_inertia_is_named() {
    let mut scene = Scene::new(Fluid::none());
    let arm = Body::dry().named("arm").mass(1.0);
    let arm = Body {
        inertia: Some(vec![0.1; 3]),
        ..arm
    };
    scene.add(arm);
    let hand = Body::dry().named("hand").mass(0.0);
    scene.add(hand.child_of("arm").joint(Joint::Revolute {
        axis: [0.0, 0.0, 1.0],
    }));
    let error = Simulator::new(&scene, Settings::default()).err().unwrap();
    assert!(matches!(error, Error::Unresolved { .. }));
    assert!(error.to_string().contains("\"hand\""), "{error}");
}
