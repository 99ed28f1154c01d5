//! From a scene to a system: meshes, masses, joints, coupling, controller.

use super::backend::{Backend, GpuSettings};
use super::clearance::Clearance;
use super::device::Device;
use super::plan::{Planned, plan};
use super::submerged::{self, Discretisation, Plan, SubmergedBody, Water};
use super::surface::{Surface, surface};
use super::{Fidelity, Policy, Settings};
use super::{contact, controller, limits};
use crate::Result;
use crate::adjoint::drag::{self, Element, Part};
use crate::adjoint::lie::{Mat3, Mat6, Pose, Vec3, exp_matrix};
use crate::coupling::{Exclusions, Isolated};
use crate::dynamics::{BodyData, Drive, Parameters, Stepper, System};
use crate::multibody::{self, Tree};
use crate::scene::{self, Body, DragPart, Placement, Scene};
use crate::shape::{Gap, Other, TriMesh};
use nalgebra::DVector;
use std::path::Path;
use std::sync::Arc;

/// A scene made ready.
#[derive(Clone)]
pub(super) struct Assembled {
    pub system: System,
    pub parameters: Parameters,
    pub policy: Arc<dyn Policy>,
    pub q: DVector<f64>,
    pub v: DVector<f64>,
    pub faces: usize,
    /// The fidelity in use: not `Auto`.
    pub fidelity: Fidelity,
    /// What each body in the water became.
    pub discretisation: Vec<Discretisation>,
    /// Smallest gap that each body's discretisation resolves, m; zero where it isn't limited but by
    /// its mesh.
    pub resolved: Vec<f64>,
    /// What `Auto` chose for each body and pair.
    pub plan: Plan,
    /// What `Auto` chose, and why.
    pub reasons: Vec<String>,
    /// What the coupling is computed on.
    pub device: Device,
    pub clearance: Clearance,
    pub warnings: Vec<String>,
}

pub(super) fn pose(p: &Placement) -> Pose {
    Pose::new(exp_matrix(&Vec3::from(p.rotation)), Vec3::from(p.position))
}

fn joint(j: &scene::Joint) -> multibody::Joint {
    let unit = |axis: &[f64; 3]| Vec3::from(*axis).normalize();
    match j {
        scene::Joint::Fixed => multibody::Joint::Fixed,
        scene::Joint::Prismatic { axis } => multibody::Joint::Prismatic(unit(axis)),
        scene::Joint::Revolute { axis } => multibody::Joint::Revolute(unit(axis)),
        scene::Joint::Planar { plane } => {
            let (x, y, z) = (Vec3::x(), Vec3::y(), Vec3::z());
            multibody::Joint::Planar(Mat3::from_columns(&match plane {
                scene::Plane::Yz => [y, z, x],
                scene::Plane::Zx => [z, x, y],
                scene::Plane::Xy => [x, y, z],
            }))
        }
        scene::Joint::Spherical => multibody::Joint::Spherical,
        scene::Joint::Free => multibody::Joint::Free,
    }
}

fn part(p: DragPart) -> Part {
    match p {
        DragPart::Tangential => Part::Tangential,
        DragPart::Normal => Part::Normal,
        DragPart::Total => Part::Total,
    }
}

/// The bodies that the water sees with a fidelity, with their numbers in the scene. Bodies that
/// can't move matter only as boundaries of the coupled flow.
pub(super) fn in_water<'a>(
    scene: &'a Scene,
    surfaces: &'a [Option<Surface>],
    tree: &Tree,
    fidelity: Fidelity,
) -> (Vec<usize>, Vec<SubmergedBody<'a>>) {
    let alone = fidelity == Fidelity::Isolated;
    let seen = |b: &usize| !alone || moves(scene, tree, *b);
    let submerged = |b: usize| {
        let (body, surface) = (&scene.bodies[b], surfaces[b].as_ref());
        let given = body.added_mass.as_ref();
        (surface.is_some() || given.is_some()).then(|| SubmergedBody {
            name: &body.name,
            mesh: surface.map(|s| &s.mesh),
            ellipsoid: (body.shape.as_ref().and_then(submerged::semi_axes))
                .map(|axes| (axes, pose(&body.shape_at))),
            coarse: surface.and_then(|s| s.coarse.as_ref()),
            added_mass: given
                .filter(|_| alone)
                .map(|rows| Mat6::from_fn(|i, j| rows[i][j])),
        })
    };
    let numbers = (0..scene.bodies.len()).filter(seen);
    numbers.filter_map(|b| Some((b, submerged(b)?))).unzip()
}

