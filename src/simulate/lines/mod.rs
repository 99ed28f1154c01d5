//! Streamlines, and the paths of tracers that go with the water.

mod field;
mod line;
mod path;
mod stream;

pub use line::{LineEnd, PathLine, Streamline, StreamlineSettings, Way};

use super::Rollout;
use crate::adjoint::lie::Vec3;
use crate::{Error, Result, memory};
use field::Field;

/// Most lines at once.
const MOST_LINES: usize = 100_000;
/// Numbers of a point of a line: place, velocity, time.
const NUMBERS: f64 = 7.0;

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
