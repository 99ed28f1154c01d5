//! The simulator: a scene made ready to run.

use super::mesh_files::MeshFiles;
use super::{BackendReport, Discretisation, ErrorEstimate, Fidelity, Policy, Settings};
use crate::adjoint::lie::{Mat3, Mat6, Pose};
use crate::assembly::{self, Assembled, Choices};
use crate::coupling::CouplingReport;
use crate::dynamics::{ContactGap, FreeMotions, Parameters, Stepper, System};
use crate::geometry::{Gap, Gaps, Other, TriMesh};
use crate::scene::Scene;
use crate::water::{Carried, Clearance, GapError, Subject, Surface, world_axes};
use crate::{Error, Result};
use nalgebra::DMatrix;
use std::path::Path;
use std::sync::Arc;

/// A scene made ready: shapes discretised, bodies joined, coupling prepared. Clones share what was prepared, so that
/// one with other parameters, another start or another controller costs next to nothing.
#[derive(Clone)]
pub struct Simulator {
    pub(super) scene: Arc<Scene>,
    pub(super) assembled: Arc<Assembled>,
    pub(super) choices: Choices,
    pub(super) mesh_files: Arc<MeshFiles>,
}

/// Added mass of all bodies in the water at one configuration.
#[derive(Clone, Debug)]
pub struct AddedMass {
    /// Names of the bodies, in the order of the rows.
    pub bodies: Vec<String>,
    /// 6B × 6B, world frame, per body linear then angular about its origin: kg, kg m, kg m².
    pub matrix: DMatrix<f64>,
    /// Rotations of the bodies, body to world axes.
    pub rotations: Vec<Mat3>,
    /// What the coupling reports.
    pub report: CouplingReport,
}

impl AddedMass {
    /// The block of body number `k` of these alone, in its own axes about its origin: what a simulator without coupling needs of it.
    pub fn own(&self, k: usize) -> Mat6 {
        let r = &self.rotations[k];
        let block = self.matrix.fixed_view::<6, 6>(6 * k, 6 * k);
        let mut out = Mat6::zeros();
        for (i, j) in [(0, 0), (0, 3), (3, 0), (3, 3)] {
            let turned = r.transpose() * block.fixed_view::<3, 3>(i, j) * r;
            out.fixed_view_mut::<3, 3>(i, j).copy_from(&turned);
        }
        0.5 * (out + out.transpose())
    }
}

impl Simulator {
    /// Prepares a scene, with what the settings ask for put over what the scene and its preset say.
    ///
    /// # Errors
    /// A scene that doesn't validate, meshes that don't bound a volume, bodies that overlap (with
    /// the fidelity `full`), or an inertia that leaves M(q) indefinite at the start.
    pub fn new(scene: &Scene, settings: Settings) -> Result<Self> {
        Self::with_choices(scene, settings.resolve(scene), None)
    }

    /// As [`Simulator::new`], with a folder where compressed bodies (fidelities `Reduced` and `Auto`)
    /// are kept from one program to the next; it is made if it isn't there. One that can't be written is a warning.
    ///
    /// # Errors
    /// As [`Simulator::new`].
    pub fn cached(scene: &Scene, settings: Settings, folder: &Path) -> Result<Self> {
        Self::with_choices(scene, settings.resolve(scene), Some(folder))
    }

    /// As [`Simulator::new`], with everything decided beforehand ([`Settings::resolve`]), and perhaps a folder where compressed
    /// bodies are kept.
    ///
    /// # Errors
    /// As [`Simulator::cached`].
    pub fn with_choices(scene: &Scene, choices: Choices, folder: Option<&Path>) -> Result<Self> {
        scene.validate()?;
        let assembled = assembly::assemble(scene, &choices, folder)?;
        let out = Self {
            scene: Arc::new(scene.clone()),
            assembled: Arc::new(assembled),
            choices,
            mesh_files: Arc::new(MeshFiles::of(scene)),
        };
        out.initial()?;
        Ok(out)
    }

    /// The scene that it was made from.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The mechanical system.
    pub fn system(&self) -> &System {
        &self.assembled.system
    }

    /// The physical parameters.
    pub fn parameters(&self) -> &Parameters {
        &self.assembled.parameters
    }

    /// The controller.
    pub fn policy(&self) -> &dyn Policy {
        self.assembled.policy.as_ref()
    }

    /// What was decided, by the scene, its preset and the settings.
    pub fn choices(&self) -> &Choices {
        &self.choices
    }

    /// Time step, s.
    pub fn time_step(&self) -> f64 {
        self.choices.time_step
    }

    /// Steps that the scene asks for.
    pub fn steps(&self) -> usize {
        self.scene.steps
    }

    /// Number of faces of all bodies in the water.
    pub fn faces(&self) -> usize {
        self.assembled.water.faces
    }

    /// Number of unknowns of the coupled solve.
    pub fn unknowns(&self) -> usize {
        self.system().coupling.unknowns()
    }

    /// What each body in the water became.
    pub fn discretisation(&self) -> &[Discretisation] {
        &self.assembled.water.discretisation
    }

