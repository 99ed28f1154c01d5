//! From a scene to a system: masses, joints, water, contact, limits, controller.

mod bodies;
mod choices;
mod contact;
mod controller;
mod limits;
mod lubrication;
mod shape;
mod symmetry;

use crate::adjoint::lie::Vec3;
use crate::adjoint::waterline::Hull;
use crate::coupling::Isolated;
use crate::dynamics::force::Streams;
use crate::dynamics::{
    Armature, BodyData, Declarations, Drift, Drive, FreeMotions, Motions, Parameters, SiteData,
    Stepper, System, force,
};
use crate::memory;
use crate::multibody::Tree;
use crate::policy::Policy;
use crate::scene::{Body, Scene, Site};
use crate::water::{self, Clearance, FlowSurface, Prepared, ShapeChange, Surface, pose};
use crate::{Error, Result};
use bodies::{ball, body_values, elements, hull};
use nalgebra::DVector;
use std::path::Path;
use std::sync::{Arc, OnceLock};

pub use choices::Choices;
pub(crate) use lubrication::bearing;

/// A scene made ready.
#[derive(Clone)]
pub(crate) struct Assembled {
    pub system: System,
    pub parameters: Parameters,
    pub policy: Arc<dyn Policy>,
    pub q: DVector<f64>,
    pub v: DVector<f64>,
    pub water: Prepared,
    /// Rigid motions along which momentum is kept, at the parameters.
    pub kept: FreeMotions,
    /// The bodies' surfaces, once someone asked for them.
    pub surfaces: Arc<OnceLock<Vec<Option<Surface>>>>,
    /// Surfaces of the bodies in the water, once someone asked for the flow on them.
    pub flow_surfaces: Arc<OnceLock<Vec<FlowSurface>>>,
}

impl Assembled {
    /// The bodies' surfaces, as the water sees them; shapes are meshed again at the first call.
    pub fn surfaces(&self, scene: &Scene, choices: &Choices) -> Result<&[Option<Surface>]> {
        if let Some(found) = self.surfaces.get() {
            return Ok(found);
        }
        let made = water::surfaces(scene, &choices.water, &choices.shape_parameters)?;
        Ok(self.surfaces.get_or_init(|| made))
    }

    /// Surfaces of the bodies in the water, on which the flow is computed; they are solved at the first call.
    ///
    /// # Errors
    /// A body without a surface, or one that panels don't resolve.
    pub fn flow_surfaces(&self, scene: &Scene, choices: &Choices) -> Result<&[FlowSurface]> {
        if let Some(found) = self.flow_surfaces.get() {
            return Ok(found);
        }
        let (surfaces, tree) = (self.surfaces(scene, choices)?, &self.system.tree);
        let (_, bodies) = water::in_water(scene, surfaces, tree, choices.water.fidelity.coupled());
        let made = FlowSurface::all(&bodies, self.system.coupling.surfaces())?;
        Ok(self.flow_surfaces.get_or_init(|| made))
    }

    /// Other parameters, of the same table.
    pub fn set_parameters(&mut self, scene: &Scene, choices: &Choices, parameters: Parameters) {
        self.kept = symmetry::kept(scene, coupled(scene, choices), &self.system, &parameters);
        self.parameters = parameters;
    }
}

/// Whether bodies in the water feel one another.
fn coupled(scene: &Scene, choices: &Choices) -> bool {
    choices.water.fidelity.coupled() && scene.fluid.density > 0.0
}

