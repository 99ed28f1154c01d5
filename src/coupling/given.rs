//! Bodies whose own added mass is given: what others and walls change of it is as computed.
//!
//! With M̄_f of a coupling, A_b each body's added mass alone in the water as that coupling has it, and Â_b the given one,
//!
//! ```text
//! M̄_f + blockdiag(Â_b − A_b)
//! ```
//!
//! A body far from all others and from walls has exactly what is given. The difference is constant in the body's own frame: impulses have it, gradients don't.

use super::{
    Coupling, CouplingReport, Direction, Linearise, Linearised, Momenta, Motion, MotionBar,
    Pullback, ShapeTerm, SurfacePotential, Tangent,
};
use crate::adjoint::lie::{Mat6, Pose, Vec3, Vec6};
use crate::boundary::PanelBoundary;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// A coupling with given added masses in the place of bodies' own.
///
/// The sum isn't positive definite by itself: where what is given is far smaller than what neighbours take away, the water's energy can be negative.
pub struct Given {
    computed: Box<dyn Coupling>,
    /// Given less own, unit density, body frame, about the body's origin.
    change: Vec<Mat6>,
    /// Of each shape parameter its body, and the rate of that body's own added mass where one is given.
    rates: Vec<(usize, Mat6)>,
}

impl Given {
    /// From a coupling and what each body's added mass is given to have more than it has there alone in the water: symmetric, unit density (m³, m⁴, m⁵), body frame,
    /// about the body's origin; zero where none is given.
    ///
    /// # Errors
    /// [`Error::Input`] if there isn't one for each body.
    pub fn new(computed: Box<dyn Coupling>, change: Vec<Mat6>) -> Result<Self> {
        let (bodies, given) = (computed.bodies(), change.len());
        if given != bodies {
            let expected = format!("one for each of the {bodies} bodies");
            return Err(Error::input(
                "given added mass: differences",
                given,
                expected,
            ));
        }
        Ok(Self {
            computed,
            change,
            rates: Vec::new(),
        })
    }

    /// With the shape parameters that the coupling was made with: of each its body, and the rate of the added mass that this has alone in the water as the coupling has it
    /// (unit density, body frame, about its origin), zero of a body that is given none. What is given stays as it is.
    ///
    /// # Errors
    /// [`Error::Input`] unless there is one for each of the coupling's, of a body that exists.
    pub fn with_shapes(self, own: Vec<(usize, Mat6)>) -> Result<Self> {
        let (expected, bodies) = (self.computed.shape_parameters(), self.change.len());
        if own.len() != expected || own.iter().any(|(b, _)| *b >= bodies) {
            let found: Vec<usize> = own.iter().map(|(b, _)| *b).collect();
            return Err(Error::input(
                "given added mass: bodies of the shape parameters",
                format!("{found:?}"),
                format!("{expected} of {bodies} bodies, counted from 0"),
            ));
        }
        Ok(Self { rates: own, ..self })
    }

    /// Adds what is given to the impulses of columns of body-frame twists.
    fn add(&self, twists: &DMatrix<f64>, impulses: &mut DMatrix<f64>) {
        for (b, change) in self.change.iter().enumerate() {
            let mut rows = impulses.rows_mut(6 * b, 6);
            rows += change * twists.rows(6 * b, 6);
        }
    }

    /// The same of one column.
    fn add_to(&self, twists: &DVector<f64>, impulses: &mut DVector<f64>) {
        for (b, change) in self.change.iter().enumerate() {
            let mut rows = impulses.fixed_rows_mut::<6>(6 * b);
            rows += change * twists.fixed_rows::<6>(6 * b);
        }
    }
}

