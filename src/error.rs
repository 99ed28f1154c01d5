//! One error type: every variant names the place, the value and what would be right.

use rayon::iter::ParallelIterator;
use std::path::PathBuf;

/// Result of every fallible call of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// All results of work spread over threads, or the first error in their order, whichever thread came first.
pub(crate) fn in_order<T: Send>(each: impl ParallelIterator<Item = Result<T>>) -> Result<Vec<T>> {
    let all: Vec<Result<T>> = each.collect();
    all.into_iter().collect()
}

/// What went wrong, where, with which number, and what to do about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A value given by the user that can't be used. `place` names the body and the field
    /// (`body "coin": mass`), `value` is what was given, `expected` what would be right.
    #[error("{place}: got {value}; {expected}")]
    Input {
        /// Body and field, or file and line.
        place: String,
        /// The value as given.
        value: String,
        /// What would be right, or how to mend it.
        expected: String,
    },
    /// A surface mesh that doesn't bound a volume, or bounds it badly.
    #[error("mesh {name}: {problem} ({location}); {remedy}")]
    Mesh {
        /// File or shape name.
        name: String,
        /// What is wrong, with its count or number.
        problem: String,
        /// First offending face, edge or vertex, with coordinates in metres.
        location: String,
        /// How to mend it.
        remedy: String,
    },
    /// A file that can't be read or written.
    #[error("{path}: {action} failed: {source}", path = path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// `read` or `write`.
        action: &'static str,
        /// The operating system's reason.
        source: std::io::Error,
    },
    /// A file whose contents can't be understood.
    #[error("{path}: {message}", path = path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// Line, key and remedy.
        message: String,
    },
    /// A linear or nonlinear solve that didn't reach its tolerance.
    #[error(
        "{what} stopped at residual {residual:.3e} after {iterations} iterations (tolerance {tolerance:.1e}); {remedy}"
    )]
    Solver {
        /// Which solve, at which time or body.
        what: String,
        /// Iterations made.
        iterations: usize,
        /// Relative residual reached.
        residual: f64,
        /// Relative residual asked for.
        tolerance: f64,
        /// What to try.
        remedy: String,
    },
    /// The physics left what the discretisation or the step resolves.
    #[error("{place}: {quantity} = {value:.6e} (limit {limit:.6e}); {remedy}")]
    Unresolved {
        /// Body, pair or time.
        place: String,
        /// The quantity.
        quantity: String,
        /// Its value.
        value: f64,
        /// The limit that it passed.
        limit: f64,
        /// What to change.
        remedy: String,
    },
    /// A GPU that isn't there, can't do what is needed, or failed.
    #[error("GPU {adapter}: {what}; {remedy}")]
    Device {
        /// The adapter's name.
        adapter: String,
        /// What it lacks, with the number needed, or how it failed.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// What whoever asked for it ended before it was done.
    #[error("{what}: stopped as asked")]
    Stopped {
        /// What was going on, and how far it had come.
        what: String,
    },
    /// What a controller gives as its reason not to act.
    #[error("controller: {source}")]
    Controller {
        /// The reason as the controller gave it: an error of another library, or an exception.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A combination of settings that has no meaning or isn't offered.
    #[error("{what} is not available: {why}; {instead}")]
    Unsupported {
        /// What was asked.
        what: String,
        /// Why not.
        why: String,
        /// What to use instead.
        instead: String,
    },
}

/// A time without the rounding of its last digits, which says nothing to a reader.
pub(crate) fn readable(time: f64) -> f64 {
    format!("{time:.9e}").parse().unwrap_or(time)
}

impl Error {
    /// What is wrong, of a mesh without its name, where the place says it.
    #[cfg(feature = "urdf")]
    pub(crate) fn problem(self) -> String {
        match self {
            Self::Mesh { problem, .. } => problem,
            other => other.to_string(),
        }
    }

    /// The same, for lengths that were given in units of `size` m.
    pub(crate) fn in_units_of(mut self, size: f64) -> Self {
        match &mut self {
            Self::Input { expected: said, .. }
            | Self::Mesh { remedy: said, .. }
            | Self::Unresolved { remedy: said, .. } => {
                said.push_str(&format!(" (lengths here in units of {size:.3e} m)"));
            }
            _ => {}
        }
        self
    }

    /// The same, saying which part of a scene it is about.
    pub(crate) fn of(mut self, place: &str) -> Self {
        match &mut self {
            Self::File { source, .. } => {
                *source = std::io::Error::new(source.kind(), format!("{source} ({place})"));
            }
            Self::Parse { message: said, .. } => said.push_str(&format!(" ({place})")),
            Self::Mesh { name: said, .. } | Self::Input { place: said, .. } => {
                *said = format!("{place}: {said}");
            }
            _ => {}
        }
        self
    }

    /// An [`Error::Input`] from its three parts.
    pub fn input(
        place: impl Into<String>,
        value: impl std::fmt::Display,
        expected: impl Into<String>,
    ) -> Self {
        Self::Input {
            place: place.into(),
            value: value.to_string(),
            expected: expected.into(),
        }
    }

    /// The same, saying at which time of a trajectory (s) it happened.
    pub(crate) fn at_time(mut self, time: f64) -> Self {
        match &mut self {
            Self::Input { place: said, .. }
            | Self::Mesh { location: said, .. }
            | Self::Parse { message: said, .. }
            | Self::Solver { what: said, .. }
            | Self::Unresolved { place: said, .. }
            | Self::Device { what: said, .. }
            | Self::Unsupported { what: said, .. } => {
                if !said.contains("t = ") {
                    said.push_str(&format!(" at t = {} s", readable(time)));
                }
            }
            Self::File { .. } | Self::Stopped { .. } | Self::Controller { .. } => {}
        }
        self
    }

    /// Whether it ends a search, and isn't one trial's failure: what was asked to stop, and what a controller or cost of the user's own raises.
    #[cfg(feature = "opt")]
    pub(crate) fn ends_search(&self) -> bool {
        matches!(self, Self::Stopped { .. } | Self::Controller { .. })
    }

    /// The same, said of one of several things that are done side by side.
    #[cfg(feature = "opt")]
    pub(crate) fn within(mut self, what: &str) -> Self {
        if let Self::Input { place, .. } | Self::Unresolved { place, .. } = &mut self {
            *place = format!("{what}: {place}");
        }
        self
    }
}
