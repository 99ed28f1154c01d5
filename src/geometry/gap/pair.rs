//! Two placed surfaces: how far apart, or how deep in one another.

use crate::geometry::boxes::Node;
use crate::geometry::tree::MeshTree;
use crate::geometry::triangle::Triangle;
use hydrograd_adjoint::lie::{Mat3, Pose, Vec3};

/// Points of each kind, at most, at which a depth is measured.
const SAMPLES: usize = 20_000;
/// Points between opposite faces, at most, at which a depth is measured.
const MIDDLES: usize = 250;
/// Times to go to and fro between two surfaces, at most.
const APPROACHES: usize = 12;
/// Pairs of crossing faces, at most, whose edges are followed.
const CROSSINGS: usize = 100_000;
/// Distances below this times the coordinates are touching: rounding can't tell them apart.
const TOUCHING: f64 = 1e-13;
/// Boxes that can improve the square of the distance by less than this are passed over.
const TIE: f64 = 1e-11;

/// What there is between two surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Between {
    /// m, negative: depth.
    pub distance: f64,
    /// Mean edge length near the closest points, m.
    pub edge: f64,
}

/// Two surfaces, the second in the frame of the first.
pub(super) struct Pair<'a> {
    a: &'a MeshTree,
    b: &'a MeshTree,
    /// Frame of b in the frame of a.
    pose: Pose,
    /// Absolute values of its rotation.
    spread: Mat3,
    /// Distance that counts as touching, m.
    touching: f64,
}

/// An outer and an inner surface, and where the inner one's points are in the outer's frame.
type Side<'s> = (&'s MeshTree, &'s MeshTree, &'s dyn Fn(&Vec3) -> Vec3);

/// The closest faces found so far.
struct Closest {
    square: f64,
    faces: Option<(usize, usize)>,
}

