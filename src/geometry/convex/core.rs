//! Corners, edges and faces, with a radius about them: balls, capsules and convex polyhedra.

use super::field::{AtCorner, Field, leaves};
use crate::error::{Error, Result};
use hydrograd_adjoint::lie::{Pose, Vec3};
use std::collections::BTreeMap;

/// Height over a face, and the face.
type Over<'f> = (f64, &'f Face);

/// The higher of two, of equal ones the first.
fn higher<'f>(best: Over<'f>, next: Over<'f>) -> Over<'f> {
    if best.0 >= next.0 { best } else { next }
}

/// Share of a core's size below which a distance is rounding.
const ROUNDING: f64 = 1e-13;

/// A convex hull with a radius about it, frame of the shape, m.
#[derive(Clone, Debug)]
pub(crate) struct Core {
    pub corners: Vec<Vec3>,
    /// Unit vectors along the edges that leave each corner.
    pub spokes: Vec<Vec<Vec3>>,
    pub edges: Vec<Edge>,
    pub faces: Vec<Face>,
    pub radius: f64,
    /// Least width between a face and the corner farthest behind it; infinite without faces.
    pub thickness: f64,
    /// Smallest and largest coordinates of the corners.
    pub bounds: [Vec3; 2],
}

/// A straight edge.
#[derive(Clone, Debug)]
pub(crate) struct Edge {
    pub from: Vec3,
    /// Unit vector.
    pub along: Vec3,
    pub length: f64,
    /// Unit vectors across the edge into its two faces; none for the edge of a capsule.
    pub inward: Option<[Vec3; 2]>,
}

/// A plane convex face.
#[derive(Clone, Debug)]
pub(crate) struct Face {
    /// Outward unit normal.
    pub normal: Vec3,
    /// The plane is `normal · x = offset`.
    pub offset: f64,
    /// A point of each side and the unit vector across it into the face.
    sides: Vec<(Vec3, Vec3)>,
}

impl Face {
    /// Whether the foot of the perpendicular from `p` lies in the face, or outside it by at most
    /// `slack`.
    pub fn is_below(&self, p: &Vec3, slack: f64) -> bool {
        self.sides
            .iter()
            .all(|(from, inward)| (p - from).dot(inward) >= -slack)
    }
}

impl Edge {
    /// The edge in the frame that `at` leads to.
    pub fn placed(&self, at: &Pose) -> Self {
        Self {
            from: at.apply(&self.from),
            along: at.rotation * self.along,
            length: self.length,
            inward: self.inward.map(|v| v.map(|d| at.rotation * d)),
        }
    }

    pub fn middle(&self) -> Vec3 {
        self.from + 0.5 * self.length * self.along
    }
}

impl Core {
    /// A ball about the origin.
    pub fn ball(radius: f64) -> Self {
        Self::bare(vec![Vec3::zeros()], vec![Vec::new()], Vec::new(), radius)
    }

    /// A capsule along z with `length` between the centres of its ends.
    pub fn capsule(radius: f64, length: f64) -> Self {
        let end = Vec3::new(0.0, 0.0, 0.5 * length);
        let edge = Edge {
            from: -end,
            along: Vec3::z(),
            length,
            inward: None,
        };
        let spokes = vec![vec![Vec3::z()], vec![-Vec3::z()]];
        Self::bare(vec![-end, end], spokes, vec![edge], radius)
    }

    /// Without faces.
    fn bare(corners: Vec<Vec3>, spokes: Vec<Vec<Vec3>>, edges: Vec<Edge>, radius: f64) -> Self {
        Self {
            bounds: [
                corners.iter().fold(corners[0], |low, c| low.inf(c)),
                corners.iter().fold(corners[0], |high, c| high.sup(c)),
            ],
            corners,
            spokes,
            edges,
            faces: Vec::new(),
            radius,
            thickness: f64::INFINITY,
        }
    }

