//! Forces on bodies and joints that don't come from the water's kinetic energy, a file for each kind.
//!
//! A force adds spatial wrenches (moment about the world's origin) on bodies, and generalised forces of joints (user
//! coordinates), at a configuration and a velocity; the balance of momenta knows forces by this trait alone.
//! To add one: a file with the type, its declared parameters and its `assemble`, and its line in `FORCES`.

mod actuation;
mod current;
mod curve;
mod damping;
mod displaced;
mod drag;
mod edge;
mod fin;
mod local;
mod lubrication;
mod passive;
mod rotor;
mod servo;
mod spring;
mod stream;
mod tendon;
mod thrust;
mod thruster;
mod waterline;
mod weight;

use super::{BodyData, BodyValues, Declarations, Parameter, Parameters, Shapes};
use crate::Result;
use crate::adjoint::drag::Element;
use crate::adjoint::lie::{Mat6, Pose, Vec3, Vec6, linear, six};
use crate::adjoint::waterline::Hull;
use crate::coupling::lubrication::Bearing;
use crate::multibody::Tree;
use crate::scene::Scene;
use nalgebra::DVector;
use std::ops::Range;
use std::sync::Arc;
pub use stream::{Streams, Undisturbed};
pub use waterline::Waterline;

/// Makes a force from a scene, and declares its parameters; `None` where a scene has none of its kind.
type Assemble = fn(&ForceParts, &mut Declarations) -> Option<Box<dyn ForceModel>>;

/// All kinds of forces, in the order in which they are added up.
const FORCES: &[Assemble] = &[
    weight::gravity,
    weight::buoyancy,
    waterline::buoyancy,
    weight::floats,
    drag::linear,
    drag::quadratic,
    thruster::assemble,
    actuation::assemble,
    passive::assemble,
    servo::assemble,
    spring::assemble,
    lubrication::assemble,
    damping::assemble,
    thrust::assemble,
    rotor::assemble,
    fin::assemble,
    edge::assemble,
    tendon::assemble,
    current::assemble,
];

/// What forces are made from.
pub struct ForceParts<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Time step, s.
    pub time_step: f64,
    /// Its joints.
    pub tree: &'a Tree,
    /// Constants of its bodies.
    pub bodies: &'a [BodyData],
    /// What their parameters start from.
    pub values: &'a [BodyValues],
    /// Surface of each body that has one.
    pub surfaces: &'a [Vec<Element>],
    /// The same as closed meshes, where the water has a surface.
    pub hulls: &'a [Option<Hull>],
    /// Above which there is no water.
    pub waterline: Option<Waterline>,
    /// Gaps that forces of viscous water act in.
    pub lubricated: Vec<Lubricated>,
    /// Currents by depth and time.
    pub streams: Arc<Streams>,
    /// Surfaces of bodies whose shapes are parameters, changed.
    pub changed: &'a [ChangedSurface<'a>],
    /// Shapes that are parameters, and what follows from them.
    pub shapes: &'a Shapes,
    /// The own added mass of each body that they act on, at unit density, body's frame.
    pub added_mass: Vec<(usize, Mat6)>,
}

/// A body's surface with a shape parameter a little larger, and a little smaller: what forces take the derivative from that follow from the surface. It is made where it is asked for:
/// those of all vertices of a hull would fill the memory.
pub struct ChangedSurface<'a> {
    /// The body.
    pub body: usize,
    /// Its parameter.
    pub parameter: Parameter,
    /// The change of it, m.
    pub step: f64,
    /// The pieces of the surface, with the parameter changed by so much.
    pub surface: Box<dyn Fn(f64) -> Vec<Element> + 'a>,
    /// The same as a closed mesh.
    pub hull: Box<dyn Fn(f64) -> Hull + 'a>,
}

impl ChangedSurface<'_> {
    /// Larger and smaller by the step.
    fn steps(&self) -> [f64; 2] {
        [self.step, -self.step]
    }
}

