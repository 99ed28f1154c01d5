//! How what bodies exchange with each other is computed: by a factor of all of it, or by products alone.

use crate::scene::{Body, Scene};

/// Bodies from which on products alone are faster (`cargo bench --bench bodies`).
pub(super) const MANY: usize = 24;

choices! {
    /// How compressed bodies are coupled.
    pub enum Exchange {
        /// By products from 24 bodies on where the scene and the integrator take them. Films don't act then, and flow, pressure and sensors aren't told.
        #[default]
        Auto,
        /// By a factor of the whole exchange, cubic in the number of bodies.
        Factor,
        /// By products alone, about linear in it: near bodies by their points, groups of far ones by moments.
        Products,
    }
}

impl Exchange {
    /// Whether it will surely be by products as far as the scene tells, `steps` being whether nothing asks for the matrix of inertia: for what a scene takes.
    pub(crate) fn expected(self, scene: &Scene, steps: bool) -> bool {
        let plain = |b: &Body| b.mimic.is_none() && b.added_mass.is_none();
        let takes = steps && scene.walls.is_empty() && scene.bodies.iter().all(plain);
        match self {
            Exchange::Factor => false,
            Exchange::Products => takes,
            Exchange::Auto => takes && scene.bodies.len() >= MANY,
        }
    }
}
