//! One evaluation of the coupled system: value and first derivative.

use super::Full;
use super::body::unit_twists;
use super::system::System;
use crate::Result;
use crate::adjoint::lie::{Pose, Vec3, Vec6};
use crate::coupling::pair::{Pair, wrench};
use crate::coupling::settings::asymmetry;
use crate::coupling::{Direction, PairTensor, Pullback, Record, Report, Tangent};
use crate::solver::{Columns, transposed_product};
use nalgebra::{DMatrix, DVector};

/// Record of [`Full`].
pub(super) struct FullRecord<'a> {
    pub full: &'a Full,
    pub poses: Vec<Pose>,
    pub pairs: Vec<Pair>,
    pub system: System<'a>,
    basis: DMatrix<f64>,
    /// a, λ, μ, r of the basis columns.
    a: Columns,
    lambda: Columns,
    mu: Columns,
    r: Columns,
    /// Pᵀ B₆ of each body that the basis moves, over all sources.
    pub readout: Vec<Option<Columns>>,
    momenta: DMatrix<f64>,
    gradient: PairTensor,
    report: Report,
}

/// Answer of the coupled system to one combination of twists.
pub(super) struct Response {
    pub twists: Vec<Vec6>,
    pub a: Vec<f64>,
    pub lambda: Vec<f64>,
    pub mu: Vec<f64>,
    pub r: Vec<f64>,
}

/// Three-vector `k` of row `j` in a `[j][columns][3]` array.
#[inline]
pub(super) fn gradient_at(g: &[f64], columns: usize, j: usize, k: usize) -> Vec3 {
    let at = 3 * (j * columns + k);
    Vec3::new(g[at], g[at + 1], g[at + 2])
}

/// Twists of body `b` in the columns of a stacked matrix.
fn body_twists(basis: &DMatrix<f64>, b: usize) -> Vec<Vec6> {
    (0..basis.ncols())
        .map(|k| basis.fixed_view::<6, 1>(6 * b, k).into_owned())
        .collect()
}

impl<'a> FullRecord<'a> {
    pub fn new(
        full: &'a Full,
        poses: &[Pose],
        basis: &DMatrix<f64>,
        derivative: bool,
    ) -> Result<Self> {
        let pairs = full.pairs(poses);
        let system = System::new(full, &pairs);
        let k = basis.ncols();
        let moving: Vec<bool> = (0..full.bodies.len())
            .map(|b| basis.rows(6 * b, 6).iter().any(|x| *x != 0.0))
            .collect();
        let readout = readouts(full, &pairs, &moving);
        let mut f = Columns::zeros(full.rows(), k);
        let mut g = Columns::zeros(full.columns(), k);
        for (b, body) in full.bodies.iter().enumerate() {
            let Some(readout) = &readout[b] else { continue };
            let twists = body_twists(basis, b);
            let range = &full.faces[b];
            f.slice_mut(range.start, range.end)
                .copy_from_slice(&body.twist_rows(&twists));
            for j in 0..g.rows {
                let row = Vec6::from_row_slice(readout.row(j));
                for (x, twist) in g.slice_mut(j, j + 1).iter_mut().zip(&twists) {
                    *x += row.dot(twist);
                }
            }
        }
        let solved = system.respond(&f, &g)?;
        let raw = DMatrix::from_fn(k, k, |i, j| {
            (0..g.rows)
                .map(|s| g.at(s, i) * solved.a.at(s, j))
                .sum::<f64>()
        });
        let volume = |b: usize| full.bodies[b].boundary.faces.volume();
        let asymmetry = asymmetry(&raw, basis, volume);
        let report = Report {
            iterations: solved.iterations,
            residual: solved.residual,
            asymmetry,
            condition: 0.0,
        };
        let mut out = Self {
            full,
            poses: poses.to_vec(),
            system,
            basis: basis.clone(),
            a: solved.a,
            lambda: solved.lambda,
            mu: solved.mu,
            r: solved.r,
            momenta: DMatrix::zeros(6 * full.bodies.len(), k),
            gradient: PairTensor::zeros(full.bodies.len(), k),
            readout,
            report,
            pairs,
        };
        for column in 0..k {
            let h = out.impulse(&out.a.column(column), &out.mu.column(column));
            out.momenta.set_column(column, &h);
        }
        if derivative && k > 0 {
            out.gradient = out.tensor();
        }
        Ok(out)
    }

    /// The basis and its strengths a.
    pub fn solution(&self) -> (&DMatrix<f64>, &Columns) {
        (&self.basis, &self.a)
    }

