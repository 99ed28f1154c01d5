//! Viscous water that is squeezed out between surfaces: W = −C(q) V on the one that moves with the twist V against the other
//! ([`crate::coupling::lubrication`]), opposite on the other one. Solved with contact.

use super::{
    CoarseGap, ForceModel, ForceParts, LoadBars, Loads, Lubricated, Moving, Outside, Place,
    Together, Velocity, coarser,
};
use crate::Result;
use crate::adjoint::lie::{Pose, Vec6, cross_force};
use crate::coupling::lubrication::{NearBearings, PlacedBearing, Unsolved};
use crate::dynamics::parameters::{Declarations, Declared, Owner, Parameter, Parameters, Range};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// At zero a change is measured by what makes the Reynolds number a thousand.
const VISCOSITY: Declared = Declared::new("viscosity", "Pa s")
    .size(|value, typical| value.max(1e-3 * typical.density * typical.speed * typical.length));
const ROUGHNESS: Declared = Declared::new("roughness", "m").range(Range::Positive);
/// Last places that are kept: those of a step are asked for several times, and of a trajectory's in turn by its reverse.
const KEPT: usize = 8;

struct Lubrication {
    gaps: Vec<Gap>,
    /// Of each force.
    roughness: Vec<Parameter>,
    /// Of bodies, for messages.
    names: Vec<String>,
    /// Which of them may have water in them.
    near: NearBearings,
    kept: Mutex<VecDeque<Arc<Filled>>>,
}

struct Gap {
    own: Lubricated,
    viscosity: Parameter,
    roughness: Parameter,
}

/// The gaps with water in them, where bodies are at these poses.
struct Filled {
    poses: Vec<Pose>,
    /// Of each force, m.
    roughness: Vec<f64>,
    films: Vec<Film>,
    /// A gap that has water in it whose pressure isn't found.
    unsolved: Option<(usize, Unsolved)>,
}

/// The water in a gap.
struct Film {
    /// Number of the gap.
    gap: usize,
    key: Key,
    placed: Arc<PlacedBearing>,
}

/// The pose of the first in the frame of the other, and the roughness.
type Key = (Pose, f64);

/// A film as bodies and parameters have it.
struct Acting<'f> {
    gap: &'f Gap,
    /// Axes of the other, about the origin of the first.
    frame: Pose,
    viscosity: f64,
    placed: &'f PlacedBearing,
}

pub(super) fn assemble(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    let (mut gaps, mut rough) = (Vec::new(), Vec::new());
    for (i, force) in parts.scene.lubrications() {
        let mut declare = |declared, value| {
            parameters.declare(Owner::Named(parts.scene.force_name(i)), declared, value)
        };
        let viscosity = declare(VISCOSITY, force.viscosity);
        let roughness = declare(ROUGHNESS, force.roughness);
        rough.push(roughness);
        let own = parts.lubricated.iter().filter(|g| g.force == i);
        gaps.extend(own.map(|gap| Gap {
            own: gap.clone(),
            viscosity,
            roughness,
        }));
    }
    (!gaps.is_empty())
        .then(|| Box::new(Lubrication::new(gaps, rough, parts)) as Box<dyn ForceModel>)
}

impl Gap {
    fn key(&self, place: &Place) -> Key {
        let own = &place.poses[self.own.first];
        let other = (self.own.second).map_or(Pose::identity(), |b| place.poses[b]);
        (
            other.inverse().compose(own),
            place.parameters[self.roughness],
        )
    }
}

impl Lubrication {
    fn new(gaps: Vec<Gap>, roughness: Vec<Parameter>, parts: &ForceParts) -> Self {
        let each = gaps.iter().map(|gap| &gap.own);
        let each = each.map(|own| (own.first, own.second, &own.bearing));
        Self {
            near: NearBearings::new(parts.bodies.len(), each),
            names: parts.bodies.iter().map(|b| b.name.clone()).collect(),
            gaps,
            roughness,
            kept: Mutex::default(),
        }
    }

    /// The gaps with water in them, found once at a place.
    fn filled(&self, place: &Place) -> Arc<Filled> {
        let lock = || self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let known = lock().clone();
        let roughness = self.roughness.iter().map(|r| place.parameters[*r]);
        let roughness: Vec<f64> = roughness.collect();
        let same = |at: &&Arc<Filled>| at.poses == place.poses && at.roughness == roughness;
        if let Some(found) = known.iter().find(same) {
            return found.clone();
        }
        // Without the lock: another thread may make the same.
        let mut made = Filled {
            poses: place.poses.to_vec(),
            roughness,
            films: Vec::new(),
            unsolved: None,
        };
        for gap in self.near.at(place.poses) {
            let own = &self.gaps[gap];
            let key = own.key(place);
            let before = known.iter().find_map(|at| {
                let film = &at.films[at.films.binary_search_by_key(&gap, |f| f.gap).ok()?];
                (film.key == key).then(|| film.placed.clone())
            });
            let placed = match before {
                Some(placed) => Ok(Some(placed)),
                None => (own.own.bearing.placed(&key.0, key.1)).map(|placed| placed.map(Arc::new)),
            };
            match placed {
                Ok(Some(placed)) => made.films.push(Film { gap, key, placed }),
                Ok(None) => {}
                Err(why) => made.unsolved = made.unsolved.or(Some((gap, why))),
            }
        }
        let made = Arc::new(made);
        let mut kept = lock();
        if kept.len() >= KEPT {
            kept.pop_front();
        }
        kept.push_back(made.clone());
        made
    }

