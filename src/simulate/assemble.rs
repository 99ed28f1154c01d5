//! From a scene to a system: meshes, masses, joints, coupling, controller.

use super::clearance::Clearance;
use super::policy::{Constant, OpenLoop, Pd, PdAxis, PushThenLock};
use super::{Fidelity, Policy, Settings};
use crate::adjoint::drag::{self, Element, Part};
use crate::adjoint::lie::{Mat3, Mat6, Pose, Vec3, exp_matrix};
use crate::boundary::BodyBoundary;
use crate::coupling::full::{Full, Solver, WetBody};
use crate::coupling::{Coupling, Exclusions, Isolated};
use crate::dynamics::{BodyData, Drive, Parameters, Stepper, System};
use crate::multibody::{self, Tree};
use crate::scene::{self, Body, Controller, DragPart, Placement, Scene};
use crate::shape::{self, MassProperties, TriMesh};
use crate::{Error, Result};
use nalgebra::DVector;
use std::path::Path;
use std::sync::Arc;

/// A scene made ready.
pub(super) struct Assembled {
    pub system: System,
    pub parameters: Parameters,
    pub policy: Box<dyn Policy>,
    pub q: DVector<f64>,
    pub v: DVector<f64>,
    pub faces: usize,
    pub sources: usize,
    pub clearance: Clearance,
    pub warnings: Vec<String>,
}

fn pose(p: &Placement) -> Pose {
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

/// A body's surface in its own frame, with its mass properties.
pub(super) struct Surface {
    pub mesh: TriMesh,
    pub properties: MassProperties,
}

fn surface(body: &Body, faces: Option<usize>) -> Result<Option<Surface>> {
    let Some(shape) = &body.shape else {
        return Ok(None);
    };
    let mesh = shape::build(shape, Path::new(""), faces)?.transformed(&pose(&body.shape_at));
    Ok(Some(Surface {
        properties: mesh.mass_properties(),
        mesh,
    }))
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

/// One-body discretisations, made once per shape and settings.
struct Library<'a> {
    settings: &'a Settings,
    made: Vec<(usize, Arc<WetBody>)>,
}

impl Library<'_> {
    /// The discretisation of body `b`; bodies with equal shapes share one.
    fn body(&mut self, scene: &Scene, b: usize, mesh: &TriMesh) -> Result<Arc<WetBody>> {
        let same = |a: &Body, c: &Body| a.shape == c.shape && a.shape_at == c.shape_at;
        if let Some((_, made)) = self
            .made
            .iter()
            .find(|(a, _)| same(&scene.bodies[*a], &scene.bodies[b]))
        {
            return Ok(made.clone());
        }
        let (vertices, faces) = (mesh.vertices(), mesh.faces());
        let name = &scene.bodies[b].name;
        let mut settings = self.settings.boundary;
        if self.settings.solve.solver == Solver::Gmres {
            // GMRES solves the square system as it is; damping belongs to least squares.
            settings.damping = 0.0;
        }
        let boundary = BodyBoundary::new(name, vertices, faces, &settings)?;
        let made = Arc::new(WetBody::new(Arc::new(boundary)));
        self.made.push((b, made.clone()));
        Ok(made)
    }
}

/// Whether anything moves body `b`.
fn moves(scene: &Scene, tree: &Tree, b: usize) -> bool {
    (0..scene.bodies.len()).any(|a| tree.carries(a, b) && !tree.links()[a].v.is_empty())
}