    /// The gaps at which surfaces are taken to touch; none where the scene has no contact.
    pub fn contact_gaps(&self) -> Vec<ContactGap> {
        let contact = self.system().contact.as_ref();
        contact.map_or(Vec::new(), |model| model.gaps().collect())
    }

    /// The fidelity in use: what was asked for, or what `Auto` chose.
    pub fn fidelity(&self) -> Fidelity {
        self.assembled.water.fidelity
    }

    /// What computes the coupling, why, and what was done on the GPU so far.
    pub fn backend(&self) -> BackendReport {
        self.assembled.water.device.report()
    }

    /// The GPU that computes the coupling, if one does.
    #[cfg(feature = "gpu")]
    pub fn context(&self) -> Option<&std::sync::Arc<crate::gpu::Context>> {
        self.assembled.water.device.context()
    }

    /// What the fidelity `Auto` chose, and why, and why an integrator stands in for the preset's ([`Settings::resolve`]).
    pub fn reasons(&self) -> &[String] {
        &self.assembled.water.reasons
    }

    /// Distances between the bodies' surfaces, and to the walls; without the pairs that never move
    /// relative to one another and those declared to overlap.
    pub fn gaps(&self) -> &Gaps {
        &self.assembled.water.clearance.moving
    }

    pub(super) fn clearance(&self) -> &Clearance {
        &self.assembled.water.clearance
    }

    /// What the user should know about the scene, with names and numbers.
    pub fn warnings(&self) -> &[String] {
        &self.assembled.water.warnings
    }

    /// The same with another controller.
    pub fn set_policy(&mut self, policy: Box<dyn Policy>) {
        Arc::make_mut(&mut self.assembled).policy = policy.into();
    }

    /// The same with other physical parameters.
    ///
    /// # Errors
    /// Parameters of another scene, or values out of their range ([`crate::dynamics::Range`]).
    pub fn set_parameters(&mut self, parameters: Parameters) -> Result<()> {
        if !parameters.same_table(self.parameters()) {
            let of = |p: &Parameters| format!("{:?}", p.names().collect::<Vec<_>>());
            return Err(Error::input(
                "parameters",
                of(&parameters),
                format!("must be {}", of(self.parameters())),
            ));
        }
        parameters.check()?;
        let mut forces = self.system().forces.iter();
        forces.try_for_each(|force| force.check(&parameters))?;
        if parameters.density() > 0.0 && self.parameters().density() <= 0.0 {
            // Without water bodies may have been in one another.
            self.check_apart(self.start().0, parameters.density())?;
        }
        let (scene, choices) = (self.scene.clone(), &self.choices);
        Arc::make_mut(&mut self.assembled).set_parameters(&scene, choices, parameters);
        Ok(())
    }

    /// The same with contact that sets in over `factor` times its width, with a stiffness `factor` times smaller: what a descent starts on,
    /// and hardens ([`crate::optimize::continuation`]). Nothing changes where nothing touches.
    ///
    /// # Errors
    /// A factor that isn't a positive number.
    pub fn soften_contact(&mut self, factor: f64) -> Result<()> {
        if !(factor > 0.0 && factor.is_finite()) {
            let expected = "must be a positive number";
            return Err(Error::input("softening of contact", factor, expected));
        }
        let assembled = Arc::make_mut(&mut self.assembled);
        if let Some(contact) = &mut assembled.system.contact {
            contact.laws.common.width *= factor;
            assembled.parameters.soften_contact(factor);
        }
        Ok(())
    }

    /// Replaces the parameters unchecked: differences step across zero.
    pub(super) fn replace_parameters(&mut self, parameters: Parameters) {
        Arc::make_mut(&mut self.assembled).parameters = parameters;
    }

    /// Rigid motions of bodies that feel one another, in which nothing outside acts: the momentum along each is kept.
    pub fn kept(&self) -> &FreeMotions {
        &self.assembled.kept
    }

    /// Names of the bodies.
    pub fn names(&self) -> Vec<String> {
        let bodies = self.system().bodies.iter();
        bodies.map(|b| b.name.clone()).collect()
    }

