//! Which configurations of a scene are compared, and in which order they are measured.

use super::configuration::{Configuration, Family};
use super::row::TradeoffRow;
use super::settings::TradeoffSettings;
use super::shapes::{ClosedForms, closed_forms, has_faces};
use super::start::{free, isolated};
use crate::coupling::full::SolveSettings;
use crate::dynamics::Integrator;
use crate::scene::Scene;
use crate::simulate::{Fidelity, Knob, Method, Numerics, Settings};
use crate::{Error, Result};
use strum::VariantArray;

const FACES: [usize; 3] = [80, 320, 1280];
const RANKS: [usize; 5] = [20, 40, 80, 160, 320];
const ACCURACIES: [f64; 6] = [3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4];
const TOLERANCES: [f64; 5] = [1e-3, 1e-4, 1e-6, 1e-8, 1e-10];
/// Of the scene's time step.
const TIME_STEPS: [f64; 5] = [4.0, 2.0, 1.0, 0.5, 0.25];
/// How setting up and stepping grow with the number of faces, at most: a guess, with a factor against
/// starting what can't end in time.
const GROWTH: f64 = 2.5;

/// The configurations that [`super::measure`] compares, each once: one of each fidelity first, what the others are varied
/// around.
///
/// # Errors
/// Settings out of range; a scene that doesn't validate, without water, or where nothing can move.
pub fn configurations(scene: &Scene, settings: &TradeoffSettings) -> Result<Vec<Configuration>> {
    settings.validate()?;
    scene.validate()?;
    check(scene)?;
    let mut plan = Plan {
        scene,
        settings,
        closed_forms: closed_forms(scene),
        out: Vec::new(),
    };
    let bases: Vec<Configuration> = or_default(&settings.fidelities, Fidelity::VARIANTS)
        .iter()
        .map(|fidelity| plan.base(*fidelity))
        .collect();
    plan.add(Family::Base, bases.iter().copied());
    if settings.full_product {
        plan.product(&bases);
    } else {
        plan.one_by_one(&bases);
    }
    Ok(plan.out)
}

/// Refuses scenes in which there is nothing to compare.
fn check(scene: &Scene) -> Result<()> {
    if scene.fluid.density <= 0.0 {
        return Err(Error::input(
            "fluid.density",
            scene.fluid.density,
            "must be above zero: without water all fidelities are the same",
        ));
    }
    if free(&isolated(scene)?)?.is_empty() {
        return Err(Error::input(
            "joints that forces move at the start",
            0,
            "give at least one body a joint that is neither locked, held nor driven",
        ));
    }
    Ok(())
}

struct Plan<'a> {
    scene: &'a Scene,
    settings: &'a TradeoffSettings,
    closed_forms: ClosedForms,
    out: Vec<Configuration>,
}

const AIMS: [Family; 3] = [Family::Rank, Family::Accuracy, Family::Tolerance];

