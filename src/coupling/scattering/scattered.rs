//! Many bodies at some poses: charges and impulses for twists, or for what recoils.

use super::Scattering;
use super::blocks::{Blocks, dot};
use super::pairs::{Near, Pairs};
use super::parts::of_each;
use super::places::{Places, length, minus};
use super::sums::{Gradient, Sums, dual};
use crate::adjoint::lie::{Mat6, Pose, Vec6};
use crate::adjoint::multipole;
use crate::coupling::CouplingReport;
use crate::coupling::isolated::Isolated;
use crate::coupling::reduced::FLUX;
use crate::coupling::settings::met;
use crate::solver::{Columns, gmres};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

const ITERATIONS: usize = 300;
const RESTART: usize = 60;
/// Answers kept: those to the velocity, to a virtual one and to what is driven, at both ends of a pair.
const KEPT: usize = 6;

/// Twists of all bodies as linear functions of a few coefficients: those of joints, and of a current.
pub trait Motions: Send + Sync {
    /// Body-frame twists (6 a body) for coefficients.
    fn twists(&self, coefficients: &DVector<f64>) -> DVector<f64>;

    /// Its transpose: what body-frame impulses are worth per coefficient.
    fn transposed(&self, impulses: &DVector<f64>) -> DVector<f64>;
}

/// What all bodies are in the water as they move.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Body-frame twists, 6 a body.
    pub twists: DVector<f64>,
    /// α, all points.
    pub charges: Vec<f64>,
    /// 4π Ūᵀ Ĝ α, body-frame impulses at unit density that the others add to each body's own.
    pub exchanged: DVector<f64>,
}

/// What [`Scattered::recoil`] finds.
#[derive(Clone, Debug)]
pub struct Recoiled {
    /// Impulses that others exchange with each body, body frames, unit density.
    pub exchanged: DVector<f64>,
    modes: Vec<f64>,
}

/// Many bodies at some poses.
pub struct Scattered<'a> {
    pub(super) model: &'a Scattering,
    pub(super) poses: Vec<Pose>,
    pub(super) pairs: Pairs,
    places: Places<f64>,
    blocks: Blocks,
    pub(super) motions: Box<dyn Motions + 'a>,
    kept: Mutex<Kept>,
}

#[derive(Default)]
struct Kept {
    answers: Vec<Arc<Answer>>,
    report: CouplingReport,
    failed: Option<(usize, f64)>,
}

impl Scattering {
    /// Places the bodies.
    ///
    /// # Errors
    /// [`Error::Input`] for another number of poses.
    pub fn place<'a>(
        &'a self,
        poses: &[Pose],
        motions: Box<dyn Motions + 'a>,
    ) -> Result<Scattered<'a>> {
        if poses.len() != self.bodies.len() {
            return Err(Error::input(
                "many bodies: poses",
                poses.len(),
                format!("must be {}, one a body", self.bodies.len()),
            ));
        }
        let places = Places::new(self, poses);
        let pairs = Pairs::new(&self.cells, &self.refused, &places, &self.levels);
        Ok(Scattered {
            blocks: Blocks::new(&Sums::new(self, &pairs, &places)),
            pairs,
            places,
            poses: poses.to_vec(),
            model: self,
            motions,
            kept: Mutex::default(),
        })
    }
}

impl<'a> Scattered<'a> {
    /// The bodies where they don't feel each other.
    pub fn alone(&self) -> &'a Isolated {
        self.model.alone()
    }
}