    /// Hands over each film at a place.
    fn each(&self, place: &Place, mut to: impl FnMut(Acting)) {
        for film in &self.filled(place).films {
            let gap = &self.gaps[film.gap];
            let other = (gap.own.second).map_or(Pose::identity(), |b| place.poses[b]);
            to(Acting {
                gap,
                frame: Pose::new(other.rotation, place.poses[gap.own.first].translation),
                viscosity: place.parameters[gap.viscosity],
                placed: &film.placed,
            });
        }
    }
}

impl Acting<'_> {
    /// How the first moves against the other, in the axes of the other.
    fn twist(&self, field: &[Vec6]) -> Vec6 {
        self.frame.twist_to_body(&self.relative(field))
    }

    /// The same, spatial.
    fn relative(&self, field: &[Vec6]) -> Vec6 {
        field[self.gap.own.first] - (self.gap.own.second).map_or(Vec6::zeros(), |b| field[b])
    }

    /// −C V, spatial.
    fn wrench(&self, twist: &Vec6) -> Vec6 {
        let own = -self.viscosity * (self.placed.damping * twist);
        self.frame.wrench_to_world(&own)
    }

    /// Adds a wrench to the first body and takes it from the other.
    fn exchange(&self, wrench: &Vec6, out: &mut [Vec6]) {
        out[self.gap.own.first] += wrench;
        if let Some(b) = self.gap.own.second {
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

    fn check_at(&self, place: &Place) -> Result<()> {
        let Some((gap, why)) = self.filled(place).unsolved else {
            return Ok(());
        };
        let own = &self.gaps[gap].own;
        Err(why.error(
            &self.names[own.first],
            own.second.map(|b| self.names[b].as_str()),
        ))
    }

    fn coarse_at(&self, place: &Place) -> Option<CoarseGap> {
        let filled = self.filled(place);
        let coarse = filled.films.iter().filter_map(|film| {
            let own = &self.gaps[film.gap].own;
            Some(CoarseGap {
                first: own.first,
                second: own.second,
                distance: film.placed.distance(),
                ratio: film.placed.coarse()?,
            })
        });
        coarse.fold(None, |worst, gap| coarser(worst, Some(gap)))
    }

    fn acts(&self, place: &Place) -> bool {
        !self.filled(place).films.is_empty()
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        self.each(&at.place, |film| {
            let wrench = film.wrench(&film.twist(at.twists));
            film.exchange(&wrench, &mut out.wrenches);
        });
    }

    fn jvp(&self, at: &Moving, change: &Velocity, out: &mut Loads) {
        self.each(&at.place, |film| {
            let wrench = film.wrench(&film.twist(change.twists));
            film.exchange(&wrench, &mut out.wrenches);
        });
    }

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        self.each(&at.place, |film| {
            let [y, virt] = [at.twists, z.twists].map(|field| film.twist(field));
            let [wrench, twist_bar] = [&y, &virt].map(|x| film.wrench(x));
            let (displaced, by_roughness) =
                film.placed.product_vjp(&film.gap.own.bearing, &virt, &y);
            bar.parameters[film.gap.viscosity] -= virt.dot(&(film.placed.damping * y));
            bar.parameters[film.gap.roughness] -= film.viscosity * by_roughness;
            film.exchange(&twist_bar, bar.twist);
            let displaced = film.frame.wrench_to_world(&(-film.viscosity * displaced));
            film.exchange(&displaced, bar.pose);
            // The rotation of the frame acts on both twists.
            if let Some(b) = film.gap.own.second {
                bar.pose[b] -= cross_force(&film.relative(at.twists), &twist_bar)
                    + cross_force(&film.relative(z.twists), &wrench);
            }
        });
    }

    fn ties_at(&self, place: &Place) -> Option<Vec<[usize; 2]>> {
        let gaps = self.filled(place);
        let gaps = gaps.films.iter().map(|film| &self.gaps[film.gap].own);
        Some(
            gaps.filter_map(|gap| Some([gap.first, gap.second?]))
                .collect(),
        )
    }

    fn outside(&self, group: &Together, _: &Parameters) -> Outside {
        let mut each = self.gaps.iter();
        let across = |g: &Gap| group.across(Some(g.own.first), g.own.second);
        match each.all(|g| across(g) == Outside::Nothing) {
            true => Outside::Nothing,
            false => Outside::All,
        }
    }
}
