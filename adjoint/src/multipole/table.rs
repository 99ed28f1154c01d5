//! Multi-indices (i, j, z) of moments and derivatives up to a degree, and which of them add up to which.
//!
//! Potentials are harmonic: ∂z² is −∂x² − ∂y², so that of each degree d the 2d + 1 indices with z below two tell all others. Sums of two of them have a z up to
//! two; those with two stand behind the others.

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

/// Multi-indices in the order of their degree.
#[derive(Clone, Debug)]
pub struct Table {
    degree: usize,
    /// Of (a·∂)ᵈ/d!, the moments of a unit charge: d times each is Σ factor · coordinate · lower.
    pub(super) monomial: Lowers,
    /// Of each derivative of 1/r: factors of coordinate times the next lower, and of those two lower.
    pub(super) once: Lowers,
    pub(super) twice: Lowers,
    /// Of each k of degree d, for the l up to the degree left: where k + l stands, one after the other.
    sums: Vec<u16>,
    /// Where those of each degree begin.
    sums_from: Vec<usize>,
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
    /// Moments up to `degree`, at most [`MOST`], and derivatives up to one more.
    pub fn new(degree: usize) -> Self {
        let degree = degree.min(MOST);
        let size = |k: &[usize; 3]| k[0] + k[1] + k[2];
        let last = degree + 1;
        let behind = (last + 1) * (last + 1);
        let place = |k: [usize; 3]| -> usize {
            let d = size(&k);
            match k[2] {
                2 => behind + (d - 1) * (d - 2) / 2 + k[1],
                z => d * d + z * (d + 1) + k[1],
            }
        };
        let index: Vec<[usize; 3]> = (0..=last)
            .flat_map(|d| (0..2.min(d + 1)).map(move |z| (d, z)))
            .flat_map(|(d, z)| (0..=d - z).map(move |j| [d - z - j, j, z]))
            .collect();
        let moments = (degree + 1) * (degree + 1);
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
            folds: Vec::new(),
            higher: Vec::new(),
            sign: (index.iter())
                .map(|k| if size(k) % 2 == 0 { 1.0 } else { -1.0 })
                .collect(),
            inverse: index.iter().map(|k| 1.0 / size(k).max(1) as f64).collect(),
        };
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
        for d in 0..=degree {
            let left = degree + 1 - d;
            for k in &index[d * d..(d + 1) * (d + 1)] {
                let all = index[..left * left].iter().map(|l| up(k, l));
                out.sums.extend(all);
            }
            out.sums_from.push(out.sums.len());
        }
        out.higher = (index[..moments].iter())
            .map(|k| [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(|e| up(k, &e)))
            .collect();
        out
    }

    /// For the k of degree `d`, which stand one after the other: where each one's sums with all l up to the degree left stand.
    #[inline(always)]
    pub(super) fn sums(
        &self,
        d: usize,
    ) -> (std::ops::Range<usize>, std::slice::ChunksExact<'_, u16>) {
        let left = self.degree + 1 - d;
        let all = &self.sums[self.sums_from[d]..self.sums_from[d + 1]];
        (d * d..(d + 1) * (d + 1), all.chunks_exact(left * left))
    }

    /// Indices with z = 2 up to a degree, each with the two that it is minus the sum of.
    #[inline(always)]
    pub(super) fn folds(&self, degree: usize) -> impl Iterator<Item = (usize, [usize; 2])> {
        let behind = (self.degree + 2) * (self.degree + 2);
        let all = self.folds[..degree * degree.saturating_sub(1) / 2].iter();
        let both = |pair: &[u16; 2]| pair.map(usize::from);
        all.enumerate()
            .map(move |(i, pair)| (behind + i, both(pair)))
    }

    /// Highest degree of moments.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Number of moments.
    pub fn moments(&self) -> usize {
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
