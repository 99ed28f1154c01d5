//! Every derivative rung of both crates: found in the source, registered, right, and refused when
//! its output is 1 % wrong.
//!
//! A rung is a function named `*_jvp`, `*_vjp`, `*_hvp` (or one of these words alone), or one of
//! the few in [`scan::OTHERS`]. One that isn't in [`registered`] fails the suite. Private helpers
//! are listed with the registered rung whose check runs through them.

mod contact;
mod coupling;
mod dynamics;
mod force;
mod forward;
mod multibody;
mod policy;
mod products;
mod scan;
mod sensor;
mod shape;
mod surface;
mod tools;

use hydrograd::adjoint;
use hydrograd::adjoint::check::{Outcome, Rung};
use std::collections::BTreeSet;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::available_parallelism;

/// Every checked rung, named by its path; those of the kernels' crate begin with `adjoint`.
fn registered() -> Vec<(String, Rung)> {
    let mut out = Vec::new();
    for rung in adjoint::rungs() {
        out.push((format!("adjoint::{}", rung.name), rung));
    }
    for part in [
        multibody::rungs(),
        contact::rungs(),
        coupling::rungs(),
        dynamics::rungs(),
        force::rungs(),
        forward::rungs(),
        policy::rungs(),
        products::rungs(),
        sensor::rungs(),
        shape::rungs(),
        surface::rungs(),
    ] {
        out.extend(part.into_iter().map(|r| (r.name.to_string(), r)));
    }
    out
}

/// Rungs on a GPU, each with the shader whose comparison in tests/gpu holds it against its twin on the CPU.
const ON_DEVICE: &[(&str, &str)] = &[
    ("gpu::batch::solved::SolvedTogether::gradient", "batch_pull"),
    (
        "gpu::batch::solved::SolvedTogether::gradient_along",
        "batch_tangent",
    ),
    ("gpu::batch::solved::SolvedTogether::vjp", "batch_pull"),
    ("gpu::batch::solved::SolvedTogether::hvp", "batch_tangent"),
    ("gpu::response::Solution::gradient", "pair_vjp"),
    (
        "gpu::reduced::linearised::GpuLinearised::gradient",
        "coulomb_vjp",
    ),
    (
        "gpu::reduced::linearised::GpuLinearised::gradient_along",
        "coulomb_vjp",
    ),
    (
        "gpu::reduced::linearised::GpuLinearised::vjp",
        "coulomb_vjp",
    ),
    (
        "gpu::reduced::linearised::GpuLinearised::hvp",
        "coulomb_hvp",
    ),
    ("gpu::reduced::sums::Placed::gradient", "coulomb_vjp"),
    ("gpu::reduced::sums::Placed::potentials_jvp", "coulomb_jvp"),
    ("gpu::reduced::sums::Placed::gradient_jvp", "coulomb_hvp"),
];

