//! The coupled panels at given poses: what all solutions there share.

use super::PanelModel;
use super::system::System;
use crate::adjoint::kernel::{double_vjp, single_sum, single_vjp};
use crate::adjoint::lie::{Pose, Vec6};
use crate::coupling::film::PlacedFilms;
use crate::coupling::pair::Pair;
use crate::coupling::response::{self, body_twists, moves};
use crate::coupling::{CoupledResponse, Direction, PairTensor, Reached, ShapeTerm, Tangent};
use crate::once::once;
use crate::solver::Columns;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// The system at given poses.
pub(super) struct PlacedPanels<'a> {
    pub coupled: &'a PanelModel,
    pub poses: Vec<Pose>,
    /// Panels of the target, points of the source: all whose relative placement changes.
    pub pairs: Vec<Pair>,
    /// What holds some of them apart.
    pub films: Arc<PlacedFilms>,
    pub system: System<'a>,
    /// S F of the unit twists of each body that the first twists move, at all points.
    readout: Vec<Option<Columns>>,
}

/// Twists, 6·bodies × k, and the water's solution.
pub(super) struct PanelSolution<'a> {
    pub placed: Arc<PlacedPanels<'a>>,
    pub twists: DMatrix<f64>,
    /// Potentials φ of the panels.
    pub phi: Columns,
    /// Adjoint densities μ.
    pub mu: Columns,
    reached: Reached,
    /// Of all pairs: ∇(S q − Ω/4π φ), once asked for.
    fields: OnceLock<Vec<Vec<f64>>>,
}

impl<'a> PlacedPanels<'a> {
    /// For twists that move the same bodies as these, or fewer.
    ///
    /// # Errors
    /// Bodies inside each other, or behind a wall.
    pub fn new(
        coupled: &'a PanelModel,
        poses: &[Pose],
        films: &Arc<PlacedFilms>,
        twists: &DMatrix<f64>,
    ) -> Result<Self> {
        let system = System::new(coupled, poses, films)?;
        let pairs = pairs(coupled, poses, films);
        Ok(Self {
            films: films.clone(),
            coupled,
            poses: poses.to_vec(),
            readout: readouts(coupled, &pairs, twists),
            pairs,
            system,
        })
    }

    /// Potentials of the panels for columns of twists.
    ///
    /// # Errors
    /// A solve that misses its tolerance.
    pub fn potentials(&self, twists: &DMatrix<f64>) -> Result<Columns> {
        let none = Columns::zeros(self.coupled.rows(), 0);
        let ([phi, _], _) = self.system.solve(&self.right(twists), &none)?;
        Ok(phi)
    }

    /// D F x̄ of columns of twists: fluxes through the panels.
    fn flux(&self, twists: &DMatrix<f64>) -> Columns {
        let mut out = Columns::zeros(self.coupled.rows(), twists.ncols());
        for (b, body) in self.coupled.bodies.iter().enumerate() {
            let twists = body_twists(twists, b);
            for (i, at) in self.coupled.faces[b].clone().enumerate() {
                let (row, out) = (body.faces.twist_flux(i), out.slice_mut(&(at..at + 1)));
                out.iter_mut()
                    .zip(&twists)
                    .for_each(|(o, t)| *o = row.dot(t));
            }
        }
        out
    }

    /// F x̄ of the panels of one body: normal velocities, `[panel][column]`; none where it rests.
    pub fn normal_velocity(&self, b: usize, twists: &DMatrix<f64>) -> Option<Vec<f64>> {
        if !moves(twists, b) {
            return None;
        }
        let (faces, twists) = (&self.coupled.bodies[b].faces, body_twists(twists, b));
        let rows = (0..faces.len()).map(|i| (faces.twist_flux(i), faces.areas[i]));
        let velocities = rows.flat_map(|(row, area)| twists.iter().map(move |t| row.dot(t) / area));
        Some(velocities.collect())
    }

