//! How far a comparison has come, and whether it should go on.

use crate::{Error, Result};
use std::ops::ControlFlow;

/// The parts of a comparison, one after the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TradeoffStage {
    /// What errors are measured against is computed.
    Reference,
    /// Configurations are measured.
    Configurations,
}

/// How far a comparison has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TradeoffProgress {
    /// Which part is under way.
    pub stage: TradeoffStage,
    /// What of it is done: simulations of the reference, or configurations.
    pub done: usize,
    /// Of how many; a guess for the reference.
    pub all: usize,
}

/// Simulations of a reference, usually.
const USUAL: usize = 10;

/// Passes the progress on, and remembers if it broke.
pub(super) struct Watch<'a> {
    progress: &'a mut (dyn FnMut(TradeoffProgress) -> ControlFlow<()> + Send),
    now: TradeoffProgress,
    stopped: bool,
}

impl<'a> Watch<'a> {
    pub fn new(progress: &'a mut (dyn FnMut(TradeoffProgress) -> ControlFlow<()> + Send)) -> Self {
        let now = TradeoffProgress {
            stage: TradeoffStage::Reference,
            done: 0,
            all: USUAL,
        };
        Self {
            progress,
            now,
            stopped: false,
        }
    }

    /// Begins the configurations, so many.
    pub fn configurations(&mut self, all: usize) -> Result<()> {
        self.now = TradeoffProgress {
            stage: TradeoffStage::Configurations,
            done: 0,
            all,
        };
        self.check()
    }

    /// One more part is done.
    pub fn advance(&mut self) -> Result<()> {
        self.now.done += 1;
        if self.now.stage == TradeoffStage::Reference {
            self.now.all = USUAL.max(self.now.done + 1);
        }
        self.check()
    }

    /// Whether to go on, in the middle of a part.
    pub fn poll(&mut self) -> ControlFlow<()> {
        self.stopped |= (self.progress)(self.now).is_break();
        if self.stopped {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    }

    /// # Errors
    /// [`Error::Stopped`] once the progress broke.
    pub fn check(&mut self) -> Result<()> {
        if self.poll().is_continue() {
            return Ok(());
        }
        let TradeoffProgress { done, stage, .. } = self.now;
        let part = match stage {
            TradeoffStage::Reference => "simulations of the reference",
            TradeoffStage::Configurations => "configurations",
        };
        let what = format!("the comparison, after {done} {part}");
        Err(Error::Stopped { what })
    }
}
