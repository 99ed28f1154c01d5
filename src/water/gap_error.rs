//! How far off the water across a gap is estimated to be, from what is known without solving anything.
//!
//! Three numbers tell most of it. With h the gap, e the length of the faces' edges there, R the radius of the relative curvature of both surfaces (from
//! the area over which they are near; without end between flat ones) and r the gap that compressed sources resolve, as far as the image behind a wall:
//!
//! ```text
//! q = h/r (2h/r to a wall), times (0.003/tolerance)^0.6       sources: the part of the force that they lose, or add between flat faces
//! s = e²/(8 R h)                                              films (of their own faces) and panels: how far the faces lie inside the surfaces, in the gap
//! R over the radius of the ball of equal volume               round, or flat
//! x = max(e, r)/(h + s)                                       a body of size s beside one much larger, whose faces or sources are coarse for it
//! e²/w²                                                       panels, of which few cover flat surfaces of the width w; e² is the product of both edges
//! ```
//!
//! The constants are fitted to `cargo bench --bench gap` (docs/accuracy-coupled.md), those of x to the cases of tests/water/gap_error.rs; by more than a factor of three they are not to fall under
//! the truth of either.

use serde::Serialize;
use strum::{Display, IntoStaticStr};

/// By what the water across a gap is carried.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Display, IntoStaticStr)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "lowercase")]
pub enum Carried {
    /// Compressed sources, as they are.
    Sources,
    /// Compressed sources or panels that are held apart, and a film in the gap.
    Film,
    /// Panels on the faces.
    Panels,
}

impl Carried {
    /// In words.
    pub(crate) fn by(self) -> &'static str {
        match self {
            Self::Sources => "compressed sources",
            Self::Film => "a film",
            Self::Panels => "panels",
        }
    }
}

/// Estimated errors of the water across a gap.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GapError {
    /// By what it is carried.
    pub carried: Carried,
    /// Of the added mass along the gap, relative.
    pub added_mass: f64,
    /// Of its slope along the gap, and so of the force, relative.
    pub force: f64,
}

/// What is known of a gap.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Across {
    /// m.
    pub gap: f64,
    /// Edges of the faces there, m: of the body with the longer ones.
    pub edge: f64,
    /// Edges of the faces that a film has there, m.
    pub film_edge: f64,
    /// Radius of the relative curvature, m.
    pub curvature: f64,
    /// Of the ball as large as the smaller body, m.
    pub size: f64,
    /// The area over which the surfaces are near, m².
    pub area: f64,
    /// The product of the edges that the faces there have on either side, m².
    pub edges: f64,
    /// Estimated error of the added mass of either body alone, relative; 0 where nothing tells it.
    pub own: f64,
    /// The gap, as far as the image behind a wall, over what compressed sources resolve.
    pub ratio: f64,
    /// Relative error that compression aims at.
    pub tolerance: f64,
    /// The gap from which on there is a film, m.
    pub reach: Option<f64>,
    /// Of the ball with as large a surface as the larger body, m; 0 at a wall.
    pub expanse: f64,
    /// The gap that compressed sources resolve there, m; 0 where there are none.
    pub resolved: f64,
}

/// Curvature of relative radius, in sizes: up to the first surfaces are round, from the second on flat.
const FLAT: [f64; 2] = [1.5, 4.5];
/// The tolerance at which what sources resolve was measured, and how their reach into gaps grows as it falls.
const TOLERANCE: f64 = 0.003;
const FINER: f64 = 0.6;
/// What sources lose of the force at the gap that they resolve, and the powers of the ratio by which they do below and above it.
const LOST: f64 = 0.085;
const BELOW: f64 = -1.0;
const ABOVE: f64 = -1.6;
/// The same between flat surfaces, where they add to it.
const ADDED: f64 = 0.3;
const ADDED_BELOW: f64 = -2.5;
const ADDED_ABOVE: f64 = -4.0;
/// The relative curvature, in sizes, of which that is; it goes with it.
const ADDED_AT: f64 = 7.0;
/// Of the force, by bodies that are solved alone, however wide the gap is.
const OWN: f64 = 0.005;
/// The part of what two meshes tell of a body alone that counts: they are cautious.
const CAUTIOUS: f64 = 0.15;
/// Most that an estimate says.
const MOST: f64 = 10.0;
/// Of the force through a film between round and between flat surfaces.
const FILM: [f64; 2] = [0.05, 0.04];
/// The same where panels are held apart, which are right in gaps that are narrower.
const FILM_OF_PANELS: [f64; 2] = [0.04, 0.05];
/// Of panels, and how it grows with both as faces lie further inside.
const PANELS: f64 = 0.01;
const FACETS: f64 = 0.13;
/// What panels between flat surfaces add below a tenth of an edge.
const THIN: f64 = 0.08;
/// Of the added mass between flat surfaces that few panels cover, by the product of both edges over the area.
const FEW: f64 = 0.5;
/// Parts of the force's error in that of the added mass: of round surfaces, and what flat ones add to it in a film.
const MASS: f64 = 0.1;
const MASS_FLAT: f64 = 0.5;

