//! Robots in URDF files.

use crate::body::{Drag, Passive, Servo};
use crate::error::input;
use crate::interrupt::light;
use crate::joint::Motion;
use crate::mapping;
use hydrograd::Fluid;
use hydrograd::scene::{Added, RobotReport};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Choices of a robot that don't fit.
fn not_a_choice(why: impl std::fmt::Display) -> PyErr {
    input(
        "robot",
        why,
        "must be choices that a scene file's [[robot]] has, with such values",
    )
}

/// What `json` doesn't know, as a scene file has it: drag, passive forces and servos by their keys, arrays as lists, mappings as dictionaries, paths as text.
#[pyfunction]
fn written<'py>(py: Python<'py>, given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    if let Ok(drag) = given.cast::<Drag>() {
        return to_dict(py, serde_json::to_string(&drag.get().0));
    }
    if let Ok(passive) = given.cast::<Passive>() {
        return to_dict(py, serde_json::to_string(&passive.get().0));
    }
    if let Ok(servo) = given.cast::<Servo>() {
        return to_dict(py, serde_json::to_string(&servo.get().0));
    }
    if given.hasattr("tolist")? {
        return given.call_method0("tolist");
    }
    match given.hasattr("keys")? {
        true => py.get_type::<PyDict>().call1((given,)),
        false => Ok(given.str()?.into_any()),
    }
}

/// The choices as a scene file has them.
fn choices(py: Python<'_>, given: Option<&Bound<'_, PyDict>>) -> PyResult<hydrograd::scene::Robot> {
    let plain = PyDict::new(py);
    let mut motions: BTreeMap<String, Vec<hydrograd::scene::Motion>> = BTreeMap::new();
    if let Some(given) = given {
        for (key, value) in given {
            if value.is_none() {
                continue;
            }
            if key.eq("motions")? {
                let given = mapping::named("robot: motions", "a Motion, or several", Some(&value))?;
                for (joint, each) in given {
                    let each: Bound<'_, PyAny> = each;
                    let each: Vec<PyRef<'_, Motion>> = match each.extract::<PyRef<'_, Motion>>() {
                        Ok(one) => vec![one],
                        Err(_) => each.extract()?,
                    };
                    motions.insert(joint, each.iter().map(|m| m.0.clone()).collect());
                }
                continue;
            }
            if key.eq("urdf")? {
                let remedy = "leave it out: the file is the first argument, `path`";
                return Err(input("robot: urdf", value.repr()?, remedy));
            }
            plain.set_item(&key, &value)?;
        }
    }
    let options = PyDict::new(py);
    options.set_item("default", wrap_pyfunction!(written, py)?)?;
    options.set_item("allow_nan", false)?;
    let json = py.import("json")?;
    for (key, value) in &plain {
        if let Err(why) = json.call_method("dumps", (&value,), Some(&options)) {
            let remedy = "must be what a scene file's [[robot]] has, its numbers finite";
            let why = format!("{} ({})", value.repr()?, why.value(py));
            return Err(input(format!("robot: {key}"), why, remedy));
        }
    }
    let json = json.call_method("dumps", (plain,), Some(&options));
    let text: String = json.map_err(not_a_choice)?.extract()?;
    let mut robot: hydrograd::scene::Robot = serde_json::from_str(&text).map_err(not_a_choice)?;
    robot.motions = motions;
    Ok(robot)
}

fn to_dict<'py>(py: Python<'py>, text: serde_json::Result<String>) -> PyResult<Bound<'py, PyAny>> {
    let text = text.map_err(not_a_choice)?;
    py.import("json")?.call_method1("loads", (text,))
}

/// A robot that was added to a scene: its bodies and joints by name, as the numbers of their bodies, and what it came to.
#[pyclass(frozen, module = "hydrograd")]
pub struct Robot {
    bodies: BTreeMap<String, usize>,
    joints: BTreeMap<String, usize>,
    thrusters: Vec<String>,
    report: RobotReport,
}

#[pymethods]
impl Robot {
    /// Numbers of its bodies in the scene, by their links' names.
    #[getter]
    fn bodies(&self) -> BTreeMap<String, usize> {
        self.bodies.clone()
    }

    /// Numbers of the bodies that its joints move, by the joints' names; those that follow others have no coordinate and aren't listed.
    #[getter]
    fn joints(&self) -> BTreeMap<String, usize> {
        self.joints.clone()
    }

    /// Names of its thrusters, forces of the scene: actuators of sites in MJCF files.
    #[getter]
    fn thrusters(&self) -> Vec<String> {
        self.thrusters.clone()
    }

    /// What it came to, as `inspect_robot` gives it.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_dict(py, serde_json::to_string(&self.report))
    }

    fn __repr__(&self) -> String {
        let names: Vec<&String> = self.bodies.keys().collect();
        format!("Robot({:?}, bodies={names:?})", self.report.robot)
    }

    fn __str__(&self) -> String {
        self.report.to_string()
    }
}

impl Robot {
    fn new(scene: &hydrograd::Scene, added: Added) -> Self {
        let named = |id: &hydrograd::BodyId| (scene.bodies[id.0].name.clone(), id.0);
        Self {
            bodies: added.bodies.iter().map(named).collect(),
            joints: added.joints.into_iter().map(|(j, id)| (j, id.0)).collect(),
            thrusters: added.thrusters,
            report: added.report,
        }
    }
}

/// `Scene.from_urdf`.
pub fn scene_of(
    py: Python<'_>,
    path: PathBuf,
    given: Option<&Bound<'_, PyDict>>,
) -> PyResult<hydrograd::Scene> {
    let robot = choices(py, given)?;
    light(py, || hydrograd::Scene::from_urdf(path, &robot))
}

/// `Scene.add_robot`.
pub fn add(
    py: Python<'_>,
    scene: &mut hydrograd::Scene,
    path: PathBuf,
    given: Option<&Bound<'_, PyDict>>,
) -> PyResult<Robot> {
    let robot = choices(py, given)?;
    let added = light(py, || scene.add_robot(path, &robot))?;
    Ok(Robot::new(scene, added))
}

/// What a robot in a URDF file comes to in water of `density` (kg/m³): tree, masses, weight against buoyancy, meshes that were replaced, and what of the file wasn't
/// used. Choices are those of `Scene.add_robot`.
#[pyfunction]
#[pyo3(signature = (path, *, density=998.0, **choices))]
pub fn inspect_robot<'py>(
    py: Python<'py>,
    path: PathBuf,
    density: f64,
    choices: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    let robot = self::choices(py, choices)?;
    let fluid = Fluid {
        density,
        ..Fluid::fresh_water()
    };
    let report = light(py, || robot.inspect(path, &fluid))?;
    to_dict(py, serde_json::to_string(&report))
}
