//! Which configurations of a scene are compared.

use clap::Args;
use serde::Serialize;

use super::report::short;
use crate::boundary::OneBody;
use crate::cli::options::{self, Method, name, positive, tolerance};
use crate::coupling::{full, reduced::compress};
use crate::dynamics::Integrator;
use crate::scene::{Scene, Shape};
use crate::shape::DEFAULT_FACES;
use crate::simulate::{Accuracy, Fidelity, Settings};

const FACES: [usize; 3] = [80, 320, 1280];
const RANKS: [usize; 5] = [20, 40, 80, 160, 320];
const ACCURACIES: [f64; 6] = [3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4];
const TOLERANCES: [f64; 5] = [1e-3, 1e-4, 1e-6, 1e-8, 1e-10];
/// Of the scene's time step.
const TIME_STEPS: [f64; 5] = [4.0, 2.0, 1.0, 0.5, 0.25];
const INTEGRATORS: [Integrator; 5] = [
    Integrator::MomentumEuler,
    Integrator::Midpoint,
    Integrator::Rk2,
    Integrator::Rk4,
    Integrator::VelocityEuler,
];
const FIDELITIES: [Fidelity; 4] = [
    Fidelity::Isolated,
    Fidelity::Reduced,
    Fidelity::Auto,
    Fidelity::Full,
];

/// What is varied. Of each list that is given, the first value is what all else is varied around.
#[derive(Clone, Debug, Default, Args)]
pub(super) struct Lists {
    /// Fidelities, with commas between [default: isolated,reduced,auto,full].
    #[arg(long, value_enum, value_delimiter = ',', value_name = "LIST")]
    fidelities: Vec<options::Fidelity>,
    /// Methods by which a body alone is solved [default: what the scene asks for, and the others
    /// that the fidelity has].
    #[arg(long, value_enum, value_delimiter = ',', value_name = "LIST")]
    methods: Vec<Method>,
    /// Faces per body, for shapes by formula [default: the scene's own, and 80,320,1280].
    #[arg(long, value_parser = positive, value_delimiter = ',', value_name = "LIST", allow_negative_numbers = true)]
    faces_list: Vec<usize>,
    /// Points of each compressed body, with the fidelity reduced [default: 20,40,80,160,320].
    #[arg(long, value_parser = positive, value_delimiter = ',', value_name = "LIST", allow_negative_numbers = true)]
    ranks: Vec<usize>,
    /// Errors that reduced and auto aim at [default: their own, and 3e-2 to 1e-4].
    #[arg(long, value_parser = tolerance, value_delimiter = ',', value_name = "LIST", allow_negative_numbers = true)]
    accuracies: Vec<f64>,
    /// Relative residuals of the coupled solve, with the fidelity full [default: its own, and 1e-3
    /// to 1e-10].
    #[arg(long, value_parser = tolerance, value_delimiter = ',', value_name = "LIST", allow_negative_numbers = true)]
    tolerances: Vec<f64>,
    /// Integrators, with one fidelity: reduced if it is among them [default: the scene's own, and
    /// all others].
    #[arg(long, value_enum, value_delimiter = ',', value_name = "LIST")]
    integrators: Vec<options::Integrator>,
    /// Time steps in s, with the same fidelity [default: the scene's own, and 4 times to a quarter of it].
    #[arg(long, value_parser = seconds, value_delimiter = ',', value_name = "LIST", allow_negative_numbers = true)]
    time_steps: Vec<f64>,
    /// Every combination of what is varied, in place of one after the other.
    #[arg(long)]
    full_product: bool,
}

/// A time above zero.
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(x) if x > 0.0 && f64::is_finite(x) => Ok(x),
        _ => Err("give a time above zero, in s".into()),
    }
}

/// What was varied to come to a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Family {
    /// Nothing: what the others are varied around.
    Base,
    Method,
    Faces,
    Rank,
    Accuracy,
    Tolerance,
    Integrator,
    TimeStep,
    /// All at once.
    Product,
}

/// One way to simulate the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Configuration {
    pub family: Family,
    pub settings: Settings,
}

