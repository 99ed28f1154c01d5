//! Lines, and how they are drawn.

use crate::adjoint::lie::Vec3;
use crate::{Error, Result};

/// Why a line ends.
#[derive(Clone, Debug, PartialEq)]
pub enum LineEnd {
    /// It is as long as it was asked to be, or at the last state.
    Length,
    /// It leaves the box.
    Box,
    /// It comes to a place where the flow isn't known ([`Rollout::flow_resolved`](crate::Rollout::flow_resolved)): in or at a body, by its name.
    Body(String),
    /// It comes to a wall, by its number.
    Wall(usize),
    /// The water stands still there.
    Still,
    /// It has as many steps as it may.
    Steps,
}

/// Where streamlines go from their seeds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Way {
    /// With the water.
    Forward,
    /// Against it.
    Backward,
    /// Both.
    #[default]
    Both,
}

/// How streamlines are drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamlineSettings {
    /// Length each way at most, m.
    pub length: f64,
    /// Error of a step at most, m; a millionth of the length where none is given.
    pub tolerance: Option<f64>,
    /// Steps each way at most.
    pub most_steps: usize,
    /// Two opposite corners of a box that lines don't leave, m.
    pub within: Option<[[f64; 3]; 2]>,
    /// Where they go.
    pub way: Way,
}

impl StreamlineSettings {
    /// Both ways, of this length at most, m.
    pub fn new(length: f64) -> Self {
        Self {
            length,
            tolerance: None,
            most_steps: 2000,
            within: None,
            way: Way::Both,
        }
    }

    pub(super) fn check(&self) -> Result<()> {
        let positive = |name: &str, x: f64| match x.is_finite() && x > 0.0 {
            true => Ok(()),
            false => {
                let place = format!("streamlines: {name}");
                Err(Error::input(place, x, "must be finite and positive, in m"))
            }
        };
        positive("length", self.length)?;
        positive("tolerance", self.tolerance())?;
        if self.most_steps == 0 {
            return Err(Error::input(
                "streamlines: most_steps",
                0,
                "must be at least 1",
            ));
        }
        for (axis, (low, high)) in self
            .within
            .iter()
            .flat_map(|[a, b]| a.iter().zip(b))
            .enumerate()
        {
            if low.is_nan() || high.is_nan() || low > high {
                return Err(Error::input(
                    format!("streamlines: within[{axis}]"),
                    format!("{low} … {high}"),
                    "must be two numbers, in m, the smaller one first",
                ));
            }
        }
        Ok(())
    }

    /// Error of a step, m.
    pub(super) fn tolerance(&self) -> f64 {
        self.tolerance.unwrap_or(1e-6 * self.length)
    }
}

/// A line along the water's velocity at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Streamline {
    /// Its points downstream, m, world frame.
    pub points: Vec<Vec3>,
    /// The water's velocity there, m/s.
    pub velocities: Vec<Vec3>,
    /// Which of them is the seed.
    pub seed: usize,
    /// Why it ends upstream and downstream; none where it wasn't to go.
    pub ends: [Option<LineEnd>; 2],
}

/// The way of a tracer.
#[derive(Clone, Debug, PartialEq)]
pub struct PathLine {
    /// Where it is at the states from the first one on, m, world frame.
    pub points: Vec<Vec3>,
    /// Its velocity there, m/s.
    pub velocities: Vec<Vec3>,
    /// When, s.
    pub times: Vec<f64>,
    /// Why it ends.
    pub end: LineEnd,
}
