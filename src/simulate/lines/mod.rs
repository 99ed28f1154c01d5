//! Streamlines, and the paths of tracers that go with the water.

mod field;
mod path;
mod stream;

use super::Rollout;
use crate::adjoint::lie::Vec3;
use crate::{Error, Result, memory};
use field::Field;

/// Most lines at once.
const MOST_LINES: usize = 100_000;
/// Numbers of a point of a line: place, velocity, time.
const NUMBERS: f64 = 7.0;

/// Why a line ends.
#[derive(Clone, Debug, PartialEq)]
pub enum LineEnd {
    /// It is as long as it was asked to be, or at the last state.
    Length,
    /// It leaves the box.
    Box,
    /// It comes to a place where the flow isn't known ([`Rollout::flow_resolved`]): in or at a body, by its name.
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

    fn check(&self) -> Result<()> {
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
    fn tolerance(&self) -> f64 {
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

impl Rollout {
    /// Lines along the water's velocity at state `n` through `seeds` (m, world frame), a current included: by steps of fifth order as long as their error allows. The flow is that of the layers on the
    /// bodies' panels, one solve for all lines. A line ends where the flow isn't known any more, and says why.
    ///
    /// # Errors
    /// A state that there isn't; settings that aren't positive; more than 100,000 seeds, or more points than the memory holds; seeds that aren't finite, in a body, behind a wall or
    /// elsewhere where the flow isn't known; whatever its solve reports, as [`Rollout::potential`].
    pub fn streamlines(
        &self,
        n: usize,
        seeds: &[Vec3],
        settings: &StreamlineSettings,
    ) -> Result<Vec<Streamline>> {
        let sample = self.sample("streamlines", n)?;
        settings.check()?;
        check_count("streamlines", seeds.len(), 2 * settings.most_steps)?;
        let made = || {
            let field = Field::new(self.simulator(), sample)?;
            field.check("streamlines: seeds", seeds)?;
            stream::lines(&field, seeds, settings)
        };
        made().map_err(|e| e.at_time(sample.time))
    }

    /// The ways of tracers that go with the water from `seeds` (m, world frame) at state `from` to state `to`: by the Runge–Kutta method of fourth order over two
    /// steps of the rollout, whose middle state is its middle stage; a last single step takes the flow at its middle from three states, and is of third order. One solve a state, as
    /// [`Rollout::streamlines`]. A tracer that comes to a place where the flow isn't known ends there, and says why.
    ///
    /// # Errors
    /// States that there aren't, or of which the second isn't the later one; seeds as of [`Rollout::streamlines`]; whatever the solves report.
    pub fn path_lines(&self, seeds: &[Vec3], from: usize, to: usize) -> Result<Vec<PathLine>> {
        let first = self.sample("path_lines", from)?;
        self.sample("path_lines", to)?;
        if from >= to {
            let expected = format!("must be after the first state, {from}");
            return Err(Error::input("path_lines: last state", to, expected));
        }
        check_count("path_lines", seeds.len(), to - from)?;
        let field = Field::new(self.simulator(), first);
        field
            .and_then(|field| field.check("path_lines: seeds", seeds))
            .map_err(|e| e.at_time(first.time))?;
        path::lines(self, seeds, from, to)
    }
}

fn check_count(what: &str, lines: usize, points: usize) -> Result<()> {
    if lines > MOST_LINES {
        let expected = format!("must be at most {MOST_LINES}: draw them in parts");
        return Err(Error::input(
            format!("{what}: number of seeds"),
            lines,
            expected,
        ));
    }
    let bytes = memory::numbers(NUMBERS * lines as f64 * points as f64);
    memory::fits(what, bytes, "take fewer seeds or fewer steps")
}
