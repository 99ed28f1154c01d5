//! What is to be found.

use super::root;
use crate::dynamics::Drive;
use crate::simulate::Simulator;
use crate::{Error, Result};

/// What was known beforehand: a mean and a standard deviation; of an unknown by its logarithm the deviation is that of the logarithm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// The mean, in the unknown's unit.
    pub mean: f64,
    /// The deviation.
    pub deviation: f64,
}

/// What an unknown sets.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Target {
    /// A parameter.
    Parameter(String),
    /// A coordinate of the initial state, by its label.
    Start(String),
    /// An entry of the root of a body's inertia, with the name that it goes by.
    Root {
        body: String,
        entry: usize,
        name: String,
    },
}

impl Target {
    pub fn name(&self) -> &str {
        match self {
            Self::Parameter(name) | Self::Start(name) | Self::Root { name, .. } => name,
        }
    }

    /// Number of a coordinate of the initial state, and of the velocity that is its rate.
    ///
    /// # Errors
    /// A label that none has, a coordinate that a motion drives, or one of a joint that turns in three dimensions.
    pub fn coordinate(&self, simulator: &Simulator) -> Result<Option<(usize, usize)>> {
        let Self::Start(label) = self else {
            return Ok(None);
        };
        let refuse = |expected: String| {
            Err(Error::input(
                "coordinate of the start",
                format!("{label:?}"),
                expected,
            ))
        };
        let labels = simulator.scene().coordinate_labels();
        let Some(i) = labels.iter().position(|l| l == label) else {
            return refuse(format!("must be one of {labels:?}"));
        };
        let system = simulator.system();
        let links = system.tree.links().iter().zip(&system.drives);
        let mut carrying = links.filter(|(link, _)| link.q.contains(&i));
        match carrying.next() {
            Some((_, Drive::Motion(_))) => {
                refuse("its joint is driven by a motion, which says where it starts".into())
            }
            Some((link, _)) if link.joint.quaternion_at().is_some() => {
                refuse("its joint turns in three dimensions, and none of its coordinates is unknown by itself: let the whole start be (`start_within`)".into())
            }
            Some((link, _)) => Ok(Some((i, link.v.start + i - link.q.start))),
            None => refuse("its joint follows another".into()),
        }
    }

    fn value(&self, simulator: &Simulator) -> Result<f64> {
        match (self, self.coordinate(simulator)?) {
            (_, Some((i, _))) => Ok(simulator.start().0[i]),
            (Self::Root { body, entry, .. }, _) => Ok(root::of(simulator, body)?[*entry]),
            _ => simulator.parameters().get(self.name()),
        }
    }
}

/// A number to be found: a parameter of the simulator, or several in a fixed ratio.
///
/// ```
/// use hydrograd::optimize::Unknown;
///
/// let mass = Unknown::new("coin.mass").positive().start(0.04);
/// // One coefficient for both fins.
/// let drag = Unknown::new("fin drag").sets("left.drag", 1.0).sets("right.drag", 1.0);
/// assert_eq!(drag.name(), "fin drag");
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Unknown {
    name: String,
    /// What it sets, and what each is of the unknown.
    sets: Vec<(Target, f64)>,
    start: Option<f64>,
    prior: Option<Prior>,
    bounds: [f64; 2],
    by_logarithm: bool,
}

impl Unknown {
    /// The parameter of this name; or, with [`Unknown::sets`], a number by any name.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            sets: Vec::new(),
            start: None,
            prior: None,
            bounds: [f64::NEG_INFINITY, f64::INFINITY],
            by_logarithm: false,
        }
    }

    /// The inertia of a body about its centre of mass, as six unknowns that make a physical one whatever they are: entries xx, yy, zz (by their logarithms), xy, xz, yz of the upper
    /// triangular root L (√kg m) of its second moments of mass, I = tr(L Lᵀ) 1 − L Lᵀ. Their names are `BODY.inertia.root.xx` and so on. What isn't given to
    /// [`identify`](super::identify) of the six stays as the simulator has it.
    pub fn inertia(body: &str) -> [Self; 6] {
        std::array::from_fn(|entry| {
            let name = format!("{body}.inertia.root.{}", root::ENTRIES[entry]);
            let target = Target::Root {
                body: body.into(),
                entry,
                name: name.clone(),
            };
            let mut out = Self::new(name);
            out.sets.push((target, 1.0));
            match entry < 3 {
                true => out.positive(),
                false => out,
            }
        })
    }

    /// Makes the parameter `parameter` `factor` times the unknown; may be given several times.
    pub fn sets(mut self, parameter: impl Into<String>, factor: f64) -> Self {
        self.sets
            .push((Target::Parameter(parameter.into()), factor));
        self
    }

    /// Makes a coordinate of the initial state `factor` times the unknown, in every experiment, by its label ("arm.angle"); that of a locked joint stays what it is, as a joint's zero
    /// does (`zeros` of [`Robot`](crate::scene::Scene::add_robot)).
    pub fn sets_start(mut self, coordinate: impl Into<String>, factor: f64) -> Self {
        self.sets.push((Target::Start(coordinate.into()), factor));
        self
    }

    /// Where the search begins; default: the prior's mean, or the value that the first of its parameters has in the first experiment.
    pub fn start(mut self, value: f64) -> Self {
        self.start = Some(value);
        self
    }

    /// What was known beforehand.
    pub fn prior(mut self, mean: f64, deviation: f64) -> Self {
        self.prior = Some(Prior { mean, deviation });
        self
    }

    /// Least and largest value.
    pub fn within(mut self, least: f64, largest: f64) -> Self {
        self.bounds = [least, largest];
        self
    }

    /// Searches over the logarithm, so that it stays positive and a step is a part of the value.
    pub fn positive(mut self) -> Self {
        self.by_logarithm = true;
        self
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }
}

