//! What a body method must answer.

use crate::Result;
use crate::adjoint::lie::{Mat6, Pose};
use crate::boundary::Response;
use crate::coupling::Exclusions;
use crate::coupling::reduced::compress::CompressSettings;
use crate::geometry::{TriMesh, Wall};
use crate::scene::Scene;
use crate::water::device::Device;
use crate::water::numerics::{Numerics, Plan};
use crate::water::shape::ShapeChange;
use crate::water::submerged::{Discretisation, Made, SubmergedBody};
use std::borrow::Cow;
use std::path::Path;

/// Gaps narrower than this many edges aren't resolved by sources inside the bodies. A sphere near a wall: at 0.3 edges the gap
/// adds 1 % to the error of its added mass with 320 faces (0.1 % with 5120), and the force along
/// the gap is 7 % too small between 0.3 and 0.8 edges (320), 3 % between 0.2 and 0.7 (1280).
const RESOLVED: f64 = 0.5;

/// A distance at which nothing is near: for a body whose flow isn't asked for, m. A needle has little area, and is long.
pub(in crate::water) fn far(body: &SubmergedBody) -> f64 {
    body.mesh
        .map_or(1.0, |m| m.surface_area().sqrt().max(m.diameter()))
}

/// A body alone, solved.
pub(crate) type Solved = Result<Box<dyn Response>>;

/// A way to solve one body in unbounded fluid, and, where it has one, its coupled system of all bodies.
pub(crate) trait BodyMethod: Send + Sync {
    /// Its name in reports of single bodies.
    fn label(&self) -> &'static str;

    /// Another method that it leaves this body to; refuses one that it can't solve.
    fn leaves_to(&self, _: &SubmergedBody) -> Result<Option<&'static dyn BodyMethod>> {
        Ok(None)
    }

    /// Whether it solves ellipsoids by formula, whatever their mesh.
    fn by_formula(&self) -> bool {
        false
    }

    /// Whether it extrapolates from a second, coarser mesh where there is one.
    fn extrapolates(&self) -> bool {
        false
    }

    /// Whether its answers are those of panels, which finer faces make better.
    fn by_panels(&self) -> bool {
        false
    }

    /// The surface around which it is compressed, in the body's frame.
    fn layout<'a>(&self, body: &SubmergedBody<'a>) -> Result<Cow<'a, TriMesh>> {
        Ok(Cow::Borrowed(body.surface("reduced")?))
    }

    /// What its response is made from, beside the layout: the key under which a compressed body is kept.
    fn made_from(&self, body: &SubmergedBody, numerics: &Numerics) -> serde_json::Value;

    /// The body alone, resolved for sources as near as `gap`, m.
    fn response(&self, body: &SubmergedBody, numerics: &Numerics, gap: f64) -> Solved;

    /// Derivatives of the added mass of the body alone with respect to shape parameters of it: of the method's own value on the mesh that there is.
    fn added_mass_slopes(
        &self,
        body: &SubmergedBody,
        numerics: &Numerics,
        changes: &[&ShapeChange],
    ) -> Result<Vec<Mat6>> {
        let far = far(body);
        let slope = |change: &&ShapeChange| {
            let entries = change.slope(|t| {
                let changed = change.changed(body, t);
                let found = self.response(&changed.body(), numerics, far)?.added_mass();
                let entries: [f64; 36] = std::array::from_fn(|n| found[(n / 6, n % 6)]);
                Ok(entries)
            });
            Ok(Mat6::from_row_slice(&entries?))
        };
        changes.iter().map(slope).collect()
    }

    /// All bodies solved together (fidelity full).
    ///
    /// # Errors
    /// A method that solves single bodies only, or whatever the discretisation reports.
    fn couple(&self, problem: &Problem, device: &mut Device) -> Result<Made>;

    /// Whether motion can be computed with all bodies solved together.
    fn steps_together(&self) -> bool {
        false
    }

    /// The narrowest gap that all bodies solved together resolve, in edges, with films in gaps or without.
    fn resolved_edges(&self, _films: bool) -> f64 {
        RESOLVED
    }

    /// Whether gaps that all bodies solved together don't resolve may have films.
    fn has_films(&self) -> bool {
        false
    }

    /// Whether all bodies solved together are made of sources inside them.
    fn by_sources(&self) -> bool {
        false
    }

    /// Whether all bodies solved together may touch: whether a gap of nothing has a solution.
    fn may_touch(&self) -> bool {
        true
    }
}

