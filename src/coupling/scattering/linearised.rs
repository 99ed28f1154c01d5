//! Derivatives of the energy of many bodies: of directions that are given by coefficients or by twists.

use super::Scattering;
use super::kept::Answer;
use super::recoiled::Recoiled;
use super::scattered::{Motions, Moving, Scattered, balance, mixed, plus};
use crate::adjoint::lie::{Mat6, Pose, Vec6};
use crate::boundary::PanelBoundary;
use crate::coupling::isolated::Isolated;
use crate::coupling::reduced::FLUX;
use crate::coupling::settings::check_asked;
use crate::coupling::{
    Carried, Coupling, CouplingReport, Direction, Linearised, Momenta, Motion, MotionBar, Pullback,
    SurfacePotential, Tangent,
};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Columns of a dense basis.
pub(super) struct Dense(pub DMatrix<f64>);

impl Motions for Dense {
    fn twists(&self, coefficients: &DVector<f64>) -> DVector<f64> {
        &self.0 * coefficients
    }

    fn transposed(&self, impulses: &DVector<f64>) -> DVector<f64> {
        self.0.tr_mul(impulses)
    }
}

/// [`Scattered`] with its derivatives; impulses of a basis are formed where one was given alone.
pub struct ScatteredLinearised<'a> {
    at: Arc<Scattered<'a>>,
    momenta: DMatrix<f64>,
    report: CouplingReport,
}

/// Bodies that move as they did, about to be displaced: where to, and what their points see of it while they are still.
pub struct Displaced<'s, 'a> {
    at: &'s Scattered<'a>,
    moving: Moving<'s>,
    answer: Arc<Answer>,
    seen: Vec<f64>,
}

impl<'a> Scattered<'a> {
    /// Bodies with these twists (body frames) that are displaced along `z`.
    pub fn displaced(&self, twists: &DVector<f64>, z: &[Vec6]) -> Displaced<'_, 'a> {
        let (answer, moving) = (self.respond(twists), self.moving(z));
        let seen = self.tangent_potentials(&moving, &answer.charges);
        Displaced {
            at: self,
            moving,
            answer,
            seen,
        }
    }
}

impl Displaced<'_, '_> {
    /// What the displacement alone asks of bodies whose twists stay as they are: in the equations of [`Scattered::recoil`], and as impulses (body frames, unit density).
    pub fn asked(&self) -> (Vec<f64>, DVector<f64>) {
        let (modes, mut impulses) = self.at.projected(&self.seen);
        let narrow = &self.moving.narrow;
        narrow.add_impulse_rate(&self.answer.twists, &mut impulses);
        let unit = FLUX.sqrt();
        (modes.into_iter().map(|a| unit * a).collect(), impulses)
    }

    /// [`Linearised::carried`] as the twists change at the rates `twists`, which recoiled so.
    pub fn carried(&self, twists: &DVector<f64>, recoiled: &Recoiled) -> Carried {
        let rates = self.at.charges(twists, recoiled.modes());
        carried(self.at, &self.moving, &self.answer, twists, &rates)
    }
}

/// Of an answer with itself, as bodies are displaced and charges change at these rates, those of the twists among them.
fn carried(
    at: &Scattered,
    moving: &Moving,
    answer: &Answer,
    twists: &DVector<f64>,
    rates: &[f64],
) -> Carried {
    let mut out = bent(at, moving, &answer.charges, rates);
    out.add_films(moving, &answer.twists);
    at.add_own(twists, &mut out.impulses);
    at.narrow.add_impulses(twists, &mut out.impulses);
    let mut wrench: Vec<_> = out.rate.into_iter().map(|w| 0.5 * w).collect();
    at.narrow.add_wrenches(twists, &answer.twists, &mut wrench);
    Carried {
        momentum: out.impulses,
        wrench,
        gradient: out.gradient,
    }
}

/// The same without what the twists do of each body alone.
fn bent(at: &Scattered, moving: &Moving, charges: &[f64], rates: &[f64]) -> Bent {
    let found = at.gradient_jvp(moving, charges, rates);
    Bent {
        impulses: at.impulses_of(&found.potentials),
        gradient: found.gradient,
        rate: found.rate,
    }
}

