//! A film's thickness at given poses, and where it ends. Its derivative is [`Layer::reverse`].

use super::Film;
use super::jet::{
    Displaced, Distance, Jet, Vector, add, constant, dot, minus, product, real, scale, zero,
};
use super::surface::Element;
use crate::coupling::fade::opening;
use crate::geometry::Field;

/// Power of the distances with which vertices count in a link's gap.
pub(super) const NEAREST: i32 = 6;
/// Cosines between the surface's normal and the way across, between which a film ends: the sides of a block still lead the flow, its back doesn't.
pub(super) const BACK: [f64; 2] = [-0.1, -0.6];
/// How well the rim leads the flow away.
pub(super) const OPENING: f64 = 20.0;
/// The length β/sin β of an arc across a wedge of the angle β, in its height, by powers of sin² β: the series up to the third, and what is left at a right
/// angle in the last.
const ARC: [f64; 4] = [1.0, 1.0 / 6.0, 3.0 / 40.0, 5.0 / 112.0];
const STEEP: f64 = 8.0;
/// Of the series of √(1 − s), from s on: where the two stand at a right angle it is smooth, and a third too large.
const COSINE: [f64; 3] = [-0.5, -1.0 / 8.0, -1.0 / 16.0];
/// Square of the sine between the two sides from which on a face lies beside what is opposite rather than over it; at 1 it does altogether.
const BESIDE: f64 = 0.5;
/// Square of a sine to which what elements give beyond 1, by their own size, goes over.
const STEEPEST: f64 = 1.2;

/// A film between a surface and what is opposite.
pub(super) struct Layer<D> {
    /// How far the two are held apart for those that don't resolve the gap, and in which direction: from the first to the other, in the frame of each.
    pub shift: [Vector<D>; 2],
    /// Of the link.
    pub gap: Gap<D>,
    /// Vertices of faces that are near.
    pub spots: Vec<Spot<D>>,
    /// The fields where these are held apart; none in a layer along a displacement.
    held: Vec<Field>,
    /// Those at which there is a potential.
    pub active: Vec<usize>,
    /// How well each leads into the open, m.
    pub rim: Vec<D>,
    /// Faces with one of them at least.
    pub cells: Vec<Cell<D>>,
}

/// Means over the vertices, of which the nearest count most.
pub(super) struct Gap<D> {
    /// m.
    pub value: D,
    /// This side's normal.
    pub mean: Vector<D>,
    /// The same, or opposite to that of the wall that is there.
    pub normal: Vector<D>,
    /// Sum of the weights.
    pub sum: D,
}

/// A vertex.
pub(super) struct Spot<D> {
    pub vertex: usize,
    /// In the frame of what is opposite.
    pub point: Vector<D>,
    /// As it is, and held apart.
    pub distances: [Distance<D>; 2],
    /// Among those at which there is a potential.
    pub number: Option<usize>,
}

/// A face's part of a film.
pub(super) struct Cell<D> {
    pub face: usize,
    /// The spots at its corners.
    pub spots: [usize; 3],
    /// Number of each corner among those with a potential.
    pub corners: [Option<usize>; 3],
    /// m: as it is, and held apart.
    pub thickness: [Thickness<D>; 2],
    /// Of the other side as it is, also for what is held apart: the difference of both then has no negative energy.
    pub facing: Facing<D>,
}

/// A thickness, and its derivative by the distances at the corners.
#[derive(Clone, Copy)]
pub(super) struct Thickness<D> {
    /// m.
    pub value: D,
    pub slopes: [D; 3],
}

/// Where the other side faces.
pub(super) struct Facing<D> {
    /// Its normal, as long as its area is of the face's.
    pub normal: Vector<D>,
    /// The same as a unit vector.
    unit: Vector<D>,
    /// ∇d along the face.
    along: Vector<D>,
    /// Derivative of the cosine between the two sides by its square.
    bend: D,
    /// How much there is of the other side, and its derivative by that square.
    share: [D; 2],
}

/// The vertices of faces that are near, with their fields.
pub(super) type Near = Vec<(usize, Field)>;

