//! What bodies that move are in the water: solves, and answers that are kept.
//!
//! An answer is linear in the twists. Of others that are known at the same poses the nearest sum is a first guess, of which a solve finds what it lacks: little where a velocity
//! differs from a known one by known steps.

use super::Scattering;
use super::kept::{Answer, Kept, Told};
use super::levels::Levels;
use super::quotients::Quotients;
use super::scattered::{Scattered, plus};
use super::unlike::{Both, count_twists};
use crate::adjoint::lie::Vec6;
use crate::coupling::CouplingReport;
use crate::coupling::reduced::FLUX;
use crate::coupling::settings::met;
use crate::solver::{Columns, gmres_beside};
use crate::{Error, Result};
use nalgebra::DVector;
use std::cell::RefCell;
use std::sync::{Arc, MutexGuard, PoisonError};

const ITERATIONS: usize = 300;
const RESTART: usize = 60;
/// Of a body's largest added mass what any motion of it counts at least.
const LEAST: f64 = 1e-6;
/// Part of a twist that must be left of it beside others for it to be another direction.
const APART: f64 = 1e-3;
/// Of no motion, how near a sum of answers has to be to be a first guess.
const NEARER: f64 = 0.5;
/// Of the size of modes the least that what they answer has.
const ASKED: f64 = 0.3;
/// Coarsest relative residual of a solve whose absolute one is asked for.
const COARSE: f64 = 1e-2;

/// Below zero, in the energy of the water displaced, that of the water shows that there is no flow: levels leave out less.
const NEGATIVE: f64 = 1e-3;
/// What to do where compressed bodies aren't resolved.
const UNRESOLVED: &str = "bodies are nearer than their compressed sources resolve, or overlap: keep them apart by contact, let films stand in their gaps, or give a smaller \
                          resolved_gap";

/// A sum of answers.
struct Sum {
    twists: DVector<f64>,
    modes: Vec<f64>,
    left: Vec<f64>,
    exchanged: DVector<f64>,
}

/// The solution of a system, and what it makes seen: of the modes, and as impulses (body frames, unit density).
pub(super) struct Solved {
    pub x: Vec<f64>,
    pub seen: Vec<f64>,
    pub impulses: DVector<f64>,
}

impl Solved {
    /// Nothing, of the sizes of others.
    pub(super) fn none(x: &[f64], seen: &[f64], impulses: usize) -> Self {
        Self {
            x: vec![0.0; x.len()],
            seen: vec![0.0; seen.len()],
            impulses: DVector::zeros(impulses),
        }
    }
}

impl Scattering {
    /// Numbers of what is kept of an answer ([`Told`]).
    pub fn told_numbers(&self) -> usize {
        3 * 6 * self.bodies.len() + 2 * self.mode_count()
    }
}

