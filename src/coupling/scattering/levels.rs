//! How finely the exchange is cut into levels, for an accuracy.

use super::Apart;
use crate::{Error, Result};

/// Relative residual at which solves end: what gradients are held against is finer than any level.
const TOLERANCE: f64 = 1e-11;

/// Levels of the exchange between many bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Levels {
    /// Highest degree of the moments' products: 2 is dipoles with dipoles.
    pub degree: usize,
    /// From where on the moments of two bodies stand for their points.
    pub bodies: Apart,
    /// From where on those of two cells do, of which one holds several bodies: what is left out differs in sign from body to body.
    pub cells: Apart,
    /// Relative residual at which solves end.
    pub tolerance: f64,
}

impl Levels {
    /// For an error of the coupling of `accuracy`, relative to the bodies' own added mass.
    ///
    /// # Errors
    /// [`Error::Input`] for an accuracy that isn't between 0 and 1.
    pub fn for_accuracy(accuracy: f64) -> Result<Self> {
        if !(accuracy > 0.0 && accuracy < 1.0) {
            return Err(Error::input(
                "settings: accuracy",
                accuracy,
                "a number between 0 and 1, such as 0.01",
            ));
        }
        // Two dipoles whose points reach half way to each other's are worth an eighth of what is left of each degree more.
        let degree = match accuracy {
            a if a >= 0.02 => 3,
            a if a >= 5e-3 => 4,
            a if a >= 1e-3 => 6,
            a if a >= 1e-4 => 8,
            _ => 10,
        };
        let env = |n: &str, d: f64| {
            std::env::var(n)
                .ok()
                .and_then(|x| x.parse().ok())
                .unwrap_or(d)
        };
        let degree = env("DEG", degree as f64) as usize;
        let most = env("THETA", 0.4);
        Ok(Self {
            degree,
            bodies: Apart {
                sure: 0.9 * most,
                most,
            },
            cells: Apart {
                sure: 0.9 * env("THETA2", 0.5),
                most: env("THETA2", 0.5),
            },
            tolerance: env("TOL", TOLERANCE),
        })
    }

    pub(super) fn of(&self, bodies: bool) -> &Apart {
        match bodies {
            true => &self.bodies,
            false => &self.cells,
        }
    }
}
