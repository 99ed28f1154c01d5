//! The radial parts of ellipsoidal harmonics.
//!
//! With ℓ = e^{2v} and T's eigenvalue h, both solutions of Lamé's equation are known by their logarithmic
//! derivatives, F for outside (D = −d ln F/dv), E for inside (D = d ln E/dv):
//!
//! ```text
//! P = ℓ (n(n+1) ℓ + h) / ((ℓ + A)(ℓ + B)),    κ = 1 − ℓ/(ℓ + A) − ℓ/(ℓ + B)
//! F:  −dD/dv = P − D² − κ D    inward from far away, where D → n + 1
//! E:   dD/dv = P − D² + κ D    outward from the focal ellipse, where D → 0 or 1
//! ```
//!
//! Each is integrated in the direction in which errors die out, by Radau's method of fifth order, which
//! stiffness (large n) doesn't disturb. All zeros and branch points are at |Im v| ≥ π/2, for any
//! ellipsoid: one step size fits all.
//!
//! # References
//! E. Hairer, G. Wanner, *Solving ordinary differential equations II* (1996), §IV.5 (Radau IIA).

use crate::adjoint::lie::{Mat3, Vec3};

/// Step in v: leaves errors of 1e-9 in F.
const STEP: f64 = 1.0 / 16.0;
/// Steps between nodes that are kept.
const KEPT: usize = 2;
/// −ln of F over a dipole's fall, beyond which F counts as 0.
const NOTHING: f64 = 37.0;
/// The same from which the start of an integration is forgotten.
const FORGOTTEN: f64 = 12.0;
/// Where D = n + 1 to rounding, as ℓ over the square of the longest semi-axis.
const FAR: f64 = 1e12;
/// Where the inside begins, as ℓ over the smallest square.
const NEAR: f64 = 1e-10;

/// Coefficients at one v: P = n(n+1) `degree` + h `value`, κ.
#[derive(Clone, Copy, Debug)]
struct Coefficients {
    degree: f64,
    value: f64,
    kappa: f64,
}

/// What all harmonics of one ellipsoid share. Lengths in longest semi-axes.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    a: f64,
    b: f64,
    /// v of the surface.
    surface: f64,
    /// Stages of each step from the surface outward, in the order they are met coming inward.
    outside: Vec<[Coefficients; 3]>,
    /// The same at the nodes, the surface first.
    nodes: Vec<Coefficients>,
    /// Stages of each step from the focal ellipse to the surface, their start and length.
    inside: Vec<[Coefficients; 3]>,
    start: Coefficients,
    stride: f64,
}

/// One harmonic's radial part outside, and what the surface needs.
#[derive(Clone, Debug)]
pub(super) struct Radial {
    /// −ln F (0 at the surface), its first and second derivative in v, at each kept node from the
    /// surface outward.
    table: Vec<[f64; 3]>,
    /// Whether F goes on beyond the table, as a power.
    open: bool,
    /// D of F and of E at the surface.
    pub outside: f64,
    pub inside: f64,
}

/// Where a point is in the table.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    cell: usize,
    /// Of value, slope and curvature at both ends of the cell.
    weights: [[f64; 3]; 2],
    v: f64,
}

impl Grid {
    /// From A ≥ B ≥ 0 and c², lengths in longest semi-axes.
    pub fn new(a: f64, b: f64, c_squared: f64) -> Self {
        let at = |v: f64| coefficients(a, b, v);
        let surface = 0.5 * c_squared.ln();
        let cells = ((0.5 * FAR.ln() - surface) / STEP).ceil() as usize;
        let cells = cells.next_multiple_of(KEPT);
        let nodes = (0..=cells).map(|k| at(surface + STEP * k as f64)).collect();
        let outside = (0..cells)
            .map(|k| ABSCISSAE.map(|c| at(surface + STEP * (k as f64 + 1.0 - c))))
            .collect();
        let smallest = if b > 0.0 { b } else { a }.min(c_squared);
        let first = 0.5 * (NEAR * smallest).ln();
        let steps = ((surface - first) / STEP).ceil();
        let stride = (surface - first) / steps;
        let inside = (0..steps as usize)
            .map(|k| ABSCISSAE.map(|c| at(first + stride * (k as f64 + c))))
            .collect();
        Self {
            a,
            b,
            surface,
            outside,
            nodes,
            inside,
            start: at(first),
            stride,
        }
    }

