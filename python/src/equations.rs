//! The equations of motion at configurations, one or many.

use crate::array::{Rows, fixed, rows, to_python};
use crate::error::{OrRaise, in_order, input};
use crate::interrupt::long;
use crate::simulator::Simulator;
use hydrograd::simulate;
use nalgebra::{DMatrix, DVector, Vector3};
use numpy::PyArrayDyn;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rayon::prelude::*;

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// The equations of motion M(q) v̇ + h(q, v, u) = τ at a configuration, or at many: made by `Simulator.equations`.
///
/// M holds the water's part; h is what is left: Coriolis and centrifugal terms of bodies and water, gravity, buoyancy, drag and springs, less the controls u.
/// Contact and the stops of joints, which a step solves, aren't in it. Where `q` was (N, q_size), all that is given may be (N, …), or one for all, and all
/// that comes back has N in front; the work is spread over all cores. Each call asks the water anew.
#[pyclass(frozen, module = "hydrograd")]
pub struct Equations {
    simulator: Py<Simulator>,
    q: Rows,
    time: f64,
}

/// Something of one configuration, with its number.
trait Part: Fn(&simulate::Equations<'_>, usize) -> hydrograd::Result<Vec<f64>> + Send + Sync {}
impl<F> Part for F where
    F: Fn(&simulate::Equations<'_>, usize) -> hydrograd::Result<Vec<f64>> + Send + Sync
{
}

/// Row by row.
fn listed(m: &DMatrix<f64>) -> Vec<f64> {
    m.transpose().as_slice().to_vec()
}

impl Equations {
    /// At these configurations and the time `time`, s; where the simulator starts if none are given.
    pub fn new(
        simulator: &Bound<'_, Simulator>,
        q: Option<&Bound<'_, PyAny>>,
        time: f64,
    ) -> PyResult<Self> {
        let inner = &simulator.get().inner;
        let q = Rows::or("equations: q", q, inner.start().0)?;
        // Refuses what is no configuration at once.
        for q in &q.values {
            inner.difference(q, q).or_raise()?;
        }
        Ok(Self {
            q,
            simulator: simulator.clone().unbind(),
            time,
        })
    }

    fn velocities(&self) -> usize {
        self.simulator.get().inner.system().tree.velocities()
    }

    /// Rows for the configurations: as many, one for all, or zeros.
    fn given(&self, place: &str, given: Option<&Bound<'_, PyAny>>, n: usize) -> PyResult<Rows> {
        let found = match given {
            Some(given) => rows(place, given, n)?,
            None => Rows::one(DVector::zeros(n)),
        };
        if found.is_many && (!self.q.is_many || found.values.len() != self.q.values.len()) {
            let wanted = match self.q.is_many {
                true => format!("must be one row, or {} as q", self.q.values.len()),
                false => "must be one row, as q".into(),
            };
            return Err(input(place, format!("{} rows", found.values.len()), wanted));
        }
        Ok(found)
    }

    fn controls(&self, u: Option<&Bound<'_, PyAny>>) -> PyResult<Rows> {
        self.given("equations: u", u, self.simulator.get().controls_size())
    }

    fn vector(&self, name: &str, given: Option<&Bound<'_, PyAny>>) -> PyResult<Rows> {
        self.given(&format!("equations: {name}"), given, self.velocities())
    }

    /// A part of all configurations, with this shape for each.
    fn each<'py>(
        &self,
        py: Python<'py>,
        shape: &[usize],
        part: impl Part + 'static,
    ) -> PyResult<Array<'py>> {
        let (inner, q) = (self.simulator.get().inner.clone(), self.q.values.clone());
        let time = self.time;
        let made: Vec<Vec<f64>> = long(py, move |_| {
            let one = |(i, q): (usize, &DVector<f64>)| part(&inner.equations_at(q, time)?, i);
            in_order(q.par_iter().enumerate().map(one))
        })?;
        let lead: &[usize] = match self.q.is_many {
            true => &[made.len()],
            false => &[],
        };
        to_python(py, made.concat(), &[lead, shape].concat())
    }

    /// A body by its number or name.
    fn body(&self, given: &Bound<'_, PyAny>) -> PyResult<usize> {
        let bodies = &self.simulator.get().inner.system().bodies;
        if let Ok(number) = given.extract::<usize>() {
            if number < bodies.len() {
                return Ok(number);
            }
        } else if let Ok(name) = given.extract::<String>()
            && let Some(number) = bodies.iter().position(|b| b.name == name)
        {
            return Ok(number);
        }
        let names: Vec<&str> = bodies.iter().map(|b| b.name.as_str()).collect();
        Err(input(
            "equations: body",
            given.repr()?,
            format!(
                "must be a number under {}, or one of {names:?}",
                names.len()
            ),
        ))
    }
}