impl Configuration {
    /// Points asked for per compressed body.
    pub fn rank(&self) -> Option<usize> {
        let reduced = self.settings.fidelity == Fidelity::Reduced;
        self.settings.compress.rank.filter(|_| reduced)
    }

    /// The error aimed at, where a fidelity has such an aim.
    pub fn accuracy(&self) -> Option<f64> {
        match self.settings.fidelity {
            Fidelity::Reduced if self.rank().is_none() => Some(self.settings.compress.tolerance),
            Fidelity::Auto => Some(self.settings.accuracy.0),
            _ => None,
        }
    }

    /// Residual at which the coupled solve stops.
    pub fn tolerance(&self) -> Option<f64> {
        let full = self.settings.fidelity == Fidelity::Full;
        full.then_some(self.settings.solve.tolerance)
    }

    /// Time step, s.
    pub fn time_step(&self) -> f64 {
        self.settings.time_step.unwrap_or(f64::NAN)
    }

    /// Without what only the way through time depends on: configurations that agree in this share M_f.
    pub fn coupling(&self) -> Settings {
        let mut out = self.settings.integrator(Integrator::default());
        out.time_step = None;
        out
    }

    /// Whether both take time in the same steps.
    pub fn steps_like(&self, other: &Self) -> bool {
        (self.settings.integrator, self.settings.time_step)
            == (other.settings.integrator, other.settings.time_step)
    }

    /// In words.
    pub fn label(&self) -> String {
        let s = &self.settings;
        let mut out = format!("{} ({})", name(s.fidelity), s.method_name());
        if let Some(faces) = s.faces {
            out += &format!(", {faces} faces a body");
        }
        if let Some(rank) = self.rank() {
            out += &format!(", rank {rank}");
        }
        if let Some(accuracy) = self.accuracy() {
            out += &format!(", accuracy {accuracy:.0e}");
        }
        if let Some(tolerance) = self.tolerance() {
            out += &format!(", tolerance {tolerance:.0e}");
        }
        out + &format!(", {}, {} s", name(s.integrator), short(self.time_step()))
    }
}

/// How many of the shapes closed forms are known for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ByFormula {
    All,
    Some,
    None,
}

/// The configurations to compare, each once; the bases of the fidelities first.
pub(super) fn plan(scene: &Scene, lists: &Lists) -> Vec<Configuration> {
    let mut plan = Plan::new(scene, lists);
    if lists.full_product {
        plan.product();
    } else {
        plan.one_by_one();
    }
    plan.out
}

struct Plan<'a> {
    scene: &'a Scene,
    lists: &'a Lists,
    by_formula: ByFormula,
    out: Vec<Configuration>,
}

impl<'a> Plan<'a> {
    fn new(scene: &'a Scene, lists: &'a Lists) -> Self {
        let shapes = || scene.bodies.iter().filter_map(|b| b.shape.as_ref());
        let formula = |s: &Shape| matches!(s, Shape::Sphere { .. } | Shape::Ellipsoid { .. });
        let by_formula = if shapes().all(formula) {
            ByFormula::All
        } else if shapes().any(formula) {
            ByFormula::Some
        } else {
            ByFormula::None
        };
        Self {
            scene,
            lists,
            by_formula,
            out: Vec::new(),
        }
    }

    fn fidelities(&self) -> Vec<Fidelity> {
        match self.lists.fidelities.as_slice() {
            [] => FIDELITIES.to_vec(),
            given => given.iter().map(|f| (*f).into()).collect(),
        }
    }

    fn one_by_one(&mut self) {
        let fidelities = self.fidelities();
        for fidelity in &fidelities {
            self.add(Family::Base, self.base(*fidelity));
        }
        for fidelity in &fidelities {
            let base = self.base(*fidelity);
            for method in self.methods(*fidelity) {
                self.add(Family::Method, method.choose(base));
            }
            if let Some(meshed) = self.with_mesh(base) {
                for faces in self.faces(*fidelity) {
                    self.add(Family::Faces, meshed.faces(faces));
                }
            }
            for (family, settings) in self.knobs(base) {
                self.add(family, settings);
            }
        }
        let led = fidelities.iter().find(|f| **f == Fidelity::Reduced);
        if let Some(lead) = led.or(fidelities.last()) {
            let base = self.base(*lead);
            for integrator in self.integrators() {
                self.add(Family::Integrator, base.integrator(integrator));
            }
            for time_step in self.time_steps() {
                self.add(Family::TimeStep, base.time_step(time_step));
            }
        }
    }

