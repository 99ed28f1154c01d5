//! Shapes of bodies as parameters: which are asked for, how surfaces move with them, and what that changes of a body alone.

use super::submerged::SubmergedBody;
use super::surface::{Coarse, Surface, pose, semi_axes};
use crate::adjoint::lie::{Pose, Vec3};
use crate::geometry::{MassProperties, TriMesh};
use crate::scene::{Body, Scene, Shape};
use crate::{Error, Result};

/// All shapes.
const ALL: &str = "*";
/// What a mesh's vertices are called.
const VERTEX: &str = "vertex";
const AXES: [&str; 3] = ["x", "y", "z"];
/// Part of a length by which it is changed where derivatives are taken by differences.
const STEP: f64 = 0.02;

/// A shape parameter of a body in a scene.
#[derive(Clone, Debug)]
pub(crate) struct ShapeChange {
    /// The body, by its number in the scene.
    pub body: usize,
    /// Name without the body's: `size.y`.
    pub name: String,
    /// Value, m (of a mesh's scale: 1).
    pub value: f64,
    /// Size of a change that says something.
    pub size: f64,
    /// The shape's frame in the body's.
    offset: Pose,
    what: What,
}

#[derive(Clone, Debug)]
enum What {
    /// A number of its formula, or the scale of a mesh.
    Formula(Shape, usize),
    /// A coordinate of a vertex of its mesh.
    Vertex(usize, usize),
}

/// A body in the water with a shape parameter changed.
pub(crate) struct Changed<'a> {
    body: &'a SubmergedBody<'a>,
    mesh: Option<TriMesh>,
    coarse: Option<Coarse>,
    ellipsoid: Option<([f64; 3], Pose)>,
}

impl ShapeChange {
    /// Those that `wanted` names in a scene whose bodies have these surfaces: `body.size.y`, all that begin with a name (`body`, `body.size`), or `*` for all of all bodies.
    /// A mesh's vertices are asked for as `body.vertex` (all that faces use) or `body.vertex.17`, with the numbers that they have in the shape; `*` leaves them out.
    ///
    /// # Errors
    /// A name that fits none, with those that there are.
    pub fn wanted(
        scene: &Scene,
        surfaces: &[Option<Surface>],
        wanted: &[String],
    ) -> Result<Vec<Self>> {
        let mut out = Vec::new();
        if wanted.is_empty() {
            return Ok(out);
        }
        let mut met = vec![false; wanted.len()];
        for (b, body) in scene.bodies.iter().enumerate() {
            let (Some(shape), Some(surface)) = (&body.shape, &surfaces[b]) else {
                continue;
            };
            let mut asked = |name: &str, vertex: bool| {
                let full = format!("{}.{name}", body.name);
                let fits = |pattern: &String| {
                    let below = full.strip_prefix(pattern.as_str());
                    let named = below.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
                    // Thousands of vertices are meant by their own name only.
                    let short = pattern.len() <= body.name.len();
                    (named || pattern == ALL) && !(vertex && short)
                };
                let mut any = false;
                for (pattern, met) in wanted.iter().zip(&mut met) {
                    let fits = fits(pattern);
                    *met |= fits;
                    any |= fits;
                }
                any
            };
            let [low, high] = surface.mesh.bounds();
            let extent = (high - low).norm();
            let offset = pose(&body.shape_at);
            for (at, (name, value)) in shape.parameters().into_iter().enumerate() {
                if asked(&name, false) {
                    let coordinate = name.starts_with("profile");
                    out.push(Self {
                        body: b,
                        value,
                        size: if coordinate { 0.2 * extent } else { value },
                        offset,
                        what: What::Formula(shape.clone(), at),
                        name,
                    });
                }
            }
            if !shape.is_mesh() || !body.refine.is_empty() {
                continue;
            }
            let numbers = given_numbers(shape, surface.mesh.vertices().len());
            for (v, (x, given)) in surface.mesh.vertices().iter().zip(&numbers).enumerate() {
                let local = offset.apply_inverse(x);
                for (axis, letter) in AXES.into_iter().enumerate() {
                    let name = format!("{VERTEX}.{given}.{letter}");
                    if asked(&name, true) {
                        out.push(Self {
                            body: b,
                            value: local[axis],
                            size: 0.05 * extent,
                            offset,
                            what: What::Vertex(v, axis),
                            name,
                        });
                    }
                }
            }
        }
        match met.iter().position(|met| !met) {
            None => Ok(out),
            Some(i) => Err(unknown(scene, &wanted[i])),
        }
    }

    /// Velocity of a point of the body (m, its frame) per unit of the parameter; none where only vertices have one.
    pub fn velocity(&self, p: &Vec3) -> Option<Vec3> {
        match &self.what {
            What::Formula(shape, at) => {
                let local = self.offset.apply_inverse(p);
                Some(self.offset.rotation * shape.parameter_velocity(*at, &local))
            }
            What::Vertex(..) => None,
        }
    }

    /// Velocities of the vertices of a mesh of the body, its frame.
    pub fn vertices(&self, mesh: &TriMesh) -> Vec<Vec3> {
        self.at_vertices(mesh.vertices())
    }

    /// The same from the vertices.
    pub fn at_vertices(&self, vertices: &[Vec3]) -> Vec<Vec3> {
        let still = Vec3::zeros();
        match &self.what {
            What::Formula(..) => (vertices.iter())
                .map(|p| self.velocity(p).unwrap_or(still))
                .collect(),
            What::Vertex(vertex, axis) => {
                let mut out = vec![still; vertices.len()];
                out[*vertex] = self.offset.rotation * Vec3::ith(*axis, 1.0);
                out
            }
        }
    }