    /// The solutions of degree n and eigenvalue h, `odd` along the shortest axis or even.
    pub fn radial(&self, n: usize, h: f64, odd: bool) -> Radial {
        let l = n as f64;
        let total = l * (l + 1.0);
        let p = |c: &Coefficients| total * c.degree + h * c.value;

        // Outward until nothing is left, by D of slow change; then some more, to forget the start.
        let root = |c: &Coefficients| {
            let half = 0.5 * c.kappa;
            (half * half + p(c)).sqrt() - half
        };
        let mut fall = 0.0;
        let mut last = 0;
        while last < self.outside.len() && fall < NOTHING + FORGOTTEN {
            fall += STEP * (root(&self.nodes[last]) - 2.0);
            last += 1;
        }
        let mut steps = Steps::from(root(&self.nodes[last]));
        let mut table = Vec::with_capacity(last / KEPT + 1);
        let mut keep = |k: usize, sum: f64, d: f64| {
            if k.is_multiple_of(KEPT) {
                let c = &self.nodes[k];
                table.push([sum, d, d * d + c.kappa * d - p(c)]);
            }
        };
        let mut sum = 0.0;
        keep(last, sum, steps.d);
        for k in (0..last).rev() {
            let stages = self.outside[k].map(|c| (p(&c), -c.kappa));
            let values = steps.radau(&stages, STEP);
            for (w, v) in BUTCHER[2].iter().zip(&values) {
                sum += STEP * w * v;
            }
            keep(k, sum, steps.d);
        }
        table.reverse();
        for entry in &mut table {
            entry[0] = sum - entry[0];
        }
        let spacing = STEP * KEPT as f64;
        let nothing = |k: usize| table[k][0] - 2.0 * spacing * k as f64 > NOTHING;
        let end = (0..table.len()).find(|&k| nothing(k));
        if let Some(end) = end {
            table.truncate(end + 1);
        }
        Radial {
            table,
            open: end.is_none(),
            outside: steps.d,
            inside: self.inside(&p, odd),
        }
    }

    /// D of E at the surface.
    fn inside(&self, p: &impl Fn(&Coefficients) -> f64, odd: bool) -> f64 {
        // From where E grows so much on the way that its start is forgotten, or from the focal ellipse.
        let mut from = self.inside.len();
        let (mut growth, mut d) = (0.0, 0.0);
        while from > 0 && growth < FORGOTTEN {
            from -= 1;
            let c = &self.inside[from][0];
            let half = 0.5 * c.kappa;
            let rate = (half * half + p(c)).sqrt();
            // Near the focal ellipse (P → 0) even and odd E stay apart.
            growth += self.stride * (rate - half);
            d = half + rate;
        }
        if growth < FORGOTTEN {
            let first = p(&self.start);
            d = match (self.b > 0.0, odd) {
                (true, true) => 1.0,
                (true, false) => first,
                // A focal segment: E goes like e^{mv}, P → m².
                (false, _) if first > 0.5 => first.sqrt(),
                (false, _) => 0.5 * first,
            };
        }
        let mut steps = Steps::from(d);
        for cell in &self.inside[from..] {
            steps.radau(&cell.map(|c| (p(&c), c.kappa)), self.stride);
        }
        steps.d
    }

    /// Where the surface ℓ is.
    pub fn spot(&self, level: f64) -> Spot {
        let v = (0.5 * level.ln()).max(self.surface);
        let h = STEP * KEPT as f64;
        let cell = (((v - self.surface) / h) as usize).min(self.nodes.len());
        let t = (v - self.surface) / h - cell as f64;
        let (t2, t3) = (t * t, t * t * t);
        let (t4, t5) = (t3 * t, t3 * t2);
        let up = 10.0 * t3 - 15.0 * t4 + 6.0 * t5;
        let start = [
            1.0 - up,
            h * (t - 6.0 * t3 + 8.0 * t4 - 3.0 * t5),
            0.5 * h * h * (t2 - 3.0 * t3 + 3.0 * t4 - t5),
        ];
        let end = [
            up,
            h * (-4.0 * t3 + 7.0 * t4 - 3.0 * t5),
            0.5 * h * h * (t3 - 2.0 * t4 + t5),
        ];
        Spot {
            cell,
            weights: [start, end],
            v,
        }
    }

