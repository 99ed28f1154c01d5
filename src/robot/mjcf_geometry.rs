//! Geometry of an MJCF file: shapes, and the mass that follows from them where a body gives none.

use super::hull::hull;
use super::inertia::Inertial;
use crate::geometry::{MassProperties, TriMesh};
use crate::shape::Shape;
use crate::shape::file::read_unchecked;
use crate::{Error, Result};
use hydrograd_adjoint::lie::Vec3;
use mjcf_rs::Model;
use mjcf_rs::body::{Body, Geom, GeomType};
use nalgebra::{
    Isometry3, Matrix3, Point3, Quaternion, Rotation3, Translation3, UnitQuaternion, Vector3,
};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

/// A shape as URDF has it, one that URDF lacks under the name that stands in a mesh's place, and its pose in the body's frame.
type Read = (urdf_rs::Geometry, Option<Shape>, Isometry3<f64>);

/// A pose of theirs.
pub(super) fn isometry(pose: &mjcf_rs::Pose) -> Isometry3<f64> {
    let (p, q) = (pose.translation, pose.rotation);
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(q.w, q.x, q.y, q.z));
    Isometry3::from_parts(Translation3::new(p.x, p.y, p.z), turn)
}

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

    /// What is read of a piece that its frame puts at `pose`; else why it isn't.
    pub fn read(
        &self,
        geom: &Geom,
        pose: &Isometry3<f64>,
    ) -> Result<std::result::Result<Read, String>> {
        let (at, [x, y, z]) = placed(geom, pose);
        let shape = match geom.type_ {
            GeomType::Sphere => urdf_rs::Geometry::Sphere { radius: x },
            GeomType::Capsule => urdf_rs::Geometry::Capsule {
                radius: x,
                length: 2.0 * y,
            },
            GeomType::Cylinder => urdf_rs::Geometry::Cylinder {
                radius: x,
                length: 2.0 * y,
            },
            GeomType::Box => urdf_rs::Geometry::Box {
                size: urdf_rs::Vec3([x, y, z].map(|s| 2.0 * s)),
            },
            GeomType::Ellipsoid => {
                let name = format!("an ellipsoid with the semi-axes {:?} m", [x, y, z]);
                let stands = urdf_rs::Geometry::Mesh {
                    filename: name,
                    scale: None,
                };
                return Ok(Ok((stands, Some(Shape::ellipsoid([x, y, z])), at)));
            }
            GeomType::Mesh => {
                let (file, scale) = self.mesh(geom)?;
                urdf_rs::Geometry::Mesh {
                    filename: file.display().to_string(),
                    scale: Some(urdf_rs::Vec3(scale)),
                }
            }
            GeomType::Plane | GeomType::Hfield | GeomType::Sdf => {
                return Ok(Err(format!(
                    "a geom of the kind {:?} isn't read",
                    geom.type_
                )));
            }
        };
        Ok(Ok((shape, None, at)))
    }

    fn wrong(&self, value: String, remedy: &str) -> Error {
        Error::input(
            format!("{}: {}: mesh", self.path.display(), self.of),
            value,
            remedy,
        )
    }

    /// The file of a mesh, and the factors of its coordinates.
    fn mesh(&self, geom: &Geom) -> Result<(PathBuf, [f64; 3])> {
        let name = geom.mesh.as_deref().unwrap_or_default();
        let Some(asset) = self.model.assets.mesh(name) else {
            let remedy = "there is no <mesh> of this name among the assets";
            return Err(self.wrong(format!("{name:?}"), remedy));
        };
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let Some(file) = self.model.resolve_mesh_file(asset, folder) else {
            let remedy = "it has no file, and vertices within the XML aren't read: write it to an STL or OBJ file";
            return Err(self.wrong(format!("{name:?}"), remedy));
        };
        if asset.refpose != mjcf_rs::Pose::default() {
            let remedy = "refpos and refquat aren't read: move the mesh itself";
            return Err(self.wrong(format!("{name:?}"), remedy));
        }
        Ok((std::path::absolute(&file).unwrap_or(file), asset.scale))
    }

    /// A piece at unit density, in its own frame; none of what has no volume.
    fn unit(&self, geom: &Geom, [x, y, z]: [f64; 3]) -> Result<Option<Inertial>> {
        let centred = |volume: f64, moments: [f64; 3]| {
            Some(Inertial {
                mass: volume,
                center: Vector3::zeros(),
                inertia: Matrix3::from_diagonal(&(volume * Vector3::from(moments))),
            })
        };
        let ellipsoid = |a: f64, b: f64, c: f64| {
            let moments = [b * b + c * c, a * a + c * c, a * a + b * b].map(|m| m / 5.0);
            centred(4.0 / 3.0 * PI * a * b * c, moments)
        };
        Ok(match geom.type_ {
            GeomType::Sphere => ellipsoid(x, x, x),
            GeomType::Ellipsoid => ellipsoid(x, y, z),
            GeomType::Box => {
                let moments = [y * y + z * z, x * x + z * z, x * x + y * y].map(|m| m / 3.0);
                centred(8.0 * x * y * z, moments)
            }
            GeomType::Cylinder => {
                let across = x * x / 4.0 + y * y / 3.0;
                centred(2.0 * PI * x * x * y, [across, across, 0.5 * x * x])
            }
            GeomType::Capsule => {
                // A cylinder between two halves of a ball, whose centroids are 3/8 of the radius from their planes.
                let (side, ball) = (2.0 * PI * x * x * y, 4.0 / 3.0 * PI * x.powi(3));
                let across = side * (x * x / 4.0 + y * y / 3.0)
                    + ball * (0.4 * x * x + y * y + 0.75 * x * y);
                let along = side * 0.5 * x * x + ball * 0.4 * x * x;
                let volume = side + ball;
                centred(volume, [across, across, along].map(|m| m / volume))
            }
            GeomType::Mesh => {
                let (file, scale) = self.mesh(geom)?;
                let mut mesh = read_unchecked(&file, 1.0).map_err(|e| e.of(self.of))?;
                for vertex in &mut mesh.vertices {
                    vertex.component_mul_assign(&Vec3::from(scale));
                }
                if scale.iter().product::<f64>() < 0.0 {
                    mesh.faces.iter_mut().for_each(|face| face.swap(1, 2));
                }
                let points = mesh.vertices.clone();
                let closed: Option<TriMesh> = mesh.into_mesh().ok();
                let name = file.display().to_string();
                let whole = closed.or_else(|| hull(&name, &points).ok());
                whole.map(|mesh| {
                    let found = MassProperties::of(&mesh);
                    Inertial {
                        mass: found.volume,
                        center: found.centroid,
                        inertia: found.inertia,
                    }
                })
            }
            GeomType::Plane | GeomType::Hfield | GeomType::Sdf => None,
        })
    }
}

