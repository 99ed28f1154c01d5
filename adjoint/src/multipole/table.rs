//! Multi-indices (i, j, z) of moments and derivatives up to a degree, and which of them add up to which.
//!
//! Potentials are harmonic: ∂z² is −∂x² − ∂y², so that of each degree d the 2d + 1 indices with z below two tell all others. Sums of two of them have a z up to
//! two; those with two stand behind the others.

use std::ops::Range;
use std::slice::ChunksExact;

/// Highest degree: numbers of derivatives of one more fit into the indices, and the products of all into a few hundred kB.
pub const MOST: usize = 12;

/// What a multi-index follows from: where that stands, which coordinate comes in, and with which factor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lower {
    pub at: usize,
    pub axis: usize,
    pub factor: f64,
}

/// Of each multi-index what it follows from.
#[derive(Clone, Debug, Default)]
pub(super) struct Lowers {
    all: Vec<Lower>,
    ends: Vec<u32>,
}

impl Lowers {
    fn push(&mut self, lowers: impl Iterator<Item = Lower>) {
        self.all.extend(lowers);
        self.ends.push(self.all.len() as u32);
    }

    #[inline(always)]
    pub fn of(&self, n: usize) -> &[Lower] {
        let start = n.checked_sub(1).map_or(0, |last| self.ends[last] as usize);
        &self.all[start..self.ends[n] as usize]
    }
}

/// Where what isn't told by its degree alone stands: indices with z = 2, and those of one more degree than that of the products.
#[derive(Clone, Copy, Debug)]
struct Behind {
    degree: usize,
    /// Those of one more degree.
    last: usize,
}

impl Behind {
    #[inline(always)]
    fn new(degree: usize) -> Self {
        let twos = degree * (degree - 1) / 2;
        Self {
            degree,
            last: (degree + 1) * (degree + 1) + twos,
        }
    }

    /// Those of degree d with z = 2.
    #[inline(always)]
    fn of(&self, d: usize) -> usize {
        match d > self.degree {
            true => self.last + 2 * d + 1,
            false => (self.degree + 1) * (self.degree + 1) + (d - 1) * (d - 2) / 2,
        }
    }
}

/// Multi-indices in the order of their degree.
#[derive(Clone, Debug)]
pub struct Table {
    degree: usize,
    /// Of (a·∂)ᵈ/d!, the moments of a unit charge: d times each is Σ factor · coordinate · lower.
    pub(super) monomial: Lowers,
    /// Of each derivative of 1/r: factors of coordinate times the next lower, and of those two lower.
    pub(super) once: Lowers,
    pub(super) twice: Lowers,
    /// Of each k of degree d, for the l from degree 1 up to the degree left: where k + l stands, one after the other.
    sums: Vec<u16>,
    /// Where those of each degree begin.
    sums_from: Vec<usize>,
    /// The same of moments that are shifted: l from degree 0 up to one less.
    shifts: Vec<u16>,
    shifts_from: Vec<usize>,
    /// The two that each index with z = 2 is minus the sum of, by degree.
    folds: Vec<[u16; 2]>,
    /// Of each index, those with z = 2 left out, the one higher along each axis; up to one degree less.
    pub(super) higher: Vec<[u16; 3]>,
    /// (−1)^|k|
    pub(super) sign: Vec<f64>,
    /// 1/d of each index.
    pub(super) inverse: Vec<f64>,
}

