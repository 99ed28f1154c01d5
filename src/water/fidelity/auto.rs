//! What the fidelity `Auto` chooses for a scene.
//!
//! Two bodies a distance c apart feel each other as dipoles: relative to their own added mass the
//! coupling is at most `2 D₁ D₂ / 4πc³` with `D = (V + M)/√M` per unit velocity, V the displaced
//! volume and M the own added mass at unit density (3(a/c)³ for equal spheres of radius a). A pair whose
//! coupling is below the aim fades out. What a body must resolve follows from the smallest gap that it
//! starts with.

use super::full::Full;
use super::kind::{FILM, FidelityKind, Knob, Planned, StartGap};
use super::reduced::Reduced;
use crate::adjoint::lie::{Pose, Vec3};
use crate::boundary::exact::lamb;
use crate::coupling::reduced::{Cutoff, compress};
use crate::geometry::{Gap, MassProperties, Other, WallSurface};
use crate::water::device::Device;
use crate::water::method::kind::Problem;
use crate::water::numerics::{Numerics, Plan};
use crate::water::submerged::{Made, SubmergedBody};
use crate::{Error, Result};
use std::f64::consts::PI;

/// Of the aim, what compression may add to the error of the bodies themselves at the smallest gap that it resolves.
const COMPRESSION: f64 = 0.5;
/// What each pair left out may.
const SHARE: f64 = 1.0 / 3.0;
/// What the coupling of real bodies may be above that of their equivalent ellipsoids' dipoles.
const SAFETY: f64 = 1.5;
/// Where a pair begins to fade, of the distance where it is gone.
const NEAR: f64 = 0.8;
/// What is resolved, of the smallest gap at the start: bodies may come nearer. Where a film holds the energy ([`FILM`]), and none is computed, what
/// compression leaves out weighs more.
const ROOM: f64 = 0.6;
const ROOM_FILM: f64 = 0.3;
/// Bodies that start apart may come near: they resolve this many times the gap that they would without a plan.
const COARSEST: f64 = 2.0;
/// Without films, gaps under this part of the finest that compression resolves are left to the fidelity `Full`, whose forces are nearer there at all gaps and
/// shapes that were measured (docs/accuracy-coupled.md).
const HOPELESS: f64 = 0.5;
/// The same where the film in a gap has more than an energy (that of [`StartGap::film`]): between flat parts, and such as are nearly so.
const HOPELESS_FILM: [(f64, f64); 2] = [(FILM, 2.0), (0.01, 1.0)];
/// Faces with edges longer than this part of the radius of the smaller body at a gap don't see its flow.
const COARSE: f64 = 0.5;
/// Under this many times the finest gap bodies are compressed no worse than `Reduced` does by default.
const CLOSE: f64 = 6.0;
/// Under this part of the finest gap compressed sources may refuse: `Full` answers, and warns.
const REFUSED: f64 = 0.1;

/// `reduced`, or `full` where gaps are too small for that, with what each body and pair needs.
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

    fn plan(&self, problem: &Problem, poses: &[Pose], gaps: &[StartGap]) -> Result<Planned> {
        plan(problem, poses, gaps)
    }

    // A fidelity that chooses is in use itself only without water.
    fn couple(&self, problem: &Problem, device: &mut Device) -> Result<Made> {
        Reduced.couple(problem, device)
    }

    fn resolved_gap(&self, compressed: f64, edge: f64) -> f64 {
        Full.resolved_gap(compressed, edge)
    }

    fn gap_warning(
        &self,
        gap: &Gap,
        edges: f64,
        place: &str,
        time: &str,
        hint: &str,
    ) -> Option<String> {
        Full.gap_warning(gap, edges, place, time, hint)
    }

    fn error(&self, bodies: f64, residual: Option<f64>, coupling: Option<f64>) -> Option<f64> {
        Reduced.error(bodies, residual, coupling)
    }
}

