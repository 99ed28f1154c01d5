//! What bodies are in the water where impulses are given, from which they recoil.

use super::answers::{Solved, add};
use super::kept::{Answer, Near, Told};
use super::scattered::{Scattered, plus};
use super::unlike::norm;
use crate::coupling::reduced::FLUX;
use nalgebra::DVector;
use std::sync::Arc;

/// What [`Scattered::recoil`] finds.
#[derive(Clone, Debug)]
pub struct Recoiled {
    /// Impulses that others exchange with each body, body frames, unit density.
    pub exchanged: DVector<f64>,
    /// Those of them that bodies recoil from: not those of films that move with them ([`Own::films`]).
    pub recoiling: DVector<f64>,
    /// What is left of the system's equations: of the modes, then of the twists, in units of about the root of their energy.
    pub left: Vec<f64>,
    /// Whether there are others.
    films: bool,
    /// Body-frame twists.
    twists: DVector<f64>,
    modes: Vec<f64>,
    /// a − Lᵀ Ĝ α.
    lacked: Vec<f64>,
}

impl Recoiled {
    /// What the modes do.
    pub(super) fn modes(&self) -> &[f64] {
        &self.modes
    }

    /// As an answer to these twists.
    fn told(self, twists: DVector<f64>) -> Told {
        Told {
            exchanged: self.exchanged,
            twists,
            solved: self.twists,
            modes: self.modes,
            left: self.lacked,
        }
    }
}

/// How bodies recoil by themselves.
#[derive(Clone, Copy)]
pub struct Own<'r> {
    /// About the root of the inertia of each body-frame twist, at unit density.
    pub scale: &'r DVector<f64>,
    /// What impulses (body frames, unit density) change of the twists: linear.
    pub recoil: &'r dyn Fn(&DVector<f64>) -> DVector<f64>,
    /// Whether the inertia that recoils has what films weigh.
    pub films: bool,
}

/// The residual at which a solve ends, in units of about the root of an energy.
#[derive(Clone, Copy, Debug)]
pub enum Goal {
    /// That of the levels.
    Full,
    /// Relative to what the solve starts from.
    Relative(f64),
    /// So much, but relative to what the solve starts from no finer than [`Goal::Full`], and no coarser than a hundredth.
    Absolute(f64),
}

impl Scattered<'_> {
    /// The next to recoil begins from what was told at poses nearby, with the twists of the same motion here.
    pub fn begin_near(&self, told: &Told, twists: DVector<f64>) {
        let modes = told.modes.clone();
        self.kept().near = Some(Near { twists, modes });
    }

    /// What the bodies are where impulses are given: their twists (body frames) are `first` less what they recoil from the impulses that others exchange with each.
    /// One system with one right-hand side, to which `behind` is added if there is any,
    /// of the modes or of modes and twists, in the units of [`Recoiled::left`]: what was left of an earlier one, or what else the modes see.
    pub fn recoil(
        &self,
        first: &DVector<f64>,
        behind: Option<&[f64]>,
        own: &Own<'_>,
        goal: Goal,
    ) -> Recoiled {
        let (m, n) = (self.model.mode_count(), first.len());
        let unit = FLUX.sqrt();
        let sums = self.making();
        let Own { scale, recoil, .. } = own;
        let exchanged = |twists: &DVector<f64>, modes: &[f64]| match own.films {
            true => self.exchanged_beside_films(&sums, twists, modes),
            false => self.exchanged(&sums, twists, modes),
        };
        // Modes and twists in units of about the root of their energy.
        let modes = |x: &[f64]| -> Vec<f64> { x[..m].iter().map(|a| a / unit).collect() };
        let twists = |x: &[f64]| DVector::from_fn(n, |i, _| x[m + i] / scale[i]);
        let seen = |x: &[f64]| exchanged(&twists(x), &modes(x));
        let next = |modes: &[f64], impulses: &DVector<f64>| -> Vec<f64> {
            let twists = recoil(impulses);
            let modes = modes.iter().map(|a| unit * a);
            let twists = twists.iter().zip(scale.iter()).map(|(t, s)| -t * s);
            modes.chain(twists).collect()
        };
        let mut start = vec![0.0; m];
        start.extend(first.iter().zip(scale.iter()).map(|(t, s)| t * s));
        if let Some(behind) = behind {
            add(1.0, behind, &mut start);
        }
        let full = self.model.levels.tolerance;
        let goal = match goal {
            Goal::Full => [full; 2],
            Goal::Relative(goal) => [goal; 2],
            // Where all count alike nothing is smaller.
            Goal::Absolute(goal) => self.relative([goal; 2], &start),
        };
        let near = self.kept().near.take();
        let near = near.and_then(|Near { twists, modes }| {
            let (own, moved) = exchanged(&twists, &modes);
            let modes = modes.iter().map(|a| unit * a);
            let twists = twists.iter().zip(scale.iter()).map(|(t, s)| t * s);
            let x: Vec<f64> = modes.chain(twists).collect();
            let right = plus(&plus(&start, 1.0, &next(&own, &moved)), -1.0, &x);
            // No nearer than nothing is of no use; nor is what isn't a number.
            let nearer = norm(&right) < norm(&start);
            nearer.then_some((x, own, moved, right))
        });
        let Solved { x, seen, impulses } = match near {
            None => self.solve(&start, goal, seen, next),
            Some((x, own, moved, right)) => {
                let (all, lacked) = (self.model.both(&start), self.model.both(&right));
                let goal = [0, 1].map(|k| goal[k] * all[k] / lacked[k]);
                let found = match goal.iter().any(|goal| *goal < 1.0) {
                    true => self.solve(&right, goal, seen, next),
                    false => Solved::none(&x, &own, moved.len()),
                };
                Solved {
                    x: plus(&x, 1.0, &found.x),
                    seen: plus(&own, 1.0, &found.seen),
                    impulses: moved + found.impulses,
                }
            }
        };
        let left = plus(&plus(&start, 1.0, &next(&seen, &impulses)), -1.0, &x);
        let (modes, twists) = (modes(&x), twists(&x));
        let mut all = impulses.clone();
        if own.films {
            self.add_films(&twists, &mut all);
        }
        Recoiled {
            lacked: plus(&modes, -1.0, &seen),
            exchanged: all,
            recoiling: impulses,
            films: own.films,
            left,
            twists,
            modes,
        }
    }

    /// Keeps what recoiled as the answer to the twists that follow from it.
    pub fn settle(&self, twists: DVector<f64>, mut recoiled: Recoiled) -> Arc<Answer> {
        // Films pull on what the twists became, or momentum would be lost by what the search leaves times what they weigh.
        if recoiled.films {
            recoiled.exchanged.copy_from(&recoiled.recoiling);
            self.add_films(&twists, &mut recoiled.exchanged);
        }
        let told = recoiled.told(twists);
        self.look(&told);
        self.keep(told)
    }

    /// Keeps what recoiled as it is, to know more of what is near it.
    pub fn remember(&self, recoiled: Recoiled) {
        let twists = recoiled.twists.clone();
        self.keep(recoiled.told(twists));
    }
}
