//! The water of a scene, ready to be evaluated.

use super::choices::WaterChoices;
use super::clearance::Clearance;
use super::device::Device;
use super::fidelity::Fidelity;
use super::fidelity::kind::Planned;
use super::method::kind::{BodyMethod, Problem};
use super::numerics::Plan;
use super::resolved::Resolved;
use super::submerged::{Discretisation, SubmergedBody};
use crate::Result;
use crate::adjoint::lie::Pose;
use crate::coupling::Coupling;
use crate::geometry::{Gap, Other};
use crate::scene::Scene;
use nalgebra::DMatrix;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The water of a scene, ready to be evaluated.
#[derive(Clone)]
pub(crate) struct Prepared {
    /// The bodies in the water, by their numbers in the scene.
    pub bodies: Vec<usize>,
    pub coupling: Arc<dyn Coupling>,
    pub faces: usize,
    /// The fidelity in use.
    pub fidelity: Fidelity,
    /// The body method in use.
    pub method: &'static dyn BodyMethod,
    /// What each body in the water became.
    pub discretisation: Vec<Discretisation>,
    /// Smallest gap that the discretisation of each body of the scene resolves, m; zero where it isn't limited but by
    /// its mesh.
    pub resolved: Vec<Resolved>,
    /// What was chosen for each body and pair.
    pub plan: Plan,
    /// What was chosen, and why.
    pub reasons: Vec<String>,
    /// What the coupling is computed on.
    pub device: Device,
    pub clearance: Clearance,
    pub warnings: Vec<String>,
    /// Where compressed bodies are kept.
    pub folder: Option<PathBuf>,
}

/// The narrowest gap that films resolve, in edges: the forces between round bodies are then 7 to 8 % off, between flat ones less.
const FILM_EDGES: f64 = 0.1;

/// Couples the bodies of a scene, which start at `poses` (all bodies of the scene).
///
/// # Errors
/// A device that can't be opened, bodies that the method or the fidelity can't take, or whatever the discretisation reports.
pub(crate) fn prepare(
    scene: &Scene,
    choices: &WaterChoices,
    (numbers, submerged): (Vec<usize>, Vec<SubmergedBody>),
    poses: &[Pose],
    mut clearance: Clearance,
    folder: Option<&Path>,
) -> Result<Prepared> {
    let method = choices.method_used().kind();
    let mut problem = Problem::new(scene, &numbers, &submerged, method, &choices.numerics);
    let (fidelity, planned) = plan(
        scene,
        choices.fidelity,
        poses,
        &clearance,
        &problem,
        &numbers,
    )?;
    (problem.plan, problem.folder) = (&planned.plan, folder);
    clearance.by_sources = !fidelity.kind().solves_alone() && method.by_sources();
    clearance.films = choices.numerics.films && fidelity.kind().compresses();
    clearance.resolved_edges = match (clearance.films, fidelity.kind().compresses()) {
        (true, _) => FILM_EDGES,
        // What compressed bodies resolve isn't a matter of edges.
        (false, true) => 0.0,
        (false, false) => method.resolved_edges(),
    };
    let touching = fidelity.kind().solves_alone() || method.may_touch();
    clearance.may_touch = touching || scene.fluid.density <= 0.0;
    for gaps in [&clearance.moving, &clearance.rigid] {
        clearance.refuse_touch(gaps.smallest(poses).as_ref())?;
    }
    clearance.refuse_film(poses)?;
    let mut warnings = choices.without_effect();
    let idle = fidelity.kind().idle_gpu();
    let mut device = Device::open(choices.backend, &choices.gpu, idle)?;
    let made = fidelity.kind().couple(&problem, &mut device)?;
    warnings.extend(device.reason.clone());
    warnings.extend(made.warnings);
    let mut resolved = vec![Resolved::default(); scene.bodies.len()];
    for (b, d) in numbers.iter().zip(&made.bodies) {
        resolved[*b] = Resolved {
            everywhere: d.resolved_gap.unwrap_or(0.0),
            regions: d.resolved_regions.clone(),
        };
    }
    Ok(Prepared {
        bodies: numbers,
        coupling: made.coupling.into(),
        faces: made.bodies.iter().map(|d| d.faces).sum(),
        fidelity,
        method,
        discretisation: made.bodies,
        resolved,
        plan: planned.plan,
        reasons: planned.reasons,
        device,
        clearance,
        warnings,
        folder: folder.map(Path::to_path_buf),
    })
}

/// The fidelity to use, and what is chosen for the scene.
fn plan(
    scene: &Scene,
    fidelity: Fidelity,
    all: &[Pose],
    clearance: &Clearance,
    problem: &Problem,
    numbers: &[usize],
) -> Result<(Fidelity, Planned)> {
    if scene.fluid.density <= 0.0 || !fidelity.kind().chooses() {
        return Ok((fidelity, Planned::default()));
    }
    let poses: Vec<Pose> = numbers.iter().map(|b| all[*b]).collect();
    let number = |b: usize| numbers.iter().position(|w| *w == b);
    let in_water = |gap: Gap| {
        let second = match gap.second {
            Other::Body(b) => Other::Body(number(b)?),
            wall => wall,
        };
        let first = number(gap.first)?;
        Some(Gap {
            first,
            second,
            ..gap
        })
    };
    let both = [&clearance.moving, &clearance.rigid].into_iter();
    let gaps = both.flat_map(|gaps| gaps.all(all).into_iter().filter_map(in_water));
    let gaps: Vec<Gap> = gaps.collect();
    let planned = fidelity.kind().plan(problem, &poses, &gaps)?;
    Ok((Fidelity::Reduced, planned))
}

/// Unit twists along world axes about each body's origin, in body frames: rotated, not shifted.
pub(crate) fn world_axes(poses: &[Pose]) -> DMatrix<f64> {
    let n = 6 * poses.len();
    let mut axes = DMatrix::zeros(n, n);
    for half in 0..2 * poses.len() {
        let axis = poses[half / 2].rotation.transpose();
        axes.fixed_view_mut::<3, 3>(3 * half, 3 * half)
            .copy_from(&axis);
    }
    axes
}
