//! How fast forces slow what moves, and how fast they swing it: what integrators that take them explicitly must resolve.
//!
//! g being the forces in the user's coordinates without the water's inertia, D = −∂g/∂v and K = −∂g/∂q at rest, both on the coordinates that nothing drives, the rates are the
//! eigenvalues of M⁻¹ D, complex where forces turn what they slow, and the squares of angular frequencies the real parts of those of M⁻¹ K: what acts one way only, as a propeller's speed on a hull, makes none. A step that moves by the velocity in which it has solved for D is stable while Δt² K < 4 (M + ½ Δt D): for it
//! M + ½ Δt D stands in place of M. Of many bodies that are coupled by products M is what each tree has alone.

use super::fluid::FluidMomenta;
use super::force::{ForceModel, Loads, Velocity};
use super::islands::Islands;
use super::{Drive, Evaluation, Integrator, Parameters, System};
use crate::Result;
use crate::solver::{eigenvalues, scaled_by};
use nalgebra::{Complex, DMatrix, DVector};

/// Part of a matrix' entries up to which its other half differs by rounding.
const EVEN: f64 = 1e-9;

/// The fastest of rates, or of angular frequencies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fastest {
    /// 1/s, or rad/s.
    pub rate: f64,
    /// The body whose joint it slows or swings most.
    pub body: usize,
}

/// Two symmetric matrices, as products with [`Islands::changes`]: the largest eigenvalue of the first by the second is looked for.
struct Pencil {
    islands: Islands,
    of: Vec<DVector<f64>>,
    by: Vec<DVector<f64>>,
}

impl System {
    /// The fastest rate at which forces slow what moves at `time` (s), if it is more than an integrator bears that takes them explicitly in steps of `dt` (s); of what turns as it is slowed the one that is
    /// as near to growing. None for integrators that solve for the velocity. Water is asked for its inertia only where the bodies' own is too small.
    ///
    /// # Errors
    /// As [`System::evaluate`].
    pub fn damping(
        &self,
        parameters: &Parameters,
        q: &DVector<f64>,
        v: &DVector<f64>,
        control: &DVector<f64>,
        time: f64,
        (integrator, dt): (Integrator, f64),
    ) -> Result<Option<Fastest>> {
        let Some(limit) = integrator.damping_limit() else {
            return Ok(None);
        };
        let rate = |z: Complex<f64>| integrator.straight(z * dt) / dt;
        let pencil = |e: &Evaluation| e.slowing(v, control);
        self.fastest(parameters, q, time, limit / dt, pencil, &rate)
    }

    /// The largest angular frequency at which forces swing what rests at `time` (s), if it is above `enough` (rad/s), in steps of `implicit` (s) that solve for the velocity in forces, if they do.
    /// Water is asked for its inertia only where the bodies' own is too small.
    ///
    /// # Errors
    /// As [`System::evaluate`].
    pub fn swinging(
        &self,
        parameters: &Parameters,
        q: &DVector<f64>,
        control: &DVector<f64>,
        time: f64,
        implicit: Option<f64>,
        enough: f64,
    ) -> Result<Option<Fastest>> {
        let pencil = |e: &Evaluation| e.swinging(control, implicit);
        let found = self.fastest(parameters, q, time, enough * enough, pencil, &|x| x.re)?;
        Ok(found.map(|Fastest { rate, body }| Fastest {
            rate: rate.sqrt(),
            body,
        }))
    }

    /// The largest that `rate` makes of all pencils' eigenvalues if it is above `enough`.
    fn fastest(
        &self,
        parameters: &Parameters,
        q: &DVector<f64>,
        time: f64,
        enough: f64,
        pencil: impl Fn(&Evaluation) -> Option<Pencil>,
        rate: &dyn Fn(Complex<f64>) -> f64,
    ) -> Result<Option<Fastest>> {
        let kinematics = self.kinematics(q)?;
        let (still, report) = (FluidMomenta::Still, Default::default());
        let dry = Evaluation::new(self, parameters, q, time, kinematics, still, report);
        // The water only adds to the inertia, but where a given added mass is smaller than what others change of it.
        let fast = |found: &Fastest| found.rate > enough;
        let alone = self.fastest_of(pencil(&dry), rate);
        let is_slow = matches!(&alone, Ok(found) if found.is_none_or(|found| !fast(&found)));
        if is_slow || !self.in_water(parameters) {
            return Ok(alone.ok().flatten().filter(fast));
        }
        let wet = self.evaluate_apart(parameters, q, time)?;
        Ok(self
            .fastest_of(pencil(&wet), rate)
            .ok()
            .flatten()
            .filter(fast))
    }

