//! Every kernel on the device against the same sums over the scalar kernels of the CPU.

use super::fixture::*;
use hydrograd::adjoint::kernel::{
    flux, flux_gradient, flux_hessian_product, normal, normal_gradient, normal_hessian_product,
    potential, potential_gradient, potential_hessian_product,
};
use hydrograd::adjoint::lie::{Pose, Vec3, Vec6, angular, linear, six};
use hydrograd::boundary::Method;
use hydrograd::coupling::Exclusions;
use hydrograd::coupling::full::{Model, Preconditioner};
use hydrograd::gpu::Arithmetic;
use hydrograd::gpu::full::{Gpu, Probe};
use hydrograd::gpu::probe::Kernels;
use hydrograd::solver::Columns;
use std::sync::Arc;

/// A pair of a face and (the image of) a source, everything in the world frame.
pub struct Entry {
    pub target: usize,
    pub source: usize,
    pub image: usize,
    pub face: usize,
    pub column: usize,
    /// Position of the source.
    pub at: Vec3,
    /// Its displacement relative to the face's body.
    pub d: Vec3,
    /// Entries of K and P, their gradients and Hessian products; P is zero within a body.
    pub k: (f64, Vec3, Vec3),
    pub p: (f64, Vec3, Vec3),
}

/// Every pair.
fn entries(model: &Model, poses: &[Pose], z: &[Vec6], mut each: impl FnMut(Entry)) {
    for (t, target) in model.bodies.iter().enumerate() {
        let (b, pose) = (target, &poses[t]);
        for (number, image) in model.images.iter().enumerate() {
            for (c, source) in model.bodies.iter().enumerate() {
                if number == 0 && model.excluded.contains(t, c) {
                    continue;
                }
                let (linear_part, shift) = image.placement(&poses[c]);
                let motion = image.twist(&z[c]) - z[t];
                for (j, s) in source.sources.iter().enumerate() {
                    let at = linear_part * s + shift;
                    let d = linear(&motion) + angular(&motion).cross(&at);
                    let (s, ds) = (pose.apply_inverse(&at), pose.rotation.tr_mul(&d));
                    for i in 0..b.faces.len() {
                        let (corners, w) = (&b.faces.corners[i], b.row_weights[i]);
                        let (x, n) = (&b.faces.centres[i], &b.faces.normals[i]);
                        let k = match b.settings.method {
                            Method::MfsVertex => (
                                flux(corners, w, &s),
                                flux_gradient(corners, w, &s),
                                flux_hessian_product(corners, w, &s, &ds),
                            ),
                            Method::MfsFace => (
                                normal(x, n, w, &s),
                                normal_gradient(x, n, w, &s),
                                normal_hessian_product(x, n, w, &s, &ds),
                            ),
                        };
                        let p = if number == 0 && t == c {
                            (0.0, Vec3::zeros(), Vec3::zeros())
                        } else {
                            (
                                potential(x, &s),
                                potential_gradient(x, &s),
                                potential_hessian_product(x, &s, &ds),
                            )
                        };
                        let turn = |(v, g, h): (f64, Vec3, Vec3)| {
                            (v, pose.rotation * g, pose.rotation * h)
                        };
                        each(Entry {
                            target: t,
                            source: c,
                            image: number,
                            face: model.faces[t].start + i,
                            column: model.sources[c].start + j,
                            at,
                            d,
                            k: turn(k),
                            p: turn(p),
                        });
                    }
                }
            }
        }
    }
}

/// Two models: solid angles with walls, normal velocities with an excluded pair.
fn models() -> [Arc<Model>; 2] {
    let settings = tight(Preconditioner::Factors);
    [
        model(Method::MfsVertex, &[WALL], Exclusions::none(), settings),
        model(Method::MfsFace, &[], Exclusions::new([(0, 2)]), settings),
    ]
}

pub fn columns(rows: usize, columns: usize, phase: f64) -> Columns {
    Columns {
        rows,
        columns,
        data: wavy(rows * columns, phase),
    }
}

/// Largest accepted differences, relative to the largest number, in single precision and finer.
pub const LIMITS: [(Arithmetic, f64); 2] =
    [(Arithmetic::Single, 1e-5), (Arithmetic::Double, 1e-12)];
/// In two-float arithmetic.
pub const TWO: f64 = 1e-11;

/// Each arithmetic with a backend that has it, and its limit.
fn each_arithmetic(model: &Arc<Model>, mut check: impl FnMut(&Probe, Arithmetic, f64)) {
    let gpu = Gpu::new(context(), model).unwrap();
    let probe = Probe::new(&gpu, &poses()).unwrap();
    for (arithmetic, limit) in LIMITS {
        if arithmetic == Arithmetic::Single || context().fine() == arithmetic {
            check(&probe, arithmetic, limit);
        }
    }
    let gpu = Gpu::new(two_float(), model).unwrap();
    check(
        &Probe::new(&gpu, &poses()).unwrap(),
        Arithmetic::TwoFloat,
        TWO,
    );
}

