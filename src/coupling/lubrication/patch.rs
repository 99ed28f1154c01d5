//! Where the pressure in a bearing is solved: the faces of a surface that are near, cut smaller where the thickness changes within them.

use super::Bearing;
use super::thickness::thickness;
use crate::adjoint::lie::{Pose, Vec3};
use crate::geometry::Field;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// Largest ratio of the thicknesses within a face where they are least, and the power of the thickness with which more is allowed: the pressure is less there.
const RATIO: f64 = 3.0;
const EASED: f64 = 0.25;
/// Slope of the thickness from which on it isn't thin: faces across the edge of what is opposite.
const STEEP: f64 = 0.5;
/// Smallest edge of those, of the body's size.
const ACROSS: f64 = 0.02;
/// Longest edge where the thickness is least, of the width of the area over which it is no more than [`NARROW`] times that: four times the area over its
/// border.
const EVEN: f64 = 0.1;
const NARROW: f64 = 2.0;
/// Most rounds of cuts, of which two halve an edge.
const ROUNDS: usize = 48;
/// Most faces.
const FACES: usize = 8_000;
/// How many times longer than it should be an edge is from which on that is told: it is as long as the film is wide. Below the damping is hardly off.
const COARSE: f64 = 1.0 / EVEN;
/// Cosine between a face's normal and the way across above which it is cut.
const FACING: f64 = 0.1;

/// A vertex.
pub(super) struct Spot {
    /// In the body's frame.
    pub own: Vec3,
    /// Unit normal, body's frame.
    pub normal: Vec3,
    /// From the body's origin, axes of what is opposite.
    pub point: Vec3,
    /// Of what is opposite there.
    pub field: Field,
}

/// Faces of a surface that are near what is opposite, some of them cut.
pub(super) struct Patch {
    pub spots: Vec<Spot>,
    /// Corners of each face, and the spots halfway along the edges that begin there.
    pub faces: Vec<([usize; 3], [usize; 3])>,
    /// Where cutting ended long before it was done: an edge over how long it should be, where that is most.
    pub coarse: Option<f64>,
}

/// A patch in the making.
struct Cutter<'a> {
    bearing: &'a Bearing,
    relative: &'a Pose,
    roughness: f64,
    spots: Vec<Spot>,
    /// The least thickness, m.
    least: f64,
    /// Longest edge where it is about that, m.
    even: f64,
    /// By the spots at the ends of the edge that each halves.
    halves: BTreeMap<[usize; 2], usize>,
}

impl Patch {
    /// At a pose of the surface in the frame of what is opposite; `None` where that is farther away than the bearing reaches.
    pub fn new(bearing: &Bearing, relative: &Pose, roughness: f64) -> Option<Self> {
        let surface = &*bearing.surface;
        // Faces may bulge towards what is opposite.
        let reach = bearing.reach + 0.5 * surface.longest;
        let field = |x: &Vec3| bearing.opposite.field(&relative.apply(x));
        let mut near = vec![false; surface.vertices.len()];
        for cluster in &surface.clusters {
            // NaN, a pose out of range, is near nothing.
            if field(&cluster.center).distance - cluster.radius < reach {
                for v in &cluster.vertices {
                    near[*v] = field(&surface.vertices[*v]).distance < reach;
                }
            }
        }
        let mut cutter = Cutter {
            bearing,
            relative,
            roughness,
            spots: Vec::new(),
            least: f64::INFINITY,
            even: f64::INFINITY,
            halves: BTreeMap::new(),
        };
        let mut numbers = vec![None; surface.vertices.len()];
        let mut faces = Vec::new();
        for corners in &surface.faces {
            if corners.iter().any(|v| near[*v]) {
                faces.push(corners.map(|v| {
                    *numbers[v].get_or_insert_with(|| {
                        cutter.place(surface.vertices[v], surface.normals[v])
                    })
                }));
            }
        }
        if faces.is_empty() {
            return None;
        }
        let mut wanted = cutter.wanted(&faces);
        for _ in 0..ROUNDS {
            let room = FACES.saturating_sub(faces.len());
            let marked = cutter.marked(&faces, &wanted, room);
            if marked.is_empty() {
                break;
            }
            faces = cutter.cut(&faces, &marked);
            wanted = cutter.wanted(&faces);
        }
        let coarse = wanted.iter().map(|x| x.0).reduce(f64::max);
        let coarse = coarse.filter(|ratio| *ratio > COARSE);
        let faces = (faces.iter())
            .map(|face| (*face, [0, 1, 2].map(|k| cutter.half(edge(face, k)))))
            .collect();
        let spots = cutter.spots;
        let within = spots.iter().any(|s| s.field.distance < bearing.reach);
        within.then_some(Self {
            spots,
            faces,
            coarse,
        })
    }
}

