//! Everything that depends on the configuration alone: kinematics, momenta per unit velocity, mass matrix.

use super::fluid::FluidMomenta;
use super::island_matrix::IslandMatrix;
use super::{JointLimit, PairContact, Parameters, System};
use crate::adjoint::lie::{Mat6, Pose, Vec3, Vec6, six};
use crate::coupling::CouplingReport;
use crate::coupling::scattering::Scattered;
use crate::multibody::Kinematics;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use std::sync::{Arc, OnceLock};

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
    /// When it is there, s: what changes with time by itself is as it is then.
    pub time: f64,
    /// Poses and joint columns.
    pub kinematics: Kinematics,
    /// Rigid inertias, body frames.
    pub rigid: Vec<Mat6>,
    /// Places where surfaces are near.
    pub contact_points: Vec<PairContact>,
    /// Limits of joints, with the laws of their stops.
    pub limits: Vec<JointLimit>,
    /// Spatial momenta of the water.
    pub(super) fluid: FluidMomenta<'a>,
    /// M(q), once it has been asked for ([`Evaluation::mass_matrix`]).
    pub(super) mass_matrix: OnceLock<DMatrix<f64>>,
    /// By islands ([`Evaluation::mass_blocks`]).
    pub(super) mass_blocks: OnceLock<IslandMatrix>,
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
    /// Evaluates the system at `q` and the time `time`, s.
    ///
    /// # Errors
    /// Whatever the coupling reports, or a configuration that isn't finite.
    pub fn evaluate<'a>(
        &'a self,
        parameters: &'a Parameters,
        q: &DVector<f64>,
        time: f64,
    ) -> Result<Evaluation<'a>> {
        let mut e = self.evaluate_apart(parameters, q, time)?;
        e.contact_points = self.contact_points(parameters, &e.kinematics.poses)?;
        Ok(e)
    }

    /// [`System::evaluate`] without looking for places where surfaces are near.
    pub(super) fn evaluate_apart<'a>(
        &'a self,
        parameters: &'a Parameters,
        q: &DVector<f64>,
        time: f64,
    ) -> Result<Evaluation<'a>> {
        let kinematics = self.kinematics(q)?;
        let (fluid, report) = match self.fluid_apart(self.in_water(parameters)) {
            Some(fluid) => (fluid, CouplingReport::default()),
            None if self.coupling.scattering().is_some() => {
                let placed = self.fluid_scattered(&kinematics)?;
                let fluid = placed.map_or(FluidMomenta::Still, FluidMomenta::Scattered);
                (fluid, CouplingReport::default())
            }
            None => {
                let basis = self.basis(&kinematics);
                let solved = self.coupling.evaluate(&basis.poses, &basis.twists)?;
                let fluid = self.fluid_coupled(&kinematics, solved.momenta());
                (fluid, solved.report().clone())
            }
        };
        Ok(Evaluation::new(
            self, parameters, q, time, kinematics, fluid, report,
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

    pub(super) fn basis(&self, kinematics: &Kinematics) -> Basis {
        let nv = self.tree.velocities();
        let columns = nv + usize::from(self.has_current());
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
}

impl<'a> Evaluation<'a> {
    /// From the water's momenta; without places where surfaces are near.
    pub(super) fn new(
        system: &'a System,
        parameters: &'a Parameters,
        q: &DVector<f64>,
        time: f64,
        kinematics: Kinematics,
        fluid: FluidMomenta<'a>,
        report: CouplingReport,
    ) -> Self {
        let mut out = Self {
            system,
            parameters,
            q: q.clone(),
            time,
            contact_points: Vec::new(),
            limits: system.limits.clone(),
            kinematics,
            rigid: system.rigid_inertias(parameters),
            fluid,
            mass_matrix: OnceLock::new(),
            mass_blocks: OnceLock::new(),
            rest_momentum: DVector::zeros(system.tree.velocities()),
            report,
        };
        if system.has_current() {
            let wrenches = out.rest_wrenches();
            out.rest_momentum = system.tree.project(&out.kinematics.columns, wrenches);
        }
        out
    }

    /// Bodies so many that they are coupled by products.
    pub(super) fn scattered(&self) -> Option<&Arc<Scattered<'a>>> {
        match &self.fluid {
            FluidMomenta::Scattered(at) => Some(at),
            FluidMomenta::Still | FluidMomenta::Apart(_) | FluidMomenta::Coupled(_) => None,
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
        (self.fluid).along(self.system, &self.kinematics, direction)
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
        for (i, own) in self.system.armature.entries(self.parameters) {
            twice += own * v[i] * v[i];
        }
        0.5 * twice
    }

    /// Potential energy of all forces that have one, J.
    pub fn potential_energy(&self) -> f64 {
        let forces = self.system.forces.iter();
        forces.map(|f| f.potential_energy(&self.place())).sum()
    }

    /// What forces displace beside the volumes of the bodies, less what of these is out of the water: the volume, m³, and its moment about the world's origin, m⁴.
    pub fn displaced(&self) -> (f64, Vec3) {
        let each = self
            .system
            .forces
            .iter()
            .flat_map(|f| f.displaced(&self.place()));
        each.fold((0.0, Vec3::zeros()), |(all, moment), (volume, of)| {
            (all + volume, moment + of)
        })
    }

    /// What the coupling reports.
    pub fn report(&self) -> CouplingReport {
        match self.scattered() {
            Some(at) => at.report(),
            None => self.report.clone(),
        }
    }
}
