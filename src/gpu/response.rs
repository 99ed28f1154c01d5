//! The water's solution to columns of twists, on the device: what both surfaces do with it, value and first derivative.

use super::buffer::Buffer;
use super::columns::{Slice, Sum, combine};
use super::kernel::Call;
use super::placed::PlacedSurfaces;
use super::refined::Solves;
use super::units::{self, Twists};
use super::wrenches::{self, Densities, tensor, wrenches};
use crate::adjoint::lie::Vec6;
use crate::coupling::{CoupledResponse, Direction, PairTensor, Reached, Tangent};
use crate::solver::Columns;
use crate::{Error, Result};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Where a coupled system keeps its unknowns.
#[derive(Clone, Copy)]
pub(super) enum Unknowns {
    /// By face, in units of L².
    Faces,
    /// By source, in units of L³.
    Sources,
}

/// A coupled system at given poses.
pub(super) trait System: Send + Sync + Sized + 'static {
    /// Densities of a column, by face and by source.
    const DENSITIES: [usize; 2];
    /// The first of them, or of these.
    const UNKNOWNS: Unknowns;

    fn surfaces(&self) -> &PlacedSurfaces;

    /// Solves for the densities, and gives them to [`Solution::take`].
    ///
    /// # Errors
    /// A tolerance that isn't reached, bodies inside each other, or a device that fails.
    fn solve(solution: &mut Solution<Self>) -> Result<()>;

    /// As the CPU's: the tangent of the first column's energy with the last.
    ///
    /// # Errors
    /// As there.
    fn second(solution: &Solution<Self>, z: &[Vec6]) -> Result<Tangent>;
}

/// The densities of some columns, on the device.
pub(super) struct Solution<S> {
    pub placed: Arc<S>,
    /// Bodies that the columns first given move.
    moving: Arc<Vec<bool>>,
    pub twists: Twists,
    pub columns: usize,
    /// By face, `[face][densities·columns]`.
    pub left: Buffer,
    /// By source, `[source][densities·columns]`.
    pub right: Buffer,
    momenta: DMatrix<f64>,
    energies: DMatrix<f64>,
    reached: Reached,
}

impl<S: System> Solution<S> {
    /// Solves for columns of twists.
    ///
    /// # Errors
    /// As [`System::solve`].
    pub fn new(placed: Arc<S>, twists: &DMatrix<f64>) -> Result<Self> {
        let moves = |b| twists.rows(6 * b, 6).iter().any(|x| *x != 0.0);
        let moving = (0..twists.nrows() / 6).map(moves).collect();
        Self::solve(placed, Arc::new(moving), twists)
    }

    fn solve(placed: Arc<S>, moving: Arc<Vec<bool>>, twists: &DMatrix<f64>) -> Result<Self> {
        let twists = Twists::new(twists.clone(), placed.surfaces().surfaces.length);
        let mut out = Self::zeros(placed, moving, twists)?;
        S::solve(&mut out)?;
        Ok(out)
    }

    fn zeros(placed: Arc<S>, moving: Arc<Vec<bool>>, twists: Twists) -> Result<Self> {
        let surfaces = &placed.surfaces().surfaces;
        let (context, sizes) = (&surfaces.context, &surfaces.sizes);
        let (k, [left, right]) = (twists.scale.len(), S::DENSITIES);
        let zeros = |label, count| context.zeros(label, context.fine(), count * k);
        Ok(Self {
            left: zeros("densities by face", sizes.faces * left)?,
            right: zeros("densities by source", sizes.sources * right)?,
            momenta: DMatrix::zeros(6 * sizes.bodies, k),
            energies: DMatrix::zeros(k, k),
            reached: Reached::default(),
            columns: k,
            twists,
            moving,
            placed,
        })
    }

