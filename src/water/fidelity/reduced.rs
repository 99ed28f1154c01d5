//! All bodies coupled, each compressed to a few sources.

use super::compressed::{compressed_body, shape_slopes};
use super::finer;
use super::kind::{FidelityKind, Knob};
use crate::Result;
use crate::boundary::Response;
use crate::coupling::film::Films;
use crate::coupling::reduced::{self, ReducedBody, Region};
use crate::geometry::{Gap, Solid, TriMesh};
use crate::water::device::Device;
use crate::water::gap_error::Carried;
use crate::water::method::kind::Problem;
use crate::water::numerics::Numerics;
use crate::water::products;
use crate::water::submerged::{Discretisation, Made, SubmergedBody};
use std::sync::Arc;

/// Multiple scattering between a few sources a body, walls as images.
pub(super) struct Reduced;

impl FidelityKind for Reduced {
    fn knobs(&self) -> &'static [Knob] {
        &[Knob::Rank, Knob::ResolvedGap, Knob::Accuracy, Knob::Films]
    }

    fn aim(&self, numerics: &Numerics) -> Option<f64> {
        Some(numerics.compress.tolerance)
    }

    fn compresses(&self) -> bool {
        true
    }

    fn couple(&self, problem: &Problem, device: &mut Device) -> Result<Made> {
        if problem.products {
            return many(problem, device);
        }
        let (coupling, unkept) = compressed(problem)?;
        let as_made = as_made(problem, coupling.reduced_bodies())?;
        let slopes = shape_slopes(problem, coupling.reduced_bodies())?;
        let own_rates = slopes
            .iter()
            .map(|(b, slope)| (*b, slope.added_mass))
            .collect();
        let coupling = coupling.with_shapes(slopes)?;
        let made = coupling.reduced_bodies();
        let films = coupling.films().clone();
        device.films = !films.is_empty();
        Ok(Made {
            own: problem.own(|b| Ok(made[b].parts().added_mass))?,
            own_rates,
            carried: Some(Carried::Sources),
            films,
            warnings: [warnings(problem, made), unkept].concat(),
            bodies: problem.named(as_made),
            coupling: device.reduced(coupling)?,
        })
    }

    fn resolved_gap(&self, compressed: f64, _: f64) -> f64 {
        compressed
    }

    // It is said by its estimated error.
    fn gap_warning(&self, _: &Gap, _: f64, _: &str, _: &str, _: &str) -> Option<String> {
        None
    }

    fn error(&self, bodies: f64, residual: Option<f64>, _: Option<f64>) -> Option<f64> {
        Some(bodies + residual?)
    }
}

/// What each body became.
fn as_made(problem: &Problem, made: &[Arc<ReducedBody>]) -> Result<Vec<Discretisation>> {
    let each = made.iter().zip(problem.bodies);
    let of = |(m, body): (&Arc<ReducedBody>, &SubmergedBody)| {
        let fit = &m.parts().fit;
        Ok(Discretisation {
            method: problem.method_for(body)?.label(),
            faces: body.mesh.map_or(0, |m| m.faces().len()),
            unknowns: m.modes(),
            points: m.points(),
            resolved_gap: Some(fit.resolved_gap),
            resolved_regions: fit.regions.clone(),
            asymmetry: fit.body_asymmetry,
            added_mass_error: fit.body_error,
            radiated_error: fit.radiated,
            scattered_error: fit.scattered,
            ..Discretisation::default()
        })
    };
    each.map(of).collect()
}

/// All bodies coupled by products.
fn many(problem: &Problem, device: &mut Device) -> Result<Made> {
    let (made, unkept) = compressed_bodies(problem)?;
    let films = match film_surfaces(problem)? {
        None => Films::default(),
        Some((surfaces, tolerances)) => {
            let mut films = reduced::films::films(&made, &surfaces, &tolerances, problem.walls)?;
            films.exclude(&problem.excluded);
            films
        }
    };
    Ok(Made {
        own: problem.own(|b| Ok(made[b].parts().added_mass))?,
        own_rates: Vec::new(),
        carried: Some(Carried::Sources),
        warnings: [warnings(problem, &made), unkept].concat(),
        bodies: problem.named(as_made(problem, &made)?),
        coupling: Box::new(products::scattering(problem, made, films.clone(), device)?),
        films,
    })
}