/// An unknown in the coordinates of the search: the value, or its logarithm.
pub(super) struct Searched {
    pub name: String,
    pub sets: Vec<(Target, f64)>,
    pub by_logarithm: bool,
    pub start: f64,
    pub prior: Option<Prior>,
    pub bounds: [f64; 2],
}

impl Searched {
    /// Checks an unknown against the simulator of the first experiment.
    pub fn new(unknown: &Unknown, simulator: &Simulator) -> Result<Self> {
        let place = |field: &str| format!("unknown {:?}: {field}", unknown.name);
        let mut sets = unknown.sets.clone();
        if sets.is_empty() {
            sets.push((Target::Parameter(unknown.name.clone()), 1.0));
        }
        for (target, factor) in &sets {
            target.value(simulator)?;
            let name = target.name();
            if !factor.is_finite() || *factor == 0.0 {
                return Err(Error::input(
                    place("sets"),
                    factor,
                    format!("give a finite factor of {name:?} other than zero"),
                ));
            }
        }
        let by_logarithm = unknown.by_logarithm;
        let (first, factor) = &sets[0];
        let start = match (unknown.start, unknown.prior) {
            (Some(start), _) => start,
            (None, Some(prior)) => prior.mean,
            (None, None) => first.value(simulator)? / factor,
        };
        let coordinate = |field: &str, x: f64| match by_logarithm {
            false if !x.is_nan() => Ok(x),
            true if x > 0.0 => Ok(x.ln()),
            _ => Err(Error::input(
                place(field),
                x,
                match by_logarithm {
                    true => "give a positive number: it is searched for by its logarithm",
                    false => "give a number",
                },
            )),
        };
        let [least, largest] = unknown.bounds;
        let least = match by_logarithm && least <= 0.0 {
            true => f64::NEG_INFINITY,
            false => coordinate("within", least)?,
        };
        let bounds = [least, coordinate("within", largest)?];
        if bounds[0] >= bounds[1] {
            return Err(Error::input(
                place("within"),
                format!("{} to {}", unknown.bounds[0], unknown.bounds[1]),
                "give the least value first, below the largest",
            ));
        }
        let start = coordinate("start", start)?;
        if !start.is_finite() || start < bounds[0] || start > bounds[1] {
            return Err(Error::input(
                place("start"),
                match by_logarithm {
                    true => start.exp(),
                    false => start,
                },
                format!(
                    "give a finite number within its bounds, {} to {}",
                    unknown.bounds[0], unknown.bounds[1]
                ),
            ));
        }
        let prior = unknown.prior.map(|prior| {
            if !(prior.deviation > 0.0 && prior.deviation.is_finite()) {
                let remedy = "give a positive deviation";
                return Err(Error::input(place("prior"), prior.deviation, remedy));
            }
            let mean = coordinate("prior", prior.mean)?;
            Ok(Prior { mean, ..prior })
        });
        Ok(Self {
            name: unknown.name.clone(),
            sets,
            by_logarithm,
            start,
            prior: prior.transpose()?,
            bounds,
        })
    }

    /// The value at a coordinate, in the unknown's unit.
    pub fn value(&self, x: f64) -> f64 {
        match self.by_logarithm {
            true => x.exp(),
            false => x,
        }
    }

    /// Derivative of the value by the coordinate.
    pub fn slope(&self, x: f64) -> f64 {
        match self.by_logarithm {
            true => x.exp(),
            false => 1.0,
        }
    }
}