fn point(given: Option<&Bound<'_, PyAny>>) -> PyResult<Vector3<f64>> {
    let place = "equations: point";
    given.map_or(Ok(Vector3::zeros()), |x| Ok(fixed::<3>(place, x)?.into()))
}

#[pymethods]
impl Equations {
    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.simulator)
    }

    /// The configurations, (…, q_size).
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        self.q.to_python(py)
    }

    /// M(q) (…, v_size, v_size), of `part` "total", of the bodies alone ("rigid"), or of the water alone ("fluid"); kg, kg m, kg m².
    #[pyo3(signature = (part="total"))]
    fn mass_matrix<'py>(&self, py: Python<'py>, part: &str) -> PyResult<Array<'py>> {
        let n = self.velocities();
        let of = match part {
            "total" => |e: &simulate::Equations<'_>| e.mass_matrix().cloned(),
            "rigid" => |e: &simulate::Equations<'_>| e.rigid_mass_matrix(),
            "fluid" => |e: &simulate::Equations<'_>| e.added_mass_matrix(),
            _ => {
                return Err(input(
                    "mass_matrix: part",
                    format!("{part:?}"),
                    "must be \"total\", \"rigid\" or \"fluid\"",
                ));
            }
        };
        self.each(py, &[n, n], move |e: &simulate::Equations<'_>, _| {
            Ok(listed(&of(e)?))
        })
    }

    /// h(q, v, u) (…, v_size), N and N m: the generalised forces without acceleration. `v` (…, v_size) and `u` (…, control_size) are zero unless given.
    #[pyo3(signature = (v=None, u=None))]
    fn bias_force<'py>(
        &self,
        py: Python<'py>,
        v: Option<&Bound<'_, PyAny>>,
        u: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Array<'py>> {
        let (v, u, n) = (self.vector("v", v)?, self.controls(u)?, self.velocities());
        self.each(py, &[n], move |e: &simulate::Equations<'_>, i| {
            Ok(e.bias_force(v.row(i), u.row(i))?.as_slice().to_vec())
        })
    }

    /// Accelerations v̇ (…, v_size) at the velocities `v`, the controls `u` and further generalised forces `force` (…, v_size), N and N m. Joints that a motion drives, or
    /// that are locked, have the accelerations that `driven` (…, v_size) gives them.
    #[pyo3(signature = (v=None, u=None, *, force=None, driven=None))]
    fn forward_dynamics<'py>(
        &self,
        py: Python<'py>,
        v: Option<&Bound<'_, PyAny>>,
        u: Option<&Bound<'_, PyAny>>,
        force: Option<&Bound<'_, PyAny>>,
        driven: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Array<'py>> {
        let (v, u, n) = (self.vector("v", v)?, self.controls(u)?, self.velocities());
        let (force, driven) = (self.vector("force", force)?, self.vector("driven", driven)?);
        self.each(py, &[n], move |e: &simulate::Equations<'_>, i| {
            let found = e.acceleration(v.row(i), u.row(i), force.row(i), driven.row(i))?;
            Ok(found.as_slice().to_vec())
        })
    }

    /// Generalised forces (…, v_size), N and N m, at which the accelerations are `acceleration` (…, v_size), beside the controls `u`; of driven joints what drives them.
    #[pyo3(signature = (acceleration, v=None, u=None))]
    fn inverse_dynamics<'py>(
        &self,
        py: Python<'py>,
        acceleration: &Bound<'_, PyAny>,
        v: Option<&Bound<'_, PyAny>>,
        u: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Array<'py>> {
        let (v, u, n) = (self.vector("v", v)?, self.controls(u)?, self.velocities());
        let acceleration = self.vector("acceleration", Some(acceleration))?;
        self.each(py, &[n], move |e: &simulate::Equations<'_>, i| {
            let found = e.force(v.row(i), acceleration.row(i), u.row(i))?;
            Ok(found.as_slice().to_vec())
        })
    }

    /// Velocity of a `point` (m, its frame; default: its origin) of a `body` (number or name) and the body's angular velocity, world axes, per generalised velocity:
    /// (…, 6, v_size).
    #[pyo3(signature = (body, point=None))]
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'_, PyAny>,
        point: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Array<'py>> {
        let (body, x) = (self.body(body)?, self::point(point)?);
        self.each(
            py,
            &[6, self.velocities()],
            move |e: &simulate::Equations<'_>, _| Ok(listed(&e.point_jacobian(body, &x)?)),
        )
    }

    /// Velocity of that point (m/s) and angular velocity of the body (rad/s) at `v`, world axes: (…, 6).
    #[pyo3(signature = (body, v, point=None))]
    fn velocity<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'_, PyAny>,
        v: &Bound<'_, PyAny>,
        point: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Array<'py>> {
        let (body, x) = (self.body(body)?, self::point(point)?);
        let v = self.vector("v", Some(v))?;
        self.each(py, &[6], move |e: &simulate::Equations<'_>, i| {
            Ok(e.point_velocity(v.row(i), body, &x)?.as_slice().to_vec())
        })
    }

    /// Acceleration of that point (m/s²) and angular acceleration of the body (rad/s²) at `v` and the generalised `acceleration`, world axes: (…, 6).
    #[pyo3(signature = (body, v, acceleration, point=None))]
    fn acceleration<'py>(
        &self,
        py: Python<'py>,
        body: &Bound<'_, PyAny>,
        v: &Bound<'_, PyAny>,
        acceleration: &Bound<'_, PyAny>,
        point: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Array<'py>> {
        let (body, x) = (self.body(body)?, self::point(point)?);
        let v = self.vector("v", Some(v))?;
        let a = self.vector("acceleration", Some(acceleration))?;
        self.each(py, &[6], move |e: &simulate::Equations<'_>, i| {
            let found = e.point_acceleration(v.row(i), a.row(i), body, &x)?;
            Ok(found.as_slice().to_vec())
        })
    }

    /// Positions of the bodies' origins, m, world axes, (…, bodies, 3).
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let bodies = self.simulator.get().inner.system().len();
        self.each(py, &[bodies, 3], |e: &simulate::Equations<'_>, _| {
            let each = e.poses().iter();
            Ok(each.flat_map(|p| <[f64; 3]>::from(p.translation)).collect())
        })
    }

    /// Rotation matrices of the bodies, body to world, (…, bodies, 3, 3).
    #[getter]
    fn rotations<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let bodies = self.simulator.get().inner.system().len();
        self.each(py, &[bodies, 3, 3], |e: &simulate::Equations<'_>, _| {
            let each = e.poses().iter();
            Ok(each
                .flat_map(|p| p.rotation.transpose().as_slice().to_vec())
                .collect())
        })
    }

    /// Centre of mass of all bodies in the world, m, (…, 3); NaN where there is no mass.
    #[getter]
    fn center_of_mass<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        self.each(py, &[3], |e: &simulate::Equations<'_>, _| {
            let found = e.center_of_mass();
            Ok(found.map_or(vec![f64::NAN; 3], |(_, x)| x.as_slice().to_vec()))
        })
    }

    /// Centre of the volume that all bodies displace, below a `waterline`, at which their buoyancy acts, in the world, m, (…, 3); NaN where nothing is in the water.
    #[getter]
    fn center_of_buoyancy<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        self.each(py, &[3], |e: &simulate::Equations<'_>, _| {
            let found = e.center_of_buoyancy();
            Ok(found.map_or(vec![f64::NAN; 3], |(_, x)| x.as_slice().to_vec()))
        })
    }

    /// Potential energy, J, (…).
    #[getter]
    fn potential_energy<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        self.each(py, &[], |e: &simulate::Equations<'_>, _| {
            Ok(vec![e.potential_energy()])
        })
    }

    /// Kinetic energy of bodies and water at `v`, J, (…); the water's in the frame that moves with the current.
    fn kinetic_energy<'py>(&self, py: Python<'py>, v: &Bound<'_, PyAny>) -> PyResult<Array<'py>> {
        let v = self.vector("v", Some(v))?;
        self.each(py, &[], move |e: &simulate::Equations<'_>, i| {
            Ok(vec![e.kinetic_energy(v.row(i))?])
        })
    }

    /// Momentum (kg m/s) and angular momentum about the world's origin (kg m²/s) of bodies and water at `v`, (…, 6).
    fn momentum<'py>(&self, py: Python<'py>, v: &Bound<'_, PyAny>) -> PyResult<Array<'py>> {
        let v = self.vector("v", Some(v))?;
        self.each(py, &[6], move |e: &simulate::Equations<'_>, i| {
            Ok(e.momentum(v.row(i))?.as_slice().to_vec())
        })
    }

    fn __repr__(&self) -> String {
        format!("Equations({} configurations)", self.q.values.len())
    }
}