    /// S F x̄ at all points.
    fn right(&self, twists: &DMatrix<f64>) -> Columns {
        let mut out = Columns::zeros(self.coupled.rows(), twists.ncols());
        for (b, readout) in self.readout.iter().enumerate() {
            let Some(readout) = readout.as_ref().filter(|_| moves(twists, b)) else {
                continue;
            };
            let twists = body_twists(twists, b);
            for i in 0..out.rows {
                let row = Vec6::from_row_slice(readout.row(i));
                let out = out.slice_mut(&(i..i + 1));
                out.iter_mut()
                    .zip(&twists)
                    .for_each(|(o, t)| *o += row.dot(t));
            }
        }
        out
    }

    /// ½ Fᵀ {D φ + Sᵀ μ} of one column: body-frame impulses of all bodies, zero for those without a readout.
    pub fn impulse(&self, phi: &[f64], mu: &[f64]) -> DVector<f64> {
        let mut out = DVector::zeros(6 * self.coupled.bodies.len());
        for (b, body) in self.coupled.bodies.iter().enumerate() {
            let Some(readout) = &self.readout[b] else {
                continue;
            };
            let mut h = Vec6::zeros();
            for (i, at) in self.coupled.faces[b].clone().enumerate() {
                h += body.faces.twist_flux(i) * phi[at];
            }
            for (i, m) in mu.iter().enumerate() {
                h += Vec6::from_row_slice(readout.row(i)) * *m;
            }
            out.fixed_rows_mut::<6>(6 * b).copy_from(&(0.5 * h));
        }
        out
    }

    /// Fᵀ Sᵀ μ of body `b` for one column μ; zero without a readout.
    pub fn read(&self, b: usize, mu: &[f64]) -> Vec6 {
        let Some(readout) = &self.readout[b] else {
            return Vec6::zeros();
        };
        let rows = mu.iter().enumerate();
        rows.map(|(i, m)| Vec6::from_row_slice(readout.row(i)) * *m)
            .sum()
    }

    /// ∇(S q − Ω/4π φ) of a pair's panels at its points, `[point][column][3]`, image's sign included: minus the velocity that they
    /// make there.
    fn fields(&self, pair: &Pair, solution: &PanelSolution) -> Vec<f64> {
        self.fields_of(pair, &solution.twists, &solution.phi)
    }

    /// The same of columns of twists and of potentials.
    pub fn fields_of(&self, pair: &Pair, twists: &DMatrix<f64>, phi: &Columns) -> Vec<f64> {
        let k = phi.columns;
        let sign = pair.image.sign;
        let triangles = self.coupled.bodies[pair.target].panels().triangles();
        let mut out = vec![0.0; 3 * k * pair.positions.len()];
        if let Some(q) = self.normal_velocity(pair.target, twists) {
            single_vjp(triangles, &pair.points, &scaled(sign, &q), k, &mut out);
        }
        let phi = phi.slice(&self.coupled.faces[pair.target]);
        double_vjp(triangles, &pair.points, &scaled(-sign, phi), k, &mut out);
        out
    }

    /// Rows of a pair's panels, and of its points.
    pub fn ranges(&self, pair: &Pair) -> (Range<usize>, Range<usize>) {
        let faces = &self.coupled.faces;
        (faces[pair.target].clone(), faces[pair.source].clone())
    }

    /// Whether impulses of body `b` are asked for.
    pub fn reads(&self, b: usize) -> bool {
        self.readout[b].is_some()
    }
}

impl<'a> PanelSolution<'a> {
    /// Solves for columns of twists.
    ///
    /// # Errors
    /// A solve that misses its tolerance.
    pub fn new(placed: Arc<PlacedPanels<'a>>, twists: DMatrix<f64>) -> Result<Self> {
        let (right, flux) = (placed.right(&twists), placed.flux(&twists));
        let ([phi, mu], reached) = placed.system.solve(&right, &flux)?;
        Ok(Self {
            placed,
            twists,
            phi,
            mu,
            reached,
            fields: OnceLock::new(),
        })
    }