pub fn close(what: &str, arithmetic: Arithmetic, got: &[f64], right: &[f64], limit: f64) {
    let found = difference(got, right);
    println!("{what} ({}): {found:.1e}", arithmetic.name());
    assert!(
        found <= limit,
        "{what} ({}): {found:.1e} past {limit:.0e}",
        arithmetic.name()
    );
}

/// A product in SI units: K or P (`potential`), or their transposes, or their tangents along z.
fn product(
    probe: &Probe,
    arithmetic: Arithmetic,
    (potential, transpose): (bool, bool),
    z: Option<&[Vec6]>,
    x: &Columns,
) -> Columns {
    let (length, weight, _) = probe.units();
    let unit = if potential { 1.0 / length } else { weight };
    let which = (potential, transpose);
    let mut out = probe.kernels().product(arithmetic, which, z, x).unwrap();
    out.data.iter_mut().for_each(|v| *v *= unit);
    out
}

/// K x, P x, Kᵀ y, Pᵀ y and their tangents.
pub struct Products {
    pub x: Columns,
    pub y: Columns,
    right: Vec<Vec<f64>>,
    back: Vec<Vec<f64>>,
}

impl Products {
    /// Of five columns, from rows, sources and all pairs.
    pub fn new(rows: usize, sources: usize, pairs: impl FnOnce(&mut dyn FnMut(Entry))) -> Self {
        let k = 5;
        let (x, y) = (columns(sources, k, 0.4), columns(rows, k, 1.7));
        let mut right = vec![vec![0.0; rows * k]; 4];
        let mut back = vec![vec![0.0; sources * k]; 4];
        pairs(&mut |e| {
            let own = e.target == e.source && e.image == 0;
            let slope = |g: &Vec3| if own { 0.0 } else { g.dot(&e.d) };
            let values = [e.k.0, e.p.0, slope(&e.k.1), slope(&e.p.1)];
            for (v, value) in values.iter().enumerate() {
                for c in 0..k {
                    right[v][e.face * k + c] += value * x.at(e.column, c);
                    back[v][e.column * k + c] += value * y.at(e.face, c);
                }
            }
        });
        Self { x, y, right, back }
    }

    /// Holds the kernels' against them, in units of K and P, displaced by z for the tangents.
    pub fn hold(&self, kernels: Kernels, a: Arithmetic, limit: f64, units: [f64; 2], z: &[Vec6]) {
        for (v, potential) in [false, true].into_iter().enumerate() {
            let of = |name: &str| format!("{} {name}", if potential { "P" } else { "K" });
            let both = [(false, &self.x, &self.right), (true, &self.y, &self.back)];
            for (transpose, x, right) in both {
                let name = match transpose {
                    true => "apply_transpose",
                    false => "apply",
                };
                let got = |z: Option<&[Vec6]>| {
                    let which = (potential, transpose);
                    let mut out = kernels.product(a, which, z, x).unwrap();
                    out.data.iter_mut().for_each(|x| *x *= units[v]);
                    out.data
                };
                close(&of(name), a, &got(None), &right[v], limit);
                let name = format!("{name}_jvp");
                close(&of(&name), a, &got(Some(z)), &right[2 + v], limit);
            }
        }
    }
}

/// K x, P x, Kᵀ y, Pᵀ y and their tangents.
pub fn products() {
    for model in models() {
        let z = displacement(model.bodies.len(), 0.9);
        let right = Products::new(model.rows(), model.columns(), |each| {
            entries(&model, &poses(), &z, each);
        });
        each_arithmetic(&model, |probe, a, limit| {
            let (length, weight, _) = probe.units();
            right.hold(probe.kernels(), a, limit, [weight, 1.0 / length], &z);
        });
    }
}

/// Bodies and image of every pair, its wrenches and their tangents.
type Wrenches = (Vec<[usize; 3]>, Vec<Vec6>, Vec<Vec6>);

/// The wrenches of all pairs in SI units, and their tangents with a displacement z.
fn wrenches(
    probe: &Probe,
    arithmetic: Arithmetic,
    z: Option<&[Vec6]>,
    left: &Columns,
    right: &Columns,
) -> Wrenches {
    let (length, weight, middle) = probe.units();
    let blocks = if z.is_some() { 5 } else { 3 };
    // Densities of boundary rows in the unit of the potential's.
    let left = Columns::from_fn(left.rows, left.columns, |i, c| {
        let potential = c / (left.columns / blocks) == 2;
        left.at(i, c) * if potential { 1.0 } else { weight * length }
    });
    let (pairs, values) = probe
        .kernels()
        .wrenches(arithmetic, z, (&left, right))
        .unwrap();
    let unit = 1.0 / (length * length);
    let spatial = |w: &[f64]| {
        let force = Vec3::new(w[0], w[1], w[2]) * unit;
        let moment = Vec3::new(w[3], w[4], w[5]) * (unit * length);
        six(&force, &(moment + middle.cross(&force)))
    };
    let all: Vec<Vec6> = values.chunks(6).map(spatial).collect();
    match z {
        None => (pairs, all, Vec::new()),
        Some(_) => (
            pairs,
            all.iter().step_by(2).copied().collect(),
            all.iter().skip(1).step_by(2).copied().collect(),
        ),
    }
}

