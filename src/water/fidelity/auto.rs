//! What the fidelity `Auto` chooses for a scene.
//!
//! Two bodies a distance c apart feel each other as dipoles: relative to their own added mass the
//! coupling is at most `2 D₁ D₂ / 4πc³` with `D = (V + M)/√M` per unit velocity, V the displaced
//! volume and M the own added mass at unit density (3(a/c)³ for equal spheres of radius a); where another own one Â is given, `D = (V + M)/√Â`. A pair whose
//! coupling is below the aim fades out. Dipoles are what bodies look like from afar: c is counted from the surfaces, of the balls around the bodies, for a pebble in
//! contact with the corner of a slab is far from its middle. What a body must resolve follows from the smallest gap that it
//! starts with.

use super::given::LEAST;
use super::kind::{FidelityKind, GapsWithin, Knob, Planned, StartGap};
use super::reduced::Reduced;
use crate::adjoint::lie::{Mat6, Pose, Vec3};
use crate::boundary::exact::lamb;
use crate::coupling::reduced::{Cutoff, compress};
use crate::geometry::{Gap, MassProperties, TriMesh};
use crate::water::device::Device;
use crate::water::method::kind::Problem;
use crate::water::numerics::Numerics;
use crate::water::submerged::Made;
use crate::{Error, Result};
use std::f64::consts::PI;

/// Of the aim, what compression may add to the error of the bodies themselves at the smallest gap that it resolves.
const COMPRESSION: f64 = 0.5;
/// What each pair left out may.
const SHARE: f64 = 1.0 / 3.0;
/// What the coupling of real bodies may be above that of their equivalent ellipsoids' dipoles.
const SAFETY: f64 = 1.5;
/// Where a pair begins to fade, of the distance between surfaces where it is gone.
const NEAR: f64 = 0.8;
/// What is resolved, of the smallest gap at the start: bodies may come nearer.
const ROOM: f64 = 0.6;
/// The same where the water between flat parts has so much of the energy: there what compression leaves out weighs more.
const ROOM_FLAT: f64 = 0.3;
const FLAT: f64 = 0.05;
/// Bodies that start apart may come near: they resolve this many times the gap that they would without a plan.
const COARSEST: f64 = 2.0;
/// Under this many times the finest gap (less than the coarsest over the least room) bodies are compressed no worse than `Reduced` does by default.
const CLOSE: f64 = 6.0;
/// `reduced`, with what each body and pair needs.
pub(super) struct Auto;

impl FidelityKind for Auto {
    fn knobs(&self) -> &'static [Knob] {
        &[Knob::Accuracy, Knob::Films]
    }

    fn chooses(&self) -> bool {
        true
    }

    fn aim(&self, numerics: &Numerics) -> Option<f64> {
        Some(numerics.accuracy)
    }

    fn compresses(&self) -> bool {
        true
    }

    fn plan(&self, problem: &Problem, poses: &[Pose], within: &GapsWithin) -> Result<Planned> {
        plan(problem, poses, within)
    }

    // A fidelity that chooses is in use itself only without water.
    fn couple(&self, problem: &Problem, device: &mut Device) -> Result<Made> {
        Reduced.couple(problem, device)
    }

    fn resolved_gap(&self, compressed: f64, edge: f64) -> f64 {
        Reduced.resolved_gap(compressed, edge)
    }

    fn gap_warning(
        &self,
        gap: &Gap,
        edges: f64,
        place: &str,
        time: &str,
        hint: &str,
    ) -> Option<String> {
        Reduced.gap_warning(gap, edges, place, time, hint)
    }

    fn error(&self, bodies: f64, residual: Option<f64>, coupling: Option<f64>) -> Option<f64> {
        Reduced.error(bodies, residual, coupling)
    }
}