    /// None where there is no pencil.
    fn fastest_of(
        &self,
        pencil: Option<Pencil>,
        rate: &dyn Fn(Complex<f64>) -> f64,
    ) -> std::result::Result<Option<Fastest>, Indefinite> {
        let Some(Pencil { islands, of, by }) = pencil else {
            return Ok(None);
        };
        let mut free = vec![None; islands.velocities()];
        for (b, (drive, link)) in self.drives.iter().zip(self.tree.links()).enumerate() {
            if *drive == Drive::Free {
                link.v.clone().for_each(|i| free[i] = Some(b));
            }
        }
        let mut found: Option<Fastest> = None;
        for ((island, of), (_, by)) in islands.blocks(&of).zip(islands.blocks(&by)) {
            let own: Vec<usize> = (0..island.len())
                .filter(|k| free[island[*k]].is_some())
                .collect();
            let block = |m: &DMatrix<f64>| m.select_rows(&own).select_columns(&own);
            let (of, by) = (block(&of), block(&by));
            if of.iter().all(|x| *x == 0.0) {
                continue;
            }
            let (rate, at) = largest(0.5 * (&by + by.transpose()), &of, rate).ok_or(Indefinite)?;
            if found.is_none_or(|other| rate > other.rate) {
                let body = free[island[own[at]]];
                found = body.map(|body| Fastest { rate, body });
            }
        }
        Ok(found)
    }
}

/// An inertia that isn't positive definite.
struct Indefinite;

/// Whether any entry isn't zero.
fn is_any(columns: &[DVector<f64>]) -> bool {
    columns
        .iter()
        .any(|column| column.iter().any(|x| *x != 0.0))
}

impl Evaluation<'_> {
    /// D by M; none where nothing is slowed.
    fn slowing(&self, v: &DVector<f64>, control: &DVector<f64>) -> Option<Pencil> {
        let islands = self.islands();
        let changes = islands.changes();
        let of = self.slowed(v, control, &changes);
        is_any(&of).then(|| Pencil {
            of,
            by: changes.iter().map(|v| self.mass_alone_times(v)).collect(),
            islands,
        })
    }

    /// K by M, or by M + ½ Δt D, at rest; none where nothing is held.
    fn swinging(&self, control: &DVector<f64>, implicit: Option<f64>) -> Option<Pencil> {
        let islands = self.islands();
        let changes = islands.changes();
        let rest = DVector::zeros(islands.velocities());
        let held = |z: &DVector<f64>| -self.user_loads_vjp(&rest, control, z).q;
        let of: Vec<_> = changes.iter().map(held).collect();
        if !is_any(&of) {
            return None;
        }
        let mut by: Vec<_> = changes.iter().map(|v| self.mass_alone_times(v)).collect();
        if let Some(dt) = implicit {
            let slowed = self.slowed(&rest, control, &changes);
            by.iter_mut()
                .zip(&slowed)
                .for_each(|(m, d)| *m += 0.5 * dt * d);
        }
        Some(Pencil { of, by, islands })
    }

    fn slowed(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
        changes: &[DVector<f64>],
    ) -> Vec<DVector<f64>> {
        let mut out = self.load_rates(self.system.smooth_forces(), v, control, changes);
        out.iter_mut().for_each(DVector::neg_mut);
        out
    }

    /// ∂g/∂v of these forces, times `changes`; user coordinates.
    pub(super) fn load_rates<'f>(
        &self,
        forces: impl Iterator<Item = &'f dyn ForceModel>,
        v: &DVector<f64>,
        control: &DVector<f64>,
        changes: &[DVector<f64>],
    ) -> Vec<DVector<f64>> {
        let tree = &self.system.tree;
        let along: Vec<_> = (changes.iter())
            .map(|dv| tree.twists(&self.kinematics, dv))
            .collect();
        let velocities: Vec<Velocity> = (changes.iter().zip(&along))
            .map(|(v, twists)| Velocity { twists, v })
            .collect();
        let mut out: Vec<Loads> = (changes.iter())
            .map(|_| Loads::zeros(self.system.len(), v.len()))
            .collect();
        let twists = tree.twists(&self.kinematics, v);
        let at = self.moving(&twists, v, control);
        for force in forces {
            force.jvps(&at, &velocities, &mut out);
        }
        let columns = out.into_iter();
        columns
            .map(|Loads { wrenches, joints }| {
                tree.project(&self.kinematics.columns, wrenches) + joints
            })
            .collect()
    }
}

/// The largest that `rate` makes of the eigenvalues of M⁻¹ S, and the coordinate that is most of its direction, or its own largest; none where M isn't positive definite.
fn largest(
    m: DMatrix<f64>,
    s: &DMatrix<f64>,
    rate: &dyn Fn(Complex<f64>) -> f64,
) -> Option<(f64, usize)> {
    let scaled = scaled_by(&m.cholesky()?.unpack(), s)?;
    if (&scaled - scaled.transpose()).amax() > EVEN * scaled.amax() {
        let at = scaled.diagonal().imax();
        let each = eigenvalues(scaled)?;
        return Some((each.iter().map(|x| rate(*x)).fold(0.0, f64::max), at));
    }
    let even = (0.5 * (&scaled + scaled.transpose())).symmetric_eigen();
    let k = even.eigenvalues.imax();
    let found = rate(Complex::from(even.eigenvalues[k]));
    Some((found, even.eigenvectors.column(k).iamax()))
}
