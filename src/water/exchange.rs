//! How what bodies exchange with each other is computed: by a factor of all of it, or by products alone.

use crate::scene::Scene;

/// Bodies from which on products alone are faster (`cargo bench --bench bodies`).
const MANY: usize = 24;

/// Whether products are faster for so many bodies between so many walls, each of which doubles what is summed.
pub(super) fn faster(bodies: usize, walls: usize) -> bool {
    let walls = u32::try_from(walls).unwrap_or(u32::MAX);
    bodies >= MANY.saturating_mul(2_usize.saturating_pow(walls))
}

choices! {
    /// How compressed bodies are coupled.
    pub enum Exchange {
        /// By products from 24 bodies on, twice as many with each wall; by the factor where shapes are parameters.
        #[default]
        Auto,
        /// By a factor of the whole exchange, cubic in the number of bodies.
        Factor,
        /// By products alone, about linear in it: near bodies by their points, groups of far ones by moments; with the backend gpu all by their points.
        Products,
    }
}

impl Exchange {
    /// Whether it will surely be by products as far as the scene tells.
    pub(crate) fn expected(self, scene: &Scene) -> bool {
        match self {
            Exchange::Factor => false,
            Exchange::Products => true,
            Exchange::Auto => faster(scene.bodies.len(), scene.walls.len()),
        }
    }
}
