//! Bodies that lie in each other at the start.
//!
//! A body and the nearest one with a surface that carries it may touch and overlap (`overlaps_parent`), up to half of the smaller one's volume; others may not. Hulls of links do
//! where the links don't. What lies in each other beyond that is parted by a plane: of two convex bodies the halves on either side of a plane within the overlap are convex and
//! apart, and what is lost is the overlap and little more. A body that would lose more than half becomes dry.

use super::hull::{fine_half, half, least_overlap};
use super::report::Report;
use super::surface::{Immersed, Surface};
use crate::Result;
use crate::geometry::{Gaps, Other, Share, Solid, TriMesh};
use hydrograd_adjoint::lie::{Pose, Vec3};

/// Most of the smaller one's volume that bodies joined to each other share once they are parted: half is allowed in a run, in which they move.
const MOST_SHARED: f64 = 0.35;
/// The gap between a body and what carries it up to which they count as touching, of the smaller one's size.
const NEAR: f64 = 0.1;
/// The gap that is left where two are parted, of the smaller one's size.
const ROOM: f64 = 0.04;
/// Least part of a body's volume that is left of it when it is parted.
const LEFT: f64 = 0.5;
/// Rounds of parting; a cut may part others as well.
const ROUNDS: usize = 4;

/// Surfaces as they stand.
struct Standing {
    meshes: Vec<Option<TriMesh>>,
    solids: Vec<Option<Solid>>,
}

impl Standing {
    fn of(wets: &[Immersed]) -> Result<Self> {
        let (mut meshes, mut solids) = (Vec::new(), Vec::new());
        for wet in wets {
            let surface = wet.surface.as_ref();
            meshes.push(surface.map(Surface::mesh).transpose()?);
            solids.push(surface.map(Surface::solid).transpose()?.flatten());
        }
        Ok(Self { meshes, solids })
    }

    fn gaps(&self, poses: &[Pose]) -> Result<Vec<(usize, usize, f64)>> {
        let meshes: Vec<_> = self.meshes.iter().map(Option::as_ref).collect();
        let gaps = Gaps::new(&meshes, &[], &[])?.by_formula(self.solids.clone())?;
        let pair = |gap: crate::geometry::Gap| match gap.second {
            Other::Body(b) => Some((gap.first.min(b), gap.first.max(b), gap.distance)),
            Other::Wall(_) => None,
        };
        Ok(gaps.all(poses).into_iter().filter_map(pair).collect())
    }

    fn volume(&self, b: usize) -> f64 {
        let mesh = self.meshes[b].as_ref();
        mesh.map_or(0.0, |m| m.mass_properties().volume)
    }

    /// Radius of the ball as large as the smaller one of two.
    fn size(&self, a: usize, b: usize) -> f64 {
        let least = self.volume(a).min(self.volume(b));
        (0.75 / std::f64::consts::PI * least).cbrt()
    }

    fn share(&self, a: usize, b: usize, poses: &[Pose]) -> f64 {
        let meshes: Vec<_> = self.meshes.iter().map(Option::as_ref).collect();
        Share::new(&meshes, (a, b)).map_or(0.0, |share| share.at(poses))
    }
}

/// The nearest body with a surface that carries each.
fn carriers(wets: &[Immersed], parents: &[Option<usize>]) -> Vec<Option<usize>> {
    let of = |b: usize| {
        let mut carrying = std::iter::successors(parents[b], |b| parents[*b]);
        carrying.find(|b| wets[*b].surface.is_some())
    };
    (0..wets.len()).map(of).collect()
}

/// The bodies to be parted.
struct Bodies<'b> {
    names: &'b [String],
    parents: &'b [Option<usize>],
    poses: &'b [Pose],
    /// Volumes before anything was cut, m³.
    whole: Vec<f64>,
}