    /// Volume, centroid and inertia of the body (its frame, unit density) with the parameter changed by `t`.
    ///
    /// # Errors
    /// A formula whose numbers left what they may be.
    pub fn properties(&self, surface: &Surface, t: f64) -> Result<MassProperties> {
        // A prism's mesh is exact, and a larger change might bend its profile inwards.
        if let (Some(changed), true) = (self.formula(t), surface.by_formula)
            && !matches!(changed, Shape::Prism { .. })
            && let Some(found) = MassProperties::by_formula(&changed)?
        {
            return Ok(found.transformed(&self.offset));
        }
        Ok(self.moved(&surface.mesh, t).mass_properties())
    }

    /// The shape with the parameter changed by `t`, where it is a number of its formula (or a mesh's scale).
    pub fn formula(&self, t: f64) -> Option<Shape> {
        match &self.what {
            What::Formula(shape, at) => Some(shape.with_nth_parameter(*at, self.value + t)),
            What::Vertex(..) => None,
        }
    }

    /// How far any vertex of a mesh of the body moves per unit of the parameter, m.
    pub fn reach(&self, mesh: &TriMesh) -> f64 {
        let speeds = self.vertices(mesh).into_iter().map(|v| v.norm());
        speeds.fold(0.0, f64::max)
    }

    /// A mesh of the body with the parameter changed by `t`.
    pub fn moved(&self, mesh: &TriMesh, t: f64) -> TriMesh {
        mesh.displaced(&self.vertices(mesh), t)
    }

    /// Semi-axes of an ellipsoid by formula with the parameter changed by `t`, m.
    pub fn semi_axes(&self, t: f64) -> Option<[f64; 3]> {
        semi_axes(&self.formula(t)?)
    }

    /// Their rates: the semi-axes are linear in the parameter.
    pub fn semi_axes_rates(&self) -> Option<[f64; 3]> {
        let (now, larger) = (self.semi_axes(0.0)?, self.semi_axes(self.value)?);
        Some([0, 1, 2].map(|k| (larger[k] - now[k]) / self.value))
    }

    /// The body in the water with the parameter changed by `t`, its meshes' faces as they are.
    pub fn changed<'a>(&self, body: &'a SubmergedBody<'a>, t: f64) -> Changed<'a> {
        let moved = |mesh: &TriMesh| self.moved(mesh, t);
        let axes = body.ellipsoid.and_then(|_| self.semi_axes(t));
        let ellipsoid = axes.map(|axes| (axes, self.offset));
        Changed {
            body,
            mesh: body.mesh.map(&moved),
            coarse: body.coarse.map(|coarse| Coarse {
                mesh: moved(&coarse.mesh),
                ratio: coarse.ratio,
            }),
            ellipsoid,
        }
    }

    /// Derivative with respect to the parameter of something smooth, from its values at six changes of it: exact up to rounding for polynomials up to sixth degree, which volumes and their
    /// moments are.
    ///
    /// # Errors
    /// Those of `at`.
    pub fn slope<const N: usize>(&self, at: impl Fn(f64) -> Result<[f64; N]>) -> Result<[f64; N]> {
        let h = STEP * self.size;
        let mut out = [0.0; N];
        for (k, weight) in [(1.0, 45.0), (2.0, -9.0), (3.0, 1.0)] {
            let (above, below) = (at(k * h)?, at(-k * h)?);
            for (x, (a, b)) in out.iter_mut().zip(above.iter().zip(&below)) {
                *x += weight * (a - b) / (60.0 * h);
            }
        }
        Ok(out)
    }
}

impl Changed<'_> {
    /// The body as it is then.
    pub fn body(&self) -> SubmergedBody<'_> {
        SubmergedBody {
            name: self.body.name,
            mesh: self.mesh.as_ref(),
            ellipsoid: self.ellipsoid,
            solid: None,
            coarse: self.coarse.as_ref(),
            added_mass: None,
            regions: self.body.regions.clone(),
        }
    }
}

/// Whether vertices of a body's mesh are among what `wanted` asks for.
pub(super) fn vertices_are_asked_for(body: &Body, wanted: &[String]) -> bool {
    let vertices = |pattern: &String| {
        let own = pattern.strip_prefix(body.name.as_str())?;
        let rest = own.strip_prefix('.')?.strip_prefix(VERTEX)?;
        Some(rest.is_empty() || rest.starts_with('.'))
    };
    wanted.iter().any(|pattern| vertices(pattern) == Some(true))
}

/// The number that each of the `count` vertices of a shape's mesh has in the shape as given, by which [`Scene::with_shape_parameter`] sets it: the mesh leaves out vertices that no face uses.
fn given_numbers(shape: &Shape, count: usize) -> Vec<usize> {
    let Shape::Triangles { vertices, faces } = shape else {
        return (0..count).collect();
    };
    let mut used = vec![false; vertices.len()];
    faces.iter().flatten().for_each(|&v| used[v] = true);
    (0..vertices.len()).filter(|&v| used[v]).collect()
}

/// The error of a name that no shape parameter has.
fn unknown(scene: &Scene, name: &str) -> Error {
    let mut known = Vec::new();
    for body in &scene.bodies {
        let Some(shape) = &body.shape else { continue };
        let own = shape.parameters().into_iter();
        known.extend(own.map(|(name, _)| format!("{}.{name}", body.name)));
        if shape.is_mesh() && body.refine.is_empty() {
            known.push(format!(
                "{}.{VERTEX} (all vertices that its faces use)",
                body.name
            ));
        }
    }
    Error::input(
        "settings: shape_parameters",
        format!("{name:?}"),
        match known.is_empty() {
            true => "no body of the scene has a shape with parameters (a mesh with refined regions has none)".into(),
            false => format!(
                "must be one of {}, what such a name begins with, or {ALL:?} for all but vertices",
                known.join(", ")
            ),
        },
    )
}
