//! The mass matrix M(q) = M_r + ρ Jᵀ M̄_f J: its products, itself, and its factor.

use super::fluid::{self, FluidMomenta};
use super::island_matrix::IslandMatrix;
use super::recoil::{Own, Recoiling};
use super::tied::{Places, Tied};
use super::{Evaluation, Parameters, System};
use crate::adjoint::lie::{Mat6, Vec6};
use crate::adjoint::rigid;
use crate::adjoint::solve::{Definite, is_scaled_above, smallest_scaled_eigenvalue};
use crate::multibody::{Articulated, Link};
use crate::once::once;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};

/// Smallest eigenvalue, the diagonal scaled to one, from which on an inertia counts as positive definite.
const LEAST: f64 = 1e-13;
/// Part of an energy's parts from which on below zero it isn't what solves leave.
const NEGATIVE: f64 = 1e-3;
/// What a factor tells of an inertia.
const EIGENVALUE: &str = "smallest eigenvalue, diagonal scaled to one";

/// The rows and columns of the mass matrix that forces decide, factored. Right-hand sides and solutions have an entry per velocity; those of driven ones aren't read,
/// and zero.
pub enum Inertia<'a> {
    /// Where it is formed, or no body feels another.
    Factored(Factor),
    /// Where so many do that no matrix is formed.
    Recoiling(Recoiling<'a>),
}

/// A factored inertia.
pub enum Factor {
    /// By the trees of joints.
    Trees(Articulated),
    /// Of sets of free velocities that feel each other.
    Blocks(Vec<(Vec<usize>, Definite)>),
}

impl<'a> Evaluation<'a> {
    /// M(q) v, user coordinates.
    pub fn mass_times(&self, v: &DVector<f64>) -> DVector<f64> {
        if let FluidMomenta::Coupled(_) = self.fluid {
            return self.mass_matrix() * v;
        }
        let tree = &self.system.tree;
        let twists = tree.twists(&self.kinematics, v);
        let fluid = self.fluid_momenta(&self.virtual_direction(v));
        let momenta = self.with_rigid(&twists, &fluid);
        let mut out = tree.project(&self.kinematics.columns, momenta);
        (self.system.armature).add(self.parameters, v, &mut out);
        out
    }

    /// ½ vᵀ M(q) v, J.
    pub(super) fn mass_energy(&self, v: &DVector<f64>) -> f64 {
        0.5 * v.dot(&self.mass_times(v))
    }

    /// M(q), user coordinates, nv × nv: made when it is first asked for. Its products and solves don't ask for it where no body feels another.
    pub fn mass_matrix(&self) -> &DMatrix<f64> {
        once(&self.mass_matrix, || {
            let made = match self.fluid {
                FluidMomenta::Coupled(_) => self.rigid_and_coupled(),
                FluidMomenta::Apart(_) | FluidMomenta::Still | FluidMomenta::Scattered(_) => {
                    let islands = self.islands_of_all();
                    let changes = islands.changes();
                    let products: Vec<_> = changes.iter().map(|v| self.mass_times(v)).collect();
                    islands.matrix(&products)
                }
            };
            0.5 * (&made + made.transpose())
        })
    }

    fn rigid_and_coupled(&self) -> DMatrix<f64> {
        let (tree, rho) = (&self.system.tree, self.parameters.density());
        let nv = tree.velocities();
        let mut out = DMatrix::zeros(nv, nv);
        let mut unit = DVector::zeros(nv);
        for k in 0..nv {
            unit[k] = 1.0;
            let mut momenta = self.fluid.column(self.system, &self.kinematics, k);
            let twists = tree.twists(&self.kinematics, &unit);
            for (b, (momentum, twist)) in momenta.iter_mut().zip(&twists).enumerate() {
                *momentum *= rho;
                if *twist != Vec6::zeros() {
                    *momentum += self.rigid_momentum(b, twist);
                }
            }
            out.set_column(k, &tree.project(&self.kinematics.columns, momenta));
            unit[k] = 0.0;
        }
        for (i, own) in self.system.armature.entries(self.parameters) {
            out[(i, i)] += own;
        }
        out
    }

