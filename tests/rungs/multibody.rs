//! Rungs of joints and of the tree.

use super::tools::{Group, all, along, groups, wavy};
use hydrograd::adjoint::check::{Outcome, Rung};
use hydrograd::adjoint::lie::{Pose, Vec3, Vec6, exp_matrix};
use hydrograd::multibody::{Cotangents, Joint, JointModel, Plane, Tree, Virtual};
use nalgebra::{DVector, UnitQuaternion};

pub fn rungs() -> Vec<Rung> {
    macro_rules! rungs {
        ($($name:literal => $check:expr),* $(,)?) => {
            vec![$(Rung { name: $name, check: $check }),*]
        };
    }
    rungs![
        "multibody::joint::model::JointModel::integrate_vjp" => joint_integrate,
        "multibody::joint::model::JointModel::chart_rate_vjp" => joint_chart_rate,
        "multibody::joint::JointMotion::frame_velocity_vjp" => joint_frame_velocity,
        "multibody::joint::JointMotion::frame_bias_vjp" => joint_frame_bias,
        "multibody::charts::Tree::integrate_vjp" => tree_integrate,
        "multibody::charts::Tree::chart_rate_vjp" => tree_chart_rate,
        "multibody::joint::model::JointModel::chart_momentum_vjp" => |c| all(joints().iter().map(|j| chart_momentum(&Tree::new([(None, Pose::identity(), j.clone())]), c))),
        "multibody::charts::Tree::chart_momentum_vjp" => |c| chart_momentum(&tree(), c),
        "multibody::fields::Tree::reverse" => tree_reverse,
    ]
}

fn joints() -> Vec<JointModel> {
    let axis = [0.36, -0.48, 0.8];
    [
        Joint::Prismatic { axis },
        Joint::Revolute { axis },
        Joint::Planar { plane: Plane::Yz },
        Joint::Spherical,
        Joint::Free,
        Joint::Screw { axis, pitch: 0.4 },
    ]
    .map(|j| j.model())
    .into()
}

/// A generic configuration of a joint.
fn generic(joint: &JointModel) -> Vec<f64> {
    joint.integrate(
        &joint.origin(),
        wavy(joint.velocities(), 0.3, 0.8).as_slice(),
    )
}

/// Tangent displacement from `base` to `q`, a chart whose derivative at `base` is the identity.
pub fn displacement(joint: &JointModel, base: &[f64], q: &[f64]) -> Vec<f64> {
    let turn = |a: &[f64], b: &[f64]| -> Vec<f64> {
        let of = |x: &[f64]| {
            UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(x[0], x[1], x[2], x[3]))
        };
        (of(b) * of(a).inverse()).scaled_axis().as_slice().to_vec()
    };
    let plain = |n: usize| -> Vec<f64> { (0..n).map(|k| q[k] - base[k]).collect() };
    match joint.quaternion_at() {
        Some(at) => {
            let mut out = plain(at);
            out.extend(turn(&base[at..], &q[at..]));
            out
        }
        None => plain(q.len()),
    }
}

