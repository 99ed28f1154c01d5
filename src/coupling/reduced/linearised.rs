//! One evaluation of the reduced coupling: value and first derivative. What a value costs is all that the derivatives need.

use super::Reduced;
use super::link::Link;
use super::placed::PlacedSkeletons;
use super::views::{FLUX, view, view_mut};
use crate::Result;
use crate::adjoint::kernel::{Points, potential_vjp};
use crate::adjoint::lie::{Pose, Vec3, Vec6, linear, point_wrench};
use crate::boundary::PanelBoundary;
use crate::coupling::film::PlacedFilms;
use crate::coupling::pair::{vector, wrench};
use crate::coupling::settings::check_asked;
use crate::coupling::surface;
use crate::coupling::{
    Coupling, CouplingReport, Direction, Linearise, Linearised, Momenta, Motion, MotionBar,
    Pullback, ShapeTerm, SurfacePotential, Tangent,
};
use crate::once::once;
use crate::solver::{Cholesky, matmul};
use faer::reborrow::ReborrowMut;
use faer::{Accum, MatRef};
use nalgebra::{DMatrix, DVector};
use std::sync::{Arc, OnceLock};

/// Work of [`ReducedLinearised::new`] per pair of points, relative to that of its derivatives.
const FILL: usize = 8;
/// Of [`ReducedLinearised::pull_back`].
pub(super) const PULL: usize = 1;

/// [`Reduced`] solved for a basis.
pub(super) struct ReducedLinearised<'a> {
    pub reduced: &'a Reduced,
    pub poses: Vec<Pose>,
    pub placed: Vec<PlacedSkeletons<'a>>,
    /// Of the gaps.
    pub films: PlacedFilms,
    /// Of I − LᵀGL.
    pub factor: Cholesky,
    /// LᵀGŪ, modes × 6 bodies.
    pub solution: DMatrix<f64>,
    /// ŪᵀGŪ, 6 bodies × 6 bodies.
    direct: DMatrix<f64>,
    pub basis: DMatrix<f64>,
    /// a of the basis columns.
    a: DMatrix<f64>,
    /// α of the basis columns.
    pub alpha: DMatrix<f64>,
    momenta: DMatrix<f64>,
    /// Made when first asked for.
    fields: OnceLock<Vec<Fields>>,
    report: CouplingReport,
}

/// ∇ of the potentials at a link's source points that the targets' charges make, one for each column of the
/// basis, `[j][k][3]`; and where the link fades those potentials, `[j][k]`.
struct Fields {
    field: Vec<f64>,
    sums: Vec<f64>,
}

/// Solution to one combination of twists.
pub(super) struct ReducedResponse {
    pub twists: DVector<f64>,
    a: DVector<f64>,
    /// α, all points.
    pub alpha: DVector<f64>,
}