/// Prepares the scene; compressed bodies are kept in `folder`.
pub(crate) fn assemble(
    scene: &Scene,
    choices: &Choices,
    folder: Option<&Path>,
) -> Result<Assembled> {
    let dt = choices.time_step;
    if !(dt > 0.0 && dt.is_finite()) {
        return Err(Error::input(
            "settings: time_step",
            dt,
            "give a time above zero, in s",
        ));
    }
    contact::check_integrator(scene, choices.integrator)?;
    let carriers = scene.carriers();
    let tree = Tree::new(
        scene
            .bodies
            .iter()
            .enumerate()
            .map(|(i, b)| (carriers.parent(i), pose(&b.placement), b.joint.model())),
    );
    let leader = |b: &Body| {
        let mimic = b.mimic.as_ref()?;
        Some((scene.body(&mimic.body)?.0, mimic.ratio, mimic.offset))
    };
    let tree = match scene.bodies.iter().any(|b| b.mimic.is_some()) {
        true => tree.following(&scene.bodies.iter().map(leader).collect::<Vec<_>>()),
        false => tree,
    };
    memory::fits(
        &format!(
            "a scene of {} bodies with {} velocities",
            scene.bodies.len(),
            tree.velocities()
        ),
        memory::numbers(numbers(
            &tree,
            coupled(scene, choices) && !by_products(scene, choices),
        )),
        "use fewer bodies, or several scenes where they don't feel each other",
    )?;
    let surfaces = water::surfaces(scene, &choices.water, &choices.shape_parameters)?;
    let in_water = water::in_water(scene, &surfaces, &tree, choices.water.fidelity.coupled());
    let mut bodies = Vec::with_capacity(scene.bodies.len());
    let mut faces = Vec::with_capacity(scene.bodies.len());
    let mut values = Vec::with_capacity(scene.bodies.len());
    let mut controls = 0;
    for (b, body) in scene.bodies.iter().enumerate() {
        let surface = surfaces[b].as_ref();
        let volume = surface.map(|s| s.properties.volume);
        values.push(body_values(scene, body, surface.map(|s| &s.properties)));
        faces.push(surface.map_or(Vec::new(), |s| elements(&s.mesh)));
        let mut first = |taken: bool, count: usize| {
            let at = controls;
            controls += if taken { count } else { 0 };
            taken.then_some(at)
        };
        bodies.push(BodyData {
            name: body.name.clone(),
            volume: volume.unwrap_or(0.0),
            submerged: in_water.0.iter().position(|w| *w == b),
            joint_control: first(body.actuated, tree.links()[b].v.len()),
            thruster: first(body.thruster, 6),
        });
    }
    let drives: Vec<Drive> = scene
        .bodies
        .iter()
        .map(|b| match &b.motion {
            Some(m) => Drive::Motion(m.clone()),
            None if b.locked => Drive::Locked,
            None => Drive::Free,
        })
        .collect();
    let clearance = Clearance::new(scene, &surfaces, &tree)?;
    let hulls: Vec<Option<Hull>> = match scene.waterline {
        Some(_) => (surfaces.iter().zip(&values))
            .map(|(s, values)| match s {
                Some(s) => Ok(Some(hull(s.given()))),
                None => ball(values),
            })
            .collect::<Result<_>>()?,
        None => Vec::new(),
    };
    let mut declared = Declarations::new(scene.fluid.density, &values);
    let points = surfaces.iter().zip(&values).map(|(s, v)| {
        s.as_ref()
            .map_or(v.center_of_mass, |s| s.properties.centroid)
    });
    let changes = ShapeChange::wanted(scene, &surfaces, &choices.shape_parameters)?;
    let shapes = shape::declare(scene, &changes, &in_water.0, &surfaces, &mut declared)?;
    let streams = Arc::new(Streams::new(scene, points.collect(), &mut declared));
    let added_mass = match streams.is_empty() || scene.fluid.density <= 0.0 {
        true => Vec::new(),
        false => water::own_added_mass(scene, &choices.water, &in_water)?,
    };
    let lubricated = lubrication::lubricated(scene, &surfaces, &clearance)?;
    shape::refuse(scene, &changes, &lubricated, !streams.is_empty())?;
    let changed = shape::changed_surfaces(&changes, &shapes, &surfaces);
    let parts = force::ForceParts {
        scene,
        time_step: dt,
        tree: &tree,
        bodies: &bodies,
        values: &values,
        surfaces: &faces,
        hulls: &hulls,
        waterline: scene.waterline.map(|_| streams.surface()),
        lubricated,
        changed: &changed,
        shapes: &shapes,
        streams: streams.clone(),
        added_mass,
    };
    let forces = force::assemble(&parts, &mut declared);
    let armature = Armature::new(scene, &tree, &mut declared);
    let mut parameters = declared.finish();
    let current = Vec3::from(scene.fluid.current);
    let site = |site: &Site| {
        Some(SiteData {
            name: site.name.clone(),
            body: scene.site_body(site)?.0,
            pose: pose(&site.placement),
        })
    };
    let mut system = System {
        bodies,
        sites: scene.sites.iter().filter_map(site).collect(),
        drift: Drift::new(&tree, |b| drives[b] == Drive::Free, &current),
        drives,
        armature,
        forces,
        current,
        streams,
        controls: scene.controls(),
        coupling: Arc::new(Isolated::new(Vec::new())),
        shapes,
        contact: None,
        limits: Vec::new(),
        late: DVector::zeros(0),
        symmetric: Motions::default(),
        tree,
    };
    let mut q = match scene.initial.q.is_empty() {
        true => start(scene),
        false => DVector::from_vec(scene.initial.q.clone()),
    };
    stepper(choices, &system, &parameters).place_motions(&mut q, 0.0);
    let poses = system.tree.kinematics(&q).poses;
    if choices.water.fidelity.coupled() && scene.fluid.density > 0.0 {
        clearance.refuse_start(&poses)?;
    }
    let mut water = water::prepare(
        scene,
        &choices.water,
        in_water,
        &poses,
        clearance,
        &changes,
        folder,
    )?;
    #[cfg(feature = "urdf")]
    if scene.fluid.density > 0.0 {
        water.warnings.extend(scene.imports.warnings());
    }
    if scene.fluid.density > 0.0 {
        let told = water::too_coarse(scene, choices.water.faces, &water.bodies, &surfaces);
        water.warnings.extend(told);
    }
    system.coupling = water.coupling.clone();
    water.reasons.extend(contact::stand_in(scene, choices));
    if let Some(given) = &scene.contact {
        let mut made = contact::assemble(scene, given, dt, &water, &surfaces, &mut parameters)?;
        let contacts = &made.shapes;
        made.changed =
            shape::changed_contacts(scene, &changes, &system.shapes, &surfaces, contacts)?;
        let told = contact::warnings(scene, given, &water, &surfaces, &made);
        water.warnings.extend(told);
        system.contact = Some(made);
    }
    system.limits = limits::assemble(scene, dt, &system, &parameters, &q)?;
    system.late = system.late_weights(&parameters, &q, dt)?;
    let coupled = coupled(scene, choices);
    system.symmetric = symmetry::free(scene, coupled, &system);
    let kept = symmetry::kept(scene, coupled, &system, &parameters);
    let v = start_velocity(scene, choices, &system, &parameters, &q)?;
    Ok(Assembled {
        policy: controller::policy(scene, &system).into(),
        system,
        parameters,
        q,
        v,
        water,
        kept,
        surfaces: Default::default(),
        flow_surfaces: Default::default(),
    })
}

