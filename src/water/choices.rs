//! How the water is computed.

use super::backend::{Backend, GpuSettings};
use super::fidelity::Fidelity;
use super::method::Method;
use super::numerics::Numerics;
use super::shape::vertices_are_asked_for;
use super::surface::{Meshing, Surface, surface};
use crate::Result;
use crate::boundary::{self, Depth};
use crate::coupling::full::{FullSolver, Preconditioner, SolveSettings};
use crate::scene::{Body, Preset, Scene};
use serde::{Deserialize, Serialize};

/// How the water is computed, everything decided.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WaterChoices {
    /// How much of the coupling is modelled.
    pub fidelity: Fidelity,
    /// Method by which each body alone is solved.
    pub method: Method,
    /// The numbers that both work with.
    pub numerics: Numerics,
    /// Faces per body of shapes by formula; `None`: what each shape says. A mesh is divided where its edges are far longer than those of
    /// so many faces (`None`: 1280).
    pub faces: Option<usize>,
    /// What computes the coupling.
    pub backend: Backend,
    /// Choices of [`Backend::Gpu`].
    pub gpu: GpuSettings,
}

impl WaterChoices {
    /// The choices of a preset.
    pub fn preset(preset: Preset) -> Self {
        match preset {
            Preset::Default => Self::default(),
            Preset::Paper => Self {
                fidelity: Fidelity::Full,
                method: Method::MfsFace,
                numerics: Numerics {
                    mfs: boundary::MfsSettings {
                        rows: boundary::RowScaling::Unscaled,
                        ..boundary::MfsSettings::plain(boundary::Method::MfsFace, Depth::Auto)
                    },
                    ..Numerics::default()
                },
                ..Self::default()
            },
        }
    }

    /// The body method that the fidelity makes of the one asked for.
    pub fn method_used(&self) -> Method {
        match self.fidelity.kind().solves_alone() {
            true => self.method,
            false => self.method.together(),
        }
    }

    /// What is asked of surfaces.
    pub(crate) fn meshing(&self) -> Meshing {
        let (alone, method) = (self.fidelity.kind().solves_alone(), self.method.kind());
        Meshing {
            faces: self.faces,
            keeps: false,
            by_formula: alone && method.by_formula(),
            pairs: self.method_used().kind().extrapolates(),
        }
    }

    /// The same of the preconditioner and its ρ.
    fn preconditioner_without_effect(&self) -> Vec<String> {
        let (solve, usual) = (&self.numerics.solve, SolveSettings::default());
        let method = self.method_used();
        let by_sources = self.fidelity == Fidelity::Full && method.kind().by_sources();
        let chosen = solve.preconditioner != usual.preconditioner;
        let reach = solve.csd24_rho != usual.csd24_rho;
        let mut out = Vec::new();
        let mut told =
            |name: &str, with: String, who: &str| out.push(without_effect(name, &with, who));
        for (name, given) in [("preconditioner", chosen), ("csd24_rho", reach)] {
            let who = "only full by fundamental solutions takes it";
            if given && !by_sources {
                told(
                    name,
                    format!("the fidelity {} by {method}", self.fidelity),
                    who,
                );
            } else if given && solve.solver == FullSolver::Qr {
                told(name, "the solver qr".into(), "only iterations take it");
            }
        }
        let takes_reach = match solve.preconditioner {
            Preconditioner::Csd24 => true,
            // There large bodies have a sparse factor in place of a dense one.
            Preconditioner::Factors => self.backend == Backend::Gpu,
            Preconditioner::Jacobi | Preconditioner::None => false,
        };
        if reach && by_sources && !takes_reach {
            let name: &str = solve.preconditioner.into();
            told(
                "csd24_rho",
                format!("the preconditioner {name}"),
                "only csd24 takes it",
            );
        }
        out
    }

