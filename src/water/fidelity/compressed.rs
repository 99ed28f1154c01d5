//! Bodies compressed to a few sources, and how these change with shapes.

use super::finer;
use super::isolated::alone_slopes;
use crate::adjoint::lie::{Pose, Vec3};
use crate::coupling::reduced::{ReducedBody, Region, ShapeSlope, cache, compress};
use crate::geometry::TriMesh;
use crate::water::method::kind::{BodyMethod, Problem, Solved};
use crate::water::numerics::Numerics;
use crate::water::shape::ShapeChange;
use crate::water::submerged::SubmergedBody;
use crate::water::surface::Coarse;
use crate::{Error, Result};
use std::sync::Arc;

/// Steps of the grid, relative to the body's size, on which lengths are compared.
const GRID: f64 = (1u64 << 30) as f64;

/// Size over thickness from which on a body isn't compressed: rounding to the grid would bend it, and points as far apart as it is thick would be
/// too many.
const SLENDER: f64 = 1e5;

/// Refuses a body of this size (m) that is too thin for it.
fn refuse_slender(name: &str, mesh: &TriMesh, size: f64) -> Result<()> {
    let thickness = 2.0 * mesh.mass_properties().volume / mesh.surface_area();
    let slender = size / thickness;
    if slender <= SLENDER {
        return Ok(());
    }
    Err(Error::Unresolved {
        place: format!("body {name:?}"),
        quantity: "size over thickness (radius of the ball around it over 2 volume/area)".into(),
        value: slender,
        limit: SLENDER,
        remedy: "a body so slender isn't compressed: use the fidelity full or isolated, or make it thicker".into(),
    })
}

/// A body in units of its own size, with lengths rounded to [`GRID`]: bodies of the same shape are then equal whatever their size, to the last bit.
struct InUnits<'a> {
    name: &'a str,
    /// m.
    size: f64,
    mesh: TriMesh,
    coarse: Option<Coarse>,
    ellipsoid: Option<([f64; 3], Pose)>,
    regions: Vec<Region>,
    settings: compress::CompressSettings,
    numerics: Numerics,
    /// The smallest gap that it resolves anywhere.
    finest: f64,
    /// How often its edges are halved for what it is fitted to.
    halved: usize,
}

impl<'a> InUnits<'a> {
    fn new(
        body: &SubmergedBody<'a>,
        method: &'static dyn BodyMethod,
        chosen: &compress::CompressSettings,
        numerics: &Numerics,
    ) -> Result<Self> {
        chosen.validate()?;
        let mesh = method.layout(body)?;
        let size = mesh.bounding_ball().radius;
        let round = |x: f64| (x / size * GRID).round() / GRID;
        refuse_slender(body.name, &mesh, size)?;
        let unit = |mesh: &TriMesh| {
            let rounded = mesh.rounded(round);
            rounded.map_err(|e| e.of(&format!("body {:?}, in units of its size", body.name)))
        };
        let mesh = unit(&mesh)?;
        let coarse = body.coarse.map(|c| {
            let mesh = unit(&c.mesh)?;
            Ok::<_, Error>(Coarse { mesh, ..*c })
        });
        let coarse = coarse.transpose()?;
        let ellipsoid = body.ellipsoid.map(|(axes, pose)| {
            let at = Pose::new(pose.rotation, pose.translation.map(round));
            (axes.map(round), at)
        });
        let gap = chosen.resolved_gap.map(round);
        let (volume, area) = (mesh.mass_properties().volume, mesh.surface_area());
        let thin = compress::usual_gap(volume, area);
        let gap = gap.unwrap_or_else(|| compress::default_gap(volume, area));
        let regions: Vec<Region> = (body.regions.iter())
            .map(|r| Region {
                center: r.center.map(round),
                radius: round(r.radius),
                gap: round(r.gap),
            })
            .collect();
        let everywhere = gap.max(compress::finest_gap(mesh.surface_area()));
        Ok(Self {
            name: body.name,
            size,
            finest: regions.iter().map(|r| r.gap).fold(everywhere, f64::min),
            halved: finer::halvings(method, &mesh, everywhere.min(thin)),
            mesh,
            coarse,
            ellipsoid,
            regions,
            settings: compress::CompressSettings {
                resolved_gap: Some(gap),
                ..*chosen
            },
            numerics: numerics.in_units_of(size),
        })
    }

    fn body(&self) -> SubmergedBody<'_> {
        SubmergedBody {
            name: self.name,
            mesh: Some(&self.mesh),
            ellipsoid: self.ellipsoid,
            solid: None,
            coarse: self.coarse.as_ref(),
            added_mass: None,
            regions: Vec::new(),
        }
    }

    /// What it answers.
    fn response(&self, method: &dyn BodyMethod) -> Solved {
        let resolved = (self.finest, self.halved);
        finer::response(method, &self.body(), &self.numerics, resolved)
    }

    /// With a shape parameter changed by `t`, m; the faces stay.
    fn changed(&self, change: &ShapeChange, t: f64) -> Self {
        let moved = |mesh: &TriMesh| {
            let velocities: Vec<Vec3> = (mesh.vertices().iter())
                .map(|p| units_velocity(change, self.size, p))
                .collect();
            mesh.displaced(&velocities, t)
        };
        let ellipsoid = self.ellipsoid.map(|(axes, pose)| {
            let axes = change
                .semi_axes(t)
                .map(|axes| axes.map(|x| x / self.size))
                .unwrap_or(axes);
            (axes, pose)
        });
        Self {
            mesh: moved(&self.mesh),
            coarse: self.coarse.as_ref().map(|c| Coarse {
                mesh: moved(&c.mesh),
                ..*c
            }),
            ellipsoid,
            regions: self.regions.clone(),
            ..*self
        }
    }
}

