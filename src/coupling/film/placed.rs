//! A film at given poses: the added mass that it has beyond one that is held apart, with derivatives.

use super::jet::{Displaced, Jet};
use super::layer::{Cell, Layer};
use super::{Film, Side};
use crate::adjoint::lie::{Mat6, Pose, Vec3, Vec6, cross_force, cross_motion, point_wrench};
use crate::solver::SparseCholesky;
use faer::MatMut;
use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use num_dual::{Dual2SVec64, DualSVec64};
use std::sync::OnceLock;

type First = DualSVec64<6>;
type Second = Dual2SVec64<6>;

/// A film whose gap is below what others resolve.
pub(crate) struct PlacedFilm<'a> {
    pub film: &'a Film,
    /// Pose of the first body in the frame of the other, or in that of the world.
    relative: Pose,
    /// Frame of what is opposite, to world.
    frame: Pose,
    /// How far others are to hold the two apart, in the frame of each.
    pub shift: [Vec3; 2],
    /// At density 1.
    mass: Mass,
    /// Of each vertex, its number among those at which there is a potential.
    numbers: Vec<Option<usize>>,
    /// As it is, and held apart.
    solved: [Solved; 2],
    first: OnceLock<Derivatives>,
    second: OnceLock<Derivatives>,
}

/// Over the twists of the first body and of the other, frame of the first.
type Mass = SMatrix<f64, TWISTS, TWISTS>;
/// Components of both.
const TWISTS: usize = 12;

/// A film's potential for unit twists.
struct Solved {
    factor: SparseCholesky,
    /// Active vertices × [`TWISTS`].
    potential: DMatrix<f64>,
}

/// Derivatives of the mass and of the shifts along the first body's displacement against the other.
struct Derivatives {
    mass: [Mass; 6],
    shift: [[Vec3; 6]; 2],
    /// `[k][l]`.
    bent_mass: Vec<[Mass; 6]>,
    /// `[frame][k][l]`.
    bent_shift: [Vec<[Vec3; 6]>; 2],
}

impl<'a> PlacedFilm<'a> {
    /// None where the gap is wide. `Err`: a distance that isn't positive, or 0 where the film has no solution.
    pub fn new(film: &'a Film, poses: &[Pose]) -> Result<Option<Self>, f64> {
        let frame = match film.other {
            Side::Body(b) => poses[b],
            Side::Wall(_) => Pose::identity(),
        };
        let relative = frame.inverse().compose(&poses[film.body]);
        let Some(layer) = film.layer::<f64>(&relative, None)? else {
            return Ok(None);
        };
        let solved = [0, 1].map(|k| film.solve(&layer, k));
        let [Some(near), Some(apart)] = solved else {
            return Err(0.0);
        };
        let mass = film
            .loads(&layer)
            .tr_mul(&(&near.potential - &apart.potential));
        let mass = Mass::from_fn(|i, j| 0.5 * (mass[(i, j)] + mass[(j, i)]));
        Ok(Some(Self {
            film,
            relative,
            frame,
            shift: layer.shift.map(Vec3::from),
            mass,
            numbers: layer.numbers,
            solved: [near, apart],
            first: OnceLock::new(),
            second: OnceLock::new(),
        }))
    }