/// A gap that a force of viscous water acts in.
#[derive(Clone)]
pub struct Lubricated {
    /// The force's number in the scene.
    pub force: usize,
    /// The body on whose surface it is solved.
    pub first: usize,
    /// The other one; none for a wall.
    pub second: Option<usize>,
    /// The two surfaces.
    pub bearing: Bearing,
}

/// A gap whose viscous water would take more faces than there may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoarseGap {
    /// The body on whose surface it is solved.
    pub first: usize,
    /// The other one; none for a wall.
    pub second: Option<usize>,
    /// The shortest distance of the surfaces, m.
    pub distance: f64,
    /// An edge of a face over how long it should be, where that is most.
    pub ratio: f64,
}

/// The worse one of both.
pub(crate) fn coarser(a: Option<CoarseGap>, b: Option<CoarseGap>) -> Option<CoarseGap> {
    let both = a.into_iter().chain(b);
    both.reduce(|a, b| if b.ratio > a.ratio { b } else { a })
}

/// All forces of a scene.
pub fn assemble(parts: &ForceParts, parameters: &mut Declarations) -> Arc<[Box<dyn ForceModel>]> {
    let made = FORCES.iter().filter_map(|make| make(parts, parameters));
    made.collect()
}

/// Where bodies and joints are.
#[derive(Clone, Copy)]
pub struct Place<'a> {
    /// Poses of the bodies in the world.
    pub poses: &'a [Pose],
    /// Joint coordinates.
    pub q: &'a DVector<f64>,
    /// When they are there, s.
    pub time: f64,
    /// The parameters.
    pub parameters: &'a Parameters,
}

/// How they move there, and what controls them.
#[derive(Clone, Copy)]
pub struct Moving<'a> {
    /// Where they are.
    pub place: Place<'a>,
    /// Spatial twists of the bodies.
    pub twists: &'a [Vec6],
    /// Generalised velocity.
    pub v: &'a DVector<f64>,
    /// Velocity of the undisturbed water that is the same everywhere and always, m/s.
    pub current: &'a Vec3,
    /// What is added to it by depth and time.
    pub streams: &'a Streams,
    /// Controls.
    pub control: &'a DVector<f64>,
}

impl Moving<'_> {
    /// Twist of body `b` through the water.
    pub fn relative(&self, b: usize) -> Vec6 {
        let water = self.current + self.streams.at_body(b, &self.place).velocity;
        self.twists[b] - six(&water, &Vec3::zeros())
    }

    /// Transpose of [`Moving::relative`] at a fixed frame of the body: added to the cotangents of the twist and of what the water's velocity there follows from.
    fn relative_vjp(&self, b: usize, relative_bar: &Vec6, bar: &mut LoadBars) {
        bar.twist[b] += relative_bar;
        let water_bar = Undisturbed {
            velocity: -linear(relative_bar),
            acceleration: Vec3::zeros(),
        };
        (self.streams).at_body_vjp(b, &self.place, &water_bar, bar);
    }
}

/// A change of the velocity at a fixed configuration, or a virtual velocity that does work against forces.
#[derive(Clone, Copy)]
pub struct Velocity<'a> {
    /// Spatial twists of the bodies.
    pub twists: &'a [Vec6],
    /// Of the joints, user coordinates.
    pub v: &'a DVector<f64>,
}

/// What forces add up to.
pub struct Loads {
    /// Spatial wrench on each body, N and N m about the world's origin.
    pub wrenches: Vec<Vec6>,
    /// Generalised force of each joint velocity, N or N m, user coordinates.
    pub joints: DVector<f64>,
}

impl Loads {
    /// None, on `bodies` bodies with `velocities` velocities.
    pub fn zeros(bodies: usize, velocities: usize) -> Self {
        Self {
            wrenches: vec![Vec6::zeros(); bodies],
            joints: DVector::zeros(velocities),
        }
    }
}