impl Cutter<'_> {
    fn place(&mut self, own: Vec3, normal: Vec3) -> usize {
        let point = self.relative.rotation * own;
        let at = point + self.relative.translation;
        let field = self.bearing.opposite.field(&at);
        self.spots.push(Spot {
            own,
            normal,
            point,
            field,
        });
        self.spots.len() - 1
    }

    fn height(&self, spot: usize) -> f64 {
        thickness(self.spots[spot].field.distance, self.roughness).value
    }

    /// Whether a face looks at what is opposite, and its area.
    fn facing(&self, face: &[usize; 3]) -> (bool, f64) {
        let [a, b, c] = face.map(|s| &self.spots[s]);
        let across = (b.point - a.point).cross(&(c.point - a.point));
        let way = a.field.gradient + b.field.gradient + c.field.gradient;
        let (size, long) = (across.norm(), way.norm());
        (-across.dot(&way) > FACING * size * long, 0.5 * size)
    }

    /// How thin it is, and over which width.
    fn survey(&mut self, faces: &[[usize; 3]]) {
        let looking: Vec<(&[usize; 3], f64, f64)> = (faces.iter())
            .filter_map(|face| {
                let (facing, area) = self.facing(face);
                let least = face.map(|s| self.height(s)).into_iter();
                facing.then(|| (face, least.fold(f64::INFINITY, f64::min), area))
            })
            .collect();
        self.least = looking.iter().map(|x| x.1).fold(f64::INFINITY, f64::min);
        let (mut area, mut border) = (0.0, BTreeMap::new());
        for (face, _, own) in looking.iter().filter(|x| x.1 < NARROW * self.least) {
            area += own;
            for k in 0..3 {
                *border.entry(edge(face, k)).or_insert(0) += 1;
            }
        }
        let border = border.iter().filter(|(_, count)| **count == 1);
        let border: f64 = border.map(|(edge, _)| self.length(*edge)).sum();
        self.even = EVEN * 4.0 * area / border;
    }

    /// The longest edge of a face, of equal ones that with the highest numbers: the same from both sides.
    fn longest(&self, face: &[usize; 3]) -> (usize, f64) {
        let key = |k: usize| {
            let edge = edge(face, k);
            (self.length(edge), edge)
        };
        let longer = |a: usize, b: usize| {
            let (x, y) = (key(a), key(b));
            if x.0 > y.0 || (x.0 == y.0 && x.1 > y.1) {
                a
            } else {
                b
            }
        };
        let k = longer(longer(0, 1), 2);
        (k, key(k).0)
    }

    fn length(&self, [a, b]: [usize; 2]) -> f64 {
        (self.spots[a].own - self.spots[b].own).norm()
    }

    fn half(&mut self, edge: [usize; 2]) -> usize {
        if let Some(at) = self.halves.get(&edge) {
            return *at;
        }
        let [a, b] = edge.map(|s| &self.spots[s]);
        let surface = &self.bearing.surface;
        let (at, normal) = surface.halfway([&a.own, &b.own], [&a.normal, &b.normal]);
        let spot = self.place(at, normal);
        self.halves.insert(edge, spot);
        spot
    }

    /// Where a face is too large for what the thickness does in it: its longest edge, over how long that should be.
    fn excess(&mut self, face: &[usize; 3]) -> Option<f64> {
        let distances = face.map(|s| self.spots[s].field.distance);
        let low = distances.into_iter().fold(f64::INFINITY, f64::min);
        let (k, length) = self.longest(face);
        if low - 0.5 * length > self.bearing.reach || !self.facing(face).0 {
            return None;
        }
        let heights = face.map(|s| self.height(s));
        // Between corners that are as near as one another a round face may be nearer.
        let middle = self.half(edge(face, k));
        let all = heights.into_iter().chain([self.height(middle)]);
        let [low, high] = all.fold([f64::INFINITY, 0.0], |[low, high], h| {
            [low.min(h), f64::max(high, h)]
        });
        let allowed = RATIO * (low / self.least).max(1.0).powf(EASED);
        let steep = high - low > STEEP * length;
        let shortest = match steep {
            true => ACROSS * self.bearing.surface.size,
            false => low,
        };
        let wide = low < NARROW * self.least && length > self.even;
        let uneven = high > allowed * low && length > shortest;
        let wide = wide.then(|| length / self.even);
        // As if the thickness changed evenly along the edge.
        let uneven =
            uneven.then(|| ((high - low) / ((allowed - 1.0) * low)).min(length / shortest));
        wide.into_iter().chain(uneven).reduce(f64::max)
    }

    /// The faces that are too large, by how much: numbers of faces, ascending.
    fn wanted(&mut self, faces: &[[usize; 3]]) -> Vec<(f64, usize)> {
        self.survey(faces);
        let each = faces.iter().enumerate();
        each.filter_map(|(i, face)| Some((self.excess(face)?, i)))
            .collect()
    }

    /// Edges to halve: of these faces, or of those that are too large by most where all would be more than there is room for.
    fn marked(
        &mut self,
        faces: &[[usize; 3]],
        wanted: &[(f64, usize)],
        room: usize,
    ) -> BTreeMap<[usize; 2], usize> {
        let all = self.closed(faces, wanted);
        if all.len() <= room {
            return all;
        }
        let mut worst = wanted.to_vec();
        worst.sort_by(|a, b| b.0.total_cmp(&a.0));
        // Those of more faces are never fewer.
        let (mut few, mut many) = (0, worst.len());
        while many - few > 1 + worst.len() / 64 {
            let half = usize::midpoint(few, many);
            match self.closed(faces, &worst[..half]).len() <= room {
                true => few = half,
                false => many = half,
            }
        }
        self.closed(faces, &worst[..few])
    }

    /// The longest edges of some of the faces, and of those that have one of them.
    fn closed(
        &mut self,
        faces: &[[usize; 3]],
        some: &[(f64, usize)],
    ) -> BTreeMap<[usize; 2], usize> {
        let mut marked = BTreeMap::new();
        for (_, i) in some {
            let edge = edge(&faces[*i], self.longest(&faces[*i]).0);
            marked.insert(edge, self.half(edge));
        }
        loop {
            let mut more = false;
            for face in faces {
                if (0..3).any(|k| marked.contains_key(&edge(face, k))) {
                    let edge = edge(face, self.longest(face).0);
                    if let Entry::Vacant(place) = marked.entry(edge) {
                        place.insert(self.half(edge));
                        more = true;
                    }
                }
            }
            if !more {
                return marked;
            }
        }
    }

    /// The faces, each cut at its longest edge and then at the others that are marked.
    fn cut(&self, faces: &[[usize; 3]], marked: &BTreeMap<[usize; 2], usize>) -> Vec<[usize; 3]> {
        let mut out = Vec::with_capacity(faces.len() + 2 * marked.len());
        let mut open: Vec<[usize; 3]> = Vec::new();
        for face in faces {
            open.push(*face);
            let mut first = Some(self.longest(face).0);
            while let Some(face) = open.pop() {
                let found = (first.take().into_iter().chain(0..3))
                    .find_map(|k| Some((k, *marked.get(&edge(&face, k))?)));
                match found {
                    None => out.push(face),
                    Some((k, half)) => {
                        let [a, b, c] = [0, 1, 2].map(|i| face[(k + i) % 3]);
                        open.push([a, half, c]);
                        open.push([half, b, c]);
                    }
                }
            }
        }
        out
    }
}

/// Edge `k` of a face, from its corner `k` on, by the smaller number first.
fn edge(face: &[usize; 3], k: usize) -> [usize; 2] {
    let [a, b] = [face[k], face[(k + 1) % 3]];
    [a.min(b), a.max(b)]
}
