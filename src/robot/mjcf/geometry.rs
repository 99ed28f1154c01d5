//! Geometry of an MJCF file: shapes, and the mass that follows from them where a body gives none.

use super::super::inertia::Inertial;
use super::super::pieces::Loaded;
use crate::geometry::{MassProperties, with_cavities};
use crate::shape::Shape;
use crate::shape::file::FileMesh;
use crate::{Error, Result};
use mjcf_rs::Model;
use mjcf_rs::body::{Geom, GeomType};
use nalgebra::{Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};

/// Of a mesh's volume, by how much another program's may differ without a word.
const SAME: f64 = 1e-3;

/// A pose of theirs.
pub(super) fn isometry(pose: &mjcf_rs::Pose) -> Isometry3<f64> {
    let (p, q) = (pose.translation, pose.rotation);
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(q.w, q.x, q.y, q.z));
    Isometry3::from_parts(Translation3::new(p.x, p.y, p.z), turn)
}

/// What a geom is.
pub(super) enum Solid {
    Shape(Shape),
    /// A file, and factors of its coordinates.
    Mesh(PathBuf, [f64; 3]),
}

/// A solid, and where it is in the body's frame.
pub(super) type Placed = (Solid, Isometry3<f64>);

/// The geometry of one body.
pub(super) struct Geometries<'m> {
    path: &'m Path,
    model: &'m Model,
    /// The body, for messages.
    of: &'m str,
}

impl<'m> Geometries<'m> {
    pub fn new(path: &'m Path, model: &'m Model, of: &'m str) -> Self {
        Self { path, model, of }
    }

    fn place(&self) -> String {
        format!("{}: {}", self.path.display(), self.of)
    }

    fn wrong(&self, field: &str, value: impl std::fmt::Display, remedy: &str) -> Error {
        Error::input(format!("{}: {field}", self.place()), value, remedy)
    }

    /// A geom that its frame puts at `pose`, and where it is in the body's frame; none of planes, height fields and distance fields.
    pub fn read(&self, geom: &Geom, pose: &Isometry3<f64>) -> Result<Option<Placed>> {
        let (at, [x, y, z]) = placed(geom, pose);
        let shape = match geom.type_ {
            GeomType::Sphere => Shape::sphere(x),
            kind @ (GeomType::Capsule | GeomType::Cylinder) if y == 0.0 => {
                let field = match kind {
                    GeomType::Capsule => "size of a capsule",
                    _ => "size of a cylinder",
                };
                let given = format!("radius {x} and no length");
                return Err(self.wrong(
                    field,
                    given,
                    "give its radius and half its length (size=\"0.05 0.2\"), or two points that aren't one (fromto)",
                ));
            }
            GeomType::Capsule => Shape::capsule(x, 2.0 * y),
            GeomType::Cylinder => Shape::cylinder(x, 2.0 * y),
            GeomType::Box => Shape::cuboid([x, y, z].map(|s| 2.0 * s)),
            GeomType::Ellipsoid => Shape::ellipsoid([x, y, z]),
            GeomType::Mesh => {
                let (file, scale) = self.mesh(geom)?;
                return Ok(Some((Solid::Mesh(file, scale), at)));
            }
            GeomType::Plane | GeomType::Hfield | GeomType::Sdf => return Ok(None),
        };
        Ok(Some((Solid::Shape(shape), at)))
    }

    /// The file of a mesh, and the factors of its coordinates.
    fn mesh(&self, geom: &Geom) -> Result<(PathBuf, [f64; 3])> {
        let name = geom.mesh.as_deref().unwrap_or_default();
        let wrong = |remedy| Err(self.wrong("mesh", format!("{name:?}"), remedy));
        let Some(asset) = self.model.assets.mesh(name) else {
            return wrong("there is no <mesh> of this name among the assets");
        };
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let Some(file) = self.model.resolve_mesh_file(asset, folder) else {
            return wrong(
                "it has no file, and vertices within the XML aren't read: write it to an STL or OBJ file",
            );
        };
        if asset.refpose != mjcf_rs::Pose::default() {
            return wrong("refpos and refquat aren't read: move the mesh itself");
        }
        Ok((std::path::absolute(&file).unwrap_or(file), asset.scale))
    }