/// All bodies compressed and coupled.
pub(in crate::water) fn compressed_all(problem: &Problem) -> Result<reduced::Reduced> {
    Ok(compressed(problem)?.0)
}

/// The bodies compressed, with what the user should know of those that couldn't be kept.
fn compressed_bodies(problem: &Problem) -> Result<(Vec<Arc<ReducedBody>>, Vec<String>)> {
    let bodies = problem.bodies;
    let mut made: Vec<Arc<ReducedBody>> = Vec::with_capacity(bodies.len());
    let mut unkept: Vec<String> = Vec::new();
    // The first of each kind.
    let mut kinds: Vec<usize> = Vec::new();
    for (b, body) in bodies.iter().enumerate() {
        let same = |a: &&usize| {
            let equal = problem.chosen(**a) == problem.chosen(b);
            equal && bodies[**a].equal(body)
        };
        if let Some(a) = kinds.iter().find(same) {
            made.push(made[*a].clone());
            continue;
        }
        let method = problem.method_for(body)?;
        let (body, warning) = compressed_body(problem, body, method, problem.chosen(b))?;
        made.push(body);
        kinds.push(b);
        // One folder, one reason.
        if unkept.is_empty() {
            unkept.extend(warning);
        }
    }
    Ok((made, unkept))
}

/// The bodies coupled by a factor, with what the user should know of those that couldn't be kept.
fn compressed(problem: &Problem) -> Result<(reduced::Reduced, Vec<String>)> {
    let (bodies, plan) = (problem.bodies, problem.plan);
    let (made, unkept) = compressed_bodies(problem)?;
    let cutoff = |a: usize, b: usize| {
        let pair = (a.min(b), a.max(b));
        let found = plan.cutoffs.iter().find(|(p, _)| *p == pair);
        found.map(|(_, cutoff)| *cutoff)
    };
    let names = bodies.iter().map(|b| b.name.to_string());
    let mut coupling = reduced::Reduced::new(made, problem.walls, cutoff)?.named(names);
    if let Some((surfaces, tolerances)) = film_surfaces(problem)? {
        coupling = coupling.with_films(&surfaces, &tolerances, problem.walls)?;
    }
    Ok((coupling.excluding(&problem.excluded)?, unkept))
}

/// Surfaces and tolerances.
type FilmSurfaces<'p> = (Vec<(&'p TriMesh, Option<&'p Solid>)>, Vec<f64>);

/// What films are made of, one a body, where there may be any.
fn film_surfaces<'p>(problem: &Problem<'p>) -> Result<Option<FilmSurfaces<'p>>> {
    if !problem.numerics.films {
        return Ok(None);
    }
    let mut surfaces = Vec::with_capacity(problem.bodies.len());
    for body in problem.bodies {
        // Finer faces in regions are for the sources; the film's potential is smooth.
        let mesh = body.surface("the fidelity reduced")?;
        let coarse = body.coarse.filter(|_| !body.regions.is_empty());
        surfaces.push((coarse.map_or(mesh, |c| &c.mesh), body.solid));
    }
    let tolerances = (0..surfaces.len()).map(|b| problem.tolerance(b));
    Ok(Some((surfaces, tolerances.collect())))
}

/// What each body answers by its own method; bodies that are equal share one. Sources as near as the first of
/// `resolved` (m, one a body) are resolved where the method has to know, with edges halved so many times.
pub(in crate::water) fn responses(
    problem: &Problem,
    resolved: &[(f64, usize)],
) -> Result<Vec<Arc<dyn Response>>> {
    let bodies = problem.bodies;
    let mut out: Vec<Arc<dyn Response>> = Vec::with_capacity(bodies.len());
    for (b, body) in bodies.iter().enumerate() {
        let same = |a: &usize| bodies[*a].equal(body) && resolved[*a] == resolved[b];
        out.push(match (0..b).find(same) {
            Some(a) => out[a].clone(),
            None => {
                let method = problem.method_for(body)?;
                let made = finer::response(method, body, problem.numerics, resolved[b])?;
                Arc::from(made)
            }
        });
    }
    Ok(out)
}