impl<'a> ReducedLinearised<'a> {
    pub fn new(reduced: &'a Reduced, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Self> {
        check_asked(reduced, poses, basis)?;
        reduced.check_memory()?;
        let films = reduced.placed_films(poses, basis)?;
        let place = |link: &'a Link| {
            let placed = link.place(&reduced.bodies, poses, &films)?;
            let block = placed.block(&reduced.bodies);
            Some((placed, block))
        };
        let (placed, blocks): (Vec<_>, Vec<_>) =
            (reduced.over(&reduced.links, FILL, place).into_iter())
                .flatten()
                .unzip();
        let (n, w) = (reduced.mode_count(), 6 * reduced.bodies.len());
        let mut system = DMatrix::identity(n, n);
        let mut solution = DMatrix::zeros(n, w);
        let mut direct = DMatrix::zeros(w, w);
        for (placed, block) in placed.iter().zip(&blocks) {
            let (t, s) = (placed.link.target, placed.link.source);
            let factor = placed.link.factor * placed.weight[0];
            for (ends, block) in [((t, s), block.as_ref()), ((s, t), block.transpose())] {
                let into = (&mut system, &mut solution, &mut direct);
                scatter(reduced, ends, factor, block, into);
            }
        }
        let Some(factor) = Cholesky::new(system.data.into(), n) else {
            return Err(reduced.indefinite(poses, 0.0));
        };
        let mut out = Self {
            report: CouplingReport {
                condition: factor.condition(),
                ..CouplingReport::default()
            },
            reduced,
            poses: poses.to_vec(),
            placed,
            films,
            factor,
            a: &solution * basis,
            solution,
            direct,
            basis: basis.clone(),
            alpha: DMatrix::zeros(0, 0),
            momenta: DMatrix::zeros(0, 0),
            fields: OnceLock::new(),
        };
        out.factor.solve(view_mut(&mut out.a));
        out.alpha = out.charges(basis, &out.a);
        out.momenta = out.impulses(basis, &out.a);
        reduced.check_solution(poses, &out.basis, &out.momenta, out.report.condition)?;
        Ok(out)
    }

    /// The value alone.
    pub fn value(self) -> Momenta {
        Momenta::new(self.momenta, self.report)
    }

    /// α = Ū x̄ + L a, column by column.
    pub fn charges(&self, twists: &DMatrix<f64>, a: &DMatrix<f64>) -> DMatrix<f64> {
        let columns = twists.ncols();
        let mut out = DMatrix::zeros(self.reduced.point_count(), columns);
        let mut all = view_mut(&mut out);
        for (b, body) in self.reduced.bodies.iter().enumerate() {
            let (points, modes) = (&self.reduced.points[b], &self.reduced.modes[b]);
            let (l, u) = view(body.basis()).split_at_col(modes.len());
            let mut own = all.rb_mut().subrows_mut(points.start, points.len());
            let a = view(a).subrows(modes.start, modes.len());
            let twists = view(twists).subrows(6 * b, 6);
            matmul(own.rb_mut(), Accum::Replace, l, a, 1.0);
            matmul(own.rb_mut(), Accum::Add, u, twists, 1.0);
        }
        out
    }

    /// M̄₀ x̄ + 4π (ŪᵀGŪ x̄ + ŪᵀGL a).
    pub fn impulses(&self, twists: &DMatrix<f64>, a: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = FLUX * (&self.direct * twists + self.solution.tr_mul(a));
        for (b, body) in self.reduced.bodies.iter().enumerate() {
            let mut rows = out.rows_mut(6 * b, 6);
            rows += body.parts().added_mass * twists.rows(6 * b, 6);
        }
        self.films.add_impulses(twists, &mut out);
        out
    }

    /// Solution to a direction: a combination of what is there, or one more back-substitution.
    pub fn respond(&self, x: Direction) -> ReducedResponse {
        match x {
            Direction::Basis(c) => ReducedResponse {
                twists: &self.basis * c,
                a: &self.a * c,
                alpha: &self.alpha * c,
            },
            Direction::Twist(x) => {
                let twists = DMatrix::from_column_slice(x.len(), 1, x.as_slice());
                let mut a = &self.solution * &twists;
                self.factor.solve(view_mut(&mut a));
                ReducedResponse {
                    alpha: self.charges(&twists, &a).column(0).into_owned(),
                    a: a.column(0).into_owned(),
                    twists: x.clone(),
                }
            }
        }
    }

    pub fn impulse(&self, x: &ReducedResponse) -> DVector<f64> {
        let column = |v: &DVector<f64>| DMatrix::from_column_slice(v.len(), 1, v.as_slice());
        let out = self.impulses(&column(&x.twists), &column(&x.a));
        out.column(0).into_owned()
    }

    /// From a potential ψ at all points (one column each): δa = (I − LᵀGL)⁻¹ Lᵀψ, the charges L δa, and
    /// the impulses 4π (Ūᵀψ + ŪᵀGL δa).
    pub fn tangent_solution(&self, psi: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        let k = psi.ncols();
        let mut a = DMatrix::zeros(self.reduced.mode_count(), k);
        let mut direct = DMatrix::zeros(6 * self.reduced.bodies.len(), k);
        for (b, body) in self.reduced.bodies.iter().enumerate() {
            let range = &self.reduced.points[b];
            let projected = body.basis().tr_mul(&psi.rows(range.start, range.len()));
            let m = body.modes();
            let at = self.reduced.modes[b].start;
            a.rows_mut(at, m).copy_from(&projected.rows(0, m));
            direct.rows_mut(6 * b, 6).copy_from(&projected.rows(m, 6));
        }
        self.factor.solve(view_mut(&mut a));
        let still = DMatrix::zeros(6 * self.reduced.bodies.len(), k);
        let alpha = self.charges(&still, &a);
        (alpha, FLUX * (direct + self.solution.tr_mul(&a)))
    }

    /// 4π α_xᵀ δG α_y: the Coulomb forces among the charges, as a wrench on each body.
    fn pull_back(&self, x: &[f64], y: &[f64]) -> Vec<Vec6> {
        let one = |placed: &PlacedSkeletons| -> (Vec6, Vec3) {
            let ends = [placed.link.target, placed.link.source];
            let [t, s] = ends.map(|b| self.range(b));
            let (at_target, at_source) = ([&x[t.clone()], &y[t]], [&x[s.clone()], &y[s]]);
            placed.pull_back(&self.reduced.bodies, at_target, at_source)
        };
        let wrenches = self.reduced.over(&self.placed, PULL, one);
        let mut out = vec![Vec6::zeros(); self.reduced.bodies.len()];
        for (placed, (wrench, force)) in self.placed.iter().zip(&wrenches) {
            placed.apply(&self.poses, &self.films, (wrench, force), &mut out);
        }
        out
    }

    fn fields(&self) -> &[Fields] {
        let made = once(&self.fields, || {
            let columns = self.alpha.ncols();
            let one = |placed: &PlacedSkeletons| {
                let (t, s) = (self.range(placed.link.target), &placed.pair.points);
                let own = self.alpha.rows(t.start, t.len()).transpose();
                let mut field = vec![0.0; 3 * columns * s.len()];
                potential_vjp(self.targets(placed), s, own.as_slice(), columns, &mut field);
                let sums = match placed.fading() {
                    true => placed.sums(&self.reduced.bodies, own.as_slice(), columns),
                    false => Vec::new(),
                };
                Fields { field, sums }
            };
            self.reduced.over(&self.placed, columns * PULL, one)
        });
        made.as_slice()
    }

    /// ∇_g E(x, e_k) for every column e_k of the basis: spatial wrenches on the bodies.
    fn pull_back_columns(&self, x: &DVector<f64>) -> Vec<Vec<Vec6>> {
        let (columns, bodies) = (x.len(), self.reduced.bodies.len());
        let mut out = vec![vec![Vec6::zeros(); bodies]; columns];
        for (placed, f) in self.placed.iter().zip(self.fields()) {
            let link = placed.link;
            let s = self.range(link.source);
            let charges = self.alpha.rows(s.start, s.len());
            let along: DVector<f64> = charges * x;
            let at = |j: usize, k: usize| vector(&f.field, columns, j, k);
            let seen: Vec<Vec3> = (0..s.len())
                .map(|j| (0..columns).map(|k| at(j, k) * x[k]).sum())
                .collect();
            let strength = FLUX * link.factor;
            for (k, out) in out.iter_mut().enumerate() {
                let mut total = wrench(&placed.pair.positions, |j| {
                    let force = seen[j] * charges[(j, k)] + at(j, k) * along[j];
                    strength * placed.weight[0] * force
                });
                let pushed = linear(&total);
                if placed.fading() {
                    let p = |j: usize, k: usize| f.sums[columns * j + k];
                    let of = |j: usize| {
                        let own: f64 = (0..columns).map(|m| p(j, m) * x[m]).sum();
                        own * charges[(j, k)] + p(j, k) * along[j]
                    };
                    let energy: f64 = (0..s.len()).map(of).sum();
                    let slope = strength * placed.weight[1] * energy;
                    let force = placed.between.normalize() * slope;
                    total += point_wrench(&placed.centre, &force);
                }
                placed.apply(&self.poses, &self.films, (&total, &pushed), out);
            }
        }
        self.films.add_column_wrenches(x, &mut out);
        out
    }

    /// The points of a link's target as the kernels see them.
    pub fn targets(&self, placed: &PlacedSkeletons) -> &Points {
        self.reduced.bodies[placed.link.target].targets()
    }

    /// Points of body `b`.
    pub fn range(&self, b: usize) -> std::ops::Range<usize> {
        self.reduced.points[b].clone()
    }
}