/// Parts bodies at these poses where they may not overlap, and says which ones are to be declared to overlap what carries them.
pub(super) fn untangle(
    wets: &mut [Immersed],
    names: &[String],
    parents: &[Option<usize>],
    poses: &[Pose],
    report: &mut Report,
) -> Result<()> {
    let first = Standing::of(wets)?;
    let bodies = Bodies {
        names,
        parents,
        poses,
        whole: (0..wets.len()).map(|b| first.volume(b)).collect(),
    };
    for round in 0..=ROUNDS {
        if !bodies.part_all(wets, round == ROUNDS, report)? {
            break;
        }
    }
    bodies.tell_cuts(wets, report)
}

/// Which bodies touch or overlap the one that carries them, or nearly so; whatever else still overlaps becomes dry.
pub(super) fn declare(
    wets: &mut [Immersed],
    names: &[String],
    parents: &[Option<usize>],
    poses: &[Pose],
    report: &mut Report,
) -> Result<Vec<bool>> {
    loop {
        let standing = Standing::of(wets)?;
        let carriers = carriers(wets, parents);
        let mut declared = vec![false; wets.len()];
        let mut bad = None;
        for (a, b, distance) in standing.gaps(poses)? {
            if carriers[b] == Some(a) {
                declared[b] = distance < NEAR * standing.size(a, b);
                if declared[b] && distance < 0.0 && standing.share(a, b, poses) > MOST_SHARED + 0.1
                {
                    bad = Some((a, b));
                }
            } else if distance <= 0.0 {
                bad = Some((a, b));
            }
        }
        let Some((a, b)) = bad else {
            return Ok(declared);
        };
        let small = if standing.volume(a) < standing.volume(b) {
            a
        } else {
            b
        };
        dry(wets, names, (a, b), small, report);
    }
}

fn dry(
    wets: &mut [Immersed],
    names: &[String],
    (a, b): (usize, usize),
    small: usize,
    report: &mut Report,
) {
    let other = if small == a { b } else { a };
    report.warn(format!(
        "body {:?} is dry: it lies in body {:?}, and no plane parts the two without taking half of one",
        names[small], names[other]
    ));
    wets[small] = Immersed::dry(format!("it lies in body {:?}", names[other]));
}

