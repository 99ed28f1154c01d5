//! Multi-indices (i, j, k) of monomials and derivatives up to a degree, and which of them add up to which.

/// Highest degree: numbers of derivatives of one more fit into the indices, and the products of all into a few hundred kB.
pub const MOST: usize = 12;

/// The next lower of a multi-index along one axis: where it stands, and by how much its entry counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lower {
    pub at: usize,
    pub axis: usize,
    pub factor: f64,
}

/// Multi-indices in the order of their degree.
#[derive(Clone, Debug)]
pub struct Table {
    degree: usize,
    index: Vec<[usize; 3]>,
    /// Numbers of multi-indices of degrees under each.
    counts: Vec<usize>,
    /// Of the monomial aᵏ/k!: the one that it is a multiple of, by a factor times a coordinate.
    pub(super) monomial: Vec<Lower>,
    /// Of each derivative of 1/r those that it follows from: factors of coordinate times the next lower, and of those two lower.
    lowers: Vec<Lower>,
    /// Where those of each begin among `lowers`, and where those of two lower do.
    ways: Vec<[u32; 3]>,
    /// Of each k of degree d, for the l up to the degree left: where k + l stands, one after the other.
    sums: Vec<u16>,
    /// Where those of each begin.
    sums_from: Vec<u32>,
    /// Of each k the one lower along each axis.
    pub(super) lower: Vec<[Option<u16>; 3]>,
    /// Of each k the one higher along each axis; up to one degree less.
    pub(super) higher: Vec<[u16; 3]>,
    /// (−1)^|k|
    pub(super) sign: Vec<f64>,
}

impl Table {
    /// Moments up to `degree`, at most [`MOST`], and derivatives up to one more.
    pub fn new(degree: usize) -> Self {
        let degree = degree.min(MOST);
        let (mut index, mut counts) = (Vec::new(), vec![0]);
        for d in 0..=degree + 1 {
            for i in (0..=d).rev() {
                index.extend((0..=d - i).rev().map(|j| [i, j, d - i - j]));
            }
            counts.push(index.len());
        }
        let place = |k: [usize; 3]| -> usize {
            let d = k[0] + k[1] + k[2];
            let rest = d - k[0];
            counts[d] + rest * (rest + 1) / 2 + k[2]
        };
        let down = |k: &[usize; 3], axis: usize, by: usize| {
            let mut k = *k;
            k[axis] = k[axis].checked_sub(by)?;
            Some(place(k))
        };
        let size = |k: &[usize; 3]| k[0] + k[1] + k[2];
        let monomial = |k: &[usize; 3]| {
            let axis = (0..3).find(|a| k[*a] > 0).unwrap_or(0);
            Lower {
                at: down(k, axis, 1).unwrap_or(0),
                axis,
                factor: 1.0 / k[axis].max(1) as f64,
            }
        };
        let once = |k: &[usize; 3]| -> Vec<Lower> {
            let m = size(k).max(1) as f64;
            let of = |axis: usize| {
                let factor = -(2.0 * m - 1.0) / m * k[axis] as f64;
                down(k, axis, 1).map(|at| Lower { at, axis, factor })
            };
            (0..3).filter_map(of).collect()
        };
        let twice = |k: &[usize; 3]| -> Vec<Lower> {
            let m = size(k).max(1) as f64;
            let of = |axis: usize| {
                let n = k[axis] as f64;
                let factor = -(m - 1.0) / m * n * (n - 1.0);
                down(k, axis, 2).map(|at| Lower { at, axis, factor })
            };
            (0..3).filter_map(of).collect()
        };
        let up = |k: &[usize; 3], l: &[usize; 3]| place([k[0] + l[0], k[1] + l[1], k[2] + l[2]]);
        let moments = counts[degree + 1];
        let sums = |k: &[usize; 3]| -> Vec<u16> {
            let left = counts[degree + 1 - size(k)];
            index[..left].iter().map(|l| up(k, l) as u16).collect()
        };
        let (mut lowers, mut ways) = (Vec::new(), Vec::new());
        for k in &index {
            let first = lowers.len() as u32;
            lowers.extend(once(k));
            let middle = lowers.len() as u32;
            lowers.extend(twice(k));
            ways.push([first, middle, lowers.len() as u32]);
        }
        let (mut all_sums, mut sums_from) = (Vec::new(), vec![0]);
        for k in &index[..moments] {
            all_sums.extend(sums(k));
            sums_from.push(all_sums.len() as u32);
        }
        Self {
            monomial: index.iter().map(monomial).collect(),
            lowers,
            ways,
            sums: all_sums,
            sums_from,
            lower: (index.iter())
                .map(|k| [0, 1, 2].map(|axis| down(k, axis, 1).map(|at| at as u16)))
                .collect(),
            higher: (index[..moments].iter())
                .map(|k| [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(|e| up(k, &e) as u16))
                .collect(),
            sign: (index.iter())
                .map(|k| if size(k) % 2 == 0 { 1.0 } else { -1.0 })
                .collect(),
            degree,
            index,
            counts,
        }
    }

    #[inline(always)]
    pub(super) fn once(&self, n: usize) -> &[Lower] {
        &self.lowers[self.ways[n][0] as usize..self.ways[n][1] as usize]
    }

    #[inline(always)]
    pub(super) fn twice(&self, n: usize) -> &[Lower] {
        &self.lowers[self.ways[n][1] as usize..self.ways[n][2] as usize]
    }

    #[inline(always)]
    pub(super) fn sums(&self, k: usize) -> &[u16] {
        &self.sums[self.sums_from[k] as usize..self.sums_from[k + 1] as usize]
    }

    /// Highest degree of moments.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Number of moments.
    pub fn moments(&self) -> usize {
        self.counts[self.degree + 1]
    }

    /// Number of derivatives of 1/r up to the degree, and up to one more.
    pub fn derivatives(&self, one_more: bool) -> usize {
        self.counts[self.degree + 1 + usize::from(one_more)]
    }

    /// (−1)^|k| of each multi-index.
    pub fn signs(&self) -> &[f64] {
        &self.sign
    }

    /// The multi-indices, those of the moments first.
    pub fn index(&self) -> &[[usize; 3]] {
        &self.index
    }
}
