//! What the water sees of a body, and what it touches with.

use super::even::{even, is_near, lost_by, of_volume};
use super::hull::{fine_hull, hull};
use super::options::Options;
use super::pieces::{Form, Meshes, Own, Piece, moved};
use super::report::Report;
use super::tree::Group;
use crate::Result;
use crate::geometry::{MassProperties, Solid, TriMesh};
use crate::shape::{Shape, build, solid};
use hydrograd_adjoint::lie::{Pose, Vec3};
use nalgebra::Isometry3;
use std::path::Path;

/// Faces of hulls and meshes for the water, unless chosen.
pub(super) const FACES: usize = 320;
/// Times as many as are asked for that a mesh may have where it would lose its form with less.
const MORE: [usize; 6] = [2, 4, 8, 16, 32, 64];
/// Most faces of a mesh that is used as it is where it can't have less.
const MOST: usize = 20_000;

/// A closed surface, in the body's frame.
#[derive(Clone)]
pub(super) enum Surface {
    Formula { shape: Shape, at: Isometry3<f64> },
    Mesh { mesh: TriMesh, convex: bool },
}

/// What a body is in water and for contact.
pub(super) struct Immersed {
    /// None of a dry body.
    pub surface: Option<Surface>,
    /// Convex pieces for contact; none where the surface itself will do.
    pub pieces: Vec<Surface>,
    /// What the surface is, in words.
    pub said: String,
}

pub(super) fn pose(at: &Isometry3<f64>) -> Pose {
    Pose::new(
        at.rotation.to_rotation_matrix().into_inner(),
        at.translation.vector,
    )
}

impl Surface {
    /// Its mesh in the body's frame.
    pub fn mesh(&self) -> Result<TriMesh> {
        match self {
            Self::Formula { shape, at } => {
                let mesh = build(shape, Path::new(""), Some(FACES))?;
                Ok(mesh.transformed(&pose(at)))
            }
            Self::Mesh { mesh, .. } => Ok(mesh.clone()),
        }
    }

    /// Its exact form in the body's frame, if it has one.
    pub fn solid(&self) -> Result<Option<Solid>> {
        match self {
            Self::Formula { shape, at } => solid(shape, pose(at)),
            Self::Mesh { .. } => Ok(None),
        }
    }

    pub fn properties(&self) -> Result<MassProperties> {
        if let Self::Formula { shape, at } = self
            && let Some(found) = MassProperties::by_formula(shape)?
        {
            return Ok(found.transformed(&pose(at)));
        }
        Ok(self.mesh()?.mass_properties())
    }

    /// As a scene has it: a shape and its pose.
    pub fn shape(&self) -> (Shape, Isometry3<f64>) {
        match self {
            Self::Formula { shape, at } => (shape.clone(), *at),
            Self::Mesh { mesh, .. } => {
                let vertices: Vec<[f64; 3]> = mesh.vertices().iter().map(|x| (*x).into()).collect();
                let shape = Shape::triangles(vertices, mesh.faces().to_vec());
                (shape, Isometry3::identity())
            }
        }
    }
}

impl Immersed {
    pub fn dry(said: impl Into<String>) -> Self {
        Self {
            surface: None,
            pieces: Vec::new(),
            said: format!("dry: {}", said.into()),
        }
    }

    /// Of a group of links; meshes as many faces as they are for now.
    pub fn of_group(
        meshes: &mut Meshes,
        group: &Group,
        name: &str,
        options: &Options,
        report: &mut Report,
    ) -> Result<Self> {
        let (pieces, hulled) = meshes.of_group(group, options, report)?;
        match &pieces[..] {
            [] => Ok(Self::dry("no geometry")),
            [one] if !hulled => Self::of_piece(meshes, one, name, options, report),
            _ => Self::of_pieces(meshes, &pieces, name, options, report),
        }
    }