/// Sizes of the larger body, in those of the smaller one, between which what the larger one resolves begins to tell beside the gap.
const LARGER: [f64; 2] = [2.5, 4.5];
/// Of the force on a small body beside a large coarse one, by the square of how coarse it is, and the most of it.
const COARSE: f64 = 0.7;
const COARSE_MOST: f64 = 1.5;
/// The same through a film, by the first power, until it has closed: bodies are held apart no farther than gaps of their own size ask for.
const COARSE_FILM: f64 = 0.8;
/// Of its added mass then, which such films don't make up for, and the most of it.
const COARSE_MASS: f64 = 0.12;
const COARSE_MASS_MOST: f64 = 0.4;

/// 0 up to the first of two numbers, 1 from the second on, straight between them.
fn between(x: f64, [from, to]: [f64; 2]) -> f64 {
    ((x - from) / (to - from)).clamp(0.0, 1.0)
}

impl Across {
    /// 0 between round surfaces, 1 between flat ones.
    pub fn flatness(&self) -> f64 {
        between(self.curvature / self.size, FLAT)
    }

    /// Of the added mass of the bodies alone.
    fn alone(&self) -> f64 {
        (CAUTIOUS * self.own).max(OWN)
    }

    /// What the larger body resolves, by faces or sources, over how far the middle of the smaller one is (x above); 0 where they are of like sizes.
    fn coarse(&self) -> f64 {
        let larger = between(self.expanse / self.size, LARGER);
        larger * self.edge.max(self.resolved) / (self.gap + self.size)
    }

    /// By sources as they are.
    fn by_sources(&self) -> GapError {
        let q = self.ratio * (TOLERANCE / self.tolerance).powf(FINER);
        let lost = match q < 1.0 {
            true => LOST * q.powf(BELOW),
            false => LOST * q.powf(ABOVE),
        };
        let power = if q < 1.0 { ADDED_BELOW } else { ADDED_ABOVE };
        let added = ADDED * self.curvature / self.size / ADDED_AT * q.powf(power);
        let flat = self.flatness();
        let own = OWN + self.tolerance;
        let force = (own + (1.0 - flat) * lost / (1.0 + lost) + flat * added).min(MOST);
        GapError {
            carried: Carried::Sources,
            added_mass: self.alone() + self.tolerance + MASS * force,
            force,
        }
    }

    /// How far faces with such edges lie inside, in the gap; a fourth of the square of the edges over the width of the patch that the gap opens around.
    fn inside(&self, edge: f64) -> f64 {
        edge.powi(2) / (8.0 * self.curvature * self.gap)
    }

    /// By a film that has taken all over, of which so much is off between round and between flat surfaces.
    fn by_film(&self, film: [f64; 2]) -> GapError {
        let flat = self.flatness();
        let base = (1.0 - flat) * film[0] + flat * film[1];
        let force = base + FACETS * (4.0 * self.inside(self.film_edge)).ln_1p();
        GapError {
            carried: Carried::Film,
            added_mass: self.alone() + self.tolerance + (MASS + MASS_FLAT * flat) * force,
            force,
        }
    }

    /// By what there is without films, and one once the gap is so narrow: it takes over soon, by 1 − (h/h_m)³.
    fn taken_over(&self, without: GapError, film: GapError) -> GapError {
        let Some(reach) = self.reach.filter(|reach| self.gap < *reach) else {
            return self.beside_coarse(without);
        };
        let (without, film) = (self.beside_coarse(without), self.beside_coarse(film));
        let left = (self.gap / reach).powi(3);
        let mix = |film: f64, without: f64| film + left * (without - film);
        GapError {
            carried: Carried::Film,
            added_mass: mix(film.added_mass, without.added_mass),
            force: mix(film.force, without.force),
        }
    }

    /// With what a small body loses beside one whose faces or sources are coarse for it.
    fn beside_coarse(&self, mut error: GapError) -> GapError {
        let coarse = self.coarse();
        let (mass, force) = match (error.carried, self.reach) {
            (Carried::Film, Some(reach)) => (
                (COARSE_MASS * coarse).min(COARSE_MASS_MOST),
                COARSE_FILM * coarse.min(1.0) * self.gap / reach,
            ),
            _ => {
                let force = (COARSE * coarse.powi(2)).min(COARSE_MOST);
                (MASS * force, force)
            }
        };
        error.added_mass += mass;
        error.force = (error.force + force).min(MOST);
        error
    }

    /// By what compressed bodies have there.
    pub fn compressed(&self) -> GapError {
        self.taken_over(self.by_sources(), self.by_film(FILM))
    }

    /// By what coupled panels have there.
    pub fn coupled(&self) -> GapError {
        let mut error = self.taken_over(self.by_panels(), self.by_film(FILM_OF_PANELS));
        // From a gap as wide as the area on there is little to lose.
        let open = 1.0 + self.gap.powi(2) / self.area.max(self.edges);
        let few = self.flatness() * FEW * (self.edges / self.area).min(1.0) / open;
        error.added_mass += few;
        error.force = (error.force + few / (MASS + MASS_FLAT)).min(MOST);
        error
    }

    /// By panels.
    fn by_panels(&self) -> GapError {
        let flat = self.flatness();
        let thin = 0.1 * self.edge / self.gap;
        let force = PANELS
            + FACETS * (2.0 * self.inside(self.edge)).ln_1p()
            + flat * THIN * thin / (1.0 + thin);
        GapError {
            carried: Carried::Panels,
            added_mass: self.alone() + (MASS + MASS_FLAT * flat) * force,
            force,
        }
    }
}