    /// The same without adjoint densities: for potentials alone.
    ///
    /// # Errors
    /// As there.
    pub fn of_potentials(placed: Arc<PlacedPanels<'a>>, twists: DMatrix<f64>) -> Result<Self> {
        let phi = placed.potentials(&twists)?;
        Ok(Self::known(placed, twists, phi))
    }

    /// With these potentials, and without adjoint densities.
    pub fn known(placed: Arc<PlacedPanels<'a>>, twists: DMatrix<f64>, phi: Columns) -> Self {
        Self {
            phi,
            mu: Columns::zeros(placed.coupled.rows(), 0),
            placed,
            twists,
            reached: Reached::default(),
            fields: OnceLock::new(),
        }
    }

    /// Of every pair: ∇(S q − Ω/4π φ) of its panels at its points, `[point][column][3]`.
    pub fn fields(&self) -> &[Vec<f64>] {
        let made = once(&self.fields, || {
            let pairs = self.placed.pairs.iter();
            pairs.map(|pair| self.placed.fields(pair, self)).collect()
        });
        made.as_slice()
    }

    /// One column from coefficients on those there are.
    fn combine(&self, coefficients: &DVector<f64>) -> Self {
        let c = coefficients.as_slice();
        let combined = |x: &Columns| Columns::from_columns(&[&x.combine(c)]);
        let fields = OnceLock::new();
        if let Some(found) = self.fields.get() {
            let of_pair = |field: &Vec<f64>| {
                let sum =
                    |at: &[f64], i| c.iter().enumerate().map(|(k, c)| c * at[3 * k + i]).sum();
                let points = field.chunks_exact(3 * c.len());
                points
                    .flat_map(|at| [0, 1, 2].map(|i| sum(at, i)))
                    .collect()
            };
            fields.get_or_init(|| found.iter().map(of_pair).collect());
        }
        Self {
            placed: self.placed.clone(),
            twists: response::combined(&self.twists, coefficients),
            phi: combined(&self.phi),
            mu: combined(&self.mu),
            reached: self.reached,
            fields,
        }
    }

    /// Single columns side by side.
    fn beside(&self, parts: &[Self]) -> Self {
        let all = |part: fn(&Self) -> &Columns| {
            let columns: Vec<&[f64]> = parts.iter().map(|p| part(p).data.as_slice()).collect();
            Columns::from_columns(&columns)
        };
        let reached = parts.iter().map(|p| p.reached);
        // Fields of new columns are then made alone, those of combinations are known.
        let fields = OnceLock::new();
        if parts.iter().any(|p| p.fields.get().is_some()) {
            fields.get_or_init(|| {
                let columns: Vec<&[Vec<f64>]> = parts.iter().map(Self::fields).collect();
                let of_pair = |(n, pair): (usize, &Pair)| {
                    let points = (0..pair.positions.len()).map(|i| 3 * i..3 * i + 3);
                    let rows = points.flat_map(|at| columns.iter().map(move |c| &c[n][at.clone()]));
                    rows.flatten().copied().collect()
                };
                self.placed.pairs.iter().enumerate().map(of_pair).collect()
            });
        }
        Self {
            placed: self.placed.clone(),
            twists: response::beside(parts.iter().map(|p| &p.twists)),
            phi: all(|p| &p.phi),
            mu: all(|p| &p.mu),
            reached: reached.fold(Reached::default(), Reached::worst),
            fields,
        }
    }
}

