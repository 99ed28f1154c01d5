//! The water of a scene: by which method each body is solved, with which fidelity they are coupled, on which device, and
//! how near they may come.

pub(crate) mod backend;
mod clearance;
mod device;
mod estimate;
mod plan;
mod settings;
mod submerged;
mod surface;

pub use backend::{AdapterName, Arithmetic, Backend, BackendReport, DeviceReport, GpuSettings};
pub use estimate::{ErrorEstimate, Level};
pub use settings::{Accuracy, Fidelity, Settings};
pub use submerged::Discretisation;

pub(crate) use clearance::Clearance;
pub(crate) use device::Device;
pub(crate) use estimate::Subject;
pub(crate) use submerged::SubmergedBody;
pub(crate) use surface::{Surface, pose, surfaces};

use crate::Result;
use crate::adjoint::lie::{Mat6, Pose};
use crate::coupling::{Coupling, Exclusions};
use crate::geometry::{Gap, Other};
use crate::multibody::Tree;
use crate::scene::Scene;
use nalgebra::DMatrix;
use plan::{Planned, plan};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use submerged::{Plan, Water};

/// The water of a scene, ready to be evaluated.
#[derive(Clone)]
pub(crate) struct Prepared {
    /// The bodies in the water, by their numbers in the scene.
    pub bodies: Vec<usize>,
    pub coupling: Arc<dyn Coupling>,
    pub faces: usize,
    /// The fidelity in use: not `Auto`.
    pub fidelity: Fidelity,
    /// What each body in the water became.
    pub discretisation: Vec<Discretisation>,
    /// Smallest gap that the discretisation of each body of the scene resolves, m; zero where it isn't limited but by
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
    /// Where compressed bodies are kept.
    pub folder: Option<PathBuf>,
}

/// The bodies that the water sees with a fidelity, with their numbers in the scene. Bodies that
/// can't move matter only as boundaries of the coupled flow.
pub(crate) fn in_water<'a>(
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

/// Whether anything moves body `b`.
fn moves(scene: &Scene, tree: &Tree, b: usize) -> bool {
    (0..scene.bodies.len()).any(|a| tree.carries(a, b) && !tree.links()[a].v.is_empty())
}

/// Couples the bodies of a scene, which start at `poses` (all bodies of the scene).
pub(crate) fn prepare(
    scene: &Scene,
    settings: &Settings,
    (numbers, submerged): (Vec<usize>, Vec<SubmergedBody>),
    poses: &[Pose],
    clearance: Clearance,
    folder: Option<&Path>,
) -> Result<Prepared> {
    let Planned {
        fidelity,
        plan,
        reasons,
    } = choose(scene, settings, poses, &clearance, &submerged, &numbers)?;
    let mut warnings = without_effect(settings);
    let water = around(scene, &numbers, folder);
    let mut device = Device::open(settings, fidelity)?;
    let made = submerged::couple(&submerged, &water, settings, fidelity, &plan, &mut device)?;
    warnings.extend(device.warning());
    warnings.extend(made.warnings);
    let mut resolved = vec![0.0; scene.bodies.len()];
    for (b, d) in numbers.iter().zip(&made.bodies) {
        resolved[*b] = d.resolved_gap.unwrap_or(0.0);
    }
    Ok(Prepared {
        bodies: numbers,
        coupling: made.coupling.into(),
        faces: made.faces,
        fidelity,
        discretisation: made.bodies,
        resolved,
        plan,
        reasons,
        device,
        clearance,
        warnings,
        folder: folder.map(Path::to_path_buf),
    })
}

/// What is around the bodies in the water, which have these numbers in the scene.
fn around<'a>(scene: &'a Scene, numbers: &[usize], folder: Option<&'a Path>) -> Water<'a> {
    let number = |b: usize| numbers.iter().position(|w| *w == b);
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
    all: &[Pose],
    clearance: &Clearance,
    submerged: &[SubmergedBody],
    numbers: &[usize],
) -> Result<Planned> {
    if settings.fidelity != Fidelity::Auto || scene.fluid.density <= 0.0 {
        return Ok(Planned {
            fidelity: settings.fidelity,
            plan: Plan::default(),
            reasons: Vec::new(),
        });
    }
    let poses: Vec<Pose> = numbers.iter().map(|b| all[*b]).collect();
    let number = |b: usize| numbers.iter().position(|w| *w == b);
    let mut gaps = Vec::new();
    for gap in [&clearance.moving, &clearance.rigid]
        .into_iter()
        .flat_map(|g| g.all(all))
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

/// Unit twists along world axes about each body's origin, in body frames: turned, not shifted.
pub(crate) fn world_axes(poses: &[Pose]) -> DMatrix<f64> {
    let n = 6 * poses.len();
    let mut axes = DMatrix::zeros(n, n);
    for (w, pose) in poses.iter().enumerate() {
        for half in 0..2 {
            axes.fixed_view_mut::<3, 3>(6 * w + 3 * half, 6 * w + 3 * half)
                .copy_from(&pose.rotation.transpose());
        }
    }
    axes
}
