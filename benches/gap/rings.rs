//! Bodies of revolution over a wall, or over their like: rings of sources on the exact surface, whose edges are well under the gap wherever it is narrow.
//!
//! Direct: ½φ − ∫ φ ∂G/∂n = −∫ G ∂φ/∂n with constant potentials, at the middles of elements; M = −∮ φ n_z. The mirror image in the plane z = 0 has the sign
//! of the motion there: 1 for a wall.

use faer::Mat;
use faer::linalg::solvers::Solve;
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};

/// A piece of the outline in the half plane (r, z), the axis of which is at the gap's middle, from below to above.
#[derive(Clone, Copy)]
pub enum Piece {
    /// From one point to another.
    Line([f64; 2], [f64; 2]),
    /// Half an ellipse about a height on the axis, with semi-axes along r and z, from the lowest point to the highest.
    Ellipse(f64, [f64; 2]),
}

impl Piece {
    fn point(&self, t: f64) -> [f64; 2] {
        match self {
            Self::Line(a, b) => [0, 1].map(|k| a[k] + t * (b[k] - a[k])),
            Self::Ellipse(height, [a, b]) => [a * (PI * t).sin(), height - b * (PI * t).cos()],
        }
    }

    /// Outward normal times the length of the outline per parameter.
    fn normal(&self, t: f64) -> [f64; 2] {
        match self {
            Self::Line(a, b) => [b[1] - a[1], a[0] - b[0]],
            Self::Ellipse(_, [a, b]) => [b * PI * (PI * t).sin(), -a * PI * (PI * t).cos()],
        }
    }
}

struct Element {
    piece: Piece,
    from: f64,
    to: f64,
}

/// A quadrature point: where, the normal times the weight.
struct Node {
    r: f64,
    z: f64,
    normal: [f64; 2],
}

/// Points and weights on [0, 1].
const GAUSS: [(f64, f64); 6] = [
    (0.033_765_242_898_423_99, 0.085_662_246_189_585_17),
    (0.169_395_306_766_867_74, 0.180_380_786_524_069_3),
    (0.380_690_406_958_401_56, 0.233_956_967_286_345_52),
    (0.619_309_593_041_598_5, 0.233_956_967_286_345_52),
    (0.830_604_693_233_132_3, 0.180_380_786_524_069_3),
    (0.966_234_757_101_576, 0.085_662_246_189_585_17),
];

impl Element {
    fn nodes(&self, from: f64, to: f64) -> impl Iterator<Item = Node> + '_ {
        GAUSS.iter().map(move |(x, weight)| {
            let t = from + x * (to - from);
            let [r, z] = self.piece.point(t);
            let normal = self.piece.normal(t).map(|n| n * weight * (to - from));
            Node { r, z, normal }
        })
    }

    fn middle(&self) -> [f64; 2] {
        self.piece.point(0.5 * (self.from + self.to))
    }

    /// ∮ n_z.
    fn lift(&self) -> f64 {
        let nodes = self.nodes(self.from, self.to);
        nodes.map(|n| 2.0 * PI * n.r * n.normal[1]).sum()
    }

    /// ∫ G n_z and ∫ ∂G/∂n as seen from a point.
    fn seen(&self, at: [f64; 2]) -> [f64; 2] {
        let mut out = [0.0; 2];
        self.part(at, self.from, self.to, 0, &mut out);
        out
    }

    fn part(&self, at: [f64; 2], from: f64, to: f64, depth: usize, out: &mut [f64; 2]) {
        let [a, m, b] = [from, 0.5 * (from + to), to].map(|t| self.piece.point(t));
        let off = |x: &[f64; 2], y: &[f64; 2]| f64::hypot(x[0] - y[0], x[1] - y[1]);
        let near = off(&a, &at).min(off(&m, &at)).min(off(&b, &at));
        if near < off(&a, &b) && depth < 24 {
            let middle = 0.5 * (from + to);
            self.part(at, from, middle, depth + 1, out);
            self.part(at, middle, to, depth + 1, out);
            return;
        }
        for node in self.nodes(from, to) {
            let (g, slopes) = ring(at, [node.r, node.z]);
            out[0] += node.r * g * node.normal[1];
            out[1] += node.r * (slopes[0] * node.normal[0] + slopes[1] * node.normal[1]);
        }
    }
}

/// Complete elliptic integrals K and E of 1 − m, by the arithmetic-geometric mean.
fn elliptic(rest: f64) -> [f64; 2] {
    let (mut a, mut b, mut sum, mut power) = (1.0, rest.sqrt(), 0.5 * (1.0 - rest), 0.5);
    while (a - b).abs() > 1e-15 * a {
        let c = 0.5 * (a - b);
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
        power *= 2.0;
        sum += power * c * c;
    }
    let k = FRAC_PI_2 / a;
    [k, k * (1.0 - sum)]
}

/// ∫ dφ/(4πR) around a ring through the point (s, y), and its derivatives by s and y.
fn ring([r, z]: [f64; 2], [s, y]: [f64; 2]) -> (f64, [f64; 2]) {
    let off = z - y;
    let (far, near) = ((r + s).powi(2) + off * off, (r - s).powi(2) + off * off);
    let [k, e] = elliptic(near / far);
    let strength = 1.0 / (PI * far.sqrt());
    let outwards = ((r * r - s * s + off * off) * e / near - k) / (2.0 * s);
    (
        strength * k,
        [strength * outwards, strength * off * e / near],
    )
}

/// Elements along an outline, of lengths at most those that `size` gives at a point.
fn elements(outline: &[Piece], size: &impl Fn([f64; 2]) -> f64) -> Vec<Element> {
    let mut out = Vec::new();
    for piece in outline {
        let (mut from, mut nodes) = (0.0, vec![0.0]);
        while from < 1.0 {
            let rate = |t: f64| {
                let n = piece.normal(t);
                f64::hypot(n[0], n[1])
            };
            let step = |t: f64| size(piece.point(t)) / rate(t);
            // By the smaller one of both ends: sizes shrink towards corners too.
            let guess = from + step(from);
            from += step(from).min(step(guess.min(1.0)));
            nodes.push(from.min(1.0));
        }
        out.extend(nodes.windows(2).map(|t| Element {
            piece: *piece,
            from: t[0],
            to: t[1],
        }));
    }
    out
}

/// Added mass along the axis of a body with this outline over the plane z = 0, at density 1: the mirror image moves as the body does (sign 1, a wall), or
/// against that.
pub fn added_mass(outline: &[Piece], sign: f64, size: impl Fn([f64; 2]) -> f64) -> f64 {
    let elements = elements(outline, &size);
    let count = elements.len();
    let rows: Vec<Vec<[f64; 2]>> = (elements.par_iter())
        .map(|row| {
            let [r, z] = row.middle();
            let seen = |e: &Element| {
                let (own, image) = (e.seen([r, z]), e.seen([r, -z]));
                [0, 1].map(|k| own[k] + sign * image[k])
            };
            elements.iter().map(seen).collect()
        })
        .collect();
    let matrix = Mat::from_fn(count, count, |i, j| {
        let own = if i == j { 0.5 } else { 0.0 };
        own - rows[i][j][1]
    });
    let right = Mat::from_fn(count, 1, |i, _| {
        -rows[i].iter().map(|seen| seen[0]).sum::<f64>()
    });
    let potential = matrix.partial_piv_lu().solve(&right);
    let all = elements.iter().enumerate();
    -all.map(|(j, e)| potential[(j, 0)] * e.lift()).sum::<f64>()
}