/// Mass, centre of mass and inertia of a body.
fn inertia(body: &Body, surface: Option<&Surface>) -> (f64, Vec3, [f64; 6]) {
    let properties = surface.map(|s| &s.properties);
    let mass = body.mass.unwrap_or_else(|| {
        let volume = properties.map_or(0.0, |p| p.volume);
        body.density.unwrap_or(0.0) * volume
    });
    let center = body
        .center_of_mass
        .map(Vec3::from)
        .unwrap_or_else(|| properties.map_or(Vec3::zeros(), |p| p.centroid));
    let six = match &body.inertia {
        Some(i) if i.len() == 6 => std::array::from_fn(|k| i[k]),
        Some(i) => std::array::from_fn(|k| if k < 3 { i[k] } else { 0.0 }),
        None => match properties {
            Some(p) => {
                let i = p.inertia * (mass / p.volume);
                [
                    i[(0, 0)],
                    i[(1, 1)],
                    i[(2, 2)],
                    i[(0, 1)],
                    i[(0, 2)],
                    i[(1, 2)],
                ]
            }
            None => [0.0; 6],
        },
    };
    (mass, center, six)
}

fn elements(mesh: &TriMesh) -> Vec<Element> {
    (0..mesh.faces().len())
        .map(|f| Element {
            center: mesh.centroid(f),
            normal: mesh.normal(f),
            area: mesh.area(f),
        })
        .collect()
}

/// Whether anything moves body `b`.
fn moves(scene: &Scene, tree: &Tree, b: usize) -> bool {
    (0..scene.bodies.len()).any(|a| tree.carries(a, b) && !tree.links()[a].v.is_empty())
}

pub(super) fn assemble(
    scene: &Scene,
    settings: &Settings,
    folder: Option<&Path>,
) -> Result<Assembled> {
    contact::check_integrator(scene, settings.integrator)?;
    let index = |name: &String| scene.bodies.iter().position(|b| b.name == *name);
    let tree = Tree::new(scene.bodies.iter().map(|b| {
        (
            b.parent.as_ref().and_then(index),
            pose(&b.placement),
            joint(&b.joint),
        )
    }));
    let mut warnings = Vec::new();
    let mut parameters = Parameters::zeros(scene.bodies.len());
    parameters.density = scene.fluid.density;
    let mut surfaces = Vec::with_capacity(scene.bodies.len());
    for body in &scene.bodies {
        surfaces.push(surface(body, settings, settings.faces, 1.0)?);
    }

    let (of_submerged, submerged) = in_water(scene, &surfaces, &tree, settings.fidelity);
    let mut bodies = Vec::with_capacity(scene.bodies.len());
    let mut controls = 0;
    for (b, body) in scene.bodies.iter().enumerate() {
        let surface = surfaces[b].as_ref();
        let (mass, center, inertia) = inertia(body, surface);
        parameters.mass[b] = mass;
        parameters.inertia[b] = inertia;
        let mut data = BodyData {
            name: body.name.clone(),
            center_of_mass: center,
            volume: surface.map_or(0.0, |s| s.properties.volume),
            centroid: surface.map_or(center, |s| s.properties.centroid),
            resistance: Mat6::zeros(),
            surface: Vec::new(),
            quadratic_part: Part::default(),
            submerged: None,
            joint_control: None,
            thruster: None,
        };
        if let Some(s) = surface {
            // Also at zero coefficient: the derivative with respect to it isn't zero.
            let pieces = elements(&s.mesh);
            let d = body.drag.unwrap_or_default();
            data.resistance = drag::resistance(&pieces, part(d.part));
            parameters.linear_drag[b] = d.linear;
            parameters.quadratic_drag[b] = d.quadratic;
            if body.drag.is_some() {
                data.quadratic_part = part(d.quadratic_part);
                data.surface = pieces;
            }
        }
        data.submerged = of_submerged.iter().position(|w| *w == b);
        if body.actuated {
            data.joint_control = Some(controls);
            controls += tree.links()[b].v.len();
        }
        if body.thruster {
            data.thruster = Some(controls);
            controls += 6;
        }
        bodies.push(data);
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
    let clearance = Clearance::new(scene, &surfaces, &tree, &drives)?;
    let mut system = System {
        bodies,
        drives,
        gravity: Vec3::from(scene.gravity),
        current: Vec3::from(scene.fluid.current),
        controls,
        coupling: Arc::new(Isolated::new(Vec::new())),
        contact: None,
        limits: Vec::new(),
        tree,
    };
    let q = start_coordinates(scene, settings, &system, &parameters, &clearance)?;
    let Planned {
        fidelity,
        plan,
        reasons,
    } = choose(
        scene,
        settings,
        &system,
        &q,
        &clearance,
        &submerged,
        &of_submerged,
    )?;
    warnings.extend(without_effect(settings));
    let water = water(scene, &of_submerged, folder);
    let mut device = Device::open(settings, fidelity)?;
    let made = submerged::couple(&submerged, &water, settings, fidelity, &plan, &mut device)?;
    warnings.extend(device.warning());
    system.coupling = made.coupling.into();
    warnings.extend(made.warnings);
    let mut resolved = vec![0.0; scene.bodies.len()];
    for (b, d) in of_submerged.iter().zip(&made.bodies) {
        resolved[*b] = d.resolved_gap.unwrap_or(0.0);
    }
    if let Some(given) = &scene.contact {
        let made = contact::assemble(contact::Parts {
            scene,
            given,
            settings,
            clearance: &clearance,
            fidelity,
            resolved: &resolved,
            surfaces: &surfaces,
            mass: &parameters.mass,
        })?;
        (system.contact, parameters.contact) = (Some(made.0), made.1);
    }
    let dt = settings.time_step.unwrap_or(scene.time_step);
    system.limits = limits::assemble(scene, dt, &system, &parameters, &q)?;
    let v = start_velocity(scene, settings, &system, &parameters, &q)?;
    Ok(Assembled {
        policy: controller::policy(scene, &system)?.into(),
        system,
        parameters,
        q,
        v,
        faces: made.faces,
        fidelity,
        discretisation: made.bodies,
        resolved,
        plan,
        reasons,
        device,
        clearance,
        warnings,
    })
}

/// What is around the bodies in the water, `of_submerged` being their numbers in the scene.
pub(super) fn water<'a>(
    scene: &'a Scene,
    of_submerged: &[usize],
    folder: Option<&'a Path>,
) -> Water<'a> {
    let number = |b: usize| of_submerged.iter().position(|w| *w == b);
    let declared = scene.overlapping().into_iter();
    let pairs = declared.filter_map(|(a, b)| Some((number(a)?, number(b)?)));
    Water {
        walls: &scene.walls,
        excluded: Exclusions::new(pairs),
        folder,
    }
}

