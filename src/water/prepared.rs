//! The water of a scene, ready to be evaluated.

use super::backend::Backend;
use super::choices::WaterChoices;
use super::clearance::Clearance;
use super::device::Device;
use super::fidelity::kind::{Planned, StartGap};
use super::fidelity::{self, Fidelity};
use super::gap_model::GapModel;
use super::method::kind::{BodyMethod, Problem};
use super::numerics::Plan;
use super::products::by_products;
use super::resolved::Resolved;
use super::shape::ShapeChange;
use super::submerged::{Discretisation, SubmergedBody};
use crate::adjoint::lie::{Mat6, Pose};
use crate::coupling::Coupling;
use crate::coupling::reduced::compress::CompressSettings;
use crate::geometry::{Gap, Gaps, Other};
use crate::scene::Scene;
use crate::{Error, Result};
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
    /// What estimates of the error across gaps need, with what each body resolves.
    pub gap_model: GapModel,
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

/// What the flow that compression leaves out is worth in the added mass.
const LEFT_OUT: f64 = 0.012;

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
    changes: &[ShapeChange],
    folder: Option<&Path>,
) -> Result<Prepared> {
    let method = choices.method_used().kind();
    let mut problem = Problem::new(scene, &numbers, &submerged, method, &choices.numerics);
    let number = |b: usize| numbers.iter().position(|w| *w == b);
    let changes = changes.iter().filter_map(|c| Some((number(c.body)?, c)));
    let changes: Vec<_> = changes.collect();
    problem.changes = &changes;
    let start: Vec<Pose> = numbers.iter().map(|b| poses[*b]).collect();
    problem.start = &start;
    let compressed = scene.fluid.density > 0.0 && choices.fidelity.kind().compresses();
    problem.products = compressed && by_products(choices.numerics.exchange, &problem)?;
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
        (false, false) => method.resolved_edges(choices.numerics.films),
    };
    let touching = fidelity.kind().solves_alone() || method.may_touch();
    clearance.may_touch = touching || scene.fluid.density <= 0.0;
    for gaps in [&clearance.moving, &clearance.rigid] {
        clearance.refuse_touch(gaps.smallest(poses).as_ref())?;
    }
    clearance.refuse_film(poses)?;
    let mut warnings = choices.without_effect(folder.is_some());
    let idle = fidelity.kind().idle_gpu();
    let mut device = Device::open(choices.backend, &choices.gpu, idle)?;
    let on_device = device.report().backend_used == Backend::Gpu;
    if !changes.is_empty() && on_device && fidelity.kind().coupled() {
        return Err(Error::Unsupported {
            what: format!("{} shape parameters on the backend gpu", changes.len()),
            why: "the coupling there has no derivatives with respect to shapes".into(),
            instead: "use the backend cpu".into(),
        });
    }
    let made = fidelity.couple(&problem, &mut device)?;
    warnings.extend(device.reason.clone());
    warnings.extend(made.warnings);
    let shapes = made.coupling.shape_parameters();
    if shapes != changes.len() {
        return Err(Error::Unsupported {
            what: format!(
                "{} shape parameters with {}",
                changes.len(),
                made.coupling.name()
            ),
            why: format!("it has derivatives with respect to {shapes} of them"),
            instead: "use the fidelity isolated, reduced, or full by panels on the backend cpu"
                .into(),
        });
    }
    let mut resolved = vec![Resolved::default(); scene.bodies.len()];
    for (b, d) in numbers.iter().zip(&made.bodies) {
        resolved[*b] = Resolved {
            everywhere: d.resolved_gap.unwrap_or(0.0),
            regions: d.resolved_regions.clone(),
        };
    }
    let (mut tolerances, mut own) = (vec![0.0; scene.bodies.len()], vec![0.0; scene.bodies.len()]);
    for (k, (b, d)) in numbers.iter().zip(&made.bodies).enumerate() {
        own[*b] = d.added_mass_error.unwrap_or(0.0);
        if fidelity.kind().compresses() {
            tolerances[*b] = tolerance(problem.chosen(k), d);
        }
    }
    let gap_model = GapModel {
        carried: made.carried.filter(|_| scene.fluid.density > 0.0),
        tolerances,
        own,
        films: made.films,
        in_water: numbers.clone(),
        resolved,
    };
    let mut reasons = planned.reasons;
    if problem.products {
        reasons.push(format!(
            "{} bodies are coupled by products alone (setting exchange)",
            numbers.len()
        ));
    }
    if choices.fidelity.kind().chooses()
        && let Some(gap) = clearance.moving.smallest(poses)
        && let Some(error) = gap_model.error(&clearance, &gap, poses)
        && error.force > choices.numerics.accuracy
    {
        reasons.push(clearance.aimed(&gap, error, choices.numerics.accuracy));
    }
    Ok(Prepared {
        bodies: numbers,
        coupling: made.coupling.into(),
        faces: made.bodies.iter().map(|d| d.faces).sum(),
        fidelity,
        method,
        discretisation: made.bodies,
        gap_model,
        plan: planned.plan,
        reasons,
        device,
        clearance,
        warnings,
        folder: folder.map(Path::to_path_buf),
    })
}

/// The own added mass of each body in the water, by its number in the scene: at unit density, body's frame, about its origin.
///
/// # Errors
/// Bodies that the method can't take, or whatever the discretisation reports.
pub(crate) fn own_added_mass(
    scene: &Scene,
    choices: &WaterChoices,
    (numbers, submerged): &(Vec<usize>, Vec<SubmergedBody>),
) -> Result<Vec<(usize, Mat6)>> {
    let method = choices.method_used().kind();
    let problem = Problem::new(scene, numbers, submerged, method, &choices.numerics);
    let made = fidelity::own_added_mass(&problem)?;
    Ok(numbers.iter().copied().zip(made).collect())
}

/// The error of compression: what was aimed at, or by what is left where the number of points was given.
fn tolerance(chosen: &CompressSettings, made: &Discretisation) -> f64 {
    match chosen.rank {
        Some(_) => (made.scattered_error * LEFT_OUT).max(chosen.tolerance.min(LEFT_OUT)),
        None => chosen.tolerance,
    }
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
    let start = |gaps: &Gaps, gap: Gap| {
        let second = match gap.second {
            Other::Body(b) => Other::Body(number(b)?),
            wall => wall,
        };
        let first = number(gap.first)?;
        Some(StartGap {
            film: clearance.film(gaps, &gap, all).1,
            gap: Gap {
                first,
                second,
                ..gap
            },
        })
    };
    let start = &start;
    let within = |distance: f64| {
        let both = [&clearance.moving, &clearance.rigid].into_iter();
        let gaps = both.flat_map(|gaps| {
            let near = gaps.within(all, distance).into_iter();
            near.filter_map(move |gap| start(gaps, gap))
        });
        gaps.collect::<Vec<StartGap>>()
    };
    let planned = fidelity.kind().plan(problem, &poses, &within)?;
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