/// The same for a tree.
pub fn tree_displacement(tree: &Tree, base: &DVector<f64>, q: &DVector<f64>) -> DVector<f64> {
    let mut out = Vec::new();
    for l in tree.links() {
        let r = l.q.clone();
        let part = displacement(&l.joint, &base.as_slice()[r.clone()], &q.as_slice()[r]);
        out.extend(part);
    }
    DVector::from_vec(out)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn moved(x: &[f64], h: f64, dx: &DVector<f64>) -> Vec<f64> {
    x.iter().zip(dx.iter()).map(|(x, d)| x + h * d).collect()
}

fn joint_integrate(c: f64) -> Outcome {
    all(joints().iter().flat_map(|j| {
        let n = j.velocities();
        let (q, xi) = (generic(j), wavy(n, 1.1, 0.7).as_slice().to_vec());
        let end = j.integrate(&q, &xi);
        let bar = wavy(n, 2.0, 1.0);
        let (q_bar, xi_bar) = j.integrate_vjp(&xi, bar.as_slice());
        let d = wavy(n, 3.3, 0.3);
        let scalar = |end2: Vec<f64>| dot(bar.as_slice(), &displacement(j, &end, &end2));
        let from = |h: f64| j.integrate(&q, (h * &d).as_slice());
        [
            along(
                |h| scalar(j.integrate(&from(h), &xi)),
                c * dot(&q_bar, d.as_slice()),
            ),
            along(
                |h| scalar(j.integrate(&q, &moved(&xi, h, &d))),
                c * dot(&xi_bar, d.as_slice()),
            ),
        ]
    }))
}

fn joint_chart_rate(c: f64) -> Outcome {
    all(joints().iter().flat_map(|j| {
        let n = j.velocities();
        let (xi, v) = (wavy(n, 1.1, 0.7), wavy(n, 0.4, 1.0));
        let (bar, d) = (wavy(n, 2.0, 1.0), wavy(n, 3.3, 0.3));
        let (xi_bar, v_bar) = j.chart_rate_vjp(xi.as_slice(), v.as_slice(), bar.as_slice());
        let scalar = |xi: &[f64], v: &[f64]| dot(bar.as_slice(), &j.chart_rate(xi, v));
        let turns = j.quaternion_at().is_some();
        let by_v = along(
            |h| scalar(xi.as_slice(), &moved(v.as_slice(), h, &d)),
            c * dot(&v_bar, d.as_slice()),
        );
        let slope = dot(&xi_bar, d.as_slice());
        assert!(turns || slope == 0.0);
        let by_xi = turns.then(|| {
            along(
                |h| scalar(&moved(xi.as_slice(), h, &d), v.as_slice()),
                c * slope,
            )
        });
        [Some(by_v), by_xi]
            .into_iter()
            .flatten()
            .collect::<Vec<_>>()
    }))
}

/// Joints with a configuration-dependent velocity map.
fn turning_joints() -> Vec<JointModel> {
    let turning = |j: &JointModel| ["planar", "free"].contains(&j.kind());
    let (some, others): (Vec<_>, Vec<_>) = joints().into_iter().partition(turning);
    for j in others {
        let v = wavy(j.velocities(), 0.4, 1.0);
        let zero = vec![0.0; j.velocities()];
        assert_eq!(j.frame_velocity_vjp(v.as_slice(), v.as_slice()), zero);
        assert_eq!(j.frame_bias_vjp(v.as_slice(), v.as_slice()), zero);
        assert_eq!(j.frame_velocity(&generic(&j), v.as_slice()), v.as_slice());
    }
    some
}

fn joint_frame_velocity(c: f64) -> Outcome {
    all(turning_joints().iter().map(|j| {
        let n = j.velocities();
        let (q, v) = (generic(j), wavy(n, 0.4, 1.0));
        let (bar, d) = (wavy(n, 2.0, 1.0), wavy(n, 3.3, 0.3));
        let q_bar = j.frame_velocity_vjp(v.as_slice(), bar.as_slice());
        along(
            |h| {
                let q = j.integrate(&q, (h * &d).as_slice());
                dot(bar.as_slice(), &j.frame_velocity(&q, v.as_slice()))
            },
            c * dot(&q_bar, d.as_slice()),
        )
    }))
}

fn joint_frame_bias(c: f64) -> Outcome {
    all(turning_joints().iter().map(|j| {
        let n = j.velocities();
        let v = wavy(n, 0.4, 1.0);
        let (bar, d) = (wavy(n, 2.0, 1.0), wavy(n, 3.3, 0.3));
        let v_bar = j.frame_bias_vjp(v.as_slice(), bar.as_slice());
        along(
            |h| dot(bar.as_slice(), &j.frame_bias(&moved(v.as_slice(), h, &d))),
            c * dot(&v_bar, d.as_slice()),
        )
    }))
}

/// Every kind of joint, on the world and on other bodies.
pub fn tree() -> Tree {
    let place = |x: f64| {
        Pose::new(
            exp_matrix(&Vec3::new(0.3 * x, -0.2, 0.5)),
            Vec3::new(x, 0.4, -0.3 * x),
        )
    };
    let j = joints();
    Tree::new([
        (None, place(0.1), j[4].clone()),
        (Some(0), place(0.8), j[1].clone()),
        (Some(1), place(-0.6), j[3].clone()),
        (Some(0), place(0.5), j[2].clone()),
        (Some(3), place(0.4), j[0].clone()),
        (None, place(-1.2), j[2].clone()),
        (Some(5), place(0.7), j[4].clone()),
        (Some(6), place(0.2), Joint::Fixed.model()),
        (Some(0), place(1.3), j[5].clone()),
    ])
}

pub fn start(tree: &Tree) -> DVector<f64> {
    tree.integrate(&tree.origin(), &wavy(tree.velocities(), 0.3, 0.6))
}

fn tree_integrate(c: f64) -> Outcome {
    let tree = tree();
    let n = tree.velocities();
    let (q, xi) = (start(&tree), wavy(n, 1.1, 0.7));
    let end = tree.integrate(&q, &xi);
    let (bar, d) = (wavy(n, 2.0, 1.0), wavy(n, 3.3, 0.3));
    let (q_bar, xi_bar) = tree.integrate_vjp(&xi, &bar);
    let scalar = |x: DVector<f64>| bar.dot(&tree_displacement(&tree, &end, &x));
    along(
        |h| scalar(tree.integrate(&tree.integrate(&q, &(h * &d)), &xi)),
        c * q_bar.dot(&d),
    )
    .worst(along(
        |h| scalar(tree.integrate(&q, &(&xi + h * &d))),
        c * xi_bar.dot(&d),
    ))
}

fn tree_chart_rate(c: f64) -> Outcome {
    let tree = tree();
    let n = tree.velocities();
    let (xi, v) = (wavy(n, 1.1, 0.7), wavy(n, 0.4, 1.0));
    let (bar, d) = (wavy(n, 2.0, 1.0), wavy(n, 3.3, 0.3));
    let (xi_bar, v_bar) = tree.chart_rate_vjp(&xi, &v, &bar);
    along(
        |h| bar.dot(&tree.chart_rate(&(&xi + h * &d), &v)),
        c * xi_bar.dot(&d),
    )
    .worst(along(
        |h| bar.dot(&tree.chart_rate(&xi, &(&v + h * &d))),
        c * v_bar.dot(&d),
    ))
}

/// Coordinates, chart coordinates and momenta, each on its own.
fn chart_momentum(tree: &Tree, c: f64) -> Outcome {
    let n = tree.velocities();
    let (q, xi, hat) = (start(tree), wavy(n, 1.1, 0.7), wavy(n, 0.4, 1.0));
    let (bar, d) = (wavy(n, 2.0, 1.0), wavy(n, 3.3, 0.3));
    let bars = tree.chart_momentum_vjp(&q, &xi, &hat, &bar);
    let value = |q: &DVector<f64>, xi: &DVector<f64>, hat: &DVector<f64>| {
        bar.dot(&tree.chart_momentum(q, xi, hat))
    };
    let [q_slope, xi_slope, hat_slope] = bars.map(|b| b.dot(&d));
    let group = |name, slope, value| Group { name, slope, value };
    groups(
        vec![
            group(
                "q",
                q_slope,
                Box::new(|h: f64| value(&tree.integrate(&q, &(h * &d)), &xi, &hat)),
            ),
            group(
                "xi",
                xi_slope,
                Box::new(|h: f64| value(&q, &(&xi + h * &d), &hat)),
            ),
            group(
                "momentum",
                hat_slope,
                Box::new(|h: f64| value(&q, &xi, &(&hat + h * &d))),
            ),
        ],
        c,
    )
}

/// All four fields and the poses at once, with either kind of virtual velocity.
fn tree_reverse(c: f64) -> Outcome {
    let tree = tree();
    let (n, bodies) = (tree.velocities(), tree.links().len());
    let (q, v, z) = (start(&tree), wavy(n, 0.4, 1.0), wavy(n, 0.9, 1.0));
    let d = wavy(n, 3.3, 0.3);
    let six = |phase: f64| -> Vec<Vec6> {
        let x = wavy(6 * bodies, phase, 1.0);
        x.as_slice().chunks(6).map(Vec6::from_row_slice).collect()
    };
    let bar = Cotangents {
        pose: six(0.1),
        twist: six(1.2),
        virtual_twist: six(2.3),
        turning: six(3.4),
        bias: six(4.5),
    };
    let kinematics = tree.kinematics(&q);
    all([true, false].into_iter().flat_map(|user| {
        let virt = if user {
            Virtual::User(&z)
        } else {
            Virtual::Frame(&z)
        };
        let fields = tree.fields(&kinematics, &q, &v, virt);
        let (q_bar, v_bar) = tree.reverse(&kinematics, &v, virt, &fields, bar.clone());
        let scalar = |q: &DVector<f64>, v: &DVector<f64>| {
            let k = tree.kinematics(q);
            let f = tree.fields(&k, q, v, virt);
            let mut sum = 0.0;
            for b in 0..bodies {
                // Work of the wrench on the displacement from the start: to first order the
                // relative motion's (translation of the world origin, rotation vector).
                let step = k.poses[b].compose(&kinematics.poses[b].inverse());
                let m = step.rotation;
                let turn = 0.5 * hydrograd::adjoint::lie::unskew(&m);
                let moved = hydrograd::adjoint::lie::six(&step.translation, &turn);
                sum += bar.pose[b].dot(&moved)
                    + bar.twist[b].dot(&f.twist[b])
                    + bar.virtual_twist[b].dot(&f.virtual_twist[b])
                    + bar.turning[b].dot(&f.turning[b])
                    + bar.bias[b].dot(&f.bias[b]);
            }
            sum
        };
        let at = |h: f64| tree.integrate(&q, &(h * &d));
        let by_q = along(|h| scalar(&at(h), &v), c * q_bar.dot(&d));
        let by_v = along(|h| scalar(&q, &(&v + h * &d)), c * v_bar.dot(&d));
        [by_q, by_v]
    }))
}