    /// The integrator with this simulator's system.
    pub fn stepper(&self) -> Stepper<'_> {
        Stepper {
            system: self.system(),
            parameters: self.parameters(),
            integrator: self.choices.integrator,
            dt: self.choices.time_step,
        }
    }

    /// The fidelity that matters: without water bodies don't feel each other.
    pub(super) fn fidelity_acting(&self) -> Fidelity {
        if self.parameters().density() > 0.0 {
            self.assembled.water.fidelity
        } else {
            Fidelity::Isolated
        }
    }

    /// What the user should know of the smallest gap at the start.
    pub fn start_gap_warning(&self) -> Option<String> {
        let system = self.system();
        let poses = system.tree.kinematics(&self.assembled.q).poses;
        let gap = self.gaps().smallest(&poses)?;
        let start = std::iter::once((0.0, poses.as_slice(), gap));
        self.gap_warning(Some((0.0, gap)), start)
    }

    /// What the user should know of gaps: of the smallest one and its time, against the meshes, and of all in `states` (times, poses,
    /// smallest gaps), against what compressed bodies resolve.
    pub(super) fn gap_warning<'s>(
        &self,
        smallest: Option<(f64, Gap)>,
        states: impl Iterator<Item = (f64, &'s [Pose], Gap)>,
    ) -> Option<String> {
        let fidelity = self.fidelity_acting();
        let (clearance, model) = (self.clearance(), &self.assembled.water.gap_model);
        if !fidelity.coupled() || model.carried.is_none() {
            return smallest.and_then(|(time, gap)| clearance.warning(time, &gap, fidelity));
        }
        if fidelity.kind().compresses() && !clearance.films {
            let error = |gap: &Gap, poses: &[Pose]| model.error(clearance, gap, poses);
            return clearance.unresolved(states, &model.resolved, error);
        }
        let errors = states.filter_map(|(time, poses, gap)| {
            let error = model.error(clearance, &gap, poses)?;
            Some((time, gap, error))
        });
        let worst = errors.max_by(|a, b| a.2.force.total_cmp(&b.2.force));
        worst.and_then(|(time, gap, error)| clearance.estimated(time, &gap, error))
    }

    /// The estimated error of the water across a gap at these poses of all bodies.
    pub(super) fn gap_error(&self, gap: &Gap, poses: &[Pose]) -> Option<GapError> {
        let coupled = self.fidelity_acting().coupled();
        let model = &self.assembled.water.gap_model;
        let error = || model.error(self.clearance(), gap, poses);
        coupled.then(error).flatten()
    }

    /// The pairs that have films at these poses.
    pub(super) fn films(&self, poses: &[Pose]) -> Vec<(usize, Other)> {
        let model = &self.assembled.water.gap_model;
        let gaps = self.gaps().within(poses, self.widest_film());
        let film = |gap: &&Gap| model.reach(gap).is_some_and(|reach| gap.distance < reach);
        let pairs = gaps.iter().filter(film).map(|g| (g.first, g.second));
        pairs.collect()
    }

    /// By what the water is carried in gaps that have no film.
    pub(super) fn carried_without_films(&self) -> Carried {
        let model = &self.assembled.water.gap_model;
        model.carried.unwrap_or(Carried::Sources)
    }

    /// The widest gap that has a film, m; 0 where there is none.
    pub(super) fn widest_film(&self) -> f64 {
        self.assembled.water.gap_model.widest()
    }

    /// Added mass of all bodies in the water at the start.
    ///
    /// # Errors
    /// Bodies in one another or in a wall, gaps that aren't resolved, and whatever the coupling reports.
    pub fn added_mass(&self) -> Result<AddedMass> {
        let system = self.system();
        self.check_apart(self.start().0, self.parameters().density())?;
        let kinematics = system.tree.kinematics(&self.assembled.q);
        let in_water = || system.submerged().map(|(b, _)| b);
        let poses: Vec<Pose> = in_water().map(|b| kinematics.poses[b]).collect();
        let turn = world_axes(&poses);
        let record = system.coupling.evaluate(&poses, &turn)?;
        let m = turn.tr_mul(record.momenta()) * self.parameters().density();
        Ok(AddedMass {
            bodies: in_water().map(|b| system.bodies[b].name.clone()).collect(),
            matrix: 0.5 * (&m + m.transpose()),
            rotations: poses.iter().map(|pose| pose.rotation).collect(),
            report: record.report().clone(),
        })
    }

    /// Estimates the error of [`Simulator::added_mass`] at the start, from the asymmetry, from what is
    /// left at check points, and from other meshes of the same bodies.
    ///
    /// It costs about as much again as preparing the scene and one added mass; several times as much
    /// for bodies with fewer than 240 faces, whose meshes are refined instead of coarsened. With the
    /// fidelity `Isolated` the coupling is computed on up to 320 faces a body, some tenths of a second.
    ///
    /// # Errors
    /// Whatever the coupling reports on the scene's own meshes.
    pub fn error_estimate(&self) -> Result<ErrorEstimate> {
        let tree = &self.system().tree;
        let subject = Subject {
            scene: &self.scene,
            choices: &self.choices.water,
            tree,
            poses: &tree.kinematics(&self.assembled.q).poses,
            water: &self.assembled.water,
            shape_parameters: &self.choices.shape_parameters,
        };
        subject.error_estimate()
    }

    /// The bodies' surfaces, each in its body's frame, as the water sees them; none for a body without a shape.
    /// Shapes are meshed again at the first call, the same way.
    ///
    /// # Errors
    /// A file of a mesh that can't be read any more.
    pub fn meshes(&self) -> Result<Vec<Option<TriMesh>>> {
        let surfaces = self.assembled.surfaces(&self.scene, &self.choices)?;
        let mesh = |s: &Option<Surface>| s.as_ref().map(|s| s.mesh.clone());
        Ok(surfaces.iter().map(mesh).collect())
    }
}