/// Helpers and declarations that are checked through a registered rung: (helper, rung).
const THROUGH: &[(&str, &str)] = &[
    // What the correction of the energy consists of.
    (
        "dynamics::integrator::energy::Closure::inertia_vjp",
        "dynamics::integrator::energy::Closure::vjp",
    ),
    (
        "dynamics::balance::Evaluation::user_loads_vjp",
        "dynamics::integrator::energy::Closure::vjp",
    ),
    // Kernels behind a body's rows, and the pieces of the coupled record.
    ("boundary::mfs::assemble::BodyBoundary::jvp", FULL_HVP),
    ("boundary::mfs::assemble::BodyBoundary::vjp", FULL_VJP),
    ("boundary::mfs::assemble::BodyBoundary::hvp", FULL_HVP),
    (
        "boundary::mfs::assemble::BodyBoundary::potential_vjp",
        FULL_VJP,
    ),
    (
        "boundary::mfs::assemble::BodyBoundary::potential_hvp",
        FULL_HVP,
    ),
    ("coupling::pair::Pair::apply_jvp", FULL_HVP),
    (
        "coupling::reduced::placed::PlacedSkeletons::apply_jvp",
        "coupling::reduced::linearised::ReducedLinearised::hvp",
    ),
    ("coupling::full::cpu::system::System::respond_jvp", FULL_HVP),
    ("coupling::full::cpu::CoupledSolution::gradient", FULL_VJP),
    ("coupling::panel::first::PlacedPanels::gradient", FULL_VJP),
    // Of those that have none, and of those that hand it on.
    ("coupling::Linearised::shape_vjp", SHAPE_VJP),
    ("coupling::response::CoupledResponse::shape_vjp", SHAPE_VJP),
    (
        "coupling::panel::placed::PanelSolution::shape_vjp",
        SHAPE_VJP,
    ),
    (
        "coupling::panel::filmed::FilmedLinearised::shape_vjp",
        SHAPE_VJP,
    ),
    // What sensors see of the layers of a body.
    (
        "boundary::panel::sensed::PanelBoundary::potential_at_vjp",
        "simulate::sensor::Rollout::sensor_vjp",
    ),
    (
        "boundary::panel::sensed::PanelBoundary::velocity_vjp",
        "simulate::sensor::Rollout::sensor_vjp",
    ),
    // Pieces of the flow on surfaces, what hands it on, and what has none.
    (
        "boundary::panel::PanelBoundary::total_potential_vjp",
        "coupling::isolated::Isolated::surface_potentials_vjp",
    ),
    (
        "coupling::Coupling::surface_potentials_vjp",
        "coupling::isolated::Isolated::surface_potentials_vjp",
    ),
    (
        "coupling::panel::surface::PanelSolution::potentials_vjp",
        "coupling::panel::PanelCoupled::surface_potentials_vjp",
    ),
    (
        "coupling::panel::filmed::FilmedPanels::surface_potentials_vjp",
        "coupling::panel::PanelCoupled::surface_potentials_vjp",
    ),
    (
        "coupling::reduced::surface::ReducedLinearised::potentials_vjp",
        "coupling::reduced::linearised::Reduced::surface_potentials_vjp",
    ),
    (
        "gpu::batch::coupled::Seats::surface_potentials_vjp",
        "coupling::reduced::linearised::Reduced::surface_potentials_vjp",
    ),
    (
        "coupling::scattering::surface::Scattering::potentials_vjp",
        "coupling::scattering::linearised::Scattering::surface_potentials_vjp",
    ),
    // The sums of many bodies, in numbers and in dual numbers.
    (
        "coupling::scattering::sums::Sums::gradient",
        "coupling::scattering::linearised::ScatteredLinearised::gradient",
    ),
    (
        "coupling::scattering::scattered::Scattered::gradient",
        "coupling::scattering::linearised::ScatteredLinearised::gradient",
    ),
    (
        "coupling::scattering::scattered::Scattered::gradient_jvp",
        "coupling::scattering::linearised::ScatteredLinearised::hvp",
    ),
    (
        "gpu::reduced::GpuReduced::surface_potentials_vjp",
        "coupling::reduced::linearised::Reduced::surface_potentials_vjp",
    ),
    (
        "coupling::full::cpu::strengths::Cpu::strengths_vjp",
        "coupling::full::Full::surface_potentials_vjp",
    ),
    ("coupling::panel::placed::PanelSolution::gradient", FULL_VJP),
    (
        "adjoint::kernel::panel::Multipoles::gradient",
        "adjoint::kernel::single::single_vjp",
    ),
    (
        "adjoint::kernel::panel::Panel::gradient",
        "adjoint::kernel::double::double_vjp",
    ),
    // Each joint's maps, through those that all joints share.
    (
        "multibody::joint::planar::Planar::frame_velocity_vjp",
        FRAME_VELOCITY,
    ),
    (
        "multibody::joint::free::Free::frame_velocity_vjp",
        FRAME_VELOCITY,
    ),
    (
        "multibody::joint::planar::Planar::frame_bias_vjp",
        FRAME_BIAS,
    ),
    ("multibody::joint::free::Free::frame_bias_vjp", FRAME_BIAS),
    (
        "adjoint::contact::Slip::vjp",
        "adjoint::contact::contact_force_vjp",
    ),
    // Pieces of the equations of motion.
    (
        "dynamics::contact::PairContact::displacement_vjp",
        "dynamics::contact_force::Evaluation::contact_force_vjp",
    ),
    (
        "dynamics::damping::Evaluation::damping_vjp",
        "dynamics::contact_force::Evaluation::contact_force_vjp",
    ),
    (
        "coupling::lubrication::pull::PlacedBearing::product_vjp",
        "dynamics::force::lubrication::Lubrication::vjp",
    ),
    (
        "dynamics::integrator::contact::Problem::solve_vjp",
        "dynamics::integrator::end_contact::Adjoint::apply_vjp",
    ),
    (
        "dynamics::integrator::contact::Problem::solve_pushed_vjp",
        "dynamics::integrator::end_contact::Adjoint::apply_vjp",
    ),
    (
        "dynamics::integrator::contact::Problem::pressed_vjp",
        "dynamics::integrator::end_contact::Adjoint::apply_vjp",
    ),
    (
        "dynamics::resistance::Evaluation::resistance_vjp",
        "dynamics::integrator::reaction::Reaction::force_vjp",
    ),
    (
        "dynamics::integrator::reaction::Resisted::force_vjp",
        "dynamics::integrator::reaction::Reaction::force_vjp",
    ),
    (
        "dynamics::integrator::hold::Hold::impulse_vjp",
        "dynamics::integrator::end_contact::Adjoint::apply_vjp",
    ),
    (
        "dynamics::integrator::motion_push::MotionPush::push_vjp",
        "dynamics::integrator::end_contact::Adjoint::apply_vjp",
    ),
    (
        "dynamics::motion_force::Linearisation::motion_force_vjp",
        "dynamics::integrator::end_contact::Adjoint::apply_vjp",
    ),
    (
        "dynamics::late::Evaluation::late_force_vjp",
        "dynamics::integrator::midpoint::Adjoint::vjp",
    ),
    (
        "dynamics::late::Evaluation::late_loads_vjp",
        "dynamics::integrator::midpoint::Adjoint::vjp",
    ),
    (
        "dynamics::balance::Evaluation::loads_vjp",
        "dynamics::balance::Linearisation::force_vjp",
    ),
    // Forces that don't depend on the velocity: nothing that 1 % could be wrong with.
    ("dynamics::force::ForceModel::jvp", FORCE_JVP),
    (
        "dynamics::balance::rigid_parameters_vjp",
        "dynamics::momentum::Linearisation::momentum_vjp",
    ),
    (
        "dynamics::balance::Evaluation::frame_velocity_vjp",
        "dynamics::integrator::readout::Stepper::conserved_vjp",
    ),
    (
        "dynamics::momentum::Linearisation::bilinear_vjp",
        "dynamics::momentum::Linearisation::momentum_vjp",
    ),
    (
        "dynamics::acceleration::Linearisation::fluid_inertial_vjp",
        "dynamics::acceleration::Linearisation::inertial_force_vjp",
    ),
    (
        "dynamics::balance_recoil::Linearisation::force_readout_vjp",
        "dynamics::integrator::readout::force_vjp",
    ),
    // Pieces of the integrators.
    (
        "dynamics::integrator::readout::solve_vjp",
        "dynamics::integrator::readout::Stepper::velocity_vjp",
    ),
    (
        "dynamics::integrator::start::Start::advance_vjp",
        "dynamics::integrator::euler::Adjoint::vjp",
    ),
    (
        "dynamics::integrator::start::Start::arrive_vjp",
        "dynamics::integrator::euler::Adjoint::vjp",
    ),
    (
        "dynamics::integrator::record::Part::vjp",
        "dynamics::integrator::euler::Adjoint::vjp",
    ),
    (
        "dynamics::integrator::record::LinearisedStep::vjp",
        "dynamics::integrator::euler::Adjoint::vjp",
    ),
    (
        "dynamics::integrator::record::LinearisedStep::state_vjp",
        "dynamics::integrator::euler::Adjoint::vjp",
    ),
    // And of their tangents.
    (
        "dynamics::integrator::readout::solve_jvp",
        "dynamics::integrator::readout::Stepper::velocity_jvp",
    ),
    (
        "dynamics::integrator::start::Start::advance_jvp",
        "dynamics::integrator::euler::Adjoint::jvp",
    ),
    // Whole solutions against sweeps and Riccati's, in tests/dynamics/control.
    (
        "optimize::ilqr::backward::gradient",
        "simulate::rollout::Rollout::vjp",
    ),
    (
        "optimize::ilqr::tracking::Tracking::act_vjp",
        "simulate::rollout::Rollout::vjp",
    ),
    // The steps of a trajectory, handed on.
    (
        "simulate::deciding::Deciding::step_vjp",
        "simulate::rollout::Rollout::vjp",
    ),
    (
        "simulate::deciding::Deciding::last_vjp",
        "simulate::rollout::Rollout::vjp",
    ),
    (
        "dynamics::armature::Armature::add_vjp",
        "dynamics::momentum::Linearisation::mass_vjp",
    ),
    (
        "dynamics::inertia::Inertia::solve_vjp",
        "dynamics::integrator::readout::Stepper::velocity_vjp",
    ),
    (
        "dynamics::integrator::start::Start::arrive_jvp",
        "dynamics::integrator::euler::Adjoint::jvp",
    ),
    (
        "dynamics::integrator::stage_adjoint::AdjointStage::solve_jvp",
        "dynamics::integrator::euler::Adjoint::jvp",
    ),
    (
        "dynamics::integrator::stage_adjoint::AdjointStage::rates_vjp",
        "dynamics::integrator::euler::Adjoint::vjp",
    ),
    (
        "dynamics::integrator::contact::Problem::solve_jvp",
        "dynamics::integrator::end_contact::Adjoint::apply_jvp",
    ),
    (
        "dynamics::resistance::Evaluation::resistance_jvp",
        "dynamics::integrator::reaction::Reaction::force_jvp",
    ),
    (
        "dynamics::integrator::hold::Hold::impulse_jvp",
        "dynamics::integrator::end_contact::Adjoint::apply_jvp",
    ),
    (
        "dynamics::integrator::motion_push::MotionPush::push_jvp",
        "dynamics::integrator::end_contact::Adjoint::apply_jvp",
    ),
    (
        "dynamics::integrator::contact::Problem::solve_pushed_jvp",
        "dynamics::integrator::end_contact::Adjoint::apply_jvp",
    ),
    (
        "dynamics::integrator::contact::Problem::pressed_jvp",
        "dynamics::integrator::end_contact::Adjoint::apply_jvp",
    ),
    (
        "dynamics::integrator::record::Part::jvp",
        "dynamics::integrator::euler::Adjoint::jvp",
    ),
    (
        "dynamics::integrator::record::Part::velocity_jvp",
        "dynamics::integrator::readout::Stepper::velocity_jvp",
    ),
    (
        "dynamics::integrator::record::LinearisedStep::jvp",
        "dynamics::integrator::euler::Adjoint::jvp",
    ),
    (
        "dynamics::integrator::record::LinearisedStep::velocity_jvp",
        "dynamics::integrator::readout::Stepper::velocity_jvp",
    ),
    (
        "simulate::observable::joint::Coordinates::jvp",
        "simulate::tangents::Rollout::jvp",
    ),
    (
        "simulate::observable::joint::Velocities::jvp",
        "simulate::tangents::Rollout::jvp",
    ),
    // Observables that any rollout's seeds begin with.
    (
        "simulate::observable::joint::Coordinates::vjp",
        "simulate::rollout::Rollout::vjp",
    ),
    (
        "simulate::observable::joint::Velocities::vjp",
        "simulate::rollout::Rollout::vjp",
    ),
    (
        "simulate::observable::pose::Positions::vjp",
        "simulate::rollout::Rollout::vjp",
    ),
    (
        "simulate::observable::pose::Rotations::vjp",
        "simulate::rollout::Rollout::vjp",
    ),
    (
        "simulate::trajectory::observables_vjp",
        "simulate::rollout::Rollout::vjp",
    ),
    // Whole rollouts: every integrator, both fidelities, in tests/rollout_gradient.rs as well.
    (
        "simulate::trajectory::Trajectory::observe_vjp",
        "simulate::rollout::Rollout::vjp",
    ),
    (
        "simulate::trajectory::Trajectory::step_vjp",
        "simulate::rollout::Rollout::vjp",
    ),
    (
        "simulate::trajectory::Trajectory::last_vjp",
        "simulate::rollout::Rollout::vjp",
    ),
    (
        "simulate::trajectory::Trajectory::seed_vjp",
        "simulate::rollout::Rollout::vjp",
    ),
    (
        "simulate::trajectory::ControlledStep::vjp",
        "simulate::rollout::Rollout::vjp",
    ),
    (
        "simulate::record::Record::vjp",
        "simulate::rollout::Rollout::vjp",
    ),
    ("adjoint::step::reverse", "simulate::rollout::Rollout::vjp"),
    (
        "coupling::film::pull::Layer::reverse",
        "coupling::reduced::linearised::ReducedLinearised::gradient",
    ),
    (
        "simulate::objective::Rollout::gradient",
        "simulate::rollout::Rollout::vjp",
    ),
];

