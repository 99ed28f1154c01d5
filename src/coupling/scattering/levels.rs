//! How finely the exchange is cut into levels, for an accuracy.

use crate::adjoint::multipole::Number;
use crate::coupling::fade::fade;
use crate::{Error, Result};

/// Relative residual at which solves end: what gradients are held against is finer than any level.
const TOLERANCE: f64 = 1e-10;
/// Of the ratio from which on moments don't stand for points, the part up to which they do so alone.
const SURE: f64 = 0.9;

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
        let (degree, bodies, cells) = match accuracy {
            a if a >= 0.03 => (4, 0.4, 0.5),
            a if a >= 0.01 => (5, 0.4, 0.5),
            a if a >= 3e-3 => (6, 0.4, 0.5),
            a if a >= 1e-3 => (7, 0.4, 0.5),
            a if a >= 3e-4 => (8, 0.4, 0.45),
            a if a >= 1e-4 => (9, 0.4, 0.45),
            _ => (10, 0.35, 0.4),
        };
        let apart = |most: f64| Apart {
            sure: SURE * most,
            most,
        };
        Ok(Self {
            degree,
            bodies: apart(bodies),
            cells: apart(cells),
            tolerance: TOLERANCE,
        })
    }

    pub(super) fn of(&self, bodies: bool) -> &Apart {
        match bodies {
            true => &self.bodies,
            false => &self.cells,
        }
    }
}

/// Sum of the radii over the distance up to which two cells are seen by their moments alone, and from which on not at all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Apart {
    /// Up to which by moments alone.
    pub sure: f64,
    /// From which on not at all.
    pub most: f64,
}

impl Apart {
    /// Weight of the moments, with its slope: 1 up to `sure`, 0 from `most` on, three derivatives smooth at both.
    pub(super) fn weight<T: Number>(&self, ratio: T) -> [T; 2] {
        let width = self.most - self.sure;
        let [value, slope] = fade((ratio - T::constant(self.sure)) * (1.0 / width));
        [value, slope * (1.0 / width)]
    }
}
