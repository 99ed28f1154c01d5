//! How near the bodies are to one another and to the walls, and what that means for the flow.

use super::fidelity::Fidelity;
use super::gap_error::GapError;
use super::resolved::{Resolved, narrowest};
use super::surface::{Surface, overlaps, touches, touching};
use crate::adjoint::lie::Pose;
use crate::error::readable;
use crate::geometry::{Gap, Gaps, Other, Pairing, Share, overlap_error};
use crate::multibody::Tree;
use crate::scene::Scene;
use crate::{Error, Result};
use std::f64::consts::PI;

/// What an error of a gap is about.
const GAP: &str = "gap in m";
/// Largest part of a body's volume that may lie inside a larger one that it is declared to overlap.
const MOST_SHARED: f64 = 0.5;
/// Edges under which sources inside the bodies don't resolve a flat gap at all: the force between boxes has the wrong sign there. The image in a wall is twice
/// as far away as the wall.
const BY_SOURCES: f64 = 3.5;
/// A gap is thin where it is less than this part of the radius of a disc with the area over which the surfaces are parallel.
const THIN: f64 = 0.4;
/// Estimated error of the force across a gap that the user is told of.
const TOLD: f64 = 0.15;
/// Energy of the film in a gap, in that of the water that the smaller body displaces, from which sources that lose it are refused.
const LOST: f64 = 0.2;

/// The gaps of a scene's bodies, from their surfaces in body frames: those of shapes by formula exact, others of meshes.
#[derive(Clone)]
pub(crate) struct Clearance {
    /// Between pairs that move relative to one another and aren't declared to overlap, and to the
    /// walls.
    pub moving: Gaps,
    /// Between pairs that don't move relative to one another and aren't declared to overlap.
    pub rigid: Gaps,
    /// How much pairs declared to overlap do so.
    declared: Vec<Share>,
    /// The nearest body with a shape that carries each.
    parents: Vec<Option<usize>>,
    /// Names of the bodies.
    names: Vec<String>,
    /// Whether the scene has contact.
    contact: bool,
    /// Volumes of the bodies, m³.
    volumes: Vec<f64>,
    /// Areas of their surfaces, m².
    areas: Vec<f64>,
    /// Whether the flow is made by sources inside the bodies, which no flat gap is resolved by.
    pub by_sources: bool,
    /// Whether the flow has a solution where bodies touch.
    pub may_touch: bool,
    /// Whether gaps that compressed bodies don't resolve have films.
    pub films: bool,
    /// The narrowest gap that is resolved, in edges.
    pub resolved_edges: f64,
}

/// What moves bodies that rest in the world.
const WORLD: usize = usize::MAX;

/// The nearest joint that moves each body: those with the same one don't move relative to one another.
fn movers(scene: &Scene, tree: &Tree) -> Vec<usize> {
    let mut out: Vec<usize> = Vec::with_capacity(scene.bodies.len());
    for (b, (body, link)) in scene.bodies.iter().zip(tree.links()).enumerate() {
        let held = body.locked && body.motion.is_none();
        out.push(match (link.columns.is_empty() || held, link.parent) {
            (false, _) => b,
            (true, Some(parent)) => out[parent],
            (true, None) => WORLD,
        });
    }
    out
}