    /// Mass and inertia of a geom, whose own mass or density it is, or else `density`, kg/m³; none of what has no volume, which `notes` say.
    pub fn inertial(
        &self,
        geom: &Geom,
        (solid, at): &Placed,
        density: f64,
        notes: &mut Vec<String>,
    ) -> Result<Option<Inertial>> {
        let found = match solid {
            Solid::Shape(shape) => {
                MassProperties::by_formula(shape).map_err(|e| e.of(&self.place()))?
            }
            Solid::Mesh(file, scale) => self.of_mesh(file, *scale, notes)?,
        };
        let Some(found) = found else {
            return match geom.mass.filter(|m| *m != 0.0) {
                None => {
                    let which = geom.name.as_deref().or(geom.mesh.as_deref());
                    notes.push(format!(
                        "{}: geom {:?} has no volume, and so no mass",
                        self.of,
                        which.unwrap_or_default()
                    ));
                    Ok(None)
                }
                Some(mass) => Err(self.wrong(
                    "mass of a geom",
                    mass,
                    "it has no volume to spread the mass over: give the body an <inertial>",
                )),
            };
        };
        let density = match geom.mass {
            Some(mass) => mass / found.volume,
            None => geom.density.unwrap_or(density),
        };
        if density < 0.0 || !density.is_finite() {
            let remedy = "give a mass and a density of zero or more";
            return Err(self.wrong("density of a geom", density, remedy));
        }
        let own = Inertial {
            mass: density * found.volume,
            center: found.centroid,
            inertia: density * found.inertia,
        };
        Ok(Some(own.moved(at)))
    }

    /// Of a mesh itself, without its cavities, or, where it encloses no volume, of its convex hull, at a density of one; none if that has no
    /// volume.
    fn of_mesh(
        &self,
        file: &Path,
        scale: [f64; 3],
        notes: &mut Vec<String>,
    ) -> Result<Option<MassProperties>> {
        let loaded = Loaded::new(file.to_owned(), scale, &self.place())?;
        let FileMesh {
            name,
            vertices,
            faces,
            ..
        } = &loaded.mesh;
        let (found, whose) = match with_cavities(name, vertices, faces) {
            Ok(found) => (found, "the volume that it encloses".to_owned()),
            Err(error) => {
                let hull = loaded.fine().map_err(|e| e.of(&self.place()))?;
                let whose = format!("its convex hull ({})", error.problem());
                (hull.map(|mesh| mesh.mass_properties()), whose)
            }
        };
        if let Some(found) = &found {
            let other = legacy_volume(&loaded.mesh);
            if (other - found.volume).abs() > SAME * found.volume {
                notes.push(format!(
                    "{}: mass and inertia of mesh {} are of {whose}, {:.4e} m³; MuJoCo's default (inertia=\"legacy\") takes about {other:.2e} m³ of it",
                    self.of,
                    file.display(),
                    found.volume
                ));
            }
        }
        Ok(found)
    }
}

/// What MuJoCo's default makes of a mesh, m³: the tetrahedra between its faces and its surface's middle, all counted as positive.
fn legacy_volume(mesh: &FileMesh) -> f64 {
    let corners = |face: &[usize; 3]| {
        let [a, b, c] = face.map(|v| mesh.vertices.get(v).copied());
        Some([a?, b?, c?])
    };
    let faces: Vec<[Vector3<f64>; 3]> = mesh.faces.iter().filter_map(corners).collect();
    let doubled = |[a, b, c]: &[Vector3<f64>; 3]| (b - a).cross(&(c - a));
    let (mut first, mut area) = (Vector3::zeros(), 0.0);
    for face in &faces {
        let of_face = doubled(face).norm();
        first += (face[0] + face[1] + face[2]) * (of_face / 3.0);
        area += of_face;
    }
    let middle = first / area;
    let each = faces.iter();
    each.map(|face| doubled(face).dot(&(face[0] - middle)).abs() / 6.0)
        .sum()
}

/// Where a piece is and its sizes: between two points where the file gives those.
fn placed(geom: &Geom, pose: &Isometry3<f64>) -> (Isometry3<f64>, [f64; 3]) {
    let Some([ax, ay, az, bx, by, bz]) = geom.fromto else {
        return (*pose, geom.size);
    };
    // The pose is that of frames around it.
    let at = pose * between([ax, ay, az], [bx, by, bz]);
    let along = Vector3::new(ax - bx, ay - by, az - bz);
    let (radius, half) = (geom.size[0], 0.5 * along.norm());
    let sizes = match geom.type_ {
        GeomType::Box | GeomType::Ellipsoid => [radius, radius, half],
        _ => [radius, half, 0.0],
    };
    (at, sizes)
}

/// The frame in the middle of two points whose z axis points from the second one to the first.
pub(super) fn between(a: [f64; 3], b: [f64; 3]) -> Isometry3<f64> {
    let [a, b] = [a, b].map(Vector3::from);
    Isometry3::from_parts(Translation3::from(0.5 * (a + b)), z_along(a - b))
}

/// The shortest turn that takes the z axis to a direction; to its opposite it is about x.
pub(super) fn z_along(direction: Vector3<f64>) -> UnitQuaternion<f64> {
    // Of any length: squares of what is very small are zero.
    let [x, y, z] = (direction / direction.amax().max(f64::MIN_POSITIVE)).into();
    let across = x.hypot(y);
    let axis = Unit::try_new(Vector3::new(-y, x, 0.0), 1e-10 * across.hypot(z));
    UnitQuaternion::from_axis_angle(&axis.unwrap_or(Vector3::x_axis()), across.atan2(z))
}