    /// A convex polyhedron from its corners and faces, the latter as numbers of corners,
    /// counter-clockwise seen from outside.
    ///
    /// # Errors
    /// [`Error::Mesh`] called `name` if an edge doesn't have two faces.
    pub fn polyhedron(name: &str, corners: Vec<Vec3>, loops: &[Vec<usize>]) -> Result<Self> {
        let mut faces = Vec::with_capacity(loops.len());
        let mut sides: BTreeMap<[usize; 2], Vec3> = BTreeMap::new();
        for border in loops {
            let pairs = || (0..border.len()).map(|k| [border[k], border[(k + 1) % border.len()]]);
            let first = corners[border[0]];
            let area: Vec3 = pairs()
                .map(|[i, j]| (corners[i] - first).cross(&(corners[j] - first)))
                .sum();
            let normal = area.normalize();
            let heights = border.iter().map(|&i| normal.dot(&corners[i]));
            let mut face = Face {
                normal,
                offset: heights.fold(f64::NEG_INFINITY, f64::max),
                sides: Vec::with_capacity(border.len()),
            };
            for [i, j] in pairs() {
                let inward = normal.cross(&(corners[j] - corners[i])).normalize();
                face.sides.push((corners[i], inward));
                sides.insert([i, j], inward);
            }
            faces.push(face);
        }
        let mut edges = Vec::new();
        let mut spokes = vec![Vec::new(); corners.len()];
        for (&[i, j], &inward) in &sides {
            let Some(&other) = sides.get(&[j, i]) else {
                return Err(Error::Mesh {
                    name: name.into(),
                    problem: "an edge between flat parts has one face only".into(),
                    location: format!("from {:?} m", corners[i].as_slice()),
                    remedy: "for contact use the convex hull, with flat parts flat to rounding"
                        .into(),
                });
            };
            let span = corners[j] - corners[i];
            let (length, along) = (span.norm(), span.normalize());
            spokes[i].push(along);
            if i < j {
                edges.push(Edge {
                    from: corners[i],
                    along,
                    length,
                    inward: Some([inward, other]),
                });
            }
        }
        let width = |f: &Face| {
            let lowest = corners.iter().map(|c| f.normal.dot(c));
            f.offset - lowest.fold(f64::INFINITY, f64::min)
        };
        let thickness = faces.iter().map(width).fold(f64::INFINITY, f64::min);
        Ok(Self {
            faces,
            thickness,
            ..Self::bare(corners, spokes, edges, 0.0)
        })
    }

    /// Whether it is a corner alone.
    pub fn is_ball(&self) -> bool {
        self.edges.is_empty()
    }

    /// Largest distance of a corner from another, at most.
    pub fn diameter(&self) -> f64 {
        (self.bounds[1] - self.bounds[0]).norm()
    }

    /// Signed distance of a point from the core, without the radius; none beyond `limit`. Inside,
    /// it is that to the nearest face.
    pub fn field(&self, p: &Vec3, limit: f64) -> Option<Field> {
        Some(self.field_of_corner(p, &[], limit)?.field)
    }

    /// The same of the corner of another body, which it leaves `into` these directions (unit vectors): inside, it is that to the nearest face through which the other
    /// body may leave.
    pub fn field_of_corner(&self, p: &Vec3, into: &[Vec3], limit: f64) -> Option<AtCorner> {
        let beside = (self.bounds[0] - p).sup(&(p - self.bounds[1]));
        if beside.max() > limit {
            return None;
        }
        let least = ROUNDING * self.diameter().max(p.amax());
        let heights = self.faces.iter().map(|f| (f.normal.dot(p) - f.offset, f));
        if let Some((height, face)) = heights.clone().reduce(higher) {
            if height > limit {
                return None;
            }
            if height <= least {
                let leaving = heights.filter(|(_, f)| leaves(&f.normal, into));
                let (height, face) = leaving.reduce(higher).unwrap_or((height, face));
                return Some(AtCorner::flat(height, face.normal));
            }
        }
        // A foot within a face is the nearest point of all.
        if let Some((height, face)) = heights
            .filter(|(h, f)| *h > 0.0 && f.is_below(p, 0.0))
            .max_by(|a, b| a.0.total_cmp(&b.0))
        {
            return Some(AtCorner::flat(height, face.normal));
        }
        let field = self.round(p, least);
        let at_edge = AtCorner { field, over: false };
        (field.distance <= limit).then_some(at_edge)
    }

    /// Distance to the nearest edge or corner.
    fn round(&self, p: &Vec3, least: f64) -> Field {
        if self.is_ball() {
            return Field::round(p - self.corners[0], None, least);
        }
        let mut best = (f64::INFINITY, Vec3::zeros(), None);
        for edge in &self.edges {
            let offset = p - edge.from;
            let s = offset.dot(&edge.along);
            let (nearest, axis) = if s <= 0.0 {
                (offset, None)
            } else if s >= edge.length {
                (offset - edge.length * edge.along, None)
            } else {
                (offset - s * edge.along, Some(&edge.along))
            };
            let square = nearest.norm_squared();
            if square < best.0 {
                best = (square, nearest, axis);
            }
        }
        // On the axis of a capsule even the end has a direction across.
        let axis = best
            .2
            .or(self.faces.is_empty().then_some(&self.edges[0].along));
        if best.0.sqrt() <= least {
            return Field::round(best.1, axis, least);
        }
        Field::round(best.1, best.2, least)
    }

    /// The outermost corner in a direction of any length.
    pub fn outermost(&self, direction: &Vec3) -> Vec3 {
        let height = |c: &&Vec3| direction.dot(c);
        let corners = self.corners.iter();
        let outermost = corners.reduce(|a, b| if height(&a) >= height(&b) { a } else { b });
        outermost.copied().unwrap_or_default()
    }
}
