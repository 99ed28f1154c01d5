//! Scenes.

use crate::array::{fixed, or_zeros, row};
use crate::body::Body;
use crate::error::{OrRaise, counts, exception, input};
use crate::fluid::{Contact, Fluid};
use crate::interrupt::light;
use crate::joint::Motion;
use crate::mapping;
use crate::robot::{self, Robot};
use hydrograd::scene::{Force, Site, Wall, WallSurface};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyBool, PyDict, PyString};
use std::path::PathBuf;

/// A force whose keys or values don't fit.
fn not_a_force(kind: &str, why: impl std::fmt::Display) -> PyErr {
    input(
        "add_force",
        format!("{kind:?}: {why}"),
        "must be a kind of force with the keys that it has in a scene file",
    )
}

/// Keys of forces that name a body.
const OF_BODIES: [&str; 3] = ["body", "to", "rotor"];

/// Whether it is a name, or nothing.
fn is_text(value: &Bound<'_, PyAny>) -> bool {
    value.is_none() || value.is_instance_of::<PyString>()
}

/// As it is now: other threads may go on with the scene while something is made of it.
pub fn copied(scene: &Bound<'_, Scene>) -> PyResult<hydrograd::Scene> {
    Ok(scene.try_borrow()?.0.clone())
}

/// Whether two scenes are the same; numbers that aren't numbers too.
fn is_same(a: &hydrograd::Scene, b: &hydrograd::Scene) -> bool {
    a == b || a.to_toml().ok() == b.to_toml().ok()
}

/// What a simulation starts from: the fluid, walls, and bodies with their joints.
///
/// `gravity` is in m/s², world axes; `time_step` (s) and `steps` are what a run takes unless told otherwise. Without a
/// `contact`, surfaces may not touch. Bodies are numbered in the order in which they are added. `waterline` is the height (m, against gravity) above which there is no
/// water to displace and to drag.
#[pyclass(eq, module = "hydrograd")]
#[derive(Clone, PartialEq)]
pub struct Scene(pub hydrograd::Scene);

