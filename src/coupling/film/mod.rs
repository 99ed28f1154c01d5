//! Films: the water in a gap that is narrow against the bodies.
//!
//! In a thin gap the flow runs along it. With the potential ψ over the film, its thickness H, and what both surfaces push into it,
//!
//! ```text
//! div(H ∇ψ) = −flux,      ψ = 0 in the open,      E = ½ ρ ∫ H |∇ψ|² dA = ½ ρ vᵀ K v,      K = bᵀ A⁻¹ b
//! δ(vᵀ K v) = −ψᵀ δA ψ                                                     stationary: no adjoint solve
//! ```
//!
//! where v are the twists of both bodies, each of which pushes along its own normals. It is solved on one body's own faces by linear elements, so that nothing is meshed at run time: a vertex is as
//! far as the exact distance to what is opposite, H is the length of the arc that meets both surfaces at right angles, and what that distance does along a
//! face says at which angle they stand. Along the side of a block over a wall H then is π/2 times the height, which is the flow into a quarter of the
//! plane: rims need nothing of their own.
//!
//! A coupling that doesn't resolve a gap h is asked for one that is held apart, with the floor h₀ below the reach h_m,
//!
//! ```text
//! h_f = h + h₀ (1 − h/h_m)³,      M(h) = M_coupling(h_f) + K(h) − K(h_f)
//! ```
//!
//! twice continuously differentiable as the gap opens and closes. With more than a third of the reach for a floor h_f has its least a little before contact (of ½ h_m
//! it is 0.456 h_m, at h = 0.18 h_m). The gradient is the reverse by hand ([`layer::Layer::reverse`]); run on dual numbers along a
//! displacement, forward and reverse give second derivatives.

mod apart;
mod bodies;
mod flow;
mod jet;
mod layer;
mod placed;
mod pull;
mod set;
mod surface;
mod water;

pub(crate) use apart::Apart;
pub(crate) use bodies::FilmBody;
pub(crate) use placed::{MovingFilm, NoFilm, PlacedFilm};
pub(crate) use set::{Films, MovingFilms, PlacedFilms};
pub(crate) use surface::{FilmSurface, TOGETHER};
pub(crate) use water::Beside;

use crate::geometry::{Image, Opposite};
use crate::solver::SparsePattern;
use std::sync::{Arc, Mutex};
use surface::Element;

/// The gap at which the coupling is asked at contact, and the one from which on it is asked as things are, m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Width {
    pub floor: f64,
    pub reach: f64,
}

/// What a coupling's films are like.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Shares {
    /// How far round bodies are held apart at contact, in the gap from which on they aren't.
    pub floor: f64,
    /// The same where one of them may have edges: meshes whose shape isn't known by formula are among them.
    pub floor_at_edges: f64,
    /// The same between two bodies with flat faces.
    pub floor_between_faces: f64,
    /// Where the flow in a film begins to go over into that around the bodies, in sizes of the first; it has at twice that. What holds bodies apart does so to all that
    /// isn't film as well, so this is where the rest of the added mass changes least with the gap: by spheres, capsules and an edge (docs/accuracy-coupled.md). Between flat
    /// faces it makes no difference.
    pub rim: f64,
    /// The same between a body and a wall.
    pub rim_to_wall: f64,
    /// How much farther films between two bodies with flat faces reach: the faces of one don't meet those of the other, as those of a body meet their own images at a wall.
    pub farther_between_faces: f64,
    /// Whether bodies with flat faces have films at walls of which there are several: in a corner each takes the other's gap for the open.
    pub in_corners: bool,
}

impl Shares {
    fn floor(&self, between: Between) -> f64 {
        match between {
            Between::Round => self.floor,
            Between::Edges => self.floor_at_edges,
            Between::Faces => self.floor_between_faces,
        }
    }

    /// Distances between which the flow in a film goes over into that around the bodies, m, where the one on whose faces it is solved has this size, m.
    fn rims(&self, other: &Side, size: f64) -> [f64; 2] {
        let start = match other {
            Side::Body(_) => self.rim,
            Side::Wall(_) => self.rim_to_wall,
        };
        [start, 2.0 * start].map(|part| part * size)
    }

    /// The gap from which on there is a film, m, of what the points resolve: where nothing of it is film bodies aren't held apart, or they would be by a jump as the
    /// first of it is.
    pub fn reach(&self, other: &Side, size: f64, resolved: f64) -> f64 {
        self.rims(other, size)[1].min(resolved)
    }
}

/// What a film is between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Between {
    /// Shapes without edges.
    Round,
    /// Two of which one may have edges: meshes whose shape isn't known by formula are among them.
    Edges,
    /// Two bodies that both have flat faces.
    Faces,
}

/// Where a film is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    /// The body on whose faces it is solved.
    pub body: usize,
    /// The gap from which on it is there, m.
    pub reach: f64,
    /// Its edges over those of the body's faces.
    pub finer: f64,
}

/// What is opposite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Side {
    /// A body, by its number in the coupling.
    Body(usize),
    /// A rigid wall, by the image that it makes.
    Wall(Image),
}

/// The film between a body and another, or a wall.
#[derive(Clone)]
pub(crate) struct Film {
    /// The body on whose faces it is solved.
    pub body: usize,
    pub other: Side,
    pub surface: Arc<FilmSurface>,
    pub opposite: Arc<Opposite>,
    pub width: Width,
    /// Distances between which the flow in it goes over into that around the bodies, m.
    rim: [f64; 2],
    /// How far what is opposite goes on beside it, from 0 to 1.
    goes_on: f64,
    pattern: Arc<Mutex<Option<LastPattern>>>,
}

/// The vertices that had potentials in the last system, and where it had entries.
type LastPattern = (Vec<usize>, Arc<SparsePattern>);

impl Film {
    /// From the gap where it begins ([`Shares::reach`]), m.
    pub fn new(
        body: usize,
        other: Side,
        (surface, opposite): (Arc<FilmSurface>, Arc<Opposite>),
        reach: f64,
        shares: &Shares,
        between: Between,
    ) -> Self {
        let rim = shares.rims(&other, surface.size);
        Self {
            body,
            other,
            surface,
            opposite,
            width: Width {
                floor: shares.floor(between) * reach,
                reach,
            },
            rim,
            goes_on: 1.0,
            pattern: Arc::default(),
        }
    }

    /// The same where what is opposite goes on beside it as far as it does beside the first body.
    pub fn beside(self, own: &FilmBody, other: &FilmBody) -> Self {
        let [_, end] = self.rim;
        Self {
            goes_on: other.goes_on_beside(own, end),
            ..self
        }
    }

    /// How far the surface bulges outside the edges of a face, m: where what is opposite is convex, and so doesn't give way to it.
    fn bulge<'f>(&self, face: &'f Element) -> &'f [f64; 3] {
        match self.opposite.is_convex() {
            true => &face.bulge,
            false => &[0.0; 3],
        }
    }
}