    /// ½ {B₆ᵀ P a + F₆ᵀ μ}: body-frame impulses of all bodies (zero for those the basis doesn't move).
    pub fn impulse(&self, a: &[f64], mu: &[f64]) -> DVector<f64> {
        let mut out = DVector::zeros(6 * self.full.bodies.len());
        for (b, body) in self.full.bodies.iter().enumerate() {
            let Some(readout) = &self.readout[b] else {
                continue;
            };
            let mut h = Vec6::zeros();
            for (j, strength) in a.iter().enumerate() {
                h += Vec6::from_row_slice(readout.row(j)) * *strength;
            }
            let range = self.full.faces[b].clone();
            for (row, m) in body.boundary.twist_rows.iter().zip(&mu[range]) {
                h += row * *m;
            }
            out.fixed_rows_mut::<6>(6 * b).copy_from(&(0.5 * h));
        }
        out
    }

    /// Answer to a direction: a combination of what is there, or a further solve.
    pub fn respond(&self, x: Direction) -> Result<Response> {
        match x {
            Direction::Basis(c) => {
                let c = c.as_slice();
                let twists = &self.basis * DVector::from_column_slice(c);
                Ok(Response {
                    twists: split(&twists),
                    a: self.a.combine(c),
                    lambda: self.lambda.combine(c),
                    mu: self.mu.combine(c),
                    r: self.r.combine(c),
                })
            }
            Direction::Twist(x) => {
                let twists = split(x);
                let mut f = Columns::zeros(self.full.rows(), 1);
                let mut g = Columns::zeros(self.full.columns(), 1);
                for (b, body) in self.full.bodies.iter().enumerate() {
                    let range = &self.full.faces[b];
                    f.data[range.clone()].copy_from_slice(&body.twist_rows(&[twists[b]]));
                    if let Some(readout) = &self.readout[b] {
                        for (j, value) in g.data.iter_mut().enumerate() {
                            *value += Vec6::from_row_slice(readout.row(j)).dot(&twists[b]);
                        }
                    }
                }
                let solved = self.system.respond(&f, &g)?;
                Ok(Response {
                    twists,
                    a: solved.a.data,
                    lambda: solved.lambda.data,
                    mu: solved.mu.data,
                    r: solved.r.data,
                })
            }
        }
    }

    /// ∇_g E for all pairs of basis columns.
    fn tensor(&self) -> PairTensor {
        let k = self.basis.ncols();
        let mut wrenches = vec![DMatrix::zeros(6, k * k); self.full.bodies.len()];
        for pair in &self.pairs {
            let raw = self.pair_tensor(pair);
            let pose = &self.poses[pair.target];
            for x in 0..k {
                for y in 0..=x {
                    let w =
                        Vec6::from_fn(|c, _| 0.5 * (raw.at(6 * x + c, y) + raw.at(6 * y + c, x)));
                    let world = pose.wrench_to_world(&w);
                    let back = pair.image.twist_vjp(&world);
                    let mut add = |b: usize, w: &Vec6| {
                        let mut column = wrenches[b].fixed_view_mut::<6, 1>(0, x * k + y);
                        column += w;
                        if x != y {
                            let mut column = wrenches[b].fixed_view_mut::<6, 1>(0, y * k + x);
                            column += w;
                        }
                    };
                    add(pair.source, &back);
                    add(pair.target, &-world);
                }
            }
        }
        PairTensor::new(k, wrenches)
    }

    /// Σ_j arm_j { (∇P_x − ∇μ_x) a_y + ∇r_x λ_y }, rows 6·x + component, columns y, in the target's frame.
    fn pair_tensor(&self, pair: &Pair) -> Columns {
        let k = self.basis.ncols();
        let body = &self.full.bodies[pair.target];
        let twists = body_twists(&self.basis, pair.target);
        let active: Vec<usize> = (0..k).filter(|x| twists[*x] != Vec6::zeros()).collect();
        let own: Vec<Vec6> = active.iter().map(|x| twists[*x]).collect();
        let faces = &self.full.faces[pair.target];
        let (mu, r) = (
            self.mu.slice(faces.start, faces.end),
            self.r.slice(faces.start, faces.end),
        );
        let mut bar = Vec::with_capacity(2 * mu.len());
        for (m, r) in mu.chunks_exact(k).zip(r.chunks_exact(k)) {
            bar.extend_from_slice(m);
            bar.extend_from_slice(r);
        }
        let fields = body.vjp(&pair.points, &bar, 2 * k);
        let potential = body.potential_vjp(&pair.points, &body.readout_rows(&own), own.len());
        let sources = pair.positions.len();
        let mut charge = vec![0.0; sources * 6 * k];
        let mut residual = vec![0.0; sources * 6 * k];
        for (j, s) in pair.positions.iter().enumerate() {
            for x in 0..k {
                let mut q = -gradient_at(&fields, 2 * k, j, x);
                if let Some(at) = active.iter().position(|i| *i == x) {
                    q += gradient_at(&potential, own.len(), j, at);
                }
                let rho = gradient_at(&fields, 2 * k, j, k + x);
                let at = (j * k + x) * 6;
                charge[at..at + 3].copy_from_slice(q.as_slice());
                charge[at + 3..at + 6].copy_from_slice(s.cross(&q).as_slice());
                residual[at..at + 3].copy_from_slice(rho.as_slice());
                residual[at + 3..at + 6].copy_from_slice(s.cross(&rho).as_slice());
            }
        }
        let range = &self.full.sources[pair.source];
        let part = |x: &Columns| Columns {
            rows: sources,
            columns: k,
            data: x.slice(range.start, range.end).to_vec(),
        };
        let mut out = transposed_product(&charge, 6 * k, &part(&self.a));
        let rest = transposed_product(&residual, 6 * k, &part(&self.lambda));
        out.add_scaled(&rest, &vec![1.0; k]);
        out
    }