/// Part of the flow that a body throws back, at points not fitted to, that compression may leave out before the user is told: the default leaves a
/// quarter at the nearest points, worth 0.3 % of the added mass; beyond this it is several per cent.
const MISSED: f64 = 0.6;

/// How far, as a factor, compression may stay behind the accuracy that it aims at before the user is told.
const SHORT: f64 = 2.0;

/// What the user should know of compressed bodies.
fn warnings(problem: &Problem, made: &[Arc<ReducedBody>]) -> Vec<String> {
    let (bodies, mut out) = (problem.bodies, Vec::new());
    for (b, (body, made)) in bodies.iter().zip(made).enumerate() {
        // Of equal bodies that are compressed alike one is enough.
        let same = |a: usize| problem.chosen(a) == problem.chosen(b) && bodies[a].equal(body);
        if (0..b).any(same) {
            continue;
        }
        let parts = made.parts();
        let size = parts.radius;
        let said = parts.fit.warnings.iter();
        out.extend(said.map(|w| {
            let name = &body.name;
            format!("body {name:?}: {w} (lengths of this message in units of {size:.3e} m)")
        }));
        let got = parts.fit.resolved_gap;
        let missed = parts.fit.scattered.max(parts.fit.radiated);
        if missed > MISSED {
            out.push(format!(
                "body {:?}: its {} compressed sources leave {} of its flow at the smallest gap that they \
                 were fitted for: use a higher rank, or the tolerance instead",
                body.name,
                parts.points.len(),
                match missed < 1.0 {
                    true => format!("{:.0} %", 100.0 * missed),
                    false => "more than all".into(),
                }
            ));
        }
        let chosen = problem.chosen(b);
        let reached = parts.fit.reached;
        if chosen.rank.is_none() && reached > SHORT * chosen.tolerance {
            out.push(format!(
                "body {:?}: its {} compressed sources reach an accuracy of {reached:.1e} at the smallest gap that they were fitted for, for {:.1e} asked \
                 for: there is no room for more of them; use the fidelity full",
                body.name,
                parts.points.len(),
                chosen.tolerance
            ));
        }
        if let Some(asked) = chosen.resolved_gap.filter(|a| *a < 0.98 * got) {
            out.push(format!(
                "body {:?}: gaps under {got:.3e} m aren't resolved by its compressed sources, for all \
                 that {asked:.3e} m were asked for: compression spreads no more points than that needs over a whole body; `refine` it where gaps \
                 close, or use the fidelity full",
                body.name
            ));
        }
        for asked in &body.regions {
            let same = |r: &&Region| (r.center - asked.center).norm() < ASIDE * size;
            let of = |r: &Region| (r.radius - asked.radius).abs() < ASIDE * size;
            let found = parts.fit.regions.iter().filter(same).find(|r| of(r));
            // A ball that resolves no more than the rest of the body does is left out of the fit.
            let got = found.map_or(got, |r| r.gap);
            if asked.gap < 0.98 * got {
                out.push(format!(
                    "body {:?}: within {:.3e} m of ({:.3e}, {:.3e}, {:.3e}), where `refine` asks for edges of {:.3e} m, gaps under {:.3e} m \
                     aren't resolved by its compressed sources, for the ball is too large: a smaller one resolves {:.3e} m",
                    body.name,
                    asked.radius,
                    asked.center.x,
                    asked.center.y,
                    asked.center.z,
                    2.0 * asked.gap,
                    got,
                    asked.gap
                ));
            }
        }
    }
    out
}

/// Part of a body's size within which regions are the same: they are compressed in rounded lengths.
const ASIDE: f64 = 1e-6;