/// Takes the terms of a force, each as what adds it.
pub type Terms<'t> = dyn FnMut(&dyn Fn(&mut Loads)) + 't;

/// What a transpose adds to.
pub struct LoadBars<'a> {
    /// Cotangents of the poses: work on a spatial displacement of each body.
    pub pose: &'a mut [Vec6],
    /// Of the twists.
    pub twist: &'a mut [Vec6],
    /// Of the joint coordinates as such, in their tangent space; that of the poses isn't part of it.
    pub q: &'a mut DVector<f64>,
    /// Of the joint velocities as such.
    pub v: &'a mut DVector<f64>,
    /// Of the controls.
    pub control: &'a mut DVector<f64>,
    /// Of the parameters.
    pub parameters: &'a mut Parameters,
}

/// Bodies that could make one rigid motion together.
pub struct Together<'a> {
    /// Whether each body is one of them.
    pub bodies: &'a [bool],
    /// Velocities of the joints to the world that they hang on.
    pub roots: &'a [Range<usize>],
}

impl Together<'_> {
    /// Whether the body is one of them.
    pub fn holds(&self, b: usize) -> bool {
        self.bodies[b]
    }

    /// Whether a velocity is that of a joint to the world that they hang on.
    pub fn hangs_on(&self, v: usize) -> bool {
        self.roots.iter().any(|root| root.contains(&v))
    }

    /// What a force between two bodies, or one and the world, knows of the world: all or nothing.
    pub fn across(&self, first: Option<usize>, second: Option<usize>) -> Outside {
        match [first, second].map(|b| b.is_some_and(|b| self.holds(b))) {
            [true, true] | [false, false] => Outside::Nothing,
            _ => Outside::All,
        }
    }
}

/// What a force knows of the world outside of bodies that move together, and so which momenta of theirs it changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outside {
    /// Nothing: it acts between them, or not on them. It changes no momentum of theirs.
    Nothing,
    /// A direction: it changes neither momenta across it nor the angular momentum about it.
    Along(Vec3),
    /// Where they are, or how they move.
    All,
}

/// A force along a fixed line of a body, by a command which is a control.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Commanded {
    /// The control.
    pub control: usize,
    /// The body.
    pub body: usize,
    /// Wrench of a newton of thrust, body's frame, about its origin: 1, m.
    pub wrench: Vec6,
    /// A command as large as they come.
    pub command: f64,
    /// The thrust that it gives in water at rest, N.
    pub thrust: f64,
}

/// A force, on any bodies and joints. It is a pure function of where they are, how they move, controls and parameters.
pub trait ForceModel: Send + Sync {
    /// Its name, for messages and checks.
    fn name(&self) -> &'static str;

    /// Adds what it does.
    fn add(&self, at: &Moving, out: &mut Loads);

    /// Hands what [`ForceModel::add`] is a sum of to `each`, term by term, for the sizes that it is rounded by: what may cancel against one another apart, and the terms of a small difference of
    /// large ones without their signs.
    fn efforts(&self, at: &Moving, each: &mut Terms) {
        each(&|out| self.add(at, out));
    }

    /// Adds the tangent of [`ForceModel::add`] along a change of the velocity; nothing where it doesn't depend on it.
    fn jvp(&self, _at: &Moving, _change: &Velocity, _out: &mut Loads) {}

    /// The same along several changes, each with what it adds to; for a force whose derivative is dear and the same for all of them.
    fn jvps(&self, at: &Moving, changes: &[Velocity], out: &mut [Loads]) {
        for (change, out) in changes.iter().zip(out) {
            self.jvp(at, change, out);
        }
    }

