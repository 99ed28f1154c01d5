//! What films see of bodies.

use super::surface::FilmSurface;
use crate::geometry::{Casing, Opposite, Solid, TriMesh};
use std::borrow::Cow;
use std::f64::consts::PI;
use std::sync::Arc;

/// Faces of a curved shape from which on there are enough for a film; they lie in one another else.
const ENOUGH: usize = 10_000;
/// The same of others. At an edge more of them wouldn't help (docs/accuracy-coupled.md), and fewer are far too stiff.
const ENOUGH_FLAT: usize = 1_000;

/// Part of a body's surface from which on a flat part of it counts as one.
const FLAT_PART: f64 = 0.05;

/// What films see of a body: the faces that they may be solved on, and what others' faces are opposite to.
#[derive(Clone)]
pub(crate) struct FilmBody {
    pub surface: Arc<FilmSurface>,
    pub(super) opposite: Arc<Opposite>,
    /// A box around it.
    pub(super) casing: Casing,
    /// Whether it may have flat faces.
    pub(super) flat: bool,
    /// Side of the square as large as its largest flat part, m; none where it is round.
    face: Option<f64>,
}

impl FilmBody {
    /// Of each body, from its surface in its own frame, and its shape by formula where it has one; the `same` ones share theirs. Where faces are few for
    /// a film they are split into four up to as many times as `splits` says of a body.
    pub fn all(
        surfaces: &[(&TriMesh, Option<&Solid>)],
        splits: impl Fn(usize) -> usize,
        same: impl Fn(usize, usize) -> bool,
    ) -> Vec<Self> {
        let mut out: Vec<Self> = Vec::with_capacity(surfaces.len());
        for (b, (mesh, solid)) in surfaces.iter().enumerate() {
            out.push(match (0..b).find(|a| same(*a, b)) {
                Some(a) => out[a].clone(),
                None => {
                    let flat = mesh.largest_flat();
                    let (mesh, finer) = split(mesh, *solid, splits(b));
                    let surface = FilmSurface {
                        finer,
                        ..FilmSurface::new(&mesh, solid.is_some())
                    };
                    let opposite = Opposite::of_body(*solid, &mesh);
                    let own = surface.casing;
                    Self {
                        casing: opposite.casing().map_or(own, |other| own.joined(other)),
                        surface: Arc::new(surface),
                        opposite: Arc::new(opposite),
                        flat: solid.is_none_or(Solid::has_faces),
                        face: (flat > FLAT_PART * mesh.surface_area()).then(|| flat.sqrt()),
                    }
                }
            });
        }
        out
    }
}

impl FilmBody {
    /// Whether it has a flat part that counts as one.
    pub(super) fn has_face(&self) -> bool {
        self.face.is_some()
    }

    /// How far it goes on, from 0 to 1, beside the film of another body that is opposite, which reaches as far around that one as `rim` (m): the face of a like block ends where the other's
    /// does. By both sizes alone, so that it changes nothing as bodies move.
    pub(super) fn goes_on_beside(&self, other: &Self, rim: f64) -> f64 {
        let Some(face) = self.face else { return 1.0 };
        let round = PI.sqrt() * other.surface.size;
        ((face - other.face.unwrap_or(round)) / (2.0 * rim)).clamp(0.0, 1.0)
    }
}

/// A finer mesh, or of the curved shape that it stands for, and its edges over those that it had.
fn split<'m>(mesh: &'m TriMesh, solid: Option<&Solid>, times: usize) -> (Cow<'m, TriMesh>, f64) {
    let (mut out, mut finer) = (Cow::Borrowed(mesh), 1.0);
    let curved = solid.filter(|solid| solid.is_curved());
    let enough = curved.map_or(ENOUGH_FLAT, |_| ENOUGH);
    for _ in 0..times {
        if out.faces().len() >= enough {
            break;
        }
        let split = out.split();
        out = Cow::Owned(match curved {
            None => split,
            Some(solid) => split.moved(|x| {
                let field = solid.field(x);
                x - field.distance * field.gradient
            }),
        });
        finer *= 0.5;
    }
    (out, finer)
}