/// Adds a block into I − LᵀGL, LᵀGŪ and ŪᵀGŪ.
fn scatter(
    reduced: &Reduced,
    (target, source): (usize, usize),
    factor: f64,
    block: MatRef<f64>,
    (system, solution, direct): (&mut DMatrix<f64>, &mut DMatrix<f64>, &mut DMatrix<f64>),
) {
    let (t, s) = (reduced.modes[target].clone(), reduced.modes[source].clone());
    // The lower triangle is all that the factorisation reads.
    if target >= source {
        let all = view_mut(system);
        let mut into = all.submatrix_mut(t.start, s.start, t.len(), s.len());
        into -= faer::Scale(factor) * block.submatrix(0, 0, t.len(), s.len());
    }
    for k in 0..6 {
        for i in 0..t.len() {
            solution[(t.start + i, 6 * source + k)] += factor * block[(i, s.len() + k)];
        }
        for i in 0..6 {
            direct[(6 * target + i, 6 * source + k)] += factor * block[(t.len() + i, s.len() + k)];
        }
    }
}

impl Linearised for ReducedLinearised<'_> {
    fn momenta(&self) -> &DMatrix<f64> {
        &self.momenta
    }

    fn gradient(&self, x: &DVector<f64>, y: &DVector<f64>) -> Result<Vec<Vec6>> {
        let (a, b) = (&self.alpha * x, &self.alpha * y);
        let mut out = self.pull_back(a.as_slice(), b.as_slice());
        self.films.add_basis_wrenches(&self.basis, [x, y], &mut out);
        Ok(out)
    }

    fn gradient_columns(&self, x: &DVector<f64>) -> Result<Vec<Vec<Vec6>>> {
        Ok(self.pull_back_columns(x))
    }

    fn gradient_along(&self, y: &DVector<f64>, z: &[Vec6]) -> Result<DVector<f64>> {
        let charges = &self.alpha * y;
        let films = self.films.along(z);
        let (psi, _) = self.tangent_potentials(&[charges.as_slice()], z, &films);
        let mut rate = DVector::zeros(self.basis.nrows());
        films.add_impulse_rate(&(&self.basis * y), &mut rate);
        Ok(FLUX * self.alpha.tr_mul(&psi.column(0)) + self.basis.tr_mul(&rate))
    }

    fn vjp(&self, x: Direction, y: Direction) -> Result<Pullback> {
        let (x, y) = (self.respond(x), self.respond(y));
        let mut wrench = self.pull_back(x.alpha.as_slice(), y.alpha.as_slice());
        self.films.add_wrenches(&x.twists, &y.twists, &mut wrench);
        Ok(Pullback {
            momentum_x: self.impulse(&x),
            momentum_y: self.impulse(&y),
            wrench,
        })
    }

    fn respond(
        &self,
        twists: &DMatrix<f64>,
        x: &DVector<f64>,
    ) -> Result<(DMatrix<f64>, Vec<Vec<Vec6>>)> {
        Ok(self.respond_many(twists, x))
    }

    fn displaced(&self, x: &DVector<f64>, z: &[Vec<Vec6>]) -> Result<Vec<Tangent>> {
        // Of one displacement its own kernels are less work.
        match z {
            [z] => Ok(vec![self.second(
                Direction::Basis(x),
                Direction::Basis(x),
                z,
            )]),
            _ => Ok(self.second_many(x, z)),
        }
    }

    fn hvp(&self, x: Direction, y: Direction, z: &[Vec6]) -> Result<Tangent> {
        Ok(self.second(x, y, z))
    }

    fn shape_vjp(&self, terms: &[ShapeTerm]) -> Result<DVector<f64>> {
        self.shapes(terms)
    }

    fn report(&self) -> &CouplingReport {
        &self.report
    }
}

