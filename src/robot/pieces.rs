//! The pieces of geometry that links are made of.

use super::file::File;
use super::hull::{fine_hull, hull};
use super::options::{BadMeshes, Options, Wet};
use super::paths::Folders;
use super::points::points;
use super::report::{MeshUse, Report};
use super::tree::{Group, link_place, placed};
use crate::geometry::TriMesh;
use crate::shape::file::{FileMesh, read_unchecked};
use crate::shape::{Shape, build, validate};
use crate::{Error, Result};
use hydrograd_adjoint::lie::Vec3;
use nalgebra::{Isometry3, Point3};
use std::cell::OnceCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use urdf_rs::Geometry;

/// Faces of a primitive where a coarse mesh stands for it.
const FACES: usize = 80;
/// Fewest faces that may be asked for.
const FEWEST: usize = 1;

/// A piece of a body, in the body's frame.
pub(super) struct Piece {
    /// The link's number.
    pub link: usize,
    pub form: Form,
    pub at: Isometry3<f64>,
}

/// What a piece is.
pub(super) enum Form {
    Primitive(Shape),
    Mesh(Rc<Loaded>),
}

/// A closed mesh as it is, or turned round.
pub(super) struct Own {
    pub mesh: TriMesh,
    /// Whether its normals pointed inward.
    pub turned: bool,
}

/// A mesh in a file, scaled.
pub(super) struct Loaded {
    pub path: PathBuf,
    pub mesh: FileMesh,
    /// Made when they are first asked for.
    hull: OnceCell<Option<TriMesh>>,
    fine: OnceCell<Option<TriMesh>>,
}

impl Loaded {
    /// The mesh in a file with its coordinates times `scale`; `place` begins messages.
    ///
    /// # Errors
    /// A scale that can't be, a file that can't be read, and vertices that aren't finite.
    pub fn new(path: PathBuf, scale: [f64; 3], place: &str) -> Result<Self> {
        if scale.iter().any(|s| !(1e-9..=1e9).contains(&s.abs())) {
            return Err(Error::input(
                format!("{place}: scale of mesh {}", path.display()),
                format!("{scale:?}"),
                "give factors that aren't zero, e.g. 0.001 0.001 0.001 for a file in millimetres",
            ));
        }
        let mut mesh = read_unchecked(&path, 1.0).map_err(|e| e.of(place))?;
        for x in &mut mesh.vertices {
            x.component_mul_assign(&Vec3::from(scale));
        }
        if scale.iter().product::<f64>() < 0.0 {
            // A mirrored surface is turned inside out.
            mesh.faces.iter_mut().for_each(|face| face.swap(1, 2));
        }
        if let Some(bad) = mesh
            .vertices
            .iter()
            .find(|x| !x.iter().all(|x| x.is_finite()))
        {
            return Err(Error::input(
                format!("{place}: mesh {}", path.display()),
                format!("a vertex at {:?}", bad.as_slice()),
                "must be finite: export the mesh again",
            ));
        }
        Ok(Self {
            path,
            mesh,
            hull: OnceCell::new(),
            fine: OnceCell::new(),
        })
    }

    /// Its convex hull with few faces; none if it has no volume.
    ///
    /// # Errors
    /// No hull is found, though there is a volume.
    pub fn hull(&self) -> Result<Option<&TriMesh>> {
        self.once(&self.hull, hull)
    }

    /// Its convex hull as the water sees it; none if it has no volume.
    ///
    /// # Errors
    /// As [`Self::hull`].
    pub fn fine(&self) -> Result<Option<&TriMesh>> {
        self.once(&self.fine, fine_hull)
    }

    fn once<'c>(
        &self,
        cell: &'c OnceCell<Option<TriMesh>>,
        hull: impl Fn(&str, &[Vec3]) -> Result<Option<TriMesh>>,
    ) -> Result<Option<&'c TriMesh>> {
        if let Some(known) = cell.get() {
            return Ok(known.as_ref());
        }
        let used = self.mesh.faces.iter().flatten();
        let points = used.filter_map(|v| self.mesh.vertices.get(*v));
        let points: Vec<Vec3> = points.copied().collect();
        let made = hull(&self.path.display().to_string(), &points)?;
        Ok(cell.get_or_init(|| made).as_ref())
    }
}

pub(super) fn moved(at: &Isometry3<f64>, x: &Vec3) -> Vec3 {
    (at * Point3::from(*x)).coords
}

impl Piece {
    /// Points in the body's frame whose hull is its own, as the water sees it.
    pub fn points(&self) -> Result<Vec<Vec3>> {
        let own = match &self.form {
            Form::Primitive(shape) => points(shape)?,
            Form::Mesh(loaded) => match loaded.fine()? {
                Some(hull) => hull.vertices().to_vec(),
                None => Vec::new(),
            },
        };
        Ok(own.iter().map(|x| moved(&self.at, x)).collect())
    }

    /// Its convex hull with few faces in the body's frame; none if it has no volume.
    pub fn hull(&self) -> Result<Option<TriMesh>> {
        let own = match &self.form {
            Form::Primitive(shape) => build(shape, Path::new(""), Some(FACES))?,
            Form::Mesh(loaded) => match loaded.hull()? {
                Some(hull) => hull.clone(),
                None => return Ok(None),
            },
        };
        let vertices = own.vertices().iter().map(|x| moved(&self.at, x)).collect();
        TriMesh::new(own.name(), vertices, own.faces().to_vec()).map(Some)
    }
}

/// Which of a link's geometry is used.
#[derive(Clone, Copy, PartialEq)]
enum Source {
    Collision,
    Visual,
}