    /// A single piece as it is, if it can be.
    fn of_piece(
        meshes: &Meshes,
        piece: &Piece,
        name: &str,
        options: &Options,
        report: &mut Report,
    ) -> Result<Self> {
        let loaded = match &piece.form {
            Form::Primitive(shape) => {
                return Ok(Self {
                    said: shape.kind().to_string(),
                    surface: Some(Surface::Formula {
                        shape: shape.clone(),
                        at: piece.at,
                    }),
                    pieces: Vec::new(),
                });
            }
            Form::Mesh(loaded) => loaded,
        };
        let why = match meshes.surface(piece.link, loaded, options)? {
            Ok(Own { mesh, turned }) => {
                let vertices: Vec<Vec3> = mesh
                    .vertices()
                    .iter()
                    .map(|x| moved(&piece.at, x))
                    .collect();
                let placed = TriMesh::new(mesh.name(), vertices, mesh.faces().to_vec())?;
                let most = options.faces.unwrap_or(FACES);
                let fewer = match placed.faces().len() > 2 * most {
                    true => coarser(&placed, most),
                    false => Ok(placed.clone()),
                };
                match fewer {
                    Ok(mesh) => {
                        tell_faces(name, &placed, &mesh, most, report);
                        let mesh = of_volume(&mesh, placed.mass_properties().volume);
                        let used_as = match turned {
                            true => "closed: used itself, turned right side out",
                            false => "closed: used itself",
                        };
                        meshes.tell(piece, used_as, report);
                        let hull = meshes.hull(piece).unwrap_or_else(|error| {
                            report.note(format!(
                                "body {name:?}: its mesh itself is for contact, since it has no convex hull: {error}"
                            ));
                            None
                        });
                        let own = mesh.mass_properties().volume;
                        let convex = hull
                            .as_ref()
                            .is_some_and(|h| h.mass_properties().volume < (1.0 + 1e-6) * own);
                        let pieces = hull.map(|mesh| Surface::Mesh { mesh, convex: true });
                        return Ok(Self {
                            said: "closed mesh".into(),
                            surface: Some(Surface::Mesh { mesh, convex }),
                            pieces: pieces.into_iter().collect(),
                        });
                    }
                    Err(error) => {
                        let why = error.problem();
                        let faces = mesh.faces().len();
                        format!(
                            "it is closed, but has {faces} faces, and with about {most} (`faces`) it would be no surface: {why}"
                        )
                    }
                }
            }
            Err(why) => format!("it is no sound closed surface: {why}"),
        };
        let made = Self::of_pieces(meshes, std::slice::from_ref(piece), name, options, report)?;
        if made.surface.is_some() {
            report.note(format!(
                "body {name:?}: the convex hull of its mesh stands for it, since {why}"
            ));
        }
        Ok(made)
    }

    /// The convex hull of pieces, each of which is for contact.
    fn of_pieces(
        meshes: &Meshes,
        pieces: &[Piece],
        name: &str,
        options: &Options,
        report: &mut Report,
    ) -> Result<Self> {
        let mut hulls = Vec::with_capacity(pieces.len());
        for piece in pieces {
            if let Form::Mesh(loaded) = &piece.form
                && options.bad_meshes == super::options::BadMeshes::Refuse
            {
                meshes.surface(piece.link, loaded, options)?.ok();
            }
            let hull = meshes.hull(piece)?;
            let used_as = match (&hull, pieces.len()) {
                (None, _) => "left out: it has no volume",
                (_, 1) => "its convex hull",
                _ => "part of a convex hull",
            };
            meshes.tell(piece, used_as, report);
            hulls.extend(hull.map(|hull| (piece, hull)));
        }
        let whole = match &hulls[..] {
            [] => None,
            [(piece, hull)] => {
                let fine = fine(name, &[piece]).ok().flatten();
                Some(fine.unwrap_or_else(|| hull.clone()))
            }
            _ => {
                let pieces: Vec<&Piece> = hulls.iter().map(|(piece, _)| *piece).collect();
                match fine(name, &pieces) {
                    Ok(Some(fine)) => Some(fine),
                    _ => {
                        let points = hulls.iter().flat_map(|(_, hull)| hull.vertices());
                        let points: Vec<Vec3> = points.copied().collect();
                        hull(&body(name), &points)?
                    }
                }
            }
        };
        let Some(whole) = whole else {
            report.warn(format!(
                "body {name:?} is dry: its geometry has no volume, not even its convex hull"
            ));
            return Ok(Self::dry("its geometry has no volume"));
        };
        let said = match hulls.len() {
            1 => "convex hull".to_string(),
            n => format!("convex hull of {n} pieces"),
        };
        let contact = hulls.into_iter().map(|(piece, mesh)| match &piece.form {
            Form::Primitive(shape) => Surface::Formula {
                shape: shape.clone(),
                at: piece.at,
            },
            Form::Mesh(_) => Surface::Mesh { mesh, convex: true },
        });
        Ok(Self {
            pieces: contact.collect(),
            said,
            surface: Some(Surface::Mesh {
                mesh: whole,
                convex: true,
            }),
        })
    }