impl Coupling for Reduced {
    fn name(&self) -> &'static str {
        "the fidelity reduced"
    }

    fn bodies(&self) -> usize {
        self.bodies.len()
    }

    fn unknowns(&self) -> usize {
        self.mode_count()
    }

    fn shape_parameters(&self) -> usize {
        self.shapes.len()
    }

    fn evaluate(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Momenta> {
        Ok(ReducedLinearised::new(self, poses, basis)?.value())
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
        surface::check(motion, surfaces)?;
        let solved = ReducedLinearised::new(self, motion.poses, &motion.columns())?;
        let moving = solved.films.along(motion.displacement);
        let (charges, seen) = solved.charges_seen(motion, &moving);
        let held = solved.films.any().then_some(surface::Held {
            films: &solved.films,
            moving: &moving,
        });
        let seen = |b: usize| seen.iter().filter(|s| s.target == b).copied().collect();
        Ok(surface::on_surfaces(motion, surfaces, &charges, seen, held))
    }

    fn surface_potentials_vjp(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
        bars: &[SurfacePotential],
    ) -> Result<MotionBar> {
        surface::check(motion, surfaces)?;
        self.solved_apart(motion)?
            .potentials_vjp(motion, surfaces, bars)
    }

    fn differentiable(&self) -> Option<&dyn Linearise> {
        Some(self)
    }
}

impl Linearise for Reduced {
    fn linearise(&self, poses: &[Pose], basis: &DMatrix<f64>) -> Result<Box<dyn Linearised + '_>> {
        Ok(Box::new(ReducedLinearised::new(self, poses, basis)?))
    }
}