    fn product(&mut self) {
        for fidelity in self.fidelities() {
            let base = self.base(fidelity);
            self.add(Family::Base, base);
        }
        for fidelity in self.fidelities() {
            let base = self.base(fidelity);
            let mut all = vec![base];
            all.extend(self.methods(fidelity).into_iter().map(|m| m.choose(base)));
            let vary = |all: Vec<Settings>, more: &dyn Fn(Settings) -> Vec<Settings>| {
                let varied = |s: Settings| std::iter::once(s).chain(more(s));
                all.into_iter().flat_map(varied).collect::<Vec<_>>()
            };
            let faces = self.faces(fidelity);
            all = vary(all, &|s| faces.iter().map(|f| s.faces(*f)).collect());
            all = vary(all, &|s| {
                self.knobs(s).into_iter().map(|(_, s)| s).collect()
            });
            let integrators = self.integrators();
            all = vary(all, &|s| {
                integrators.iter().map(|i| s.integrator(*i)).collect()
            });
            let time_steps = self.time_steps();
            all = vary(all, &|s| {
                time_steps.iter().map(|dt| s.time_step(*dt)).collect()
            });
            for settings in all {
                self.add(Family::Product, settings);
            }
        }
    }

    /// What the other configurations of a fidelity are varied around.
    fn base(&self, fidelity: Fidelity) -> Settings {
        let lists = self.lists;
        let own = Settings::for_scene(self.scene).fidelity(fidelity);
        let mut out = own.time_step(
            lists
                .time_steps
                .first()
                .copied()
                .unwrap_or(self.scene.time_step),
        );
        // The coupled system is one of fundamental solutions.
        let fits = |m: &&Method| match fidelity {
            Fidelity::Full => !matches!(m, Method::Exact | Method::Panel),
            _ => true,
        };
        if let Some(method) = lists.methods.iter().find(fits) {
            out = method.choose(out);
        }
        if let Some(faces) = lists.faces_list.first() {
            out = out.faces(*faces);
        }
        if let Some(integrator) = lists.integrators.first() {
            out = out.integrator((*integrator).into());
        }
        if let Some(tolerance) = lists.tolerances.first() {
            out = out.tolerance(*tolerance);
        }
        match (lists.accuracies.first(), lists.ranks.first()) {
            (Some(accuracy), _) => out.accuracy(*accuracy),
            (None, Some(rank)) if fidelity == Fidelity::Reduced => out.rank(*rank),
            _ => out,
        }
    }

    fn methods(&self, fidelity: Fidelity) -> Vec<Method> {
        if !self.lists.methods.is_empty() {
            return self.lists.methods.clone();
        }
        match fidelity {
            Fidelity::Isolated | Fidelity::Reduced => {
                vec![
                    Method::Auto,
                    Method::Panel,
                    Method::MfsVertex,
                    Method::MfsFace,
                ]
            }
            Fidelity::Auto => Vec::new(),
            Fidelity::Full => vec![Method::MfsVertex, Method::MfsFace],
        }
    }

    fn faces(&self, fidelity: Fidelity) -> Vec<usize> {
        match (self.lists.faces_list.as_slice(), fidelity) {
            ([], Fidelity::Auto) => Vec::new(),
            ([], _) => FACES.to_vec(),
            (given, _) => given.to_vec(),
        }
    }

    /// The base with a method whose answer depends on the mesh.
    fn with_mesh(&self, base: Settings) -> Option<Settings> {
        let meshed = |s: &Settings| {
            let exact = matches!(s.one_body, OneBody::Auto | OneBody::Exact);
            let coupled = matches!(s.fidelity, Fidelity::Full);
            coupled || !exact || self.by_formula != ByFormula::All
        };
        let methods = match self.lists.methods.as_slice() {
            [] => vec![Method::Panel],
            given => given.to_vec(),
        };
        let others = methods.into_iter().map(|m| m.choose(base));
        std::iter::once(base).chain(others).find(meshed)
    }

