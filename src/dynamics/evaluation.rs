//! Everything that depends on the configuration alone: kinematics, momenta per unit velocity, mass matrix.

use super::{JointLimit, PairContact, Parameters, System};
use crate::adjoint::lie::{Mat6, Pose, Vec3, Vec6, six};
use crate::adjoint::rigid;
use crate::coupling::CouplingReport;
use crate::multibody::Kinematics;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};

/// Where coordinates left floating point: before the step's end, at a stage of it.
pub(crate) const WITHIN: &str = "within the step";

/// The system at one configuration: values alone. What has derivatives too is a [`Linearisation`](super::Linearisation).
#[derive(Clone)]
pub struct Evaluation<'a> {
    /// The system.
    pub system: &'a System,
    /// Its parameters.
    pub parameters: &'a Parameters,
    /// The configuration.
    pub q: DVector<f64>,
    /// Poses and joint columns.
    pub kinematics: Kinematics,
    /// Rigid inertias, body frames.
    pub rigid: Vec<Mat6>,
    /// Places where surfaces are near.
    pub contact_points: Vec<PairContact>,
    /// Limits of joints, with the laws of their stops.
    pub limits: Vec<JointLimit>,
    /// Spatial fluid momentum of each body at unit density per basis column (6 × k each).
    fluid_momenta: Vec<DMatrix<f64>>,
    /// M(q) = M_r + Jᵀ M_f J, user coordinates.
    pub mass_matrix: DMatrix<f64>,
    /// Generalised momentum at v = 0, from the current: of the water, and of the bodies relative to what may drift.
    pub rest_momentum: DVector<f64>,
    report: CouplingReport,
}

/// Where the bodies in the water are, and the body-frame twists of the basis on which the water is solved: one column a
/// generalised velocity, and one for the current if there is any.
pub(super) struct Basis {
    pub poses: Vec<Pose>,
    pub twists: DMatrix<f64>,
}

impl System {
    /// Evaluates the system at `q`.
    ///
    /// # Errors
    /// Whatever the coupling reports, or a configuration that isn't finite.
    pub fn evaluate<'a>(
        &'a self,
        parameters: &'a Parameters,
        q: &DVector<f64>,
    ) -> Result<Evaluation<'a>> {
        let mut e = self.evaluate_apart(parameters, q)?;
        e.contact_points = self.contact_points(parameters, &e.kinematics.poses)?;
        Ok(e)
    }

    /// [`System::evaluate`] without looking for places where surfaces are near.
    pub(super) fn evaluate_apart<'a>(
        &'a self,
        parameters: &'a Parameters,
        q: &DVector<f64>,
    ) -> Result<Evaluation<'a>> {
        let kinematics = self.kinematics(q)?;
        let basis = self.basis(&kinematics);
        let solved = match self.in_water(parameters) {
            true => Some(self.coupling.evaluate(&basis.poses, &basis.twists)?),
            false => None,
        };
        let momenta = self.spatial_momenta(&kinematics, solved.as_ref().map(|s| s.momenta()));
        let report = solved.map_or_else(CouplingReport::default, |s| s.report().clone());
        Ok(Evaluation::new(
            self, parameters, q, kinematics, momenta, report,
        ))
    }

    /// Whether any water acts on any body.
    pub(super) fn in_water(&self, parameters: &Parameters) -> bool {
        parameters.density() > 0.0 && self.coupling.bodies() > 0
    }

    pub(super) fn kinematics(&self, q: &DVector<f64>) -> Result<Kinematics> {
        if let Some(bad) = q.iter().position(|x| !x.is_finite()) {
            return Err(Error::Unresolved {
                place: WITHIN.into(),
                quantity: format!("coordinate q[{bad}] of body {:?}", self.carried(bad)),
                value: q[bad],
                limit: f64::MAX,
                remedy: "the simulation left what floating point holds: the step is too long or a force too large".into(),
            });
        }
        Ok(self.tree.kinematics(q))
    }

    /// Name of the body whose joint has coordinate `i`.
    fn carried(&self, i: usize) -> &str {
        let links = self.tree.links().iter().zip(&self.bodies);
        let mut named = links.filter(|(link, _)| link.q.contains(&i));
        named.next().map_or("", |(_, body)| body.name.as_str())
    }

    /// Columns of the basis.
    fn columns(&self) -> usize {
        self.tree.velocities() + usize::from(self.has_current())
    }

    pub(super) fn basis(&self, kinematics: &Kinematics) -> Basis {
        let (nv, columns) = (self.tree.velocities(), self.columns());
        let jacobian = self.tree.jacobian(kinematics);
        let mut twists = DMatrix::zeros(6 * self.coupling.bodies(), columns);
        let mut poses = Vec::with_capacity(self.coupling.bodies());
        let rest = six(&-self.current, &Vec3::zeros());
        for (b, w) in self.submerged() {
            let pose = &kinematics.poses[b];
            poses.push(*pose);
            for k in 0..columns {
                let world = if k < nv {
                    jacobian.fixed_view::<6, 1>(6 * b, k).into_owned()
                } else {
                    rest
                };
                twists
                    .fixed_view_mut::<6, 1>(6 * w, k)
                    .copy_from(&pose.twist_to_body(&world));
            }
        }
        Basis { poses, twists }
    }

    /// Spatial six-vectors of the submerged bodies, in each body's frame as twists, stacked.
    pub fn submerged_twists(&self, kinematics: &Kinematics, field: &[Vec6]) -> DVector<f64> {
        let mut out = DVector::zeros(6 * self.coupling.bodies());
        for (b, w) in self.submerged() {
            let twist = kinematics.poses[b].twist_to_body(&field[b]);
            out.fixed_rows_mut::<6>(6 * w).copy_from(&twist);
        }
        out
    }

    /// Spatial momenta of all bodies from the body-frame impulses of those in the water; zeros without water.
    pub(super) fn spatial_momenta(
        &self,
        kinematics: &Kinematics,
        impulses: Option<&DMatrix<f64>>,
    ) -> Vec<DMatrix<f64>> {
        let columns = self.columns();
        let mut out = vec![DMatrix::zeros(6, columns); self.len()];
        let Some(impulses) = impulses else { return out };
        for (b, w) in self.submerged() {
            for k in 0..columns {
                let h = impulses.fixed_view::<6, 1>(6 * w, k).into_owned();
                out[b].set_column(k, &kinematics.poses[b].wrench_to_world(&h));
            }
        }
        out
    }
}