/// What hands over a derivative that its caller gave.
const PASSED_ON: &[&str] = &["optimize::descent::Shared::gradient"];

const FRAME_VELOCITY: &str = "multibody::joint::JointMotion::frame_velocity_vjp";
const FRAME_BIAS: &str = "multibody::joint::JointMotion::frame_bias_vjp";
const FORCE_JVP: &str = "dynamics::balance::Linearisation::force_jvp";
const SHAPE_VJP: &str = "coupling::response::ResponseLinearised::shape_vjp";
const FULL_VJP: &str = "coupling::response::ResponseLinearised::vjp";
const FULL_HVP: &str = "coupling::response::ResponseLinearised::hvp";

#[test]
fn every_rung_in_the_source_is_registered() {
    let mut found = scan::rungs("adjoint/src", "adjoint::");
    found.extend(scan::rungs("src", ""));
    assert!(found.len() > 50, "only {} rungs found", found.len());
    let registered: BTreeSet<String> = registered().into_iter().map(|(name, _)| name).collect();
    let through = THROUGH.iter().map(|(helper, _)| *helper);
    let helpers: BTreeSet<&str> = through
        .chain(ON_DEVICE.iter().map(|(rung, _)| *rung))
        .chain(PASSED_ON.iter().copied())
        .collect();
    let missing: Vec<_> = found
        .iter()
        .filter(|name| !registered.contains(*name) && !helpers.contains(name.as_str()))
        .collect();
    assert!(missing.is_empty(), "rungs without a check: {missing:#?}");
    let stale: Vec<_> = registered
        .iter()
        .map(String::as_str)
        .chain(helpers.iter().copied())
        .filter(|name| !found.contains(*name))
        .collect();
    assert!(
        stale.is_empty(),
        "registered, but not in the source: {stale:#?}"
    );
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let compared = std::fs::read_to_string(folder.join("tests/gpu/main.rs")).unwrap();
    for (rung, shader) in ON_DEVICE {
        assert!(
            compared.contains(&format!("\"{shader}\" =>")),
            "{rung}: nothing compares {shader}"
        );
    }
    for (helper, rung) in THROUGH {
        assert!(
            registered.contains(*rung),
            "{helper} is checked through {rung}, which isn't"
        );
    }
}