/// The body compressed, from the cache if it is there.
pub(super) fn compressed_body(
    problem: &Problem,
    body: &SubmergedBody,
    method: &'static dyn BodyMethod,
    chosen: &compress::CompressSettings,
) -> Result<cache::Fetched> {
    let own = InUnits::new(body, method, chosen, problem.numerics)?;
    let made_from = (method.made_from(&own.body(), &own.numerics), own.halved);
    let key = cache::Key::new(&own.mesh, &made_from, &own.settings, &own.regions);
    let found = cache::fetch(key, problem.folder, || {
        let response = own.response(method)?;
        let (settings, regions) = (&own.settings, &own.regions);
        compress::compress(body.name, &own.mesh, response.as_ref(), settings, regions)
    });
    let (found, warning) = found.map_err(|e| e.in_units_of(own.size))?;
    Ok((Arc::new(found.scaled(own.size)?), warning))
}

/// Part of a length by which a shape is changed to see how its compression changes: the differences err by its square.
const STEP: f64 = 1e-3;

/// How the compressed bodies change with the shape parameters, each with its body.
///
/// # Errors
/// Vertices of a mesh, along which nothing but the mesh is known to move.
pub(super) fn shape_slopes(
    problem: &Problem,
    made: &[Arc<ReducedBody>],
) -> Result<Vec<(usize, ShapeSlope)>> {
    let mut out: Vec<(usize, ShapeSlope)> = Vec::with_capacity(problem.changes.len());
    let groups: Vec<_> = problem.changes.chunk_by(|a, b| a.0 == b.0).collect();
    for (n, group) in groups.iter().enumerate() {
        let b = group[0].0;
        let body = &problem.bodies[b];
        // Equal bodies follow their shapes alike.
        let same = |of: &&[(usize, &ShapeChange)]| {
            let asked = |g: &[(usize, &ShapeChange)]| -> Vec<(String, f64)> {
                g.iter().map(|(_, c)| (c.name.clone(), c.value)).collect()
            };
            let a = of[0].0;
            problem.bodies[a].equal(body)
                && problem.chosen(a) == problem.chosen(b)
                && asked(of) == asked(group)
        };
        if let Some(first) = groups[..n].iter().position(same) {
            let from: usize = groups[..first].iter().map(|g| g.len()).sum();
            let known = out[from..from + group.len()].to_vec();
            out.extend(known.into_iter().map(|(_, slope)| (b, slope)));
            continue;
        }
        let method = problem.method_for(body)?;
        let units = InUnits::new(body, method, problem.chosen(b), problem.numerics)?;
        let (size, own) = (units.size, alone_slopes(problem, body, group)?);
        let moving: Vec<_> = group
            .iter()
            .map(|(_, change)| move |p: &Vec3| units_velocity(change, size, p))
            .collect();
        if let Some((_, change)) = group
            .iter()
            .find(|(_, c)| c.velocity(&Vec3::zeros()).is_none())
        {
            return Err(Error::Unsupported {
                what: format!("shape parameter {:?} of body {:?} with the fidelity reduced", change.name, body.name),
                why: "a compressed body follows shapes by formula and the scale of meshes; of a single vertex it isn't known how the sources inside move".into(),
                instead: "use the fidelity isolated, or full by panels".into(),
            });
        }
        let answering: Vec<_> = group
            .iter()
            .map(|(_, change)| {
                let units = &units;
                move |t: f64| units.changed(change, t).response(method)
            })
            .collect();
        let each = group.iter().zip(&moving).zip(&answering).zip(own);
        let steps: Vec<_> = each
            .map(
                |((((_, change), velocity), response), added_mass)| compress::ShapeStep {
                    step: STEP * change.size,
                    velocity,
                    response,
                    added_mass,
                },
            )
            .collect();
        let response = units.response(method)?;
        let (settings, regions) = (&units.settings, &units.regions);
        let points = made[b].parts().points.iter();
        let points: Vec<Vec3> = points.map(|p| p / size).collect();
        let made = compress::slopes(
            body.name,
            &units.mesh,
            &points,
            response.as_ref(),
            settings,
            regions,
            &steps,
        );
        let made = made.map_err(|e| e.in_units_of(size))?;
        out.extend(made.into_iter().map(|slope| (b, slope.scaled(size))));
    }
    Ok(out)
}

/// Velocity of a point in units of a body's size, per unit of the parameter.
fn units_velocity(change: &ShapeChange, size: f64, p: &Vec3) -> Vec3 {
    change.velocity(&(p * size)).unwrap_or_else(Vec3::zeros) / size
}