    /// Adds the transpose of [`ForceModel::add`] in all its arguments: the gradient of its power on the velocity `z`.
    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars);

    /// [`ForceModel::vjp`] for several velocities at one motion, where nobody may ask for the cotangents of the parameters; to be given where they share work.
    fn vjps(&self, at: &Moving, z: &[Velocity], bars: &mut [LoadBars], _by_parameters: bool) {
        for (z, bar) in z.iter().zip(bars) {
            self.vjp(at, z, bar);
        }
    }

    /// Adds what [`ForceModel::add`] has that isn't there at an instant: a servo looks ahead by a time step.
    fn ahead(&self, _at: &Moving, _out: &mut Loads) {}

    /// Whether it acts on joints with one coordinate alone, each by its own coordinate and velocity, and may resist them so stiffly that the mean velocity of a step won't do for it
    /// (`dynamics::late`).
    fn is_late(&self) -> bool {
        false
    }

    /// Whether it resists motion: its derivative by the velocity is then symmetric, and takes energy. Contact is solved with what it changes by as contact changes the velocity
    /// (`dynamics::resistance`), and with that of those that are late.
    fn resists(&self) -> bool {
        false
    }

    /// Whether it is solved with contact, at the end of a step and in the velocity that the step moves by: a damper that is too stiff to act at any other. It is then
    /// linear in the twists of the bodies, symmetric, takes energy away, and acts on bodies alone; integrators that don't solve contact refuse it.
    fn solved_with_contact(&self) -> bool {
        false
    }

    /// Refuses a place at which it has no value; asked of those that are solved with contact, once a step before they are.
    ///
    /// # Errors
    /// A solve of its own that fails there.
    fn check_at(&self, _place: &Place) -> Result<()> {
        Ok(())
    }

    /// The gap that it resolves worst of those that it doesn't resolve there; asked of those that are solved with contact.
    fn coarse_at(&self, _place: &Place) -> Option<CoarseGap> {
        None
    }

    /// Whether it does anything there at some velocity; asked of those that are solved with contact.
    fn acts(&self, _place: &Place) -> bool {
        true
    }

    /// What it knows of the world outside of bodies that move together, at these parameters.
    fn outside(&self, _group: &Together, _parameters: &Parameters) -> Outside {
        Outside::All
    }

    /// Pairs of bodies of which it makes one feel how the other moves or where it is; `None` where it may be any.
    fn ties(&self) -> Option<Vec<[usize; 2]>> {
        None
    }

    /// Those that there are at a place; asked of those that are solved with contact.
    fn ties_at(&self, _place: &Place) -> Option<Vec<[usize; 2]>> {
        self.ties()
    }

    /// Whether it changes no energy but its own potential one, at these parameters and where nothing is controlled.
    fn conservative(&self, _parameters: &Parameters) -> bool {
        false
    }

    /// The most power, W, that controls put in beyond that of joint forces and wrenches which are controls themselves, by forces as `at` one state and velocities as of another,
    /// `moving`: over a step either may be that of its start or of its end. For warnings of energy from nowhere.
    fn driven_power(&self, _at: &Moving, _moving: &Moving) -> f64 {
        0.0
    }

    /// Controls of joints that are where these are to be, and no forces.
    fn targets(&self) -> Vec<usize> {
        Vec::new()
    }

    /// Forces along fixed lines of bodies that controls command, at these parameters.
    fn commanded(&self, _parameters: &Parameters) -> Vec<Commanded> {
        Vec::new()
    }

    /// What it displaces beside the volumes of the bodies, less what of these is out of the water: volumes, m³, and their moments about the world's origin, m⁴.
    fn displaced(&self, _place: &Place) -> Vec<(f64, Vec3)> {
        Vec::new()
    }

    /// Refuses parameters that no single one's range does.
    ///
    /// # Errors
    /// Those that the force can't have together.
    fn check(&self, _parameters: &Parameters) -> Result<()> {
        Ok(())
    }

    /// Potential energy, J, of a force that has one.
    fn potential_energy(&self, _place: &Place) -> f64 {
        0.0
    }
}