impl<'a> Pair<'a> {
    /// None unless both poses are finite.
    pub fn new(
        (a, pose_a): (&'a MeshTree, &Pose),
        (b, pose_b): (&'a MeshTree, &Pose),
    ) -> Option<Self> {
        // Difference of the translations first: nothing is lost far from the origin.
        let pose = Pose::new(
            pose_a.rotation.tr_mul(&pose_b.rotation),
            pose_a
                .rotation
                .tr_mul(&(pose_b.translation - pose_a.translation)),
        );
        let finite = pose.rotation.iter().chain(pose.translation.iter());
        if !finite.into_iter().all(|x| x.abs() <= 1e60) {
            return None;
        }
        // The translations were rounded in the world.
        let placed = pose_a.translation.amax().max(pose_b.translation.amax());
        Some(Self {
            spread: pose.rotation.abs(),
            touching: TOUCHING * (a.reach + b.reach) + 4.0 * f64::EPSILON * placed,
            a,
            b,
            pose,
        })
    }

    /// What is between them, if that is below `limit` (m).
    pub fn between(&self, limit: f64) -> Option<Between> {
        let cutoff = limit.max(2.0 * self.touching);
        let mut closest = Closest {
            square: cutoff * cutoff,
            faces: None,
        };
        let bound = self.bound(&self.a.nodes[0], &self.b.nodes[0]);
        if bound >= closest.square * (1.0 - TIE) {
            return None;
        }
        let proven = self.approach(limit, &mut closest)?;
        if !proven {
            self.search(0, 0, bound, &mut closest);
        }
        let distance = closest.square.sqrt();
        let crossing = closest.faces.is_some() && distance <= self.touching;
        let found = if crossing || (!proven && self.contained()) {
            let depth = self.depth(crossing);
            let faces = closest.faces.or_else(|| self.closest_faces());
            Some((if depth > self.touching { -depth } else { 0.0 }, faces?))
        } else {
            closest.faces.map(|faces| (distance, faces))
        };
        found
            .filter(|(distance, _)| *distance < limit)
            .map(|(distance, (f, g))| Between {
                distance,
                edge: self.a.edge_at_face(f).max(self.b.edge_at_face(g)),
            })
    }

    /// Goes to and fro between the surfaces, each time to the closest point, which finds the
    /// closest points of convex surfaces that are some way apart. Then asks whether the slab
    /// between the planes through both points is empty, which proves them closest: true if it
    /// is, none if the distance is proven not to be below `limit`.
    fn approach(&self, limit: f64, closest: &mut Closest) -> Option<bool> {
        let mut q = self.pose.apply(&self.b.ball.center);
        let mut last = (f64::INFINITY, Vec3::zeros(), 0, 0);
        for _ in 0..APPROACHES {
            let (p, f) = self.a.closest(&q);
            let (there, g) = self.b.closest(&self.pose.apply_inverse(&p));
            q = self.pose.apply(&there);
            let square = (q - p).norm_squared();
            let nearer = square < last.0 * (1.0 - TIE);
            if square < last.0 {
                last = (square, q - p, f, g);
            }
            if !nearer {
                break;
            }
        }
        let (square, way, f, g) = last;
        let distance = square.sqrt();
        if !(distance > 2.0 * self.touching && distance.is_finite()) {
            return Some(false);
        }
        if square < closest.square {
            *closest = Closest {
                square,
                faces: Some((f, g)),
            };
        }
        let way = way / distance;
        let (b_least, _) = self.b.lowest(&self.pose.rotation.tr_mul(&way));
        let (a_least, _) = self.a.lowest(&-way);
        let slab = self.pose.translation.dot(&way) + b_least + a_least;
        if slab > 0.0 && slab >= limit {
            return None;
        }
        Some(slab >= distance * (1.0 - TIE))
    }

    /// The closest faces, however far.
    fn closest_faces(&self) -> Option<(usize, usize)> {
        let mut closest = Closest {
            square: f64::INFINITY,
            faces: None,
        };
        self.search(0, 0, 0.0, &mut closest);
        closest.faces
    }

    /// Square of a lower bound of the distance between two boxes: along the axes of either, and
    /// along the line between their centres.
    #[inline]
    fn bound(&self, a: &Node, b: &Node) -> f64 {
        let apart = self.pose.apply(&b.center) - a.center;
        let (along_a, along_b) = (apart.abs(), self.pose.rotation.tr_mul(&apart).abs());
        let outside = |v: Vec3| v.map(|x| x.max(0.0)).norm_squared();
        let bound = outside(along_a - a.half - self.spread * b.half)
            .max(outside(along_b - b.half - self.spread.tr_mul(&a.half)));
        let whole = apart.norm_squared();
        let free = whole - along_a.dot(&a.half) - along_b.dot(&b.half);
        if free > 0.0 {
            bound.max(free * (free / whole))
        } else {
            bound
        }
    }

    /// A face of the second surface in the frame of the first.
    #[inline]
    fn placed(&self, face: usize) -> Triangle {
        let t = &self.b.triangles[face];
        Triangle {
            corners: t.corners.map(|x| self.pose.apply(&x)),
            normal: self.pose.rotation * t.normal,
        }
    }

    fn search(&self, m: usize, n: usize, bound: f64, closest: &mut Closest) {
        let done = self.touching * self.touching;
        if bound >= closest.square * (1.0 - TIE)
            || (closest.faces.is_some() && closest.square <= done)
        {
            return;
        }
        if let Some(children) = self.children(m, n) {
            let mut next =
                children.map(|(m, n)| (self.bound(&self.a.nodes[m], &self.b.nodes[n]), m, n));
            if next[1].0 < next[0].0 {
                next.swap(0, 1);
            }
            for (bound, m, n) in next {
                self.search(m, n, bound, closest);
            }
            return;
        }
        for g in self.b.nodes[n].faces.clone() {
            let there = self.placed(g);
            for f in self.a.nodes[m].faces.clone() {
                let here = &self.a.triangles[f];
                if let Some(square) = here.distance_squared(&there, closest.square) {
                    *closest = Closest {
                        square,
                        faces: Some((f, g)),
                    };
                }
            }
        }
    }

    /// The two pairs of boxes that a pair divides into, by its larger box.
    #[inline]
    fn children(&self, m: usize, n: usize) -> Option<[(usize, usize); 2]> {
        let (a, b) = (&self.a.nodes[m], &self.b.nodes[n]);
        match (a.second, b.second) {
            (None, None) => None,
            (Some(second), None) => Some([(m + 1, n), (second, n)]),
            (None, Some(second)) => Some([(m, n + 1), (m, second)]),
            (Some(first), Some(second)) => {
                if a.half.norm_squared() >= b.half.norm_squared() {
                    Some([(m + 1, n), (first, n)])
                } else {
                    Some([(m, n + 1), (m, second)])
                }
            }
        }
    }

    /// Whether a piece of one is inside the other; surfaces that don't cross.
    fn contained(&self) -> bool {
        let inside = |outer: &MeshTree, inner: &MeshTree, place: &dyn Fn(&Vec3) -> Vec3| {
            let mut pieces = inner.pieces.iter().map(|v| place(&inner.vertices[*v]));
            pieces.any(|x| outer.depth_above(&x, 0.0).is_some())
        };
        inside(self.a, self.b, &|x| self.pose.apply(x))
            || inside(self.b, self.a, &|x| self.pose.apply_inverse(x))
    }

    /// The deepest point found of either in the other: its distance to the other's surface.
    /// No shorter shift separates them.
    fn depth(&self, crossing: bool) -> f64 {
        let to_a = |x: &Vec3| self.pose.apply(x);
        let to_b = |x: &Vec3| self.pose.apply_inverse(x);
        let deepest =
            |depth: f64, outer: &MeshTree, p: &Vec3| outer.depth_above(p, depth).unwrap_or(depth);
        let mut depth = 0.0;
        let sides: [Side; 2] = [(self.a, self.b, &to_a), (self.b, self.a, &to_b)];
        for (outer, inner, place) in sides {
            let faces = inner.triangles.len();
            let stride = |count: usize| count / SAMPLES + 1;
            for t in inner.triangles.iter().step_by(stride(faces)) {
                for x in &t.corners {
                    depth = deepest(depth, outer, &place(x));
                }
            }
            for f in (0..faces).step_by(stride(faces)) {
                depth = deepest(depth, outer, &place(&inner.centroid(f)));
            }
        }
        if crossing {
            for (of_a, p) in self.crossing_points() {
                depth = if of_a {
                    deepest(depth, self.b, &to_b(&p))
                } else {
                    deepest(depth, self.a, &to_a(&p))
                };
            }
        }
        // Surfaces that nearly coincide have no points deep in one another: points well inside
        // each of them do.
        for (outer, inner, place) in sides {
            let faces = inner.triangles.len();
            let middles = (0..faces).step_by(faces / MIDDLES + 1);
            let center = Some(inner.ball.center).filter(|c| inner.depth_above(c, 0.0).is_some());
            for p in middles.filter_map(|f| inner.middle(f)).chain(center) {
                depth = deepest(depth, outer, &place(&p));
            }
        }
        depth
    }

    /// On every edge that passes through faces of the other surface, the points midway between
    /// its passages and its ends: whether it is an edge of the first surface, and the point in
    /// its frame.
    fn crossing_points(&self) -> Vec<(bool, Vec3)> {
        let mut passages: Vec<(bool, usize, usize, f64)> = Vec::new();
        let mut tested = 0;
        let mut stack = vec![(0, 0)];
        let reach = self.touching * self.touching;
        while let Some((m, n)) = stack.pop() {
            if self.bound(&self.a.nodes[m], &self.b.nodes[n]) > reach {
                continue;
            }
            if let Some([first, second]) = self.children(m, n) {
                stack.extend([second, first]);
                continue;
            }
            tested += 1;
            if tested > CROSSINGS {
                break;
            }
            for g in self.b.nodes[n].faces.clone() {
                let there = self.placed(g);
                for f in self.a.nodes[m].faces.clone() {
                    let here = &self.a.triangles[f];
                    let sides = [
                        (true, here, self.a.corners[f], &there),
                        (false, &there, self.b.corners[g], here),
                    ];
                    for (of_a, by, numbers, through) in sides {
                        for k in 0..3 {
                            let l = (k + 1) % 3;
                            if numbers[k] < numbers[l] {
                                let s = through.pierced(&by.corners[k], &by.corners[l]);
                                passages.extend(s.map(|s| (of_a, numbers[k], numbers[l], s)));
                            }
                        }
                    }
                }
            }
        }
        let edge = |p: &(bool, usize, usize, f64)| (p.0, p.1, p.2);
        passages.sort_by(|p, q| edge(p).cmp(&edge(q)).then(p.3.total_cmp(&q.3)));
        let mut points = Vec::new();
        for group in passages.chunk_by(|p, q| edge(p) == edge(q)) {
            let (of_a, v, w) = edge(&group[0]);
            let surface = if of_a { self.a } else { self.b };
            let (x, y) = (surface.vertices[v], surface.vertices[w]);
            let mut last = 0.0;
            for s in group.iter().map(|p| p.3).chain([1.0]) {
                points.push((of_a, x + (y - x) * (0.5 * (last + s))));
                last = s;
            }
        }
        points
    }
}