/// A rung with the outcome of its check, right and 1 % wrong, and what it drew.
struct Checked {
    name: String,
    right: Outcome,
    corrupted: Outcome,
    drawn: Vec<Vec<f64>>,
}

impl Checked {
    fn of(name: &str, rung: &Rung) -> Self {
        let [(right, drawn), (corrupted, _)] = tools::both(rung.check, 1.01);
        Self {
            name: name.into(),
            right,
            corrupted,
            drawn,
        }
    }
}

/// Threads of their own take the rungs in turn: what a check draws is kept by thread, and tasks of a pool may do another's work while they wait.
static CHECKED: LazyLock<Vec<Checked>> = LazyLock::new(|| {
    let rungs = registered();
    let (next, threads) = (AtomicUsize::new(0), available_parallelism());
    let work = || {
        let turns = std::iter::repeat_with(|| next.fetch_add(1, Ordering::Relaxed));
        let mine = turns.map_while(|k| Some((k, rungs.get(k)?)));
        mine.map(|(k, (name, rung))| (k, Checked::of(name, rung)))
            .collect::<Vec<_>>()
    };
    let mut all = std::thread::scope(|scope| {
        let threads = (0..threads.map_or(1, usize::from)).map(|_| scope.spawn(work));
        let threads = threads.collect::<Vec<_>>().into_iter();
        threads
            .flat_map(|thread| thread.join().expect("a check panicked"))
            .collect::<Vec<_>>()
    });
    all.sort_by_key(|(k, _)| *k);
    all.into_iter().map(|(_, checked)| checked).collect()
});