/// Rates of the impulses that bodies exchange, wrenches, and their rates.
struct Bent {
    impulses: DVector<f64>,
    gradient: Vec<Vec6>,
    rate: Vec<Vec6>,
}

impl Bent {
    /// Adds what films have themselves, of twists that stay as they are.
    fn add_films(&mut self, moving: &Moving, twists: &DVector<f64>) {
        let wrenches = (&mut self.gradient[..], &mut self.rate[..]);
        let impulses = std::slice::from_mut(&mut self.impulses);
        (moving.narrow).add_tangent(&[twists], wrenches, impulses);
    }
}

impl<'a> ScatteredLinearised<'a> {
    /// Of what is placed already. No basis's impulses are formed.
    pub fn of(at: Arc<Scattered<'a>>) -> Self {
        Self {
            at,
            momenta: DMatrix::zeros(0, 0),
            report: CouplingReport::default(),
        }
    }

    fn dense(model: &'a Scattering, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Self> {
        check_asked(model, poses, basis)?;
        let at = model.place(poses, Box::new(Dense(basis.clone())))?;
        let mut momenta = DMatrix::zeros(basis.nrows(), basis.ncols());
        for (k, mut out) in momenta.column_iter_mut().enumerate() {
            let answer = at.respond(&basis.column(k).into_owned());
            out.copy_from(&at.impulses(&answer));
        }
        at.check()?;
        if let Some(bad) = momenta.iter().find(|x| !x.is_finite()) {
            return Err(Error::Unresolved {
                place: "exchange between many bodies".into(),
                quantity: "impulse".into(),
                value: *bad,
                limit: f64::MAX,
                remedy: "points of two bodies coincide: bodies overlap".into(),
            });
        }
        Ok(Self {
            report: at.report(),
            at: Arc::new(at),
            momenta,
        })
    }

    fn respond(&self, x: &Direction) -> Arc<Answer> {
        match x {
            Direction::Basis(c) => self.at.respond(&self.at.motions.twists(c)),
            Direction::Twist(x) => self.at.respond(x),
        }
    }

    /// The rates of charges as bodies are displaced.
    fn rates(&self, moving: &Moving, charges: &[f64]) -> Vec<f64> {
        let at = &self.at;
        at.answered(&at.tangent_potentials(moving, charges)).0
    }

    /// The rate of the impulses of an answer as bodies are displaced.
    fn impulse_rate(&self, answer: &Answer, z: &[Vec6]) -> DVector<f64> {
        let at = &self.at;
        let moving = at.moving(z);
        let seen = at.tangent_potentials(&moving, &answer.charges);
        let (_, mut out) = at.answered(&seen);
        moving.narrow.add_impulse_rate(&answer.twists, &mut out);
        out
    }

    /// ∇E of two answers.
    fn pull_back(&self, x: &Answer, y: &Answer) -> Vec<Vec6> {
        let mut out = self.at.pull_back(&x.charges, &y.charges);
        self.at.narrow.add_wrenches(&x.twists, &y.twists, &mut out);
        out
    }
}