/// Spatial momenta of the bodies for coefficients on the basis, from those of its columns.
pub(super) fn combined(columns: &[DMatrix<f64>], direction: &DVector<f64>) -> Vec<Vec6> {
    (columns.iter())
        .map(|m| (m * direction).fixed_rows::<6>(0).into_owned())
        .collect()
}

impl<'a> Evaluation<'a> {
    /// From the spatial fluid momenta per basis column; without places where surfaces are near.
    pub(super) fn new(
        system: &'a System,
        parameters: &'a Parameters,
        q: &DVector<f64>,
        kinematics: Kinematics,
        fluid_momenta: Vec<DMatrix<f64>>,
        report: CouplingReport,
    ) -> Self {
        let rigid: Vec<Mat6> = (0..system.len())
            .map(|b| {
                rigid::spatial_inertia(
                    parameters.mass(b),
                    &system.bodies[b].center_of_mass,
                    &parameters.inertia(b),
                )
            })
            .collect();
        let jacobian = system.tree.jacobian(&kinematics);
        let nv = system.tree.velocities();
        let mut mass_matrix = DMatrix::zeros(nv, nv);
        let mut rest_momentum = DVector::zeros(nv);
        for b in 0..system.len() {
            let j = jacobian.rows(6 * b, 6);
            let mut momenta = parameters.density() * fluid_momenta[b].columns(0, nv).into_owned();
            let pose = &kinematics.poses[b];
            for k in 0..nv {
                let twist = pose.twist_to_body(&j.column(k).fixed_rows::<6>(0).into_owned());
                if twist != Vec6::zeros() {
                    let mut c = momenta.column_mut(k);
                    c += pose.wrench_to_world(&(rigid[b] * twist));
                }
            }
            mass_matrix += j.tr_mul(&momenta);
            if system.has_current() {
                rest_momentum += parameters.density() * j.tr_mul(&fluid_momenta[b].column(nv));
                let drift = pose.twist_to_body(system.drift.of(b));
                rest_momentum -= j.tr_mul(&pose.wrench_to_world(&(rigid[b] * drift)));
            }
        }
        let mass_matrix = 0.5 * (&mass_matrix + mass_matrix.transpose());
        Self {
            system,
            parameters,
            q: q.clone(),
            contact_points: Vec::new(),
            limits: system.limits.clone(),
            kinematics,
            rigid,
            fluid_momenta,
            mass_matrix,
            rest_momentum,
            report,
        }
    }

    /// Coefficients on the fluid's basis of the velocity `v` through the water.
    pub fn through_water(&self, v: &DVector<f64>) -> DVector<f64> {
        self.extended(v, 1.0)
    }

    /// Coefficients of a virtual velocity: the current doesn't take part.
    pub fn virtual_direction(&self, z: &DVector<f64>) -> DVector<f64> {
        self.extended(z, 0.0)
    }

    fn extended(&self, v: &DVector<f64>, last: f64) -> DVector<f64> {
        if self.system.has_current() {
            v.push(last)
        } else {
            v.clone()
        }
    }

    /// Twist of body `b` through the water, from its twist in the world.
    pub fn relative(&self, twist: &Vec6) -> Vec6 {
        twist - six(&self.system.current, &Vec3::zeros())
    }

    /// Spatial fluid momenta of the bodies at unit density for coefficients on the basis.
    pub fn fluid_momenta(&self, direction: &DVector<f64>) -> Vec<Vec6> {
        combined(&self.fluid_momenta, direction)
    }