    /// Factors the rows and columns of M(q) of the velocities `free`.
    ///
    /// # Errors
    /// A mass matrix that isn't positive definite.
    pub fn factored(&self, free: &[usize]) -> Result<Inertia<'a>> {
        let added = match &self.fluid {
            FluidMomenta::Coupled(_) => return self.factored_dense(free),
            FluidMomenta::Apart(added) => Some(*added),
            FluidMomenta::Still => None,
            FluidMomenta::Scattered(at) => {
                // Also where films weigh with them: it refuses what has no inertia by the joint's name.
                let alone = self.factored_apart(free, Some(at.own()))?;
                let own = match self.factored_filmed(free) {
                    Some(own) => own,
                    None => Own::new(false, move |right: &DVector<f64>| alone.solve(right)),
                };
                return Ok(Inertia::Recoiling(Recoiling::new(self, at, own)));
            }
        };
        self.factored_apart(free, added).map(Inertia::Factored)
    }

    /// v with given velocities `driven` (zero where free) and the rows `free` of M v = `right`.
    ///
    /// # Errors
    /// A mass matrix that isn't positive definite.
    pub(crate) fn velocity(
        &self,
        free: &[usize],
        mut right: DVector<f64>,
        driven: &DVector<f64>,
    ) -> Result<DVector<f64>> {
        let factor = self.factored(free)?;
        let moved = driven.iter().any(|x| *x != 0.0);
        let v = match (&factor, &self.fluid) {
            (Inertia::Recoiling(many), FluidMomenta::Scattered(at)) => {
                if moved {
                    right -= self.own_mass_times(at.own(), driven);
                }
                many.solve_beside(&right, driven)
            }
            _ => {
                if moved {
                    right -= self.mass_times(driven);
                }
                driven + factor.solve(&right)
            }
        };
        self.check()?;
        // Of driven velocities what the others exchange isn't in what was asked.
        if !moved {
            self.check_energy(&v, &right)?;
        }
        Ok(v)
    }

    /// Whether `v`, which solves M v = `right` on its rows that aren't zero, has energy: where many bodies are coupled by products there is no factor of M that would tell.
    ///
    /// # Errors
    /// A mass matrix that isn't positive definite, by the joint at which most is below zero. One that is so along other velocities isn't noticed.
    pub(crate) fn check_energy(&self, v: &DVector<f64>, right: &DVector<f64>) -> Result<()> {
        let parts = v.component_mul(right);
        let (sum, size) = (parts.sum(), parts.abs().sum());
        let below = sum < -NEGATIVE * size;
        if self.scattered().is_none() || !below {
            return Ok(());
        }
        let of_joint = |link: &Link| parts.rows_range(link.v.clone()).sum();
        let joints = self.system.tree.links().iter().filter(|l| !l.v.is_empty());
        let worst = joints.min_by(|a, b| of_joint(a).total_cmp(&of_joint(b)));
        let place = self.at_joint(worst.map(|link| link.v.start));
        let quantity = "energy of a velocity that it has, in that of its parts";
        Err(unresolved(place, quantity, sum / size, 0.0))
    }

    /// Whether the water's solves so far met their tolerance.
    ///
    /// # Errors
    /// The first that didn't.
    pub(crate) fn check(&self) -> Result<()> {
        self.fluid.check()
    }

    /// M(q) v but for what many bodies that are coupled by products exchange.
    pub(super) fn mass_alone_times(&self, v: &DVector<f64>) -> DVector<f64> {
        match self.scattered() {
            Some(at) => self.own_mass_times(at.own(), v),
            None => self.mass_times(v),
        }
    }

    /// M v of bodies with these added masses that don't feel each other.
    fn own_mass_times(&self, added: &[Mat6], v: &DVector<f64>) -> DVector<f64> {
        let tree = &self.system.tree;
        let twists = tree.twists(&self.kinematics, v);
        let fluid = fluid::apart(added, self.system, &self.kinematics, &twists);
        let momenta = self.with_rigid(&twists, &fluid);
        let mut out = tree.project(&self.kinematics.columns, momenta);
        (self.system.armature).add(self.parameters, v, &mut out);
        out
    }

    /// The factor of bodies that don't feel each other: by their trees; closed by a transmission, a tree isn't one any more.
    fn factored_apart(&self, free: &[usize], added: Option<&[Mat6]>) -> Result<Factor> {
        if !self.system.tree.has_followers() {
            return self.articulated(free, added).map(Factor::Trees);
        }
        let islands = self.jointed_islands();
        let changes = islands.changes();
        let products: Vec<_> = changes.iter().map(|v| self.mass_alone_times(v)).collect();
        let mass = IslandMatrix::new(islands, &products).symmetric();
        let mut factors = Vec::new();
        for (rows, block) in mass.free_blocks(free) {
            let rows: Vec<usize> = rows.iter().map(|row| free[*row]).collect();
            let factor = definite(block).map_err(|found| {
                let smallest = found.smallest;
                let place = self.at_joint(found.weakest.map(|k| rows[k]));
                unresolved(place, EIGENVALUE, smallest, LEAST)
            })?;
            factors.push((rows, factor));
        }
        Ok(Factor::Blocks(factors))
    }

    /// That of many bodies which the films between them weigh upon; none where there are no films.
    fn factored_filmed(&self, free: &[usize]) -> Option<Own<'a>> {
        if !self.has_films() {
            return None;
        }
        let velocities = self.system.tree.velocities();
        let mut matrix = Tied::new(self.mass_blocks(), velocities, free);
        self.film_masses(|i, j, x| matrix.add(i, j, x));
        let factor = matrix.factor(&mut Places::default())?;
        let free = free.to_vec();
        Some(Own::new(true, move |right: &DVector<f64>| {
            let found = factor.solve(&right.select_rows(&free));
            let mut out = DVector::zeros(right.len());
            for (i, x) in free.iter().zip(found.iter()) {
                out[*i] = *x;
            }
            out
        }))
    }

    /// The factor of trees of joints, of bodies with these added masses.
    fn articulated(&self, free: &[usize], added: Option<&[Mat6]>) -> Result<Articulated> {
        let mut inertias = self.rigid.clone();
        if let Some(added) = added {
            for (b, w) in self.system.submerged() {
                inertias[b] += self.parameters.density() * added[w];
            }
        }
        let mut is_free = vec![false; self.system.tree.velocities()];
        free.iter().for_each(|i| is_free[*i] = true);
        let (tree, kinematics) = (&self.system.tree, &self.kinematics);
        let mut added = vec![0.0; is_free.len()];
        for (i, own) in self.system.armature.entries(self.parameters) {
            added[i] = own;
        }
        let free = |i: usize| is_free[i].then_some(added[i]);
        Articulated::new(tree, kinematics, &inertias, free, LEAST).map_err(|found| {
            let name = &self.system.bodies[found.body].name;
            let place = format!("mass matrix M(q), at the joint of body {name:?}");
            unresolved(place, EIGENVALUE, found.smallest, LEAST)
        })
    }

    fn factored_dense(&self, free: &[usize]) -> Result<Inertia<'a>> {
        self.mass_matrix();
        self.check()?;
        let block = self.mass_matrix().select_rows(free).select_columns(free);
        match definite(block) {
            Ok(factor) => {
                let all = vec![(free.to_vec(), factor)];
                Ok(Inertia::Factored(Factor::Blocks(all)))
            }
            Err(found) => {
                let weakest = found.weakest.map(|k| free[k]);
                let place = self.at_joint(weakest);
                Err(unresolved(place, EIGENVALUE, found.smallest, LEAST))
            }
        }
    }

    /// Where a velocity is that has least inertia, in words.
    fn at_joint(&self, velocity: Option<usize>) -> String {
        let mut links = self.system.tree.links().iter().zip(&self.system.bodies);
        match velocity.and_then(|i| links.find(|(link, _)| link.v.contains(&i))) {
            Some((_, body)) => format!(
                "mass matrix M(q), most at the joint of body {:?}",
                body.name
            ),
            None => "mass matrix M(q)".into(),
        }
    }

    /// Wrenches, spatial, that change the momentum at v = 0: that of the water as the current moves it, and that of the bodies relative to what may drift.
    pub(super) fn rest_wrenches(&self) -> Vec<Vec6> {
        let (system, rho) = (self.system, self.parameters.density());
        let still = DVector::zeros(system.tree.velocities());
        let mut out = self.fluid_momenta(&self.through_water(&still));
        for (b, wrench) in out.iter_mut().enumerate() {
            *wrench = rho * *wrench - self.rigid_momentum(b, system.drift.of(b));
        }
        out
    }
}