/// Chooses for the bodies at the start, for an error of the coupling of the accuracy that is aimed at.
fn plan(problem: &Problem, poses: &[Pose], gaps: &[StartGap]) -> Result<Planned> {
    let (bodies, walls, aim) = (problem.bodies, problem.walls, problem.numerics.accuracy);
    if !(aim > 0.0 && aim < 1.0) {
        return Err(Error::input(
            "settings: accuracy",
            aim,
            "a number between 0 and 1, such as 0.01",
        ));
    }
    let mut out = Planned::default();
    let mut strengths = Vec::with_capacity(bodies.len());
    for (b, body) in bodies.iter().enumerate() {
        let Some(mesh) = body.mesh else {
            return Err(Error::Unsupported {
                what: format!("coupling of body {:?}", body.name),
                why: "it has a given added mass but no shape".into(),
                instead: "give it a shape, or use the fidelity isolated".into(),
            });
        };
        let properties = mesh.mass_properties();
        strengths.push((
            strength(&properties)?,
            poses[b].apply(&mesh.bounding_ball().center),
        ));
        let near = || gaps.iter().filter(|g| g.gap.touches(b));
        let nearest = (near().map(|g| &g.gap))
            .min_by(|a, b| a.image_distance().total_cmp(&b.image_distance()));
        let (smallest, edge) =
            nearest.map_or((f64::INFINITY, 0.0), |g| (g.image_distance(), g.edge));
        let finest = compress::finest_gap(mesh.surface_area());
        // Who refines a body means its gaps to be resolved there.
        let refined = body.regions.iter().map(|r| r.gap).fold(finest, f64::min);
        let hopeless = !problem.numerics.films
            && near().any(|g| {
                let film = HOPELESS_FILM.iter().find(|(film, _)| g.film > *film);
                let part = film.map_or(HOPELESS, |(_, part)| *part);
                g.gap.image_distance() < part * refined
            });
        let rigid = walls.iter().all(|w| w.surface == WallSurface::Rigid);
        if hopeless && rigid {
            let coarse = nearest.is_some_and(|g| edge > COARSE * smaller(bodies, g));
            let full = !coarse || smallest < REFUSED * finest;
            let so = if full {
                out.together = true;
                "all bodies are solved together (full)"
            } else {
                "neither does full with such edges; use more faces and full for accurate forces there"
            };
            out.reasons.push(format!(
                "body {:?} starts {smallest:.3e} m from a neighbour (or its own mirror image) at edges of \
                 {edge:.3e} m; its compressed sources resolve {finest:.3e} m at best: {so}",
                body.name
            ));
        }
        let coarsest = COARSEST * compress::default_gap(properties.volume, mesh.surface_area());
        let room = match !problem.numerics.films && near().any(|g| g.film > FILM) {
            true => ROOM_FILM,
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
    if out.together {
        out.plan = Plan::default();
        return Ok(out);
    }
    for (b, body) in bodies.iter().enumerate() {
        let gap = out.plan.compress[b].resolved_gap.unwrap_or_default();
        out.reasons.push(format!(
            "body {:?} resolves gaps from {gap:.3e} m on (half that to a wall)",
            body.name
        ));
        for (a, other) in bodies.iter().enumerate().take(b + 1) {
            if a == b && walls.is_empty() {
                continue;
            }
            let far =
                (SAFETY * 2.0 * strengths[a].0 * strengths[b].0 / (4.0 * PI * SHARE * aim)).cbrt();
            let cutoff = Cutoff {
                near: NEAR * far,
                far,
            };
            out.plan.cutoffs.push(((a, b), cutoff));
            let c = (strengths[a].1 - strengths[b].1).norm();
            if a != b && c > cutoff.near {
                out.reasons.push(format!(
                    "bodies {:?} and {:?} start {c:.3e} m apart: coupled in full up to {:.3e} m, not \
                     at all from {far:.3e} m on",
                    other.name, body.name, cutoff.near
                ));
            }
        }
    }
    Ok(out)
}

/// Radius of the ball around the smaller of the bodies at a gap, m.
fn smaller(bodies: &[SubmergedBody], gap: &Gap) -> f64 {
    let radius = |b: usize| {
        bodies[b]
            .mesh
            .map_or(f64::INFINITY, |m| m.bounding_ball().radius)
    };
    match gap.second {
        Other::Body(b) => radius(gap.first).min(radius(b)),
        Other::Wall(_) => radius(gap.first),
    }
}

/// Largest `(V + M)/√M` over the axes of the ellipsoid with the same volume and inertia.
fn strength(p: &MassProperties) -> Result<f64> {
    let moments: Vec3 = p.inertia.symmetric_eigenvalues();
    let trace: f64 = moments.sum();
    // I_i = V (a_j² + a_k²)/5
    let axes: [f64; 3] = std::array::from_fn(|i| {
        let square = 2.5 * (trace - 2.0 * moments[i]) / p.volume;
        square.max(1e-6 * trace / p.volume).sqrt()
    });
    let m = lamb::added_mass(axes)?;
    let of = |i: usize| (p.volume + m[(i, i)]) / m[(i, i)].sqrt();
    Ok((0..3).map(of).fold(0.0, f64::max))
}
