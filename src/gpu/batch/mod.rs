//! The fidelity of [`crate::coupling::reduced`] for many equal scenes at once, whose simulations run side by side on the host.
//!
//! One workgroup answers one question about one scene: it places the points, solves I − LᵀGL, reads the momenta and makes the
//! wrenches of all pairs of columns (`shaders/batch_*.wgsl`). Nothing of the size of G is stored. The system is the identity and something
//! small: conjugate gradients in single precision gain five digits, and rounds of residuals in the fine arithmetic refine them.
//! Points and charges stay on the device in a *slot* of their scene, so that what derivatives ask for sends a few numbers.
//!
//! The simulations ask for whatever they need when they need it. Each sits at a seat, on a thread of its own; once all of a group have
//! asked, one of them takes the questions to the device. Two groups take turns, so that one computes on the host while the other waits.
//! An answer depends on its question alone: not on who else is there, nor on their order.
//!
//! Where a gap has a film, a system isn't solved on the device, or two directions that aren't on the basis are asked for, the CPU answers that question.

mod count;
mod coupled;
mod group;
mod meeting;
mod model;
mod question;
mod runner;
mod seat;
mod solved;

pub use count::{Cost, forward, with_gradient};

use super::context::Context;
use crate::Result;
use crate::coupling::reduced::Reduced;
use crate::coupling::{Coupling, Together, TogetherReport};
use coupled::{Seats, sit};
use group::{Group, SLOTS};
use model::Model;
use seat::Seat;
use std::sync::Arc;

/// Most columns of a basis.
const COLUMNS: usize = 12;
/// Most threads that wait for one device.
const SEATS: usize = 2048;
/// From how many scenes on they are parted into two groups.
const PARTED: usize = 64;

/// Seats for equal scenes of compressed bodies on a device.
pub struct Batch {
    groups: Vec<Arc<Group>>,
    coupled: Arc<Seats>,
}

impl Batch {
    /// Seats for up to `scenes` scenes whose basis has `columns` columns: fewer where the device's buffers don't take so many, or more threads than pays.
    /// `None` where such scenes are computed one by one: without columns or with more than twelve, and where pairs of bodies fade out.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(
        context: &Arc<Context>,
        reduced: &Arc<Reduced>,
        scenes: usize,
        columns: usize,
    ) -> Result<Option<Self>> {
        let fading = reduced.links().iter().any(|l| l.cutoff.is_some());
        if fading || !(1..=COLUMNS).contains(&columns) || scenes == 0 {
            return Ok(None);
        }
        let model = Arc::new(Model::new(context, reduced, columns)?);
        let each = runner::scene_bytes(&model, SLOTS);
        let largest = context.adapter().largest_binding as usize;
        let most = each.iter().map(|bytes| largest / (*bytes).max(1)).min();
        let groups = if scenes >= PARTED { 2 } else { 1 };
        let seats = scenes.min(SEATS).min(groups * most.unwrap_or(1));
        if seats == 0 {
            return Ok(None);
        }
        let mut seats = seats;
        loop {
            match Self::of(&model, seats, groups) {
                // The device has less memory than its buffers may take: fewer sit down at a time.
                Err(_) if seats > groups && context.check().is_ok() => seats = seats.div_ceil(2),
                made => return made.map(Some),
            }
        }
    }

    /// So many seats in so many groups.
    fn of(model: &Arc<Model>, seats: usize, groups: usize) -> Result<Self> {
        let sizes = (0..groups).map(|g| (g + 1) * seats / groups - g * seats / groups);
        let sizes: Vec<usize> = sizes.filter(|n| *n > 0).collect();
        let made = sizes.iter().map(|n| Ok(Arc::new(Group::new(model, *n)?)));
        let groups = made.collect::<Result<Vec<_>>>()?;
        let seats = groups.iter().zip(&sizes);
        let seats = seats.flat_map(|(group, n)| (0..*n).map(|k| Seat::new(group, k)));
        let coupled = Arc::new(Seats {
            seats: seats.collect(),
            reduced: model.reduced.clone(),
        });
        Ok(Self { groups, coupled })
    }
}

impl Together for Batch {
    fn seats(&self) -> usize {
        self.coupled.seats.len()
    }

    fn coupling(&self) -> Arc<dyn Coupling> {
        self.coupled.clone()
    }

    fn sit(&self, seat: usize) {
        sit(Some(seat));
    }

    fn leave(&self, seat: usize) {
        sit(None);
        if let Some(seat) = self.coupled.seats.get(seat) {
            seat.group.leave();
        }
    }

    fn report(&self) -> TogetherReport {
        let mut out = TogetherReport::default();
        for report in self.groups.iter().map(|group| group.report()) {
            out.size = report.size;
            out.meetings += report.meetings;
            out.questions += report.questions;
            out.alone += report.alone;
            out.packing += report.packing;
            out.waiting += report.waiting;
            out.iterations += report.iterations;
            out.evaluations += report.evaluations;
            out.computing = report
                .computing
                .map(|own| own + out.computing.unwrap_or(0.0));
        }
        out
    }
}
