//! The fidelity of [`crate::coupling::reduced`] for many equal scenes at once, whose simulations run side by side on the host.
//!
//! One workgroup answers one question about one scene: it places the points, solves I − LᵀGL, reads the momenta and makes the
//! wrenches of all pairs of columns (`shaders/batch_*.wgsl`). Nothing of the size of G is stored. The system is the identity and something
//! small: conjugate gradients in single precision gain five digits, and rounds of residuals in the fine arithmetic refine them.
//! Points and charges stay on the device in a *slot* of their scene, so that what derivatives ask for sends a few numbers.
//!
//! The simulations ask for whatever they need when they need it. Each sits at a seat, on a stack of its own, and makes way for others of its thread while it waits; once all of
//! a group have asked, the group's server takes the questions to the device. Up to four groups take turns, so that some compute on the host while others wait.
//! An answer depends on its question alone: not on who else is there, nor on their order.
//!
//! Where a gap has a film, a system isn't solved on the device, or two directions that aren't on the basis are asked for, the CPU answers that question.

mod count;
mod coupled;
mod crew;
mod group;
mod meeting;
mod model;
mod question;
mod runner;
mod seat;
mod solved;

pub use count::{Cost, forward, with_gradient};

use super::context::Context;
use crate::coupling::reduced::Reduced;
use crate::coupling::{Coupling, Together, TogetherReport};
use crate::{Error, Result};
use coupled::Seats;
use group::{Group, SLOTS};
use model::Model;
use seat::Seat;
use std::sync::Arc;

/// Most columns of a basis.
const COLUMNS: usize = 12;
/// Most members that wait for one device.
const SEATS: usize = 2048;
/// Most groups, and scenes of one at least: one is on the device while others compute on the host.
const GROUPS: usize = 4;
const GROUP: usize = 32;

/// Seats for equal scenes of compressed bodies on a device.
pub struct Batch {
    groups: Vec<Arc<Group>>,
    coupled: Arc<Seats>,
}

impl Batch {
    /// Seats for up to `scenes` scenes whose basis has `columns` columns: fewer where the device's buffers don't take so many, or more members than pays.
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
        let groups = (scenes / GROUP).clamp(1, GROUPS);
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

/// Leaves a seat, whatever happens to whom sits there.
struct Leaves<'a>(&'a (dyn Fn(usize) + Sync), usize);

impl Drop for Leaves<'_> {
    fn drop(&mut self) {
        (self.0)(self.1);
    }
}

impl Together for Batch {
    fn seats(&self) -> usize {
        self.coupled.seats.len()
    }

    fn coupling(&self) -> Arc<dyn Coupling> {
        self.coupled.clone()
    }

    fn side_by_side(&self, member: &(dyn Fn(usize) + Sync)) -> Result<()> {
        let leave = |seat: usize| {
            if let Some(seat) = self.coupled.seats.get(seat) {
                seat.group.leave();
            }
        };
        let seated = |seat: usize| {
            let leaves = Leaves(&leave, seat);
            member(seat);
            drop(leaves);
        };
        let serve = self.groups.iter().map(|group| || group.serve());
        let serve: Vec<_> = serve.collect();
        let servers: Vec<&(dyn Fn() + Sync)> = serve.iter().map(|one| one as _).collect();
        let seats = self.seats();
        let ran = crew::side_by_side(seats, &servers, &seated, &leave);
        ran.map_err(|error| Error::Unsupported {
            what: format!("a batch of {seats} members at a time"),
            why: format!("no thread or memory could be had for it: {error}"),
            instead: "use fewer members, or the backend cpu".into(),
        })
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
            if let Some(own) = report.computing {
                *out.computing.get_or_insert(0.0) += own;
            }
        }
        out
    }
}