    /// Spatial fluid momenta of body `b` at unit density per generalised velocity (6 × nv).
    pub(super) fn fluid_columns(&self, b: usize) -> DMatrix<f64> {
        let nv = self.system.tree.velocities();
        self.fluid_momenta[b].columns(0, nv).into_owned()
    }

    /// Spatial rigid momentum of body `b` moving with the spatial twist `v`.
    pub fn rigid_momentum(&self, b: usize, v: &Vec6) -> Vec6 {
        let pose = &self.kinematics.poses[b];
        pose.wrench_to_world(&(self.rigid[b] * pose.twist_to_body(v)))
    }

    /// Spatial six-vectors of the submerged bodies, in each body's frame as twists, stacked.
    pub fn submerged_twists(&self, field: &[Vec6]) -> DVector<f64> {
        self.system.submerged_twists(&self.kinematics, field)
    }

    /// A field of the submerged bodies.
    pub fn submerged_field(&self, field: &[Vec6]) -> Vec<Vec6> {
        self.system.submerged().map(|(b, _)| field[b]).collect()
    }

    /// The submerged bodies' field on all bodies, zero elsewhere.
    pub fn from_submerged(&self, field: &[Vec6]) -> Vec<Vec6> {
        let mut out = vec![Vec6::zeros(); self.system.len()];
        for (b, w) in self.system.submerged() {
            out[b] = field[w];
        }
        out
    }

    /// Body-frame impulses of the submerged bodies (stacked) as spatial momenta of all bodies.
    pub fn submerged_impulses(&self, impulses: &DVector<f64>) -> Vec<Vec6> {
        let mut out = vec![Vec6::zeros(); self.system.len()];
        for (b, w) in self.system.submerged() {
            let h = impulses.fixed_rows::<6>(6 * w).into_owned();
            out[b] = self.kinematics.poses[b].wrench_to_world(&h);
        }
        out
    }

    /// Twists of the bodies relative to what may drift with the water ([`Drift`](super::Drift)).
    pub(super) fn drifting(&self, twists: &[Vec6]) -> Vec<Vec6> {
        let drift = &self.system.drift;
        (twists.iter().enumerate())
            .map(|(b, twist)| twist - drift.of(b))
            .collect()
    }

    /// Total spatial momenta of the bodies, rigid and fluid, at velocity `v`.
    pub fn momenta(&self, v: &DVector<f64>) -> Vec<Vec6> {
        let twists = self.system.tree.twists(&self.kinematics, v);
        self.with_rigid(&twists, &self.fluid_momenta(&self.through_water(v)))
    }

    /// Momenta of bodies with these spatial twists, with the fluid's from those at unit density.
    pub(super) fn with_rigid(&self, twists: &[Vec6], fluid: &[Vec6]) -> Vec<Vec6> {
        let rho = self.parameters.density();
        (0..self.system.len())
            .map(|b| self.rigid_momentum(b, &twists[b]) + rho * fluid[b])
            .collect()
    }

    /// Total momentum and angular momentum about the world origin of bodies and fluid at velocity `v`,
    /// given the bodies' momenta there. A tree on a free joint counts with its frame momentum and what drifts besides, which M(q) v yields to
    /// round-off; the sum of the bodies' is as exact as the coupling's solve.
    pub fn total_momentum(&self, v: &DVector<f64>, momenta: &[Vec6]) -> Vec6 {
        let tree = &self.system.tree;
        let composite = tree.composite(momenta.to_vec());
        let hat = self.frame_momentum(v);
        let drift = &self.system.drift;
        let drifting = (0..self.system.len()).map(|b| self.rigid_momentum(b, drift.of(b)));
        let drifting = tree.composite(drifting.collect());
        let mut total = Vec6::zeros();
        for (b, link) in tree.links().iter().enumerate() {
            total += match (link.parent, link.joint.is_free()) {
                (Some(_), _) => Vec6::zeros(),
                (None, true) => {
                    let own = hat.fixed_rows::<6>(link.v.start).into_owned();
                    link.placement.wrench_to_world(&own) + drifting[b]
                }
                (None, false) => composite[b],
            };
        }
        total
    }

    /// Kinetic energy of bodies and fluid, J; the fluid's in the frame that moves with the current.
    pub fn kinetic_energy(&self, v: &DVector<f64>) -> f64 {
        let twists = self.system.tree.twists(&self.kinematics, v);
        let fluid = self.fluid_momenta(&self.through_water(v));
        let mut twice = 0.0;
        for (b, twist) in twists.iter().enumerate() {
            twice += twist.dot(&self.rigid_momentum(b, twist));
            twice += self.parameters.density() * self.relative(twist).dot(&fluid[b]);
        }
        0.5 * twice
    }

    /// What the coupling reports.
    pub fn report(&self) -> &CouplingReport {
        &self.report
    }
}