impl Plan<'_> {
    fn one_by_one(&mut self, bases: &[Configuration]) {
        for base in bases {
            self.vary(Family::Method, *base);
            if let Some(meshed) = self.with_mesh(*base) {
                self.vary(Family::Faces, meshed);
            }
            for family in AIMS {
                self.vary(family, *base);
            }
        }
        let reduced = bases.iter().find(|b| b.fidelity == Fidelity::Reduced);
        if let Some(base) = reduced.or(bases.last()) {
            self.vary(Family::Integrator, *base);
            self.vary(Family::TimeStep, *base);
        }
    }

    fn product(&mut self, bases: &[Configuration]) {
        for base in bases {
            let mut all = vec![*base];
            use Family::{Faces, Integrator, Method, TimeStep};
            for families in [&[Method][..], &[Faces], &AIMS, &[Integrator], &[TimeStep]] {
                let plan = &*self;
                let more = |c| families.iter().flat_map(move |f| plan.varied(*f, c));
                all = all
                    .into_iter()
                    .flat_map(|c| std::iter::once(c).chain(more(c)))
                    .collect();
            }
            self.add(Family::Product, all);
        }
    }

    fn vary(&mut self, family: Family, base: Configuration) {
        self.add(family, self.varied(family, base));
    }

    /// What the other configurations of a fidelity are varied around.
    fn base(&self, fidelity: Fidelity) -> Configuration {
        let own = Settings::default().fidelity(fidelity).resolve(self.scene);
        let given = self.settings;
        let fits = |m: &&Method| fidelity.kind().solves_alone() || m.kind().steps_together();
        let method = given.methods.iter().find(fits).copied();
        let accuracy = given.accuracies.first().copied();
        let time_step = given.time_steps.first().copied();
        self.normalised(Configuration {
            family: Family::Base,
            fidelity,
            method: method.unwrap_or(own.water.method_used()),
            faces_per_body: given.faces.first().copied(),
            rank: given.ranks.first().copied().filter(|_| accuracy.is_none()),
            accuracy,
            tolerance: given.tolerances.first().copied(),
            integrator: *given.integrators.first().unwrap_or(&own.integrator),
            time_step: time_step.unwrap_or(own.time_step),
        })
    }

    /// The base with each value of what a family varies; none if its fidelity doesn't look at that.
    fn varied(&self, family: Family, base: Configuration) -> Vec<Configuration> {
        fn each<T: Copy>(
            base: Configuration,
            (given, own): (&[T], &[T]),
            set: fn(&mut Configuration, T),
        ) -> Vec<Configuration> {
            let with = |value: &T| {
                let mut out = base;
                set(&mut out, *value);
                out
            };
            or_default(given, own).iter().map(with).collect()
        }
        let (given, fidelity) = (self.settings, base.fidelity.kind());
        let has = |knob| fidelity.knobs().contains(&knob);
        match family {
            Family::Method => {
                let fits = |m: &&Method| match fidelity.solves_alone() {
                    true => !fidelity.chooses() && **m != Method::Exact,
                    false => m.kind().steps_together() && m.together() == **m,
                };
                let own: Vec<Method> = Method::VARIANTS.iter().filter(fits).copied().collect();
                each(base, (&given.methods, &own), |c, method| c.method = method)
            }
            Family::Faces => {
                let own = if fidelity.chooses() { 0 } else { FACES.len() };
                each(base, (&given.faces, &FACES[..own]), |c, n| {
                    c.faces_per_body = Some(n);
                })
            }
            Family::Rank if has(Knob::Rank) => each(base, (&given.ranks, &RANKS), |c, n| {
                (c.rank, c.accuracy, c.tolerance) = (Some(n), None, None);
            }),
            Family::Accuracy if has(Knob::Accuracy) => {
                each(base, (&given.accuracies, &ACCURACIES), |c, x| {
                    (c.rank, c.accuracy, c.tolerance) = (None, Some(x), None);
                })
            }
            Family::Tolerance if has(Knob::Tolerance) => {
                each(base, (&given.tolerances, &TOLERANCES), |c, x| {
                    (c.rank, c.accuracy, c.tolerance) = (None, None, Some(x));
                })
            }
            Family::Integrator => {
                let all = (given.integrators.as_slice(), Integrator::VARIANTS);
                each(base, all, |c, integrator| c.integrator = integrator)
            }
            Family::TimeStep => {
                let own = TIME_STEPS.map(|x| x * self.scene.time_step);
                each(base, (&given.time_steps, &own), |c, dt| c.time_step = dt)
            }
            _ => Vec::new(),
        }
    }

    /// The base with a method whose solution depends on the mesh.
    fn with_mesh(&self, base: Configuration) -> Option<Configuration> {
        let meshed = |c: &Configuration| {
            let exact = c.fidelity.kind().solves_alone() && c.method.kind().by_formula();
            !exact || self.closed_forms != ClosedForms::All
        };
        let methods = or_default(&self.settings.methods, &[Method::Panel]);
        let others = methods.iter();
        let others = others.map(|m| Configuration { method: *m, ..base });
        std::iter::once(base).chain(others).find(meshed)
    }

    fn add(&mut self, family: Family, configurations: impl IntoIterator<Item = Configuration>) {
        for configuration in configurations {
            let new = self.normalised(configuration);
            let equal = |old: &Configuration| old.couples_like(&new) && old.steps_like(&new);
            if !self.out.iter().any(equal) {
                self.out.push(Configuration { family, ..new });
            }
        }
    }

    /// The same without what makes no difference, and with defaults written out, so that equals are equal.
    fn normalised(&self, mut c: Configuration) -> Configuration {
        let has = |knob| c.fidelity.knobs().contains(&knob);
        c.rank = c.rank.filter(|_| has(Knob::Rank));
        let own_accuracy = c.fidelity.kind().aim(&Numerics::default());
        let own_accuracy = own_accuracy.filter(|_| c.rank.is_none());
        c.accuracy = own_accuracy.map(|own| c.accuracy.unwrap_or(own));
        let own_tolerance = SolveSettings::default().tolerance;
        c.tolerance = has(Knob::Tolerance).then(|| c.tolerance.unwrap_or(own_tolerance));
        c.method = match (c.method, self.closed_forms) {
            (method, _) if c.fidelity.kind().chooses() => method,
            (method, _) if !c.fidelity.kind().solves_alone() => method.together(),
            (Method::Auto, ClosedForms::All) => Method::Exact,
            (Method::Auto, ClosedForms::None) => Method::Panel,
            (method, _) => method,
        };
        c.faces_per_body = c.faces_per_body.filter(|n| !has_faces(self.scene, *n));
        c
    }
}

