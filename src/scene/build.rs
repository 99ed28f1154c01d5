//! Scenes written in Rust.
//!
//! ```
//! use hydrograd::scene::{Body, Fluid, Scene, Shape};
//!
//! let mut scene = Scene::new(Fluid::fresh_water());
//! scene.add(Body::new(Shape::sphere(0.05)).density(998.0).at([-0.1, 0.0, 0.0]).actuated());
//! let coin = scene.add(Body::new(Shape::ellipsoid([0.04, 0.04, 0.01])).density(998.0));
//! assert_eq!(scene.bodies[coin.0].name, "body 1");
//! scene.validate()?;
//! # Ok::<(), hydrograd::Error>(())
//! ```

#[cfg(feature = "urdf")]
use super::Imports;
use super::{
    Body, CollisionPiece, Drag, Fluid, Initial, Joint, Motion, Placement, Preset, Refinement,
    Scene, Shape, Wall,
};

/// Methods that give the same with one thing set, each `name(arguments) => field = value`.
macro_rules! setters {
    ($type:ident { $($(#[$about:meta])* $name:ident($($x:ident: $of:ty),*) => $($field:ident).+ = $value:expr;)* }) => {
        impl $type {
            $(
                $(#[$about])*
                pub fn $name(mut self, $($x: $of),*) -> Self {
                    self.$($field).+ = $value;
                    self
                }
            )*
        }
    };
}

/// A body of a scene, by its place in [`Scene::bodies`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BodyId(pub usize);

impl Scene {
    /// An empty scene: no gravity, no walls, 100 steps of 0.01 s.
    pub fn new(fluid: Fluid) -> Self {
        Self {
            name: String::new(),
            fluid,
            gravity: [0.0; 3],
            waterline: None,
            time_step: 0.01,
            steps: 100,
            preset: Preset::Default,
            walls: Vec::new(),
            contact: None,
            bodies: Vec::new(),
            #[cfg(feature = "urdf")]
            robots: Vec::new(),
            #[cfg(feature = "urdf")]
            imports: Imports::default(),
            forces: Vec::new(),
            sites: Vec::new(),
            initial: Initial::default(),
            controller: None,
        }
    }

    /// Adds a body, named `body 0`, `body 1`, … by its [`BodyId`] if it has no name.
    pub fn add(&mut self, mut body: Body) -> BodyId {
        let mut number = self.bodies.len();
        while body.name.is_empty() {
            let name = format!("body {number}");
            if self.body(&name).is_none() {
                body.name = name;
            }
            number += 1;
        }
        self.bodies.push(body);
        BodyId(self.bodies.len() - 1)
    }

    /// The body of this name.
    pub fn body(&self, name: &str) -> Option<BodyId> {
        let at = self.bodies.iter().position(|body| body.name == name);
        at.map(BodyId)
    }

    /// Adds a plane rigid wall through `point`, m, with `normal` into the fluid.
    pub fn add_wall(&mut self, point: [f64; 3], normal: [f64; 3]) {
        self.walls.push(Wall::rigid(point, normal));
    }

    /// Sets the target number of faces of every shape given by formula; meshes stay as they are.
    pub fn set_faces(&mut self, faces: usize) {
        for body in &mut self.bodies {
            if let Some(shape) = &mut body.shape {
                shape.set_faces(faces);
            }
        }
    }
}

impl Fluid {
    /// Fresh water at 20 °C, 998 kg/m³, at rest far away.
    pub fn fresh_water() -> Self {
        Self {
            density: 998.0,
            current: [0.0; 3],
        }
    }

    /// No fluid at all: density zero.
    pub fn none() -> Self {
        Self {
            density: 0.0,
            current: [0.0; 3],
        }
    }
}

impl Placement {
    /// A translation, m, and a rotation vector, rad.
    pub fn new(position: [f64; 3], rotation: [f64; 3]) -> Self {
        Self { position, rotation }
    }
}

impl Body {
    /// A free body of this shape, at the world's origin; it still needs a density or a mass.
    pub fn new(shape: Shape) -> Self {
        Self {
            shape: Some(shape),
            ..Self::dry()
        }
    }

    /// A free body without a surface; the water doesn't see it unless it's given an added mass.
    pub fn dry() -> Self {
        Self::default()
    }

    /// Makes faces that touch a ball (body's frame; center and radius in m) smaller, until no edge is longer
    /// than `edge`, m. Call it again for more balls.
    pub fn refine(mut self, center: [f64; 3], radius: f64, edge: f64) -> Self {
        self.refine.push(Refinement {
            center,
            radius,
            edge,
        });
        self
    }

    /// Adds a convex piece that the body is for contact instead of its shape, at a position (m) and with a rotation vector (rad) in the
    /// body's frame. Call it again for more pieces.
    pub fn collision_piece(mut self, shape: Shape, position: [f64; 3], rotation: [f64; 3]) -> Self {
        let at = Placement::new(position, rotation);
        self.collision.push(CollisionPiece { shape, at });
        self
    }

    /// Fixes the body to its parent, or to the world.
    pub fn fixed(self) -> Self {
        self.joint(Joint::Fixed)
    }
}

setters! { Body {
    /// Name, unique in the scene.
    named(name: impl Into<String>) => name = name.into();
    /// Density, kg/m³, from which mass and inertia follow.
    density(density: f64) => density = Some(density);
    /// Mass, kg.
    mass(mass: f64) => mass = Some(mass);
    /// Inertia about the centre of mass, body axes, kg m²: `[xx, yy, zz]` or
    /// `[xx, yy, zz, xy, xz, yz]`.
    inertia(inertia: impl Into<Vec<f64>>) => inertia = Some(inertia.into());
    /// Centre of mass in the body's frame, m.
    center_of_mass(center: [f64; 3]) => center_of_mass = Some(center);
    /// Volume by which the body is buoyant, m³, instead of its shape's.
    volume(volume: f64) => volume = Some(volume);
    /// Where buoyancy acts in the body's frame, m, instead of the shape's centroid.
    center_of_buoyancy(center: [f64; 3]) => center_of_buoyancy = Some(center);
    /// The body's own added mass in unbounded water, at unit density, about its origin, body axes, instead of the computed one.
    added_mass(rows: [[f64; 6]; 6]) => added_mass = Some(rows.iter().map(|row| row.to_vec()).collect());
    /// Position of the joint's frame in the parent's frame, m: where the body is at q = 0.
    at(position: [f64; 3]) => placement.position = position;
    /// Rotation of the joint's frame in the parent's frame: axis times angle, rad.
    rotated(rotation: [f64; 3]) => placement.rotation = rotation;
    /// Pose of the shape in the body's frame: translation, m, and rotation vector, rad.
    shape_at(position: [f64; 3], rotation: [f64; 3]) => shape_at = Placement::new(position, rotation);
    /// How the body moves against its parent; [`Joint::Free`] if never called.
    joint(joint: Joint) => joint = joint;
    /// Name of the body that carries this one; add that one first.
    child_of(parent: impl Into<String>) => parent = Some(parent.into());
    /// Lets the surface touch or overlap that of the body that carries it; the two then don't feel
    /// each other through the water.
    overlaps_parent() => overlaps_parent = true;
    /// Coordinates of the joint where the scene starts, unless the scene's `initial.q` says.
    start(q: impl Into<Vec<f64>>) => start = q.into();
    /// Drives the joint by a given motion, one per coordinate.
    driven(motion: impl Into<Vec<Motion>>) => motion = Some(motion.into());
    /// Holds the joint where it starts.
    locked() => locked = true;
    /// Stops a prismatic or revolute joint at the ends of a range `[lower, upper]`, m or rad.
    limits(range: [f64; 2]) => limits = Some(range);
    /// Stiffness of the stops at the limits, N/m or N m/rad.
    limit_stiffness(stiffness: f64) => limit_stiffness = Some(stiffness);
    /// Makes the joint's generalised forces controls.
    actuated() => actuated = true;
    /// Makes a wrench on the body (world axes, about its origin; N, N m) a control.
    thruster() => thruster = true;
    /// Drag on the body's surface.
    drag(drag: Drag) => drag = Some(drag);
} }
