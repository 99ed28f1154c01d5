//! Scenes written in Rust.
//!
//! ```
//! use hydrograd::scene::{Body, Fluid, Scene, Shape};
//!
//! let mut scene = Scene::new(Fluid::fresh_water());
//! scene.add(Body::new(Shape::sphere(0.05)).density(998.0).at([-0.1, 0.0, 0.0]).actuated());
//! let coin = scene.add(Body::new(Shape::ellipsoid([0.04, 0.04, 0.01])).density(998.0));
//! assert_eq!(scene.bodies[coin.0].name, "body 2");
//! scene.validate()?;
//! # Ok::<(), hydrograd::Error>(())
//! ```

use super::{
    Body, Drag, Fluid, Initial, Joint, Motion, Placement, Preset, Refinement, Scene, Shape, Wall,
};

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
            time_step: 0.01,
            steps: 100,
            preset: Preset::Default,
            walls: Vec::new(),
            contact: None,
            bodies: Vec::new(),
            forces: Vec::new(),
            initial: Initial::default(),
            controller: None,
        }
    }

    /// Adds a body, named `body 1`, `body 2`, … by its place if it has no name.
    pub fn add(&mut self, mut body: Body) -> BodyId {
        let mut number = self.bodies.len() + 1;
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
        Self {
            name: String::new(),
            shape: None,
            shape_at: Placement::default(),
            refine: Vec::new(),
            mass: None,
            density: None,
            center_of_mass: None,
            inertia: None,
            added_mass: None,
            parent: None,
            overlaps_parent: false,
            placement: Placement::default(),
            joint: Joint::Free,
            motion: None,
            locked: false,
            limits: None,
            limit_stiffness: None,
            actuated: false,
            thruster: false,
            drag: None,
        }
    }

    /// Name, unique in the scene.
    pub fn named(mut self, name: impl Into<String>) -> Self {
        self.name = name.into();
        self
    }

    /// Density, kg/m³, from which mass and inertia follow.
    pub fn density(mut self, density: f64) -> Self {
        self.density = Some(density);
        self
    }

    /// Mass, kg.
    pub fn mass(mut self, mass: f64) -> Self {
        self.mass = Some(mass);
        self
    }

    /// Inertia about the centre of mass, body axes, kg m²: `[xx, yy, zz]` or
    /// `[xx, yy, zz, xy, xz, yz]`.
    pub fn inertia(mut self, inertia: impl Into<Vec<f64>>) -> Self {
        self.inertia = Some(inertia.into());
        self
    }

    /// Centre of mass in the body's frame, m.
    pub fn center_of_mass(mut self, center: [f64; 3]) -> Self {
        self.center_of_mass = Some(center);
        self
    }

    /// The body's own added mass at unit density of the fluid, about its origin, body axes.
    pub fn added_mass(mut self, rows: [[f64; 6]; 6]) -> Self {
        self.added_mass = Some(rows.iter().map(|row| row.to_vec()).collect());
        self
    }

    /// Position of the joint's frame in the parent's frame, m: where the body is at q = 0.
    pub fn at(mut self, position: [f64; 3]) -> Self {
        self.placement.position = position;
        self
    }

    /// Rotation of the joint's frame in the parent's frame: axis times angle, rad.
    pub fn rotated(mut self, rotation: [f64; 3]) -> Self {
        self.placement.rotation = rotation;
        self
    }

    /// Pose of the shape in the body's frame: translation, m, and rotation vector, rad.
    pub fn shape_at(mut self, position: [f64; 3], rotation: [f64; 3]) -> Self {
        self.shape_at = Placement::new(position, rotation);
        self
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

    /// How the body moves against its parent; [`Joint::Free`] if never called.
    pub fn joint(mut self, joint: Joint) -> Self {
        self.joint = joint;
        self
    }

    /// Fixes the body to its parent, or to the world.
    pub fn fixed(self) -> Self {
        self.joint(Joint::Fixed)
    }

    /// Name of the body that carries this one; add that one first.
    pub fn child_of(mut self, parent: impl Into<String>) -> Self {
        self.parent = Some(parent.into());
        self
    }

    /// Lets the surface touch or overlap that of the body that carries it; the two then don't feel
    /// each other through the water.
    pub fn overlaps_parent(mut self) -> Self {
        self.overlaps_parent = true;
        self
    }

    /// Drives the joint by a given motion, one per coordinate.
    pub fn driven(mut self, motion: impl Into<Vec<Motion>>) -> Self {
        self.motion = Some(motion.into());
        self
    }

    /// Holds the joint where it starts.
    pub fn locked(mut self) -> Self {
        self.locked = true;
        self
    }

    /// Stops a prismatic or revolute joint at the ends of a range `[lower, upper]`, m or rad.
    pub fn limits(mut self, range: [f64; 2]) -> Self {
        self.limits = Some(range);
        self
    }

    /// Stiffness of the stops at the limits, N/m or N m/rad.
    pub fn limit_stiffness(mut self, stiffness: f64) -> Self {
        self.limit_stiffness = Some(stiffness);
        self
    }

    /// Makes the joint's generalised forces controls.
    pub fn actuated(mut self) -> Self {
        self.actuated = true;
        self
    }

    /// Makes a wrench on the body (world axes, about its origin; N, N m) a control.
    pub fn thruster(mut self) -> Self {
        self.thruster = true;
        self
    }

    /// Drag on the body's surface.
    pub fn drag(mut self, drag: Drag) -> Self {
        self.drag = Some(drag);
        self
    }
}