    fn derivatives<D: Jet>(&self) -> Derivatives {
        // The same decisions as for the value, whatever rounding makes of them here.
        let known = Some(self.numbers.as_slice());
        let layer = self.film.layer::<D>(&self.relative, known).ok().flatten();
        let Some(layer) = layer else {
            return Derivatives::none();
        };
        let mut out = Derivatives::none();
        for (s, shift) in layer.shift.iter().enumerate() {
            for k in 0..6 {
                out.shift[s][k] = Vec3::from_fn(|i, _| shift[i].first()[k]);
                for l in 0..6 {
                    out.bent_shift[s][k][l] = Vec3::from_fn(|i, _| shift[i].second()[(k, l)]);
                }
            }
        }
        for (which, solved) in self.solved.iter().enumerate() {
            let sign = if which == 0 { 1.0 } else { -1.0 };
            let psi = &solved.potential;
            for (cell, square, _) in cells(self.film, &layer, psi) {
                out.add(&cell.thickness[which], -sign, &square);
                // b changes with the other side's normal: ψᵀ δb and its transpose.
                let own = corners(cell, psi);
                for (i, n) in cell.facing.iter().enumerate() {
                    let pushed = own.tr_mul(&self.film.pushed(cell, &Vec3::ith(i, 1.0)));
                    out.add(n, sign, &(pushed + pushed.transpose()));
                }
            }
            for (v, rim) in layer.rim.iter().enumerate() {
                let row = psi.fixed_view::<1, TWISTS>(v, 0).transpose();
                out.add(rim, -sign, &(row * row.transpose()));
            }
            if D::NDERIV > 1 {
                let both = self.film.answers(&layer, solved, which);
                for k in 0..6 {
                    for l in 0..6 {
                        let at = (TWISTS * k, TWISTS * l);
                        let one = both.fixed_view::<TWISTS, TWISTS>(at.0, at.1);
                        out.bent_mass[k][l] += sign * (one + one.transpose());
                    }
                }
            }
        }
        out
    }

    fn first(&self) -> &Derivatives {
        self.first.get_or_init(|| self.derivatives::<First>())
    }

    fn second(&self) -> &Derivatives {
        self.second.get_or_init(|| self.derivatives::<Second>())
    }

    /// Twice the energy of body-frame twists.
    fn energy<D: Jet>(&self, mass: &[[D; TWISTS]; TWISTS], x: &Twists, y: &Twists) -> D {
        let relative = Displaced::<D>::new(&self.relative);
        let of = |x: &Twists| -> [D; TWISTS] {
            let other = relative.twist_to_body(&x.other);
            std::array::from_fn(|i| match i < 6 {
                true => D::from(x.own[i]),
                false => other[i - 6],
            })
        };
        let (x, y) = (of(x), of(y));
        // A wall doesn't move.
        let moving = match self.film.other {
            Side::Body(_) => TWISTS,
            Side::Wall(_) => 6,
        };
        let mut out = D::from(0.0);
        for i in 0..moving {
            for j in 0..moving {
                out += mass[i][j] * x[i] * y[j];
            }
        }
        out
    }

    fn mass_first(&self) -> [[First; TWISTS]; TWISTS] {
        let d = self.first();
        entries(|i, j| {
            let slope = Vec6::from_fn(|k, _| d.mass[k][(i, j)]);
            First::new(self.mass[(i, j)], num_dual::Derivative::some(slope))
        })
    }

    fn mass_second(&self) -> [[Second; TWISTS]; TWISTS] {
        let d = self.second();
        entries(|i, j| {
            let slope = Vec6::from_fn(|k, _| d.mass[k][(i, j)]).transpose();
            let bent = Mat6::from_fn(|k, l| d.bent_mass[k][l][(i, j)]);
            let some = num_dual::Derivative::some(bent);
            Second::new(self.mass[(i, j)], num_dual::Derivative::some(slope), some)
        })
    }

    fn twists(&self, x: &DVector<f64>) -> Twists {
        let of = |b: usize| x.fixed_rows::<6>(6 * b).into_owned();
        Twists {
            own: of(self.film.body),
            other: match self.film.other {
                Side::Body(b) => of(b),
                Side::Wall(_) => Vec6::zeros(),
            },
        }
    }

