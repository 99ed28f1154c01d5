//! How fast forces that depend on the velocity slow what moves: what explicit integrators must resolve.
//!
//! With D = ∂g/∂v, g being the forces in the user's coordinates without the water's inertia, the rates are the eigenvalues of M^-½ ½(−D − Dᵀ) M^-½ on the coordinates
//! that nothing drives. Of many bodies that are coupled by products M is what each tree has alone.

use super::fluid::FluidMomenta;
use super::force::{ForceModel, Loads, Velocity};
use super::{Drive, Evaluation, Parameters, System};
use crate::Result;
use nalgebra::{DMatrix, DVector};

/// The fastest of the rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damping {
    /// 1/s.
    pub rate: f64,
    /// The body whose joint it slows most.
    pub body: usize,
}

impl System {
    /// The fastest rate at which forces slow what moves at `time` (s), if it is above `enough` (1/s). Water is asked for its inertia only where the bodies' own is too small.
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
        enough: f64,
    ) -> Result<Option<Damping>> {
        let kinematics = self.kinematics(q)?;
        let (still, report) = (FluidMomenta::Still, Default::default());
        let dry = Evaluation::new(self, parameters, q, time, kinematics, still, report);
        // The water only adds to the inertia, but where a given added mass is smaller than what others change of it.
        let fast = |d: &Damping| d.rate > enough;
        let alone = dry.fastest(v, control);
        let is_slow = matches!(&alone, Ok(found) if found.is_none_or(|d| !fast(&d)));
        if is_slow || !self.in_water(parameters) {
            return Ok(alone.ok().flatten().filter(fast));
        }
        let wet = self.evaluate_apart(parameters, q, time)?;
        Ok(wet.fastest(v, control).ok().flatten().filter(fast))
    }
}

/// An inertia that isn't positive definite.
struct Indefinite;

impl Evaluation<'_> {
    /// None where nothing is slowed.
    fn fastest(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
    ) -> std::result::Result<Option<Damping>, Indefinite> {
        let system = self.system;
        let mut free = vec![None; v.len()];
        for (b, (drive, link)) in system.drives.iter().zip(system.tree.links()).enumerate() {
            if *drive == Drive::Free {
                link.v.clone().for_each(|i| free[i] = Some(b));
            }
        }
        let islands = self.islands();
        let changes = islands.changes();
        let slowed = self.load_rates(self.system.smooth_forces(), v, control, &changes);
        if slowed.iter().all(|column| column.iter().all(|x| *x == 0.0)) {
            return Ok(None);
        }
        let inertia: Vec<_> = changes.iter().map(|v| self.mass_alone_times(v)).collect();
        let mut found: Option<Damping> = None;
        for ((island, slowed), (_, inertia)) in
            islands.blocks(&slowed).zip(islands.blocks(&inertia))
        {
            let own: Vec<usize> = (0..island.len())
                .filter(|k| free[island[*k]].is_some())
                .collect();
            let block = |m: &DMatrix<f64>| {
                let m = m.select_rows(&own).select_columns(&own);
                0.5 * (&m + m.transpose())
            };
            let (slowed, inertia) = (-block(&slowed), block(&inertia));
            if slowed.iter().all(|x| *x == 0.0) {
                continue;
            }
            let (rate, at) = largest(inertia, &slowed).ok_or(Indefinite)?;
            if found.is_none_or(|d| rate > d.rate) {
                let body = free[island[own[at]]];
                found = body.map(|body| Damping { rate, body });
            }
        }
        Ok(found)
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

/// The largest eigenvalue of M^-½ S M^-½, and the coordinate that is most of its direction; none where M isn't positive definite.
fn largest(m: DMatrix<f64>, slowed: &DMatrix<f64>) -> Option<(f64, usize)> {
    let lower = m.cholesky()?.unpack();
    let half = lower.solve_lower_triangular(slowed)?;
    let scaled = lower.solve_lower_triangular(&half.transpose())?;
    if !scaled.iter().all(|x| x.is_finite()) {
        return None;
    }
    let found = (0.5 * (&scaled + scaled.transpose())).symmetric_eigen();
    let k = found.eigenvalues.imax();
    Some((found.eigenvalues[k], found.eigenvectors.column(k).iamax()))
}