    /// F at a spot, 1 at the surface.
    pub fn value(&self, radial: &Radial, spot: &Spot) -> f64 {
        let table = &radial.table;
        if let Some([start, end]) = table.get(spot.cell..spot.cell + 2).map(|s| [s[0], s[1]]) {
            let mut fall = 0.0;
            for i in 0..3 {
                fall += spot.weights[0][i] * start[i] + spot.weights[1][i] * end[i];
            }
            return (-fall).exp();
        }
        match table.last() {
            Some([fall, slope, _]) if radial.open => {
                let v = self.surface + STEP * (KEPT * (table.len() - 1)) as f64;
                (-fall - slope * (spot.v - v)).exp()
            }
            _ => 0.0,
        }
    }

    /// c/(ab): |dτ/dv| at the surface.
    pub fn rate(&self) -> f64 {
        let level = (2.0 * self.surface).exp();
        (level / ((level + self.a) * (level + self.b))).sqrt()
    }
}

fn coefficients(a: f64, b: f64, v: f64) -> Coefficients {
    let level = (2.0 * v).exp();
    let (p, q) = (level / (level + a), level / (level + b));
    Coefficients {
        degree: p * q,
        value: p / (level + b),
        kappa: 1.0 - p - q,
    }
}

const ROOT_6: f64 = 2.449_489_742_783_178;
const ABSCISSAE: [f64; 3] = [(4.0 - ROOT_6) / 10.0, (4.0 + ROOT_6) / 10.0, 1.0];
const BUTCHER: [[f64; 3]; 3] = [
    [
        (88.0 - 7.0 * ROOT_6) / 360.0,
        (296.0 - 169.0 * ROOT_6) / 1800.0,
        (-2.0 + 3.0 * ROOT_6) / 225.0,
    ],
    [
        (296.0 + 169.0 * ROOT_6) / 1800.0,
        (88.0 + 7.0 * ROOT_6) / 360.0,
        (-2.0 - 3.0 * ROOT_6) / 225.0,
    ],
    [(16.0 - ROOT_6) / 36.0, (16.0 + ROOT_6) / 36.0, 1.0 / 9.0],
];

/// What of a step of Newton's method is so little that the next would be rounding.
const QUADRATIC: f64 = 1e-9;

/// Where the polynomial through a step's start and its stages goes at the stages of the next step.
const AHEAD: [[f64; 4]; 3] = ahead();

const fn ahead() -> [[f64; 4]; 3] {
    let nodes = [0.0, ABSCISSAE[0], ABSCISSAE[1], ABSCISSAE[2]];
    let mut out = [[1.0; 4]; 3];
    let mut j = 0;
    while j < 3 {
        let mut i = 0;
        while i < 4 {
            let mut m = 0;
            while m < 4 {
                if m != i {
                    out[j][i] *= (1.0 + ABSCISSAE[j] - nodes[m]) / (nodes[i] - nodes[m]);
                }
                m += 1;
            }
            i += 1;
        }
        j += 1;
    }
    out
}

/// Steps of `D' = p − D² + k D` on end.
struct Steps {
    /// D so far.
    d: f64,
    /// What the stages of the next step are guessed to be.
    guess: Vec3,
}

impl Steps {
    fn from(start: f64) -> Self {
        Self {
            d: start,
            guess: Vec3::repeat(start),
        }
    }

    /// Stages of one step, (p, k) at each stage; the last one is the step's end.
    fn radau(&mut self, stages: &[(f64, f64); 3], h: f64) -> [f64; 3] {
        let (start, mut d) = (self.d, self.guess);
        for _ in 0..20 {
            let mut residual = d.add_scalar(-start);
            let mut jacobian = Mat3::identity();
            for j in 0..3 {
                let (p, k) = stages[j];
                let rate = p + d[j] * (k - d[j]);
                let slope = k - 2.0 * d[j];
                for i in 0..3 {
                    residual[i] -= h * BUTCHER[i][j] * rate;
                    jacobian[(i, j)] -= h * BUTCHER[i][j] * slope;
                }
            }
            let Some(inverse) = jacobian.try_inverse() else {
                break;
            };
            let step = inverse * residual;
            d -= step;
            if step.amax() <= QUADRATIC * d.amax() {
                break;
            }
        }
        let through = [start, d[0], d[1], d[2]];
        let sum = |weights: &[f64; 4]| weights.iter().zip(through).map(|(w, x)| w * x).sum();
        self.guess = Vec3::from(AHEAD.each_ref().map(sum));
        self.d = d[2];
        d.into()
    }
}