    /// Choices that the backend, the fidelity or the method doesn't look at; `cached`: whether compressed bodies are to be kept in a folder.
    pub(crate) fn without_effect(&self, cached: bool) -> Vec<String> {
        use super::fidelity::Knob::{Accuracy, Films, Rank, ResolvedGap, Tolerance};
        const REDUCED: &str = "only reduced takes it";
        const COMPRESSED: &str = "only reduced and auto take it";
        const FILMED: &str = "only reduced, auto, and full by panels take it";
        let mut out = Vec::new();
        if self.backend == Backend::Cpu && self.gpu != GpuSettings::default() {
            out.push("the settings of the GPU have no effect with the backend cpu".into());
        }
        out.extend(self.preconditioner_without_effect());
        let (numerics, usual) = (&self.numerics, Numerics::default());
        let (compress, solve, mfs) = (&numerics.compress, &numerics.solve, &numerics.mfs);
        let method = self.method_used().kind();
        let has = |knob| self.fidelity.knobs().contains(&knob);
        let compresses = self.fidelity.kind().compresses();
        let filmed = self.fidelity.kind().solves_alone() || method.has_films();
        let mut told = |name: &str, given: bool, heeded: bool, with: &str, who: &str| {
            if given && !heeded {
                out.push(without_effect(name, with, who));
            }
        };
        let with = format!("the fidelity {}", self.fidelity);
        let mut of_fidelity = |name: &str, given: bool, heeded: bool, who: &str| {
            told(name, given, heeded, &with, who)
        };
        of_fidelity("rank", compress.rank.is_some(), has(Rank), REDUCED);
        let gap = compress.resolved_gap.is_some();
        of_fidelity("resolved_gap", gap, has(ResolvedGap), REDUCED);
        of_fidelity("films", !numerics.films, has(Films), FILMED);
        let aims = [compress.tolerance, numerics.accuracy];
        let aimed = aims != [usual.compress.tolerance, usual.accuracy];
        of_fidelity("accuracy", aimed, has(Accuracy), COMPRESSED);
        let exchange = numerics.exchange != usual.exchange;
        of_fidelity("exchange", exchange, compresses, COMPRESSED);
        of_fidelity("cache", cached, compresses, COMPRESSED);
        for (name, given) in [
            ("tolerance", solve.tolerance != usual.solve.tolerance),
            ("solver", solve.solver != usual.solve.solver),
            (
                "max_iterations",
                solve.max_iterations != usual.solve.max_iterations,
            ),
        ] {
            of_fidelity(name, given, has(Tolerance), "only full takes it");
        }
        let with = format!("the method {}", self.method_used());
        let unfilmed = !numerics.films && has(Films);
        told("films", unfilmed, filmed, &with, FILMED);
        // What a preset says of its own method isn't asked of another one.
        let asked = *mfs != Self::preset(Preset::Paper).numerics.mfs;
        for (name, given) in [
            ("depth", mfs.depth != usual.mfs.depth),
            ("rows", mfs.rows != usual.mfs.rows),
            ("readout", mfs.readout != usual.mfs.readout),
            ("damping", mfs.damping != usual.mfs.damping),
        ] {
            let who = "only mfs-vertex and mfs-face take it";
            told(name, asked && given, method.by_sources(), &with, who);
        }
        out
    }
}

/// What is said of a setting that nothing looks at.
fn without_effect(name: &str, with: &str, who: &str) -> String {
    format!("the setting {name} has no effect with {with}: {who}")
}

/// The surfaces of all bodies of a scene, each in its body's frame; none for a body without a shape. Equal shapes are meshed once.
/// Meshes whose vertices are among the `shape_parameters` keep their faces.
///
/// # Errors
/// A mesh that can't be read, or a shape that can't be meshed.
pub(crate) fn surfaces(
    scene: &Scene,
    choices: &WaterChoices,
    shape_parameters: &[String],
) -> Result<Vec<Option<Surface>>> {
    let keeps = |body: &Body| vertices_are_asked_for(body, shape_parameters);
    let mut out: Vec<Option<Surface>> = Vec::with_capacity(scene.bodies.len());
    // The first bodies of each shape.
    let mut firsts: Vec<usize> = Vec::new();
    for (b, body) in scene.bodies.iter().enumerate() {
        let known = firsts
            .iter()
            .map(|a| (*a, &scene.bodies[*a]))
            .find(|(_, first)| is_shaped_as(first, body) && keeps(first) == keeps(body));
        let made = match known {
            Some((a, _)) => out[a].clone(),
            None => {
                firsts.push(b);
                let meshing = Meshing {
                    keeps: keeps(body),
                    ..choices.meshing()
                };
                surface(body, meshing, 1.0)?
            }
        };
        out.push(made);
    }
    Ok(out)
}

/// Whether two bodies have the same surface in their frames.
fn is_shaped_as(a: &Body, b: &Body) -> bool {
    a.shape == b.shape && a.shape_at == b.shape_at && a.refine == b.refine
}