/// Wrenches and their tangents of two columns.
pub fn derivatives() {
    for model in models() {
        let n = 2;
        let (rows, sources) = (model.rows(), model.columns());
        let (left, right) = (columns(rows, 5 * n, 2.2), columns(sources, 4 * n, 3.1));
        let z = displacement(model.bodies.len(), 0.2);
        let images = model.images.len();
        let bodies = model.bodies.len();
        let mut sums = vec![vec![(Vec6::zeros(), Vec6::zeros()); n * n]; bodies * images * bodies];
        entries(&model, &poses(), &z, |e| {
            if e.target == e.source && e.image == 0 {
                return;
            }
            let pair = &mut sums[(e.target * images + e.image) * bodies + e.source];
            for x in 0..n {
                let l = |block: usize| left.at(e.face, block * n + x);
                for y in 0..n {
                    let r = |block: usize| right.at(e.column, block * n + y);
                    let q = l(2) * e.p.1 - l(0) * e.k.1;
                    let rho = l(1) * e.k.1;
                    let dq = l(2) * e.p.2 - l(0) * e.k.2 - l(3) * e.k.1;
                    let drho = l(1) * e.k.2 + l(4) * e.k.1;
                    let f = q * r(0) + rho * r(1);
                    let df = dq * r(0) + q * r(2) + drho * r(1) + rho * r(3);
                    let sum = &mut pair[x * n + y];
                    sum.0 += six(&f, &e.at.cross(&f));
                    sum.1 += six(&df, &(e.d.cross(&f) + e.at.cross(&df)));
                }
            }
        });
        let values = |pairs: &[[usize; 3]], tangent: bool| -> Vec<f64> {
            let of = |[target, source, image]: &[usize; 3]| {
                let sum = &sums[(target * images + image) * bodies + source];
                sum.iter()
                    .map(|s| if tangent { s.1 } else { s.0 })
                    .collect::<Vec<_>>()
            };
            flat(&pairs.iter().flat_map(of).collect::<Vec<_>>())
        };
        let part = |c: &Columns, n: usize| Columns::from_fn(c.rows, n, |i, k| c.at(i, k));
        each_arithmetic(&model, |probe, a, limit| {
            let (first, second) = (part(&left, 3 * n), part(&right, 2 * n));
            let (pairs, got, _) = wrenches(probe, a, None, &first, &second);
            close("pair_vjp", a, &flat(&got), &values(&pairs, false), limit);
            let (pairs, got, tangents) = wrenches(probe, a, Some(&z), &left, &right);
            let (first, second) = (values(&pairs, false), values(&pairs, true));
            close("pair_hvp, first", a, &flat(&got), &first, limit);
            close("pair_hvp", a, &flat(&tangents), &second, limit);
        });
    }
}

/// The refined solve of random right-hand sides, with every preconditioner.
pub fn solves() {
    for preconditioner in [
        Preconditioner::Factors,
        Preconditioner::Jacobi,
        Preconditioner::Csd24,
    ] {
        let mut settings = tight(preconditioner);
        settings.tolerance = 1e-10;
        let model = match preconditioner {
            Preconditioner::Factors => {
                model(Method::MfsVertex, &[WALL], Exclusions::none(), settings)
            }
            _ => small(&[WALL], settings),
        };
        let poses = &poses()[..model.bodies.len()];
        let g = columns(model.columns(), 4, 5.5);
        for context in [context(), two_float()] {
            let gpu = Gpu::new(context, &model).unwrap();
            let probe = Probe::new(&gpu, poses).unwrap();
            // KᵀK x + D² x is made in the fine arithmetic, apart from the solve.
            let (mut x, reached) = probe.normal_solve(&g).unwrap();
            let weight = probe.units().1;
            x.data.iter_mut().for_each(|v| *v /= weight * weight);
            let a = context.fine();
            let kx = product(&probe, a, (false, false), None, &x);
            let mut back = product(&probe, a, (false, true), None, &kx);
            let damping = model.bodies.iter().flat_map(|b| &b.damping);
            for (j, d) in damping.enumerate() {
                for k in 0..4 {
                    back.data[j * 4 + k] += d * d * x.at(j, k);
                }
            }
            println!("{preconditioner:?}: {reached:?}");
            close("solve", a, &back.data, &g.data, 1e-8);
        }
    }
}