    /// Adds the impulses of the twists in the columns, body frames.
    pub fn add_impulses(&self, twists: &DMatrix<f64>, out: &mut DMatrix<f64>) {
        for c in 0..twists.ncols() {
            let x = self.twists(&twists.column(c).into_owned());
            let other = self.relative.twist_to_body(&x.other);
            let mut both = SVector::<f64, TWISTS>::zeros();
            both.fixed_rows_mut::<6>(0).copy_from(&x.own);
            both.fixed_rows_mut::<6>(6).copy_from(&other);
            let impulses = self.mass * both;
            let impulse: Vec6 = impulses.fixed_rows::<6>(0).into_owned();
            let back: Vec6 = impulses.fixed_rows::<6>(6).into_owned();
            let mut add = |b: usize, wrench: &Vec6| {
                let mut rows = out.fixed_view_mut::<6, 1>(6 * b, c);
                rows += wrench;
            };
            add(self.film.body, &impulse);
            if let Side::Body(b) = self.film.other {
                add(b, &self.relative.wrench_to_world(&back));
            }
        }
    }

    /// The displacement of the first body against the other, frame of the other, of spatial displacements.
    pub fn displacement(&self, z: &[Vec6]) -> Vec6 {
        let relative = match self.film.other {
            Side::Body(b) => z[self.film.body] - z[b],
            Side::Wall(_) => z[self.film.body],
        };
        self.frame.twist_to_body(&relative)
    }

    /// Rate of the shift in the frame `at` (0: of the first) along a displacement.
    pub fn shift_rate(&self, at: usize, displacement: &Vec6) -> Vec3 {
        let rates = &self.first().shift[at];
        (0..6).map(|k| rates[k] * displacement[k]).sum()
    }

    /// The wrench, frame of the other, that a force in the frame `at` exerts by way of the shift.
    pub fn shift_wrench(&self, at: usize, force: &Vec3) -> Vec6 {
        let rates = &self.first().shift[at];
        Vec6::from_fn(|k, _| rates[k].dot(force))
    }

    /// Its tangent along a displacement, for a force that changes by `dforce`.
    pub fn shift_wrench_tangent(
        &self,
        at: usize,
        force: &Vec3,
        dforce: &Vec3,
        along: &Vec6,
    ) -> Vec6 {
        let d = self.second();
        let wrench = Vec6::from_fn(|k, _| d.shift[at][k].dot(force));
        Vec6::from_fn(|k, _| {
            let bent: Vec3 = (0..6).map(|l| d.bent_shift[at][k][l] * along[l]).sum();
            d.shift[at][k].dot(dforce) + bent.dot(force) + half_bracket(k, along, &wrench)
        })
    }

    /// ∇E(x, y), frame of the other.
    pub fn wrench(&self, x: &DVector<f64>, y: &DVector<f64>) -> Vec6 {
        let (x, y) = (self.twists(x), self.twists(y));
        self.energy(&self.mass_first(), &x, &y).first()
    }

    /// ∇E(x, e) of several e.
    pub fn wrenches(&self, x: &DVector<f64>, columns: &DMatrix<f64>) -> Vec<Vec6> {
        let (mass, x) = (self.mass_first(), self.twists(x));
        let of = |c: usize| self.twists(&columns.column(c).into_owned());
        let all = 0..columns.ncols();
        all.map(|c| self.energy(&mass, &x, &of(c)).first())
            .collect()
    }

    /// ∇E(x, y) and its tangent along a displacement, frame of the other.
    pub fn wrench_tangent(&self, x: &DVector<f64>, y: &DVector<f64>, along: &Vec6) -> (Vec6, Vec6) {
        let (x, y) = (self.twists(x), self.twists(y));
        let energy = self.energy(&self.mass_second(), &x, &y);
        let wrench = energy.first();
        let bent = energy.second() * along;
        let tangent = Vec6::from_fn(|k, _| bent[k] + half_bracket(k, along, &wrench));
        (wrench, tangent)
    }

    /// Adds the tangent of the impulses of twists that stay as they are.
    pub fn add_impulse_tangent(&self, x: &DVector<f64>, along: &Vec6, out: &mut DVector<f64>) {
        let (mass, x) = (self.mass_first(), self.twists(x));
        for i in 0..12 {
            let unit = Vec6::from_fn(|k, _| if k == i % 6 { 1.0 } else { 0.0 });
            let (body, y) = match (i < 6, self.film.other) {
                (true, _) => (self.film.body, Twists::new(unit, Vec6::zeros())),
                (false, Side::Body(b)) => (b, Twists::new(Vec6::zeros(), unit)),
                (false, Side::Wall(_)) => continue,
            };
            out[6 * body + i % 6] += self.energy(&mass, &x, &y).first().dot(along);
        }
    }

