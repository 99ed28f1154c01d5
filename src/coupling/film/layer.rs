//! A film's thickness at given poses, and where it ends.

use super::jet::{Displaced, Jet, Vector, add, distance, dot, real, scale};
use super::surface::Element;
use super::{FilmSurface, Width};
use crate::adjoint::lie::Pose;
use crate::geometry::{Field, Opposite};

/// Power of the distances with which vertices count in a link's gap.
const NEAREST: i32 = 6;
/// Distances between which the flow in a film goes over into that around the bodies, in sizes of the first.
const RIM: [f64; 2] = [0.5, 1.0];
/// The same in cosines between the surface's normal and the way across: the sides of a block still lead the flow, its back doesn't.
const BACK: [f64; 2] = [-0.1, -0.6];
/// How well the rim leads the flow away.
const OPENING: f64 = 20.0;
/// The length β/sin β of an arc across a wedge of the angle β, in its height, by powers of sin² β: the series up to the third, and what is left at a right
/// angle in the last.
const ARC: [f64; 4] = [1.0, 1.0 / 6.0, 3.0 / 40.0, 5.0 / 112.0];
const STEEP: i32 = 8;
/// Of the series of √(1 − s), from s on: where the two stand at a right angle it is smooth, and a third too large.
const COSINE: [f64; 3] = [-0.5, -1.0 / 8.0, -1.0 / 16.0];
/// Largest square of a sine that elements may give to rounding and their own size.
const STEEPEST: f64 = 1.2;

/// A film between a surface and what is opposite.
pub(super) struct Layer<D> {
    /// How far the two are held apart for those that don't resolve the gap, and in which direction: from the first to the other, in the frame of each.
    pub shift: [Vector<D>; 2],
    /// Of each vertex of the surface, its number among those at which there is a potential.
    pub numbers: Vec<Option<usize>>,
    /// Those vertices.
    pub active: Vec<usize>,
    /// How well each leads into the open, m.
    pub rim: Vec<D>,
    /// Faces with one of them at least.
    pub cells: Vec<Cell<D>>,
}

/// A face's part of a film.
pub(super) struct Cell<D> {
    pub face: usize,
    /// Number of each corner among the active ones.
    pub corners: [Option<usize>; 3],
    /// m: as it is, and held apart.
    pub thickness: [D; 2],
    /// Unit normal of the other side as it is, also for what is held apart: the difference of both then has no negative energy.
    pub facing: Vector<D>,
}

impl<D: Jet> Layer<D> {
    /// With the pose of the surface in the frame of what is opposite, and the numbers of the vertices where another layer at that pose has decided; none where that is farther than `width` reaches. `Err` gives a distance that isn't
    /// positive.
    pub fn new(
        surface: &FilmSurface,
        opposite: &Opposite,
        pose: &Pose,
        width: &Width,
        known: Option<&[Option<usize>]>,
    ) -> Result<Option<Self>, f64> {
        let middle = opposite.field(&pose.apply(&surface.center));
        if middle.distance - surface.radius > width.reach {
            return Ok(None);
        }
        let reals = surface.vertices.iter().map(|x| pose.apply(x));
        let fields: Vec<Field> = reals.map(|p| opposite.field(&p)).collect();
        let lowest = fields
            .iter()
            .map(|f| f.distance)
            .fold(f64::INFINITY, f64::min);
        if lowest <= 0.0 {
            return Err(lowest);
        }
        // The link's gap is a mean.
        if lowest >= width.reach {
            return Ok(None);
        }
        let placed = Displaced::<D>::new(pose);
        let end = RIM[1] * surface.size;
        let near: Vec<bool> = fields.iter().map(|f| f.distance < end).collect();
        let mut needed = near.clone();
        for face in &surface.faces {
            if face.corners.iter().any(|v| near[*v]) {
                face.corners.iter().for_each(|v| needed[*v] = true);
            }
        }
        let points: Vec<Option<Vector<D>>> = (surface.vertices.iter().zip(&needed))
            .map(|(x, needed)| needed.then(|| placed.apply(x)))
            .collect();
        let distances: Vec<Option<D>> = (points.iter().zip(&fields))
            .map(|(p, field)| p.as_ref().map(|p| distance(field, p)))
            .collect();
        let (gap, mean) = nearest(surface, &distances, end, width.reach);
        if known.is_none() && gap.re() >= width.reach {
            return Ok(None);
        }
        let normal = match opposite.wall_normal() {
            Some(wall) => placed.rotate_inverse(&-wall),
            None => mean,
        };
        let wider = (-gap / width.reach + 1.0).powi(3) * width.floor;
        let own = scale(wider, &normal);
        let other = placed.rotate(&own);
        let back = other.map(|x| -x);
        let apart: Vec<Option<D>> = (points.iter())
            .map(|p| {
                let p = add(p.as_ref()?, &back);
                Some(distance(&opposite.field(&real(&p)), &p))
            })
            .collect();
        let mut out = Self {
            shift: [own, other],
            numbers: Vec::new(),
            active: Vec::new(),
            rim: Vec::new(),
            cells: Vec::new(),
        };
        out.bound(surface, &distances, &normal, known);
        let numbers = &out.numbers;
        for (f, face) in surface.faces.iter().enumerate() {
            let corners = face.corners.map(|v| numbers[v]);
            if corners.iter().all(Option::is_none) {
                continue;
            }
            let of = |all: &[Option<D>]| face.corners.map(|v| all[v].unwrap_or(D::from(end)));
            let [near, held] = [of(&distances), of(&apart)];
            out.cells.push(Cell {
                face: f,
                corners,
                thickness: [near, held].map(|d| thickness(&d, &face.slopes)),
                facing: facing(&near, face),
            });
        }
        Ok(Some(out))
    }

