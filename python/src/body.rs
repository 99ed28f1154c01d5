//! Bodies and their drag.

use crate::array::{self, Dim, fixed, or_zeros, row};
use crate::error::{input, shown};
use crate::joint::{Joint, Motion};
use crate::shape::Shape;
use hydrograd::scene::{self, CollisionPiece, DragPart, Placement, Refinement};
use pyo3::prelude::*;

/// Drag per area of a body's surface: `linear` in kg/(m² s), `quadratic` dimensionless (½ρc|w|w); the parts of the local
/// velocity that drag are "tangential", "normal" or "total".
#[pyclass(frozen, eq, module = "hydrograd")]
#[derive(Clone, PartialEq)]
pub struct Drag(pub scene::Drag);

fn part(name: &str, given: &str) -> PyResult<DragPart> {
    match given {
        "tangential" => Ok(DragPart::Tangential),
        "normal" => Ok(DragPart::Normal),
        "total" => Ok(DragPart::Total),
        _ => Err(input(
            format!("drag: {name}"),
            format!("{given:?}"),
            "must be \"tangential\", \"normal\" or \"total\"",
        )),
    }
}

#[pymethods]
impl Drag {
    #[new]
    #[pyo3(signature = (*, linear=0.0, part="tangential", quadratic=0.0, quadratic_part="tangential"))]
    fn new(linear: f64, part: &str, quadratic: f64, quadratic_part: &str) -> PyResult<Self> {
        Ok(Self(scene::Drag {
            part: self::part("part", part)?,
            linear,
            quadratic_part: self::part("quadratic_part", quadratic_part)?,
            quadratic,
        }))
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.0)
    }
}

/// What a joint with one coordinate does by itself: a spring of `stiffness` (N/m or N m/rad) with its `rest` coordinate (m or rad), viscous `damping` (N s/m or
/// N m s/rad), Coulomb `friction` (N or N m) that sets in over `friction_speed` (m/s or rad/s), and the inertia `armature` (kg or kg m²) of its drive.
#[pyclass(frozen, eq, module = "hydrograd")]
#[derive(Clone, PartialEq)]
pub struct Passive(pub scene::Passive);

#[pymethods]
impl Passive {
    #[new]
    #[pyo3(signature = (*, stiffness=0.0, rest=0.0, damping=0.0, friction=0.0, friction_speed=0.02, armature=0.0))]
    fn new(
        stiffness: f64,
        rest: f64,
        damping: f64,
        friction: f64,
        friction_speed: f64,
        armature: f64,
    ) -> Self {
        Self(scene::Passive {
            stiffness,
            rest,
            damping,
            friction,
            friction_speed,
            armature,
        })
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.0)
    }
}

/// Lets a joint with one coordinate follow that of the body named `body`: q = `ratio` · q(leader) + `offset` (m or rad).
#[pyclass(frozen, eq, module = "hydrograd")]
#[derive(Clone, PartialEq)]
pub struct Mimic(pub scene::Mimic);

#[pymethods]
impl Mimic {
    #[new]
    #[pyo3(signature = (body, *, ratio=1.0, offset=0.0))]
    fn new(body: &str, ratio: f64, offset: f64) -> Self {
        Self(scene::Mimic::new(body).ratio(ratio).offset(offset))
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.0)
    }
}

/// Makes the control of an actuated joint with one coordinate its target (m or rad): a drive of `stiffness` k (N/m or N m/rad) and `damping` c (N s/m or N m s/rad), implicit, and so
/// stable however stiff, with the integrators "momentum-euler", "energy-euler" and "midpoint". It aims at where the joint will be a time step Δt later, τ = k (u − q − Δt q̇) − c q̇: with every
/// integrator it damps by k Δt more than c.
#[pyclass(frozen, eq, module = "hydrograd")]
#[derive(Clone, PartialEq)]
pub struct Servo(pub scene::Servo);

#[pymethods]
impl Servo {
    #[new]
    #[pyo3(signature = (stiffness, damping=0.0))]
    fn new(stiffness: f64, damping: f64) -> Self {
        Self(scene::Servo::new(stiffness, damping))
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.0)
    }
}