/// Whether no matrix is formed of bodies that feel one another.
fn by_products(scene: &Scene, choices: &Choices) -> bool {
    let exchange = choices.water.numerics.exchange;
    let water = &choices.water;
    choices.shape_parameters.is_empty()
        && water.fidelity.kind().compresses()
        && exchange.expected(scene)
}

/// Numbers that a step takes at once. Where bodies feel each other through the water, of all velocities with all: the mass matrix with its factor and that of the
/// water, and what each velocity moves. Else of the velocities of each tree of joints with one another.
fn numbers(tree: &Tree, coupled: bool) -> f64 {
    let (bodies, velocities) = (tree.links().len() as f64, tree.velocities() as f64);
    if coupled {
        return 4.0 * velocities * velocities + 6.0 * bodies * velocities;
    }
    let mut roots: Vec<usize> = Vec::with_capacity(tree.links().len());
    let mut sizes = vec![0_usize; tree.links().len()];
    for (b, link) in tree.links().iter().enumerate() {
        let root = link.parent.map_or(b, |parent| roots[parent]);
        sizes[root] += link.v.len();
        roots.push(root);
    }
    let largest = sizes.into_iter().max().unwrap_or(0) as f64;
    // Inertia, its change, what the step is solved with, and the factors of that.
    8.0 * velocities * largest
}

fn stepper<'a>(choices: &Choices, system: &'a System, parameters: &'a Parameters) -> Stepper<'a> {
    Stepper {
        system,
        parameters,
        integrator: Default::default(),
        dt: choices.time_step,
    }
}

/// Where joints start by themselves.
fn start(scene: &Scene) -> DVector<f64> {
    let of = |body: &Body| match (&body.mimic, body.start.is_empty()) {
        (Some(_), _) => Vec::new(),
        (None, true) => body.joint.origin(),
        (None, false) => body.start.clone(),
    };
    DVector::from_vec(scene.bodies.iter().flat_map(of).collect())
}

/// Initial velocity; a given momentum is turned into velocity.
fn start_velocity(
    scene: &Scene,
    choices: &Choices,
    system: &System,
    parameters: &Parameters,
    q: &DVector<f64>,
) -> Result<DVector<f64>> {
    let mut v = if scene.initial.v.is_empty() {
        DVector::zeros(system.tree.velocities())
    } else {
        DVector::from_vec(scene.initial.v.clone())
    };
    for (drive, link) in system.drives.iter().zip(system.tree.links()) {
        if let Drive::Motion(motions) = drive {
            for (k, i) in link.v.clone().enumerate() {
                v[i] = motions[k].rate(0.0);
            }
        }
    }
    if !scene.initial.momentum.is_empty() {
        let stepper = stepper(choices, system, parameters);
        let e = system.evaluate(parameters, q, 0.0)?;
        let p = DVector::from_vec(scene.initial.momentum.clone());
        v = stepper.velocity_of_momentum(&e, &p)?;
    }
    Ok(v)
}
