//! How what bodies exchange with each other is computed: by a factor of all of it, or by products alone.

use crate::scene::Scene;

/// Bodies from which on products alone are faster (`cargo bench --bench bodies`).
pub(super) const MANY: usize = 24;

choices! {
    /// How compressed bodies are coupled.
    pub enum Exchange {
        /// By products where that is faster, and everything in the scene takes them.
        #[default]
        Auto,
        /// By a factor of the whole exchange, cubic in the number of bodies.
        Factor,
        /// By products alone, about linear in it: near bodies by their points, groups of far ones by moments.
        Products,
    }
}

impl Exchange {
    /// Whether it will be by products as far as the scene alone tells, `steps` being whether the integrator needs no matrix: for what a scene takes.
    pub(crate) fn expected(self, scene: &Scene, steps: bool) -> bool {
        match self {
            Exchange::Factor => false,
            Exchange::Products => true,
            Exchange::Auto => steps && scene.walls.is_empty() && scene.bodies.len() >= MANY,
        }
    }
}