    /// A density of all columns, by face and by source.
    pub fn by_face(&self, density: usize) -> Slice<'_> {
        let k = self.columns;
        (&self.left, S::DENSITIES[0] * k, density * k)
    }

    pub fn by_source(&self, density: usize) -> Slice<'_> {
        let k = self.columns;
        (&self.right, S::DENSITIES[1] * k, density * k)
    }

    /// What a solve left, in the device's units; `lacking` are impulses that the densities don't tell.
    pub fn take(
        &mut self,
        reached: Reached,
        [momenta, energies]: [&[f64]; 2],
        lacking: Option<DMatrix<f64>>,
    ) {
        let (k, scale) = (self.columns, &self.twists.scale);
        let l5 = self.placed.surfaces().surfaces.length.powi(5);
        self.reached = reached;
        self.energies =
            DMatrix::from_fn(k, k, |x, y| energies[x * k + y] * scale[x] * scale[y] * l5);
        self.momenta = self.impulses(momenta);
        if let Some(lacking) = lacking {
            self.energies += self.twists.all.tr_mul(&lacking);
            self.momenta += lacking;
        }
    }

    /// Body-frame impulses of the bodies that move, from the device's.
    fn impulses(&self, values: &[f64]) -> DMatrix<f64> {
        let mut out = self.twists.impulses(values, 1.0);
        for b in (0..self.moving.len()).filter(|b| !self.moving[*b]) {
            out.rows_mut(6 * b, 6).fill(0.0);
        }
        out
    }

    /// A combination of the columns, coefficients columns × n.
    fn combination(&self, coefficients: &DMatrix<f64>) -> Result<Self> {
        let (twists, units) = self.twists.combined(coefficients);
        let mut out = Self::zeros(self.placed.clone(), self.moving.clone(), twists)?;
        out.momenta = &self.momenta * coefficients;
        out.energies = coefficients.tr_mul(&self.energies) * coefficients;
        out.reached = self.reached;
        if out.columns == 0 || self.columns == 0 {
            return Ok(out);
        }
        let surfaces = &self.placed.surfaces().surfaces;
        let (context, sizes, [left, right]) = (&surfaces.context, &surfaces.sizes, S::DENSITIES);
        let of = |x, out, sizes| combine(context, x, &units, out, sizes);
        context.submit(&[
            of(&self.left, &out.left, (sizes.faces, left))?,
            of(&self.right, &out.right, (sizes.sources, right))?,
        ])?;
        Ok(out)
    }

    /// `out = scale · from`.
    pub fn copy(
        &self,
        (rows, columns): (usize, usize),
        from: Slice,
        out: Slice,
        scale: f32,
    ) -> Result<Call> {
        let surfaces = &self.placed.surfaces().surfaces;
        let task = Sum {
            taken: (from.1, from.2),
            scale,
            ..Sum::new((rows, columns), (from.0, 1), out)
        };
        task.call(&surfaces.context, surfaces.context.fine(), &surfaces.open)
    }

    /// Solves for the tangents of densities and reads what follows from them: the tangents of the impulses, and the wrenches of densities that have
    /// their tangents beside them.
    pub fn tangents(
        &self,
        solves: &Solves,
        mut follow: Vec<Call>,
        momenta: &Buffer,
        [left, right, motions]: [&Buffer; 3],
        z: &[Vec6],
    ) -> Result<Tangent> {
        let (placed, n) = (self.placed.surfaces(), self.columns);
        let (context, sizes) = (&placed.surfaces.context, &placed.surfaces.sizes);
        let of = Densities {
            left,
            right,
            columns: n,
            taken: (0, n),
            motions: Some(motions),
        };
        let (pairs, wrenches, count) = wrenches(placed, context.fine(), &of)?;
        follow.extend(pairs);
        let wanted = [(momenta, 6 * sizes.bodies * n), (&wrenches, count)];
        let (_, values) = solves.run(&[], &follow, &wanted)?;
        let impulses = self.impulses(&values[0]);
        let [gradient, wrench] = wrenches::tangent(placed, z, &values[1], &self.twists.scale);
        Ok(Tangent {
            momentum_x: impulses.column(0).into_owned(),
            momentum_y: impulses.column(n - 1).into_owned(),
            gradient,
            wrench,
        })
    }
}

impl<S: System> CoupledResponse for Solution<S> {
    fn reached(&self) -> Reached {
        self.reached
    }

    fn momenta(&self) -> Result<DMatrix<f64>> {
        Ok(self.momenta.clone())
    }

    fn energies(&self) -> Result<DMatrix<f64>> {
        Ok(self.energies.clone())
    }

    fn gradient(&self) -> Result<PairTensor> {
        let densities = [&self.left, &self.right];
        tensor(self.placed.surfaces(), densities, &self.twists.scale)
    }

    fn directions(&self, directions: &[Direction]) -> Result<Box<dyn CoupledResponse + '_>> {
        let solution = match self.twists.along(directions) {
            Ok(coefficients) => self.combination(&coefficients)?,
            // One more column costs a solve little: the kernels are evaluated once for all.
            Err(twists) => Self::solve(self.placed.clone(), self.moving.clone(), &twists)?,
        };
        Ok(Box::new(solution))
    }

    fn tangent(&self, z: &[Vec6]) -> Result<Tangent> {
        if !(1..=2).contains(&self.columns) {
            let columns = self.columns;
            return Err(Error::input("tangent: columns", columns, "must be 1 or 2"));
        }
        let length = self.placed.surfaces().surfaces.length;
        units::along(z, length, |z| S::second(self, z))
    }

    fn densities(&self) -> Result<Columns> {
        let surfaces = &self.placed.surfaces().surfaces;
        let (k, context) = (self.columns, &surfaces.context);
        let ((buffer, stride, _), n, power) = match S::UNKNOWNS {
            Unknowns::Faces => (self.by_face(0), surfaces.sizes.faces, 2),
            Unknowns::Sources => (self.by_source(0), surfaces.sizes.sources, 3),
        };
        let values = context.read(context.fine(), &[(buffer, n * stride)])?;
        let unit = surfaces.length.powi(power);
        Ok(Columns::from_fn(n, k, |i, c| {
            values[0][i * stride + c] * self.twists.scale[c] * unit
        }))
    }
}
