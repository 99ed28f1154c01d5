//! The gaps in which viscous water acts.

use crate::Result;
use crate::coupling::lubrication::{Bearing, BearingSurface};
use crate::dynamics::force::Lubricated;
use crate::geometry::{Opposite, Other, Wall, WallSurface};
use crate::scene::Scene;
use crate::water::{Clearance, Surface};
use std::sync::Arc;

/// Both sides that a body's surface may be of a bearing, made once.
struct Sides<'s> {
    scene: &'s Scene,
    surfaces: &'s [Option<Surface>],
    made: Vec<Option<(Arc<BearingSurface>, Arc<Opposite>)>>,
    walls: Vec<Arc<Opposite>>,
}

impl<'s> Sides<'s> {
    fn new(scene: &'s Scene, surfaces: &'s [Option<Surface>]) -> Result<Self> {
        let walls = scene.walls.iter().enumerate();
        let wall = |(w, wall): (usize, &Wall)| Ok(Arc::new(Opposite::of_wall(wall.half_space(w)?)));
        Ok(Self {
            scene,
            surfaces,
            made: vec![None; surfaces.len()],
            walls: walls.map(wall).collect::<Result<_>>()?,
        })
    }

    fn of(&mut self, b: usize) -> Option<(Arc<BearingSurface>, Arc<Opposite>)> {
        if self.made[b].is_none() {
            let surface = self.surfaces[b].as_ref()?;
            let (mesh, solid) = (&surface.mesh, surface.solid.as_ref());
            let opposite = Opposite::of_body(solid, mesh);
            let own = BearingSurface::new(mesh, solid);
            self.made[b] = Some((Arc::new(own), Arc::new(opposite)));
        }
        self.made[b].clone()
    }

    /// The bodies, of which the first is the smaller one, and their bearing.
    fn between(
        &mut self,
        first: usize,
        second: Other,
        reach: Option<f64>,
    ) -> Option<(usize, Option<usize>, Bearing)> {
        let own = self.of(first)?;
        let (first, second, surface, opposite) = match second {
            Other::Wall(w) => {
                // A free surface gives way.
                if self.scene.walls[w].surface == WallSurface::Free {
                    return None;
                }
                (first, None, own.0, self.walls[w].clone())
            }
            Other::Body(b) => {
                let other = self.of(b)?;
                match own.0.size <= other.0.size {
                    true => (first, Some(b), own.0, other.1),
                    false => (b, Some(first), other.0, own.1),
                }
            }
        };
        let reach = reach.unwrap_or(0.5 * surface.size);
        let bearing = Bearing {
            surface,
            opposite,
            reach,
        };
        Some((first, second, bearing))
    }
}

/// The gaps of all forces of viscous water in the scene.
pub(super) fn lubricated(
    scene: &Scene,
    surfaces: &[Option<Surface>],
    clearance: &Clearance,
) -> Result<Vec<Lubricated>> {
    let mut out = Vec::new();
    let mut sides = Sides::new(scene, surfaces)?;
    let carriers = scene.carriers();
    for (force, lubrication) in scene.lubrications() {
        for (a, other) in clearance.moving.pairs() {
            if let Other::Body(b) = other
                && carriers.are_neighbours(a, b)
            {
                continue;
            }
            let both = [Some(a), matching(other)].into_iter().flatten();
            let names: Vec<&str> = both.map(|b| scene.bodies[b].name.as_str()).collect();
            if lubrication.acts_between(&names)
                && let Some((first, second, bearing)) = sides.between(a, other, lubrication.reach)
            {
                out.push(Lubricated {
                    force,
                    first,
                    second,
                    bearing,
                });
            }
        }
    }
    Ok(out)
}

fn matching(other: Other) -> Option<usize> {
    match other {
        Other::Body(b) => Some(b),
        Other::Wall(_) => None,
    }
}

/// The bearing of one gap, as a force of that reach (m; by default the bodies' own) would have it, and its bodies.
pub(crate) fn bearing(
    scene: &Scene,
    surfaces: &[Option<Surface>],
    (first, second): (usize, Other),
    reach: Option<f64>,
) -> Result<Option<(usize, Option<usize>, Bearing)>> {
    Ok(Sides::new(scene, surfaces)?.between(first, second, reach))
}