/// Settings that the backend or the fidelity doesn't look at.
fn without_effect(settings: &Settings) -> Vec<String> {
    let mut out = Vec::new();
    if settings.backend == Backend::Cpu && settings.gpu != GpuSettings::default() {
        out.push("the settings of the GPU have no effect with the backend cpu".into());
    }
    if settings.fidelity == Fidelity::Reduced {
        return out;
    }
    let given = [
        ("rank", settings.compress.rank.is_some()),
        ("resolved_gap", settings.compress.resolved_gap.is_some()),
    ];
    let unused = given.iter().filter(|(_, given)| *given);
    out.extend(unused.map(|(name, _)| {
        format!(
            "the setting {name} has no effect with the fidelity {}: only reduced takes it",
            format!("{:?}", settings.fidelity).to_lowercase()
        )
    }));
    out
}

/// The fidelity to use, and what `Auto` makes of the scene.
fn choose(
    scene: &Scene,
    settings: &Settings,
    system: &System,
    q: &DVector<f64>,
    clearance: &Clearance,
    submerged: &[SubmergedBody],
    of_submerged: &[usize],
) -> Result<Planned> {
    if settings.fidelity != Fidelity::Auto || scene.fluid.density <= 0.0 {
        return Ok(Planned {
            fidelity: settings.fidelity,
            plan: Plan::default(),
            reasons: Vec::new(),
        });
    }
    let all = system.tree.kinematics(q).poses;
    let poses: Vec<Pose> = of_submerged.iter().map(|b| all[*b]).collect();
    let number = |b: usize| of_submerged.iter().position(|w| *w == b);
    let mut gaps = Vec::new();
    for gap in [&clearance.moving, &clearance.rigid]
        .into_iter()
        .flat_map(|g| g.all(&all))
    {
        let second = match gap.second {
            Other::Body(b) => number(b).map(Other::Body),
            wall => Some(wall),
        };
        if let (Some(first), Some(second)) = (number(gap.first), second) {
            gaps.push(Gap {
                first,
                second,
                ..gap
            });
        }
    }
    plan(submerged, &poses, &gaps, &scene.walls, settings.accuracy.0)
}

/// Initial coordinates.
fn start_coordinates(
    scene: &Scene,
    settings: &Settings,
    system: &System,
    parameters: &Parameters,
    clearance: &Clearance,
) -> Result<DVector<f64>> {
    let mut q = if scene.initial.q.is_empty() {
        system.tree.origin()
    } else {
        DVector::from_vec(scene.initial.q.clone())
    };
    stepper(scene, settings, system, parameters).place_motions(&mut q, 0.0);
    if settings.fidelity != Fidelity::Isolated && scene.fluid.density > 0.0 {
        clearance.refuse_start(&q, system)?;
    }
    Ok(q)
}

fn stepper<'a>(
    scene: &Scene,
    settings: &Settings,
    system: &'a System,
    parameters: &'a Parameters,
) -> Stepper<'a> {
    Stepper {
        system,
        parameters,
        integrator: Default::default(),
        dt: settings.time_step.unwrap_or(scene.time_step),
    }
}

/// Initial velocity; a given momentum is turned into velocity.
fn start_velocity(
    scene: &Scene,
    settings: &Settings,
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
        let stepper = stepper(scene, settings, system, parameters);
        let e = system.evaluate(parameters, q, false, false)?;
        let p = DVector::from_vec(scene.initial.momentum.clone());
        v = stepper.velocity_of_momentum(&e, &p)?;
    }
    Ok(v)
}
