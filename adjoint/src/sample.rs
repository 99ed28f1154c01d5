//! Reproducible numbers without a pattern, for checks, tests, benches and the starts of iterations: the only such
//! generator of the project.
//!
//! SplitMix64: a counter is scrambled by integer operations alone, so that the numbers are the same on every machine.
//! Samples of a smooth function won't do instead: any three samples of a sine at equal distances satisfy a linear
//! relation, so that all vectors made of them lie in one plane, and a check along them never sees the component of a
//! derivative across it. [`span`] measures that.
//!
//! # References
//! G. L. Steele, D. Lea, C. H. Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014.

use nalgebra::Matrix3;

/// Distance of consecutive counters, 2⁶⁴ over the golden ratio.
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// The 64 bits of a counter.
pub fn bits(counter: u64) -> u64 {
    let mut z = counter.wrapping_add(STEP);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The number of a counter, uniform in [−1, 1).
pub fn number(counter: u64) -> f64 {
    (bits(counter) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// The first `count` numbers of a seed, uniform in [−`size`, `size`).
pub fn numbers(seed: u64, count: usize, size: f64) -> Vec<f64> {
    Samples::new(seed).numbers(count, size)
}

/// An endless sequence of numbers.
#[derive(Clone, Debug)]
pub struct Samples(u64);

impl Samples {
    /// The sequence of a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next number, uniform in [−1, 1).
    pub fn number(&mut self) -> f64 {
        let counter = self.0;
        self.0 = counter.wrapping_add(STEP);
        number(counter)
    }

    /// The next number, uniform in [`low`, `high`).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + 0.5 * (high - low) * (self.number() + 1.0)
    }

    /// The next number of a standard normal distribution, by the transformation of Box and Muller.
    pub fn normal(&mut self) -> f64 {
        // In (0, 1], so that the logarithm is finite.
        let radius = (-2.0 * (1.0 - self.between(0.0, 1.0)).ln()).sqrt();
        radius * (std::f64::consts::PI * self.number()).cos()
    }

    /// One of 0, …, `count` − 1.
    pub fn below(&mut self, count: usize) -> usize {
        (0.5 * (self.number() + 1.0) * count as f64) as usize
    }

    /// A vector with components in [−`size`, `size`).
    pub fn vector(&mut self, size: f64) -> [f64; 3] {
        self.array().map(|x| size * x)
    }

    /// A vector of unit length.
    pub fn direction(&mut self) -> [f64; 3] {
        nalgebra::Vector3::from(self.vector(1.0)).normalize().into()
    }

    /// The next `N` numbers, uniform in [−1, 1).
    pub fn array<const N: usize>(&mut self) -> [f64; N] {
        std::array::from_fn(|_| self.number())
    }

    /// The next `count` numbers, uniform in [−`size`, `size`).
    pub fn numbers(&mut self, count: usize, size: f64) -> Vec<f64> {
        (0..count).map(|_| size * self.number()).collect()
    }
}

/// How evenly vectors span space: the smallest over the largest singular value of the matrix of their columns. Zero
/// (to round-off) where they lie in one plane, or where there are fewer than three; 1 where no direction is preferred.
pub fn span(vectors: impl IntoIterator<Item = [f64; 3]>) -> f64 {
    let mut gram = Matrix3::zeros();
    for v in vectors {
        let v = nalgebra::Vector3::from(v);
        gram += v * v.transpose();
    }
    let squares = gram.symmetric_eigenvalues();
    if squares.max() > 0.0 {
        (squares.min().max(0.0) / squares.max()).sqrt()
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn windows(x: &[f64]) -> impl Iterator<Item = [f64; 3]> + '_ {
        x.windows(3).map(|w| [w[0], w[1], w[2]])
    }

    #[test]
    fn numbers_are_those_of_the_published_generator() {
        // The first outputs of seed 1234567, as the generator's authors print them.
        let published = [
            6457827717110365317_u64,
            3203168211198807973,
            9817491932198370423,
        ];
        let found = numbers(1234567, 3, 1.0);
        for (x, z) in found.iter().zip(published) {
            assert_eq!(*x, (z >> 11) as f64 / (1_u64 << 52) as f64 - 1.0);
        }
    }

    #[test]
    fn numbers_are_uniform_and_their_vectors_span_space() {
        let x = numbers(3, 30_000, 2.0);
        let moment = |p: i32| x.iter().map(|x| x.powi(p)).sum::<f64>() / x.len() as f64;
        assert!(x.iter().all(|x| (-2.0..2.0).contains(x)));
        assert!(moment(1).abs() < 0.02 && (moment(2) - 4.0 / 3.0).abs() < 0.03);
        assert!(span(windows(&x)) > 0.97);
        for seed in 0..100 {
            assert!(span(windows(&numbers(seed, 33, 1.0))) > 0.3, "{seed}");
        }
    }

    #[test]
    fn samples_of_a_sine_lie_in_a_plane() {
        let x: Vec<f64> = (0..100).map(|i| (12.9898 * i as f64).sin()).collect();
        assert!(span(windows(&x)) < 1e-6);
        assert_eq!(span([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), 0.0);
        assert_eq!(span([]), 0.0);
    }
}