impl Clearance {
    pub fn new(scene: &Scene, surfaces: &[Option<Surface>], tree: &Tree) -> Result<Self> {
        let bodies = scene.bodies.len();
        let meshes: Vec<_> = surfaces
            .iter()
            .map(|s| s.as_ref().map(|s| &s.mesh))
            .collect();
        let carriers = scene.carriers();
        let declared = carriers.overlapping();
        let shares = declared.iter().map(|pair| Share::new(&meshes, *pair));
        let (shares, movers) = (shares.collect::<Vec<_>>(), movers(scene, tree));
        let solids: Vec<_> = surfaces.iter().map(|s| s.as_ref()?.solid.clone()).collect();
        let all = Gaps::new(&meshes, &[], &[])?.by_formula(solids)?;
        // What rests in the world stays as far from walls as it is.
        let rests: Vec<bool> = movers.iter().map(|mover| *mover == WORLD).collect();
        let goes = rests.iter().map(|rests| !rests).collect();
        let rigid = Pairing::within(movers.clone()).but(declared.clone());
        let moving = Pairing::between(movers).but(declared).at_walls(goes);
        Ok(Self {
            rigid: all.paired(&scene.walls, rigid.at_walls(rests))?,
            moving: all.paired(&scene.walls, moving)?,
            declared: shares.into_iter().flatten().collect(),
            parents: (0..bodies).map(|b| carriers.submerged_parent(b)).collect(),
            names: scene.bodies.iter().map(|b| b.name.clone()).collect(),
            contact: scene.contact.is_some(),
            volumes: surfaces
                .iter()
                .map(|s| s.as_ref().map_or(0.0, |s| s.properties.volume))
                .collect(),
            areas: surfaces
                .iter()
                .map(|s| s.as_ref().map_or(0.0, |s| s.mesh.surface_area()))
                .collect(),
            by_sources: false,
            may_touch: true,
            films: false,
            resolved_edges: 0.0,
        })
    }

    /// Refuses a start with bodies in one another or in a wall: the coupled flow has no meaning there.
    pub fn refuse_start(&self, poses: &[Pose]) -> Result<()> {
        for gaps in [&self.moving, &self.rigid] {
            if let Some(gap) = gaps.smallest(poses)
                && overlaps(&gap)
            {
                let mut error = overlap_error(&gap, &self.names);
                if let Error::Unresolved { remedy, .. } = &mut error {
                    remedy.push_str(&self.hint(&gap));
                }
                return Err(error);
            }
        }
        self.refuse_depth(poses)
    }

    /// Area over which the surfaces at a gap of `gaps` are parallel, m², and the energy of the water that flows along it as a film, in that of the water
    /// that the smaller body displaces: over a gap h and a round area A it is ½ ρ A² U²/(8π h).
    pub fn film(&self, gaps: &Gaps, gap: &Gap, poses: &[Pose]) -> (f64, f64) {
        let own = self.volumes[gap.first];
        let volume = match gap.second {
            Other::Body(b) => own.min(self.volumes[b]),
            Other::Wall(_) => own,
        };
        let area = gaps.parallel_area(gap, poses);
        (area, area.powi(2) / (8.0 * PI * gap.distance * volume))
    }

    /// Refuses flat gaps that sources inside the bodies don't resolve: what they give there is smaller than the truth by a factor and
    /// has slopes of the wrong sign.
    pub fn refuse_film(&self, poses: &[Pose]) -> Result<()> {
        if !self.by_sources {
            return Ok(());
        }
        let limit = |gap: &Gap| match gap.second {
            Other::Body(_) => BY_SOURCES * gap.edge,
            Other::Wall(_) => 0.5 * BY_SOURCES * gap.edge,
        };
        let widest = BY_SOURCES * self.moving.longest_edge();
        let all = self.moving.within(poses, widest);
        for gap in all.iter().filter(|gap| gap.distance < limit(gap)) {
            let (area, energy) = self.film(&self.moving, gap, poses);
            if energy > LOST && gap.distance < THIN * (area / PI).sqrt() {
                return Err(Error::Unresolved {
                    place: self.place(gap),
                    quantity: "flat gap in m".into(),
                    value: gap.distance,
                    limit: limit(gap),
                    remedy: format!(
                        "over {area:.3e} m² the water between them is a film, which fundamental solutions don't resolve under 3½ edges between bodies, 1¾ to a wall: \
                         use the method panel, or more faces, or end the run before"
                    ),
                });
            }
        }
        Ok(())
    }

    /// Refuses bodies that touch where that has no solution.
    pub fn refuse_touch(&self, smallest: Option<&Gap>) -> Result<()> {
        match smallest.filter(|gap| touches(gap) && !self.may_touch) {
            None => Ok(()),
            Some(gap) => Err(Error::Unresolved {
                place: self.place(gap),
                quantity: GAP.into(),
                value: gap.distance,
                limit: 0.0,
                remedy: format!(
                    "they touch, and coupled panels have no solution without water between: move them apart, or use the fidelity isolated{}",
                    self.hint(gap)
                ),
            }),
        }
    }