    /// What one fidelity alone can vary.
    fn knobs(&self, base: Settings) -> Vec<(Family, Settings)> {
        let mut out = Vec::new();
        let accuracies = or_default(&self.lists.accuracies, &ACCURACIES);
        let mut without = base;
        without.compress.rank = None;
        let aims = accuracies
            .iter()
            .map(|a| (Family::Accuracy, without.accuracy(*a)));
        match base.fidelity {
            Fidelity::Isolated => {}
            Fidelity::Reduced => {
                let own = without.accuracy(compress::Settings::default().tolerance);
                let ranks = or_default(&self.lists.ranks, &RANKS);
                out.extend(ranks.iter().map(|r| (Family::Rank, own.rank(*r))));
                out.extend(aims);
            }
            Fidelity::Auto => out.extend(aims),
            Fidelity::Full => {
                let tolerances = or_default(&self.lists.tolerances, &TOLERANCES);
                let of = |t: &f64| (Family::Tolerance, base.tolerance(*t));
                out.extend(tolerances.iter().map(of));
            }
        }
        out
    }

    fn integrators(&self) -> Vec<Integrator> {
        match self.lists.integrators.as_slice() {
            [] => INTEGRATORS.to_vec(),
            given => given.iter().map(|i| (*i).into()).collect(),
        }
    }

    fn time_steps(&self) -> Vec<f64> {
        match self.lists.time_steps.as_slice() {
            [] => TIME_STEPS.map(|x| x * self.scene.time_step).to_vec(),
            given => given.to_vec(),
        }
    }

    fn add(&mut self, family: Family, settings: Settings) {
        let settings = self.plain(settings);
        if self.out.iter().all(|c| c.settings != settings) {
            self.out.push(Configuration { family, settings });
        }
    }

    /// The same with what makes no difference at its default, so that equals are equal.
    fn plain(&self, mut s: Settings) -> Settings {
        let (accuracy, compress) = (s.accuracy, s.compress);
        s.accuracy = Accuracy::default();
        s.compress = compress::Settings::default();
        match s.fidelity {
            Fidelity::Reduced => s.compress = compress,
            Fidelity::Auto => s.accuracy = accuracy,
            Fidelity::Isolated | Fidelity::Full => {}
        }
        if matches!(s.fidelity, Fidelity::Isolated | Fidelity::Reduced) {
            s.solve.tolerance = full::SolveSettings::default().tolerance;
            s.one_body = match (s.one_body, self.by_formula) {
                (OneBody::Auto, ByFormula::All) => OneBody::Exact,
                (OneBody::Auto, ByFormula::None) => OneBody::Panel,
                (method, _) => method,
            };
        }
        if s.fidelity == Fidelity::Full && s.one_body == OneBody::Auto {
            s.one_body = OneBody::Mfs;
        }
        s.faces = s.faces.filter(|faces| !self.asks_for(*faces));
        s
    }

    /// Whether the scene itself has so many faces on every shape by formula.
    fn asks_for(&self, faces: usize) -> bool {
        let own = |shape: &Shape| match shape {
            Shape::Sphere { faces, .. }
            | Shape::Ellipsoid { faces, .. }
            | Shape::Box { faces, .. }
            | Shape::Cylinder { faces, .. }
            | Shape::Capsule { faces, .. }
            | Shape::Prism { faces, .. } => Some(faces.unwrap_or(DEFAULT_FACES)),
            Shape::Mesh { .. } | Shape::Triangles { .. } => None,
        };
        let shapes = self.scene.bodies.iter().filter_map(|b| b.shape.as_ref());
        shapes.filter_map(own).all(|n| n == faces)
    }
}