impl Table {
    /// Products of moments up to `degree` (2 to [`MOST`]): moments up to one less, and derivatives up to one more.
    pub fn new(degree: usize) -> Self {
        let degree = degree.clamp(2, MOST);
        let size = |k: &[usize; 3]| k[0] + k[1] + k[2];
        let last = degree + 1;
        // Those of one more degree stand behind all that products need.
        let behind = Behind::new(degree);
        let place = |k: [usize; 3]| -> usize {
            let d = size(&k);
            match k[2] {
                2 => behind.of(d) + k[1],
                z if d > degree => behind.last + z * (d + 1) + k[1],
                z => d * d + z * (d + 1) + k[1],
            }
        };
        let index: Vec<[usize; 3]> = (0..=last)
            .flat_map(|d| (0..2.min(d + 1)).map(move |z| (d, z)))
            .flat_map(|(d, z)| (0..=d - z).map(move |j| [d - z - j, j, z]))
            .collect();
        let moments = degree * degree;
        let down = |k: &[usize; 3], axis: usize, by: usize| {
            let mut k = *k;
            k[axis] = k[axis].checked_sub(by)?;
            Some(place(k))
        };
        let mut out = Self {
            degree,
            monomial: Lowers::default(),
            once: Lowers::default(),
            twice: Lowers::default(),
            sums: Vec::new(),
            sums_from: vec![0],
            shifts: Vec::new(),
            shifts_from: vec![0],
            folds: Vec::new(),
            higher: Vec::new(),
            sign: (index.iter())
                .map(|k| if size(k) % 2 == 0 { 1.0 } else { -1.0 })
                .collect(),
            inverse: index.iter().map(|k| 1.0 / size(k).max(1) as f64).collect(),
        };
        out.sign.truncate(moments);
        for k in &index {
            let m = size(k).max(1) as f64;
            let along = |axis: usize, factor: f64, at: Option<usize>| {
                at.map(|at| Lower { at, axis, factor })
            };
            let plain = (0..3).filter_map(|axis| along(axis, 1.0, down(k, axis, 1)));
            // z times an index with z = 1 is minus those with two more along x and y.
            let turned = (0..2).filter_map(|axis| {
                let at = match k[2] {
                    0 if k[axis] > 1 => {
                        let mut lower = *k;
                        (lower[axis], lower[2]) = (k[axis] - 2, 1);
                        Some(place(lower))
                    }
                    _ => None,
                };
                along(2, -1.0, at)
            });
            out.monomial.push(plain.chain(turned));
            out.once.push((0..3).filter_map(|axis| {
                let factor = -(2.0 * m - 1.0) / m * k[axis] as f64;
                along(axis, factor, down(k, axis, 1))
            }));
            out.twice.push((0..3).filter_map(|axis| {
                let n = k[axis] as f64;
                let factor = -(m - 1.0) / m * n * (n - 1.0);
                along(axis, factor, down(k, axis, 2))
            }));
        }
        for d in 2..=last {
            let two = |j: usize| [place([d - j, j, 0]), place([d - 2 - j, j + 2, 0])];
            let all = (0..d - 1).map(|j| two(j).map(|at| at as u16));
            out.folds.extend(all);
        }
        let up =
            |k: &[usize; 3], l: &[usize; 3]| place([k[0] + l[0], k[1] + l[1], k[2] + l[2]]) as u16;
        for d in 1..degree {
            let left = degree - d;
            for k in &index[d * d..(d + 1) * (d + 1)] {
                let of = |l: &[[usize; 3]]| l.iter().map(|l| up(k, l)).collect::<Vec<_>>();
                out.sums.extend(of(&index[1..(left + 1) * (left + 1)]));
                out.shifts.extend(of(&index[..left * left]));
            }
            out.sums_from.push(out.sums.len());
            out.shifts_from.push(out.shifts.len());
        }
        let derivatives = (degree + 1) * (degree + 1);
        out.higher = (index[..derivatives].iter())
            .map(|k| [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(|e| up(k, &e)))
            .collect();
        out
    }

    /// Degrees of moments: without that of all charges together.
    #[inline(always)]
    pub(super) fn degrees(&self) -> std::ops::Range<usize> {
        1..self.degree
    }

    /// For the k of degree `d`, which stand one after the other: where each one's sums with all l from degree 1 up to the degree left stand.
    #[inline(always)]
    pub(super) fn sums(&self, d: usize) -> (Range<usize>, ChunksExact<'_, u16>) {
        let left = self.degree + 1 - d;
        let all = &self.sums[self.sums_from[d - 1]..self.sums_from[d]];
        (d * d..(d + 1) * (d + 1), all.chunks_exact(left * left - 1))
    }

    /// The same where those of degree `d` are shifted: with all l up to where the sum is still a moment.
    #[inline(always)]
    pub(super) fn shifts(&self, d: usize) -> (Range<usize>, ChunksExact<'_, u16>) {
        let left = self.degree - d;
        let all = &self.shifts[self.shifts_from[d - 1]..self.shifts_from[d]];
        (d * d..(d + 1) * (d + 1), all.chunks_exact(left * left))
    }

    /// Where the indices of derivatives up to the degree of products stand, z = 2 left out, or `one_more`, in their order.
    #[inline(always)]
    pub(super) fn derived(&self, one_more: bool) -> impl Iterator<Item = (usize, usize)> {
        let own = (self.degree + 1) * (self.degree + 1);
        let last = Behind::new(self.degree).last;
        let more = if one_more { 2 * self.degree + 3 } else { 0 };
        (0..own + more).map(move |n| (n, if n < own { n } else { last + n - own }))
    }

    /// Indices with z = 2 up to a degree, each with the two that it is minus the sum of.
    #[inline(always)]
    pub(super) fn folds(&self, degree: usize) -> impl Iterator<Item = (usize, [usize; 2])> {
        let behind = Behind::new(self.degree);
        (2..=degree).flat_map(move |d| {
            let all = self.folds[(d - 1) * (d - 2) / 2..d * (d - 1) / 2].iter();
            let both = |pair: &[u16; 2]| pair.map(usize::from);
            all.enumerate()
                .map(move |(i, pair)| (behind.of(d) + i, both(pair)))
        })
    }

    /// Highest degree of products of moments.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Number of moments, that of all charges together, which is zero, among them.
    pub fn moments(&self) -> usize {
        self.degree * self.degree
    }

    /// Number of derivatives of 1/r, the first of all, from which all follow that products of moments need ([`unfold`](super::unfold)).
    pub fn kept(&self) -> usize {
        (self.degree + 1) * (self.degree + 1)
    }

    /// Room for derivatives of 1/r up to one degree more, those with z = 2 among them.
    pub fn derivatives(&self) -> usize {
        (self.degree + 2) * (self.degree + 2) + self.folds.len()
    }

    /// (−1)^|k| of each multi-index.
    pub fn signs(&self) -> &[f64] {
        &self.sign
    }
}