    /// Stops a run when bodies get into one another or into a wall.
    pub fn keep_apart(&self, poses: &[Pose]) -> Result<()> {
        // Of gaps that aren't as small nothing is asked here.
        let touching = self
            .moving
            .within(poses, touching(self.moving.longest_edge()));
        let smallest = (touching.into_iter()).min_by(|a, b| a.distance.total_cmp(&b.distance));
        if let Some(gap) = smallest.as_ref().filter(|gap| overlaps(gap)) {
            return Err(Error::Unresolved {
                place: self.place(gap),
                quantity: GAP.into(),
                value: gap.distance,
                limit: 0.0,
                remedy: self.part(-gap.distance, &self.hint(gap)),
            });
        }
        self.refuse_film(poses)?;
        self.refuse_touch(smallest.as_ref())?;
        self.refuse_depth(poses)
    }

    /// What to do about bodies that get into one another by `depth`, m.
    fn part(&self, depth: f64, hint: &str) -> String {
        match self.contact {
            true if !hint.is_empty() => format!(
                "they overlap by {depth:.3e} m, where the water can't be solved, and one carries the other, between which contact doesn't act: give the joint `limits`{hint}"
            ),
            true => format!(
                "they overlap by {depth:.3e} m, where the water can't be solved: raise \
                 contact.stiffness or contact.gap, or take a smaller time step"
            ),
            false => format!(
                "they overlap by {depth:.3e} m, and the scene has no contact: give it a section \
                 [contact], end the run earlier, keep them apart by the controls, or use \
                 the fidelity isolated{hint}"
            ),
        }
    }

    /// An error of a step within which bodies get into one another, with what to do about it here.
    pub fn explain(&self, mut error: Error) -> Error {
        if let Error::Unresolved {
            quantity,
            value,
            remedy,
            ..
        } = &mut error
            && quantity == GAP
            && *value <= 0.0
        {
            *remedy = self.part(-*value, "");
        }
        error
    }

    /// Refuses bodies that lie too far inside one another though they may overlap.
    fn refuse_depth(&self, poses: &[Pose]) -> Result<()> {
        for share in &self.declared {
            if let Some(value) = share.above(poses, MOST_SHARED) {
                let (inner, outer) = share.bodies();
                let name = |b: usize| format!("body {:?}", self.names[b]);
                return Err(Error::Unresolved {
                    place: format!("{} inside {}", name(inner), name(outer)),
                    quantity: "part of its volume".into(),
                    value,
                    limit: MOST_SHARED,
                    remedy: "links with `overlaps_parent` may share up to half of the smaller \
                             one's volume: move them apart, or make one body of them"
                        .into(),
                });
            }
        }
        Ok(())
    }

    /// What the smallest gap of a run means.
    pub fn warning(&self, time: f64, gap: &Gap, fidelity: Fidelity) -> Option<String> {
        let (time, place, hint) = (readable(time), self.place(gap), self.hint(gap));
        (fidelity.kind()).gap_warning(gap, self.resolved_edges, &place, &time.to_string(), &hint)
    }

    /// How bodies of which one carries the other may be declared to overlap.
    fn hint(&self, gap: &Gap) -> String {
        let Other::Body(second) = gap.second else {
            return String::new();
        };
        let (a, b) = (gap.first.min(second), gap.first.max(second));
        if self.parents[b] != Some(a) {
            return String::new();
        }
        format!(
            ". If they are links that belong together, write `overlaps_parent = true` for body {:?}: \
             the two then don't feel each other through the water",
            self.names[b]
        )
    }

    /// Names of both.
    fn place(&self, gap: &Gap) -> String {
        let name = |b: usize| format!("body {:?}", self.names[b]);
        match gap.second {
            Other::Body(b) => format!("{} and {}", name(gap.first), name(b)),
            Other::Wall(w) => format!("{} and wall {w}", name(gap.first)),
        }
    }

