//! Bodies that may drift with the water: what a current carries along, and what isn't held against it.
//!
//! In a current U a tree of joints whose joint to the world lets it move along is at rest relative to the water when it drifts with it, at the velocity W: the part of U
//! along the translations that this joint allows, or zero where something drives it. The momenta that integrators carry are those relative to W,
//!
//! ```text
//! h'_b = I_b (V_b − W) + h_f      ḣ'_b = F_b + U ×* h_f + W ×* I_b (V_b − W) + wrenches
//! ```
//!
//! so that no step sees how fast all drift together. Frame momenta are taken about a point at rest; about one that drifts along they are, after the time τ,
//! (1 − τ D) p̂', with D p̂ = W ×* p̂ on the coordinates of a joint to the world (of a free one: (0, W × P)). D² = 0.

use crate::adjoint::lie::{Vec3, Vec6, angular, cross_motion, linear, six};
use crate::multibody::{Link, Tree};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Part of what is largest below which a number counts as zero.
const ZERO: f64 = 1e-10;

/// How the trees of a system drift.
#[derive(Clone, Debug, Default)]
pub struct Drift {
    /// W of each body.
    twists: Vec<Vec6>,
    /// Of each joint to the world that drifts: its velocities, and D on them.
    turning: Vec<(Range<usize>, DMatrix<f64>)>,
    /// The velocity at which all that may drift does, user coordinates.
    velocity: DVector<f64>,
    /// Whether everything may, along the whole current.
    whole: bool,
}

impl Drift {
    /// Of a tree in the current `current`, m/s; `is_free` says of which bodies nothing drives the joints.
    pub fn new(tree: &Tree, is_free: impl Fn(usize) -> bool, current: &Vec3) -> Self {
        let links = tree.links();
        let mut out = Self {
            twists: vec![Vec6::zeros(); links.len()],
            turning: Vec::new(),
            velocity: DVector::zeros(tree.velocities()),
            whole: true,
        };
        for (b, link) in links.iter().enumerate() {
            if let Some(parent) = link.parent {
                out.twists[b] = out.twists[parent];
                continue;
            }
            let along = match is_free(b) && tree.is_single(b) {
                true => along(link, current),
                false => None,
            };
            let Some(Along { hat, twist, matrix }) = along else {
                out.whole &= *current == Vec3::zeros();
                continue;
            };
            out.whole &= linear(&twist) == *current;
            out.twists[b] = twist;
            // X of a translation is the identity.
            out.velocity.as_mut_slice()[link.v.clone()].copy_from_slice(hat.as_slice());
            if matrix.iter().any(|x| *x != 0.0) {
                out.turning.push((link.v.clone(), matrix));
            }
        }
        out
    }

    /// W of body `b`, spatial twist.
    pub fn of(&self, b: usize) -> &Vec6 {
        &self.twists[b]
    }

    /// The velocity at which all that may drift does, user coordinates.
    pub fn velocity(&self) -> &DVector<f64> {
        &self.velocity
    }

    /// Whether all bodies may drift along with the whole of the current; also where there is none.
    pub fn is_whole(&self) -> bool {
        self.whole
    }

    /// Whether nothing drifts.
    pub fn is_none(&self) -> bool {
        self.twists.iter().all(|w| *w == Vec6::zeros())
    }

    /// Whether D isn't zero.
    pub fn turns(&self) -> bool {
        !self.turning.is_empty()
    }

    /// (1 + τ D) p̂: frame momenta about a point at rest, from those about one that has drifted from it for the time τ.
    pub fn carry(&self, time: f64, mut p: DVector<f64>) -> DVector<f64> {
        for (v, d) in &self.turning {
            let turned = d * p.rows(v.start, v.len());
            let mut own = p.rows_mut(v.start, v.len());
            own += time * turned;
        }
        p
    }

    /// Transpose of [`Drift::carry`].
    pub fn carry_back(&self, time: f64, mut bar: DVector<f64>) -> DVector<f64> {
        for (v, d) in &self.turning {
            let turned = d.tr_mul(&bar.rows(v.start, v.len()));
            let mut own = bar.rows_mut(v.start, v.len());
            own += time * turned;
        }
        bar
    }

    /// D p̂.
    pub fn turn(&self, p: &DVector<f64>) -> DVector<f64> {
        let mut out = DVector::zeros(p.len());
        for (v, d) in &self.turning {
            let turned = d * p.rows(v.start, v.len());
            out.rows_mut(v.start, v.len()).copy_from(&turned);
        }
        out
    }

    /// Transpose of [`Drift::turn`].
    pub fn turn_back(&self, bar: &DVector<f64>) -> DVector<f64> {
        let mut out = DVector::zeros(bar.len());
        for (v, d) in &self.turning {
            let turned = d.tr_mul(&bar.rows(v.start, v.len()));
            out.rows_mut(v.start, v.len()).copy_from(&turned);
        }
        out
    }
}

/// How a joint to the world drifts.
struct Along {
    /// Frame velocity.
    hat: DVector<f64>,
    /// W, spatial.
    twist: Vec6,
    /// D on the joint's frame momenta.
    matrix: DMatrix<f64>,
}

/// None where the joint's translations, if it has any, are across the current.
fn along(link: &Link, current: &Vec3) -> Option<Along> {
    let basis: Vec<Vec6> = (link.joint.basis().iter())
        .map(|b| link.placement.twist_to_world(b))
        .collect();
    let n = basis.len();
    if n == 0 {
        return None;
    }
    let turning = DMatrix::from_fn(3, n, |i, j| angular(&basis[j])[i]);
    let decomposed = turning.tr_mul(&turning).symmetric_eigen();
    let top = decomposed.eigenvalues.max().max(f64::MIN_POSITIVE);
    let kept: Vec<usize> = (0..n)
        .filter(|&k| decomposed.eigenvalues[k] <= ZERO * top.min(1.0))
        .collect();
    if kept.is_empty() {
        return None;
    }
    let still = decomposed.eigenvectors.select_columns(&kept);
    let moving = DMatrix::from_fn(3, n, |i, j| linear(&basis[j])[i]);
    let translations = &moving * &still;
    let solved = translations.svd(true, true).solve(current, ZERO).ok()?;
    let hat = DVector::from_column_slice((still * solved).as_slice());
    let found = &moving * &hat;
    let mut velocity = Vec3::new(found[0], found[1], found[2]);
    if velocity.norm() <= ZERO * current.norm() {
        return None;
    }
    if (velocity - current).norm() <= ZERO * current.norm() {
        velocity = *current;
    }
    let twist = six(&velocity, &Vec3::zeros());
    // W × Ŝ_i = Σ_k c_ki Ŝ_k, as the joint's motions are a group: Ŝ_iᵀ (W ×* H) = −Σ_k c_ki p̂_k.
    let columns = DMatrix::from_fn(6, n, |i, j| basis[j][i]);
    let turned = DMatrix::from_fn(6, n, |i, j| cross_motion(&twist, &basis[j])[i]);
    let c = columns.svd(true, true).solve(&turned, ZERO).ok()?;
    let size = c.amax();
    let matrix = DMatrix::from_fn(n, n, |i, k| match c[(k, i)] {
        x if x.abs() <= ZERO * size => 0.0,
        x => -x,
    });
    Some(Along { hat, twist, matrix })
}
