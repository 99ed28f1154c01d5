//! M(q)⁻¹ of many bodies that feel each other, without M(q): what others exchange with each recoils in its own inertia.
//!
//! With the bodies' inertias alone, own added mass with them, M = M₀ + ρ Jᵀ H J, H v̄ the impulses that others exchange with each body. M v = p is v = M₀⁻¹ (p − ρ Jᵀ h), h = H J v, and
//! with M₀⁻¹ of each joint tree for itself ([`Articulated`](crate::multibody::Articulated)) the system is one in the charges ([`Scattered::recoil`]). Whatever else is added to M₀ and is easily divided by goes with it: contact that presses,
//! what turns and damps in an implicit stage.

use super::Evaluation;
use crate::adjoint::lie::{Mat6, Vec6};
use crate::coupling::Carried;
use crate::coupling::scattering::{self, Goal, Recoiled, Scattered};
use nalgebra::DVector;
use std::sync::Arc;

/// Least inertia, of a body's largest, that a twist is measured by.
const LEAST: f64 = 1e-6;
/// Part of a velocity's tolerance that a change of it may leave.
const CHANGE: f64 = 0.05;

/// v with M₀ v = the impulses given on the free velocities, and zero on driven ones.
type Solve<'a> = Box<dyn Fn(&DVector<f64>) -> DVector<f64> + Send + Sync + 'a>;

/// The inertia that recoils.
pub(super) struct Own<'a> {
    solve: Solve<'a>,
    /// Whether M₀ has what films between the bodies weigh, which is much more than the bodies where surfaces are near.
    films: bool,
}

impl<'a> Own<'a> {
    /// By what solves with it.
    pub fn new(
        films: bool,
        solve: impl Fn(&DVector<f64>) -> DVector<f64> + Send + Sync + 'a,
    ) -> Self {
        let solve = Box::new(solve);
        Self { solve, films }
    }
}

/// The factor of M(q), free rows and columns, of many bodies.
pub struct Recoiling<'a> {
    at: Arc<Scattered<'a>>,
    own: Own<'a>,
    /// About the root of the inertia of each body-frame twist, at unit density.
    scale: DVector<f64>,
    density: f64,
    /// Whether a current's coefficient stands behind the velocities.
    current: bool,
}

impl<'a> Recoiling<'a> {
    pub(super) fn new(evaluation: &Evaluation<'a>, at: &Arc<Scattered<'a>>, own: Own<'a>) -> Self {
        let system = evaluation.system;
        let density = evaluation.parameters.density();
        let mut scale = DVector::zeros(6 * system.coupling.bodies());
        for (b, w) in system.submerged() {
            let inertia: Mat6 = evaluation.rigid[b] / density + at.own()[w];
            let diagonal = inertia.diagonal();
            let most = [0, 3].map(|k| diagonal.rows(k, 3).max());
            for i in 0..6 {
                let least = LEAST * most[i / 3].max(f64::MIN_POSITIVE);
                scale[6 * w + i] = diagonal[i].max(least).sqrt();
            }
        }
        Self {
            at: at.clone(),
            own,
            scale,
            density,
            current: system.has_current(),
        }
    }

    /// Body-frame twists at velocities, water at rest.
    fn twists(&self, v: &DVector<f64>) -> DVector<f64> {
        match self.current {
            true => self.at.motions().twists(&v.push(0.0)),
            false => self.at.motions().twists(v),
        }
    }

    /// What exchanged impulses change of the velocities of bodies that answer alone.
    fn answered(&self, impulses: &DVector<f64>) -> DVector<f64> {
        let mut all = self.at.motions().transposed(impulses);
        if self.current {
            all = all.rows(0, all.len() - 1).into_owned();
        }
        (self.own.solve)(&(self.density * all))
    }

    /// What bodies recoil with, from a first velocity and to a residual.
    fn found(&self, start: &DVector<f64>, behind: Option<&[f64]>, goal: Goal) -> Recoiled {
        let own = scattering::Own {
            scale: &self.scale,
            recoil: &|h| self.twists(&self.answered(h)),
            films: self.own.films,
        };
        self.at.recoil(start, behind, &own, goal)
    }