impl CoupledResponse for PanelSolution<'_> {
    fn reached(&self) -> Reached {
        self.reached
    }

    fn momenta(&self) -> Result<DMatrix<f64>> {
        let columns = (0..self.twists.ncols())
            .map(|k| (self.placed).impulse(&self.phi.column(k), &self.mu.column(k)));
        let mut out = DMatrix::zeros(self.twists.nrows(), self.twists.ncols());
        for (k, column) in columns.enumerate() {
            out.set_column(k, &column);
        }
        Ok(out + self.placed.coupled.lacking(&self.twists))
    }

    fn energies(&self) -> Result<DMatrix<f64>> {
        let (k, flux) = (self.twists.ncols(), self.placed.flux(&self.twists));
        let lacking = self
            .twists
            .tr_mul(&self.placed.coupled.lacking(&self.twists));
        Ok(DMatrix::from_fn(k, k, |i, j| {
            let products = (0..flux.rows).map(|s| flux.at(s, i) * self.phi.at(s, j));
            lacking[(i, j)] + products.sum::<f64>()
        }))
    }

    fn gradient(&self) -> Result<PairTensor> {
        Ok(self.placed.gradient(self))
    }

    fn directions(&self, directions: &[Direction]) -> Result<Box<dyn CoupledResponse + '_>> {
        Ok(Box::new(self.along(directions)?))
    }

    fn shape_vjp(&self, terms: &[ShapeTerm]) -> Result<Option<DVector<f64>>> {
        self.shape_slopes(terms).map(Some)
    }

    fn tangent(&self, z: &[Vec6]) -> Result<Tangent> {
        match self.twists.ncols() {
            1 | 2 => self.placed.second(self, z),
            k => Err(Error::input("tangent: columns", k, "must be 1 or 2")),
        }
    }

    fn densities(&self) -> Result<Columns> {
        Ok(self.phi.clone())
    }
}

impl<'a> PanelSolution<'a> {
    /// The solution to these directions, one column each.
    ///
    /// # Errors
    /// A solve that misses its tolerance.
    pub fn along(&self, directions: &[Direction]) -> Result<Self> {
        let parts = directions.iter().map(|direction| match direction {
            Direction::Basis(c) => Ok(self.combine(c)),
            Direction::Twist(x) => {
                let twists = DMatrix::from_column_slice(x.len(), 1, x.as_slice());
                Self::new(self.placed.clone(), twists)
            }
        });
        Ok(self.beside(&parts.collect::<Result<Vec<_>>>()?))
    }
}

/// All numbers times one.
pub(super) fn scaled(factor: f64, x: &[f64]) -> Vec<f64> {
    x.iter().map(|x| factor * x).collect()
}

/// All but each body with its own points and with those of bodies that it doesn't feel; images count always.
fn pairs(coupled: &PanelModel, poses: &[Pose], films: &PlacedFilms) -> Vec<Pair> {
    let mut out = Vec::new();
    for target in 0..coupled.bodies.len() {
        for image in &coupled.images {
            for source in 0..coupled.bodies.len() {
                let apart = source == target || coupled.excluded.contains(source, target);
                if apart && image.is_identity() {
                    continue;
                }
                let points = &coupled.bodies[source].faces.centres;
                let (at, from) = ((target, &poses[target]), (source, &poses[source]));
                out.push(Pair::new(at, from, image, points).held_off(films));
            }
        }
    }
    out
}

fn readouts(coupled: &PanelModel, pairs: &[Pair], twists: &DMatrix<f64>) -> Vec<Option<Columns>> {
    let own = |(b, body): (usize, &Arc<crate::boundary::PanelBoundary>)| {
        moves(twists, b).then(|| {
            let mut columns = Columns::zeros(coupled.rows(), 6);
            let rows = columns.slice_mut(&coupled.faces[b]).iter_mut().enumerate();
            rows.for_each(|(n, x)| *x = body.single_layer()[(n / 6, n % 6)]);
            columns
        })
    };
    let mut out: Vec<_> = coupled.bodies.iter().enumerate().map(own).collect();
    for pair in pairs {
        let Some(columns) = &mut out[pair.target] else {
            continue;
        };
        let body = &coupled.bodies[pair.target];
        let q = body.normal_velocity();
        let sign = pair.image.sign;
        let q: Vec<f64> = (0..6 * q.nrows())
            .map(|n| sign * q[(n / 6, n % 6)])
            .collect();
        let out = columns.slice_mut(&coupled.faces[pair.source]);
        single_sum(body.panels().triangles(), &pair.points, &q, 6, out);
    }
    out
}