impl Scene {
    /// The name of a body given by its number or its name, as `key` of `what`.
    fn named_body(&self, what: &str, key: &str, body: &Bound<'_, PyAny>) -> PyResult<String> {
        let named = match body.extract::<usize>() {
            Ok(_) if body.is_instance_of::<PyBool>() => None,
            Ok(number) => self.0.bodies.get(number).map(|b| b.name.clone()),
            Err(_) => body.extract::<String>().ok(),
        };
        named
            .filter(|name| self.0.body(name).is_some())
            .ok_or_else(|| {
                input(
                    format!("{what}: {key}"),
                    body.to_string(),
                    format!(
                        "must be the number or name of a body: {:?}",
                        self.body_names()
                    ),
                )
            })
    }
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (fluid=None, *, name="", gravity=None, contact=None, time_step=0.01, steps=100, waterline=None))]
    fn new(
        fluid: Option<PyRef<'_, Fluid>>,
        name: &str,
        gravity: Option<&Bound<'_, PyAny>>,
        contact: Option<PyRef<'_, Contact>>,
        time_step: f64,
        #[pyo3(from_py_with = counts::steps)] steps: usize,
        waterline: Option<f64>,
    ) -> PyResult<Self> {
        let fluid = fluid.map_or_else(hydrograd::Fluid::fresh_water, |f| f.0);
        let mut scene = hydrograd::Scene::new(fluid);
        scene.name = name.to_string();
        scene.gravity = or_zeros("scene: gravity", gravity)?;
        scene.contact = contact.map(|c| c.0);
        scene.time_step = time_step;
        scene.steps = steps;
        scene.waterline = waterline;
        Ok(Self(scene))
    }

    /// Reads a scene file (TOML); paths of meshes are relative to it, and absolute in the scene.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        light(py, || hydrograd::Scene::load(path)).map(Self)
    }

    /// A scene from TOML text; paths of meshes are relative to `folder` (default: the current one), and absolute in the scene.
    #[staticmethod]
    #[pyo3(signature = (text, folder=None))]
    fn from_toml(py: Python<'_>, text: &str, folder: Option<PathBuf>) -> PyResult<Self> {
        // The folder in which the program is now, wherever it goes on.
        let folder = folder.unwrap_or_else(|| ".".into());
        light(py, || hydrograd::Scene::from_toml(text, folder)).map(Self)
    }

    /// A scene of the robot in a URDF or MJCF file, in still fresh water, gravity along -z. Choices are those of `add_robot`.
    #[staticmethod]
    #[pyo3(signature = (path, **choices))]
    fn from_urdf(
        py: Python<'_>,
        path: PathBuf,
        choices: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        robot::scene_of(py, path, choices).map(Self)
    }

    /// Adds the robot of a URDF or MJCF file: a body for each link that moves, a site for each that doesn't. Choices are the keys of a scene file's [[robot]]: `base` "free"
    /// or "fixed", `position` (m) and `rotation` (rad) of the root, `prefix` of all names, `package_path` (folders), `shape` "collision", "visual", "hull" or "none",
    /// `bad_meshes` "hull" or "refuse", `faces` of hulls, `mimic` "follow" or "independent", `actuated`, `limits`, `drag`, `servo` (of all joints that are controls), `start` (joint to coordinate), `motions`
    /// (joint to the `Motion` that drives it), `zeros` (joint whose zero isn't sure to its offset, the coordinate of a body "JOINT zero" before it), `joints` (joint to its `actuated`, `servo`, `passive`, `limits`, `limit_stiffness`), `links` (link to its `shape`, `mass`, `density`, `keep`, and what `Body` takes: `drag`, `center_of_mass`, `inertia`, `volume`, `center_of_buoyancy`,
    /// `added_mass`, `overlaps_parent`).
    #[pyo3(signature = (path, **choices))]
    fn add_robot(
        slf: &Bound<'_, Self>,
        path: PathBuf,
        choices: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Robot> {
        let before = copied(slf)?;
        let mut scene = before.clone();
        let robot = robot::add(slf.py(), &mut scene, path, choices)?;
        let mut now = slf.try_borrow_mut()?;
        if !is_same(&now.0, &before) {
            // What was added meanwhile would be lost.
            return Err(exception(hydrograd::Error::Unsupported {
                what: "add_robot to a scene that changes meanwhile".into(),
                why: "another thread changed it while the robot's files were read".into(),
                instead: "let one thread at a time change a scene".into(),
            }));
        }
        now.0 = scene;
        Ok(robot)
    }

    /// The scene as TOML text, from which `from_toml` makes an equal one.
    fn to_toml(&self) -> PyResult<String> {
        self.0.to_toml().or_raise()
    }

    /// Adds a body and gives its number, by which `positions[step, number]` and objectives know it.
    fn add(&mut self, body: PyRef<'_, Body>) -> PyResult<usize> {
        let mut added = body.body.clone();
        if let Some(parent) = body.parent {
            let carrier = self.0.bodies.get(parent).ok_or_else(|| {
                input(
                    "body: parent",
                    parent,
                    "must be the number of a body that was added before",
                )
            })?;
            added.parent = Some(carrier.name.clone());
        }
        Ok(self.0.add(added).0)
    }

    /// Adds a plane wall through `point` (m) with `normal` into the fluid. `surface` is "rigid", or "free" for a flat free
    /// surface without waves (with the fidelities "reduced" and "auto", and "full" by panels).
    #[pyo3(signature = (point, normal, surface="rigid"))]
    fn add_wall(
        &mut self,
        point: &Bound<'_, PyAny>,
        normal: &Bound<'_, PyAny>,
        surface: &str,
    ) -> PyResult<()> {
        let surface = match surface {
            "rigid" => WallSurface::Rigid,
            "free" => WallSurface::Free,
            _ => {
                return Err(input(
                    "wall: surface",
                    format!("{surface:?}"),
                    "must be \"rigid\" or \"free\"",
                ));
            }
        };
        self.0.walls.push(Wall {
            point: fixed("wall: point", point)?,
            normal: fixed("wall: normal", normal)?,
            surface,
        });
        Ok(())
    }

    /// Adds a force by its kind and the keys that it has in a scene file, bodies by name or number; places and directions are in the body's frame. A "spring", with a damper
    /// beside it, joins the point `at` (m) of `body` and `to_at` of the body `to` (default: of the world): `stiffness`
    /// in N/m, `rest_length` in m, `damping` in N s/m. "lubrication" is what viscous water does in thin gaps, between all surfaces or in the gaps of `bodies` (names):
    /// their `roughness` in m, the `viscosity` in Pa s, and `reach` in m, the distance at which the pressure has fallen to that in the open.
    ///
    /// "damping" of a `body` about the point `at`: −(D_L ν + D_Q |ν| ν), ν its twist through the water; `linear` and `quadratic` are (6,), along x, y, z and about
    /// x, y, z, or (6, 6). A "thruster" pushes a `body` at the point `at` along `direction` by a command, which is a control: its thrust in N is Σ c_k |u|^(k−1) u with
    /// the coefficients `polynomial`, or a smooth curve through the points (command, thrust) of `table` (n, 2), or the command; `dead_band` is a command, `torque` (m) the
    /// moment about the direction per newton, `loss` (N s/m) what is lost per command and speed, above the command `smoothing`. With a `rotor`, a body on
    /// a joint of one velocity, that velocity is the command, and the control is the one that it is driven to with the `time_constant` (s). A "fin" lifts and drags a `body` at `at`,
    /// the middle of its chord: directions `chord` (toward the leading edge) and `normal`, `length` of the chord (m), `area` (m²), `lift_slope` (1/rad), `drag`
    /// along the chord and `induced_drag` across it, smoothed below `smoothing` (m/s). A "float" at the point `at` of a `body` has a `volume` (m³) and a `mass` (kg),
    /// which is made part of the body's. An "edge" is a trailing edge of a `body` with its middle `at`, and a `span` in m: directions `forward` (to the head) and `normal`, `factor` the part of
    /// the theory's force, which fades below a speed `smoothing` forward (m/s). A "tendon" runs over
    /// the joints of bodies at lever arms, `arms` = {body: m}: on each its arm times the tension k (g u - Σ r q) - c Σ r q̇, with a control u, `stiffness` k (N/m), `damping` c (N s/m) and `gain` g (m).
    /// A "current" beside the fluid's: a `velocity` (m/s, world axes) times the share by depth of a smooth curve through the points (depth in m, share) of `profile` (n, 2) and the
    /// factor `over_time`, a `Motion`; all bodies in the water feel it.
    #[pyo3(signature = (kind, **fields))]
    fn add_force(
        &mut self,
        kind: &str,
        fields: Option<&Bound<'_, PyDict>>,
        py: Python<'_>,
    ) -> PyResult<()> {
        let given = PyDict::new(py);
        for (key, value) in fields.into_iter().flatten() {
            let name = key.extract::<String>()?;
            match value.extract::<PyRef<'_, Motion>>() {
                Ok(motion) => given.set_item(key, motion.keys(py)?)?,
                // A name may be that of a body to come.
                Err(_) if OF_BODIES.contains(&name.as_str()) && !is_text(&value) => {
                    given.set_item(key, self.named_body(kind, &name, &value)?)?;
                }
                Err(_) => given.set_item(key, value)?,
            }
        }
        given.set_item("kind", kind)?;
        // Arrays as lists, mappings as dictionaries.
        let code = c"lambda x: dict(x) if hasattr(x, 'keys') else x.tolist()";
        let options = PyDict::new(py);
        options.set_item("default", py.eval(code, None, None)?)?;
        let json = py
            .import("json")?
            .call_method("dumps", (given,), Some(&options));
        let text: String = json.map_err(|e| not_a_force(kind, e))?.extract()?;
        let force = Force::from_json(&text).map_err(|e| match e {
            hydrograd::Error::Parse { message, .. } => not_a_force(kind, message),
            e => exception(e),
        })?;
        self.0.add_force(force);
        Ok(())
    }

    /// Adds a named frame on a `body` (number or name), at `position` (m) and `rotation` (rotation vector, rad) in its frame, and gives its number: rollouts tell
    /// "site_positions", "site_rotations", "site_attitudes" (roll, pitch, yaw), "site_velocities", "site_gyros" (rates in own axes) and "site_accelerations".
    #[pyo3(signature = (name, body, position=None, rotation=None))]
    fn add_site(
        &mut self,
        name: &str,
        body: &Bound<'_, PyAny>,
        position: Option<&Bound<'_, PyAny>>,
        rotation: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<usize> {
        let named = self.named_body("site", "body", body)?;
        let site = Site::new(name, named)
            .at(or_zeros("site: position", position)?)
            .rotated(or_zeros("site: rotation", rotation)?);
        Ok(self.0.add_site(site))
    }

    /// Names of the sites, in order.
    #[getter]
    fn site_names(&self) -> Vec<String> {
        self.0.sites.iter().map(|s| s.name.clone()).collect()
    }

    /// Where the scene starts: joint coordinates `q` (q_size), generalised velocity `v` (v_size) or, instead of it, generalised
    /// momentum M(q)v. What is None starts at the origin and at rest.
    #[pyo3(signature = (q=None, v=None, *, momentum=None))]
    fn set_initial(
        &mut self,
        q: Option<&Bound<'_, PyAny>>,
        v: Option<&Bound<'_, PyAny>>,
        momentum: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let list = |place: &str, given: Option<&Bound<'_, PyAny>>| {
            given.map_or(Ok(Vec::new()), |g| row(place, g))
        };
        self.0.initial = hydrograd::scene::Initial {
            q: list("initial: q", q)?,
            v: list("initial: v", v)?,
            momentum: list("initial: momentum", momentum)?,
        };
        Ok(())
    }

    /// The parameters of all bodies' shapes with their values, m (a mesh's scale: 1): "finger.size.y", "ball.radius" …
    #[getter]
    fn shape_parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.0.shape_parameters().into_py_dict(py)
    }

    /// The scene with other values of some of `shape_parameters`, or of coordinates of a mesh's vertices ("hull.vertex.17.x") that is given number by number. What would turn a
    /// body inside out is refused.
    fn with_shape_parameters(slf: &Bound<'_, Self>, values: &Bound<'_, PyAny>) -> PyResult<Self> {
        let scene = copied(slf)?;
        let values = mapping::named("with_shape_parameters", "a number", Some(values))?;
        light(slf.py(), || {
            let values = values.iter().map(|(name, value)| (name.as_str(), *value));
            scene.with_shape_parameters(values)
        })
        .map(Self)
    }

    /// Says what is wrong with the scene, if anything is.
    fn validate(slf: &Bound<'_, Self>) -> PyResult<()> {
        let scene = copied(slf)?;
        light(slf.py(), || scene.validate())
    }

    /// Number of the body with this name.
    fn index(&self, name: &str) -> PyResult<usize> {
        let found = self.0.body(name).map(|id| id.0);
        found.ok_or_else(|| {
            let names: Vec<&str> = self.0.bodies.iter().map(|b| b.name.as_str()).collect();
            input(
                "scene: body",
                format!("{name:?}"),
                format!("must be one of {names:?}"),
            )
        })
    }

    /// Names of the bodies, in order.
    #[getter]
    fn body_names(&self) -> Vec<String> {
        self.0.bodies.iter().map(|b| b.name.clone()).collect()
    }

    /// Name of the scene.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// The walls: a point (m) and the normal into the fluid, as they were given, and "rigid" or "free".
    #[getter]
    fn walls(&self) -> Vec<([f64; 3], [f64; 3], &'static str)> {
        let surface = |wall: &Wall| match wall.surface {
            WallSurface::Rigid => "rigid",
            WallSurface::Free => "free",
        };
        let walls = self.0.walls.iter();
        walls.map(|w| (w.point, w.normal, surface(w))).collect()
    }

    /// The fluid.
    #[getter]
    fn fluid(&self) -> Fluid {
        Fluid(self.0.fluid)
    }

    /// Gravity, m/s², world axes.
    #[getter]
    fn gravity(&self) -> (f64, f64, f64) {
        self.0.gravity.into()
    }

    /// Time step that a run takes unless told otherwise, s.
    #[getter]
    fn time_step(&self) -> f64 {
        self.0.time_step
    }

    /// Steps that a run takes unless told otherwise.
    #[getter]
    fn steps(&self) -> usize {
        self.0.steps
    }

    fn __len__(&self) -> usize {
        self.0.bodies.len()
    }

    fn __repr__(&self) -> String {
        format!("Scene({:?}, bodies={:?})", self.0.name, self.body_names())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let text = slf.try_borrow()?.to_toml()?;
        Ok((slf.get_type().getattr("from_toml")?, (text,)))
    }
}