    /// Adds a wrench in the frame of the other to both bodies, as spatial wrenches.
    pub fn apply(&self, wrench: &Vec6, out: &mut [Vec6]) {
        self.apply_world(&self.frame.wrench_to_world(wrench), out);
    }

    fn apply_world(&self, world: &Vec6, out: &mut [Vec6]) {
        out[self.film.body] += world;
        if let Side::Body(b) = self.film.other {
            out[b] -= world;
        }
    }

    /// Tangent of [`PlacedFilm::apply`] along spatial displacements.
    pub fn apply_tangent(&self, wrench: &Vec6, dwrench: &Vec6, z: &[Vec6], out: &mut [Vec6]) {
        let turned = match self.film.other {
            Side::Body(b) => cross_force(&z[b], &self.frame.wrench_to_world(wrench)),
            Side::Wall(_) => Vec6::zeros(),
        };
        self.apply_world(&(turned + self.frame.wrench_to_world(dwrench)), out);
    }
}

/// Body-frame twists of the two sides.
struct Twists {
    own: Vec6,
    other: Vec6,
}

impl Twists {
    fn new(own: Vec6, other: Vec6) -> Self {
        Self { own, other }
    }
}

/// What order makes of a second derivative: displacements don't commute.
fn half_bracket(k: usize, along: &Vec6, wrench: &Vec6) -> f64 {
    let unit = Vec6::from_fn(|i, _| if i == k { 1.0 } else { 0.0 });
    0.5 * cross_motion(&unit, along).dot(wrench)
}

fn entries<T>(f: impl Fn(usize, usize) -> T) -> [[T; TWISTS]; TWISTS] {
    std::array::from_fn(|i| std::array::from_fn(|j| f(i, j)))
}

/// A row for each corner of a face.
type Corners = SMatrix<f64, 3, TWISTS>;

/// The potential at the corners of a face.
fn corners<D>(cell: &Cell<D>, psi: &DMatrix<f64>) -> Corners {
    let mut own = Corners::zeros();
    for (i, at) in cell.corners.iter().enumerate() {
        if let Some(at) = at {
            own.row_mut(i).copy_from(&psi.row(*at));
        }
    }
    own
}

/// The faces of a layer, each with ∫∇ψ·∇ψ and ∫∇φ_i·∇ψ over it at thickness 1.
fn cells<'l, D: Jet>(
    film: &'l Film,
    layer: &'l Layer<D>,
    psi: &'l DMatrix<f64>,
) -> impl Iterator<Item = (&'l Cell<D>, Mass, Corners)> {
    layer.cells.iter().map(|cell| {
        let element = &film.surface.faces[cell.face];
        let own = corners(cell, psi);
        let slopes = element.slopes * own * element.area;
        (cell, own.tr_mul(&slopes), slopes)
    })
}

impl Derivatives {
    fn none() -> Self {
        Self {
            mass: [Mass::zeros(); 6],
            shift: [[Vec3::zeros(); 6]; 2],
            bent_mass: vec![[Mass::zeros(); 6]; 6],
            bent_shift: [0, 1].map(|_| vec![[Vec3::zeros(); 6]; 6]),
        }
    }

    /// Adds what a matrix with the strength `factor` contributes to the mass by its derivatives.
    fn add<D: Jet>(&mut self, factor: &D, sign: f64, matrix: &Mass) {
        let first = sign * factor.first();
        for k in 0..6 {
            self.mass[k] += first[k] * matrix;
        }
        if D::NDERIV > 1 {
            let second = sign * factor.second();
            for k in 0..6 {
                for l in 0..6 {
                    self.bent_mass[k][l] += second[(k, l)] * matrix;
                }
            }
        }
    }
}