impl Film {
    /// The vertices that a film needs, of a surface with these points in the frame of what is opposite; none where that is farther than a film reaches. `Err`
    /// gives a distance that isn't positive.
    pub(super) fn near(&self, placed: &Displaced<f64>) -> Result<Option<Near>, f64> {
        let (surface, opposite) = (&*self.surface, &*self.opposite);
        let field = |v: usize| opposite.field(&real(&placed.apply(&surface.vertices[v])));
        let middle = opposite.field(&real(&placed.apply(&surface.center)));
        if middle.distance - surface.radius > self.width.reach {
            return Ok(None);
        }
        let [_, end] = self.rim;
        let (mut fields, mut lowest) = (vec![None; surface.vertices.len()], f64::INFINITY);
        for cluster in &surface.clusters {
            let center = opposite.field(&real(&placed.apply(&cluster.center)));
            if center.distance - cluster.radius > end.max(self.width.reach) {
                continue;
            }
            for v in &cluster.vertices {
                let field = field(*v);
                lowest = lowest.min(field.distance);
                fields[*v] = Some(field);
            }
        }
        if lowest <= 0.0 {
            return Err(lowest);
        }
        // The link's gap is a mean.
        if lowest >= self.width.reach {
            return Ok(None);
        }
        let near = |v: usize| fields[v].is_some_and(|f: Field| f.distance < end);
        let mut needed: Vec<bool> = (0..fields.len()).map(near).collect();
        for face in &surface.faces {
            if face.corners.iter().any(|v| near(*v)) {
                face.corners.iter().for_each(|v| needed[*v] = true);
            }
        }
        let all = (0..fields.len()).filter(|v| needed[*v]);
        let all = all.map(|v| (v, fields[v].unwrap_or_else(|| field(v))));
        Ok(Some(all.collect()))
    }
}

impl<D: Jet> Layer<D> {
    /// Of a pose of the surface in the frame of what is opposite. With the layer at that pose there are potentials where it has them; else none where the gap is wide.
    pub fn new(
        film: &Film,
        placed: &Displaced<D>,
        near: &Near,
        known: Option<&Layer<f64>>,
    ) -> Option<Self> {
        let (surface, opposite, width) = (&film.surface, &film.opposite, &film.width);
        let mut spots: Vec<Spot<D>> = (near.iter())
            .map(|(vertex, field)| {
                let point = placed.apply(&surface.vertices[*vertex]);
                let here = Distance::new(field, &point);
                Spot {
                    vertex: *vertex,
                    point,
                    distances: [here; 2],
                    number: None,
                }
            })
            .collect();
        let gap = Gap::new(film, placed, &spots)?;
        if known.is_none() && gap.value.re() >= width.reach {
            return None;
        }
        let wider = (-gap.value / width.reach + 1.0).powi(3) * width.floor;
        let own = scale(wider, &gap.normal);
        let other = placed.rotate(&own);
        let mut held = Vec::with_capacity(if known.is_none() { spots.len() } else { 0 });
        for (s, spot) in spots.iter_mut().enumerate() {
            let at = add(&spot.point, &minus(&other));
            let field = match known {
                Some(known) => known.held[s],
                None => {
                    held.push(opposite.field(&real(&at)));
                    held[s]
                }
            };
            spot.distances[1] = Distance::new(&field, &at);
        }
        let mut out = Self {
            shift: [own, other],
            gap,
            spots,
            held,
            active: Vec::new(),
            rim: Vec::new(),
            cells: Vec::new(),
        };
        out.bound(film, known);
        out.fill(film);
        Some(out)
    }

    /// The least distance at which vertices with a potential are held apart, m.
    pub fn least_held(&self) -> f64 {
        let held = self
            .active
            .iter()
            .map(|s| self.spots[*s].distances[1].value.re());
        held.fold(f64::INFINITY, f64::min)
    }

    /// Where the film ends: which vertices have a potential, unless that is known, and how well each leads into the open.
    fn bound(&mut self, film: &Film, known: Option<&Layer<f64>>) {
        for s in 0..self.spots.len() {
            let t = self.outside(film, s);
            let within = t.iter().all(|t| t.re() < 1.0);
            if known.map_or(within, |known| known.spots[s].number.is_some()) {
                let spot = &mut self.spots[s];
                spot.number = Some(self.active.len());
                self.active.push(s);
                let area = film.surface.areas[spot.vertex];
                let open = opening(t[0]) + opening(t[1]);
                self.rim
                    .push(open * (OPENING * area) / spot.distances[0].value);
            }
        }
    }

    /// How far a spot is from where the film begins to end to where it has, by its distance and by where it faces.
    pub(super) fn outside(&self, film: &Film, spot: usize) -> [D; 2] {
        let [start, end] = film.rim;
        let spot = &self.spots[spot];
        let facing = dot(&self.gap.normal, &film.surface.normals[spot.vertex]);
        [
            (spot.distances[0].value - start) / (end - start),
            (facing - BACK[0]) / (BACK[1] - BACK[0]),
        ]
    }