/// Chooses for the bodies at the start, for an error of the coupling of the accuracy that is aimed at.
fn plan(problem: &Problem, poses: &[Pose], within: &GapsWithin) -> Result<Planned> {
    let (bodies, walls, aim) = (problem.bodies, problem.walls, problem.numerics.accuracy);
    if !(aim > 0.0 && aim < 1.0) {
        return Err(Error::input(
            "settings: accuracy",
            aim,
            "a number between 0 and 1, such as 0.01",
        ));
    }
    // Gaps so wide that none is resolved finer for them aren't looked at.
    let coarsest = bodies.iter().map(|body| body.mesh.map_or(0.0, coarsest));
    let coarsest: Vec<f64> = coarsest.collect();
    let gaps = within(coarsest.iter().copied().fold(0.0, f64::max) / ROOM_FLAT);
    let mut near: Vec<Vec<&StartGap>> = bodies.iter().map(|_| Vec::new()).collect();
    for start in &gaps {
        for (b, _) in start.gap.sides() {
            near[b].push(start);
        }
    }
    let mut out = Planned::default();
    let mut seen = Vec::with_capacity(bodies.len());
    for (b, body) in bodies.iter().enumerate() {
        let Some(mesh) = body.mesh else {
            return Err(Error::Unsupported {
                what: format!("coupling of body {:?}", body.name),
                why: "it has a given added mass but no shape".into(),
                instead: "give it a shape, or use the fidelity isolated".into(),
            });
        };
        let properties = mesh.mass_properties();
        let ball = mesh.bounding_ball();
        seen.push(Seen {
            strength: strength(&properties, body.added_mass.as_ref())?,
            centre: poses[b].apply(&ball.center),
            radius: ball.radius,
        });
        let distances = near[b].iter().map(|start| start.gap.image_distance());
        let smallest = distances.fold(f64::INFINITY, f64::min);
        let (finest, coarsest) = (compress::finest_gap(mesh.surface_area()), coarsest[b]);
        let flat = |start: &&StartGap| {
            start.film > FLAT && ROOM_FLAT * start.gap.image_distance() < coarsest
        };
        let room = match near[b].iter().any(flat) {
            true => ROOM_FLAT,
            false => ROOM,
        };
        let gap = (room * smallest).clamp(finest, coarsest);
        // What compression leaves out is worth more the nearer the gap, in the force above all.
        let tolerance = match smallest < CLOSE * finest {
            true => (COMPRESSION * aim).min(compress::CompressSettings::default().tolerance),
            false => COMPRESSION * aim,
        };
        out.plan.compress.push(compress::CompressSettings {
            rank: None,
            tolerance,
            resolved_gap: Some(gap),
        });
    }
    for (b, body) in bodies.iter().enumerate() {
        let gap = out.plan.compress[b].resolved_gap.unwrap_or_default();
        out.reasons.push(format!(
            "body {:?} resolves gaps from {gap:.3e} m on (half that to a wall)",
            body.name
        ));
        // Pairs far apart are no work of their own there.
        let pairs = if problem.products { 0 } else { b + 1 };
        for (a, other) in bodies.iter().enumerate().take(pairs) {
            if a == b && walls.is_empty() {
                continue;
            }
            let (first, second) = (&seen[a], &seen[b]);
            let cutoff = first.cutoff(second, aim);
            out.plan.cutoffs.push(((a, b), cutoff));
            let c = (first.centre - second.centre).norm();
            if a != b && c > cutoff.near {
                out.reasons.push(format!(
                    "bodies {:?} and {:?} start with their middles {c:.3e} m apart: coupled in full up to {:.3e} m, \
                     not at all from {:.3e} m on",
                    other.name, body.name, cutoff.near, cutoff.far
                ));
            }
        }
    }
    Ok(out)
}

/// A body as others see it from afar.
struct Seen {
    /// D, m^3/2.
    strength: f64,
    /// Middle of the ball around it in the world, and its radius, m.
    centre: Vec3,
    radius: f64,
}

impl Seen {
    /// Where two bodies, or a body and its image, fade out for each other at an accuracy: distances of their middles.
    fn cutoff(&self, other: &Self, aim: f64) -> Cutoff {
        let dipoles = SAFETY * 2.0 * self.strength * other.strength;
        let far = (dipoles / (4.0 * PI * SHARE * aim)).cbrt();
        let touch = self.radius + other.radius;
        Cutoff {
            near: touch + NEAR * far,
            far: touch + far,
        }
    }
}

/// The gap that a body resolves to which nothing is near, m.
fn coarsest(mesh: &TriMesh) -> f64 {
    let volume = mesh.mass_properties().volume;
    COARSEST * compress::default_gap(volume, mesh.surface_area())
}

/// Largest `(V + M)/√M` over the axes of the ellipsoid with the same volume and inertia; `(V + M)/√Â` where Â is given.
fn strength(p: &MassProperties, given: Option<&Mat6>) -> Result<f64> {
    let principal = p.inertia.symmetric_eigen();
    let moments: Vec3 = principal.eigenvalues;
    let trace: f64 = moments.sum();
    // I_i = V (a_j² + a_k²)/5
    let axes: [f64; 3] = std::array::from_fn(|i| {
        let square = 2.5 * (trace - 2.0 * moments[i]) / p.volume;
        square.max(1e-6 * trace / p.volume).sqrt()
    });
    let m = lamb::added_mass(axes)?;
    let own = |i: usize| match given {
        Some(given) => {
            let axis = principal.eigenvectors.column(i);
            let along = axis.dot(&(given.fixed_view::<3, 3>(0, 0) * axis));
            along.max(LEAST * p.volume)
        }
        None => m[(i, i)],
    };
    let of = |i: usize| (p.volume + m[(i, i)]) / own(i).sqrt();
    Ok((0..3).map(of).fold(0.0, f64::max))
}
