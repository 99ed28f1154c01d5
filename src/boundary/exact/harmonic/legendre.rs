//! Real spherical harmonics of one direction, degree after degree.
//!
//! `Y_{n0} = P̄_n⁰(u)/√(2π)`, `Y_{nm} = P̄_n^m(u) {cos, sin}(mφ)/√π`, orthonormal on the unit sphere, with P̄
//! normalised on [−1, 1]; the recursion in n at fixed m loses no digits.
//!
//! # References
//! NIST DLMF 14.10.3, 14.30.

use std::f64::consts::PI;

/// One direction.
#[derive(Clone, Debug)]
pub(super) struct Legendre {
    u: f64,
    s: f64,
    /// cos mφ and sin mφ, with the norm's 1/√π or 1/√(2π).
    azimuthal: Vec<[f64; 2]>,
    /// P̄_n^m of the degree reached and of the one before.
    now: Vec<f64>,
    before: Vec<f64>,
    degree: usize,
}

/// Factors of the recursion that leads to a degree, one pair for each order below it.
pub(super) fn recursion(n: usize) -> Vec<[f64; 2]> {
    let l = n as f64;
    (0..n)
        .map(|m| {
            let m = m as f64;
            let a = ((4.0 * l * l - 1.0) / (l * l - m * m)).sqrt();
            let k = l - 1.0;
            let b = if n > 1 {
                ((k * k - m * m).max(0.0) / (4.0 * k * k - 1.0)).sqrt()
            } else {
                0.0
            };
            [a, a * b]
        })
        .collect()
}

impl Legendre {
    /// At degree 0, for degrees up to `most`; components (u, v, w) of a unit vector.
    pub fn new([u, v, w]: [f64; 3], most: usize) -> Self {
        let s = v.hypot(w);
        let (cos, sin) = if s > 0.0 { (v / s, w / s) } else { (1.0, 0.0) };
        let mut azimuthal = vec![[(0.5 / PI).sqrt(), 0.0]];
        let mut multiple = [1.0 / PI.sqrt(), 0.0];
        for _ in 0..most {
            multiple = [
                multiple[0] * cos - multiple[1] * sin,
                multiple[0] * sin + multiple[1] * cos,
            ];
            azimuthal.push(multiple);
        }
        let mut now = vec![0.0; most + 1];
        now[0] = 0.5f64.sqrt();
        Self {
            u,
            s,
            azimuthal,
            now,
            before: vec![0.0; most + 1],
            degree: 0,
        }
    }

    /// Goes on to the next degree, whose [`recursion`] is given.
    pub fn advance(&mut self, recursion: &[[f64; 2]]) {
        let n = self.degree + 1;
        for (m, [a, b]) in recursion.iter().enumerate() {
            let next = a * self.u * self.now[m] - b * self.before[m];
            self.before[m] = self.now[m];
            self.now[m] = next;
        }
        let l = n as f64;
        self.before[n] = 0.0;
        // P̄_{n−1}^{n−1} has been moved.
        self.now[n] = (1.0 + 0.5 / l).sqrt() * self.s * self.before[n - 1];
        self.degree = n;
    }

    /// Y_{nm} of the degree reached.
    pub fn value(&self, m: usize, sine: bool) -> f64 {
        self.now[m] * self.azimuthal[m][usize::from(sine)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Σ_m Y_nm(x) Y_nm(y) = (2n + 1)/(4π) P_n(x · y).
    #[test]
    fn addition_theorem() {
        let most = 300;
        let x = [0.48f64, 0.64, 0.6];
        for y in [x, [0.6, 0.0, -0.8], [1.0, 0.0, 0.0], [-1e-9, 1.0, 0.0]] {
            let dot: f64 = x.iter().zip(&y).map(|(a, b)| a * b).sum();
            let mut pair = [x, y].map(|d| Legendre::new(d, most));
            let (mut p, mut q) = (dot, 1.0);
            for n in 1..=most {
                let step = recursion(n);
                pair.iter_mut().for_each(|l| l.advance(&step));
                let sum: f64 = (0..=n)
                    .flat_map(|m| [(m, false), (m, true)])
                    .map(|(m, sine)| pair[0].value(m, sine) * pair[1].value(m, sine))
                    .sum();
                let l = n as f64;
                let exact = (2.0 * l + 1.0) / (4.0 * PI) * p;
                assert!((sum - exact).abs() < 1e-12 * l, "{n}: {sum} {exact}");
                (p, q) = (((2.0 * l + 1.0) * dot * p - l * q) / (l + 1.0), p);
            }
        }
    }
}