/// The meshes of a file, each read once.
pub(super) struct Meshes<'f> {
    file: &'f File,
    folders: Folders,
    loaded: HashMap<(PathBuf, [u64; 3]), Rc<Loaded>>,
}

impl<'f> Meshes<'f> {
    pub fn new(file: &'f File, options: &Options) -> Self {
        Self {
            folders: Folders::new(&file.path, &options.package_path),
            loaded: HashMap::new(),
            file,
        }
    }

    /// What the water sees of a group of links, and whether a hull of it is asked for.
    pub fn of_group(
        &mut self,
        group: &Group,
        options: &Options,
        report: &mut Report,
    ) -> Result<(Vec<Piece>, bool)> {
        let (mut pieces, mut hulled) = (Vec::new(), false);
        for part in &group.parts {
            let link = &self.file.robot.links[part.link];
            let chosen = options
                .links
                .get(&link.name)
                .and_then(|choice| choice.shape);
            let wet = chosen.unwrap_or(options.shape);
            let first = match wet {
                Wet::None => continue,
                Wet::Visual => Source::Visual,
                Wet::Collision | Wet::Hull => Source::Collision,
            };
            let has = |source: Source| match source {
                Source::Collision => !link.collision.is_empty(),
                Source::Visual => !link.visual.is_empty(),
            };
            let source = match (first, has(first)) {
                (first, true) => first,
                (Source::Collision, false) => Source::Visual,
                (Source::Visual, false) => Source::Collision,
            };
            if !has(source) {
                continue;
            }
            if source != first {
                let [lacks, stands] = match first {
                    Source::Collision => ["collision", "visual"],
                    Source::Visual => ["visual", "collision"],
                };
                report.note(format!(
                    "link {:?} has no <{lacks}>: its <{stands}> stands for it",
                    link.name
                ));
            }
            hulled |= wet == Wet::Hull;
            let geometry: Vec<(&Geometry, Isometry3<f64>)> = match source {
                Source::Collision => (link.collision.iter())
                    .map(|c| (&c.geometry, placed(&c.origin)))
                    .collect(),
                Source::Visual => (link.visual.iter())
                    .map(|v| (&v.geometry, placed(&v.origin)))
                    .collect(),
            };
            for (geometry, at) in geometry {
                pieces.push(Piece {
                    link: part.link,
                    form: self.form(geometry, part.link)?,
                    at: part.at * at,
                });
            }
        }
        Ok((pieces, hulled))
    }

    fn form(&mut self, geometry: &Geometry, link: usize) -> Result<Form> {
        let shape = match geometry {
            Geometry::Box { size } => Shape::cuboid(**size),
            Geometry::Cylinder { radius, length } => Shape::cylinder(*radius, *length),
            Geometry::Capsule { radius, length } if *length == 0.0 => Shape::sphere(*radius),
            Geometry::Capsule { radius, length } => Shape::capsule(*radius, *length),
            Geometry::Sphere { radius } => Shape::sphere(*radius),
            Geometry::Mesh { filename, .. } if self.file.shapes.contains_key(filename) => {
                self.file.shapes[filename].clone()
            }
            Geometry::Mesh { filename, scale } => {
                let scale = scale.map_or([1.0; 3], |s| *s);
                return self.mesh(filename, scale, link).map(Form::Mesh);
            }
        };
        let place = link_place(self.file, link);
        validate(&shape, &place)?;
        // What no mesh can be of, as it is too thin, is an error of the file: thinnest are the faces of the coarsest mesh.
        build(&shape, Path::new(""), Some(FEWEST)).map_err(|e| e.of(&place))?;
        Ok(Form::Primitive(shape))
    }

    fn mesh(&mut self, name: &str, scale: [f64; 3], link: usize) -> Result<Rc<Loaded>> {
        let place = link_place(self.file, link);
        let path = self.folders.find(name, &place)?;
        let key = (path.clone(), scale.map(f64::to_bits));
        if let Some(known) = self.loaded.get(&key) {
            return Ok(known.clone());
        }
        let loaded = Rc::new(Loaded::new(path, scale, &place)?);
        self.loaded.insert(key, loaded.clone());
        Ok(loaded)
    }

    /// The surface of a mesh itself, if nothing is wrong with it or it is inside out; else why it isn't used, or the error if such are refused.
    pub fn surface(
        &self,
        link: usize,
        loaded: &Loaded,
        options: &Options,
    ) -> Result<std::result::Result<Own, String>> {
        let mesh = loaded.mesh.clone();
        let error = match mesh.into_mesh() {
            Ok(mesh) => {
                return Ok(Ok(Own {
                    mesh,
                    turned: false,
                }));
            }
            Err(error) => error,
        };
        if options.bad_meshes == BadMeshes::Refuse {
            return Err(error.of(&link_place(self.file, link)));
        }
        let mut other = loaded.mesh.clone();
        other.faces.iter_mut().for_each(|f| f.swap(1, 2));
        if let Ok(mesh) = other.into_mesh() {
            return Ok(Ok(Own { mesh, turned: true }));
        }
        Ok(Err(error.problem()))
    }

    /// As [`Piece::hull`], with an error that names the link.
    pub fn hull(&self, piece: &Piece) -> Result<Option<TriMesh>> {
        (piece.hull()).map_err(|e| e.of(&link_place(self.file, piece.link)))
    }

    /// Tells what became of a piece that is a mesh.
    pub fn tell(&self, piece: &Piece, used_as: &str, report: &mut Report) {
        if let Form::Mesh(loaded) = &piece.form {
            report.meshes.push(MeshUse {
                link: self.file.robot.links[piece.link].name.clone(),
                file: loaded.path.display().to_string(),
                faces: loaded.mesh.faces.len(),
                used_as: used_as.into(),
            });
        }
    }
}