    /// Gives hulls of the body of this name the faces that the water needs.
    pub fn finish(&mut self, name: &str, options: &Options, report: &mut Report) {
        if let (Some(Surface::Formula { shape, .. }), Some(faces)) =
            (&mut self.surface, options.faces)
        {
            shape.set_faces(faces);
        }
        let wanted = options.faces.unwrap_or(FACES);
        if let Some(Surface::Mesh { mesh, convex }) = &mut self.surface {
            // A mesh with as many faces as that stays what it is.
            if *convex || 2 * mesh.faces().len() < wanted {
                *mesh = even(mesh, wanted, *convex);
                let found = mesh.faces().len();
                if !is_near(found, wanted) {
                    tell_count(name, found, wanted, report);
                }
            }
            self.said = format!("{}, {} faces", self.said, mesh.faces().len());
        }
    }
}

/// A mesh with about so many faces, or with a few times as many where it would be no surface with so few, or lose its form; if it always does, with the most of these.
fn coarser(mesh: &TriMesh, most: usize) -> Result<TriMesh> {
    let mut last = mesh.coarsened(most);
    for times in MORE {
        if last
            .as_ref()
            .is_ok_and(|found| keeps_form(mesh, found, most))
        {
            break;
        }
        let next = match times * most < mesh.faces().len() {
            true => mesh.coarsened(times * most),
            false if mesh.faces().len() <= MOST => Ok(mesh.clone()),
            false => break,
        };
        if next.is_ok() {
            last = next;
        }
    }
    last
}

/// Whether a mesh with about so many faces has the volume that it stands for, but for what that many faces cut off of a body.
fn keeps_form(mesh: &TriMesh, found: &TriMesh, faces: usize) -> bool {
    lost(mesh, found).abs() < lost_by(faces)
}

/// Part of the volume that a mesh lacks.
fn lost(mesh: &TriMesh, found: &TriMesh) -> f64 {
    1.0 - found.mass_properties().volume / mesh.mass_properties().volume
}

/// Says where a surface has more faces than are asked for, and where it lost its form.
fn tell_faces(name: &str, mesh: &TriMesh, found: &TriMesh, asked: usize, report: &mut Report) {
    let (lost, faces) = (lost(mesh, found), found.faces().len());
    if lost.abs() >= lost_by(asked) {
        report.warn(format!(
            "body {name:?}: its mesh of {} faces lost {:.1} % of its volume as it was given {faces}, and was scaled to have it again: its form isn't kept; \
             ask for more (`faces`)",
            mesh.faces().len(),
            100.0 * lost
        ));
    } else if faces > asked && !is_near(faces, asked) && faces < mesh.faces().len() {
        tell_count(name, faces, asked, report);
    }
}

/// Says that a surface hasn't about as many faces as are asked for, and why.
fn tell_count(name: &str, found: usize, asked: usize, report: &mut Report) {
    let why = match found > asked {
        true => "with about that many it would lose its form",
        false => "its faces aren't divided evenly into more",
    };
    report.note(format!(
        "body {name:?}: its surface has {found} faces, where {asked} are asked for (`faces`): {why}"
    ));
}

fn body(name: &str) -> String {
    format!("body {name:?}")
}

/// The convex hull of pieces as the water sees it; none if it has no volume.
fn fine(name: &str, pieces: &[&Piece]) -> Result<Option<TriMesh>> {
    let each = pieces.iter().map(|piece| piece.points());
    let points: Vec<Vec<Vec3>> = each.collect::<Result<_>>()?;
    fine_hull(&body(name), &points.concat())
}