    fn fill(&mut self, film: &Film) {
        let surface = &*film.surface;
        let mut at = vec![None; surface.vertices.len()];
        for (s, spot) in self.spots.iter().enumerate() {
            at[spot.vertex] = Some(s);
        }
        for (f, face) in surface.faces.iter().enumerate() {
            let [Some(a), Some(b), Some(c)] = face.corners.map(|v| at[v]) else {
                continue;
            };
            let spots = [a, b, c];
            let corners = spots.map(|s| self.spots[s].number);
            if corners.iter().all(Option::is_none) {
                continue;
            }
            let heights = |which: usize| spots.map(|s| self.spots[s].distances[which].value);
            let [near, held] = [0, 1].map(heights);
            self.cells.push(Cell {
                face: f,
                spots,
                corners,
                thickness: [near, held].map(|d| Thickness::new(&d, face, film.bulge(face))),
                facing: Facing::new(&near, face, film.goes_on),
            });
        }
    }
}

impl<D: Jet> Gap<D> {
    fn new(film: &Film, placed: &Displaced<D>, spots: &[Spot<D>]) -> Option<Self> {
        let (surface, reach, [_, end]) = (&film.surface, film.width.reach, film.rim);
        let (mut sum, mut gap) = (D::from(0.0), D::from(0.0));
        let mut mean = zero::<D>();
        for spot in spots {
            let d = spot.distances[0].value;
            if let Some(weight) = weight(d, surface.areas[spot.vertex], end, reach) {
                sum += weight;
                gap += weight * d;
                let n = &surface.normals[spot.vertex];
                (0..3).for_each(|i| mean[i] += weight * n[i]);
            }
        }
        let mean = mean.map(|x| x / sum);
        (sum.re() > 0.0).then(|| Self {
            value: gap / sum,
            mean,
            normal: match film.opposite.wall_normal() {
                Some(wall) => placed.rotate_inverse(&constant(&-wall)),
                None => mean,
            },
            sum,
        })
    }
}

/// How much a vertex at a distance counts in a link's gap; beyond `end` nothing.
pub(super) fn weight<D: Jet>(d: D, area: f64, end: f64, scale: f64) -> Option<D> {
    let fade = || (-d / end + 1.0).powi(3) * area;
    // To the power −NEAREST.
    let near = || {
        let once = d.recip() * scale;
        let square = once * once;
        square * square * square
    };
    (d.re() < end).then(|| near() * fade())
}

impl<D: Jet> Thickness<D> {
    /// The length of the arc that meets both surfaces at right angles, of a face with these distances at its corners: 1/(mean of 1/length), which is what the flow
    /// across lines of equal thickness feels, by the middles of its edges, outside which the shape bulges.
    fn new(d: &[D; 3], face: &Element, bulge: &[f64; 3]) -> Self {
        let (steep, slopes) = steepness(d, face);
        let [arc, slope] = arc(steep);
        let middles: [_; 3] = std::array::from_fn(|i| inverse(d[i] + d[(i + 1) % 3], bulge[i]));
        let mean = (middles[0][0] + middles[1][0] + middles[2][0]).recip() * 1.5;
        let value = arc * mean;
        let narrower = value * mean / 1.5;
        Self {
            value,
            slopes: std::array::from_fn(|i| {
                slope * slopes[i] * mean - (middles[i][1] + middles[(i + 2) % 3][1]) * narrower
            }),
        }
    }
}

/// 1/(w − 2b) of a sum of two distances, w, where the surface bulges by b, and its derivative: (1 + t + 2t²)/w in t = 2b/w, as large at t = ½ and never without end.
fn inverse<D: Jet>(w: D, bulge: f64) -> [D; 2] {
    let once = w.recip();
    let t = once * (2.0 * bulge);
    [
        (t * (t * 2.0 + 1.0) + 1.0) * once,
        -(t * (t * 6.0 + 2.0) + 1.0) * once * once,
    ]
}

/// |∇d|² on a face, bounded, and its derivative.
fn steepness<D: Jet>(d: &[D; 3], face: &Element) -> (D, [D; 3]) {
    let s = &face.slopes;
    let along = [0, 1, 2].map(|i| d[0] * s[(i, 0)] + d[1] * s[(i, 1)] + d[2] * s[(i, 2)]);
    let [steep, slope] = bounded(product(d, &along));
    (steep, along.map(|x| slope * x * 2.0))
}