    /// Where the film ends: which vertices have a potential, unless that is known, and how well each leads into the open.
    fn bound(
        &mut self,
        surface: &FilmSurface,
        distances: &[Option<D>],
        normal: &Vector<D>,
        known: Option<&[Option<usize>]>,
    ) {
        let [start, end] = RIM.map(|part| part * surface.size);
        let mut numbers = vec![None; distances.len()];
        for (v, d) in distances.iter().enumerate() {
            let Some(d) = *d else { continue };
            let outside = (d - start) / (end - start);
            let facing = dot(normal, &surface.normals[v]);
            let behind = (facing - BACK[0]) / (BACK[1] - BACK[0]);
            let within = outside.re() < 1.0 && behind.re() < 1.0;
            if known.map_or(within, |known| known[v].is_some()) {
                numbers[v] = Some(self.active.len());
                self.active.push(v);
                let open = opening(outside) + opening(behind);
                self.rim.push(open * (OPENING * surface.areas[v]) / d);
            }
        }
        self.numbers = numbers;
    }
}

/// The gap of a link and this side's normal there: means over the vertices, of which the nearest count most, and those beyond `end` nothing.
fn nearest<D: Jet>(
    surface: &FilmSurface,
    distances: &[Option<D>],
    end: f64,
    scale: f64,
) -> (D, Vector<D>) {
    let (mut sum, mut gap, mut normal) = (D::from(0.0), D::from(0.0), [D::from(0.0); 3]);
    for (v, d) in distances.iter().enumerate() {
        let Some(d) = d.filter(|d| d.re() < end) else {
            continue;
        };
        let fade = (-d / end + 1.0).powi(3);
        let weight = (d / scale).powi(-NEAREST) * fade * surface.areas[v];
        sum += weight;
        gap += weight * d;
        let n = &surface.normals[v];
        (0..3).for_each(|i| normal[i] += weight * n[i]);
    }
    if sum.re() <= 0.0 {
        return (D::from(f64::INFINITY), normal);
    }
    (gap / sum, normal.map(|x| x / sum))
}

/// t³/(1 − t)³ from 0 on.
fn opening<D: Jet>(t: D) -> D {
    if t.re() <= 0.0 {
        return D::from(0.0);
    }
    (t / (-t + 1.0)).powi(3)
}

/// The length of the arc that meets both surfaces at right angles, of a face with these distances at its corners: 1/(mean of 1/length), which is what the flow
/// across lines of equal thickness feels.
fn thickness<D: Jet>(d: &[D; 3], slopes: &nalgebra::Matrix3<f64>) -> D {
    let mut steep = D::from(0.0);
    for i in 0..3 {
        steep += d[i] * d[i] * slopes[(i, i)];
        steep += d[i] * d[(i + 1) % 3] * (2.0 * slopes[(i, (i + 1) % 3)]);
    }
    if steep.re() > STEEPEST {
        steep = D::from(STEEPEST);
    }
    let last = std::f64::consts::FRAC_PI_2 - ARC.iter().sum::<f64>();
    let [a, b, c, e] = ARC;
    let arc = steep * (steep * (steep * e + c) + b) + a + steep.powi(STEEP) * last;
    let inverse: D = (0..3).map(|i| (d[i] + d[(i + 1) % 3]).recip()).sum();
    arc * 1.5 / inverse
}

/// The other side's normal: its part along the face is what the distances do there. The arcs that meet both at right angles cut equal areas off both.
fn facing<D: Jet>(d: &[D; 3], face: &Element) -> Vector<D> {
    let along: Vector<D> = std::array::from_fn(|i| {
        let g = &face.gradients;
        d[0] * g[(i, 0)] + d[1] * g[(i, 1)] + d[2] * g[(i, 2)]
    });
    let square = along[0] * along[0] + along[1] * along[1] + along[2] * along[2];
    let [a, b, c] = COSINE;
    let cosine = square * (square * (square * c + b) + a) + 1.0;
    std::array::from_fn(|i| along[i] - cosine * face.normal[i])
}