pub(super) fn assemble(scene: &Scene, settings: &Settings) -> Result<Assembled> {
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
        surfaces.push(surface(body, settings.faces)?);
    }

    let mut library = Library {
        settings,
        made: Vec::new(),
    };
    let mut isolated: Vec<Mat6> = Vec::new();
    let mut full: Vec<Arc<WetBody>> = Vec::new();
    let mut bodies = Vec::with_capacity(scene.bodies.len());
    let (mut controls, mut wet_count, mut faces, mut sources) = (0, 0, 0, 0);
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
            wet: None,
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
        // Bodies that can't move matter only as boundaries of the coupled flow.
        let seen = settings.fidelity == Fidelity::Full || moves(scene, &tree, b);
        if seen && (surface.is_some() || body.added_mass.is_some()) {
            data.wet = Some(wet_count);
            wet_count += 1;
            match (settings.fidelity, &body.added_mass, surface) {
                (Fidelity::Isolated, Some(rows), _) => {
                    isolated.push(Mat6::from_fn(|i, j| rows[i][j]));
                }
                (_, _, Some(s)) => {
                    let made = library.body(scene, b, &s.mesh)?;
                    faces += made.faces();
                    sources += made.sources();
                    isolated.push(made.boundary.added_mass);
                    full.push(made);
                }
                (Fidelity::Full, Some(_), None) => {
                    return Err(Error::Unsupported {
                        what: format!("coupling of body \"{}\"", body.name),
                        why: "it has a given added mass but no shape".into(),
                        instead: "give it a shape, or use the fidelity isolated".into(),
                    });
                }
                (_, None, None) => {}
            }
        }
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
    for (_, made) in &library.made {
        warnings.extend(made.boundary.warnings.iter().cloned());
    }
    let coupling: Box<dyn Coupling> = match settings.fidelity {
        Fidelity::Isolated => {
            if !scene.walls.is_empty() {
                warnings.push(format!(
                    "{} wall(s) have no effect with the fidelity isolated; use full to feel them",
                    scene.walls.len()
                ));
            }
            Box::new(Isolated::new(isolated))
        }
        Fidelity::Full => {
            let pairs = scene.overlapping().into_iter();
            let wet = pairs.filter_map(|(a, b)| Some((bodies[a].wet?, bodies[b].wet?)));
            let excluded = Exclusions::new(wet);
            Box::new(Full::new(full, &scene.walls, excluded, settings.solve)?)
        }
    };
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
    let system = System {
        bodies,
        drives,
        gravity: Vec3::from(scene.gravity),
        current: Vec3::from(scene.fluid.current),
        controls,
        coupling,
        tree,
    };
    let (q, v) = start(scene, settings, &system, &parameters, &clearance)?;
    Ok(Assembled {
        policy: policy(scene, &system)?,
        system,
        parameters,
        q,
        v,
        faces,
        sources,
        clearance,
        warnings,
    })
}

/// Initial coordinates and velocity; a given momentum is turned into velocity.
fn start(
    scene: &Scene,
    settings: &Settings,
    system: &System,
    parameters: &Parameters,
    clearance: &Clearance,
) -> Result<(DVector<f64>, DVector<f64>)> {
    let stepper = Stepper {
        system,
        parameters,
        integrator: Default::default(),
        dt: settings.time_step.unwrap_or(scene.time_step),
    };
    let mut q = if scene.initial.q.is_empty() {
        system.tree.origin()
    } else {
        DVector::from_vec(scene.initial.q.clone())
    };
    stepper.place_motions(&mut q, 0.0);
    if settings.fidelity == Fidelity::Full && scene.fluid.density > 0.0 {
        clearance.refuse_start(&q, system)?;
    }
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
        let e = stepper.evaluate(&q, false)?;
        let p = DVector::from_vec(scene.initial.momentum.clone());
        v = stepper.velocity_of_momentum(&e, &p)?;
    }
    Ok((q, v))
}

/// The scene's controller.
fn policy(scene: &Scene, system: &System) -> Result<Box<dyn Policy>> {
    let count = |name: &str, n: usize| {
        if n == system.controls {
            return Ok(());
        }
        Err(Error::input(
            format!("controller.{name}"),
            format!("{n} numbers"),
            format!("must be {} numbers, one per control", system.controls),
        ))
    };
    Ok(match &scene.controller {
        None => Box::new(OpenLoop),
        Some(Controller::Constant { control }) => {
            count("control", control.len())?;
            Box::new(Constant {
                control: control.clone(),
            })
        }
        Some(Controller::Pd {
            target,
            stiffness,
            damping,
        }) => {
            count("target", target.len())?;
            count("stiffness", stiffness.len())?;
            count("damping", damping.len())?;
            let mut axes = Vec::new();
            for (body, link) in system.bodies.iter().zip(system.tree.links()) {
                let Some(at) = body.joint_control else {
                    continue;
                };
                for k in 0..link.v.len() {
                    axes.push(PdAxis {
                        control: at + k,
                        q: link.q.start + k,
                        v: link.v.start + k,
                        target: target[at + k],
                        stiffness: stiffness[at + k],
                        damping: damping[at + k],
                    });
                }
            }
            Box::new(Pd {
                controls: system.controls,
                velocities: system.tree.velocities(),
                axes,
            })
        }
        Some(Controller::PushThenLock {
            body,
            force,
            stop_at,
        }) => {
            let b = system.bodies.iter().position(|x| x.name == *body);
            let found = b.and_then(|b| Some((b, system.bodies[b].joint_control?)));
            let Some((b, control)) = found else {
                return Err(Error::input(
                    "controller.body",
                    body,
                    "must be the name of a body with an actuated one-coordinate joint",
                ));
            };
            Box::new(PushThenLock {
                controls: system.controls,
                bodies: system.len(),
                body: b,
                control,
                q: system.tree.links()[b].q.start,
                force: *force,
                stop_at: *stop_at,
                from_above: *force < 0.0,
            })
        }
    })
}