/// What it was up to 1, [`STEEPEST`] in the end, and its derivative: three times continuously differentiable.
fn bounded<D: Jet>(square: D) -> [D; 2] {
    const WIDTH: f64 = 2.0 * (STEEPEST - 1.0);
    let t = (square - 1.0) * (1.0 / WIDTH);
    if t.re() <= 0.0 {
        return [square, D::from(1.0)];
    }
    if t.re() >= 1.0 {
        return [D::from(STEEPEST), D::from(0.0)];
    }
    let fourth = t * t * t * t;
    [
        (t - fourth * (t * (t - 3.0) + 2.5)) * WIDTH + 1.0,
        -rise(t) + 1.0,
    ]
}

/// From 0 at t = 0 to 1 at 1, where two derivatives vanish.
fn rise<D: Jet>(t: D) -> D {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

/// An arc's length in its height, and its derivative, of a square of a sine.
fn arc<D: Jet>(steep: D) -> [D; 2] {
    let last = std::f64::consts::FRAC_PI_2 - ARC.iter().sum::<f64>();
    let [a, b, c, e] = ARC;
    let square = steep * steep;
    // To the power STEEP − 1.
    let once = square * square * square * steep * last;
    [
        steep * (steep * (steep * e + c) + b) + a + steep * once,
        steep * (steep * (3.0 * e) + 2.0 * c) + b + once * STEEP,
    ]
}

/// How much of the other side there is over a face at the square of a sine, and its derivative, where it goes on beside the film as far as `goes_on` says: 1 over
/// it, and beside it that.
fn share<D: Jet>(square: D, goes_on: f64) -> [D; 2] {
    let t = (square - BESIDE) * (1.0 / (1.0 - BESIDE));
    let lost = 1.0 - goes_on;
    if lost == 0.0 || t.re() <= 0.0 {
        return [D::from(1.0), D::from(0.0)];
    }
    if t.re() >= 1.0 {
        return [D::from(goes_on), D::from(0.0)];
    }
    let left = -t + 1.0;
    let slope = t * t * left * left * (30.0 / (1.0 - BESIDE));
    [rise(t) * -lost + 1.0, slope * -lost]
}

impl<D: Jet> Facing<D> {
    /// The other side's normal: its part along the face is what the distances do there. The arcs that meet both at right angles cut equal areas off both, as far as there is
    /// another side: a block's sides beside another one of its size have none.
    fn new(d: &[D; 3], face: &Element, goes_on: f64) -> Self {
        let along = slope_of(d, face);
        let square = product(&along, &along);
        let [a, b, c] = COSINE;
        let cosine = square * (square * (square * c + b) + a) + 1.0;
        let unit = std::array::from_fn(|i| along[i] - cosine * face.normal[i]);
        let share = share(square, goes_on);
        Self {
            normal: scale(share[0], &unit),
            unit,
            along,
            bend: square * (square * (3.0 * c) + 2.0 * b) + a,
            share,
        }
    }

    /// The cotangents of the distances at the corners, from that of the normal.
    pub fn pull(&self, bar: &Vector<D>, face: &Element) -> [D; 3] {
        let square = dot(bar, &face.normal) * self.bend * self.share[0] * -1.0
            + product(bar, &self.unit) * self.share[1];
        let bar = add(
            &scale(self.share[0], bar),
            &scale(square * 2.0, &self.along),
        );
        [0, 1, 2].map(|k| dot(&bar, &face.gradients.column(k).into_owned()))
    }

    /// The normal's derivatives by the distances at the corners.
    pub fn slopes(&self, face: &Element) -> [Vector<D>; 3] {
        [0, 1, 2].map(|k| {
            let gradient = face.gradients.column(k).into_owned();
            let square = dot(&self.along, &gradient) * 2.0;
            let across = square * self.bend;
            std::array::from_fn(|i| {
                (-across * face.normal[i] + gradient[i]) * self.share[0]
                    + self.unit[i] * square * self.share[1]
            })
        })
    }
}

/// ∇d on a face.
fn slope_of<D: Jet>(d: &[D; 3], face: &Element) -> Vector<D> {
    let g = &face.gradients;
    std::array::from_fn(|i| d[0] * g[(i, 0)] + d[1] * g[(i, 1)] + d[2] * g[(i, 2)])
}