/// A matrix that isn't positive definite: its smallest eigenvalue, the diagonal scaled to one, and the entry that the eigenvector has most of.
struct Refused {
    smallest: f64,
    weakest: Option<usize>,
}

/// The factor of a symmetric matrix.
fn definite(block: DMatrix<f64>) -> std::result::Result<Definite, Refused> {
    let refused = |block: &DMatrix<f64>, smallest: f64| Refused {
        smallest,
        weakest: least_direction(block).map(|x| x.icamax()),
    };
    if !is_scaled_above(&block, LEAST) {
        let smallest = smallest_scaled_eigenvalue(&block);
        if smallest.is_nan() || smallest <= LEAST {
            return Err(refused(&block, smallest));
        }
    }
    match Definite::new(block.clone()) {
        Some(factor) => Ok(factor),
        None => Err(refused(&block, smallest_scaled_eigenvalue(&block))),
    }
}

/// The eigenvector of the smallest eigenvalue of a matrix scaled to unit diagonal, rows without a positive one being zero; none where an entry isn't finite.
fn least_direction(a: &DMatrix<f64>) -> Option<DVector<f64>> {
    let scale = a
        .diagonal()
        .map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(a.nrows(), a.ncols(), |i, j| scale[i] * a[(i, j)] * scale[j]);
    if a.is_empty() || scaled.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let found = scaled.symmetric_eigen();
    let least = found.eigenvalues.imin();
    Some(found.eigenvectors.column(least).into_owned())
}

