//! Geometry of an MJCF file: shapes, and the mass that follows from them where a body gives none.

use super::super::inertia::Inertial;
use super::super::pieces::Loaded;
use crate::geometry::MassProperties;
use crate::shape::Shape;
use crate::{Error, Result};
use mjcf_rs::Model;
use mjcf_rs::body::{Geom, GeomType};
use nalgebra::{Isometry3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

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
            GeomType::Capsule if y == 0.0 => Shape::sphere(x),
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

    /// Mass and inertia of a geom, whose own mass or density it is, or else `density`, kg/m³; none of what has no volume.
    pub fn inertial(
        &self,
        geom: &Geom,
        (solid, at): &Placed,
        density: f64,
    ) -> Result<Option<Inertial>> {
        let found = match solid {
            Solid::Shape(shape) => {
                MassProperties::by_formula(shape).map_err(|e| e.of(&self.place()))?
            }
            Solid::Mesh(file, scale) => {
                let loaded = Loaded::new(file.clone(), *scale, &self.place())?;
                let closed = loaded.mesh.clone().into_mesh().ok();
                let whole = closed.or_else(|| loaded.fine().cloned());
                whole.map(|mesh| mesh.mass_properties())
            }
        };
        let Some(found) = found else {
            return match geom.mass.filter(|m| *m != 0.0) {
                None => Ok(None),
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
    let turn = Rotation3::rotation_between(&Vector3::z(), &(a - b))
        .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector3::x_axis(), PI));
    let turn = UnitQuaternion::from_rotation_matrix(&turn);
    Isometry3::from_parts(Translation3::from(0.5 * (a + b)), turn)
}