impl Scattered<'_> {
    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What moves the bodies.
    pub fn motions(&self) -> &dyn Motions {
        self.motions.as_ref()
    }

    /// The added mass of each body alone, at unit density (body frame, about its origin).
    pub fn own(&self) -> &[Mat6] {
        self.model.own()
    }

    /// What solves cost so far.
    pub fn report(&self) -> CouplingReport {
        self.kept().report.clone()
    }

    /// Whether all solves so far met their tolerance.
    ///
    /// # Errors
    /// [`Error::Solver`] for the first that didn't.
    pub fn check(&self) -> Result<()> {
        match self.kept().failed {
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
                remedy: "bodies are nearer than their compressed sources resolve, or overlap: keep them \
                         apart by contact, or give a smaller resolved_gap"
                    .into(),
            }),
        }
    }

    /// The two bodies whose points are nearest to each other against their sizes, of those that are seen point by point.
    fn nearest(&self) -> Option<[usize; 2]> {
        let model = self.model;
        let ratio = |near: &Near| {
            let [a, b] = near.bodies;
            let [x, y] = [a, b].map(|b| self.places.centres[model.cells.leaf[b]]);
            (model.sizes[a] + model.sizes[b]) / length(&minus(&x, &y))
        };
        let pairs = self.pairs.near.iter();
        let nearest = pairs.max_by(|a, b| ratio(a).total_cmp(&ratio(b)));
        // What a mirror shows of a body has its name.
        nearest.map(|near| near.bodies.map(|b| b % self.poses.len()))
    }

    fn sums(&self) -> Sums<'_, f64> {
        Sums::new(self.model, &self.pairs, &self.places)
    }

    /// [L, Ū]ᵀ ψ of every body: of the modes, and of the twists.
    fn projected(&self, potentials: &[f64]) -> (Vec<f64>, DVector<f64>) {
        let model = self.model;
        self.parted(&model.points, potentials, |_| true)
    }

    /// What modes and twists see, from what points or numbers do that stand in these ranges.
    fn parted(
        &self,
        ranges: &[Range<usize>],
        seen: &[f64],
        points: impl Fn(usize) -> bool + Sync,
    ) -> (Vec<f64>, DVector<f64>) {
        let model = self.model;
        let of_body = |b: usize| {
            let seen = &seen[ranges[b].clone()];
            match points(b) {
                true => products(model.bodies[b].basis(), seen),
                false => seen.to_vec(),
            }
        };
        let mut modes = Vec::with_capacity(model.mode_count());
        let mut impulses = DVector::zeros(6 * model.bodies.len());
        for (b, found) in of_each(model.bodies.len(), of_body).iter().enumerate() {
            let (own, moved) = found.split_at(model.bodies[b].modes());
            modes.extend_from_slice(own);
            for (k, sum) in moved.iter().enumerate() {
                impulses[6 * b + k] = FLUX * sum;
            }
        }
        (modes, impulses)
    }

    /// α = Ū x̄ + L a.
    fn charges(&self, twists: &DVector<f64>, modes: &[f64]) -> Vec<f64> {
        self.joined(twists, modes, |_| true)
    }

    /// The charges of some bodies' points, [a, x̄] of others.
    fn joined(
        &self,
        twists: &DVector<f64>,
        modes: &[f64],
        points: impl Fn(usize) -> bool + Sync,
    ) -> Vec<f64> {
        let model = self.model;
        let of_body = |b: usize| {
            let own = &modes[model.modes[b].clone()];
            let own = [own, &twists.as_slice()[6 * b..6 * b + 6]].concat();
            match points(b) {
                true => combined(model.bodies[b].basis(), &own),
                false => own,
            }
        };
        of_each(model.bodies.len(), of_body).concat()
    }

    /// [Lᵀ, 4π Ūᵀ] Ĝ (Ū x̄ + L a), by what few numbers see of each other.
    fn exchanged(
        &self,
        sums: &Sums<'_, f64>,
        twists: &DVector<f64>,
        modes: &[f64],
    ) -> (Vec<f64>, DVector<f64>) {
        let model = self.model;
        let points = |b: usize| model.carrier(b).is_none();
        let numbers = self.joined(twists, modes, points);
        self.parted(&model.numbers, &self.blocks.seen(sums, &numbers), points)
    }

    /// a = Lᵀ(ψ + Ĝ L a), from what else the modes see.
    fn scattered(&self, right: &[f64]) -> Vec<f64> {
        let still = DVector::zeros(6 * self.model.bodies.len());
        let sums = self.sums();
        self.solve(right, |a| self.exchanged(&sums, &still, a).0)
    }

    /// x with x = right + f(x).
    fn solve(&self, right: &[f64], f: impl Fn(&[f64]) -> Vec<f64>) -> Vec<f64> {
        let column = |data: Vec<f64>| Columns {
            rows: data.len(),
            columns: 1,
            data,
        };
        let apply = |v: &Columns, _: &[usize]| {
            let mut out = v.data.clone();
            for (out, x) in out.iter_mut().zip(f(&v.data)) {
                *out -= x;
            }
            [v.clone(), column(out)]
        };
        let tolerance = self.model.levels.tolerance;
        let found = gmres(
            apply,
            &column(right.to_vec()),
            tolerance,
            ITERATIONS,
            RESTART,
        );
        let mut kept = self.kept();
        kept.report.iterations = kept.report.iterations.max(found.iterations);
        kept.report.residual = kept.report.residual.max(found.residual);
        if !met(found.residual, tolerance) && kept.failed.is_none() {
            kept.failed = Some((found.iterations, found.residual));
        }
        found.x.data
    }

    /// The answer to body-frame twists.
    pub fn respond(&self, twists: &DVector<f64>) -> Arc<Answer> {
        if let Some(known) = self.kept().answers.iter().find(|a| a.twists == *twists) {
            return known.clone();
        }
        if twists.iter().all(|x| *x == 0.0) {
            return self.keep(Answer {
                charges: vec![0.0; self.model.point_count()],
                exchanged: twists.clone(),
                twists: twists.clone(),
            });
        }
        let sums = self.sums();
        let none = vec![0.0; self.model.mode_count()];
        let modes = self.scattered(&self.exchanged(&sums, twists, &none).0);
        self.keep(Answer {
            exchanged: self.exchanged(&sums, twists, &modes).1,
            charges: self.charges(twists, &modes),
            twists: twists.clone(),
        })
    }

    fn keep(&self, answer: Answer) -> Arc<Answer> {
        let answer = Arc::new(answer);
        let mut kept = self.kept();
        if kept.answers.len() >= KEPT {
            kept.answers.remove(0);
        }
        kept.answers.push(answer.clone());
        answer
    }

    /// What the bodies are where impulses are given: their twists (body frames) are `first` − `recoil`(the impulses that others exchange with each, at unit density),
    /// `recoil` linear and `scale` about the root of each twist's inertia at unit density. One system with one right-hand side.
    pub fn recoil(
        &self,
        first: &DVector<f64>,
        scale: &DVector<f64>,
        recoil: impl Fn(&DVector<f64>) -> DVector<f64>,
    ) -> Recoiled {
        let (m, n) = (self.model.mode_count(), first.len());
        let unit = FLUX.sqrt();
        let sums = self.sums();
        // Modes and twists in units of about the root of their energy.
        let modes = |x: &[f64]| -> Vec<f64> { x[..m].iter().map(|a| a / unit).collect() };
        let seen = |x: &[f64]| {
            let twists = DVector::from_fn(n, |i, _| x[m + i] / scale[i]);
            self.exchanged(&sums, &twists, &modes(x))
        };
        let next = |(modes, impulses): (Vec<f64>, DVector<f64>)| -> Vec<f64> {
            let twists = recoil(&impulses);
            let modes = modes.into_iter().map(|a| unit * a);
            let twists = twists.iter().zip(scale.iter()).map(|(t, s)| -t * s);
            modes.chain(twists).collect()
        };
        let mut start = vec![0.0; m];
        start.extend(first.iter().zip(scale.iter()).map(|(t, s)| t * s));
        let x = self.solve(&start, |x| next(seen(x)));
        Recoiled {
            exchanged: seen(&x).1,
            modes: modes(&x),
        }
    }

    /// Keeps what recoiled as the answer to the twists that follow from it.
    pub fn settle(&self, twists: DVector<f64>, recoiled: Recoiled) -> Arc<Answer> {
        self.keep(Answer {
            charges: self.charges(&twists, &recoiled.modes),
            exchanged: recoiled.exchanged,
            twists,
        })
    }

    /// 4π αᵀ δĜ α as spatial wrenches.
    pub(super) fn gradient(&self, charges: &[f64]) -> Vec<Vec6> {
        let found = self.sums().gradient(charges).wrenches();
        found.into_iter().map(|w| 2.0 * FLUX * w).collect()
    }

    /// 4π α_xᵀ δĜ α_y as spatial wrenches.
    pub(super) fn pull_back(&self, x: &[f64], y: &[f64]) -> Vec<Vec6> {
        if x == y {
            return self.gradient(x);
        }
        let [sum, difference] = [1.0, -1.0].map(|sign| self.gradient(&plus(x, sign, y)));
        mixed(&sum, &difference)
    }

    /// The places as the bodies are displaced.
    pub(super) fn moving(&self, z: &[Vec6]) -> Places<Dual64> {
        Places::moving(self.model, &self.poses, z)
    }

    /// `DĜ[Z] α`.
    pub(super) fn tangent_potentials(&self, places: &Places<Dual64>, charges: &[f64]) -> Vec<f64> {
        let still = vec![0.0; charges.len()];
        let sums = Sums::new(self.model, &self.pairs, places);
        let seen = sums.potentials(&dual(charges, &still));
        seen.iter().map(|x| x.eps).collect()
    }

    /// The gradient of ½ αᵀ Ĝ α as bodies are displaced and the charges change.
    pub(super) fn gradient_jvp<'p>(
        &'p self,
        places: &'p Places<Dual64>,
        charges: &[f64],
        rates: &[f64],
    ) -> Gradient<'p, Dual64> {
        Sums::new(self.model, &self.pairs, places).gradient(&dual(charges, rates))
    }

    /// Charges of these twists that answer further potentials with their own.
    pub(super) fn answering_beside(&self, twists: &DVector<f64>, potentials: &[f64]) -> Vec<f64> {
        let none = vec![0.0; self.model.mode_count()];
        let (mut right, _) = self.exchanged(&self.sums(), twists, &none);
        let (further, _) = self.projected(potentials);
        right.iter_mut().zip(further).for_each(|(x, y)| *x += y);
        self.charges(twists, &self.scattered(&right))
    }

    /// Charges that bodies that stand still answer potentials with, L a, a = Lᵀ(ψ + Ĝ L a).
    pub(super) fn answering(&self, potentials: &[f64]) -> Vec<f64> {
        let still = DVector::zeros(6 * self.model.bodies.len());
        self.charges(&still, &self.scattered(&self.projected(potentials).0))
    }

    /// 4π Ūᵀ(ψ + Ĝ α), α those charges.
    pub(super) fn impulses_answered(&self, potentials: &[f64]) -> DVector<f64> {
        let still = DVector::zeros(6 * self.model.bodies.len());
        let (right, impulses) = self.projected(potentials);
        let answered = self.scattered(&right);
        impulses + self.exchanged(&self.sums(), &still, &answered).1
    }

    /// 4π Ūᵀ ψ.
    pub(super) fn impulses_of(&self, potentials: &[f64]) -> DVector<f64> {
        self.projected(potentials).1
    }

    /// M̄ x̄: with each body's own.
    pub fn impulses(&self, answer: &Answer) -> DVector<f64> {
        let mut out = answer.exchanged.clone();
        self.add_own(&answer.twists, &mut out);
        out
    }

    /// Adds each body's own impulses.
    pub(super) fn add_own(&self, twists: &DVector<f64>, out: &mut DVector<f64>) {
        for (b, own) in self.model.own().iter().enumerate() {
            let own: &Mat6 = own;
            let twist = twists.fixed_rows::<6>(6 * b).into_owned();
            let mut rows = out.fixed_rows_mut::<6>(6 * b);
            rows += own * twist;
        }
    }
}

/// Aᵀ x, column by column.
fn products(a: &DMatrix<f64>, x: &[f64]) -> Vec<f64> {
    let columns = a.as_slice().chunks_exact(x.len());
    multipole::vectorized(
        #[inline(always)]
        || columns.map(|column| dot(column, x)).collect(),
    )
}

/// A x.
fn combined(a: &DMatrix<f64>, x: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; a.nrows()];
    multipole::vectorized(
        #[inline(always)]
        || {
            for (x, column) in x.iter().zip(a.as_slice().chunks_exact(out.len())) {
                for (out, a) in out.iter_mut().zip(column) {
                    *out += x * a;
                }
            }
        },
    );
    out
}

/// x + `sign` y.
pub(super) fn plus(x: &[f64], sign: f64, y: &[f64]) -> Vec<f64> {
    let each = x.iter().zip(y);
    each.map(|(x, y)| x + sign * y).collect()
}

/// Of a quadratic form's values at x + y and at x − y its bilinear one's at x and y.
pub(super) fn mixed(sum: &[Vec6], difference: &[Vec6]) -> Vec<Vec6> {
    let each = sum.iter().zip(difference);
    each.map(|(s, d)| 0.25 * (s - d)).collect()
}