    /// Radius of the ball as large as the smaller one of the bodies at a gap, m.
    pub fn size(&self, gap: &Gap) -> f64 {
        let volumes = gap.sides().map(|(b, _)| self.volumes[b]);
        (0.75 / PI * volumes.fold(f64::INFINITY, f64::min)).cbrt()
    }

    /// Radius of the ball with as large a surface as the larger one of the bodies at a gap, m; 0 at a wall, which is resolved however small the body.
    pub fn expanse(&self, gap: &Gap) -> f64 {
        let Other::Body(second) = gap.second else {
            return 0.0;
        };
        let area = self.areas[gap.first].max(self.areas[second]);
        (area / (4.0 * PI)).sqrt()
    }

    /// That the force across the smallest gap at the start isn't as accurate as the added mass is aimed to be.
    pub fn aimed(&self, gap: &Gap, error: GapError, aim: f64) -> String {
        format!(
            "{} start {:.3e} m apart, with {} between: the force across is estimated to be off by {:.1} %, the added mass along by {:.1} %, for {:.2} % aimed at",
            self.place(gap),
            gap.distance,
            error.carried.by(),
            100.0 * error.force,
            100.0 * error.added_mass,
            100.0 * aim
        )
    }

    /// What the user should know of the water across a gap that is estimated to be so far off.
    pub fn estimated(&self, time: f64, gap: &Gap, error: GapError) -> Option<String> {
        (error.force > TOLD).then(|| {
            format!(
                "{}: the gap whose water is estimated to be furthest off, {:.3e} m at t = {} s, is narrower than is resolved with edges of {:.3e} m: the force of the water across it, by {}, may be off by \
                 {:.0} %, the added mass along it by {:.1} % (estimated; `check_gap` measures it); use more faces, refine the bodies there (`refine`), or end the run before{}",
                self.place(gap),
                gap.distance.max(0.0),
                readable(time),
                gap.edge,
                error.carried.by(),
                100.0 * error.force,
                100.0 * error.added_mass,
                self.hint(gap)
            )
        })
    }

    /// The gap that is smallest against what compressed bodies resolve, if it isn't resolved. `states`
    /// are times, poses and smallest gaps; `resolved` what each body resolves, and `error` estimates that across a gap.
    pub fn unresolved<'a>(
        &self,
        states: impl Iterator<Item = (f64, &'a [Pose], Gap)>,
        resolved: &[Resolved],
        error: impl Fn(&Gap, &[Pose]) -> Option<GapError>,
    ) -> Option<String> {
        let coarsest = resolved.iter().map(|r| r.everywhere).fold(0.0, f64::max);
        let mut worst: Option<(f64, f64, Gap, f64, &[Pose])> = None;
        for (time, poses, smallest) in states {
            if smallest.distance >= coarsest {
                continue;
            }
            for gap in self.moving.within(poses, coarsest) {
                if let Some((ratio, limit)) = narrowest(&self.moving, &gap, poses, resolved)
                    && ratio < 1.0
                    && worst.is_none_or(|w| ratio < w.0)
                {
                    worst = Some((ratio, time, gap, limit, poses));
                }
            }
        }
        let (ratio, time, gap, limit, poses) = worst?;
        let error = error(&gap, poses)?;
        let limit = match gap.second {
            Other::Body(_) => limit,
            Other::Wall(_) => 0.5 * limit,
        };
        Some(format!(
            "{}: the gap that is narrowest against what is resolved, {:.3e} m at t = {} s, is {ratio:.2} of what their compressed sources \
         resolve ({limit:.3e} m): the force across it may be off by {:.0} %, the added mass along it by {:.1} % (estimated; `check_gap` measures it); turn films on, or end the run \
         before",
            self.place(&gap),
            gap.distance.max(0.0),
            readable(time),
            100.0 * error.force,
            100.0 * error.added_mass
        ))
    }
}
