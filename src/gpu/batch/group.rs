//! A group of seats that meet: the device's memory for them, and who uses which part of it.

use super::meeting::Meeting;
use super::model::Model;
use super::question::Question;
use super::runner::{Answer, Runner};
use crate::coupling::TogetherReport;
use crate::{Error, Result};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Evaluations of one scene whose derivatives can be asked for at a time without placing it again.
pub(super) const SLOTS: usize = 3;

/// Seats that meet.
pub(super) struct Group {
    pub model: Arc<Model>,
    meeting: Meeting<Vec<Question>, Vec<Answer>>,
    runner: Mutex<Runner>,
    meetings: AtomicU64,
    questions: AtomicU64,
    alone: AtomicU64,
    iterations: AtomicU64,
    evaluations: AtomicU64,
}

/// What an error says without its adapter, which is told where the answer is taken.
fn said(error: Error) -> String {
    match error {
        Error::Device { what, .. } => what,
        other => other.to_string(),
    }
}

impl Group {
    /// Of so many seats.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(model: &Arc<Model>, seats: usize) -> Result<Self> {
        Ok(Self {
            model: model.clone(),
            meeting: Meeting::new(seats),
            runner: Mutex::new(Runner::new(model, seats, SLOTS)?),
            meetings: AtomicU64::new(0),
            questions: AtomicU64::new(0),
            alone: AtomicU64::new(0),
            iterations: AtomicU64::new(0),
            evaluations: AtomicU64::new(0),
        })
    }

    /// Answers for some seats' questions.
    fn work(&self, asked: Vec<Vec<Question>>) -> std::result::Result<Vec<Vec<Answer>>, String> {
        let counts: Vec<usize> = asked.iter().map(Vec::len).collect();
        let all: Vec<Question> = asked.into_iter().flatten().collect();
        self.meetings.fetch_add(1, Ordering::Relaxed);
        self.questions
            .fetch_add(all.len() as u64, Ordering::Relaxed);
        let mut runner = self.runner.lock().unwrap_or_else(PoisonError::into_inner);
        let mut answers = runner.run(&all).map_err(said)?.into_iter();
        let parts = counts.iter().map(|n| answers.by_ref().take(*n).collect());
        Ok(parts.collect())
    }

    /// Answers all seats of this group until they are left.
    pub fn serve(&self) {
        self.meeting.serve(|asked| self.work(asked));
    }

    /// Asks from a seat of this group.
    ///
    /// # Errors
    /// A device that fails.
    pub fn ask(&self, seat: usize, questions: Vec<Question>) -> Result<Vec<Answer>> {
        let answered = self.meeting.ask(seat, questions);
        answered.map_err(|what| self.model.context.failure(what))
    }

    /// A seat is left.
    pub fn leave(&self) {
        self.meeting.leave();
    }

    /// An evaluation was computed on the CPU.
    pub fn count_alone(&self) {
        self.alone.fetch_add(1, Ordering::Relaxed);
    }

    /// An evaluation took so many iterations.
    pub fn count_iterations(&self, iterations: usize) {
        self.evaluations.fetch_add(1, Ordering::Relaxed);
        self.iterations
            .fetch_add(iterations as u64, Ordering::Relaxed);
    }

    /// What was done so far.
    pub fn report(&self) -> TogetherReport {
        let spent = self
            .runner
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .spent;
        TogetherReport {
            size: self.model.sizes,
            meetings: self.meetings.load(Ordering::Relaxed),
            questions: self.questions.load(Ordering::Relaxed),
            alone: self.alone.load(Ordering::Relaxed),
            packing: spent.packing,
            waiting: spent.waiting,
            computing: spent.computing,
            iterations: self.iterations.load(Ordering::Relaxed),
            evaluations: self.evaluations.load(Ordering::Relaxed),
        }
    }
}
