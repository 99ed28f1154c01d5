//! Shapes as parameters: what a body's shape changes of the water's energy, and what of its body follows from it.
//!
//! A shape parameter s acts on the water through M̄_f, whose coupling answers for it ([`Coupling`](crate::coupling::Coupling)), and on the body through
//! its volume, mass, inertia and their centres, as far as the scene leaves these to the shape. Of the latter each is a parameter itself: the derivative with respect to s is its
//! own and, along these, theirs.

use super::Parameters;
use super::evaluation::Evaluation;
use super::fluid::FluidMomenta;
use super::linearisation::{Linearisation, Water};
use crate::Result;
use crate::adjoint::lie::Vec6;
use crate::coupling::{Direction, ShapeTerm};
use nalgebra::DVector;

/// A bilinear term of the water's energy, by coefficients on the basis and by twists of the bodies (spatial, all bodies): the latter where bodies are apart and the basis is
/// empty.
pub(super) struct Bilinear<'t> {
    pub weight: f64,
    pub x: (Option<&'t DVector<f64>>, &'t [Vec6]),
    pub y: (Option<&'t DVector<f64>>, &'t [Vec6]),
    /// A displacement, spatial twists of all bodies, where it is the energy's slope along that.
    pub along: Option<&'t [Vec6]>,
}

impl Linearisation<'_> {
    /// Adds the cotangents of the shapes for ρ times the sum of `terms`.
    ///
    /// # Errors
    /// A coupling that fails.
    pub(super) fn add_shape_vjp(
        &self,
        water: &Water,
        terms: &[Bilinear],
        bar: &mut Parameters,
    ) -> Result<()> {
        let shapes = &self.system.shapes.water;
        let rho = self.parameters.density();
        if shapes.is_empty() || rho == 0.0 {
            return Ok(());
        }
        let e: &Evaluation = self;
        let apart = matches!(water.fluid, FluidMomenta::Apart(_));
        let twists = |(coefficients, field): (Option<&DVector<f64>>, &[Vec6])| {
            let asked = apart || coefficients.is_none();
            asked.then(|| e.submerged_twists(field))
        };
        let made: Vec<_> = terms
            .iter()
            .map(|t| {
                (
                    twists(t.x),
                    twists(t.y),
                    t.along.map(|z| e.submerged_field(z)),
                )
            })
            .collect();
        fn direction<'d>(
            (coefficients, _): (Option<&'d DVector<f64>>, &[Vec6]),
            twists: &'d Option<DVector<f64>>,
        ) -> Option<Direction<'d>> {
            match (twists, coefficients) {
                (Some(x), _) => Some(Direction::Twist(x)),
                (None, Some(c)) => Some(Direction::Basis(c)),
                (None, None) => None,
            }
        }
        let asked = terms.iter().zip(&made).filter_map(|(t, (x, y, along))| {
            Some(ShapeTerm {
                weight: rho * t.weight,
                x: direction(t.x, x)?,
                y: direction(t.y, y)?,
                along: along.as_deref(),
            })
        });
        let found = water.linearised.shape_vjp(&asked.collect::<Vec<_>>())?;
        for (p, x) in shapes.iter().zip(found.iter()) {
            bar[*p] += x;
        }
        Ok(())
    }
}