fn or_default<'a, T>(given: &'a [T], default: &'a [T]) -> &'a [T] {
    if given.is_empty() { default } else { given }
}

/// The order in which configurations are measured, so that what the budget has no time for matters
/// least: first what all else is varied around, then some of everything, and the expensive ones last.
pub(super) fn order(configurations: &[Configuration]) -> Vec<usize> {
    let mut out: Vec<usize> = (0..configurations.len()).collect();
    out.sort_by_key(|i| {
        let c = &configurations[*i];
        let expensive = c.fidelity == Fidelity::Full;
        // Faces left to the scene are usually the most.
        let faces = c.faces_per_body.unwrap_or(usize::MAX);
        let like = |d: &&Configuration| (d.family, d.fidelity) == (c.family, c.fidelity);
        let place = configurations[..*i].iter().filter(like).count();
        let faces = if expensive { faces } else { 0 };
        (c.family != Family::Base, expensive, faces, place)
    });
    out
}

/// Seconds that a configuration takes at least, guessed from the same with fewer faces.
pub(super) fn expected(configuration: &Configuration, rows: &[Option<TradeoffRow>]) -> f64 {
    let Some(faces) = configuration.faces_per_body else {
        return 0.0;
    };
    let known = rows.iter().flatten().filter_map(|row| {
        let (c, d) = (&row.configuration, configuration);
        let fewer = c.faces_per_body.filter(|f| *f < faces)?;
        let seconds = row.setup_seconds? + 1e-3 * row.ms_per_step?;
        ((c.fidelity, c.method) == (d.fidelity, d.method))
            .then(|| seconds * (faces as f64 / fewer as f64).powf(GROWTH))
    });
    known.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cheap_configurations_come_first() {
        let of = |family, fidelity| Configuration {
            family,
            fidelity,
            ..Configuration::default()
        };
        let (full, reduced) = (Fidelity::Full, Fidelity::Reduced);
        let plan = [
            of(Family::Base, full),
            of(Family::Base, reduced),
            of(Family::Method, full),
            of(Family::Faces, reduced),
            of(Family::Integrator, reduced),
            of(Family::Faces, reduced),
        ];
        assert_eq!(order(&plan), [1, 0, 3, 4, 5, 2]);
    }
}