#[test]
fn every_rung_is_right_and_fails_when_corrupted() {
    let mut wrong = Vec::new();
    for Checked {
        name,
        right,
        corrupted,
        ..
    } in CHECKED.iter()
    {
        println!("{:.1e} {:5.2} {name}", right.rel_error, right.order);
        if !right.passes() || right.tolerance > 1e-6 {
            wrong.push(format!("{name}: {right:?}"));
        }
        if corrupted.passes() {
            wrong.push(format!("{name} passes 1 % wrong: {corrupted:?}"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Least ratio of the smallest singular value of a check's vectors to the largest.
const SPANNED: f64 = 0.15;

/// A check along vectors in one plane doesn't see the component of a derivative across it. The rungs of `adjoint` are
/// held to this by a test of their own.
#[test]
fn vectors_of_every_check_span_space() {
    let mut flat = Vec::new();
    for Checked { name, drawn, .. } in CHECKED.iter() {
        // Arrays of vectors, each of unit size.
        let vectors: Vec<[f64; 3]> = drawn
            .iter()
            .filter(|d| d.len() % 3 == 0)
            .flat_map(|d| {
                let size = adjoint::check::norm(d);
                d.chunks(3).map(move |v| [0, 1, 2].map(|c| v[c] / size))
            })
            .collect();
        // A policy without actions has no derivative.
        if vectors.is_empty() || name == "policy::OpenLoop::act_vjp" {
            continue;
        }
        let span = adjoint::sample::span(vectors.iter().copied());
        println!("{span:.2} {:4} {name}", vectors.len());
        if span < SPANNED {
            flat.push(name.clone());
        }
    }
    assert!(flat.is_empty(), "{flat:#?}");
}