impl Coupling for Given {
    fn name(&self) -> &'static str {
        self.computed.name()
    }

    fn bodies(&self) -> usize {
        self.computed.bodies()
    }

    fn unknowns(&self) -> usize {
        self.computed.unknowns()
    }

    fn shape_parameters(&self) -> usize {
        self.computed.shape_parameters()
    }

    fn evaluate(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Momenta> {
        let Momenta {
            mut momenta,
            report,
        } = self.computed.evaluate(poses, basis)?;
        self.add(basis, &mut momenta);
        Ok(Momenta::new(momenta, report))
    }

    fn differentiable(&self) -> Option<&dyn Linearise> {
        self.computed.differentiable().map(|_| self as _)
    }

    /// That of the flow as computed: what is given has none.
    fn residual(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Option<DMatrix<f64>>> {
        self.computed.residual(poses, basis)
    }

    fn film_momenta(&self, poses: &[Pose], twists: &DMatrix<f64>) -> Result<Option<DMatrix<f64>>> {
        self.computed.film_momenta(poses, twists)
    }

    /// As computed from the bodies' shapes: an added mass tells no flow.
    fn velocity(
        &self,
        poses: &[Pose],
        twists: &DVector<f64>,
        points: &[Vec3],
    ) -> Result<Option<Vec<Vec3>>> {
        self.computed.velocity(poses, twists, points)
    }

    fn surfaces(&self) -> Option<&[Arc<PanelBoundary>]> {
        self.computed.surfaces()
    }

    /// As computed from the bodies' shapes, as [`Coupling::velocity`].
    fn surface_potentials(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
    ) -> Result<Vec<SurfacePotential>> {
        self.computed.surface_potentials(motion, surfaces)
    }

    fn surface_potentials_vjp(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
        bars: &[SurfacePotential],
    ) -> Result<MotionBar> {
        self.computed.surface_potentials_vjp(motion, surfaces, bars)
    }
}

impl Linearise for Given {
    fn linearise(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Box<dyn Linearised + '_>> {
        let computed = self
            .computed
            .differentiable()
            .ok_or_else(|| Error::Unsupported {
                what: format!("derivatives of {}", self.computed.name()),
                why: "it has values only".into(),
                instead: "use a fidelity that has derivatives".into(),
            })?;
        let computed = computed.linearise(poses, basis)?;
        let mut momenta = computed.momenta().clone();
        self.add(basis, &mut momenta);
        Ok(Box::new(GivenLinearised {
            given: self,
            computed,
            basis: basis.clone(),
            momenta,
        }))
    }
}

/// [`Given`] at given poses.
struct GivenLinearised<'a> {
    given: &'a Given,
    computed: Box<dyn Linearised + 'a>,
    basis: DMatrix<f64>,
    momenta: DMatrix<f64>,
}

impl GivenLinearised<'_> {
    fn add(&self, x: Direction, impulses: &mut DVector<f64>) {
        self.given.add_to(&self.twists(x), impulses);
    }

    fn twists(&self, x: Direction) -> DVector<f64> {
        match x {
            Direction::Basis(c) => &self.basis * c,
            Direction::Twist(x) => x.clone(),
        }
    }
}

impl Linearised for GivenLinearised<'_> {
    fn momenta(&self) -> &DMatrix<f64> {
        &self.momenta
    }

    fn gradient(&self, x: &DVector<f64>, y: &DVector<f64>) -> Result<Vec<Vec6>> {
        self.computed.gradient(x, y)
    }

    fn gradient_columns(&self, x: &DVector<f64>) -> Result<Vec<Vec<Vec6>>> {
        self.computed.gradient_columns(x)
    }

    fn gradient_along(&self, y: &DVector<f64>, z: &[Vec6]) -> Result<DVector<f64>> {
        self.computed.gradient_along(y, z)
    }

    fn vjp(&self, x: Direction, y: Direction) -> Result<Pullback> {
        let mut out = self.computed.vjp(x, y)?;
        self.add(x, &mut out.momentum_x);
        self.add(y, &mut out.momentum_y);
        Ok(out)
    }

    fn respond(
        &self,
        twists: &DMatrix<f64>,
        x: &DVector<f64>,
    ) -> Result<(DMatrix<f64>, Vec<Vec<Vec6>>)> {
        let (mut momenta, wrenches) = self.computed.respond(twists, x)?;
        self.given.add(twists, &mut momenta);
        Ok((momenta, wrenches))
    }

    fn displaced(&self, x: &DVector<f64>, z: &[Vec<Vec6>]) -> Result<Vec<Tangent>> {
        self.computed.displaced(x, z)
    }

    fn hvp(&self, x: Direction, y: Direction, z: &[Vec6]) -> Result<Tangent> {
        self.computed.hvp(x, y, z)
    }

    fn shape_vjp(&self, terms: &[ShapeTerm]) -> Result<DVector<f64>> {
        let mut out = self.computed.shape_vjp(terms)?;
        // Constant in the bodies' frames: a displacement doesn't change it.
        for term in terms.iter().filter(|term| term.along.is_none()) {
            let [x, y] = [term.x, term.y].map(|x| self.twists(x));
            for (out, (b, rate)) in out.iter_mut().zip(&self.given.rates) {
                let [x, y] = [&x, &y].map(|x| x.fixed_rows::<6>(6 * b).into_owned());
                *out -= term.weight * x.dot(&(rate * y));
            }
        }
        Ok(out)
    }

    fn report(&self) -> &CouplingReport {
        self.computed.report()
    }
}