/// Where a piece is and its sizes: between two points where the file gives those.
fn placed(geom: &Geom, pose: &Isometry3<f64>) -> (Isometry3<f64>, [f64; 3]) {
    let Some([ax, ay, az, bx, by, bz]) = geom.fromto else {
        return (*pose, geom.size);
    };
    // The pose is that of frames around it. Axes point from the second end to the first.
    let [a, b] = [[ax, ay, az], [bx, by, bz]].map(|x| (pose * Point3::from(x)).coords);
    let along = a - b;
    let turn = Rotation3::rotation_between(&Vector3::z(), &along)
        .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector3::x_axis(), PI));
    let turn = UnitQuaternion::from_rotation_matrix(&turn);
    let at = Isometry3::from_parts(Translation3::from(0.5 * (a + b)), turn);
    let (radius, half) = (geom.size[0], 0.5 * along.norm());
    let sizes = match geom.type_ {
        GeomType::Box | GeomType::Ellipsoid => [radius, radius, half],
        _ => [radius, half, 0.0],
    };
    (at, sizes)
}

/// Of all pieces of a body, each of its own mass or density; none if they have no mass.
pub(super) fn mass_properties(
    geometries: &Geometries,
    body: &Body,
    density: f64,
) -> Result<Option<Inertial>> {
    let mut parts: Vec<Inertial> = Vec::new();
    for geom in &body.geoms {
        let pose = isometry(&geom.pose);
        let (at, sizes) = placed(geom, &pose);
        let Some(unit) = geometries.unit(geom, sizes)? else {
            if let Some(mass) = geom.mass.filter(|m| *m != 0.0) {
                let place = format!(
                    "{}: {}: mass of a geom",
                    geometries.path.display(),
                    geometries.of
                );
                let remedy =
                    "it has no volume to spread the mass over: give the body an <inertial>";
                return Err(Error::input(place, mass, remedy));
            }
            continue;
        };
        let density = match geom.mass {
            Some(mass) if unit.mass > 0.0 => mass / unit.mass,
            _ => geom.density.unwrap_or(density),
        };
        if density < 0.0 || !density.is_finite() {
            let place = format!(
                "{}: {}: density of a geom",
                geometries.path.display(),
                geometries.of
            );
            let remedy = "give a mass and a density of zero or more";
            return Err(Error::input(place, density, remedy));
        }
        let own = Inertial {
            mass: density * unit.mass,
            center: unit.center,
            inertia: density * unit.inertia,
        };
        parts.push(own.moved(&at));
    }
    let together = Inertial::together(&parts);
    Ok((together.mass > 0.0).then_some(together))
}