impl Linearised for ScatteredLinearised<'_> {
    fn momenta(&self) -> &DMatrix<f64> {
        &self.momenta
    }

    fn gradient(&self, x: &DVector<f64>, y: &DVector<f64>) -> Result<Vec<Vec6>> {
        let (a, b) = (
            self.respond(&Direction::Basis(x)),
            self.respond(&Direction::Basis(y)),
        );
        let out = self.pull_back(&a, &b);
        self.at.check()?;
        Ok(out)
    }

    fn gradient_along(&self, y: &DVector<f64>, z: &[Vec6]) -> Result<DVector<f64>> {
        let answer = self.respond(&Direction::Basis(y));
        let rate = self.impulse_rate(&answer, z);
        self.at.check()?;
        Ok(self.at.motions.transposed(&rate))
    }

    fn vjp(&self, x: Direction, y: Direction) -> Result<Pullback> {
        let (x, y) = (self.respond(&x), self.respond(&y));
        let out = Pullback {
            momentum_x: self.at.impulses(&x),
            momentum_y: self.at.impulses(&y),
            wrench: self.pull_back(&x, &y),
        };
        self.at.check()?;
        Ok(out)
    }

    fn carried(
        &self,
        x: &DVector<f64>,
        twists: &DVector<f64>,
        z: &[Vec6],
    ) -> Result<Option<Carried>> {
        let at = &self.at;
        let answer = self.respond(&Direction::Basis(x));
        let moving = at.moving(z);
        let seen = at.tangent_potentials(&moving, &answer.charges);
        // Charges that the twists ask for, and those that answer the displacement, in one solve.
        let rates = at.answering_beside(twists, &seen);
        let found = carried(at, &moving, &answer, twists, &rates);
        at.check()?;
        Ok(Some(found))
    }

    fn hvp(&self, x: Direction, y: Direction, z: &[Vec6]) -> Result<Tangent> {
        let at = &self.at;
        let moving = at.moving(z);
        let (x, y) = (self.respond(&x), self.respond(&y));
        // A spin that makes no charges may move a film.
        let out = if x.charges == y.charges && x.twists == y.twists {
            let rates = self.rates(&moving, &x.charges);
            let mut bent = bent(at, &moving, &x.charges, &rates);
            bent.add_films(&moving, &x.twists);
            Tangent {
                momentum_x: bent.impulses.clone(),
                momentum_y: bent.impulses,
                gradient: bent.gradient,
                wrench: bent.rate,
            }
        } else {
            // Each is solved to its own size.
            let [dx, dy] = [&x, &y].map(|of| self.rates(&moving, &of.charges));
            let part = balance(&x.charges, &y.charges);
            let [sum, difference] = [part, -part].map(|part| {
                let charges = plus(&x.charges, part, &y.charges);
                bent(at, &moving, &charges, &plus(&dx, part, &dy))
            });
            let mut out = Tangent {
                momentum_x: 0.5 * (&sum.impulses + &difference.impulses),
                momentum_y: (0.5 / part) * (&sum.impulses - &difference.impulses),
                gradient: mixed(&sum.gradient, &difference.gradient, part),
                wrench: mixed(&sum.rate, &difference.rate, part),
            };
            let mut impulses = [out.momentum_x, out.momentum_y];
            let wrenches = (&mut out.gradient[..], &mut out.wrench[..]);
            let twists = [&x.twists, &y.twists];
            (moving.narrow).add_tangent(&twists, wrenches, &mut impulses);
            [out.momentum_x, out.momentum_y] = impulses;
            out
        };
        at.check()?;
        Ok(out)
    }

    fn report(&self) -> &CouplingReport {
        &self.report
    }
}

impl Coupling for Scattering {
    fn name(&self) -> &'static str {
        "the fidelity reduced, for many bodies"
    }

    fn bodies(&self) -> usize {
        self.bodies.len()
    }

    fn unknowns(&self) -> usize {
        self.mode_count()
    }

    fn evaluate(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Momenta> {
        let found = ScatteredLinearised::dense(self, poses, basis)?;
        Ok(Momenta::new(found.momenta, found.report))
    }

    fn differentiable(&self) -> Option<&dyn crate::coupling::Linearise> {
        Some(self)
    }

    fn scattering(&self) -> Option<&Scattering> {
        Some(self)
    }

    fn give(&mut self, change: &[Mat6]) -> bool {
        let own = self.bodies.iter().zip(change);
        let own = own.map(|(body, change)| body.parts().added_mass + change);
        self.alone = Isolated::new(own.collect());
        true
    }

    fn film_momenta(&self, poses: &[Pose], twists: &DMatrix<f64>) -> Result<Option<DMatrix<f64>>> {
        check_asked(self, poses, twists)?;
        Ok(Some(self.films.momenta(poses, twists, &self.names)?))
    }

    fn surface_potentials(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
    ) -> Result<Vec<SurfacePotential>> {
        self.potentials(motion, surfaces)
    }

    fn surface_potentials_vjp(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
        bars: &[SurfacePotential],
    ) -> Result<MotionBar> {
        self.potentials_vjp(motion, surfaces, bars)
    }
}

impl crate::coupling::Linearise for Scattering {
    fn linearise(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Box<dyn Linearised + '_>> {
        Ok(Box::new(ScatteredLinearised::dense(self, poses, basis)?))
    }
}