impl Bodies<'_> {
    /// Parts all pairs that need it once; whether there were any. In the last round bodies become dry instead.
    fn part_all(&self, wets: &mut [Immersed], last: bool, report: &mut Report) -> Result<bool> {
        let mut standing = Standing::of(wets)?;
        let carriers = carriers(wets, self.parents);
        let mut any = false;
        for (a, b, distance) in standing.gaps(self.poses)? {
            if wets[a].surface.is_none() || wets[b].surface.is_none() {
                continue;
            }
            let joined = carriers[b] == Some(a);
            let needed = match joined {
                true => distance < 0.0 && standing.share(a, b, self.poses) > MOST_SHARED,
                false => distance <= 0.0,
            };
            if !needed {
                continue;
            }
            any = true;
            let parted = match last {
                true => false,
                false => self.part(wets, &standing, (a, b), joined)?,
            };
            if !parted {
                let small = if standing.volume(a) < standing.volume(b) {
                    a
                } else {
                    b
                };
                dry(wets, self.names, (a, b), small, report);
            }
            for body in [a, b] {
                standing.meshes[body] = (wets[body].surface.as_ref())
                    .map(Surface::mesh)
                    .transpose()?;
            }
        }
        Ok(any)
    }

    /// Cuts two bodies apart, or, if they are joined, the smaller one until they share no more than may be; whether enough is left of both.
    fn part(
        &self,
        wets: &mut [Immersed],
        standing: &Standing,
        (a, b): (usize, usize),
        joined: bool,
    ) -> Result<bool> {
        let in_world = |body: usize| -> Option<TriMesh> {
            let mesh = match wets[body].surface.as_ref()? {
                Surface::Mesh { convex: false, .. } => return None,
                convex => convex.mesh().ok()?,
            };
            Some(mesh.transformed(&self.poses[body]))
        };
        let (Some(one), Some(other)) = (in_world(a), in_world(b)) else {
            return Ok(false);
        };
        let Some((normal, level, depth)) = least_overlap(&one, &other) else {
            return Ok(false);
        };
        let room = 0.5 * ROOM * standing.size(a, b);
        let cuts: Vec<(usize, Vec3, f64)> = match joined {
            false => {
                let middle = level - 0.5 * depth;
                vec![(a, normal, middle - room), (b, -normal, -(middle + room))]
            }
            true => {
                // Of the smaller one, as little as will do.
                let small = if standing.volume(a) < standing.volume(b) {
                    a
                } else {
                    b
                };
                let steps = [0.25, 0.5, 0.75, 1.0];
                let cut = |part: f64| match small == b {
                    true => (b, -normal, -(level - depth * (1.0 - part))),
                    false => (a, normal, level - part * depth),
                };
                let enough = |part: &f64| {
                    let (body, n, at) = cut(*part);
                    let mesh = if body == a { &one } else { &other };
                    let Some(left) = half(mesh, &n, at) else {
                        return true;
                    };
                    let pair = match body == a {
                        true => [Some(&left), Some(&other)],
                        false => [Some(&one), Some(&left)],
                    };
                    let still = [Pose::identity(), Pose::identity()];
                    Share::new(&pair, (0, 1)).is_none_or(|s| s.at(&still) <= MOST_SHARED)
                };
                let part = steps.into_iter().find(enough).unwrap_or(1.0);
                vec![cut(part)]
            }
        };
        let mut made = Vec::new();
        for (body, n, at) in cuts {
            let pose = &self.poses[body];
            // n·(R x + t) ≤ level, in the body's frame.
            let own = pose.rotation.transpose() * n;
            let at = at - n.dot(&pose.translation);
            let Some(wet) = cut(&wets[body], &own, at)? else {
                return Ok(false);
            };
            let Some(surface) = &wet.surface else {
                return Ok(false);
            };
            if surface.mesh()?.mass_properties().volume < LEFT * self.whole[body] {
                return Ok(false);
            }
            made.push((body, wet));
        }
        for (body, wet) in made {
            wets[body] = wet;
        }
        Ok(true)
    }

    /// Says what was cut off.
    fn tell_cuts(&self, wets: &mut [Immersed], report: &mut Report) -> Result<()> {
        for (b, wet) in wets.iter_mut().enumerate() {
            let Some(surface) = &wet.surface else {
                continue;
            };
            let left = surface.mesh()?.mass_properties().volume / self.whole[b];
            if left < 1.0 - 1e-6 {
                report.warn(format!(
                    "body {:?}: {:.1} % of its hull lay in other bodies and was cut off by a plane",
                    self.names[b],
                    100.0 * (1.0 - left)
                ));
                wet.said.push_str(", cut where it lay in others");
            }
        }
        Ok(())
    }
}

/// The part of a convex body where `normal`·x ≤ `level`, its pieces for contact with it.
fn cut(wet: &Immersed, normal: &Vec3, level: f64) -> Result<Option<Immersed>> {
    type Half = fn(&TriMesh, &Vec3, f64) -> Option<TriMesh>;
    let convex = |surface: &Surface, half: Half| -> Result<Option<Surface>> {
        let mesh = surface.mesh()?;
        if mesh.vertices().iter().all(|x| normal.dot(x) <= level) {
            return Ok(Some(surface.clone()));
        }
        Ok(half(&mesh, normal, level).map(|mesh| Surface::Mesh { mesh, convex: true }))
    };
    let Some(surface) = wet.surface.as_ref() else {
        return Ok(None);
    };
    let Some(left) = convex(surface, fine_half)? else {
        return Ok(None);
    };
    let mut pieces = Vec::new();
    for piece in &wet.pieces {
        pieces.extend(convex(piece, half)?);
    }
    if pieces.is_empty() && matches!(left, Surface::Mesh { .. }) {
        // Few faces are enough to touch with.
        pieces.push(convex(surface, half)?.unwrap_or_else(|| left.clone()));
    }
    Ok(Some(Immersed {
        surface: Some(left),
        pieces,
        said: wet.said.clone(),
    }))
}