    /// ∇_g E(x, y) from two responses.
    fn pull_back(&self, x: &Response, y: &Response) -> Vec<Vec6> {
        let mut out = vec![Vec6::zeros(); self.full.bodies.len()];
        for pair in &self.pairs {
            let body = &self.full.bodies[pair.target];
            let t = pair.target;
            let faces = self.full.faces[t].clone();
            let bar: Vec<f64> = faces
                .flat_map(|i| [x.mu[i], x.r[i], y.mu[i], y.r[i]])
                .collect();
            let fields = body.vjp(&pair.points, &bar, 4);
            let rows = body.readout_rows(&[x.twists[t], y.twists[t]]);
            let potential = body.potential_vjp(&pair.points, &rows, 2);
            let at = self.full.sources[pair.source].start;
            let w = wrench(&pair.positions, |j| {
                let (g, p) = (
                    |k| gradient_at(&fields, 4, j, k),
                    |k| gradient_at(&potential, 2, j, k),
                );
                let s = at + j;
                0.5 * ((p(0) - g(0)) * y.a[s]
                    + g(1) * y.lambda[s]
                    + (p(1) - g(2)) * x.a[s]
                    + g(3) * x.lambda[s])
            });
            pair.apply(&self.poses[t], &w, &mut out);
        }
        out
    }
}

/// Pᵀ B₆ of each moving body over all sources: its own block and every image that its faces see.
fn readouts(full: &Full, pairs: &[Pair], moving: &[bool]) -> Vec<Option<Columns>> {
    let units = unit_twists();
    let mut out: Vec<Option<Columns>> = moving
        .iter()
        .map(|m| m.then(|| Columns::zeros(full.columns(), 6)))
        .collect();
    for (b, body) in full.bodies.iter().enumerate() {
        if let Some(columns) = &mut out[b] {
            let own = columns.slice_mut(full.sources[b].start, full.sources[b].end);
            for (row, p) in own.chunks_exact_mut(6).zip(&body.boundary.readout) {
                row.copy_from_slice(p.as_slice());
            }
        }
    }
    for pair in pairs {
        let body = &full.bodies[pair.target];
        if let Some(columns) = &mut out[pair.target] {
            let part = body.potential(&pair.points, &body.readout_rows(&units), 6);
            let range = &full.sources[pair.source];
            let target = columns.slice_mut(range.start, range.end);
            for (t, p) in target.iter_mut().zip(part) {
                *t += p;
            }
        }
    }
    out
}

fn split(x: &DVector<f64>) -> Vec<Vec6> {
    (0..x.len() / 6)
        .map(|b| x.fixed_rows::<6>(6 * b).into_owned())
        .collect()
}

impl Record for FullRecord<'_> {
    fn momenta(&self) -> &DMatrix<f64> {
        &self.momenta
    }

    fn gradient(&self, x: &DVector<f64>, y: &DVector<f64>) -> Vec<Vec6> {
        self.gradient.contract(x, y)
    }

    fn gradient_along(&self, y: &DVector<f64>, z: &[Vec6]) -> DVector<f64> {
        self.gradient.along(y, z)
    }

    fn vjp(&self, x: Direction, y: Direction) -> Result<Pullback> {
        let (x, y) = (self.respond(x)?, self.respond(y)?);
        Ok(Pullback {
            momentum_x: self.impulse(&x.a, &x.mu),
            momentum_y: self.impulse(&y.a, &y.mu),
            wrench: self.pull_back(&x, &y),
        })
    }

    fn hvp(&self, x: Direction, y: Direction, z: &[Vec6]) -> Result<Tangent> {
        self.second(x, y, z)
    }

    fn report(&self) -> &Report {
        &self.report
    }
}
