//! Viscous water that is squeezed out between surfaces: W = −C(q) V on the one that moves with the twist V against the other
//! ([`crate::coupling::lubrication`]), opposite on the other one. Solved with contact.

use super::{
    ForceModel, ForceParts, LoadBars, Loads, Lubricated, Moving, Outside, Place, Together, Velocity,
};
use crate::adjoint::lie::{Pose, Vec6, cross_force};
use crate::coupling::lubrication::{Bearing, PlacedBearing};
use crate::dynamics::parameters::{Declarations, Declared, Owner, Parameter, Parameters, Range};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// At zero a change is measured by what makes the Reynolds number a thousand.
const VISCOSITY: Declared = Declared::new("viscosity", "Pa s")
    .size(|value, typical| value.max(1e-3 * typical.density * typical.speed * typical.length));
const ROUGHNESS: Declared = Declared::new("roughness", "m").range(Range::Positive);
/// Last poses of a gap that are kept: those of a step are asked for several times, and of a trajectory's in turn by its reverse.
const KEPT: usize = 8;

struct Lubrication(Vec<Gap>);

struct Gap {
    first: usize,
    second: Option<usize>,
    bearing: Bearing,
    viscosity: Parameter,
    roughness: Parameter,
    kept: Mutex<VecDeque<Kept>>,
}

/// The pose of the first in the frame of the other, and the roughness.
type Key = (Pose, f64);
/// With what is there; none where the gap is open.
type Kept = (Key, Option<Arc<PlacedBearing>>);

/// A gap with water in it.
struct Filled<'g> {
    gap: &'g Gap,
    /// Axes of the other, about the origin of the first.
    frame: Pose,
    viscosity: f64,
    placed: Arc<PlacedBearing>,
}

pub(super) fn assemble(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    let mut gaps = Vec::new();
    for (i, force) in parts.scene.lubrications() {
        let mut declare = |declared, value| {
            parameters.declare(Owner::Named(parts.scene.force_name(i)), declared, value)
        };
        let viscosity = declare(VISCOSITY, force.viscosity);
        let roughness = declare(ROUGHNESS, force.roughness);
        let own = parts.lubricated.iter().filter(|g| g.force == i);
        gaps.extend(own.map(|gap: &Lubricated| Gap {
            first: gap.first,
            second: gap.second,
            bearing: gap.bearing.clone(),
            viscosity,
            roughness,
            kept: Mutex::default(),
        }));
    }
    (!gaps.is_empty()).then(|| Box::new(Lubrication(gaps)) as Box<dyn ForceModel>)
}

impl Gap {
    /// None where it is open.
    fn filled(&self, place: &Place) -> Option<Filled<'_>> {
        let viscosity = place.parameters[self.viscosity];
        let own = &place.poses[self.first];
        let other = self.second.map_or(Pose::identity(), |b| place.poses[b]);
        let key = (
            other.inverse().compose(own),
            place.parameters[self.roughness],
        );
        let find = |kept: &VecDeque<Kept>| {
            let found = kept.iter().find(|(at, _)| *at == key);
            found.map(|(_, placed)| placed.clone())
        };
        let known = find(&self.kept.lock().unwrap_or_else(PoisonError::into_inner));
        let placed = known.unwrap_or_else(|| {
            // Without the lock: another thread may make the same.
            let made = self.bearing.placed(&key.0, key.1).map(Arc::new);
            let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
            if kept.len() >= KEPT {
                kept.pop_front();
            }
            kept.push_back((key, made.clone()));
            made
        });
        Some(Filled {
            gap: self,
            frame: Pose::new(other.rotation, own.translation),
            viscosity,
            placed: placed?,
        })
    }
}

impl Filled<'_> {
    /// How the first moves against the other, in the axes of the other.
    fn twist(&self, field: &[Vec6]) -> Vec6 {
        self.frame.twist_to_body(&self.relative(field))
    }

    /// The same, spatial.
    fn relative(&self, field: &[Vec6]) -> Vec6 {
        field[self.gap.first] - self.gap.second.map_or(Vec6::zeros(), |b| field[b])
    }

    /// −C V, spatial.
    fn wrench(&self, twist: &Vec6) -> Vec6 {
        let own = -self.viscosity * (self.placed.damping * twist);
        self.frame.wrench_to_world(&own)
    }

    /// Adds a wrench to the first body and takes it from the other.
    fn exchange(&self, wrench: &Vec6, out: &mut [Vec6]) {
        out[self.gap.first] += wrench;
        if let Some(b) = self.gap.second {
            out[b] -= wrench;
        }
    }
}

impl ForceModel for Lubrication {
    fn name(&self) -> &'static str {
        "lubrication"
    }

    fn solved_with_contact(&self) -> bool {
        true
    }

    fn acts(&self, place: &Place) -> bool {
        self.0.iter().any(|gap| gap.filled(place).is_some())
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        for film in self.0.iter().filter_map(|gap| gap.filled(&at.place)) {
            let wrench = film.wrench(&film.twist(at.twists));
            film.exchange(&wrench, &mut out.wrenches);
        }
    }

    fn jvp(&self, at: &Moving, change: &Velocity, out: &mut Loads) {
        for film in self.0.iter().filter_map(|gap| gap.filled(&at.place)) {
            let wrench = film.wrench(&film.twist(change.twists));
            film.exchange(&wrench, &mut out.wrenches);
        }
    }

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        for film in self.0.iter().filter_map(|gap| gap.filled(&at.place)) {
            let [y, virt] = [at.twists, z.twists].map(|field| film.twist(field));
            let [wrench, twist_bar] = [&y, &virt].map(|x| film.wrench(x));
            let (displaced, by_roughness) = film.placed.product_vjp(&film.gap.bearing, &virt, &y);
            bar.parameters[film.gap.viscosity] -= virt.dot(&(film.placed.damping * y));
            bar.parameters[film.gap.roughness] -= film.viscosity * by_roughness;
            film.exchange(&twist_bar, bar.twist);
            let displaced = film.frame.wrench_to_world(&(-film.viscosity * displaced));
            film.exchange(&displaced, bar.pose);
            // The rotation of the frame acts on both twists.
            if let Some(b) = film.gap.second {
                bar.pose[b] -= cross_force(&film.relative(at.twists), &twist_bar)
                    + cross_force(&film.relative(z.twists), &wrench);
            }
        }
    }

    fn ties(&self) -> Option<Vec<[usize; 2]>> {
        Some(
            (self.0.iter())
                .filter_map(|gap| Some([gap.first, gap.second?]))
                .collect(),
        )
    }

    fn outside(&self, group: &Together, _: &Parameters) -> Outside {
        let mut each = self.0.iter();
        let across = |g: &Gap| group.across(Some(g.first), g.second);
        match each.all(|g| across(g) == Outside::Nothing) {
            true => Outside::Nothing,
            false => Outside::All,
        }
    }
}