/// `xi` from or onto configurations, one or many: rows of `size` numbers.
fn moved<'py>(
    py: Python<'py>,
    [first, second]: [&Rows; 2],
    size: usize,
    map: impl Fn(&DVector<f64>, &DVector<f64>) -> hydrograd::Result<DVector<f64>>,
) -> PyResult<Array<'py>> {
    // No rows are many as well.
    let count = if first.is_many { first } else { second }.values.len();
    let both = first.is_many && second.is_many;
    if both && first.values.len() != second.values.len() {
        return Err(input(
            "configurations",
            format!("{} and {} rows", first.values.len(), second.values.len()),
            "must be as many, or one for all",
        ));
    }
    let made = (0..count).map(|i| map(first.row(i), second.row(i)));
    let values = made.collect::<hydrograd::Result<Vec<_>>>().or_raise()?;
    let is_many = first.is_many || second.is_many;
    let made = Rows {
        values,
        size,
        is_many,
    };
    made.to_python(py)
}

impl Simulator {
    /// q ⊕ ξ.
    pub fn integrated<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        xi: &Bound<'py, PyAny>,
    ) -> PyResult<Array<'py>> {
        let tree = &self.inner.system().tree;
        let size = tree.coordinates();
        let q = rows("integrate: q", q, size)?;
        let given = rows("integrate: xi", xi, tree.velocities())?;
        moved(xi.py(), [&q, &given], size, |q, xi| {
            self.inner.integrate(q, xi)
        })
    }

    /// ξ from one configuration to another.
    pub fn differing<'py>(
        &self,
        from: &Bound<'py, PyAny>,
        to: &Bound<'py, PyAny>,
    ) -> PyResult<Array<'py>> {
        let tree = &self.inner.system().tree;
        let (n, size) = (tree.coordinates(), tree.velocities());
        let first = rows("difference: start", from, n)?;
        let second = rows("difference: end", to, n)?;
        moved(from.py(), [&first, &second], size, |a, b| {
            self.inner.difference(a, b)
        })
    }

    /// A and B of a step from states, one or many.
    pub fn linearised<'py>(
        &self,
        py: Python<'py>,
        [q, v, u]: [Option<&Bound<'_, PyAny>>; 3],
        step: usize,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let (q0, v0) = self.inner.placed(step, None, None).or_raise()?;
        let (nv, nu) = (v0.len(), self.controls_size());
        let parts = [
            Rows::or("linearise: q", q, &q0)?,
            Rows::or("linearise: v", v, &v0)?,
            Rows::or("linearise: u", u, &DVector::zeros(nu))?,
        ];
        let many = || parts.iter().filter(|rows| rows.is_many);
        let count = many().map(|rows| rows.values.len()).max().unwrap_or(1);
        if many().any(|rows| rows.values.len() != count) {
            let counts: Vec<usize> = many().map(|rows| rows.values.len()).collect();
            return Err(input(
                "linearise",
                format!("{counts:?} rows"),
                "q, v and u must have as many, or one for all",
            ));
        }
        let is_many = many().next().is_some();
        let inner = self.inner.clone();
        let made: Vec<[Vec<f64>; 2]> = long(py, move |_| {
            let [q, v, u] = &parts;
            let one = |i: usize| {
                let state = inner.state(step, q.row(i), v.row(i))?;
                let (_, record) = inner.step(&state, u.row(i))?;
                let found = record.rollout().jacobians()?;
                Ok([listed(&found.state), listed(&found.controls)])
            };
            in_order((0..count).into_par_iter().map(one))
        })?;
        let part = |k: usize, columns: usize| {
            let values = made.iter().flat_map(|m| m[k].iter().copied()).collect();
            let lead = if is_many { vec![count] } else { Vec::new() };
            to_python(py, values, &[&lead[..], &[2 * nv, columns]].concat())
        };
        PyTuple::new(py, [part(0, 2 * nv)?, part(1, nu)?])
    }
}