impl Scattered<'_> {
    pub(super) fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What solves cost so far, and the largest residual, of those to a coarser goal as if they had gone on to the levels' as well as to theirs.
    pub fn report(&self) -> CouplingReport {
        self.kept().report.clone()
    }

    /// How the exchange is cut into levels.
    pub fn levels(&self) -> &Levels {
        &self.model.levels
    }

    /// Whether all solves so far met their tolerance.
    ///
    /// # Errors
    /// [`Error::Solver`] for the first that didn't, and whatever befell sums that are made elsewhere.
    pub fn check(&self) -> Result<()> {
        let mut kept = self.kept();
        if let Some(lost) = kept.lost.take() {
            return Err(lost);
        }
        if let Some((quantity, value)) = kept.negative {
            return Err(Error::Unresolved {
                place: match self.nearest() {
                    Some([a, b]) => format!(
                        "body {:?} and body {:?}, the nearest of {}",
                        self.model.names[a],
                        self.model.names[b],
                        self.model.names.len()
                    ),
                    None => "exchange between many bodies".into(),
                },
                quantity: quantity.into(),
                value,
                limit: 0.0,
                remedy: UNRESOLVED.into(),
            });
        }
        match kept.failed {
            None => Ok(()),
            Some((iterations, residual)) => Err(Error::Solver {
                what: match self.nearest() {
                    Some([a, b]) => format!(
                        "exchange between {} bodies, nearest to each other {:?} and {:?}",
                        self.model.names.len(),
                        self.model.names[a],
                        self.model.names[b]
                    ),
                    None => "exchange between many bodies".into(),
                },
                iterations,
                residual,
                tolerance: self.model.levels.tolerance,
                remedy: UNRESOLVED.into(),
            }),
        }
    }

    /// a = Lᵀ(ψ + Ĝ L a), from what else the modes see.
    pub(super) fn scattered(&self, right: &[f64]) -> Solved {
        self.scattered_to(right, [self.model.levels.tolerance; 2])
    }

    /// The same to relative residuals.
    fn scattered_to(&self, right: &[f64], goal: Both) -> Solved {
        let still = DVector::zeros(6 * self.model.bodies.len());
        let sums = self.making();
        let quotients = RefCell::new(Quotients::default());
        let seen = |a: &[f64]| {
            let (modes, impulses) = self.exchanged(&sums, &still, a);
            quotients.borrow_mut().push(a, &plus(a, -1.0, &modes));
            (modes, impulses)
        };
        let found = self.solve(right, goal, seen, |modes, _| modes.to_vec());
        if let Some(below) = quotients.into_inner().negative() {
            let quantity = "smallest eigenvalue of I − LᵀGL, at most";
            self.kept().negative.get_or_insert((quantity, below));
        }
        found
    }

    /// The relative residuals of a solve from `right` whose absolute ones are given.
    pub(super) fn relative(&self, goal: Both, right: &[f64]) -> Both {
        let (sizes, full) = (self.model.both(right), self.model.levels.tolerance);
        [0, 1].map(|k| match sizes[k] > 0.0 {
            true => (goal[k] / sizes[k]).min(COARSE).max(full),
            false => full,
        })
    }

    /// x with x = right + f(what x makes seen), both linear, to relative residuals. What is seen of the directions of the search adds up to what is seen of x, at no further product.
    pub(super) fn solve(
        &self,
        right: &[f64],
        goal: Both,
        seen: impl Fn(&[f64]) -> (Vec<f64>, DVector<f64>),
        f: impl Fn(&[f64], &DVector<f64>) -> Vec<f64>,
    ) -> Solved {
        let model = self.model;
        let first = self.search((right, goal[0], 1.0), |_| 1.0, &seen, &f);
        let Some(weights) = &model.unlike else {
            return first;
        };
        // What the small among unlike bodies still lack.
        let lacking = plus(right, 1.0, &f(&first.seen, &first.impulses));
        let lacking = plus(&lacking, -1.0, &first.x);
        let part = model.both(&lacking)[1] / model.both(right)[1];
        // Nothing where nothing was asked for, or what isn't a number was found.
        if !(part > goal[1] && part.is_finite()) {
            return first;
        }
        let asked = (&lacking[..], goal[1] / part, part);
        let more = self.search(asked, |b| weights[b], &seen, &f);
        Solved {
            x: plus(&first.x, 1.0, &more.x),
            seen: plus(&first.seen, 1.0, &more.seen),
            impulses: first.impulses + more.impulses,
        }
    }

    /// The same where every body counts so many times, to one relative residual; with the part that the right-hand side is of what was asked for first.
    fn search(
        &self,
        (right, goal, part): (&[f64], f64, f64),
        weight: impl Fn(usize) -> f64,
        seen: &impl Fn(&[f64]) -> (Vec<f64>, DVector<f64>),
        f: &impl Fn(&[f64], &DVector<f64>) -> Vec<f64>,
    ) -> Solved {
        let column = |data: Vec<f64>| Columns {
            rows: data.len(),
            columns: 1,
            data,
        };
        let apply = |v: &Columns, _: &[usize]| {
            let x = self.model.counted(&v.data, |b| 1.0 / weight(b));
            let (modes, impulses) = seen(&x);
            let image = plus(&x, -1.0, &f(&modes, &impulses));
            let image = self.model.counted(&image, &weight);
            let beside = [&x, &modes, impulses.as_slice()].concat();
            [column(beside), column(image)]
        };
        let modes = self.model.mode_count();
        let beside = modes + 6 * self.model.bodies.len();
        let right = column(self.model.counted(right, &weight));
        let found = gmres_beside(apply, beside, &right, goal, ITERATIONS, RESTART);
        // As if the levels' was asked for.
        let tolerance = self.model.levels.tolerance;
        let residual = found.residual * (tolerance / goal);
        let mut kept = self.kept();
        kept.report.iterations = kept.report.iterations.max(found.iterations);
        kept.report.residual = kept.report.residual.max(residual);
        if !met(residual, tolerance) && kept.failed.is_none() {
            kept.failed = Some((found.iterations, part * found.residual));
        }
        let mut x = found.x.data;
        let mut seen = x.split_off(right.rows);
        let impulses = DVector::from_vec(seen.split_off(modes));
        Solved { x, seen, impulses }
    }

    /// About the root of twice the energy of twists, each alone and axis by axis, at unit density.
    fn size(&self, twists: &DVector<f64>) -> Both {
        self.model.both_of_twists(self.weighed(twists).as_slice())
    }

    /// Of the water that the shapes move or, where it is more, what is given in the place of it: charges know of shapes alone. What moves hardly any water, such as a ball's spin,
    /// counts a little.
    fn weighed(&self, twists: &DVector<f64>) -> DVector<f64> {
        let (own, sizes) = (self.model.own(), &self.model.sizes);
        let mut out = twists.clone();
        for (b, twist) in out.as_mut_slice().chunks_exact_mut(6).enumerate() {
            let shape = self.model.bodies[b].parts().added_mass.diagonal();
            let diagonal = own[b].diagonal().sup(&shape);
            let most = diagonal.rows(0, 3).max();
            for (i, x) in twist.iter_mut().enumerate() {
                let least = LEAST * most * if i < 3 { 1.0 } else { sizes[b] * sizes[b] };
                *x *= diagonal[i].max(least).sqrt();
            }
        }
        out
    }

    /// The same where all bodies count alike.
    fn weighed_alike(&self, twists: &DVector<f64>) -> DVector<f64> {
        let mut out = self.weighed(twists);
        if let Some(weights) = &self.model.unlike {
            count_twists(out.as_mut_slice(), |b| weights[b]);
        }
        out
    }

    /// The sum of known answers that is nearest to these twists; none where it is no nearer than no motion.
    fn known(&self, twists: &DVector<f64>) -> Option<Sum> {
        let known = self.kept().answers.clone();
        // Orthonormal sums of theirs, each with its coefficients.
        let mut basis: Vec<[DVector<f64>; 2]> = Vec::new();
        for (k, answer) in known.iter().enumerate() {
            let mut direction = self.weighed_alike(&answer.solved);
            let size = direction.norm();
            let mut sum = DVector::zeros(known.len());
            sum[k] = 1.0;
            // Once more for what rounding left.
            for _ in 0..2 {
                for [other, of] in &basis {
                    let along = direction.dot(other);
                    direction -= along * other;
                    sum -= along * of;
                }
            }
            let norm = direction.norm();
            if norm > APART * size {
                basis.push([direction / norm, sum / norm]);
            }
        }
        let wanted = self.weighed_alike(twists);
        let mut sum = DVector::zeros(known.len());
        for [direction, of] in &basis {
            sum += direction.dot(&wanted) * of;
        }
        let mut out = Sum {
            twists: DVector::zeros(twists.len()),
            modes: vec![0.0; self.model.mode_count()],
            left: vec![0.0; self.model.mode_count()],
            exchanged: DVector::zeros(twists.len()),
        };
        for (answer, weight) in known.iter().zip(sum.iter()).filter(|(_, w)| **w != 0.0) {
            out.twists.axpy(*weight, &answer.solved, 1.0);
            add(*weight, &answer.modes, &mut out.modes);
            add(*weight, &answer.left, &mut out.left);
            out.exchanged.axpy(*weight, &answer.exchanged, 1.0);
        }
        let rest = self.weighed_alike(&(twists - &out.twists));
        let nearer = rest.norm() <= NEARER * wanted.norm();
        (!known.is_empty() && nearer).then_some(out)
    }

    /// The answer to body-frame twists.
    pub fn respond(&self, twists: &DVector<f64>) -> Arc<Answer> {
        if let Some(known) = self.kept().found(twists) {
            return known;
        }
        let none = vec![0.0; self.model.mode_count()];
        if twists.iter().all(|x| *x == 0.0) {
            return self.keep(Told {
                exchanged: twists.clone(),
                twists: twists.clone(),
                solved: twists.clone(),
                left: none.clone(),
                modes: none,
            });
        }
        let (sums, tolerance) = (self.making(), self.model.levels.tolerance);
        let (modes, (seen, exchanged)) = match self.known(twists) {
            None => {
                let (right, moved) = self.exchanged(&sums, twists, &none);
                let found = self.scattered(&right);
                let seen = plus(&right, 1.0, &found.seen);
                (found.x, (seen, moved + found.impulses))
            }
            Some(near) => {
                let rest = twists - &near.twists;
                let (lacks, size) = (self.size(&rest), self.size(twists));
                let left = self.model.both(&near.left);
                let lacking = |k: usize| lacks[k] + FLUX.sqrt() * left[k] > tolerance * size[k];
                if lacking(0) || lacking(1) {
                    let (seen, moved) = self.exchanged(&sums, &rest, &none);
                    let right = plus(&seen, -1.0, &near.left);
                    let modes = self.model.both(&near.modes);
                    let goal = self.relative(modes.map(|size| tolerance * ASKED * size), &right);
                    let found = self.scattered_to(&right, goal);
                    // What the sum sees is its modes but for what is left of them, which the right-hand side has.
                    let seen = plus(&plus(&near.modes, 1.0, &right), 1.0, &found.seen);
                    let modes = plus(&near.modes, 1.0, &found.x);
                    (modes, (seen, near.exchanged + moved + found.impulses))
                } else {
                    let seen = self.exchanged(&sums, twists, &near.modes);
                    (near.modes, seen)
                }
            }
        };
        let left = plus(&modes, -1.0, &seen);
        let told = Told {
            exchanged,
            twists: twists.clone(),
            solved: twists.clone(),
            modes,
            left,
        };
        self.look(&told);
        self.keep(told)
    }

    /// Looks whether the water has energy: a search finds solutions of systems that have no sense as well.
    pub(super) fn look(&self, told: &Told) {
        let (mut own, mut displaced) = (0.0, 0.0);
        // What the shapes have, whatever is given in the place of it.
        for (b, body) in self.model.bodies.iter().enumerate() {
            let twist: Vec6 = told.twists.fixed_rows::<6>(6 * b).into_owned();
            own += twist.dot(&(body.parts().added_mass * twist));
            displaced += body.displaced(&twist);
        }
        let energy = own + told.twists.dot(&told.exchanged);
        if energy < -NEGATIVE * displaced {
            let mut kept = self.kept();
            let quantity = "energy of the water, in that of the water displaced";
            kept.negative.get_or_insert((quantity, energy / displaced));
        }
    }

    pub(super) fn keep(&self, told: impl Into<Arc<Told>>) -> Arc<Answer> {
        let told = told.into();
        let charges = self.charges(&told.twists, &told.modes);
        let answer = Arc::new(Answer { charges, told });
        self.kept().keep(answer.clone());
        answer
    }

    /// What is known of the answer to these body-frame twists.
    pub fn told_of(&self, twists: &DVector<f64>) -> Option<Arc<Told>> {
        self.kept().told(twists)
    }

    /// Knows an answer from the same poses again.
    pub fn recall(&self, told: &Arc<Told>) {
        if self.told_of(&told.twists).is_none() {
            self.keep(told.clone());
        }
    }
}

/// `to` + `weight` x.
pub(super) fn add(weight: f64, x: &[f64], to: &mut [f64]) {
    for (to, x) in to.iter_mut().zip(x) {
        *to += weight * x;
    }
}