fn or_default<T: Clone>(given: &[T], default: &[T]) -> Vec<T> {
    match given {
        [] => default.to_vec(),
        given => given.to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Body, Fluid};

    fn scene(shapes: &[Shape]) -> Scene {
        let mut scene = Scene::new(Fluid::fresh_water());
        for shape in shapes {
            scene.add(Body::new(shape.clone()).density(998.0));
        }
        scene
    }

    fn of(plan: &[Configuration], fidelity: Fidelity, family: Family) -> Vec<Configuration> {
        let fits = |c: &&Configuration| (c.settings.fidelity, c.family) == (fidelity, family);
        plan.iter().filter(fits).copied().collect()
    }

    #[test]
    fn configurations_are_distinct_and_bases_come_first() {
        for shapes in [
            vec![Shape::sphere(1.0)],
            vec![Shape::cuboid([1.0; 3])],
            vec![Shape::sphere(1.0), Shape::cuboid([1.0; 3])],
        ] {
            let plan = plan(&scene(&shapes), &Lists::default());
            assert!(plan[..4].iter().all(|c| c.family == Family::Base));
            assert!(plan[4..].iter().all(|c| c.family != Family::Base));
            for (i, c) in plan.iter().enumerate() {
                assert!(
                    plan[..i].iter().all(|d| d.label() != c.label()),
                    "{}",
                    c.label()
                );
            }
        }
    }

    #[test]
    fn methods_without_a_difference_are_one() {
        let methods = |shapes: &[Shape]| -> Vec<&str> {
            let plan = plan(&scene(shapes), &Lists::default());
            let families = [Family::Base, Family::Method];
            let reduced = families.map(|f| of(&plan, Fidelity::Reduced, f)).concat();
            reduced.iter().map(|c| c.settings.method_name()).collect()
        };
        let sphere = Shape::sphere(1.0);
        let cube = Shape::cuboid([1.0; 3]);
        let all = ["exact", "panel", "mfs-vertex", "mfs-face"];
        assert_eq!(methods(std::slice::from_ref(&sphere)), all);
        assert_eq!(methods(std::slice::from_ref(&cube)), all[1..]);
        assert_eq!(methods(&[sphere, cube])[0], "auto");
    }

    #[test]
    fn first_values_are_the_base() {
        let lists = Lists {
            fidelities: vec![options::Fidelity::Reduced, options::Fidelity::Full],
            methods: vec![Method::Panel, Method::MfsFace],
            faces_list: vec![320, 80],
            ranks: vec![20, 40],
            tolerances: vec![1e-6],
            integrators: vec![options::Integrator::Rk4],
            time_steps: vec![0.02, 0.01],
            ..Lists::default()
        };
        let plan = plan(&scene(&[Shape::sphere(1.0)]), &lists);
        let reduced = plan[0];
        assert_eq!(reduced.settings.one_body, OneBody::Panel);
        assert_eq!(reduced.settings.faces, Some(320));
        assert_eq!((reduced.rank(), reduced.accuracy()), (Some(20), None));
        assert_eq!(reduced.time_step(), 0.02);
        // Full takes the first method that it can step with; panels follow as a row of their own.
        let full = plan[1];
        assert_eq!(full.settings.method_name(), "mfs-face");
        assert_eq!(full.tolerance(), Some(1e-6));
        let methods = of(&plan, Fidelity::Full, Family::Method);
        assert_eq!(methods.len(), 1);
        assert_eq!(methods[0].settings.method_name(), "panel");
        let steps = of(&plan, Fidelity::Reduced, Family::TimeStep);
        assert_eq!(steps.len(), 1);
        assert!(!steps[0].steps_like(&reduced) && steps[0].coupling() == reduced.coupling());
        assert!(
            plan.iter()
                .all(|c| c.settings.integrator == Integrator::Rk4)
        );
    }

    #[test]
    fn product_has_every_combination_once() {
        let lists = Lists {
            fidelities: vec![options::Fidelity::Reduced],
            methods: vec![Method::Panel, Method::MfsVertex],
            faces_list: vec![80, 320],
            ranks: vec![20, 40],
            accuracies: vec![1e-2],
            integrators: vec![options::Integrator::Rk2, options::Integrator::Rk4],
            time_steps: vec![0.01, 0.02, 0.04],
            full_product: true,
            ..Lists::default()
        };
        let plan = plan(&scene(&[Shape::sphere(1.0)]), &lists);
        assert_eq!(plan.len(), 2 * 2 * 3 * 2 * 3);
    }
}