fn unresolved(place: String, quantity: &str, value: f64, limit: f64) -> Error {
    Error::Unresolved {
        place,
        quantity: quantity.into(),
        value,
        limit,
        remedy: "M must be positive definite. At the start: give massless bodies mass, inertia or added \
                 mass, refine the meshes where a gap isn't resolved, or take away a given added mass that is far \
                 smaller than what others change of it. Later: the run may have blown up, \
                 take a smaller time step or the integrator midpoint"
            .into(),
    }
}

impl Factor {
    fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        match self {
            Self::Trees(tree) => tree.solve(right),
            Self::Blocks(all) => {
                let mut out = DVector::zeros(right.len());
                for (velocities, factor) in all {
                    let found = factor.solve(&right.select_rows(velocities));
                    let each = velocities.iter().zip(found.iter());
                    each.for_each(|(i, x)| out[*i] = *x);
                }
                out
            }
        }
    }

    fn solve_columns(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        match self {
            Self::Trees(tree) => tree.solve_columns(right),
            Self::Blocks(all) => {
                let mut out = DMatrix::zeros(right.nrows(), right.ncols());
                for (velocities, factor) in all {
                    let found = factor.solve_columns(&right.select_rows(velocities));
                    for (i, x) in velocities.iter().zip(found.row_iter()) {
                        out.row_mut(*i).copy_from(&x);
                    }
                }
                out
            }
        }
    }
}

impl Inertia<'_> {
    /// v with M v = `right` on the free rows.
    pub fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        match self {
            Self::Factored(factor) => factor.solve(right),
            Self::Recoiling(many) => many.solve(right),
        }
    }

    /// The same of every column.
    pub fn solve_columns(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        match self {
            Self::Factored(factor) => factor.solve_columns(right),
            Self::Recoiling(many) => {
                let mut out = right.clone();
                for (mut out, right) in out.column_iter_mut().zip(right.column_iter()) {
                    out.copy_from(&many.solve(&right.into_owned()));
                }
                out
            }
        }
    }

    /// Cotangent of the right-hand side from that of the solution: M is symmetric.
    pub fn solve_vjp(&self, v_bar: &DVector<f64>) -> DVector<f64> {
        self.solve(v_bar)
    }
}

impl System {
    /// Rigid inertias of the bodies, body frames.
    pub(super) fn rigid_inertias(&self, parameters: &Parameters) -> Vec<Mat6> {
        let of = |b: usize| {
            rigid::spatial_inertia(
                parameters.mass(b),
                &parameters.center_of_mass(b),
                &parameters.inertia(b),
            )
        };
        (0..self.len()).map(of).collect()
    }
}