/// A rigid body with the joint that carries it.
///
/// `shape` is what the water sees; without one the body is dry. Give `density` (kg/m³) or `mass` (kg); `inertia` about
/// the centre of mass (xx, yy, zz or also xy, xz, yz; kg m²) and `center_of_mass` (m) follow from the shape if left out.
/// `position` (m) and `rotation` (axis times angle, rad) place the joint's frame in the frame of `parent`, a body's name or
/// number, or the world. `actuated` makes the joint's forces controls (N, N m; a free joint has six), `thruster` a wrench on
/// the body in world axes. `locked` holds the joint, `motion` (one per coordinate) drives it, `limits` (m or rad) stop it; `passive` gives it spring, damping,
/// friction and armature, `mimic` lets it follow another, `servo` makes its control a target.
/// `shape_position` and `shape_rotation` place the shape in the body; `refine` lists balls (center, radius, edge), m,
/// where its faces are made smaller. `collision` lists the convex pieces that the body is for contact instead of its shape, each
/// a shape, (shape, position) or (shape, position, rotation) in the body's frame. `start` are the joint's coordinates at the start, unless the
/// scene is given all by `set_initial`. `added_mass` (6, 6; m³, m⁴, m⁵) replaces the body's own at unit density, about its origin.
/// `volume` (m³) and `center_of_buoyancy` (m) are what it is buoyant by and where, instead of the shape's volume at its centroid.
#[pyclass(frozen, eq, module = "hydrograd")]
#[derive(Clone, PartialEq)]
pub struct Body {
    /// The body, without its parent where that is a number.
    pub body: hydrograd::Body,
    /// The parent, where it was given as a number.
    pub parent: Option<usize>,
}

#[derive(FromPyObject)]
enum Parent {
    Number(usize),
    Name(String),
}

/// The items of a list, or nothing of None; what isn't one of them, or no list, is an `InputError` of `place`.
fn items<'py, T>(place: &str, given: Option<&Bound<'py, PyAny>>, expected: &str) -> PyResult<Vec<T>>
where
    T: for<'a> FromPyObject<'a, 'py>,
{
    let Some(given) = given else {
        return Ok(Vec::new());
    };
    let each = |(k, item): (usize, PyResult<Bound<'py, PyAny>>)| {
        let item = item?;
        let refuse = |_| input(format!("{place}[{k}]"), shown(&item), expected);
        item.extract::<T>().map_err(Into::into).map_err(refuse)
    };
    let list = given.try_iter();
    let list = list.map_err(|_: PyErr| input(place, shown(given), "must be a list"))?;
    list.enumerate().map(each).collect()
}

#[derive(FromPyObject)]
struct Ball<'py>(Bound<'py, PyAny>, f64, f64);

/// A convex piece for contact: its shape, and where it is.
#[derive(FromPyObject)]
enum Piece<'py> {
    Turned(PyRef<'py, Shape>, Bound<'py, PyAny>, Bound<'py, PyAny>),
    Placed(PyRef<'py, Shape>, Bound<'py, PyAny>),
    #[pyo3(transparent)]
    Bare(PyRef<'py, Shape>),
}

impl Piece<'_> {
    fn made(&self, place: &str) -> PyResult<CollisionPiece> {
        let (shape, position, rotation) = match self {
            Self::Turned(shape, position, rotation) => (shape, Some(position), Some(rotation)),
            Self::Placed(shape, position) => (shape, Some(position), None),
            Self::Bare(shape) => (shape, None, None),
        };
        let at = Placement::new(
            or_zeros(&format!("{place}: position"), position)?,
            or_zeros(&format!("{place}: rotation"), rotation)?,
        );
        Ok(CollisionPiece {
            shape: shape.0.clone(),
            at,
        })
    }
}