impl Film {
    /// What the other body's twist pushes on a face, at its corners, if `normal` is its normal times its part of the area.
    fn pushed<D>(&self, cell: &Cell<D>, normal: &Vec3) -> Corners {
        let element = &self.surface.faces[cell.face];
        let mut out = Corners::zeros();
        for (i, arm) in element.arms.iter().enumerate() {
            let wrench = point_wrench(arm, &(element.area / 3.0 * normal));
            out.fixed_view_mut::<1, 6>(i, 6)
                .copy_from(&wrench.transpose());
        }
        out
    }

    /// `rᵀ A⁻¹ r` with r = δb − δA ψ along each component, for each two of them.
    fn answers<D: Jet>(&self, layer: &Layer<D>, solved: &Solved, which: usize) -> DMatrix<f64> {
        let psi = &solved.potential;
        let rows = psi.nrows();
        let mut pushed = DMatrix::zeros(rows, 6 * TWISTS);
        let mut add = |v: usize, k: usize, flux: SMatrix<f64, 1, TWISTS>| {
            let mut row = pushed.fixed_view_mut::<1, TWISTS>(v, TWISTS * k);
            row += flux;
        };
        for (cell, _, slopes) in cells(self, layer, psi) {
            let first = cell.thickness[which].first();
            let turned = cell.facing.map(|n| n.first());
            for k in 0..6 {
                let normal = Vec3::from_fn(|i, _| turned[i][k]);
                let flux = self.pushed(cell, &normal) - first[k] * slopes;
                for (i, at) in cell.corners.iter().enumerate() {
                    if let Some(at) = at {
                        add(*at, k, flux.row(i).into_owned());
                    }
                }
            }
        }
        for (v, rim) in layer.rim.iter().enumerate() {
            let (first, row) = (rim.first(), psi.fixed_view::<1, TWISTS>(v, 0));
            (0..6).for_each(|k| add(v, k, -first[k] * row));
        }
        let mut answered = pushed.clone();
        let all = MatMut::from_column_major_slice_mut(answered.as_mut_slice(), rows, 6 * TWISTS);
        solved.factor.solve(all);
        pushed.tr_mul(&answered)
    }

    /// What unit twists push at the active vertices: ∫ φ (n, x × n) dA over each side.
    fn loads(&self, layer: &Layer<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(layer.active.len(), TWISTS);
        for (v, vertex) in layer.active.iter().enumerate() {
            let own = self.surface.loads[*vertex].transpose();
            out.fixed_view_mut::<1, 6>(v, 0).copy_from(&own);
        }
        for cell in &layer.cells {
            let pushed = self.pushed(cell, &Vec3::from(cell.facing));
            for (i, at) in cell.corners.iter().enumerate() {
                if let Some(at) = at {
                    let mut row = out.row_mut(*at);
                    row += pushed.row(i);
                }
            }
        }
        out
    }

    /// div(H ∇ψ) = −flux, with the thickness as it is (0) or held apart (1).
    fn solve(&self, layer: &Layer<f64>, which: usize) -> Option<Solved> {
        let n = layer.active.len();
        let mut entries = Vec::with_capacity(6 * layer.cells.len() + n);
        for cell in &layer.cells {
            let element = &self.surface.faces[cell.face];
            let strength = element.area * cell.thickness[which];
            for (i, a) in cell.corners.iter().enumerate() {
                for (j, b) in cell.corners.iter().enumerate() {
                    match (a, b) {
                        (Some(a), Some(b)) if a >= b => {
                            entries.push((*a, *b, strength * element.slopes[(i, j)]));
                        }
                        _ => (),
                    }
                }
            }
        }
        entries.extend(layer.rim.iter().enumerate().map(|(v, rim)| (v, v, *rim)));
        let factor = SparseCholesky::new(n, &entries)?;
        let mut potential = self.loads(layer);
        let all = MatMut::from_column_major_slice_mut(potential.as_mut_slice(), n, TWISTS);
        factor.solve(all);
        Some(Solved { factor, potential })
    }
}