    /// v with M v = `right` on the free rows; driven ones rest.
    pub fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        self.solve_beside(right, &DVector::zeros(right.len()))
    }

    /// v with given velocities `driven` (zero where free), and M v = `right` + M₀ `driven` on the free rows.
    pub fn solve_beside(&self, right: &DVector<f64>, driven: &DVector<f64>) -> DVector<f64> {
        let mut first = driven + (self.own.solve)(right);
        if self.own.films && driven.iter().any(|x| *x != 0.0) {
            let twists = self.twists(driven);
            let mut impulses = DVector::zeros(twists.len());
            self.at.add_films(&twists, &mut impulses);
            first -= self.answered(&impulses);
        }
        let (v, found) = self.recoiled(first, None, Goal::Full);
        self.at.settle(self.twists(&v), found);
        v
    }

    /// [`Recoiling::solve`] for a change of the velocity `of`, if it is one: to a residual that is small beside it. The water remembers it.
    pub(super) fn change(&self, right: &DVector<f64>, of: Option<&DVector<f64>>) -> DVector<f64> {
        let goal = of.map_or(Goal::Full, |v| {
            Goal::Absolute(CHANGE * self.at.levels().tolerance * self.size(v))
        });
        let (v, found) = self.recoiled((self.own.solve)(right), None, goal);
        self.at.remember(found);
        v
    }

    /// [`Recoiling::solve`] to a relative residual, with what earlier ones left (none being as good as zeros); and what this leaves, of which the impulses of the
    /// velocity are made that come with it.
    pub(super) fn step(
        &self,
        right: &DVector<f64>,
        behind: &[f64],
        goal: f64,
    ) -> (DVector<f64>, Vec<f64>) {
        let behind = Some(behind).filter(|b| !b.is_empty());
        let (v, found) = self.recoiled((self.own.solve)(right), behind, Goal::Relative(goal));
        (v, found.left)
    }

    /// v with M₀ v = `right` on the free rows; driven ones rest.
    pub(super) fn alone(&self, right: &DVector<f64>) -> DVector<f64> {
        (self.own.solve)(right)
    }

    /// Of a velocity in the units of what is left.
    pub(super) fn size(&self, v: &DVector<f64>) -> f64 {
        self.twists(v).component_mul(&self.scale).norm()
    }

    /// w with M w = `right` + ρ Jᵀ h on the free rows, h the rates of the bodies' impulses in the water as they move with the velocity of the coefficients `direction`, are displaced along
    /// `z` and change their twists (body frames) at the rates `twists`; and what [`Linearised::carried`] tells of the rates `twists` − J w.
    ///
    /// [`Linearised::carried`]: crate::coupling::Linearised::carried
    pub(super) fn carried(
        &self,
        right: &DVector<f64>,
        direction: &DVector<f64>,
        twists: &DVector<f64>,
        z: &[Vec6],
    ) -> (DVector<f64>, Carried) {
        let at = &self.at;
        let displaced = at.displaced(&at.motions().twists(direction), z);
        let (asked, mut impulses) = displaced.asked();
        at.add_own(twists, &mut impulses);
        if self.own.films {
            at.add_films(twists, &mut impulses);
        }
        let first = (self.own.solve)(right) + self.answered(&impulses);
        let start = twists - self.twists(&first);
        let found = self.found(&start, Some(&asked), Goal::Full);
        let w = first + self.answered(&found.recoiling);
        let carried = displaced.carried(&(twists - self.twists(&w)), &found);
        (w, carried)
    }

    fn recoiled(
        &self,
        first: DVector<f64>,
        behind: Option<&[f64]>,
        goal: Goal,
    ) -> (DVector<f64>, Recoiled) {
        let found = self.found(&self.twists(&first), behind, goal);
        (first - self.answered(&found.recoiling), found)
    }
}