/// The bodies in the water, what is around them, and how they are solved.
pub(crate) struct Problem<'a> {
    pub bodies: &'a [SubmergedBody<'a>],
    pub walls: &'a [Wall],
    /// Pairs that don't feel each other, by their numbers among `bodies`.
    pub excluded: Exclusions,
    /// The method that is asked for.
    pub method: &'static dyn BodyMethod,
    pub numerics: &'a Numerics,
    pub plan: &'a Plan,
    /// Where the bodies start.
    pub start: &'a [Pose],
    /// Whether they are coupled by products alone.
    pub products: bool,
    /// Where compressed bodies are kept.
    pub folder: Option<&'a Path>,
    /// Shape parameters, each of a body by its number in the water.
    pub changes: &'a [(usize, &'a ShapeChange)],
}

impl<'a> Problem<'a> {
    /// Of bodies of a scene, which have these numbers there, without a plan.
    pub fn new(
        scene: &'a Scene,
        numbers: &[usize],
        bodies: &'a [SubmergedBody],
        method: &'static dyn BodyMethod,
        numerics: &'a Numerics,
    ) -> Self {
        let number = |b: usize| numbers.iter().position(|w| *w == b);
        let declared = scene.carriers().overlapping().into_iter();
        let pairs = declared.filter_map(|(a, b)| Some((number(a)?, number(b)?)));
        Self {
            bodies,
            walls: &scene.walls,
            excluded: Exclusions::new(pairs),
            method,
            numerics,
            plan: &NO_PLAN,
            start: &[],
            products: false,
            folder: None,
            changes: &[],
        }
    }

    /// The method for a body: the one asked for, or another that it leaves the body to.
    pub fn method_for(&self, body: &SubmergedBody) -> Result<&'static dyn BodyMethod> {
        Ok(self.method.leaves_to(body)?.unwrap_or(self.method))
    }

    /// How body `b` is compressed.
    pub fn chosen(&self, b: usize) -> &CompressSettings {
        let planned = self.plan.compress.get(b);
        planned.unwrap_or(&self.numerics.compress)
    }

    /// The tolerance of body `b`'s compression; where its number of points was given, the default.
    pub fn tolerance(&self, b: usize) -> f64 {
        let chosen = self.chosen(b);
        let default = CompressSettings::default().tolerance;
        chosen.rank.map_or(chosen.tolerance, |_| default)
    }

    /// Each body's added mass alone in the water, `alone` of its number, where another one is given: elsewhere nobody asks.
    ///
    /// # Errors
    /// Whatever `alone` reports.
    pub fn own(&self, mut alone: impl FnMut(usize) -> Result<Mat6>) -> Result<Vec<Option<Mat6>>> {
        let bodies = self.bodies.iter().enumerate();
        bodies
            .map(|(b, body)| body.added_mass.map(|_| alone(b)).transpose())
            .collect()
    }

    /// What each body became, with its name.
    pub fn named(&self, made: impl IntoIterator<Item = Discretisation>) -> Vec<Discretisation> {
        let named = |(d, body): (Discretisation, &SubmergedBody)| Discretisation {
            body: body.name.to_string(),
            ..d
        };
        made.into_iter().zip(self.bodies).map(named).collect()
    }
}

static NO_PLAN: Plan = Plan {
    compress: Vec::new(),
    cutoffs: Vec::new(),
};