#[pymethods]
impl Body {
    #[new]
    #[pyo3(signature = (
        shape=None, *, name="", density=None, mass=None, inertia=None, center_of_mass=None, position=None,
        rotation=None, joint=None, parent=None, actuated=false, thruster=false, locked=false, motion=None, limits=None,
        limit_stiffness=None, drag=None, shape_position=None, shape_rotation=None, refine=None, added_mass=None,
        overlaps_parent=false, collision=None, passive=None, mimic=None, servo=None, start=None, volume=None, center_of_buoyancy=None
    ))]
    #[expect(
        clippy::too_many_arguments,
        reason = "one per keyword of the constructor"
    )]
    fn new(
        shape: Option<PyRef<'_, Shape>>,
        name: &str,
        density: Option<f64>,
        mass: Option<f64>,
        inertia: Option<&Bound<'_, PyAny>>,
        center_of_mass: Option<&Bound<'_, PyAny>>,
        position: Option<&Bound<'_, PyAny>>,
        rotation: Option<&Bound<'_, PyAny>>,
        joint: Option<PyRef<'_, Joint>>,
        parent: Option<&Bound<'_, PyAny>>,
        actuated: bool,
        thruster: bool,
        locked: bool,
        motion: Option<Vec<PyRef<'_, Motion>>>,
        limits: Option<&Bound<'_, PyAny>>,
        limit_stiffness: Option<f64>,
        drag: Option<PyRef<'_, Drag>>,
        shape_position: Option<&Bound<'_, PyAny>>,
        shape_rotation: Option<&Bound<'_, PyAny>>,
        refine: Option<&Bound<'_, PyAny>>,
        added_mass: Option<&Bound<'_, PyAny>>,
        overlaps_parent: bool,
        collision: Option<&Bound<'_, PyAny>>,
        passive: Option<PyRef<'_, Passive>>,
        mimic: Option<PyRef<'_, Mimic>>,
        servo: Option<PyRef<'_, Servo>>,
        start: Option<&Bound<'_, PyAny>>,
        volume: Option<f64>,
        center_of_buoyancy: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let at = |field: &str| {
            if name.is_empty() {
                format!("body: {field}")
            } else {
                format!("body {name:?}: {field}")
            }
        };
        for (field, value) in [("density", density), ("mass", mass), ("volume", volume)] {
            if let Some(value) = value
                && !(value >= 0.0 && value.is_finite())
            {
                return Err(input(at(field), value, "must be finite and not negative"));
            }
        }
        let added_mass = added_mass.map(|given| {
            let rows = array::array(&at("added_mass"), given, &[Dim::Is(6), Dim::Is(6)])?;
            PyResult::Ok(rows.values.chunks(6).map(<[f64]>::to_vec).collect())
        });
        let balls = "must be (center, radius, edge), m";
        let refine: Vec<Ball<'_>> = items(&at("refine"), refine, balls)?;
        let refine = refine.iter().map(|Ball(center, radius, edge)| {
            Ok(Refinement {
                center: fixed(&at("refine: center"), center)?,
                radius: *radius,
                edge: *edge,
            })
        });
        let kinds = "must be a shape, (shape, position) or (shape, position, rotation)";
        let pieces: Vec<Piece<'_>> = items(&at("collision"), collision, kinds)?;
        if collision.is_some() && pieces.is_empty() {
            return Err(input(
                at("collision"),
                "no pieces",
                "give some, or leave it out: the body is then its shape for contact",
            ));
        }
        let collision = pieces
            .iter()
            .enumerate()
            .map(|(k, piece)| piece.made(&at(&format!("collision[{k}]"))));
        let optional = |field: &str, given: Option<&Bound<'_, PyAny>>| {
            given.map(|g| fixed(&at(field), g)).transpose()
        };
        let parent = parent.map(|given| {
            given.extract().map_err(|_: PyErr| {
                let expected = "must be the name of a body, or its number, counted from 0";
                input(at("parent"), shown(given), expected)
            })
        });
        let (number, parent) = match parent.transpose()? {
            Some(Parent::Number(number)) => (Some(number), None),
            Some(Parent::Name(name)) => (None, Some(name)),
            None => (None, None),
        };
        let body = hydrograd::Body {
            shape: shape.map(|s| s.0.clone()),
            shape_at: Placement::new(
                or_zeros(&at("shape_position"), shape_position)?,
                or_zeros(&at("shape_rotation"), shape_rotation)?,
            ),
            refine: refine.collect::<PyResult<_>>()?,
            collision: collision.collect::<PyResult<_>>()?,
            mass,
            density,
            center_of_mass: optional("center_of_mass", center_of_mass)?,
            volume,
            center_of_buoyancy: optional("center_of_buoyancy", center_of_buoyancy)?,
            inertia: inertia
                .map(|given| row(&at("inertia"), given))
                .transpose()?,
            added_mass: added_mass.transpose()?,
            parent,
            overlaps_parent,
            placement: Placement::new(
                or_zeros(&at("position"), position)?,
                or_zeros(&at("rotation"), rotation)?,
            ),
            joint: joint.map_or_else(Default::default, |j| j.0),
            start: start.map_or(Ok(Vec::new()), |given| row(&at("start"), given))?,
            motion: motion.map(|list| list.iter().map(|m| m.0.clone()).collect()),
            locked,
            limits: limits
                .map(|given| fixed(&at("limits"), given))
                .transpose()?,
            limit_stiffness,
            passive: passive.map(|p| p.0),
            mimic: mimic.map(|m| m.0.clone()),
            actuated,
            servo: servo.map(|s| s.0),
            thruster,
            drag: drag.map(|d| d.0),
            name: name.to_string(),
            origin: Default::default(),
        };
        Ok(Self {
            body,
            parent: number,
        })
    }

    /// Its name; empty until it is added to a scene if it was given none.
    #[getter]
    fn name(&self) -> &str {
        &self.body.name
    }

    /// Its shape.
    #[getter]
    fn shape(&self) -> Option<Shape> {
        self.body.shape.clone().map(Shape)
    }

    /// Its joint.
    #[getter]
    fn joint(&self) -> Joint {
        Joint(self.body.joint)
    }

    /// Its density, kg/m³, if that was given.
    #[getter]
    fn density(&self) -> Option<f64> {
        self.body.density
    }

    /// Its mass, kg, if that was given.
    #[getter]
    fn mass(&self) -> Option<f64> {
        self.body.mass
    }

    /// Position of its joint in the parent's frame, m.
    #[getter]
    fn position(&self) -> (f64, f64, f64) {
        self.body.placement.position.into()
    }

    fn __repr__(&self) -> String {
        let shape = self.body.shape.as_ref().map_or("dry", |s| s.kind());
        format!(
            "Body({:?}, {shape}, {})",
            self.body.name,
            self.body.joint.kind()
        )
    }
}
